"""What is loaded only when it is first used, so that programs start at once."""

import subprocess
import sys

import pytest

NUMERICAL = {"numba", "llvmlite", "cv2", "scipy"}
HEAVY = {
    *NUMERICAL,
    *("numpy", "shapely", "PIL", "svgelements", "tinycss2", "yaml", "rosbags"),
    *("grpc", "asyncio", "uvicorn", "pluggy", "pydantic_settings", "hypothesis"),
    *("sketchmatch.model", "sketchmatch.api", "sketchmatch.registry", "sketchmatch.pipeline"),
    *("sketchmatch.io", "sketchmatch.server", "sketchmatch_builtin", "sketchmatch_client"),
}
COMMAND = """
import sys
from sketchmatch.cli import main
sys.argv = ["sketchmatch", *{arguments!r}]
try:
    main()
except SystemExit as end:
    assert not end.code, end.code
"""


def loaded_by(code):
    """Return the names of all modules that a new process loads for some code."""
    report = "\nimport sys\nprint(*sys.modules, file=sys.stderr)"
    done = subprocess.run(
        [sys.executable, "-c", code + report], capture_output=True, text=True, check=True
    )
    return set(done.stderr.split())


def test_the_package_loads_nothing_but_itself():
    loaded = loaded_by("import sketchmatch")
    assert "sketchmatch" in loaded
    assert not loaded & {*HEAVY, "pydantic", "rich", "typer", "google.protobuf"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        ["--version"],
        ["match", "--help"],
        ["transfer", "--help"],
        ["carry", "--help"],
        ["serve", "--help"],
        ["plugins", "list", "--help"],
    ],
    ids=" ".join,
)
def test_help_loads_nothing_that_computes(arguments):
    loaded = loaded_by(COMMAND.format(arguments=arguments))
    assert "sketchmatch.cli.app" in loaded
    assert not loaded & HEAVY


def test_a_scene_needs_no_compiler_no_pictures_and_no_transport():
    loaded = loaded_by(
        "from sketchmatch import Scene\n"
        "Scene.from_polygons([[(0, 0), (1, 0), (1, 1)], [(2, 0), (3, 0), (3, 1)]])"
    )
    assert "shapely" in loaded
    assert not loaded & {*NUMERICAL, "PIL", "grpc", "google.protobuf", "pydantic", "rich"}


@pytest.mark.slow
def test_what_asks_a_server_does_not_compute():
    loaded = loaded_by("import sketchmatch.cli.answering, sketchmatch.cli.sources")
    assert not loaded & {*NUMERICAL, "sketchmatch_builtin"}
