"""Polygons and strokes as people have them: each file with what its format's text says is right."""

import json

import pytest

from sketchmatch.errors import InvalidInputError
from sketchmatch.io import read_source
from sketchmatch.io.geojson import decode_geojson
from sketchmatch.pipeline.segment import segment
from sketchmatch.pipeline.selection import Choice, resolve_segmenter
from sketchmatch.registry import default_registry
from sketchmatch_builtin.segmenters.polygons import PolygonSegmenter
from tests.tools import ROOT

CASES = ROOT.parent / "shared" / "data" / "cases"
NAMES = ("desk", "shelf", "bed", "lamp", "table")
ODD = "left side red [bold]x[/bold]"
LEFT_OUT = "features[5].geometry was left out: {} enclose no area."
NOWHERE = "features[5]{} was left out: it has no place."
METRES = "The coordinates are longitudes and latitudes, and were turned into metres."
READ = {
    # RFC 7946, 3.1.1: a third element is the height; further ones may be ignored.
    "3d": (NAMES, ()),
    "3d-null": (NAMES, ()),
    # 3.1.6: a linear ring is a closed LineString with four or more positions.
    "closed-line": (
        NAMES,
        ("features[4].geometry is a closed line, taken as the outline of an object.",),
    ),
    "contains": ((*NAMES, "room"), ()),
    "crlf-bom": (NAMES, ()),
    # 4: crs is not used any more; here it says that the plane is meant.
    "crs": (NAMES, ()),
    # 3.1.6: parsers should not reject polygons that do not follow the right-hand rule.
    "cw": (NAMES, ()),
    "dup-points": (NAMES, ()),
    # 3.1: empty coordinates may be interpreted as null objects.
    "empty-multi": (NAMES, (NOWHERE.format(".geometry"),)),
    "empty-polygon": (NAMES, (NOWHERE.format(".geometry"),)),
    "gc": (("x",) * 5, ()),
    # 3.2: a feature's id is its commonly used identifier.
    "id-label": (NAMES, ()),
    "label-multiline": (tuple(f"{name} {ODD}" for name in NAMES), ()),
    "line-too": (NAMES, (LEFT_OUT.format("open lines"),)),
    # 4: coordinates are longitude and latitude, in degrees.
    "lonlat": (NAMES, (METRES,)),
    "multi": ((*NAMES[:3], "pair", "pair"), ()),
    "name-bool-null": (("true",) * 5, ()),
    "name-zero": (("0", "1", "2", "3", "4"), ()),
    "ndjson": (NAMES, ()),
    "no-properties": (("",) * 5, ()),
    # 3.2: geometry is null where a feature has no place.
    "null-geometry": (NAMES, (NOWHERE.format(""),)),
    "overlap": ((*NAMES, "rug"), ()),
    "plain": (NAMES, ()),
    "point-too": (NAMES, (LEFT_OUT.format("points"),)),
    # RFC 8142: texts after record separators.
    "rs-seq": (NAMES, ()),
    "same-twice": ((*NAMES, "desk"), ()),
    "utm": (NAMES, ()),
}
REFUSED = {
    "bare-list": "polygons holds one polygon; a match compares",
    "bowtie": "polygons[4] crosses itself at (",
    "curve": 'features[5].geometry.type is "CurvePolygon", which GeoJSON does not have; give',
    "hole-covers": "polygons[4] crosses itself or a hole at (",
    "hole-crosses": "polygons[4] crosses itself or a hole at (",
    "hole-outside": "polygons[4] is not a polygon (Hole lies outside shell",
    "spike": "polygons[4] crosses itself at (",
    # RFC 7946, 3.1.1: a position is an array of numbers.
    "string-coords": 'coordinates[0][0][0] is "0"; give a finite number',
    "topojson": "an object with 'type', 'arcs', 'objects' and type 'Topology')",
    "touch-self": "polygons[4] crosses itself at (3.45, 2.6)",
    # 3.1.6: a linear ring has four or more positions.
    "zero-area": "polygons[5].rings[0] has 2 distinct points; a ring needs at least three",
}
STROKES = {
    "bom": NAMES,
    "epoch-ms": NAMES,
    "geo": NAMES,
    "label-num": ("0", "1", "2", "3", "4"),
    "nul-label": NAMES,
    "plain": NAMES,
    "surrogate": ("\ufffddesk", *NAMES[1:]),
    "time-backwards": NAMES,
    "time-null": NAMES,
}
WRONG_STROKES = {
    "1e400": "strokes[0].points[0][0] is Infinity; give a finite number",
    "inf": "strokes[0].points[2][0] is Infinity; give a finite number",
    "nan": "strokes[0].points[2][0] is NaN; give a finite number",
    "null": "strokes[0].points[2][0] is missing; give a finite number",
    # Which way y grows is not said, so that either reading could be the mirror image.
    "list": "is JSON of an unknown kind (a list of 5, the first an object with 'points', 'label')",
    "null-stroke": 'strokes[5] is missing; give an object with "points"',
    "pressure4": "strokes[0].points[0] is a list of 4; give [x, y] or [x, y, seconds]",
    "trailing-comma": "is not JSON (",
    "utf16": "is not UTF-8 text; save it as UTF-8",
    "xy-objects": "strokes[0].points[0] is an object; give [x, y] or [x, y, seconds]",
    "y-axis-caps": 'y_axis is "Down"; give "up" or "down"',
    "yAxis": "'yAxis' is not a key that is read; write \"y_axis\", or leave it out",
}
# What other tests look at, or those of the segmenter of strokes: taps and empty sketches.
ELSEWHERE = {"dot", "dot5", "empty-stroke", "excalidraw", "gc-collide"}


def found(folder, name):
    """Return what a file's scene holds."""
    path = CASES / folder / name
    if not path.exists():
        pytest.skip(f"shared/data/cases/{folder}/{name} is not there")
    source = read_source(path)
    segmenter = resolve_segmenter(default_registry(), Choice(), source)
    return segment(source, segmenter, default_registry(), "")


@pytest.mark.parametrize("name", READ)
def test_geojson_is_read_as_its_text_says(name):
    labels, notes = READ[name]
    segmentation = found("30-geojson-geometry", f"{name}.geojson")
    assert segmentation.scene.labels == labels
    assert segmentation.warnings == notes


def test_degrees_have_the_shape_that_they_have_on_the_ground():
    ground = found("30-geojson-geometry", "lonlat.geojson").scene
    plain = found("30-geojson-geometry", "plain.geojson").scene
    for one, other in zip(ground.objects, plain.objects, strict=True):
        assert one.area == pytest.approx(other.area, rel=0.02)


@pytest.mark.parametrize("name", REFUSED)
def test_geojson_that_cannot_be_honoured_is_refused_with_its_place(name):
    with pytest.raises(InvalidInputError) as caught:
        found("30-geojson-geometry", f"{name}.geojson")
    assert REFUSED[name] in str(caught.value)


@pytest.mark.parametrize("name", STROKES)
def test_strokes_are_read(name):
    assert found("31-strokes-json", f"{name}.json").scene.labels == STROKES[name]


@pytest.mark.parametrize("name", WRONG_STROKES)
def test_strokes_that_cannot_be_honoured_are_refused_with_their_place(name):
    with pytest.raises(InvalidInputError) as caught:
        found("31-strokes-json", f"{name}.json")
    assert WRONG_STROKES[name] in str(caught.value)


@pytest.mark.parametrize(
    ("folder", "tried"),
    [
        ("30-geojson-geometry", {*READ, *REFUSED}),
        ("31-strokes-json", {*STROKES, *WRONG_STROKES, *ELSEWHERE}),
    ],
)
def test_every_file_is_tried(folder, tried):
    if not CASES.exists():
        pytest.skip("shared/data/cases is not there")
    assert {path.stem for path in (CASES / folder).iterdir()} == tried


def test_a_title_in_several_lines_is_one_name():
    names = found("41-label-newline", "wrapped-title.svg").scene.labels
    assert names == ("writing desk", "shelf left side", "bed")


def test_where_too_little_is_left_the_refusal_says_what_was_left_out():
    line = {"type": "LineString", "coordinates": [[0, 0], [1, 1]]}
    with pytest.raises(InvalidInputError) as caught:
        segment(decode_geojson(json.dumps(line)), PolygonSegmenter(), default_registry(), "map")
    assert str(caught.value) == (
        "map.polygons holds no polygon; a match compares relations between objects, so give at "
        "least two (The geometry was left out: open lines enclose no area.)"
    )
