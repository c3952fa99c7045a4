"""The tutorial of CONTRIBUTING, step by step in a clean environment, and the plugin it is about."""

import ast
import json
import re
import zipfile

import pytest

from tests.processes import free_port
from tests.shell import steps
from tests.tools import ROOT

# An environment is made and kernels are compiled in it.
pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]

EXAMPLE = ROOT / "plugins" / "sketchmatch-example-searcher"
TUTORIAL = re.search(
    r"^## Adding an algorithm\n(.*?)(?=^## )",
    (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"),
    re.S | re.M,
)[1]
_, *BLOCKS = re.findall(r"^```(console|python|toml)\n(.*?)^```", TUTORIAL, re.S | re.M)
MATCH = "sketchmatch match living_room_sketch.svg living_room.yaml --searcher annealing --json"


@pytest.fixture(scope="module")
def followed(clean_shell):
    """Return the shell of a reader who has followed all steps."""
    port = str(free_port())
    for language, text in BLOCKS:
        if language == "console":
            for step in steps(text.replace("50051", port)):
                clean_shell.follow(step)
        elif name := re.match(r"# (\S+)\n", text):
            (clean_shell.folder / name[1]).write_text(text, encoding="utf-8")
    return clean_shell


@pytest.mark.usefixtures("followed")
def test_every_step_does_what_the_tutorial_says():
    commands = "".join(text for language, text in BLOCKS if language == "console")
    for word in ("plugins new", "plugins list", "pytest", "serve", "--server", "config", "wheel"):
        assert word in commands


def test_the_catalogue_says_where_the_plugin_comes_from(followed):
    found = json.loads("\n".join(followed.run("sketchmatch plugins list --json")))
    (item,) = [item for item in found["algorithms"] if item["name"] == "annealing"]
    assert item["kind"] == "ALGORITHM_KIND_SEARCHER"
    assert item["distribution"] == "sketchmatch-example-searcher"
    assert item["distributionVersion"] == "0.1.0"
    assert {"sweeps", "hottest", "coldest"} < set(item["parametersSchema"]["properties"])
    (plugin,) = [p for p in found["plugins"] if p["distribution"] == "sketchmatch-example-searcher"]
    assert plugin["state"] == "PLUGIN_STATE_ACTIVE"


def test_a_server_answers_as_the_process_does(followed):
    port = free_port()
    (serve,) = steps(f"$ sketchmatch serve --address 127.0.0.1:{port} &\nsketchmatch: serving")
    followed.follow(serve)
    command = f"{MATCH} --seed 3 --set searcher.runs=2"
    lines = followed.run(f"{command} --server 127.0.0.1:{port}")
    told = [line for line in lines if " INFO " not in line]  # the server's log, in the same shell
    asked = json.loads("\n".join(told))
    alone = json.loads("\n".join(followed.run(command)))
    followed.run("kill %1 && wait")
    for part in ("objectMatches", "fmapEntries", "fmapConfidence", "outcome"):
        assert asked[part] == alone[part], part


def test_the_wheel_holds_the_package_and_nothing_else(followed):
    (wheel,) = (followed.folder / "dist").glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
        (points,) = [name for name in archive.namelist() if name.endswith("entry_points.txt")]
        assert "[sketchmatch]\nexample-searcher = sketchmatch_example_searcher" in (
            archive.read(points).decode()
        )
    package = "sketchmatch_example_searcher"
    assert names == {f"{package}/{name}" for name in ("__init__.py", "annealing.py", "py.typed")}


def test_the_tutorial_quotes_the_entry_point_as_it_is():
    project = (EXAMPLE / "pyproject.toml").read_text(encoding="utf-8")
    quoted = [text for language, text in BLOCKS if language == "toml" and text[:2] != "# "]
    assert quoted
    for text in quoted:
        assert text in project


@pytest.mark.parametrize("path", sorted(EXAMPLE.rglob("*.py")), ids=lambda path: path.name)
def test_the_plugin_imports_of_the_engine_only_what_a_plugin_may(path):
    allowed = {"api", "model"} | ({"testing"} if "tests" in path.parts else set())
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = [item.name for item in getattr(node, "names", [])]
        if isinstance(node, ast.ImportFrom):
            whole = node.module == "sketchmatch"
            names = [f"sketchmatch.{name}" for name in names] if whole else [node.module]
        for name in names if isinstance(node, ast.Import | ast.ImportFrom) else ():
            package, _, rest = name.partition(".")
            assert package != "sketchmatch" or rest.split(".")[0] in allowed, name
