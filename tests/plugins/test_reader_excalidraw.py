"""The reader of Excalidraw's drawings."""

import json

import numpy as np
import pytest

from sketchmatch.api import InvalidInputError
from sketchmatch.io import read_source
from sketchmatch.model.limits import SourceLimits, limited_to
from sketchmatch.pipeline.segment import segment
from sketchmatch.pipeline.selection import Choice, resolve_segmenter
from sketchmatch.registry import default_registry
from sketchmatch_builtin.readers.excalidraw import ExcalidrawReader
from sketchmatch_builtin.segmenters.rooms import RoomSegmenter
from tests.pace import within
from tests.tools import ROOT

CASES = ROOT.parent / "shared" / "data" / "cases" / "31-strokes-json"


def element(kind, x=0, y=0, width=100, height=50, **more):
    paint = {"strokeColor": "#1e1e1e", "backgroundColor": "transparent", "opacity": 100}
    place = {"x": x, "y": y, "width": width, "height": height, "angle": 0}
    return {"type": kind, **paint, **place, "isDeleted": False, **more}


def read(*elements, part="", **more):
    document = {"type": "excalidraw", "version": 2, "elements": elements, **more}
    return ExcalidrawReader().read(json.dumps(document).encode(), part)


def points(*elements):
    return [stroke.points for stroke in read(*elements).strokes]


def test_shapes_are_closed_strokes_with_y_turned_up():
    box, diamond = points(element("rectangle", 10, 20), element("diamond", 10, 20))
    assert box.tolist() == [[10, -20], [110, -20], [110, -70], [10, -70], [10, -20]]
    assert diamond.tolist() == [[60, -20], [110, -45], [60, -70], [10, -45], [60, -20]]
    (ellipse,) = points(element("ellipse", 10, 20))
    assert ellipse[0] == pytest.approx(ellipse[-1])
    radii = np.hypot(*((ellipse - (60, -45)) / (50, 25)).T)
    assert radii == pytest.approx(np.ones(len(ellipse)))


def test_lines_and_freehand_strokes_begin_where_they_were_put():
    line = element("line", 5, 5, points=[[0, 0], [10, 0], [10, 10]])
    pen = element("freedraw", -5, 5, points=[[0, 0], [1, 2, 0.5]])
    found = points(line, pen)
    assert found[0].tolist() == [[5, -5], [15, -5], [15, -15]]
    assert found[1].tolist() == [[-5, -5], [-4, -7]]


def test_a_turned_shape_is_turned_clockwise_about_its_middle():
    (found,) = points(element("rectangle", 0, 0, 100, 50, angle=np.pi / 2))
    assert found[:4] == pytest.approx(np.array([[75, 25], [75, -75], [25, -75], [25, 25]]))
    line = element("line", 0, 0, points=[[0, 0], [10, 0], [10, 10]], angle=np.pi)
    assert points(line)[0] == pytest.approx(np.array([[10, -10], [0, -10], [0, 0]]))


def test_round_corners_are_round():
    (found,) = points(element("rectangle", 0, 0, 100, 80, roundness={"type": 3}))
    assert not (found == [0, 0]).all(axis=1).any()
    assert found.min(axis=0).tolist() == [0, -80]
    (wide,) = points(element("rectangle", 0, 0, 1000, 1000, roundness={"type": 3}))
    assert [0, -32] in wide.round(9).tolist()


def test_a_curve_goes_through_its_points():
    corners = [[0, 0], [10, 0], [10, 10], [0, 10]]
    (found,) = points(element("line", points=corners, roundness={"type": 2}))
    assert len(found) > 20
    for x, y in corners:
        assert np.hypot(*(found - (x, -y)).T).min() == pytest.approx(0.0, abs=1e-9)


def test_a_text_names_the_shape_that_it_is_bound_to_grouped_with_or_over():
    found = read(
        element("rectangle", 0, 0, 1000, 1000, id="room"),
        element("rectangle", 100, 100, id="desk"),
        element("rectangle", 300, 300, id="bed", groupIds=["g"]),
        element("rectangle", 500, 500, id="sofa"),
        element("text", 900, 900, id="a", containerId="sofa", text="so\nfa", originalText="sofa"),
        element("text", 800, 800, id="b", groupIds=["g"], text="bed"),
        element("text", 110, 110, 20, 10, id="c", text="desk"),
        element("text", 800, 100, 20, 10, id="d", text="living"),
        element("text", 820, 150, 20, 10, id="e", text="room"),
        element("text", 5000, 100, 20, 10, id="f", text="a title"),
    )
    assert [s.label for s in found.strokes] == ["living room", "desk", "bed", "sofa"]


def test_all_texts_but_those_of_arrows_are_names_of_rooms():
    found = read(
        element("line", points=[[0, 0], [10, 0]], id="a"),
        element("arrow", id="b", points=[[0, 0], [10, 0]]),
        element("text", 10, 20, 40, 10, text="dining\nroom", fontSize=20),
        element("text", 0, 0, text="bound", containerId="a", fontSize="?"),
        element("text", 0, 0, text="3 m", containerId="b"),
        element("text", 0, 0, text=" "),
    )
    assert [(each.name, each.point, each.size) for each in found.landmarks] == [
        ("dining room", (30.0, -25.0), 20.0),
        ("bound", (50.0, -25.0), 0.0),
    ]
    assert not found.strokes[0].label.startswith("3 m")


@pytest.mark.parametrize(
    ("more", "dashed", "opaque"),
    [
        ({}, False, False),
        ({"strokeStyle": "dashed"}, True, False),
        ({"strokeStyle": "dotted", "backgroundColor": "#ffc9c9"}, False, True),
        ({"backgroundColor": "#ffc9c9", "fillStyle": "solid"}, False, True),
        ({"backgroundColor": "#ffc9c980", "fillStyle": "solid"}, False, False),
        ({"backgroundColor": "#ffc9c9", "fillStyle": "hachure"}, False, False),
        ({"backgroundColor": "#ffc9c9", "fillStyle": "solid", "opacity": 50}, False, False),
    ],
)
def test_lines_with_gaps_and_fillings_are_known(more, dashed, opaque):
    (stroke,) = read(element("rectangle", strokeWidth=4, **{"fillStyle": "solid", **more})).strokes
    assert (stroke.dashed, stroke.opaque, stroke.width) == (dashed, opaque, 4.0)


@pytest.mark.slow
@pytest.mark.parametrize("width", [None, "thin", True, -3, 10**400, [1]])
def test_a_width_that_is_none_does_not_matter(width):
    (stroke,) = read(element("rectangle", strokeWidth=width)).strokes
    assert stroke.width == 0


def test_rooms_of_a_plan_of_lines_have_the_names_written_in_them():
    walls = element("rectangle", width=600, height=400)
    between = element("line", 300, 0, points=[[0, 0], [0, 400]])
    rug = element("rectangle", 40, 40, 200, 320, strokeStyle="dashed")
    texts = [element("text", x, 190, 40, 20, text=text) for x, text in ((130, "a"), (430, "b"))]
    found = RoomSegmenter().segment(read(walls, between, rug, *texts))
    assert [item.label for item in found.scene.objects] == ["a", "b"]


def test_arrows_pictures_and_what_nobody_sees_are_no_strokes():
    found = read(
        element("rectangle"),
        element("rectangle", isDeleted=True),
        element("rectangle", opacity=0),
        element("rectangle", strokeColor="transparent"),
        element("rectangle", strokeColor="transparent", backgroundColor="#ffc9c9"),
        element("arrow", points=[[0, 0], [9, 9]]),
        element("arrow", points=[[0, 0], [9, 9]]),
        element("image"),
    )
    assert len(found.strokes) == 2
    assert found.notes == ("Left out because they are not objects: arrows (2), pictures (1).",)


def test_odd_names_in_a_drawing_can_be_shown():
    odd = "a\ud800\x1b[1m\nb"
    found = read(
        element("rectangle", frameId="x"),
        element("rectangle", 500, frameId="y"),
        element("frame", id="x", name=odd),
        element("frame", id="y", name="y"),
        element(odd),
    )
    segmenter = resolve_segmenter(default_registry(), Choice(), found)
    for warning in segment(found, segmenter, default_registry(), "").warnings:
        assert warning.encode("utf-8").decode().isprintable()


def test_a_frame_is_no_shape_and_chooses_what_is_in_it():
    elements = (
        element("frame", id="k", name="kitchen"),
        element("frame", id="h", name="hall"),
        element("rectangle", 1, frameId="k"),
        element("rectangle", 2, frameId="h"),
        element("rectangle", 3),
    )
    found = read(*elements)
    assert [stroke.points[0, 0] for stroke in found.strokes] == [1, 2, 3]
    assert found.notes == ("All 2 frames were read; FILE#FRAME reads one: 'hall', 'kitchen'.",)
    assert [s.points[0, 0] for s in read(*elements, part="hall").strokes] == [2]
    with pytest.raises(InvalidInputError, match="has no frame 'attic'; choose one of: 'kitchen'"):
        read(*elements, part="attic")


@pytest.mark.parametrize(
    ("document", "words"),
    [
        ([], "give a drawing"),
        ({"type": "other", "elements": []}, 'type is "other"; give a drawing of type excalidraw'),
        ({"type": "excalidraw"}, "elements is missing; give a list of elements"),
        ({"type": "excalidraw", "elements": []}, "elements has no shape in it; draw"),
        ({"type": "excalidraw", "elements": [3]}, "elements[0] is 3; give an element"),
        ({"type": "excalidraw", "elements": [{}]}, "elements[0].type is missing; give a name"),
        (
            {"type": "excalidraw", "elements": [{"type": "ellipse", "x": "a"}]},
            'elements[0].x is "a"; give a finite number',
        ),
        (
            {"type": "excalidraw", "elements": [{"type": "line", "x": 0, "y": 0, "points": [[1]]}]},
            "elements[0].points[0] is a list of 1; give [x, y]",
        ),
    ],
)
def test_a_fault_is_named_with_its_path_and_the_remedy(document, words):
    with pytest.raises(InvalidInputError) as caught:
        ExcalidrawReader().read(json.dumps(document).encode())
    assert words in str(caught.value)


def test_a_drawing_of_more_points_than_are_allowed_is_refused():
    pen = element("freedraw", points=[[k, 0] for k in range(20)])
    with limited_to(SourceLimits(max_vertices=10)), pytest.raises(InvalidInputError, match="limit"):
        read(pen)


def test_the_files_that_people_had_are_read_or_refused_as_what_they_are():
    if not CASES.exists():
        pytest.skip("shared/data/cases is not there")
    assert len(read_source(CASES / "excalidraw.json").strokes) == 1
    with pytest.raises(InvalidInputError, match="elements has no shape in it"):
        read_source(CASES / "excalidraw.excalidraw")


def test_groups_that_are_none_are_left_alone():
    box = {"type": "rectangle", "id": "a", "x": 0, "y": 0, "width": 4, "height": 2}
    text = {"type": "text", "text": "desk", "x": 9, "y": 9, "groupIds": ["g", ["h"], 5]}
    for groups in (5, "g", [["g"]], {"g": 1}, None):
        document = {"type": "excalidraw", "elements": [box | {"groupIds": groups}, text]}
        (stroke,) = ExcalidrawReader().read(json.dumps(document).encode()).strokes
        assert stroke.label == ""


def test_thousands_of_texts_over_thousands_of_shapes_are_read_soon():
    corner = [[0, 0], [4, 4], [0, 4]]
    lines = [{"type": "line", "x": 9 * k, "y": 0, "points": corner} for k in range(3000)]
    texts = [{"type": "text", "text": str(k), "x": 9 * k + 1, "y": 3} for k in range(3000)]
    data = json.dumps({"type": "excalidraw", "elements": lines + texts}).encode()
    with within(3.0):
        strokes = ExcalidrawReader().read(data).strokes
    assert [stroke.label for stroke in strokes] == [str(k) for k in range(3000)]


def test_a_note_with_an_odd_name_is_told_once():
    boxes = [element("rectangle", x=200 * k) for k in range(2)]
    source = read(*boxes, element("\ud800"))
    segmenter = resolve_segmenter(default_registry(), Choice(), source)
    found = segment(source, segmenter, default_registry(), "sketch.stroke_set")
    odd = "elements of type \N{REPLACEMENT CHARACTER} (1)."
    assert found.warnings == (f"Left out because they are not objects: {odd}",)
