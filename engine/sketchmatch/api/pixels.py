"""Objects made of pixels: their outlines, and how they lie to each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from sketchmatch.api.forces import APART, MEETING, OVERLAPPING, TOUCHING
from sketchmatch.kernels.raster import filled_pixels, pixel_edges
from sketchmatch.model import BoolArray, Edges, FloatArray, IntArray

__all__ = ["PixelObject", "outlines", "pixel_object", "pixel_relations", "rasterised"]


class PixelObject(NamedTuple):
    """Some pixels of a grid; the pixel at row i and column j is the square [j, j+1] × [i, i+1].

    Attributes
    ----------
    mask
        Shape (rows, columns), row 0 at the bottom: a window that holds all of the object.
    row, column
        Where in the grid the window's first pixel lies.
    """

    mask: BoolArray
    row: int = 0
    column: int = 0


def pixel_object(mask: BoolArray) -> PixelObject:
    """Return the pixels of a mask, row 0 at the bottom, in the smallest window."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if rows.size == 0:
        return PixelObject(mask[:0, :0])
    window = mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return PixelObject(window, int(rows[0]), int(columns[0]))


def rasterised(starts: FloatArray, ends: FloatArray) -> PixelObject:
    """Return the pixels whose centres lie inside an outline that is given in pixels."""
    column, row = np.floor(starts.min(axis=0)).astype(int)
    columns, rows = np.ceil(starts.max(axis=0)).astype(int) - (column, row)
    corner = np.array([column, row], dtype=np.float64)
    mask = filled_pixels(starts - corner, ends - corner, int(rows), int(columns))
    return PixelObject(mask, int(row), int(column))


def outlines(objects: Sequence[PixelObject]) -> Edges:
    """Return the outlines of objects, in pixels."""
    corners = [(item.column, item.row) for item in objects]
    edges = [pixel_edges(item.mask) for item in objects]
    counts = [len(starts) for starts, _ in edges]
    return Edges(
        np.concatenate(
            [starts + corner for (starts, _), corner in zip(edges, corners, strict=True)]
        ),
        np.concatenate([ends + corner for (_, ends), corner in zip(edges, corners, strict=True)]),
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
    )


def pixel_relations(objects: Sequence[PixelObject], pairs: IntArray) -> IntArray:
    """Say of each pair of objects whether they share pixels, touch or lie apart.

    Returns
    -------
    ndarray
        Shape (p,): OVERLAPPING, TOUCHING along a side, MEETING at corners alone, or APART.
    """
    relations = np.full(len(pairs), APART, dtype=np.int64)
    beside = [_grown(item, _SIDES) for item in objects]
    around = [_grown(item, _SIDES_AND_CORNERS) for item in objects]
    for p, (a, b) in enumerate(pairs):
        if _share(around[a], objects[b]):
            relations[p] = TOUCHING if _share(beside[a], objects[b]) else MEETING
            if _share(objects[a], objects[b]):
                relations[p] = OVERLAPPING
    return relations


_SIDES = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], dtype=np.uint8)
_SIDES_AND_CORNERS = np.ones((3, 3), dtype=np.uint8)


def _grown(item: PixelObject, neighbours: NDArray[np.uint8]) -> PixelObject:
    """Return an object with the neighbours of all its pixels."""
    padded = np.pad(item.mask, 1).astype(np.uint8)
    mask = cv2.dilate(padded, neighbours).astype(bool)
    return PixelObject(mask, item.row - 1, item.column - 1)


def _share(a: PixelObject, b: PixelObject) -> bool:
    """Whether some pixel belongs to both."""
    rows = max(a.row, b.row), min(a.row + a.mask.shape[0], b.row + b.mask.shape[0])
    columns = (
        max(a.column, b.column),
        min(a.column + a.mask.shape[1], b.column + b.mask.shape[1]),
    )
    if rows[0] >= rows[1] or columns[0] >= columns[1]:
        return False
    first, second = (
        item.mask[
            rows[0] - item.row : rows[1] - item.row,
            columns[0] - item.column : columns[1] - item.column,
        ]
        for item in (a, b)
    )
    return bool((first & second).any())
