"""Small shapes in a row are writing."""

import numpy as np
import pytest

from sketchmatch_builtin.segmenters._writing import written

TYPICAL = 10.0


def letters(*places, size=1.0, tall=1.0):
    """Boxes of letters, each from its lower left corner."""
    corners = np.array([(0, 0), (size, 0), (size, tall), (0, tall)], dtype=float)
    return [corners + place for place in places]


def row(count, y=0.0, step=1.5):
    return [(step * k, y) for k in range(count)]


@pytest.mark.parametrize(
    ("places", "opened", "count"),
    [
        (row(3), 3, 3),
        (row(3), 1, 3),
        (row(4), 1, 0),  # most of it closed
        (row(2), 2, 0),
        (row(3, step=1.55), 3, 3),
        (row(3, step=1.65), 3, 0),  # too far apart
        ([(0, 1.5 * k) for k in range(3)], 3, 3),  # downwards
        ([(0, 0), (1.5, 0.55), (3, 0)], 3, 3),  # as high as 1.6 letters
        ([(0, 0), (1.5, 0.65), (3, 0)], 3, 0),
        ([(0.2 * k, 0) for k in range(3)], 3, 0),  # upon each other, not along a row
        ([(x, y) for x, _ in row(3) for y in (0, 1.5, 3)], 9, 0),  # a block
        ([*row(2), *row(4, 20.0)], 6, 4),  # what is no row is passed over
    ],
)
def test_open_shapes_close_to_each_other_in_a_row_are_writing(places, opened, count):
    closed = [k >= opened for k in range(len(places))]
    found = written(letters(*places), closed, TYPICAL)
    assert found == frozenset(range(len(places))[len(places) - count :])


@pytest.mark.parametrize(("size", "count"), [(2.9, 3), (3.1, 0)])
def test_shapes_as_large_as_objects_are_no_letters(size, count):
    places = row(3, step=1.2 * size)
    assert len(written(letters(*places, size=size), [False] * 3, TYPICAL)) == count


@pytest.mark.parametrize(("size", "rows", "count"), [(1.9, 2, 6), (1.9, 1, 0), (2.1, 2, 0)])
def test_rows_of_closed_shapes_are_writing_if_there_are_several(size, rows, count):
    places = [place for k in range(rows) for place in row(3, 50.0 * k, 1.2 * size)]
    boxes = letters(*places, size=size, tall=size)
    assert len(written(boxes, [True] * len(places), TYPICAL)) == count


def test_dashes_along_a_line_are_a_row():
    assert len(written(letters(*row(3), tall=0.0), [False] * 3, TYPICAL)) == 3


def test_dots_are_no_letters():
    assert not written(letters(*row(3), size=0.0, tall=0.0), [False] * 3, TYPICAL)


def test_the_parts_of_one_outline_are_one_letter():
    boxes, closed = letters(*row(4)), [False] * 4
    assert len(written(boxes, closed, TYPICAL, [(0, 1)])) == 4
    assert not written(boxes, closed, TYPICAL, [(0, 1), (2, 3)])
    assert not written(boxes, closed, TYPICAL, [(0, 1, 2)])
    assert len(written(boxes, closed, TYPICAL, [(0, 1, 2, 9)])) == 4  # of which one is elsewhere
