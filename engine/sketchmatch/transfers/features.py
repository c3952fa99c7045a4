"""What is carried from one scene to another: points, routes and zones, and what became of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
import shapely
from numpy.typing import ArrayLike

from sketchmatch.errors import InvalidInputError, Reason, counted, quoted
from sketchmatch.model import FloatArray
from sketchmatch.model.arrays import frozen_floats
from sketchmatch.model.labels import cleaned_label
from sketchmatch.transfers.mending import mended

__all__ = ["Carried", "Change", "ChangeReason", "Feature", "FeatureKind"]

_FARTHEST = 1e9
_FEWEST = {"point": 1, "route": 2, "zone": 3}


class FeatureKind(StrEnum):
    """What a feature is."""

    POINT = "point"
    ROUTE = "route"
    ZONE = "zone"


@dataclass(frozen=True, eq=False, init=False)
class Feature:
    """A point, a route or a zone with a name.

    Attributes
    ----------
    kind
        Which of them it is.
    rings
        One line of one point; or one line of two or more, the route in its order; or the outline of
        a zone and its holes, each of three or more. Each of shape (k, 2), y up. If an outline
        crosses itself near its ends, as hand-drawn ones do, its tails are cut.
    name
        For people.
    speeds
        Shape (k,), the speed of a route from each of its points on, or None.
    numbers
        For each ring, shape (k,): which given point each of its points is, or comes after; with a
        fraction where tails were cut.

    Raises
    ------
    InvalidInputError
        If it is not what its kind says, with a path within it.
    """

    kind: FeatureKind
    rings: tuple[FloatArray, ...]
    name: str
    speeds: FloatArray | None
    numbers: tuple[FloatArray, ...] = field(init=False)

    def __init__(
        self,
        kind: FeatureKind | str,
        rings: Sequence[ArrayLike],
        name: str = "",
        speeds: ArrayLike | None = None,
    ) -> None:
        if kind not in list(FeatureKind):
            raise _refused("kind", f"is {quoted(kind)}; give {', '.join(FeatureKind)}")
        kind = FeatureKind(kind)
        object.__setattr__(self, "kind", kind)
        object.__setattr__(self, "name", cleaned_label(name))
        if len(rings) < 1 or (kind is not FeatureKind.ZONE and len(rings) > 1):
            sample = "[[1, 2]]" if kind is FeatureKind.POINT else "[[1, 2], [3, 4]]"
            raise _refused(
                "rings", f"are {len(rings)}; give a {kind} a single one, as in ({sample},)"
            )
        lines = tuple(self._checked(ring, k) for k, ring in enumerate(rings))
        if kind is FeatureKind.ZONE:
            lines, numbers = zip(*map(mended, lines), strict=True)
        else:
            numbers = tuple(np.arange(len(line), dtype=np.float64) for line in lines)
        object.__setattr__(self, "rings", tuple(map(frozen_floats, lines)))
        object.__setattr__(self, "numbers", tuple(map(frozen_floats, numbers)))
        if kind is FeatureKind.ZONE:
            _check_area(shapely.Polygon(lines[0], lines[1:]))
        checked = None if speeds is None else self._checked_speeds(speeds, len(lines[0]))
        object.__setattr__(self, "speeds", checked)

    @property
    def points(self) -> FloatArray:
        """The first line, shape (k, 2): all there is of a point or a route."""
        return self.rings[0]

    def _checked(self, given: ArrayLike, k: int) -> FloatArray:
        field = f"rings[{k}]" if self.kind is FeatureKind.ZONE else "points"
        ring = frozen_floats(given)
        if ring.ndim != 2 or ring.shape[1] != 2:
            raise _refused(field, "is not a list of [x, y] pairs of numbers")
        beyond = ~(np.abs(ring) <= _FARTHEST).all(axis=1)
        if beyond.any():
            x, y = ring[np.argmax(beyond)]
            raise _refused(
                field, f"has a point at ({x:g}, {y:g}); give finite numbers up to {_FARTHEST:g}"
            )
        if self.kind is FeatureKind.ZONE and len(ring) > 1 and (ring[0] == ring[-1]).all():
            ring = frozen_floats(ring[:-1])
        fewest = _FEWEST[self.kind]
        if len(ring) < fewest or (self.kind is FeatureKind.POINT and len(ring) > 1):
            exactly = "" if self.kind is FeatureKind.POINT else " or more"
            has = f"has {counted(len(ring), 'point')}"
            raise _refused(field, f"{has}; a {self.kind} has {fewest}{exactly}")
        return ring

    def _checked_speeds(self, given: ArrayLike, count: int) -> FloatArray:
        speeds = frozen_floats(given)
        if self.kind is not FeatureKind.ROUTE:
            raise _refused("speeds", f"are given for a {self.kind}; only routes have speeds")
        if speeds.shape != (count,):
            raise _refused(
                "speeds", f"are {speeds.size} for {count} points; give one for each or none"
            )
        if not ((speeds >= 0.0) & np.isfinite(speeds)).all():
            raise _refused("speeds", "hold one that is negative or not finite; give them in m/s")
        return speeds


class ChangeReason(StrEnum):
    """Why something was not left as the warp carried it."""

    OBSTACLE = "obstacle"
    MOVED_START = "moved_start"
    MOVED_END = "moved_end"
    OTHER_SIDE = "other_side"
    UNREACHABLE = "unreachable"
    BLOCKED = "blocked"
    OUTSIDE = "outside"


@dataclass(frozen=True)
class Change:
    """What was changed about a feature, or is impossible.

    Attributes
    ----------
    reason
        The kind of change.
    first, last
        The first and the last of the transferred points that it is about.
    sentence
        For people.
    """

    reason: ChangeReason
    first: int
    last: int
    sentence: str


@dataclass(frozen=True, eq=False)
class Carried:
    """A feature after the transfer.

    Attributes
    ----------
    kind, name
        Of what was given.
    feature
        The feature there. A route may have more points than the given one, or fewer if a part of it
        cannot be reached; None if nothing of it can.
    deviations
        For each ring, shape (k,): standard deviations of its points, along each axis.
    sources
        For each ring, shape (k,): the given point of each transferred one, or the one before it; a
        fraction for points in between.
    changes
        What was changed, in the order of the points.
    """

    kind: FeatureKind
    name: str
    feature: Feature | None
    deviations: tuple[FloatArray, ...]
    sources: tuple[FloatArray, ...]
    changes: tuple[Change, ...] = ()

    @property
    def deviation(self) -> float:
        """The median of the standard deviations; nan where nothing was carried."""
        if self.feature is None:
            return float("nan")
        return float(np.median(np.concatenate(self.deviations)))

    def changed(self, *changes: Change) -> Carried:
        """Return it with more changes."""
        return replace(self, changes=(*self.changes, *changes))


def _check_area(zone: shapely.Polygon) -> None:
    if zone.is_valid:
        return
    if zone.convex_hull.area == 0.0:
        raise _refused("rings", "enclose no area; draw a zone around what it is to cover")
    raise _refused("rings", "cross themselves or each other; draw a zone without crossing")


def _refused(field: str, problem: str) -> InvalidInputError:
    return InvalidInputError(Reason.INVALID_FIELD, field, problem)
