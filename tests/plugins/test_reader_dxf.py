"""The reader of DXF drawings."""

import io
import sys

import numpy as np
import pytest

from sketchmatch.api import InvalidInputError, Reason
from sketchmatch.model.limits import SourceLimits, limited_to
from sketchmatch_builtin.readers.dxf import DxfReader
from sketchmatch_builtin.segmenters.rooms import RoomSegmenter
from tests.pace import within

ezdxf = pytest.importorskip("ezdxf", reason="ezdxf is not installed")
SQUARE = [(0, 0), (2000, 0), (2000, 1000), (0, 1000)]


@pytest.fixture
def drawing():
    made = ezdxf.new()
    made.units = ezdxf.units.MM
    made.layers.add("FURN")
    return made


def saved(drawing):
    text = io.StringIO()
    drawing.write(text)
    return text.getvalue().encode(drawing.output_encoding)


def read(drawing, part=""):
    return DxfReader().read(saved(drawing), part)


def area(polygon):
    total = 0.0
    for k, ring in enumerate(polygon.rings):
        x, y = ring.T
        total += (-1 if k else 1) * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2
    return total


def test_closed_polylines_are_objects_in_metres_and_open_ones_are_left_out(drawing):
    space = drawing.modelspace()
    space.add_lwpolyline(SQUARE, close=True, dxfattribs={"layer": "FURN"})
    space.add_lwpolyline([*SQUARE, SQUARE[0]])
    space.add_polyline2d(SQUARE, close=True)
    space.add_lwpolyline(SQUARE)
    space.add_line((500, 0), (509, 9))
    found = read(drawing)
    assert [polygon.label for polygon in found.polygons] == ["FURN", "", ""]
    assert [area(polygon) for polygon in found.polygons] == pytest.approx([2.0] * 3)
    assert found.polygons[0].rings[0].max(axis=0).tolist() == [2.0, 1.0]
    assert found.notes == (
        "The objects are on several layers, of which FILE#LAYER,… chooses some: 0 (2), FURN (1).",
    )
    assert [line.round(6).tolist() for line in found.lines] == [
        [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]],
        [[0.5, 0.0], [0.509, 0.009]],
    ]


def test_lines_and_arcs_that_meet_all_around_are_an_object_of_their_layer(drawing):
    space = drawing.modelspace()
    space.add_line((2000, 0), (0, 0))
    space.add_line((2000.0000004, 0), (2000, 1000))
    space.add_arc((1000, 1000), 1000, 0, 180)
    space.add_lwpolyline([(0, 1000), (0, 300), (0, 0)])
    table = {"layer": "FURN"}
    corners = [(5000, 0), (6000, 0), (6000, 1000), (5000, 1000)]
    for k in range(4):
        space.add_line(corners[k], corners[k - 1], dxfattribs=table)
    space.add_line((5000, 0), (4000, 0), dxfattribs=table)  # a leg of it
    for k in range(3):
        space.add_line((9000, k * 1000), (9000, k * 1000 + 999))  # gaps of a millimetre
    space.add_line((20000, 0), (21000, 0))
    space.add_line((21000, 0), (20000, 0))  # drawn twice
    found = read(drawing)
    assert [polygon.label for polygon in found.polygons] == ["", "FURN"]
    sizes = [area(polygon) for polygon in found.polygons]
    assert sizes == pytest.approx([2.0 + np.pi / 2, 1.0], rel=1e-3)
    assert len(found.notes) == 1
    assert sorted((line[0].round(3).tolist(), len(line)) for line in found.lines) == [
        ([5.0, 0.0], 2), ([9.0, 0.0], 2), ([9.0, 1.0], 2), ([9.0, 2.0], 2), ([20.0, 0.0], 3),
    ]  # fmt: skip


def test_lines_of_no_length_are_left_out_with_a_note(drawing):
    space = drawing.modelspace()
    space.add_lwpolyline(SQUARE, close=True)
    space.add_line((5, 5), (5, 5))
    found = read(drawing)
    assert found.lines == ()
    assert found.notes == (
        "Left out because they enclose no area or are not objects: empty lines (1).",
    )


def test_walls_that_are_single_lines_part_rooms_named_by_what_is_written_in_them(drawing):
    space = drawing.modelspace()
    house = [(0, 0), (9000, 0), (9000, 6000), (0, 6000)]
    space.add_lwpolyline(house, close=True, dxfattribs={"layer": "WALLS"})
    space.add_line((0, 3000), (9000, 3000))
    space.add_lwpolyline([(4000, 3000), (4000, 4200), (4050, 4200), (4050, 6000)])
    for name, x, y in (
        ("living room", 4500, 1600),
        ("kitchen\\P12 m²", 1500, 4500),
        ("bath", 6000, 4000),
        ("ground floor", 4500, 9000),
    ):
        space.add_mtext(name, dxfattribs={"char_height": 250}).set_location((x, y))
    space.add_text("bathtub", height=120).set_placement((6500, 4500))
    found = read(drawing)
    assert [polygon.label for polygon in found.polygons] == ["WALLS"]
    sizes = {item.name: item.size for item in found.landmarks}
    assert sizes["bath"] == pytest.approx(0.25)
    assert sizes["bathtub"] == pytest.approx(0.12)
    rooms = RoomSegmenter().segment(found)
    areas = {item.label: item.area for item in rooms.scene.objects}
    assert areas == {
        "kitchen": pytest.approx(12.0, rel=0.05),
        "bath": pytest.approx(15.0, rel=0.05),
        "living room": pytest.approx(27.0, rel=0.05),
    }
    assert rooms.warnings == ()


def test_bulges_circles_ellipses_and_splines_are_as_large_as_they_are(drawing):
    space = drawing.modelspace()
    space.add_lwpolyline([(0, 0, 0, 0, 1), (1000, 0, 0, 0, 1)], close=True)
    space.add_circle((5000, 0), 500)
    space.add_ellipse((9000, 0), (1000, 0), 0.5)
    space.add_ellipse((9000, 0), (1000, 0), 0.5, 0.0, 2.0)
    space.add_spline().set_closed([(0, 5000, 0), (1000, 5000, 0), (1000, 6000, 0), (0, 6000, 0)])
    found = read(drawing).polygons
    quarter = np.pi / 4
    assert [area(polygon) for polygon in found[:3]] == pytest.approx(
        [quarter, quarter, quarter * 2], rel=2e-2
    )
    # The closed uniform cubic B-spline of a unit square: its basis, integrated finely.
    assert area(found[3]) == pytest.approx(0.6778, abs=2e-3)
    assert len(found) == 4


def test_a_hatch_in_its_outline_is_one_object_and_one_alone_has_its_holes(drawing):
    space = drawing.modelspace()
    space.add_lwpolyline(SQUARE, close=True)
    space.add_hatch().paths.add_polyline_path(SQUARE, is_closed=True)
    alone = space.add_hatch()
    alone.paths.add_polyline_path([(x + 5000, y) for x, y in SQUARE], is_closed=True)
    hole = [(5500, 250), (6500, 250), (6500, 750), (5500, 750)]
    alone.paths.add_polyline_path(hole, is_closed=True, flags=16)
    alone.paths.add_polyline_path(hole, is_closed=True, flags=16)
    island = [(5900, 400), (6000, 400), (6000, 410), (5900, 410)]
    alone.paths.add_polyline_path(island, is_closed=True, flags=16)
    found = read(drawing).polygons
    assert [len(polygon.rings) for polygon in found] == [1, 2]
    assert [area(polygon) for polygon in found] == pytest.approx([2.0, 1.5])


def test_a_block_is_an_object_at_each_place_with_its_name(drawing):
    chair = drawing.blocks.new("CHAIR")
    for begin, end in (((0, 0), (500, 0)), ((500, 0), (500, 500)), ((0, 500), (0, 0))):
        chair.add_line(begin, end)
    table = drawing.blocks.new("*U1")
    table.add_lwpolyline(SQUARE, close=True)
    table.add_line((0, 0), (2100, 0))
    space = drawing.modelspace()
    space.add_blockref("CHAIR", (1000, 1000), dxfattribs={"rotation": 90})
    space.add_blockref("CHAIR", (5000, 0), dxfattribs={"column_count": 3, "column_spacing": 1000})
    named = space.add_blockref("*U1", (0, 5000), dxfattribs={"layer": "FURN"})
    named.add_attrib("NAME", "big table")
    found = read(drawing).polygons
    assert [polygon.label for polygon in found] == ["CHAIR"] * 4 + ["big table"]
    assert [area(polygon) for polygon in found] == pytest.approx([0.25] * 4 + [2.0])
    assert found[0].rings[0].min(axis=0) == pytest.approx([0.5, 1.0])
    assert [polygon.rings[0].min(axis=0)[0] for polygon in found[1:4]] == pytest.approx([5, 6, 7])


def test_the_text_in_a_shape_is_its_name(drawing):
    space = drawing.modelspace()
    space.add_lwpolyline([(-9000, -9000), (9000, -9000), (9000, 9000), (-9000, 9000)], close=True)
    space.add_lwpolyline(SQUARE, close=True)
    space.add_text("desk").set_placement((100, 100))
    space.add_mtext("of\\POtto").set_location((100, 400))
    space.add_text("room").set_placement((-5000, 100))
    assert [polygon.label for polygon in read(drawing).polygons] == ["room", "desk of Otto"]


def test_texts_all_over_a_shape_are_of_parts_of_it(drawing):
    space = drawing.modelspace()
    space.add_lwpolyline(SQUARE, close=True, dxfattribs={"layer": "house"})
    space.add_text("hall").set_placement((100, 500))
    space.add_text("bath").set_placement((1800, 500))
    found = read(drawing)
    assert [polygon.label for polygon in found.polygons] == ["house"]
    assert [(item.name, item.point, item.kind) for item in found.landmarks] == [
        ("hall", (0.1, 0.5), "room"),
        ("bath", (1.8, 0.5), "room"),
    ]


def test_layers_are_chosen_by_name_or_by_being_switched_on(drawing):
    drawing.layers.add("OFF").off()
    space = drawing.modelspace()
    for layer in ("FURN", "OFF", "Walls"):
        space.add_lwpolyline(SQUARE, close=True, dxfattribs={"layer": layer})
    assert [p.label for p in read(drawing).polygons] == ["FURN", "Walls"]
    assert [p.label for p in read(drawing, "walls").polygons] == ["Walls"]
    assert [p.label for p in read(drawing, "FURN, OFF").polygons] == ["FURN", "OFF"]
    with pytest.raises(InvalidInputError, match=r"has no layer 'doors'; choose .*'FURN'"):
        read(drawing, "FURN,Doors")


def test_a_drawing_without_a_unit_is_taken_as_it_is(drawing):
    drawing.units = 0
    drawing.modelspace().add_lwpolyline(SQUARE, close=True)
    found = read(drawing)
    assert area(found.polygons[0]) == pytest.approx(2e6)
    assert found.notes == ("The drawing does not state its unit: lengths are taken as they are.",)


def test_a_binary_drawing_is_read_like_any(drawing, tmp_path):
    drawing.modelspace().add_lwpolyline(SQUARE, close=True)
    drawing.saveas(tmp_path / "plan.dxf", fmt="bin")
    found = DxfReader().read((tmp_path / "plan.dxf").read_bytes())
    assert area(found.polygons[0]) == pytest.approx(2.0)


@pytest.mark.parametrize("data", [b"no drawing", b"\x00" * 40])
def test_what_is_no_drawing_is_refused(data):
    with pytest.raises(InvalidInputError, match="save it as DXF again") as caught:
        DxfReader().read(data)
    assert caught.value.reason == Reason.INVALID_FILE


def test_blocks_in_blocks_are_not_unfolded_beyond_the_limit(drawing):
    for k in range(30):
        block = drawing.blocks.new(f"B{k}")
        for _ in range(2):
            if k:
                block.add_blockref(f"B{k - 1}", (0, 0))
            else:
                block.add_line((0, 0), (1, 1))
    drawing.modelspace().add_blockref("B29", (0, 0))
    with pytest.raises(InvalidInputError, match="unfolds to more than the limit"):
        read(drawing)
    with (
        limited_to(SourceLimits(max_vertices=100)),
        pytest.raises(InvalidInputError, match="lines"),
    ):
        read(drawing)


def test_of_too_many_shapes_the_layers_are_told(drawing):
    for layer in ("FURN", "FURN", "Walls"):
        drawing.modelspace().add_lwpolyline(SQUARE, close=True, dxfattribs={"layer": layer})
    with limited_to(SourceLimits(max_objects=2)):
        with pytest.raises(
            InvalidInputError, match=r"has 3 closed shapes, .*FURN \(2\), Walls \(1\)"
        ):
            read(drawing)
        assert len(read(drawing, "FURN").polygons) == 2


def test_without_the_package_one_sentence_says_what_to_install(drawing, monkeypatch):
    data = saved(drawing)
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    with pytest.raises(InvalidInputError, match=r"pip install 'sketchmatch\[dxf\]'"):
        DxfReader().read(data)


def test_counting_shapes_stops_far_above_what_is_allowed(drawing):
    drawing.blocks.new("CHAIR").add_lwpolyline(SQUARE, close=True)
    grid = {"row_count": 200, "column_count": 200, "row_spacing": 9, "column_spacing": 9}
    drawing.modelspace().add_blockref("CHAIR", (0, 0), grid)
    with limited_to(SourceLimits(max_objects=20)), pytest.raises(InvalidInputError) as caught:
        read(drawing)
    assert "has more than 100 closed shapes, more than the limit of 20 objects" in str(caught.value)


def test_hundreds_of_hatches_over_each_other_are_compared_soon(drawing):
    for k in range(300):
        hatch = drawing.modelspace().add_hatch()
        side = 1.04**k
        corners = [(0, 0), (side, 0), (side, side), (0, side)]
        hatch.paths.add_polyline_path(corners, is_closed=True)
    with within(4.0):
        assert len(read(drawing).polygons) == 300


def test_islands_in_islands_have_an_end(drawing):
    hatch = drawing.modelspace().add_hatch()
    for k in range(200):
        corners = [(k, k), (999 - k, k), (999 - k, 999 - k), (k, 999 - k)]
        hatch.paths.add_polyline_path(corners, is_closed=True)
    with pytest.raises(InvalidInputError, match="islands nested more than 50 deep; draw it"):
        read(drawing)


def test_a_text_names_the_smallest_shape_around_it(drawing):
    space = drawing.modelspace()
    for radius in (5, 3, 1):
        space.add_circle((0, 0), radius)
    for name, x in (("inner", 0), ("middle", 2), ("outer", 4), ("nobody's", 9), ("too", 0.5)):
        space.add_text(name, dxfattribs={"insert": (x, 0)})
    assert [polygon.label for polygon in read(drawing).polygons] == ["outer", "middle", "inner too"]
