"""The engine works beside the oldest versions that it says it works with."""

import json
import re
import sys
import tomllib

import pytest

from tests.environment import environment, said_by
from tests.tools import ROOT

pytestmark = pytest.mark.slow

CLIENT = ROOT / "clients" / "python"
EXAMPLES = ROOT / "engine" / "sketchmatch" / "examples"
SKETCH, MAP = EXAMPLES / "living_room_sketch.svg", EXAMPLES / "living_room.yaml"

COMPILED = {
    *("grpcio", "numba", "numpy", "opencv-python-headless"),
    *("pillow", "pyyaml", "scikit-image", "shapely"),
}
"""Their oldest versions are built for the Pythons of their day alone."""


@pytest.fixture(scope="module")
def sketchmatch(tmp_path_factory):
    folder = tmp_path_factory.mktemp("oldest")
    wanted = ["--only-binary", ":all:", "--no-binary", "sketchmatch,sketchmatch-client"]
    programs = environment(folder, *wanted, str(CLIENT), str(ROOT), *oldest(), PIP_CONSTRAINT="")
    return lambda *words: said_by(programs / "sketchmatch", *words, NUMBA_CACHE_DIR=str(folder))


def oldest():
    """Return the oldest version allowed of each distribution, where there may be a wheel."""
    claimed = [
        re.match(r"([\w-]+)>=([\w.]+)$", each)
        for folder in (ROOT, CLIENT)
        for each in tomllib.loads((folder / "pyproject.toml").read_text())["project"][
            "dependencies"
        ]
    ]
    lowest = {
        found[1]: found[2] if "." in found[2] else f"{found[2]}.0" for found in claimed if found
    }
    assert {"numba", "protobuf", "typer", "pyyaml"} <= set(lowest)
    new = sys.version_info >= (3, 13)
    return [
        f"{name}=={lowest[name]}.*" for name in sorted(lowest) if not (new and name in COMPILED)
    ]


def test_matches_are_found_and_written_as_json(sketchmatch):
    found = json.loads("\n".join(sketchmatch("match", SKETCH, MAP, "--json")))
    assert found["objectMatches"][0]["sketchObject"] == 0
    compared = json.loads(
        "\n".join(sketchmatch("relate", SKETCH, MAP, "--json", "--limit", "9999"))
    )
    assert 0 in {each["sketchPair"]["first"] for each in compared["comparisons"]}


def test_a_server_answers(sketchmatch, tmp_path):
    assert sketchmatch("demo", "--overlay", tmp_path / "overlay.png")


def test_help_and_errors_are_told(sketchmatch):
    assert any("--overlay" in line for line in sketchmatch("match", "--help"))
    assert sketchmatch("config", "show")
