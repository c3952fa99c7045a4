"""Objects of a robot's map that people mended, in a file beside it."""

import json
import re
import shutil

import numpy as np
import pytest

from sketchmatch import Scene, read_scene
from sketchmatch.cli.sources import source_of
from sketchmatch.errors import InvalidInputError
from sketchmatch.io import read_source
from sketchmatch.io.files import read_map_files
from sketchmatch.io.ros_map import decode_map_server
from sketchmatch.io.scene_files import save_scene
from sketchmatch_map_files import content_of, parse

HEADER = (
    "image: office.pgm\nresolution: 0.1\norigin: [-1, 2, 0]\nnegate: 0\n"
    "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
)
SAID = "the objects are from {} beside the map, unless a segmenter is chosen"


def picture(*boxes):
    """A walled room of 6 × 4 m with boxes (row, column, rows, columns) in it."""
    greys = np.full((40, 60), 254, np.uint8)
    greys[[0, -1]] = greys[:, [0, -1]] = 0
    for row, column, rows, columns in boxes:
        greys[row : row + rows, column : column + columns] = 0
    return b"P5\n60 40\n255\n" + greys.tobytes()


BOXES = ((5, 5, 6, 9), (5, 40, 5, 5), (25, 20, 8, 8))


@pytest.fixture
def office(tmp_path):
    path = tmp_path / "office.yaml"
    path.write_text(HEADER, encoding="utf-8")
    (tmp_path / "office.pgm").write_bytes(picture(*BOXES))
    return path


@pytest.fixture
def mended(office):
    """The map with its objects beside it, and what edits these."""
    beside = office.with_name("office.objects.geojson")
    save_scene(beside, read_scene(office), content=read_map_files(office).content)

    def edit(change):
        document = json.loads(beside.read_text(encoding="utf-8"))
        change(document["features"])
        beside.write_text(json.dumps(document), encoding="utf-8")

    return office, beside, edit


def feature(*corners, **properties):
    geometry = {"type": "Polygon", "coordinates": [[*corners, corners[0]]]}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def areas(scene: Scene):
    return [round(item.area, 6) for item in scene.objects]


def notes(path):
    return read_source(path).notes


def test_what_was_saved_beside_a_map_stands_for_it(mended):
    office, beside, _ = mended
    assert areas(read_scene(office)) == [0.54, 0.25, 0.64]
    assert notes(office) == (SAID.format(beside.name),)


def test_objects_are_dropped_named_added_split_and_merged(mended):
    office, _, edit = mended

    def change(features):
        features[0]["properties"]["label"] = "desk"
        second, third = features[1]["geometry"], features[2]["geometry"]
        merged = [second["coordinates"], third["coordinates"]]
        features[1]["geometry"] = {"type": "MultiPolygon", "coordinates": merged}
        features[2:] = [
            feature([0, 3], [1, 3], [1, 5], name="rug"),
            feature([3, 3], [4, 3], [3, 4]),
        ]

    edit(change)
    scene = read_scene(office)
    assert scene.labels == ("desk", "", "rug", "")
    hull = scene.objects[1].polygon
    assert hull.equals(hull.convex_hull)
    assert hull.bounds == pytest.approx((1.0, 2.7, 3.5, 5.5))
    assert areas(scene)[2:] == [1.0, 0.5]


def test_coordinates_are_metres_whatever_a_tool_says(mended):
    office, beside, _ = mended
    document = json.loads(beside.read_text(encoding="utf-8"))
    document["crs"] = {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}
    beside.write_text(json.dumps(document), encoding="utf-8")
    assert areas(read_scene(office)) == [0.54, 0.25, 0.64]


def test_certainties_are_kept(mended):
    office, _, edit = mended
    edit(lambda features: features[1]["properties"].update(certainty=0.25))
    assert [item.certainty for item in read_scene(office).objects] == [1.0, 0.25, 1.0]


def test_a_segmenter_that_is_chosen_goes_over_it(mended):
    office, _, edit = mended
    edit(lambda features: features.pop())
    assert len(read_scene(office)) == 2
    assert len(read_scene(office, segmenter="occupancy-grid")) == 3
    assert len(read_scene(office, params={"min_size": 0.6})) == 2
    assert areas(read_scene(office, params={"min_size": 0.6})) == [0.54, 0.64]


def test_that_of_another_content_is_said_and_ignored(mended):
    office, _, edit = mended
    edit(lambda features: features.pop())
    (office.parent / "office.pgm").write_bytes(picture(*BOXES, (30, 50, 4, 4)))
    assert len(read_scene(office)) == 4
    assert notes(office) == (
        "office.objects.geojson was made for an earlier state of the map and was ignored; replace "
        "it and all that is in it with `sketchmatch segment office.yaml --segmenter occupancy-grid "
        "--out office.objects.geojson`",
    )


def test_one_that_says_of_no_map_is_ignored(mended):
    office, _, edit = mended
    edit(lambda features: [each["properties"].pop("map") for each in features])
    assert "does not say for which state of the map" in notes(office)[0]
    content = re.search(r"add map=(sha256:[0-9a-f]{16})", notes(office)[0])[1]
    edit(lambda features: features[0]["properties"].update(map=content))
    assert notes(office) == (SAID.format("office.objects.geojson"),)


def test_one_that_a_caller_says_is_of_this_map_need_not_say_so_itself(office):
    text, picture = office.read_text(), office.with_suffix(".pgm").read_bytes()
    crate = feature([1, 1], [2, 1], [2, 2], [1, 2], label="crate")
    objects = json.dumps({"type": "FeatureCollection", "features": [crate]})
    ignored = decode_map_server(text, picture, objects)
    assert ignored.objects is None
    assert "an earlier state" in ignored.notes[-1]
    taken = decode_map_server(text, picture, objects, own_objects=True)
    assert [each.label for each in taken.objects.polygons] == ["crate"]
    assert not any("content" in note for note in taken.notes)


def test_one_feature_that_says_of_which_map_it_is_is_enough(mended):
    office, _, edit = mended
    edit(lambda features: [each["properties"].pop("map") for each in features[1:]])
    assert notes(office) == (SAID.format("office.objects.geojson"),)


def test_it_is_found_by_the_maps_content_under_another_name(mended):
    office, beside, edit = mended
    edit(lambda features: features.pop())
    for name in ("kitchen.yaml", "kitchen.pgm"):
        shutil.copy(office.with_name(f"office{name[7:]}"), office.with_name(name))
    kitchen = office.with_name("kitchen.yaml")
    kitchen.write_text(HEADER.replace("office.pgm", "kitchen.pgm"), encoding="utf-8")
    assert len(read_scene(kitchen)) == 2
    assert notes(kitchen) == (SAID.format(beside.name),)


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ("resolution: 0.1", "resolution: 0.10", True),
        ("office.pgm", "other.pgm", True),
        ("negate: 0", "negate: 0 # not inverted", True),
        ("resolution: 0.1", "resolution: 0.2", False),
        ("origin: [-1, 2, 0]", "origin: [-1, 2.5, 0]", False),
        ("free_thresh: 0.196", "free_thresh: 0.25", False),
    ],
)
def test_the_content_is_what_the_cells_are_and_where(old, new, same):
    contents = [content_of(parse(text), b"P5") for text in (HEADER, HEADER.replace(old, new))]
    assert (contents[0] == contents[1]) is same
    assert content_of(parse(HEADER), b"P6") != contents[0]


def test_what_cannot_be_read_is_told_with_its_place(mended):
    office, beside, edit = mended
    edit(lambda features: features[1]["geometry"].update(coordinates=[[[0, 0], [1]]]))
    with pytest.raises(InvalidInputError) as caught:
        read_source(office)
    place = "objects.features[1].geometry.coordinates[0][1]"
    assert caught.value.field == f"{office}: {place}"
    beside.write_text("{", encoding="utf-8")
    with pytest.raises(InvalidInputError, match=r"office\.yaml: objects is not JSON"):
        read_source(office)


def test_one_object_is_too_few_and_the_place_says_so(mended):
    office, _, edit = mended

    def drop(features):
        del features[1:]

    edit(drop)
    with pytest.raises(InvalidInputError, match=r"objects\.polygons holds one polygon"):
        read_scene(office)


def test_the_command_line_sends_it_along(mended):
    office, beside, _ = mended
    packed = source_of(office).map_server_map
    assert packed.objects == beside.read_text(encoding="utf-8")
    beside.unlink()
    assert source_of(office).map_server_map.objects == ""


def test_the_client_sends_it_along_with_a_warning(mended):
    from sketchmatch_client import sources

    office, beside, _ = mended
    with pytest.warns(UserWarning, match=r"the objects are from office\.objects\.geojson"):
        packed = sources.map_server_map(office)
    assert packed.map_server_map.objects == beside.read_text(encoding="utf-8")
