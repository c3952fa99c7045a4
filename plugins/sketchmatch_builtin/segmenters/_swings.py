"""Doors as plans draw them: a leaf that stands open, and the arc that it turns through.

These are no walls: where several doors open into a hall they would cut it to pieces. But they say
where rooms end, however narrow these are.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from sketchmatch.model import FloatArray
from sketchmatch_builtin.segmenters._lines import is_closed, is_straight

__all__ = ["doors_apart", "is_swing"]

# Of the whole drawing's span: how far on both sides of a point the direction of a line is measured,
# and the smallest and the largest leaf.
_ASIDE, _NARROWEST, _WIDEST = 0.004, 0.01, 0.2
# A line has a corner where it turns by more.
_CORNER = math.radians(55.0)
# What an arc turns by, at least and at most; drawn ajar it is less than a quarter of a circle.
_TURNS = (math.radians(25.0), math.radians(130.0))
# Of the radius: how far points leave the arc at most, and of its chord those of a straight leaf.
_ROUND, _STRAIGHT = 0.1, 0.08
# Of the radius: how far a leaf begins from the hinge and ends from the arc, and how thick it is.
_MEETS = 0.2
# Of the radius: how far beyond both ends of a closed leaf the walls go on, by how much more a leaf
# that is drawn may be off them if it is the closed one, and how much longer that is drawn than it
# is, so that it meets the walls.
_IN_LINE, _OPEN, _BEYOND = 0.3, 0.1, 0.1
# In a drawing of more points or arcs, or of more ends at hinges, no doors are looked for, as that
# would take long.
_MOST_POINTS, _MOST_ARCS, _MOST_MEETING = 200_000, 1000, 100_000


class _Pieces(NamedTuple):
    """Parts of lines from corner to corner.

    Attributes
    ----------
    line
        Shape (n,), the line of each.
    first, last
        Shape (n,), the first and the last of its points in that line.
    ends
        Shape (n, 2, 2), these two.
    """

    line: NDArray[np.int64]
    first: NDArray[np.int64]
    last: NDArray[np.int64]
    ends: FloatArray


class _Arc(NamedTuple):
    """A piece that is an arc: its number, the hinge in its middle, and its radius."""

    piece: int
    hinge: FloatArray
    radius: float


def doors_apart(lines: Sequence[FloatArray]) -> tuple[list[FloatArray], list[FloatArray]]:
    """Return lines without the leaves of doors and the arcs at these, and these doors closed.

    An arc is one if a straight line leads from its middle to one of its ends, as does the leaf. A
    leaf may be a narrow box, the arc and it one line, and that closed. It may also be left out, if
    a wall is at the arc's middle and another, or the same, at one of its ends.

    Parameters
    ----------
    lines
        Shape (k, 2) each; at least one has a point.

    Returns
    -------
    list of ndarray, list of ndarray
        What is left of the lines, and for each door that from its hinge to where it closes, shape
        (2, 2), and a little beyond both.
    """
    points = np.concatenate(lines)
    span = float(np.ptp(points, axis=0).max())
    if not span or len(points) > _MOST_POINTS:
        return list(lines), []
    aside, widest = _ASIDE * span, _WIDEST * span
    rolled = [_from_a_corner(line, aside) for line in lines]
    pieces = _pieces(rolled, aside)
    chords = np.linalg.norm(pieces.ends[:, 1] - pieces.ends[:, 0], axis=1)
    may = (chords > 0.0) & (chords < 2.0 * widest) & (pieces.last - pieces.first > 1)
    found = [_arc(k, _points(rolled, pieces, k)) for k in np.flatnonzero(may).tolist()]
    arcs = [arc for arc in found if arc and _NARROWEST * span <= arc.radius <= widest]
    if not 0 < len(arcs) <= _MOST_ARCS:
        return list(lines), []
    swings = list(_swings(arcs, rolled, pieces))
    dropped = {k for arc, leaves in swings for k in (arc.piece, *leaves[0], *leaves[1])}
    alone = [arc for arc in arcs if arc.piece not in dropped]
    walls = _together(_left(rolled, lines, pieces, dropped.union(arc.piece for arc in alone)))
    hung = [(arc, _gap(arc, pieces.ends[arc.piece], walls)) for arc in alone]
    hung = [(arc, gap) for arc, gap in hung if gap is not None]
    left = _left(rolled, lines, pieces, dropped.union(arc.piece for arc, _ in hung))
    walls = _together(left)
    closing = [(arc, [bool(each) for each in leaves]) for arc, leaves in swings]
    closing += [(arc, [False, False]) for arc, gap in hung if gap]
    return left, [_closed(arc, pieces.ends[arc.piece], leaves, walls) for arc, leaves in closing]


def is_swing(line: FloatArray) -> bool:
    """Whether a line, shape (k, 2), is an arc as a door may turn through."""
    return len(line) > 2 and bool(np.ptp(line, axis=0).any()) and _arc(0, line) is not None


def _turns(line: FloatArray, aside: float) -> tuple[FloatArray, FloatArray]:
    """Return how far along a line each point is, and by what it turns there; closed ones are."""
    steps = np.hypot(*np.diff(line, axis=0).T)
    until = np.concatenate([[0.0], steps.cumsum()])
    whole = float(until[-1])
    closed = is_closed(line)
    there = np.stack([until - aside, until + aside])
    there = there % whole if closed else there.clip(0.0, whole)
    around = np.stack([np.interp(there, until, each) for each in line.T], axis=-1)
    before, after = line - around[0], around[1] - line
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    turned = np.abs(np.arctan2(cross, (before * after).sum(axis=1)))
    if not closed:
        turned[[0, -1]] = math.pi
    return until, turned


def _corners(line: FloatArray, aside: float) -> list[int]:
    """Return the points of a line at which it has a corner, the sharpest of those nearby."""
    if len(line) < 3 or not (line[1:] != line[:-1]).any():
        return []
    until, turned = _turns(line, aside)
    found: list[int] = []
    for k in np.flatnonzero(turned > _CORNER).tolist():
        near = slice(*np.searchsorted(until, [until[k] - aside, until[k] + aside]).tolist())
        if turned[k] >= turned[near].max(initial=0.0) - 1e-9:
            found.append(k)
    return found


def _from_a_corner(line: FloatArray, aside: float) -> FloatArray:
    """Return a line that, if it is closed, begins at a corner where it has one."""
    if not is_closed(line):
        return line
    corners = _corners(line, aside)
    if not corners or corners[0] == 0:
        return line
    turned = np.roll(line[:-1], -corners[0], axis=0)
    return np.concatenate([turned, turned[:1]])


def _pieces(lines: Sequence[FloatArray], aside: float) -> _Pieces:
    found = [
        (k, first, last)
        for k, line in enumerate(lines)
        if len(line) > 1
        for first, last in itertools.pairwise(sorted({0, *_corners(line, aside), len(line) - 1}))
    ]
    line, first, last = np.array(found, dtype=np.int64).reshape(-1, 3).T
    ends = [(lines[k][i], lines[k][j]) for k, i, j in found]
    return _Pieces(line, first, last, np.array(ends, dtype=np.float64).reshape(-1, 2, 2))


def _points(lines: Sequence[FloatArray], pieces: _Pieces, k: int) -> FloatArray:
    line = lines[int(pieces.line[k])]
    return line[pieces.first[k] : pieces.last[k] + 1]


def _arc(piece: int, points: FloatArray) -> _Arc | None:
    """Return a piece as an arc of the circle nearest to its points, or None if it is none."""
    about = points - points.mean(axis=0)
    size = float(np.abs(about).max())
    around = np.column_stack([about / size, np.ones(len(points))])
    (x, y, rest), *_ = np.linalg.lstsq(around, ((about / size) ** 2).sum(axis=1))
    middle = np.array([x, y]) / 2.0
    radius = size * math.sqrt(max(float(middle @ middle + rest), 0.0))
    hinge = points.mean(axis=0) + size * middle
    away = np.hypot(*(points - hinge).T)
    if not (np.abs(away - radius) <= _ROUND * radius).all():
        return None
    turns = 2.0 * math.asin(min(math.dist(points[0], points[-1]) / (2.0 * radius), 1.0))
    return _Arc(piece, hinge, radius) if _TURNS[0] <= turns <= _TURNS[1] else None


def _swings(
    arcs: Sequence[_Arc], lines: Sequence[FloatArray], pieces: _Pieces
) -> Iterator[tuple[_Arc, tuple[list[int], list[int]]]]:
    """Yield the arcs of doors, and for each tip of one the pieces that are a leaf up to there."""
    ends = shapely.STRtree(np.asarray(shapely.points(pieces.ends.reshape(-1, 2)), dtype=object))
    near = [_MEETS * arc.radius for arc in arcs]
    leaves: list[tuple[list[int], list[int]]] = [([], []) for _ in arcs]
    met = 0
    for arc, reach, both in zip(arcs, near, leaves, strict=True):
        at_hinge = ends.query(shapely.Point(arc.hinge), "dwithin", reach).tolist()
        met += len(at_hinge)
        if met > _MOST_MEETING:
            return
        for piece, side in (divmod(end, 2) for end in at_hinge):
            to_tips = pieces.ends[arc.piece] - pieces.ends[piece, 1 - side]
            tip = int(np.hypot(*to_tips.T).argmin())
            if (
                piece != arc.piece
                and math.hypot(*to_tips[tip].tolist()) <= reach
                and is_straight(_points(lines, pieces, piece), _STRAIGHT)
            ):
                both[tip].append(piece)
    for arc, reach, both in zip(arcs, near, leaves, strict=True):
        if any(both):
            for tip, sides in zip(pieces.ends[arc.piece], both, strict=True):
                sides.extend(_between(sides, np.stack([arc.hinge, tip]), reach, pieces))
            yield arc, both


def _between(sides: list[int], ends: FloatArray, near: float, pieces: _Pieces) -> list[int]:
    """Return the short pieces at either end of a thick leaf, between its sides."""
    found = []
    for k in {n for side in sides for n in (side - 1, side + 1)}.difference(sides):
        if 0 <= k < len(pieces.line) and pieces.line[k] in pieces.line[sides]:
            away = np.linalg.norm(pieces.ends[k][:, None] - ends, axis=2)
            if (away <= near).all(axis=0).any():
                found.append(k)
    return found


def _gap(arc: _Arc, tips: FloatArray, walls: shapely.Geometry) -> bool | None:
    """Return whether a door, drawn as an arc alone, closes a gap; None if it is no door.

    Walls are at the hinge and at a tip. There is no gap if a wall goes on between these; round a
    corner of walls, without one, is something else.
    """
    spots = np.stack([arc.hinge, *tips, *((arc.hinge + tips) / 2.0)])
    away = np.asarray(shapely.distance(shapely.points(spots), walls) / arc.radius)
    met = away[1:3] <= _MEETS
    gap = bool((met & (away[3:] >= _BEYOND)).any())
    return gap if away[0] <= _MEETS and met.any() and (gap or not met.all()) else None


def _together(lines: Sequence[FloatArray]) -> shapely.Geometry:
    return shapely.MultiLineString([line for line in lines if len(line) > 1])


def _closed(
    arc: _Arc, tips: FloatArray, has_leaf: Sequence[bool], walls: shapely.Geometry
) -> FloatArray:
    """Return the leaf of a door as it is closed: across a gap, in line with the walls at it.

    Some draw the leaf as it stands open, some as it closes, and some both.
    """
    along = tips - arc.hinge
    spots = arc.hinge + np.array([0.5, 1.0, 1.0 + _IN_LINE, -_IN_LINE])[:, None, None] * along
    away = np.asarray(shapely.distance(shapely.points(spots), walls) / arc.radius)
    # There is no gap where a wall is already.
    off = away[1:].sum(axis=0) + _OPEN * np.array(has_leaf) + 9.0 * (away[0] < _BEYOND)
    tip = int(np.argmin(off))
    beyond = _BEYOND * along[tip]
    return np.stack([arc.hinge - beyond, tips[tip] + beyond])


def _left(
    rolled: Sequence[FloatArray],
    lines: Sequence[FloatArray],
    pieces: _Pieces,
    dropped: set[int],
) -> list[FloatArray]:
    """Return what is left of lines, in parts where pieces between them are dropped."""
    touched = {int(pieces.line[k]) for k in dropped}
    found = [line for k, line in enumerate(lines) if k not in touched]
    for line in sorted(touched):
        low, high = np.searchsorted(pieces.line, [line, line + 1]).tolist()
        mine = np.array([k for k in range(low, high) if k not in dropped], dtype=np.int64)
        # What follows each other is one line again.
        runs = np.split(mine, np.flatnonzero(np.diff(mine) != 1) + 1) if mine.size else []
        found += [rolled[line][pieces.first[run[0]] : pieces.last[run[-1]] + 1] for run in runs]
    return found
