"""Environments of a test's own, with what pip installs."""

import os
import subprocess
import sys
from pathlib import Path

from tests.shell import NO_INDEX
from tests.tools import require


def environment(folder: Path, *wanted: str, **variables: str) -> Path:
    """Make an environment with some distributions, and return the folder of its programs."""
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    programs = folder / "bin"
    if wanted:
        said_by(programs / "pip", "install", "--quiet", *wanted, **variables)
    return programs


def said_by(*command: str | Path, cwd: Path | None = None, **variables: str) -> list[str]:
    """Run a command with nothing of our own Python about it, and return the lines it prints.

    The test is skipped, but not in CI, where the command finds no package index.
    """
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        list(map(str, command)),
        cwd=cwd,
        env={**kept, **variables},
        capture_output=True,
        text=True,
        check=False,
        timeout=550,
    )
    require(not NO_INDEX.search(done.stderr), "a package index that pip reaches")
    assert done.returncode == 0, f"{command}\n{done.stdout[-4000:]}\n{done.stderr[-4000:]}"
    return done.stdout.splitlines()
