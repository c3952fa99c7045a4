"""The segmenter of polygons."""

import numpy as np
import pytest

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import LabelledPolygon, PolygonSet
from sketchmatch_builtin.segmenters.polygons import PolygonSegmenter

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
HOLE = [[1, 1], [1, 2], [2, 2], [2, 1]]


def segmented(*polygons):
    source = PolygonSet(
        tuple(
            LabelledPolygon(tuple(np.array(ring, float) for ring in rings), label)
            for rings, label in polygons
        )
    )
    return PolygonSegmenter().segment(source)


def test_every_polygon_is_an_object_in_its_order():
    found = segmented(([SQUARE, HOLE], "ring"), ([[[9, 9], [9, 7], [8, 8]]], ""))
    assert found.scene.labels == ("ring", "")
    assert [item.area for item in found.scene.objects] == [15.0, 1.0]
    assert found.warnings == ()


def test_open_lines_are_told_to_be_left_out_and_whose_walls_they_may_be():
    square, lines = LabelledPolygon((np.array(SQUARE, float),)), (np.zeros((2, 2)), np.ones((3, 2)))
    found = PolygonSegmenter().segment(PolygonSet((square, square), lines=lines))
    assert found.warnings == ("Left out because they enclose no area: open lines (2).",)
    with pytest.raises(
        InvalidInputError, match=r"segmenter rooms, which takes its open lines \(2\)"
    ):
        PolygonSegmenter().segment(PolygonSet((square,), lines=lines))


@pytest.mark.parametrize(
    ("rings", "field", "words"),
    [
        ([[[0, 0], [2, 2], [2, 0], [0, 2]]], "polygons[1]", "crosses itself at (1, 1); draw"),
        ([[[0, 0], [1, 1], [2, 2]]], "polygons[1]", "has no area; give three corners"),
        ([[[0, 0], [1, 1]]], "polygons[1].rings[0]", "a ring needs at least three"),
        ([[[0, 0], [1, np.nan], [1, 1]]], "polygons[1].rings[0].points[1]", "is not finite"),
        ([[[0, 0], [1, np.inf], [1, 1]]], "polygons[1].rings[0].points[1]", "is not finite"),
        ([SQUARE, [[6, 6], [9, 6], [6, 9]]], "polygons[1]", "keep holes inside the outer ring"),
        ([], "polygons[1].rings", "is empty; give at least an outer ring"),
    ],
)
def test_an_invalid_polygon_is_named_with_the_remedy(rings, field, words):
    with pytest.raises(InvalidInputError) as caught:
        segmented(([SQUARE], ""), (rings, "bad"))
    assert caught.value.field == field
    assert caught.value.reason == Reason.INVALID_POLYGON
    assert words in caught.value.problem


@pytest.mark.parametrize(
    ("polygons", "words"), [((), "no polygon"), ((([SQUARE], ""),), "one polygon")]
)
def test_fewer_than_two_are_refused(polygons, words):
    with pytest.raises(InvalidInputError, match=f"holds {words}; .* give at least two") as caught:
        segmented(*polygons)
    assert (caught.value.field, caught.value.reason) == ("polygons", Reason.TOO_FEW_OBJECTS)
