"""Sources by hand: their form is checked where they are made."""

from dataclasses import replace

import numpy as np
import pytest

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import Image, OccupancyGrid, PolygonSet, Stroke, StrokeSet
from sketchmatch.pipeline.segment import segment
from sketchmatch.registry import Kind, default_registry
from sketchmatch.testing.conformance.sources import sample_source

CELLS = np.array([[0, 100], [-1, 50]])


def test_a_stroke_keeps_points_and_times():
    stroke = Stroke([[0, 0], [1, 2]], times=[0.0, 0.1], label="bed")
    assert stroke.points.shape == (2, 2)
    assert stroke.times.tolist() == [0.0, 0.1]
    assert not stroke.points.flags.writeable


@pytest.mark.parametrize(
    ("points", "times", "field"),
    [
        ([1, 2, 3], None, "points"),
        ([[1, 2, 3]], None, "points"),
        ([[0, 0], [1, 1]], [0.0], "times"),
    ],
)
def test_a_stroke_of_another_form_is_refused(points, times, field):
    with pytest.raises(InvalidInputError) as caught:
        Stroke(points, times)
    assert (caught.value.reason, caught.value.field) == (Reason.INVALID_STROKE, field)


def test_a_grid_keeps_small_read_only_cells():
    grid = OccupancyGrid(CELLS, 0.05)
    assert grid.cells.dtype == np.int8
    assert not grid.cells.flags.writeable
    assert grid.cells.tolist() == CELLS.tolist()


@pytest.mark.parametrize(
    ("changes", "field", "words"),
    [
        ({"cells": np.zeros((0, 3))}, "cells", "is empty"),
        ({"cells": np.zeros(3)}, "cells", "rows × columns"),
        ({"cells": [[0, 101]]}, "cells", "outside"),
        ({"cells": [[-2, 0]]}, "cells", "outside"),
        ({"resolution": 0.0}, "resolution", "positive"),
        ({"resolution": -0.1}, "resolution", "positive"),
        ({"resolution": float("nan")}, "resolution", "positive"),
        ({"resolution": float("inf")}, "resolution", "positive"),
        ({"origin": (0.0, 1.0)}, "origin", "yaw"),
        ({"origin": (0.0, float("nan"), 0.0)}, "origin", "not finite"),
    ],
)
def test_a_grid_that_cannot_be_is_refused(changes, field, words):
    with pytest.raises(InvalidInputError, match=words) as caught:
        OccupancyGrid(**{"cells": CELLS, "resolution": 0.05, **changes})
    assert (caught.value.reason, caught.value.field) == (Reason.INVALID_GRID, field)


@pytest.mark.parametrize(
    "pixels",
    [
        np.zeros((0, 4), np.uint8),
        np.zeros((4, 4)),
        np.zeros(4, np.uint8),
        np.zeros((4, 4, 4), np.uint8),
        np.zeros((4, 4, 3)),
        np.zeros((0, 4, 3), np.uint8),
    ],
)
def test_an_image_is_grey_or_red_green_and_blue_of_eight_bits(pixels):
    with pytest.raises(InvalidInputError) as caught:
        Image(pixels)
    assert (caught.value.reason, caught.value.field) == (Reason.INVALID_IMAGE, "pixels")


@pytest.mark.parametrize("shape", [(2, 3), (2, 3, 3)])
def test_an_image_cannot_be_written_to(shape):
    assert not Image(np.zeros(shape, np.uint8)).pixels.flags.writeable


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("strokes", StrokeSet),
        ("polygons", PolygonSet),
        ("occupancy-grid", OccupancyGrid),
        ("rooms", OccupancyGrid),
    ],
)
def test_what_a_reader_noted_stands_once_before_the_warnings(name, kind):
    registry = default_registry()
    segmenter = registry.find(Kind.SEGMENTER, name).algorithm()
    source = sample_source(kind)
    warnings = segmenter.segment(source).warnings
    noted = replace(source, notes=("The\tpaper  was left out.",))
    found = segment(noted, segmenter, registry, "sketch")
    assert found.warnings == ("The paper was left out.", *warnings)
