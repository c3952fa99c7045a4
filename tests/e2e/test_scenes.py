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
    assert scenes("scenes delete", labelled[:9]).stdout.strip() == labelled
    assert labelled not in scenes("scenes list").stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "arguments", "said"),
    [
        (
            "scenes show",
            ["ff"],
            "'ff' is not the beginning of a scene's name; `sketchmatch scenes list` shows",
        ),
        ("scenes delete", ["f" * 64], f"name is {'f' * 64}, but you have stored no scene"),
        ("scenes label", ["ff", "desk"], "'desk' is not of the form NUMBER=LABEL; number objects"),
        ("scenes label", ["ff", "0=desk"], "'0=desk' is not of the form"),
        ("scenes put", ["missing.yaml"], "missing.yaml"),
        ("match", [LIVING_ROOM_SKETCH, "scene:"], "'' is not the name of a scene"),
    ],
)
def test_what_is_of_no_use_is_said_in_one_line(scenes, command, arguments, said):
    done = scenes(command, *arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert said in line


@pytest.mark.slow
def test_objects_are_counted_from_1_where_there_is_none_of_the_number(scenes):
    name = scenes("scenes put", LIVING_ROOM_MAP).stdout.strip()
    done = scenes("scenes label", name, "1=desk", "9=lamp")
    assert (done.returncode, done.stdout) == (2, "")
    assert "'9=' names object 9, but the scene has objects 1 to 8" in done.stderr


@pytest.mark.slow
def test_a_stored_map_takes_what_is_carried_as_its_file_does(scenes, tmp_path):
    drawn = tmp_path / "drawn.geojson"
    way = {"type": "LineString", "coordinates": [[120, -150], [300, -220], [420, -180]]}
    drawn.write_text(json.dumps({"type": "Feature", "properties": {}, "geometry": way}))
    zone = {"type": "Polygon", "coordinates": [[[1, 1], [2, 1], [2, 2], [1, 1]]]}
    zones = tmp_path / "zones.geojson"
    zones.write_text(json.dumps({"type": "Feature", "properties": {}, "geometry": zone}))
    stored = f"scene:{scenes('scenes put', LIVING_ROOM_MAP).stdout.strip()[:12]}"
    picture = tmp_path / "carried.png"
    done = scenes("transfer --radius 0.3", LIVING_ROOM_SKETCH, stored, drawn, "--overlay", picture)
    plain = scenes("transfer --radius 0.3", LIVING_ROOM_SKETCH, LIVING_ROOM_MAP, drawn)
    assert (done.returncode, done.stdout) == (0, plain.stdout)
    assert picture.stat().st_size > 10_000
    moved = scenes("carry", zones, stored, LIVING_ROOM_MAP)
    assert moved.returncode == 0
    assert "zone" in moved.stdout


@pytest.mark.slow
def test_a_stored_scene_without_a_server_is_refused():
    done = sketchmatch("match", LIVING_ROOM_SKETCH, "scene:ab")
    assert done.returncode == 2
    assert "'scene:ab' is a scene on a server, but no server is given; add --server" in done.stderr
