"""``segment --out``: what was found is saved, and reads back as it was."""

import importlib.util
import json
import shutil

import numpy as np
import pytest
from google.protobuf.json_format import Parse

from sketchmatch import read_scene
from sketchmatch.cli.pictures import scene_of
from sketchmatch.examples import LIVING_ROOM_MAP
from sketchmatch.io import read_source
from sketchmatch_proto.v1.scene_service_pb2 import SegmentResponse
from tests import processes
from tests.bags import write
from tests.tools import require


@pytest.fixture(params=["in process", "server"])
def where(request, address):
    return ["--server", address] if request.param == "server" else []


@pytest.mark.slow
def test_what_was_found_is_saved_to_the_last_digit(command_line, where, tmp_path):
    saved, again = tmp_path / "scene.geojson", tmp_path / "again.geojson"
    done = command_line("segment", LIVING_ROOM_MAP, "--json", "--out", saved, *where)
    assert done.returncode == 0
    found = scene_of(Parse(done.stdout, SegmentResponse()).scene)
    read = read_scene(saved)
    assert read.labels == found.labels
    for a, b in zip(read.objects, found.objects, strict=True):
        for ring, other in zip(a.rings, b.rings, strict=True):
            assert np.array_equal(ring, other)
    assert command_line("segment", saved, "--out", again, *where).returncode == 0
    assert again.read_bytes() == saved.read_bytes()


@pytest.mark.parametrize(
    ("name", "words"),
    [("scene.json", "give a name that ends in .geojson"), ("no/s.geojson", "there is no folder")],
)
def test_other_endings_are_refused_before_the_work_starts(
    command_line, where, tmp_path, name, words
):
    done = command_line("segment", tmp_path / "missing.yaml", "--out", tmp_path / name, *where)
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith("sketchmatch: --out is ")
    assert words in line


def test_lines_and_overlay_come_beside_it(command_line, where, tmp_path):
    saved, picture = tmp_path / "scene.geojson", tmp_path / "scene.png"
    done = command_line("segment", LIVING_ROOM_MAP, "--out", saved, "--overlay", picture, *where)
    lines = done.stdout.splitlines()
    assert len(lines) >= len(json.loads(saved.read_text())["features"]) > 1
    assert picture.stat().st_size > 0


def test_a_map_lies_under_its_objects_however_it_is_given(command_line, tmp_path):
    for file in (LIVING_ROOM_MAP, LIVING_ROOM_MAP.with_suffix(".pgm")):
        shutil.copy(file, tmp_path)
    given = (tmp_path / LIVING_ROOM_MAP.name, tmp_path / "living_room.pgm", tmp_path)
    pictures = []
    for k, path in enumerate(given):
        picture = tmp_path / f"{k}.png"
        assert command_line("segment", path, "--overlay", picture).returncode == 0
        pictures.append(picture.read_bytes())
    assert pictures[1:] == pictures[:1] * 2


@pytest.mark.parametrize("name", ["a.jpg", "a.pgm", "rooms/a.png"])
def test_a_part_may_be_named_as_pictures_are(command_line, where, tmp_path, name):
    file = tmp_path / "instances.json"
    outlines = [(1, [0, 0, 4, 0, 4, 4]), (1, [9, 9, 13, 9, 13, 13]), (2, [0, 0, 8, 0, 8, 8])]
    coco = {
        "images": [{"id": 1, "file_name": name}, {"id": 2, "file_name": "b.jpg"}],
        "annotations": [{"image_id": k, "segmentation": [outline]} for k, outline in outlines],
    }
    file.write_text(json.dumps(coco))
    done = command_line("segment", f"{file}#{name}", *where)
    assert done.returncode == 0, done.stderr
    assert [line.split("\t")[3] for line in done.stdout.splitlines()[1:]] == ["8", "8"]
    assert [len(each.rings) for each in read_scene(f"{file}#{name}").objects] == [1, 1]


def test_a_bag_is_read_here_and_sent_to_a_server(command_line, where, tmp_path):
    require(importlib.util.find_spec("rosbags"), "rosbags (`pip install 'sketchmatch[rosbag]'`)")
    grid = read_source(LIVING_ROOM_MAP)
    cells = grid.cells.copy()
    bag = write(tmp_path, "mcap", ("/map", cells, 0.0))
    done = command_line("segment", f"{bag}#/map", "--overlay", tmp_path / "bag.png", *where)
    assert done.returncode == 0, done.stderr
    expected = command_line("segment", LIVING_ROOM_MAP, *where)
    assert len(done.stdout.splitlines()) == len(expected.stdout.splitlines())


# Limits -----------------------------------------------------------------------------------------


def test_the_environment_limits_files_in_process(command_line, monkeypatch):
    monkeypatch.setenv("SKETCHMATCH_LIMITS__MAX_PIXELS", "1000")
    done = command_line("segment", LIVING_ROOM_MAP)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert (
        "pixels, more than the limit of 1000 pixels; scale it down, or raise limits.max_pixels"
        in line
    )


@pytest.mark.parametrize("command", [["segment", LIVING_ROOM_MAP], ["serve"]])
def test_a_bad_value_in_the_environment_is_one_sentence(command_line, monkeypatch, command):
    monkeypatch.setenv("SKETCHMATCH_LIMITS__MAX_OBJECTS", "few")
    done = command_line(*command)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "sketchmatch: SKETCHMATCH_LIMITS__MAX_OBJECTS is 'few'; it should be a valid integer\n"
    )


@pytest.mark.slow
def test_serve_takes_its_limits_on_sources_from_options(command_line, tmp_path):
    with processes.server("--max-pixels", "1000", "--max-objects", "2") as running:
        done = command_line("segment", LIVING_ROOM_MAP, "--server", running.address)
        three = tmp_path / "three.geojson"
        rings = [[[x, 0], [x + 1, 0], [x, 1], [x, 0]] for x in (0, 3, 6)]
        shapes = [{"type": "Polygon", "coordinates": [ring]} for ring in rings]
        three.write_text(json.dumps({"type": "GeometryCollection", "geometries": shapes}))
        few = command_line("segment", three, "--server", running.address)
    assert (done.returncode, few.returncode) == (2, 2)
    assert "more than the limit of 1000 pixels" in done.stderr
    assert "has 3 objects, more than the limit of 2 objects" in few.stderr


FOREIGN = {
    "sketch.excalidraw": {
        "type": "excalidraw",
        "elements": [
            {"type": "rectangle", "id": "a", "x": 0, "y": 0, "width": 9, "height": 5},
            {"type": "text", "containerId": "a", "text": "writing\n\x1b[1mdesk", "x": 1, "y": 1},
            {"type": "ellipse", "id": "b", "x": 20, "y": 0, "width": 4, "height": 9},
            {"type": "arrow", "id": "c", "x": 0, "y": 0, "points": [[0, 0], [9, 9]]},
        ],
    },
    "labels.json": {
        "shapes": [
            {"label": "writing\ndesk", "points": [[0, 0], [9, 0], [9, 5], [0, 5]]},
            {"label": "", "shape_type": "rectangle", "points": [[20, 0], [24, 9]]},
            {"label": "door", "shape_type": "line", "points": [[0, 9], [5, 9]]},
        ]
    },
}


@pytest.mark.parametrize("name", FOREIGN)
def test_files_of_other_tools_are_read_by_whoever_answers(command_line, where, tmp_path, name):
    file = tmp_path / name
    file.write_text(json.dumps(FOREIGN[name]))
    done = command_line("segment", file, "--overlay", tmp_path / "x.png", *where)
    assert done.returncode == 0, done.stderr
    assert [line.split("\t")[:2] for line in done.stdout.splitlines()[1:]] == [
        ["0", "writing desk"],
        ["1", ""],
    ]
    assert done.stderr.count("sketchmatch: ") == 1
    assert (tmp_path / "x.png").stat().st_size > 0


PLAN = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 900 600">
<path fill="none" stroke="black" d="M0 0H900V600H0ZM0 300H900M400 0V300"/>
<text x="300" y="450">living room</text><text x="100" y="150">kitchen</text></svg>"""


def test_what_is_written_in_a_drawn_plan_names_its_rooms(command_line, where, tmp_path):
    plan, picture = tmp_path / "plan.svg", tmp_path / "plan.png"
    plan.write_text(PLAN, encoding="utf-8")
    options = ("--segmenter", "rooms", "--overlay", picture, *where)
    done = command_line("segment", plan, *options)
    assert done.returncode == 0, done.stderr
    assert [line.split("\t")[1] for line in done.stdout.splitlines()[1:]] == [
        "kitchen", "", "living room",
    ]  # fmt: skip
    assert picture.stat().st_size > 0


def test_a_fault_in_a_file_of_another_tool_begins_with_its_path(command_line, where, tmp_path):
    file = tmp_path / "labels.json"
    file.write_text('{"shapes": [{"points": 3}]}')
    done = command_line("segment", file, *where)
    words = "shapes[0].points is 3; give a list of [x, y]"
    assert (done.returncode, done.stderr) == (2, f"sketchmatch: {file}: {words}\n")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("a.json", "is JSON of an unknown kind (an object with 'walls'); known are strokes"),
        ("a.dwg", "is of an unknown kind; give a file whose name ends in one of .bag "),
        ("a.json#x", "is JSON of an unknown kind (an object with 'walls'"),
    ],
)
def test_of_a_file_that_nobody_reads_it_is_said_what_was_seen(
    command_line, where, tmp_path, name, words
):
    (tmp_path / name.partition("#")[0]).write_text('{"walls": []}')
    done = command_line("segment", tmp_path / name, *where)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"sketchmatch: {tmp_path / name} {words}" in done.stderr


def test_what_a_file_leaves_out_is_told(command_line, where, tmp_path):
    file = tmp_path / "room.geojson"
    ring = [[0, 0], [1, 0], [1, 1], [0, 0]]
    polygons = [{"type": "Polygon", "coordinates": [ring]}] * 2
    nowhere = {"type": "Feature", "geometry": None, "properties": {}}
    file.write_text("\n".join(json.dumps(each) for each in (*polygons, nowhere)))
    done = command_line("segment", file, *where)
    assert done.returncode == 0
    assert "[2] was left out: it has no place." in done.stderr


def test_a_map_is_mended_in_the_file_that_was_saved_beside_it(command_line, where, tmp_path):
    for path in LIVING_ROOM_MAP.parent.glob("living_room.*"):
        shutil.copy(path, tmp_path)
    room, beside = tmp_path / "living_room.yaml", tmp_path / "living_room.objects.geojson"
    assert command_line("segment", room, "--out", beside, *where).returncode == 0
    document = json.loads(beside.read_text(encoding="utf-8"))
    document["features"][2:4] = []
    document["features"][0]["properties"]["label"] = "mended"
    beside.write_text(json.dumps(document), encoding="utf-8")
    done = command_line("segment", room, *where)
    rows = [line.split("\t") for line in done.stdout.splitlines()[1:]]
    assert (len(rows), rows[0][1]) == (6, "mended")
    assert "the objects are from living_room.objects.geojson beside the map" in done.stderr
    anew = command_line("segment", room, "--segmenter", "occupancy-grid", *where)
    assert len(anew.stdout.splitlines()) == 9
    document["features"][0]["geometry"]["coordinates"] = [[[0, 0], [1, 1], [1, 0], [0, 1]]]
    beside.write_text(json.dumps(document), encoding="utf-8")
    wrong = command_line("segment", room, *where)
    assert wrong.returncode == 2
    assert "living_room.objects.geojson: polygons[0] crosses itself" in wrong.stderr


def test_what_people_say_of_another_content_is_never_replaced_unasked(command_line, tmp_path):
    map_, beside = tmp_path / "office.yaml", tmp_path / "office.objects.geojson"
    shutil.copy(LIVING_ROOM_MAP, map_)
    (picture,) = LIVING_ROOM_MAP.parent.glob(f"{LIVING_ROOM_MAP.stem}.p*")
    shutil.copy(picture, tmp_path / picture.name)
    save = ("segment", map_, "--out", beside)
    assert command_line(*save).returncode == 0
    assert command_line(*save).returncode == 0, "what is read for the map may be saved again"
    document = json.loads(beside.read_text(encoding="utf-8"))
    for feature in document["features"]:
        feature["properties"] |= {"label": "by hand", "map": "sha256:0000000000000000"}
    beside.write_text(json.dumps(document), encoding="utf-8")
    done = command_line(*save)
    assert done.returncode == 2
    assert "which was made for another state of the map and would be lost" in done.stderr
    assert "by hand" in beside.read_text(encoding="utf-8")
    assert command_line(*save, "--segmenter", "occupancy-grid").returncode == 0
    assert "by hand" not in beside.read_text(encoding="utf-8")
    beside.write_text("{", encoding="utf-8")
    done = command_line("segment", map_)
    assert f"{beside} is not JSON" in done.stderr


@pytest.mark.parametrize(
    ("option", "name"),
    [
        ("--out", "drawn.geojson"),
        ("--keepout", "map.yaml"),
        ("--keepout", "office.yaml"),
        ("--waypoints", "office.yaml"),
    ],
)
def test_what_is_carried_never_takes_the_place_of_what_is_read(
    command_line, tmp_path, option, name
):
    shades = np.full((60, 80), 254, np.uint8)
    for x, y, width, height in ((10, 10, 12, 8), (40, 15, 9, 20), (60, 40, 8, 8), (20, 40, 16, 6)):
        shades[y : y + height, x : x + width] = 0
    (tmp_path / "map.pgm").write_bytes(b"P5 80 60 255\n" + shades.tobytes())
    (tmp_path / "office.yaml").write_text(
        "image: map.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.2\n"
    )
    line = {"type": "LineString", "coordinates": [[1, 0.5], [3, 0.5]]}
    (tmp_path / "drawn.geojson").write_text(json.dumps(line))
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    given = [tmp_path / each for each in ("drawn.geojson", "office.yaml", "office.yaml")]
    done = command_line("carry", *given, option, tmp_path / name)
    assert done.returncode == 2
    assert "which is read here and would be lost" in done.stderr
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
