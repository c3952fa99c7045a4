"""Type checkers read the packages as they are installed."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.tools import ROOT

SCRIPT = Path(__file__).with_name("typed_script.py")
SOURCES = (ROOT / "engine", ROOT / "clients" / "python")


@pytest.mark.parametrize("package", ["sketchmatch", "sketchmatch_client", "sketchmatch_proto"])
def test_a_package_tells_that_it_has_types(package):
    assert Path(find_spec(package).origin).with_name("py.typed").exists()


@pytest.mark.slow
def test_a_script_with_the_public_names_passes_mypy_strict(tmp_path):
    done = subprocess.run(
        [
            *(sys.executable, "-m", "mypy", "--strict", "--config-file", ""),
            *("--follow-imports", "silent", "--cache-dir", tmp_path, SCRIPT.name),
        ],
        cwd=SCRIPT.parent,
        env={**os.environ, "MYPYPATH": os.pathsep.join(map(str, SOURCES))},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout.count("error")) == (0, 0), done.stdout + done.stderr
