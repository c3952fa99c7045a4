"""The door for every kind of file."""

import json
import re
import subprocess
import sys

import pytest

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io import files, read_source
from sketchmatch.io.files import file_and_part, kind_of_file, read_here
from sketchmatch.model import PolygonSet, StrokeSet


def refused(path):
    with pytest.raises(InvalidInputError) as caught:
        read_source(path)
    return caught.value


def test_a_missing_file_is_named(tmp_path):
    error = refused(tmp_path / "none.svg")
    assert str(error) == f"{tmp_path / 'none.svg'} does not exist; check the path"
    assert error.reason == Reason.INVALID_FILE


def test_a_directory_is_named(tmp_path):
    (tmp_path / "maps.yaml").mkdir()
    error = refused(tmp_path / "maps.yaml")
    remedy = "is a folder without a map; give the .yaml that map_server saved"
    assert str(error) == f"{tmp_path / 'maps.yaml'} {remedy}"


@pytest.mark.parametrize("name", ["sketch.dwg", "sketch", ".svg"])
def test_an_unknown_kind_lists_the_known_ones(tmp_path, name):
    (tmp_path / name).write_text("?")
    error = refused(tmp_path / name)
    assert error.reason == Reason.INVALID_FILE
    assert "is of an unknown kind; give a file whose name ends in one of .bag .bmp" in error.problem


def test_a_path_that_the_system_refuses_is_named():
    assert "cannot be read (file name too long)" in refused("x" * 5000 + ".svg").problem


@pytest.mark.parametrize("name", ["/dev/zero", "/dev/null"])
def test_a_device_is_not_read(tmp_path, name):
    (tmp_path / "endless.png").symlink_to(name)
    assert "is not a regular file" in refused(tmp_path / "endless.png").problem


def test_a_path_with_a_null_is_named():
    assert "; " in refused("a\0b.svg").problem


def test_contents_at_fault_are_named_after_the_path(tmp_path):
    path = tmp_path / "sketch.json"
    path.write_text('{"strokes": [{"points": [[0, 0], [1, null]]}]}')
    expected = f"{path}: strokes[0].points[1][1] is missing; give a finite number"
    assert str(refused(path)) == expected


def test_a_part_follows_the_name_of_a_file_that_is_there(tmp_path):
    path = tmp_path / "a#b.excalidraw"
    path.touch()
    assert file_and_part(path) == (path, "")
    assert file_and_part(tmp_path / "a#b.excalidraw#hall #2") == (path, "hall #2")
    assert file_and_part(tmp_path / "none.dxf#x") == (tmp_path / "none.dxf#x", "")


@pytest.mark.parametrize("name", ["x.svg", "x.json", "x.png", "x.yaml"])
def test_a_file_without_parts_has_none_to_choose(tmp_path, name):
    (tmp_path / name).write_text('{"strokes": []}')
    assert (
        "has no parts of which 'x' could be one; leave out '#'"
        in refused(tmp_path / f"{name}#x").problem
    )


@pytest.mark.parametrize(
    ("text", "seen"),
    [
        ("{}", "is JSON of an unknown kind (an empty object); known are strokes as"),
        ('{"b": 1, "a": 2}', "is JSON of an unknown kind (an object with 'b', 'a')"),
        ('{"type": "Topology", "arcs": []}', "with 'type', 'arcs' and type 'Topology');"),
        ("[]", "is JSON of an unknown kind (a list of 0);"),
        ("[[1]]", "is JSON of an unknown kind (a list of 1);"),
        ('[{"x": 1}, 2]', "of an unknown kind (a list of 2, the first an object with 'x');"),
        ("3", "is JSON of an unknown kind (3);"),
        ('"\\ud800"', "is JSON of an unknown kind ('\\ud800');"),
    ],
)
def test_of_json_of_no_known_kind_it_is_said_what_was_seen_and_what_is_known(tmp_path, text, seen):
    (tmp_path / "x.json").write_text(text)
    problem = refused(tmp_path / "x.json").problem
    assert seen in problem
    assert "GeoJSON with its type; coco with 'images', 'annotations'; excalidraw with" in problem


def test_many_keys_are_not_all_shown(tmp_path):
    (tmp_path / "x.json").write_text(json.dumps({f"key {k}": 0 for k in range(50)}))
    problem = refused(tmp_path / "x.json").problem
    assert "'key 5' and 44 more); known are" in problem


@pytest.mark.parametrize(
    ("name", "text", "kind"),
    [
        ("a.json", '{"type": "FeatureCollection", "features": []}', PolygonSet),
        ("a.geojson", '{"strokes": []}', StrokeSet),
        ("a.json", '{"shapes": []}', PolygonSet),
        ("a.ndjson", '{"type": "Polygon", "coordinates": []}\n' * 2, PolygonSet),
    ],
)
def test_json_is_known_by_what_is_in_it(name, text, kind):
    assert kind_of_file(name, text.encode()).source is kind


STROKES = '{"strokes": [{"points": [[0, 0], [4, 0], [4, 3], [0, 3]]}]}'


def test_a_sketch_is_read_and_parsed_once_where_it_needs_no_plugin(tmp_path, monkeypatch):
    path, parsed = tmp_path / "sketch.json", []
    path.write_text(STROKES)
    load = files.load_sequence
    monkeypatch.setattr(files, "load_sequence", lambda text: parsed.append(text) or load(text))
    assert read_here(path).strokes[0].points.tolist() == [[0, 0], [4, 0], [4, 3], [0, 3]]
    assert parsed == [STROKES]


@pytest.mark.parametrize(
    ("name", "text"),
    [("a.json", '{"shapes": []}'), ("a.json", "{}"), ("a.json", "["), ("a.dxf", ""), ("a.x", "")],
)
def test_what_a_plugin_may_read_is_not_read_here(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    assert read_here(tmp_path / name) is None


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("none.json", "does not exist"),
        ("none.svg", "does not exist"),
        ("bad.json", "strokes[0].points[1][1] is missing"),
        ("good.json#x", "has no parts of which 'x' could be one"),
    ],
)
def test_what_is_read_here_is_refused_as_by_the_one_door(tmp_path, name, problem):
    (tmp_path / "bad.json").write_text('{"strokes": [{"points": [[0, 0], [1, null]]}]}')
    (tmp_path / "good.json").write_text(STROKES)
    with pytest.raises(InvalidInputError, match=re.escape(problem)) as caught:
        read_here(tmp_path / name)
    assert str(caught.value) == str(refused(tmp_path / name))


def test_slow_libraries_wait_until_a_file_needs_them():
    script = (
        "import sys, sketchmatch.io; print([name for name in"
        " ('cv2', 'PIL', 'svgelements', 'yaml', 'grpc') if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"
