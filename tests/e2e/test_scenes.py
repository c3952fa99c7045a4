"""``sketchmatch scenes``, and a stored scene in the place of a file."""

import json

import pytest

from sketchmatch.app.setup import RequestLimits, Setup
from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH
from sketchmatch.pipeline.engine import Engine
from sketchmatch.registry import default_registry
from tests.processes import sketchmatch
from tests.server.harness import hosting


@pytest.fixture(scope="module")
def scenes(tmp_path_factory):
    """Run a command about scenes on a server."""
    setup = Setup(Engine(default_registry()), RequestLimits())
    with hosting(setup, store=tmp_path_factory.mktemp("state") / "store") as host:

        def run(command, *arguments):
            return sketchmatch(*command.split(), *arguments, "--server", host.address)

        yield run


@pytest.mark.slow
def test_a_map_is_put_labelled_and_matched_with_by_its_name(scenes):
    name = scenes("scenes put", LIVING_ROOM_MAP).stdout.strip()
    assert len(name) == 64
    labelled = scenes("scenes label", name[:9], "2=the desk", "1=").stdout.strip()
    listed = [line.split("\t") for line in scenes("scenes list").stdout.splitlines()]
    assert [(each[0], each[1], each[3]) for each in listed] == [
        (labelled, "8", "the desk"),
        (name, "8", ""),
    ]
    found = scenes("match --json", LIVING_ROOM_SKETCH, f"scene:{labelled[:9]}")
    lines = json.loads(found.stdout)["objectMatches"]
    assert "the desk" in [line.get("mapLabel") for line in lines]
    assert "\t" in scenes("scenes show", labelled).stdout
    assert scenes("scenes delete", labelled).returncode == 0
    assert labelled not in scenes("scenes list").stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "arguments", "said"),
    [
        ("scenes show", ["ff"], "'ff' begins no name of a scene; `sketchmatch scenes list` shows"),
        ("scenes delete", ["f" * 64], f"name is {'f' * 64}, and you keep no scene of this name"),
        ("scenes label", ["ff", "desk"], "'desk' is no label of an object; give its number"),
        ("scenes label", ["ff", "0=desk"], "'0=desk' is no label of an object"),
        ("scenes put", ["missing.yaml"], "missing.yaml"),
    ],
)
def test_what_is_of_no_use_is_said_in_one_line(scenes, command, arguments, said):
    done = scenes(command, *arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert said in line


@pytest.mark.slow
def test_a_stored_scene_without_a_server_is_refused():
    done = sketchmatch("match", LIVING_ROOM_SKETCH, "scene:ab")
    assert done.returncode == 2
    assert "'scene:ab' is kept by a server, and none is asked; give --server" in done.stderr
