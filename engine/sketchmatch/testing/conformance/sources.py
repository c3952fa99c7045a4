"""Sources of each type in which there is something, and such in which there is nothing."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sketchmatch.model import (
    FloatArray,
    Image,
    LabelledPolygon,
    OccupancyGrid,
    PolygonSet,
    Scene,
    Source,
    Stroke,
    StrokeSet,
)
from sketchmatch.model.arrays import frozen_floats
from sketchmatch.testing.drawing import draw_strokes
from sketchmatch.testing.sketches import random_scene

__all__ = ["RESOLUTION", "blank_sources", "memory_of", "sample_source"]

RESOLUTION = 0.05
"""Metres a cell of the grids."""

_FREE, _OCCUPIED, _UNKNOWN = 0, 100, -1
_SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def sample_source(kind: type[Any], *, mirrored: bool = False) -> Source:
    """Return a source with at least two objects, all in its upper half.

    Strokes and polygons are some hexagons apart from each other, a picture the same shapes filled
    with black, and a grid is two rooms with a doorway between them and two things in each.
    """
    if kind is OccupancyGrid:
        cells = _two_rooms()
        return OccupancyGrid(cells[:, ::-1] if mirrored else cells, RESOLUTION)
    scene = random_scene(np.random.default_rng(4), 5)
    factor = [-1.0, 1.0] if mirrored else [1.0, 1.0]
    rings = [item.rings[0] * factor for item in scene.objects]
    if kind is StrokeSet:
        return draw_strokes(Scene.from_polygons(rings), np.random.default_rng(4))
    if kind is PolygonSet:
        return _polygons(*rings)
    return Image(_painted(rings))


def blank_sources(kind: type[Any]) -> Mapping[str, Source]:
    """Return sources that no segmenter can find two objects in, by what they are in words."""
    return _BLANK[kind]


def memory_of(source: Source) -> Mapping[str, NDArray[Any]]:
    """Return the arrays of a source, by the names that they have there."""
    match source:
        case StrokeSet(strokes):
            return {f"strokes[{k}].points": stroke.points for k, stroke in enumerate(strokes)}
        case PolygonSet(polygons):
            return {
                f"polygons[{k}].rings[{n}]": ring
                for k, item in enumerate(polygons)
                for n, ring in enumerate(item.rings)
            }
        case OccupancyGrid(cells):
            return {"cells": cells}
        case Image(pixels):
            return {"pixels": pixels}


def _two_rooms() -> NDArray[np.int8]:
    """Return 12 m × 12 m of cells, of which the upper half is a house."""
    cells = np.full((240, 240), _UNKNOWN, dtype=np.int8)
    house = cells[124:236, 4:236]
    house[:] = _OCCUPIED
    house[4:-4, 4:-4] = _FREE
    house[4:-4, 128:132] = _OCCUPIED
    house[60:78, 128:132] = _FREE
    for row, column, height, width in ((30, 30, 20, 30), (70, 70, 16, 16), (24, 180, 24, 16)):
        house[row : row + height, column : column + width] = _OCCUPIED
    house[70:90, 170:200] = _OCCUPIED
    house[80:90, 186:200] = _FREE
    return cells


def _painted(rings: list[FloatArray]) -> NDArray[np.uint8]:
    """Return 480 × 480 pixels with filled shapes, 2 × 20 wide at most, in the upper half."""
    import cv2

    pixels = np.full((480, 480), 255, dtype=np.uint8)
    corners = np.concatenate(rings)
    low, extent = corners.min(axis=0), np.ptp(corners, axis=0).max()
    for ring in rings:
        x, y = (30.0 + 190.0 * (ring - low) / extent).T
        cv2.fillPoly(pixels, [np.stack([2.0 * x, 240.0 - y], axis=1).astype(np.int32)], (0,))
    return pixels


def _grid(value: int, side: int = 60) -> OccupancyGrid:
    return OccupancyGrid(np.full((side, side), value, dtype=np.int8), RESOLUTION)


def _image(value: int, side: int = 64) -> Image:
    return Image(np.full((side, side), value, dtype=np.uint8))


def _strokes(*points: Any) -> StrokeSet:
    return StrokeSet(tuple(Stroke(np.array(each, dtype=float).reshape(-1, 2)) for each in points))


def _polygons(*rings: Any) -> PolygonSet:
    return PolygonSet(tuple(LabelledPolygon((frozen_floats(ring),)) for ring in rings))


_BLANK: Mapping[type[Any], Mapping[str, Source]] = MappingProxyType(
    {
        StrokeSet: {
            "no stroke": StrokeSet(()),
            "a stroke without points": _strokes([]),
            "dots": _strokes([[0, 0]], [[1, 1], [1, 1]]),
            "one outline": _strokes([*_SQUARE, _SQUARE[0]]),
            "a line": _strokes([[0, 0], [1, 2], [2, 4]]),
            "points that are not finite": _strokes([[0, 0], [np.nan, 1], [1, 1]]),
        },
        PolygonSet: {
            "no polygon": PolygonSet(()),
            "one polygon": _polygons(_SQUARE),
            "polygons without rings": PolygonSet((LabelledPolygon(()), LabelledPolygon(()))),
            "polygons without area": _polygons(_SQUARE[:2], 0.0 * _SQUARE, _SQUARE[[0, 2, 0]]),
            "points that are not finite": _polygons(np.full((4, 2), np.inf), _SQUARE),
        },
        OccupancyGrid: {
            "one cell": _grid(_FREE, 1),
            "free cells alone": _grid(_FREE),
            "occupied cells alone": _grid(_OCCUPIED),
            "unknown cells alone": _grid(_UNKNOWN),
        },
        Image: {
            "one pixel": _image(0, 1),
            "white paper": _image(255),
            "grey paper": _image(128),
            "black paper": _image(0),
        },
    }
)
