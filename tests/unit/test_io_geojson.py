"""Polygons as GeoJSON."""

import json

import numpy as np
import pytest

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io import read_source
from sketchmatch.io.degrees import from_metres
from sketchmatch.io.geojson import decode_geojson, polygons_of
from sketchmatch.io.scene_files import encode_geojson
from sketchmatch.model import PolygonSet, Scene

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
    "another geometry": (
        features(polygon(), {"type": "CurvePolygon", "coordinates": []}),
        "features[1].geometry.type",
        'is "CurvePolygon", which GeoJSON does not have; give Polygon or MultiPolygon',
    ),
    "no geometry": (
        {"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {}}]},
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


def test_features_without_a_place_are_left_out_with_a_note():
    nowhere = [None, {"type": "MultiPolygon", "coordinates": []}]
    found = decode_geojson(json.dumps(features(polygon(), *nowhere, polygon())))
    assert len(found.polygons) == 2
    assert found.notes == ("features[1] and 1 more were left out: they have no place.",)


def test_points_and_open_lines_are_left_out_and_closed_lines_are_outlines():
    found = decode_geojson(
        json.dumps(
            features(
                polygon(),
                {"type": "Point", "coordinates": [1, 1]},
                {"type": "LineString", "coordinates": [[0, 0], [6, 0]]},
                {"type": "LineString", "coordinates": SQUARE[0]},
                {"type": "LineString", "coordinates": [[0, 0], [6, 0], [0, 0]]},
            )
        )
    )
    assert [item.rings[0].tolist() for item in found.polygons] == [SQUARE[0], SQUARE[0]]
    assert found.notes == (
        "features[1].geometry was left out: points enclose no area.",
        "features[2].geometry and 1 more were left out: open lines enclose no area.",
        "features[3].geometry is a closed line, taken as the outline of an object.",
    )


def test_labels_are_texts_numbers_and_truths_and_else_the_id():
    one = {"type": "Feature", "geometry": polygon()}
    found = decode(
        {
            "type": "FeatureCollection",
            "features": [
                {**one, "properties": {"label": 0, "name": "other"}},
                {**one, "properties": {"label": None, "name": True}},
                {**one, "properties": {"label": [], "name": {}}, "id": "desk"},
                {**one, "properties": {"name": 1.5}, "id": 7},
                {**one, "properties": None, "id": 7},
            ],
        }
    )
    assert [item.label for item in found] == ["0", "true", "desk", "1.5", "7"]


@pytest.mark.parametrize(
    "text", ["{0}\n{1}\n", "{0}\r\n\n{1}", "\x1e{0}\n\x1e{1}\n", "[{0},\n{1}]"]
)
def test_several_texts_are_read_like_a_collection(text):
    first, second = json.dumps(feature(polygon(), name="a")), json.dumps(polygon(WITH_HOLE))
    found = decode_geojson(text.replace("{0}", first).replace("{1}", second)).polygons
    assert [(item.label, len(item.rings)) for item in found] == [("a", 1), ("", 2)]


def test_a_fault_in_one_of_several_texts_is_found_in_that_one():
    good = json.dumps(polygon())
    with pytest.raises(InvalidInputError, match=r"^\[1\] is not JSON"):
        decode_geojson(f"{good}\n{{\n")
    with pytest.raises(InvalidInputError, match=r"^\[1\]\.coordinates is missing"):
        decode_geojson(f'{good}\n{{"type": "Polygon"}}')


def test_degrees_become_metres_where_they_are_meant():
    corners = [[11.0, 60.0], [11.0001, 60.0], [11.0001, 60.0001], [11.0, 60.0001]]
    found = decode_geojson(json.dumps(polygon([corners])))
    assert found.notes == (
        "The coordinates are longitudes and latitudes, and were turned into metres.",
    )
    (ring,), middle = found.polygons[0].rings, found.geographic_origin
    assert from_metres(ring, middle) == pytest.approx(np.array(corners), abs=1e-12)
    # 1e-4 degrees of a great circle of 40 030 km; half of it along the parallel of 60°.
    width, height = found.polygons[0].rings[0].max(axis=0) - found.polygons[0].rings[0].min(axis=0)
    assert (width, height) == pytest.approx((5.5597, 11.1195), rel=1e-4)


@pytest.mark.parametrize(
    ("crs", "turned"),
    [
        ({"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}, True),
        ({"type": "name", "properties": {"name": "EPSG:4326"}}, True),
        ({"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3857"}}, False),
        ({"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::14326"}}, False),
        (None, False),
    ],
)
def test_a_member_crs_says_whether_coordinates_are_degrees(crs, turned):
    found = decode_geojson(json.dumps({**features(polygon()), "crs": crs}))
    assert bool(found.notes) is turned
    tiny = [[[30, 40], [30.01, 40], [30.01, 40.01]]]
    found = decode_geojson(json.dumps({**features(polygon(tiny)), "crs": crs}))
    assert bool(found.notes) is (crs is not None)


def test_a_scene_that_we_wrote_is_never_taken_for_degrees():
    tiny = Scene.from_polygons(
        [[[9, 9], [9.01, 9], [9, 9.01]], [[9.05, 9], [9.06, 9], [9.05, 9.01]]]
    )
    found = decode_geojson(encode_geojson(tiny))
    assert found.notes == ()
    assert found.polygons[0].rings[0].max() == 9.01


def test_a_file_is_read_by_its_suffix(tmp_path):
    path = tmp_path / "room.geojson"
    path.write_text(json.dumps(features(polygon(), polygon())))
    source = read_source(path)
    assert isinstance(source, PolygonSet)
    assert len(source.polygons) == 2


def unit(x, **properties):
    square = [[x, 0], [x + 1, 0], [x + 1, 1], [x, 0]]
    geometry = {"type": "Polygon", "coordinates": [square]}
    return {"type": "Feature", "id": f"u{x}", "properties": properties, "geometry": geometry}


def building(*units):
    return {"type": "FeatureCollection", "features": list(units), "crs": None}


def test_a_name_in_several_languages_is_the_first_of_them_that_says_something():
    found = polygons_of(
        building(
            unit(0, name={"ru": "", "en": "hall"}, alt_name={"en": "lobby"}),
            unit(2, name=None, alt_name={"de": "Flur"}),
            unit(4, name={}, category="stairs"),
        )
    )
    assert [each.label for each in found.polygons] == ["hall", "Flur", "u4"]


def test_of_a_building_of_several_levels_one_is_chosen():
    house = building(
        unit(0, level="0"),
        unit(2, level="0;1"),
        unit(4, level=1),
        unit(6, level_id="roof", level="9"),
        unit(8),
    )
    every = polygons_of(house)
    assert [each.label for each in every.polygons] == ["u0", "u2", "u4", "u6", "u8"]
    assert every.notes == (
        "The objects are on several levels, of which FILE#LEVEL chooses one: "
        "0 (2), 1 (2), roof (1).",
    )
    chosen = polygons_of(house, "1")
    assert [each.label for each in chosen.polygons] == ["u2", "u4"]
    assert chosen.notes == ()
    assert polygons_of(building(unit(0, level=1), unit(2))).notes == ()
    with pytest.raises(InvalidInputError, match=r"no level '9'; choose one of '0', '1', 'roof'"):
        polygons_of(house, "9")
    with pytest.raises(InvalidInputError, match="has no parts of which '1' could be one"):
        polygons_of(building(unit(0)), "1")


def test_a_level_of_a_file_is_read_by_its_name(tmp_path):
    file = tmp_path / "house.geojson"
    file.write_text(json.dumps(building(unit(0, level=0), unit(2, level=1))), encoding="utf-8")
    assert [each.label for each in read_source(f"{file}#1").polygons] == ["u2"]


def test_properties_that_name_a_thing_are_found_however_they_are_capitalized():
    corners = [[0, 0], [2, 0], [2, 1], [0, 0]]
    given = [{"Name": "desk"}, {"LABEL": "sofa", "name": "x"}, {"ref": "A 12"}, {"NAME": None}]
    features = [
        {
            "type": "Feature",
            "id": k,
            "properties": each,
            "geometry": {"type": "Polygon", "coordinates": [corners]},
        }
        for k, each in enumerate(given)
    ]
    document = {"type": "FeatureCollection", "features": features}
    found = decode_geojson(json.dumps(document)).polygons
    assert [polygon.label for polygon in found] == ["desk", "sofa", "A 12", "3"]
