"""Outlines of things, around the origin and of area 1, and where things may lie."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from sketchmatch.model import FloatArray
from tests.experiments.people import Shapes

__all__ = [
    "TURNS",
    "WIDTH",
    "apart",
    "box",
    "ellipse",
    "l_shape",
    "of_area_one",
    "polygon",
    "simplified",
    "turned",
]

TURNS = 2.0 * np.pi
WIDTH = 2.0 / np.sqrt(np.pi)
"""Of the circle of area 1."""

_CORNERS = 20


def box(aspect: float = 1.0) -> FloatArray:
    """Return a rectangle that is ``aspect`` times as wide as high."""
    return of_area_one(np.array([[0, 0], [aspect, 0], [aspect, 1], [0, 1]], dtype=float))


def ellipse(aspect: float = 1.0) -> FloatArray:
    """Return an ellipse that is ``aspect`` times as wide as high."""
    angles = np.arange(_CORNERS) * (TURNS / _CORNERS)
    return of_area_one(np.column_stack([aspect * np.cos(angles), np.sin(angles)]))


def l_shape(aspect: float, arm: float) -> FloatArray:
    """Return a rectangle without its upper right corner; ``arm`` is the share that is left."""
    w, h, a, b = aspect, 1.0, arm * aspect, arm
    return of_area_one(np.array([[0, 0], [w, 0], [w, b], [a, b], [a, h], [0, h]], dtype=float))


def polygon(rng: np.random.Generator, corners: int) -> FloatArray:
    """Return a polygon whose corners lie at about equal angles and unequal distances."""
    angles = (np.arange(corners) + rng.uniform(-0.3, 0.3, corners)) * (TURNS / corners)
    spokes = rng.uniform(0.6, 1.2, corners)
    return of_area_one(np.column_stack([spokes * np.cos(angles), spokes * np.sin(angles)]))


def of_area_one(ring: FloatArray) -> FloatArray:
    """Return a ring moved to the origin and scaled to area 1."""
    outline = shapely.Polygon(ring)
    centre = outline.centroid
    scaled: FloatArray = (ring - [centre.x, centre.y]) / np.sqrt(outline.area)
    return scaled


def simplified(ring: FloatArray, shapes: Shapes) -> FloatArray:
    """Return what somebody draws for an outline: itself, or a box or an ellipse as large."""
    if shapes is Shapes.OUTLINES:
        return ring
    outline = shapely.Polygon(ring)
    around = shapely.get_coordinates(shapely.minimum_rotated_rectangle(outline))
    sides = np.diff(around[:3], axis=0)
    width, height = np.hypot(*sides.T)
    plain = box(width / height) if shapes is Shapes.BOXES else ellipse(width / height)
    heading = float(np.arctan2(sides[0, 1], sides[0, 0]))
    centre = shapely.get_coordinates(outline.centroid)[0]
    drawn: FloatArray = turned(plain, heading) * np.sqrt(outline.area) + centre
    return drawn


def turned(points: FloatArray, angle: float) -> FloatArray:
    """Return points turned counter-clockwise about the origin."""
    c, s = np.cos(angle), np.sin(angle)
    rotated: FloatArray = points @ np.array([[c, s], [-s, c]])
    return rotated


def apart(rings: Sequence[FloatArray]) -> bool:
    """Whether no two outlines meet."""
    outlines = [shapely.Polygon(ring) for ring in rings]
    tree = shapely.STRtree(outlines)
    first, second = tree.query(outlines, predicate="intersects")
    return bool((first == second).all())
