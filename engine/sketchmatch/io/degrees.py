"""Longitudes and latitudes: what is taken for such, and metres around a place instead of them."""

from __future__ import annotations

import json
import math
import re
from typing import Any

import numpy as np

from sketchmatch.model import FloatArray

__all__ = ["SPAN", "from_metres", "in_metres", "may_be_degrees", "middle_of", "names_degrees"]

SPAN = 0.1
"""Degrees. A place in metres is larger than that, and a globe's place mostly smaller."""

_EARTH_RADIUS = 6_371_008.8
_DEGREES = re.compile(r"CRS84|EPSG:+4326\b|EPSG:[\d.]*:4326\b|WGS ?84", re.IGNORECASE)


def may_be_degrees(points: FloatArray, document: Any) -> bool:
    """Whether points of a document can be longitudes and latitudes: ``"crs": null`` says no."""
    said = document.get("crs", "") if isinstance(document, dict) else ""
    return said is not None and len(points) > 0 and not (np.abs(points) > (360.0, 90.0)).any()


def names_degrees(document: Any) -> bool:
    """Whether the member ``crs`` of a document says that it has longitudes and latitudes."""
    said = document.get("crs", "") if isinstance(document, dict) else ""
    return bool(_DEGREES.search(json.dumps(said)))


def middle_of(points: FloatArray) -> tuple[float, float]:
    """Return the middle of the box around points."""
    x, y = (points.min(axis=0) + points.max(axis=0)) / 2.0
    return float(x), float(y)


def in_metres(points: FloatArray, middle: tuple[float, float]) -> FloatArray:
    """Return longitudes and latitudes, shape (k, 2), as metres east and north of a place."""
    found: FloatArray = (points - middle) * _lengths(middle)
    return found


def from_metres(points: FloatArray, middle: tuple[float, float]) -> FloatArray:
    """Return longitudes and latitudes, shape (k, 2): what :func:`in_metres` undoes.

    Examples
    --------
    >>> from_metres(np.array([[0.0, 111.195]]), (13.0, 52.0)).round(5).tolist()
    [[13.0, 52.001]]
    """
    found: FloatArray = points / _lengths(middle) + middle
    return found


def _lengths(middle: tuple[float, float]) -> FloatArray:
    """Return how many metres a degree has there, eastwards and northwards."""
    unit = math.radians(1.0) * _EARTH_RADIUS
    return np.array([unit * math.cos(math.radians(middle[1])), unit])
