"""Things that are drawn in a floor plan, such as furniture: closed lines that bound no room."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely

from sketchmatch.model import FloatArray, Landmark, Stroke
from sketchmatch_builtin.segmenters._doorways import Labels
from sketchmatch_builtin.segmenters._lines import is_outline, is_straight, plain_outlines
from sketchmatch_builtin.segmenters._merging import groups

__all__ = [
    "Things",
    "between_walls",
    "dimensions",
    "paper",
    "seen",
    "standing",
    "things_in",
    "within",
]

# Of the area of the hull of all that is drawn: the largest thing.
_LARGEST = 0.06
# … and most of all that touch walls.
_FULL = 0.3
# Of a room: what things fill at most.
_MOST = 0.5
# Of the square of the way around it: the least area. What is longer than seven times its width is
# a wall.
_THICK = 0.027
# Of the span of all: what is nearer to each other touches.
_NEAR = 0.003
# So many parallel lines are of paper: as long as the longest, at like distances, in radians of one
# direction; of the longest, and of the usual distance.
_RULED, _AS_LONG, _PARALLEL, _LIKE = 8, 0.98, 0.005, 0.03
# So many are of a grid, whose lines are at most so wide, of the widest of all; of the pairs of its
# lines in different directions those that cross.
_GRID, _THIN, _CROSSING = 3, 0.2, 0.5
# Of ruled lines that part rooms: how many of their ends are at others, and how many of them cross
# others at most.
_ENDED, _CROSSED = 0.5, 0.25
# Of its length: what is nearer to a line than this is that line.
_TWICE = 1e-6
# Of the distances between them: those that are so many times the usual one.
_EVEN = 0.9
# Of the span of all: what is nearer to the border of a filling is not hidden by it.
_BORDER = 0.001
# Outlines that may be hidden, times points of those that hide: of more, in some seconds, none is.
_MOST_HIDING = 1_000_000
# Lines of a dimension: it and what ends it.
_FEWEST = 3
# Of the length of a dimension line: how long what ends it is, and how far from its end that may be.
_TICK, _AT_END = 0.1, 0.05
# It is longer than this share of the span of all, and leaves its chord by no more than that.
_SHORTEST, _STRAIGHT = 0.05, 0.01


class Things(NamedTuple):
    """Lines that may be things.

    Attributes
    ----------
    free
        The lines of each thing that touches nothing else.
    touching
        Those that touch other lines, and have no name in them.
    """

    free: list[list[int]]
    touching: list[int]


def paper(lines: Sequence[FloatArray], widths: Sequence[float] = ()) -> frozenset[int]:
    """Return which lines, each of shape (k, 2), are of ruled paper: parallel, and evenly apart.

    They are many; or, in two directions, at least a few that cross most of the others and are much
    thinner than what is drawn on them.

    Parameters
    ----------
    lines
        The lines of a plan.
    widths
        How wide each is drawn; left out, that is not known.
    """
    which = [k for k, line in enumerate(lines) if len(line) == 2 and (line[0] != line[1]).any()]
    found = {k for rules in _ruled(lines, which, _RULED) for k in rules}
    thin = _THIN * max(widths, default=0.0)
    if thin > 0.0:
        thinner = [k for k in which if 0.0 < widths[k] <= thin]
        families = _ruled(lines, thinner, _GRID)
        drawn = [np.array([shapely.LineString(lines[k]) for k in each]) for each in families]
        for a, b in itertools.combinations(range(len(families)), 2):
            if shapely.intersects(drawn[a][:, None], drawn[b]).mean() >= _CROSSING:
                found.update(families[a], families[b])
    return frozenset(found)


def between_walls(lines: Sequence[FloatArray], ruled: frozenset[int]) -> frozenset[int]:
    """Return which ruled lines may be walls between rooms: they end at others and cross none.

    Lines of paper go on beneath all that is drawn, and end at nothing but the border of a sheet.

    Parameters
    ----------
    lines
        The lines of a plan, of shape (k, 2) each.
    ruled
        Which of them :func:`paper` found.
    """
    if not ruled:
        return frozenset()
    rest = [line for k, line in enumerate(lines) if k not in ruled and len(line) > 1]
    others = np.array([shapely.LineString(line) for line in rest], dtype=object)
    near = _NEAR * float(np.ptp(np.concatenate(lines), axis=0).max())
    tree, found = shapely.STRtree(others), set[int]()
    for which in _ruled(lines, sorted(ruled), _RULED):
        drawn = np.array([shapely.LineString(lines[k]) for k in which], dtype=object)
        points = np.concatenate([lines[k] for k in which])
        ends = np.asarray(shapely.points(points), dtype=object)
        ended = np.unique(tree.query(ends, "dwithin", near)[0])
        one, other = tree.query(drawn, "intersects")
        meeting = shapely.intersection(drawn[one], others[other])
        # What ends at a wall may do so a little beyond it; closed lines end nowhere.
        crossing = shapely.get_dimensions(meeting) == 0
        for side in (drawn[one], others[other]):
            crossing &= ~(shapely.distance(meeting, shapely.boundary(side)) <= near)
        crossed = np.unique(one[crossing])
        if len(ended) >= _ENDED * len(ends) and len(crossed) <= _CROSSED * len(which):
            found.update(which)
    return frozenset(found)


def _ruled(lines: Sequence[FloatArray], which: Sequence[int], fewest: int) -> list[list[int]]:
    """Return which of some straight lines are ruled together, each of at least so many places."""
    if len(which) < fewest:
        return []
    ends = np.array([lines[k] for k in which])
    steps = ends[:, 1] - ends[:, 0]
    lengths = np.hypot(*steps.T)
    # A line is the same from either end.
    direction = np.arctan2(steps[:, 1], steps[:, 0]) % math.pi
    found: list[list[int]] = []
    seen = np.zeros(len(which), dtype=bool)
    for k in np.argsort(-lengths).tolist():
        turned = np.abs((direction - direction[k] + math.pi / 2.0) % math.pi - math.pi / 2.0)
        same = (turned <= _PARALLEL) & (lengths >= _AS_LONG * lengths[k])
        same &= lengths <= lengths[k] / _AS_LONG
        if seen[k] or same.sum() < fewest:
            continue
        across = np.array([-steps[k, 1], steps[k, 0]]) / lengths[k]
        gaps = np.diff(np.sort(ends[same].mean(axis=1) @ across))
        # What is drawn twice is one line.
        gaps = gaps[gaps > _TWICE * lengths[k]]
        if len(gaps) < fewest - 1:
            continue
        apart = gaps / np.median(gaps)
        if (np.abs(apart - np.round(apart)) <= _LIKE).mean() >= _EVEN:
            seen |= same
            found.append([which[j] for j in np.flatnonzero(same).tolist()])
    return found


def dimensions(lines: Sequence[FloatArray]) -> frozenset[int]:
    """Return which lines, each of shape (k, 2), say how long something is.

    A straight line does, and what is drawn at both of its ends, as ticks and arrowheads are, if
    these touch nothing else.
    """
    which = [k for k, line in enumerate(lines) if len(line) > 1]
    if len(which) < _FEWEST:
        return frozenset()
    drawn = np.array([shapely.LineString(lines[k]) for k in which], dtype=object)
    span = float(np.ptp(shapely.get_coordinates(drawn), axis=0).max())
    group = groups(len(drawn), shapely.STRtree(drawn).query(drawn, "dwithin", _NEAR * span))
    found: list[int] = []
    for members in np.split(np.argsort(group, kind="stable"), np.bincount(group).cumsum()[:-1]):
        if len(members) < _FEWEST:
            continue
        sizes = np.ptp(shapely.bounds(drawn[members]).reshape(-1, 2, 2), axis=1).max(axis=1)
        longest = members[int(sizes.argmax())]
        chord = lines[which[longest]][[0, -1]]
        length = math.dist(*chord)
        if length < _SHORTEST * span or not is_straight(lines[which[longest]], _STRAIGHT):
            continue
        ends, others = shapely.points(chord), drawn[members[members != longest]]
        at_ends = [shapely.distance(others, end) <= _AT_END * length for end in ends]
        if (np.sort(sizes)[:-1] <= _TICK * length).all() and all(map(np.any, at_ends)):
            found += [which[k] for k in members.tolist()]
    return frozenset(found)


def seen(strokes: Sequence[Stroke]) -> list[FloatArray]:
    """Return the lines of strokes but for what later ones hide, where either of the two is large.

    So rooms are drawn over each other, and over corridors. Things are whole beneath things, open
    lines beneath all, and what lies along the border of a filling is seen. What crosses itself
    hides nothing, and is whole.
    """
    lines = [stroke.points for stroke in strokes]
    outlines = plain_outlines(lines)
    covers = np.array([k for k in outlines if strokes[k].opaque], dtype=np.int64)
    if not len(covers):
        return lines
    whole = shapely.MultiPoint(np.concatenate(lines))
    least = _LARGEST * whole.convex_hull.area
    large = {k for k, outline in outlines.items() if outline.area > least}
    points = sum(len(lines[k]) * len(outlines if k in large else large) for k in covers.tolist())
    if points > _MOST_HIDING:
        return lines
    inward = _BORDER * float(np.ptp(shapely.get_coordinates(whole), axis=0).max())
    hiding = shapely.buffer(np.array([outlines[k] for k in covers], dtype=object), -inward)
    wide = np.array([k in large for k in covers.tolist()])
    tree = shapely.STRtree(hiding)
    found: list[FloatArray] = []
    for k, line in enumerate(lines):
        above = np.zeros(0, dtype=np.int64)
        if k in outlines:
            above = tree.query(shapely.LineString(line), "intersects")
            above = above[(covers[above] > k) & (wide[above] | (k in large))]
        if not len(above):
            found.append(line)
            continue
        left = shapely.LineString(line) - shapely.union_all(hiding[above])
        parts = shapely.get_parts(shapely.line_merge(left))
        found += [shapely.get_coordinates(part) for part in parts if part.length]
    return found


def things_in(lines: Sequence[FloatArray], names: Sequence[Landmark]) -> Things:
    """Return which lines, each of shape (k, 2), may be things: small closed ones, no thin walls.

    Parameters
    ----------
    lines
        The lines of a plan.
    names
        What is written in it.
    """
    closed = [k for k, line in enumerate(lines) if is_outline(line)]
    if not closed:
        return Things([], [])
    outlines = np.array([shapely.Polygon(lines[k]) for k in closed], dtype=object)
    whole = shapely.MultiPoint(np.concatenate(lines))
    areas = shapely.area(outlines)
    small = (areas > 0.0) & (areas <= _LARGEST * whole.convex_hull.area)
    small &= areas >= _THICK * shapely.length(outlines) ** 2
    which, outlines = np.array(closed)[small], outlines[small]
    near = _NEAR * float(np.ptp(shapely.get_coordinates(whole), axis=0).max())
    aside = {*which.tolist()} | within(lines, which.tolist())
    rest = [line for k, line in enumerate(lines) if k not in aside]
    walls = [shapely.LineString(line) for line in rest if len(line) > 1]
    if not walls:
        return Things([], [])
    pairs = shapely.STRtree(outlines).query(outlines, "dwithin", near)
    group = groups(len(outlines), pairs)
    touches = np.zeros(len(outlines), dtype=bool)
    touches[shapely.STRtree(walls).query(outlines, "dwithin", near)[0]] = True
    touching = np.isin(group, group[touches])
    written = shapely.MultiPoint([item.point for item in names])
    unnamed = touching & ~shapely.intersects(outlines, written)
    # What covers so much is rooms.
    unnamed &= shapely.area(outlines[unnamed]).sum() <= _FULL * whole.convex_hull.area
    free = [which[~touching & (group == k)].tolist() for k in np.unique(group[~touching])]
    return Things(free, which[unnamed].tolist())


def within(lines: Sequence[FloatArray], outlines: Sequence[int]) -> set[int]:
    """Return which lines, each of shape (k, 2), are drawn in others that are closed."""
    others = np.array([k for k, line in enumerate(lines) if len(line) > 1], dtype=np.int64)
    drawn = np.array([shapely.LineString(lines[k]) for k in others], dtype=object)
    if not len(drawn):
        return set()
    near = _NEAR * float(np.ptp(shapely.get_coordinates(drawn), axis=0).max())
    around = shapely.buffer(np.array([_outline(lines[k]) for k in outlines], dtype=object), near)
    inner = shapely.STRtree(drawn).query(around, "contains")[1]
    return {*others[inner].tolist()} - {*outlines}


def standing(
    free: Sequence[Sequence[int]],
    lines: Sequence[FloatArray],
    names: Sequence[Landmark],
    rooms: Labels,
    cells: FloatArray,
) -> list[int]:
    """Return the lines of free things that stand in a room.

    Of several with names in a place without one of its own, these are rooms, and so are those that
    fill most of a place, between which there is hardly a way.

    Parameters
    ----------
    free
        As in :class:`Things`.
    lines, names
        Of the plan.
    rooms
        The number of each cell's room without all things, 0 for none.
    cells
        The side of a cell, and where the first one is: (side, x, y).
    """
    outlines = [shapely.union_all([_outline(lines[k]) for k in each]) for each in free]
    things = shapely.union_all(outlines)
    spots = [shapely.Point(item.point) for item in names]
    own = Counter(
        _room_at(np.array([item.point]), rooms, cells)
        for item, spot in zip(names, spots, strict=True)
        if not things.intersects(spot)
    )
    where = [_room_at(np.concatenate([lines[k] for k in each]), rooms, cells) for each in free]
    named = Counter(
        room
        for room, outline in zip(where, outlines, strict=True)
        if shapely.intersects(outline, spots).any()
    )
    filled = np.bincount(where, shapely.area(outlines), minlength=int(rooms.max()) + 1)
    full = filled > _MOST * np.bincount(rooms.ravel()) * cells[0] ** 2
    return [
        k
        for room, each in zip(where, free, strict=True)
        if room and not full[room] and (named[room] < 2 or own[room])
        for k in each
    ]


def _outline(line: FloatArray) -> shapely.Geometry:
    """Return what a closed line encloses, or, where it crosses itself, what is around it.

    To part the loops of a scribble takes the third power of its points.
    """
    outline = shapely.Polygon(line)
    return outline if outline.is_valid else outline.convex_hull


def _room_at(points: FloatArray, rooms: Labels, cells: FloatArray) -> int:
    """Return the room in which most of some points are, or 0."""
    column, row = ((points - cells[1:]) / cells[0]).astype(int).T
    rows, columns = rooms.shape
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    count = np.bincount(rooms[row[inside], column[inside]], minlength=1)
    return int(count.argmax())
