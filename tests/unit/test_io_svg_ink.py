"""Pen strokes whose ink alone was exported are read as the lines that were drawn."""

import itertools
from pathlib import Path

import numpy as np
import pytest
import shapely

from sketchmatch.io import read_source
from sketchmatch.io.svg import decode_svg
from sketchmatch_builtin.segmenters.strokes import StrokeSegmenter
from tests.pace import within

CASES = Path(__file__).parents[3] / "shared" / "data" / "cases" / "15-svg-freedraw-outline"
needs_cases = pytest.mark.skipif(not CASES.is_dir(), reason=f"{CASES} is not here")


def data_of(ring, turned=0):
    """Path data of a closed line that begins somewhere on it."""
    points = np.roll(np.asarray(ring)[:-1], turned, axis=0)
    return "M" + "L".join(f"{x:.3f} {y:.3f}" for x, y in points) + "z"


def ribbon(line, width):
    """The outline of a line's ink as pens export it: one side, and the other side back."""
    line = np.asarray(line, float)
    along = np.gradient(line, axis=0)
    across = along[:, ::-1] * (-1, 1) / np.hypot(*along.T)[:, None]
    widths = np.broadcast_to(width, len(line))[:, None]
    sides = line + across * widths / 2, line - across * widths / 2
    return np.concatenate([sides[0], sides[1][::-1], sides[0][:1]])


def loop(start, end, radius=100.0, centre=(200.0, 200.0), count=120):
    angles = np.radians(np.linspace(start, end, count))
    return np.stack([np.cos(angles), np.sin(angles)], axis=1) * radius + centre


def read(*data, paint="", rule=""):
    body = "".join(f'<path d="{each}" {paint} {rule}/>' for each in data)
    return [s.points * (1, -1) for s in decode_svg(f"<svg>{body}</svg>".encode()).strokes]


def far_from(line, other):
    """The largest distance of one line's points from another line."""
    return shapely.LineString(line).hausdorff_distance(shapely.LineString(other))


@pytest.mark.parametrize("width", [1.0, 4.0, 12.0, 25.0])
@pytest.mark.parametrize(("start", "end"), [(0, 359), (0, 345), (0, 380), (20, 420)])
@pytest.mark.parametrize("turned", [0, 70])
def test_a_ribbon_is_read_as_the_line_in_its_middle(width, start, end, turned):
    drawn = loop(start, end)
    (found,) = read(data_of(ribbon(drawn, width), turned))
    assert far_from(found, drawn) < 0.1 + 0.15 * width
    ends = [np.hypot(*(found[i] - drawn[j]).T) for i, j in ((0, 0), (-1, -1), (0, -1), (-1, 0))]
    assert min(ends[0] + ends[1], ends[2] + ends[3]) < 0.5 + 2.2 * width


def test_pressure_and_tapered_ends_do_not_matter():
    drawn = loop(0, 355, count=200)
    width = 1.0 + 9.0 * np.sin(np.linspace(0, np.pi, 200))
    (found,) = read(data_of(ribbon(drawn, width)))
    assert far_from(found, drawn) < 2.0


def test_an_open_ribbon_is_an_open_line():
    x = np.linspace(0, 900, 150)
    drawn = np.stack([x, 100 + 60 * np.sin(x / 120)], axis=1)
    (found,) = read(data_of(ribbon(drawn, 8)))
    assert far_from(found, drawn) < 3.0
    assert abs(found[0, 0] - found[-1, 0]) > 890


@pytest.mark.parametrize(
    ("paint", "ink"),
    [("", True), ('stroke="black"', True), ('stroke="red"', False), ('fill="none"', False)],
)
def test_ink_is_a_filling_with_no_other_line(paint, ink):
    outline = ribbon(loop(0, 345), 6)
    if "none" in paint:
        paint += ' stroke="black"'
    (found,) = read(data_of(outline), paint=paint)
    assert (far_from(found, outline) > 2.0) == ink


@pytest.mark.parametrize(
    "shape",
    [
        "M0 0h200v40h-200z",
        "M0 0h400v15h-400z",  # a shelf of 1 : 27
        "M0 0h150v30h-120v90h-30z",  # a counter
        "M0 0h20v80h60v-80h20v100h-100z",  # … around three sides
        data_of(loop(0, 360)),
        data_of(loop(0, 180)),
        data_of(ribbon(np.linspace((0, 0), (70, 0), 40), 10)),  # a bar of 1 : 7
        data_of(ribbon(np.linspace((0, 0), (150, 0), 7), 10)),  # … and of 14 corners
    ],
)
def test_a_shape_is_no_ink(shape):
    (found,) = read(shape)
    (outline,) = read(shape, paint='stroke="red"')
    assert found.tolist() == outline.tolist()


def test_things_drawn_with_several_strokes_are_joined():
    data = []
    for x, y in ((0, 0), (300, 40)):
        corners = [(x, y), (x + 200, y), (x + 200, y + 90), (x, y + 90), (x, y)]
        for start, end in itertools.pairwise(corners):
            data.append(data_of(ribbon(np.linspace(start, end, 25), 9.0)))
    body = "".join(f'<path d="{each}"/>' for each in data)
    found = StrokeSegmenter().segment(decode_svg(f"<svg>{body}</svg>".encode()))
    boxes = [(0, -90, 200, 0), (300, -130, 500, -40)]
    for item, expected in zip(found.scene.objects, boxes, strict=True):
        assert item.polygon.bounds == pytest.approx(expected, abs=5)


def test_a_rectangle_is_no_ink():
    (stroke,) = decode_svg(b'<svg><rect width="400" height="5"/></svg>').strokes
    assert len(stroke.points) == 5


def rings(shape):
    shape = shapely.geometry.polygon.orient(shape)
    return "".join(data_of(each.coords) for each in (shape.exterior, *shape.interiors))


@pytest.mark.parametrize("rule", ["", 'fill-rule="evenodd"'])
@pytest.mark.parametrize("width", [2.0, 10.0, 30.0])
def test_a_ring_of_ink_is_the_loop_in_its_middle_without_its_ends(rule, width):
    drawn = shapely.LineString([(0, -30), (0, 200), (300, 200), (300, 0), (-40, 0)])
    (found,) = read(rings(drawn.buffer(width / 2, join_style="mitre")), rule=rule)
    square = shapely.box(0, 0, 300, 200)
    both = shapely.Polygon(found)
    assert both.intersection(square).area > 0.97 * both.union(square).area


def test_a_traced_drawing_is_read_as_its_rings_and_lines():
    circles = [loop(0, 360, 50.0, (x, 100.0)) for x in (100, 300, 700)]
    way = shapely.LineString([(100, 100), (320, 100)])  # from ring to ring
    ink = [shapely.LinearRing(each).buffer(3) for each in circles]
    alone = shapely.LineString(np.stack([np.linspace(0, 900, 90), np.full(90, 400.0)], axis=1))
    whole = shapely.union_all([*ink, way.buffer(3), alone.buffer(3, quad_segs=8)])
    data = "".join(rings(part) for part in shapely.get_parts(whole))
    for rule in ("", 'fill-rule="evenodd"'):
        found = read(data, rule=rule)
        areas = sorted(shapely.Polygon(each).area for each in found if len(each) > 3)
        assert np.allclose(areas[-3:], np.pi * 50**2, rtol=0.06)
        assert len(found) == 4


def test_holes_of_a_shape_are_no_shapes():
    table = "M0 0h200v100h-200zM60 40v20h80v-20z"
    assert [len(each) for each in read(table)] == [5]
    assert len(read(table, rule='fill-rule="evenodd"')) == 1
    island = table + "M90 45h20v10h-20z"
    assert [len(each) for each in read(island)] == [5, 5]
    assert len(read(table, paint='stroke="red"')) == 2, "lines are drawn"
    same_way = "M0 0h200v100h-200zM60 40h80v20h-80z"
    assert len(read(same_way)) == 1
    assert len(read(same_way, rule='fill-rule="evenodd"')) == 1


def test_parts_of_a_filling_that_touch_are_one():
    # A line around a box as Figma draws one that lies within: corners and edges.
    corners = "M400 300V299H399V300H400ZM490 300H491V299H490V300ZM490 420V421H491V420H490Z"
    edges = "M400 301H490V299H400V301ZM489 300V420H491V300H489ZM490 419H400V421H490V419Z"
    (found,) = read(f"{corners}M400 420H399V421H400V420Z{edges}M401 420V300H399V420H401Z")
    assert far_from(found, shapely.box(400, 300, 490, 420).exterior.coords) < 0.8
    apart = "M0 0h90v90h-90zM100 0h90v90h-90z"
    assert [len(each) for each in read(apart)] == [5, 5]
    (joined,) = read(apart.replace("M100", "M80"))
    assert np.ptp(joined, axis=0).tolist() == [170, 90]


def test_a_ring_that_crosses_itself_is_one_with_what_it_touches():
    left, right = read("M0 0L90 90V10L0 90zM80 20h90v50h-90z")  # from two triangles
    assert [left[:, 0].max(), right[:, 0].min()] == pytest.approx([810 / 17] * 2)
    assert right[:, 0].max() == 170


def test_scribbles_without_end_are_outlines_each():
    rng = np.random.default_rng(0)
    scribbles = [rng.uniform(0, 100, (300, 2)) + 30 * k for k in range(2)]
    with within(4):
        found = read("".join(data_of([*ring, ring[0]]) for ring in scribbles))
    assert [len(line) for line in found] == [301, 301]


def test_rings_beyond_count_are_outlines_each():
    data = "".join(f"M{k} {k}H{9000 - k}V{9000 - k}H{k}z" for k in range(2001))
    assert len(read(data, rule='fill-rule="evenodd"')) == 2001


THINGS = {
    "desk": (100, 100, 300, 180),
    "shelf": (550, 90, 610, 330),
    "bed": (120, 400, 340, 560),
    "lamp": (620, 480, 690, 550),
    "table": (400, 300, 490, 420),
}


HANDS = ("gap8", "touch", "overlap", "overlap80")


@needs_cases
@pytest.mark.parametrize(
    "name",
    [
        *(f"{tool}-{hand}" for tool in ("plain", "excalidraw") for hand in HANDS),
        "excalidraw-overlap-with-route",
    ],
)
def test_what_a_pad_exported_is_what_was_drawn(name):
    found = StrokeSegmenter().segment(read_source(CASES / f"{name}.svg"))
    assert len(found.scene) == len(THINGS)
    assert (found.route is not None) == ("route" in name)
    for item, (x0, y0, x1, y1) in zip(found.scene.objects, THINGS.values(), strict=True):
        thing = shapely.box(x0, -y1, x1, -y0)
        assert item.polygon.intersection(thing).area > 0.93 * item.polygon.union(thing).area


def walls(*holes, outline="M0 0H100V70H0z"):
    path = f'<path fill="#333" fill-rule="evenodd" d="{outline}{"".join(holes)}"/>'
    document = f'<svg xmlns="http://www.w3.org/2000/svg">{path}</svg>'
    return [stroke.points.tolist() for stroke in decode_svg(document.encode()).strokes]


def test_ink_around_several_holes_is_walls_and_read_as_their_sides():
    rooms = ["M5 5H45V65H5z", "M50 5H95V30H50z", "M50 35H95V65H50z"]
    outer, *inner = walls(*rooms)
    assert outer == [[0, 0], [100, 0], [100, -70], [0, -70], [0, 0]]
    assert sorted(map(min, inner)) == [[5, -65], [50, -65], [50, -30]]
    assert [len(ring) for ring in inner] == [5, 5, 5]


def test_a_hole_that_winds_around_walls_is_no_pen_stroke():
    # Three rooms, open to each other at the lower end of the walls between them.
    comb = "M3 3H30V60H36V3H63V60H69V3H97V67H3z"
    outer, inner = walls(comb)
    assert len(outer) == 5
    assert [30, -60] in inner
    assert len(inner) == 13


def test_a_ring_of_ink_around_one_hole_is_still_the_loop_in_its_middle():
    (loop,) = walls("M4 4H96V66H4z")
    assert np.ptp(loop, axis=0) == pytest.approx([96, 66], abs=0.5)


def test_ink_that_leads_on_from_a_ring_is_walls_and_not_the_ring_alone():
    # A closet between two rooms, with their walls.
    closet = "M53 3H67V67H53z"
    outer, hole = walls(closet, outline="M0 0H120V3H70V67H120V70H0V67H50V3H0z")
    assert np.ptp(outer, axis=0).tolist() == [120, 70]
    assert np.ptp(hole, axis=0).tolist() == [14, 64]
