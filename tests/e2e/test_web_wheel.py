"""The built pad ships in the wheel, so that nobody who installs it needs Node.js."""

import subprocess
import sys
import zipfile

import pytest

from tests.tools import ROOT
from tests.web import built


@pytest.mark.slow
def test_the_wheel_holds_the_built_pad_and_the_places(tmp_path):
    built()
    build = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", tmp_path]
    done = subprocess.run([*build, ROOT], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (wheel,) = tmp_path.glob("sketchmatch-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        pad = [name for name in archive.namelist() if name.startswith("sketchmatch/server/pad/")]
        page = archive.read("sketchmatch/server/pad/index.html").decode()
    assert sum(name.endswith("map.yaml") for name in pad) == 5
    for kind in (".js", ".css"):
        assets = [name for name in pad if name.endswith(kind)]
        assert assets
        assert all(name.removeprefix("sketchmatch/server/pad/") in page for name in assets)
    assert "<script>" not in page
    assert "style=" not in page


def test_what_is_installed_for_the_build_is_known_by_its_hash_and_by_no_host():
    lock = (ROOT / "clients" / "package-lock.json").read_text(encoding="utf-8")
    assert "://" not in "".join(line for line in lock.splitlines() if '"resolved"' in line)
    assert lock.count('"integrity": "sha512-') > 100
