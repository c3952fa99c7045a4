"""A pen stroke by its length: points at distances along it, and parts of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np

from sketchmatch.model import FloatArray
from sketchmatch.model.caching import cached_property

__all__ = ["LATELY", "LONGEST", "SAMPLES", "Trace", "once", "span_of", "traced"]

# Points that stand for a stroke where strokes are compared; outlines are made of all.
SAMPLES = 24
# What is drawn is looked at again and again, while most strokes stay: so many of those met lately
# are known, up to so many points each.
LATELY = 512
LONGEST = 2048

_Asked = ParamSpec("_Asked")
_Found = TypeVar("_Found")


@dataclass(frozen=True, eq=False)
class Trace:
    """A stroke.

    Attributes
    ----------
    points
        Shape (k, 2), two or more, none like the one before it.
    way
        Shape (k,), distance of each from the first along the stroke.
    samples
        Shape (SAMPLES, 2), points at even distances.
    span
        Largest distance between two samples.
    """

    points: FloatArray
    way: FloatArray
    samples: FloatArray
    span: float

    @cached_property
    def known(self) -> dict[Any, Any]:
        """What was found out about it, for :func:`once`."""
        return {}

    @property
    def length(self) -> float:
        """Length of the stroke."""
        return float(self.way[-1])

    @property
    def size(self) -> float:
        """Larger side of the box around it."""
        return float(np.ptp(self.points, axis=0).max())

    def at(self, distances: FloatArray) -> FloatArray:
        """Return the points at distances along the stroke, shape (…, 2)."""
        return _at(self.points, self.way, distances)

    def part(self, start: float, end: float) -> FloatArray:
        """Return the points from one distance to another, both ends included."""
        inner = self.points[(self.way > start) & (self.way < end)]
        first, last = self.at(np.array([start, end]))
        return np.concatenate([first[None], inner, last[None]])


def traced(points: FloatArray) -> Trace:
    """Return a stroke with its measures: the same one for the same points, if met lately."""
    if len(points) > LONGEST:
        return _measured(points)
    return _met_lately(np.ascontiguousarray(points, dtype=np.float64).tobytes())


def once(
    work: Callable[Concatenate[Trace, _Asked], _Found],
) -> Callable[Concatenate[Trace, _Asked], _Found]:
    """Let a function find out about each stroke once what it is asked, as long as that is known."""

    @wraps(work)
    def known(stroke: Trace, /, *asked: _Asked.args, **named: _Asked.kwargs) -> _Found:
        key = (work.__name__, *asked, *named.items())
        if key not in stroke.known:
            stroke.known[key] = work(stroke, *asked, **named)
        found: _Found = stroke.known[key]
        return found

    return known


@lru_cache(maxsize=LATELY)
def _met_lately(points: bytes) -> Trace:
    return _measured(np.frombuffer(points).reshape(-1, 2))


def _measured(points: FloatArray) -> Trace:
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    samples = _at(points, way, np.linspace(0.0, way[-1], SAMPLES))
    return Trace(points, way, samples, span_of(samples))


def span_of(points: FloatArray) -> float:
    """Return the largest distance between any two of a few points."""
    x, y = points.T
    return float(np.sqrt(((x[:, None] - x) ** 2 + (y[:, None] - y) ** 2).max()))


def _at(points: FloatArray, way: FloatArray, distances: FloatArray) -> FloatArray:
    x, y = points.T
    return np.stack([np.interp(distances, way, x), np.interp(distances, way, y)], axis=-1)
