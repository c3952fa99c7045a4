"""Polygons as GeoJSON."""

import json

import pytest

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io import read_source
from sketchmatch.io.geojson import decode_geojson
from sketchmatch.model import PolygonSet

SQUARE = [[[0, 0], [4, 0], [4, 4], [0, 4], [0, 0]]]
WITH_HOLE = [*SQUARE, [[1, 1], [1, 2], [2, 2], [2, 1], [1, 1]]]


def polygon(coordinates=SQUARE):
    return {"type": "Polygon", "coordinates": coordinates}


def feature(geometry, **properties):
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def decode(document):
    return decode_geojson(json.dumps(document)).polygons


def test_features_give_one_polygon_each_with_its_label():
    found = decode(
        {
            "type": "FeatureCollection",
            "features": [
                feature(polygon(), label="desk", name="other"),
                feature(polygon(WITH_HOLE), name="ring"),
                feature(polygon()),
                {"type": "Feature", "geometry": polygon(), "properties": None},
            ],
        }
    )
    assert [item.label for item in found] == ["desk", "ring", "", ""]
    assert [len(item.rings) for item in found] == [1, 2, 1, 1]
    assert found[1].rings[1].tolist() == WITH_HOLE[1]


def test_collections_and_multipolygons_are_taken_apart():
    several = {"type": "MultiPolygon", "coordinates": [SQUARE, WITH_HOLE]}
    collection = {"type": "GeometryCollection", "geometries": [several, polygon()]}
    found = decode(feature(collection, label="chairs"))
    assert [item.label for item in found] == ["chairs"] * 3
    assert [len(item.rings) for item in found] == [1, 2, 1]


def test_heights_are_ignored():
    assert decode(polygon([[[0, 0, 9], [1, 0, 9], [1, 1, 9]]]))[0].rings[0].shape == (3, 2)


def features(*geometries):
    return {"type": "FeatureCollection", "features": [feature(g) for g in geometries]}


WRONG = {
    "a line": (
        features(polygon(), {"type": "LineString", "coordinates": [[0, 0], [1, 1]]}),
        "features[1].geometry.type",
        'is "LineString"; give Polygon or MultiPolygon',
    ),
    "no geometry": (
        features(None),
        "features[0].geometry",
        "is missing; give a GeoJSON object",
    ),
    "a word for a number": (
        features(polygon(), polygon(), polygon(), polygon([[[0, 0], [1, 0], ["a", 1]]])),
        "features[3].geometry.coordinates[0][2][0]",
        'is "a"; give a finite number',
    ),
    "not a number": (
        polygon([[[0, 0], [1, 0], [float("nan"), 1]]]),
        "coordinates[0][2][0]",
        "is NaN; give a finite number",
    ),
    "too few levels": (
        polygon([[0, 0], [1, 0], [1, 1]]),
        "coordinates[0][0]",
        "is 0; give a position [x, y]",
    ),
    "one coordinate": (polygon([[[0], [1], [1]]]), "coordinates[0][0]", "give a position [x, y]"),
    "coordinates missing": ({"type": "Polygon"}, "coordinates", "is missing; give a list of rings"),
    "features missing": ({"type": "FeatureCollection"}, "features", "give a list of features"),
    "a multipolygon of rings": (
        {"type": "MultiPolygon", "coordinates": SQUARE},
        "coordinates[0][0][0]",
        "is 0; give a position [x, y]",
    ),
    "no type": ({}, "type", "is missing; give Polygon"),
    "a list": ([], "", "is a list of 0; give a GeoJSON object"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_fault_is_named_with_its_path_and_the_remedy(case):
    document, field, words = WRONG[case]
    with pytest.raises(InvalidInputError) as caught:
        decode(document)
    assert caught.value.field == field
    assert caught.value.reason == Reason.INVALID_POLYGON
    assert words in caught.value.problem


def test_deep_nesting_is_refused():
    with pytest.raises(InvalidInputError, match="nested too deeply"):
        decode_geojson('{"type":"GeometryCollection","geometries":[' * 50_000)
    deep = '{"type":"GeometryCollection","geometries":[' * 600 + json.dumps(polygon()) + "]}" * 600
    with pytest.raises(InvalidInputError, match="nested too deeply"):
        decode_geojson(deep)


def test_a_file_is_read_by_its_suffix(tmp_path):
    path = tmp_path / "room.geojson"
    path.write_text(json.dumps(features(polygon(), polygon())))
    source = read_source(path)
    assert isinstance(source, PolygonSet)
    assert len(source.polygons) == 2
