"""A match as rows, GeoJSON and a picture, in the client and beside the engine's."""

import json
import re
from copy import deepcopy
from xml.etree import ElementTree

import pytest

import sketchmatch
from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH
from sketchmatch.io.geojson import decode_geojson
from sketchmatch_client import Match, MatchCollector, MatchRow
from sketchmatch_proto.v1 import match_pb2
from sketchmatch_views import PAIR_COLOURS, Line, MatchView, Shape
from tests.contract.golden import golden

SVG = "{http://www.w3.org/2000/svg}"
UNKNOWN = dict.fromkeys(("probability", "margin", "relation", "reference_object"))
SQUARE = [(0, 0), (2, 0), (2, 2), (0, 2)]
WITH_HOLE = Shape([[(0, 0), (4, 0), (4, 4), (0, 4)], [(1, 1), (1, 2), (2, 2)]], (2, 2.5), "bar")


@pytest.fixture
def match() -> Match:
    collector = MatchCollector(None)
    for kind in ("accepted", "scenes", "progress", "result"):
        collector.add(deepcopy(golden(f"MatchResponse.{kind}")))
    return collector.match()


@pytest.fixture(scope="module")
def living_room():
    return sketchmatch.match(LIVING_ROOM_SKETCH, LIVING_ROOM_MAP)


def drawn(svg):
    """Return the areas and the texts of a picture."""
    root = ElementTree.fromstring(svg)
    return root.findall(f"{SVG}path"), [text.text for text in root.findall(f"{SVG}text")]


def test_a_row_has_what_is_known_of_an_object_and_its_partner(match):
    first, second = match.result.object_matches
    rows = match.rows()
    assert [row["sketch_object"] for row in rows] == [0, 1, 2]
    assert rows[1] == {
        "sketch_object": 1,
        "sketch_label": "desk",
        "map_object": 3,
        "map_label": "rack",
        "map_x": 15.0,
        "map_y": 5.0,
        "confidence": first.confidence,
        "probability": first.probability,
        "margin": first.margin,
        "relation": first.relation.phrase,
        "reference_object": first.relation.reference_object,
    }
    assert (rows[2]["map_object"], rows[2]["margin"]) == (0, second.margin)


def test_an_object_without_partner_has_a_row_too(match):
    row = match.rows()[0]
    assert row.pop("probability") == match.result.unmatched_sketch_probabilities[0] == 0.575
    assert row.pop("sketch_object") == 0
    assert row.pop("sketch_label") == "bed"
    assert row.pop("map_label") == ""
    assert set(row.values()) == {None}
    match.result.ClearField("unmatched_sketch_probabilities")
    assert match.rows()[0]["probability"] is None


def test_what_is_unknown_is_none_and_not_zero():
    line = match_pb2.ObjectMatch(sketch_object=1, map_object=2, confidence=0.5)
    bare = Match(
        match_pb2.MatchAccepted(),
        match_pb2.MatchScenes(),
        match_pb2.MatchResult(object_matches=[line]),
    )
    assert bare.rows() == [
        {
            **{"sketch_object": 1, "map_object": 2, "confidence": 0.5},
            **{"sketch_label": "", "map_label": "", "map_x": None, "map_y": None},
            **UNKNOWN,
        }
    ]
    (feature,) = bare.to_geojson()["features"]
    assert feature["geometry"] is None
    assert drawn(bare._view().svg())[0] == []


def test_the_keys_of_a_row_are_those_that_are_promised(match):
    assert {tuple(row) for row in match.rows()} == {tuple(MatchRow.__annotations__)}


def test_geojson_has_partners_where_they_are_on_the_map(match):
    found = match.to_geojson()
    assert (found["type"], found["crs"]) == ("FeatureCollection", None)
    lone, rack, *_ = found["features"]
    assert lone["geometry"] is None
    assert lone["properties"] == {"label": "bed", **match.rows()[0]}
    assert rack["properties"] == {"label": "rack", **match.rows()[1]}
    ring = [(point.x, point.y) for point in match.scenes.map.objects[3].rings[0].points]
    assert rack["geometry"] == {
        "type": "Polygon",
        "coordinates": [[list(point) for point in (*ring, ring[0])]],
    }


def test_geojson_has_every_mapped_object_once_and_is_read_as_a_map(match):
    found = match.to_geojson()
    mapped = [feature["properties"]["map_object"] for feature in found["features"]]
    assert sorted(each for each in mapped if each is not None) == [0, 1, 2, 3]
    read = decode_geojson(json.dumps(found)).polygons
    labels = {polygon.label: len(polygon.rings) for polygon in read}
    assert labels == {"table": 1, "bar": 2, "bunk": 1, "rack": 1}


def test_a_picture_has_every_object_with_partners_in_one_colour(match):
    match.result.ClearField("object_groups")
    paths, texts = drawn(match._view().svg())
    assert texts[0] == "sketch"
    assert {"0 bed", "1 desk", "2 shelf", "0 table", "1 bar", "2 bunk", "3 rack"} < set(texts)
    areas = [path for path in paths if path.get("fill") != "none"]
    colours = [path.get("fill") for path in areas]
    grey = "rgb(150,150,150)"
    assert [colours[0], *colours[4:6]] == [grey] * 3  # the bed, the bar and the bunk
    assert colours[1] == colours[6] == "rgb({},{},{})".format(*PAIR_COLOURS[0])
    assert colours[2] == colours[3] == "rgb({},{},{})".format(*PAIR_COLOURS[1])


def test_a_picture_has_what_is_one_together_in_one_colour(match):
    # The desk is the rack by a line of its own, as is the bar then; bed and bunk have no line.
    match.result.ClearField("object_groups")
    match.result.object_groups.add(sketch_objects=[1], map_objects=[3, 1])
    match.result.object_groups.add(sketch_objects=[0], map_objects=[2])
    paths, _ = drawn(match._view().svg())
    colours = [path.get("fill") for path in paths if path.get("fill") != "none"]
    desk, shelf, bed = (
        "rgb({},{},{})".format(*colour) for colour in PAIR_COLOURS[:2] + PAIR_COLOURS[3:4]
    )
    assert colours == [bed, desk, shelf, shelf, desk, bed, desk]


def test_a_picture_is_upright_and_fills_its_half():
    view = MatchView([Shape([SQUARE], (1, 1))], [Shape([[(0, 0), (4, 0), (0, 2)]], (1, 0.5))], [])
    (square, triangle), _ = drawn(view.svg())
    assert numbers(square) == [(12, 306), (288, 306), (288, 30), (12, 30)]
    assert numbers(triangle) == [(312, 237), (588, 237), (312, 99)]


def test_a_picture_shows_holes_the_route_and_no_more_points_than_can_be_told_apart():
    dense = Shape([[(k / 10_000, 0) for k in range(10_001)] + [(1, 1), (0, 1)]], (0, 0))
    paths, _ = drawn(MatchView([dense, WITH_HOLE], [], [], {}, [(0, 0), (4, 4)]).svg())
    assert [path.get("d").count("M") for path in paths] == [1, 2, 1]
    assert paths[1].get("fill-rule") == "evenodd"
    assert paths[2].get("stroke-dasharray")
    assert len(numbers(paths[0])) < 1000


def test_labels_are_text_and_long_ones_are_cut():
    shapes = [Shape([SQUARE], (1, 1), "<script>"), Shape([SQUARE], (1, 1), "x" * 99)]
    svg = MatchView(shapes, [], []).svg()
    assert "<script>" not in svg
    assert drawn(svg)[1] == ["sketch", "0 <script>", f"1 {'x' * 21}…", "map"]


def test_colours_begin_again_after_the_last():
    count = len(PAIR_COLOURS) + 1
    shapes = [Shape([SQUARE], (1, 1))] * count
    paths, _ = drawn(MatchView(shapes, shapes, [Line(k, k, 1.0) for k in range(count)]).svg())
    fills = [path.get("fill") for path in paths]
    assert fills[0] == fills[count - 1] != fills[1]


def test_the_engine_shows_the_same(living_room):
    rows = living_room.rows()
    assert {row["sketch_object"]: row["map_object"] for row in rows} == living_room.object_map
    for row, line in zip(rows, living_room.matches, strict=True):
        thing = living_room.map.objects[line.map_object]
        assert (row["map_label"], (row["map_x"], row["map_y"])) == (thing.label, thing.centroid)
        assert (row["confidence"], row["margin"]) == (line.confidence, line.margin)
        assert (row["probability"], row["relation"]) == (line.probability, line.relation.phrase)
        assert row["reference_object"] == line.relation.reference_object
    assert json.loads(json.dumps(rows)) == rows
    read = decode_geojson(json.dumps(living_room.to_geojson())).polygons
    assert len(read) == len(living_room.map)
    picture, _, table = living_room._repr_html_().partition("</svg>")
    assert len(drawn(f"{picture}</svg>")[0]) == len(living_room.sketch) + len(living_room.map)
    assert table.startswith("<p>")


def numbers(path):
    found = re.findall(r"([\d.]+) ([\d.]+)", path.get("d"))
    return [(float(x), float(y)) for x, y in found]
