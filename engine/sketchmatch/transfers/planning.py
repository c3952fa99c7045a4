"""Routes kept out of obstacles: planned again where the warp leads into one.

A part of a route that comes too near to obstacles is replaced by the cheapest way between its ends
(scikit-image's ``MCP_Geometric``, Dijkstra's algorithm on cells), which stays near the carried
route and rather in the middle of free space, and then is pulled smooth. Objects are passed on the
side on which they were drawn: the way that led past one on the other side is closed, and planned
again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import shapely

from sketchmatch.model import BoolArray, FloatArray, IntArray
from sketchmatch.transfers.features import Change, ChangeReason
from sketchmatch.transfers.obstacles import Obstacles, Window, sampled

__all__ = ["Landmarks", "Way", "kept_clear"]

_MARGIN = 2.0
"""Metres, or radii times 8, around a part that is planned again, at first."""
_STRAY = 1.0
_HUG = 0.5
_SMOOTHINGS = 40
_SLACK = 0.5
"""In cells: how much farther away a line stays that is pulled smooth, to be simplified."""
_SHARES = np.arange(1, 17)[:, None, None] / 16.0
"""Where a leg is looked at."""
_MOST_BARRIERS = 6
_MOST_STRETCHES = 8
_MANY_CELLS = 400_000
"""More than these are first searched by blocks."""


@dataclass(frozen=True, eq=False)
class Landmarks:
    """The objects that a route was drawn around, on both sides.

    Attributes
    ----------
    drawn, carried
        Shape (n, 2), where they were drawn, and where they are.
    sizes
        Shape (n,), the roots of the areas that they have there.
    names
        For people.
    """

    drawn: FloatArray
    carried: FloatArray
    sizes: FloatArray
    names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Way:
    """A line through points.

    Attributes
    ----------
    points
        Shape (k, 2).
    sources
        Shape (k,): which of the given points each is, or comes after, with a fraction.
    drawn
        Shape (k, 2), where each was drawn.
    """

    points: FloatArray
    sources: FloatArray
    drawn: FloatArray

    def part(self, first: int, last: int) -> Way:
        """Return the part from one point up to another, with both."""
        chosen = slice(first, last + 1)
        return Way(self.points[chosen], self.sources[chosen], self.drawn[chosen])

    def __add__(self, other: Way) -> Way:
        return Way(
            np.vstack([self.points, other.points]),
            np.concatenate([self.sources, other.sources]),
            np.vstack([self.drawn, other.drawn]),
        )


def kept_clear(
    way: Way, obstacles: Obstacles, radius: float, landmarks: Landmarks, unit: str = "m"
) -> tuple[Way | None, tuple[Change, ...]]:
    """Return a way that keeps its distance from obstacles, and what was changed.

    Parameters
    ----------
    way
        As it was carried, with points no farther apart than a cell or two.
    obstacles, radius
        What it keeps away from, and how far.
    landmarks
        What was drawn, to pass it on the same side.
    unit
        Of the radius, for sentences.

    Returns
    -------
    Way or None
        As far as it can be reached from its beginning; None if nowhere.
    tuple of Change
        Their indices are those of the returned way.
    """
    clear = _clear_stretches(way, obstacles, radius)
    if not clear.any():
        where = "is beyond the grid" if not obstacles.inside(way.points).any() else "is blocked"
        return None, (Change(ChangeReason.UNREACHABLE, 0, 0, f"All of it {where}."),)
    first, last = (int(k) for k in np.flatnonzero(clear)[[0, -1]])
    changes: list[Change] = []
    if first > 0:
        changes.append(_moved(way, 0, first, ChangeReason.MOVED_START, "begins", unit))
    done = way.part(first, first)
    at = first
    while at < last:
        if clear[at + 1]:
            blocked = np.flatnonzero(~clear[at + 1 : last + 1])
            until = at + int(blocked[0]) if blocked.size else last
            done, at = done + way.part(at + 1, until), until
            continue
        # What is clear may be the hollow of a thing of which only the outline was seen.
        for beyond in _reappearing(clear, at):
            found, sides = _around(way, at, beyond, obstacles, radius, landmarks)
            if found is not None:
                break
        if found is None:
            sentence = (
                f"What comes after point {len(done.points)} cannot be reached: obstacles leave no "
                f"way of {radius:g} {unit} to each side; the route ends there."
            )
            end = len(done.points) - 1
            changes.append(Change(ChangeReason.UNREACHABLE, end, end, sentence))
            return _finished(done, changes)
        begin = len(done.points) - 1
        done = done + found
        named = _named(way.part(at, beyond), landmarks)
        sentence = f"Led around{named}, to stay {radius:g} {unit} away from obstacles."
        changes.append(Change(ChangeReason.OBSTACLE, begin, len(done.points) - 1, sentence))
        changes += [replace(each, first=begin, last=len(done.points) - 1) for each in sides]
        at = beyond
    if last < len(way.points) - 1:
        end = len(done.points) - 1
        moved = _moved(way, len(way.points) - 1, last, ChangeReason.MOVED_END, "ends", unit)
        changes.append(replace(moved, first=end, last=end))
    return _finished(done, changes)


def _reappearing(clear: BoolArray, at: int) -> list[int]:
    """Return where stretches that are clear begin after a point that ends one."""
    begins = at + 1 + np.flatnonzero(clear[at + 1 :] & ~clear[at:-1])
    return [int(k) for k in begins[:_MOST_STRETCHES]]


def _finished(done: Way, changes: list[Change]) -> tuple[Way | None, tuple[Change, ...]]:
    if len(done.points) < 2:
        return None, tuple(replace(each, first=0, last=0) for each in changes)
    return done, tuple(changes)


def _clear_stretches(way: Way, obstacles: Obstacles, radius: float) -> BoolArray:
    """Return which points are clear; a point after a leg that is not clear counts as none."""
    clear = obstacles.clear(way.points, radius)
    legs = way.points[:-1] + _SHARES * (way.points[1:] - way.points[:-1])
    passed = obstacles.clear(legs.reshape(-1, 2), radius).reshape(legs.shape[:2]).all(axis=0)
    clear[1:] &= passed | ~clear[:-1]
    return clear


def _moved(way: Way, given: int, taken: int, reason: ChangeReason, verb: str, unit: str) -> Change:
    away = float(np.hypot(*(way.points[taken] - way.points[given])))
    sentence = f"It {verb} {away:.2g} {unit} from where it was carried to: there are obstacles."
    return Change(reason, 0, 0, sentence)


def _named(part: Way, landmarks: Landmarks) -> str:
    """Return which object a part of a way led into, for people; nothing where it is none."""
    line = shapely.LineString(part.points)
    away = shapely.distance(shapely.points(landmarks.carried), line) / landmarks.sizes
    nearest = int(np.argmin(away))
    return f" {landmarks.names[nearest]}" if away[nearest] <= 1.0 else ""


def _around(
    way: Way, first: int, last: int, obstacles: Obstacles, radius: float, landmarks: Landmarks
) -> tuple[Way | None, list[Change]]:
    """Return a way from one clear point to another, without the first, and what is odd of it."""
    carried = way.part(first, last)
    wanted = [_swept(carried.drawn, place) for place in landmarks.drawn]
    barriers: list[FloatArray] = []
    closed: set[int] = set()
    found = line = _planned(carried, obstacles, radius, barriers)
    while found is not None and len(closed) < _MOST_BARRIERS:
        wrong = [
            k
            for k, place in enumerate(landmarks.carried)
            if k not in closed and abs(_swept(found, place) - wanted[k]) > math.pi
        ]
        if not wrong:
            line = found
            break
        closed.update(wrong)
        barriers += [_barrier(carried, landmarks, k, obstacles) for k in wrong]
        found = _planned(carried, obstacles, radius, barriers)
    if line is None:
        return None, []
    odd = [
        landmarks.names[k]
        for k, place in enumerate(landmarks.carried)
        if abs(_swept(line, place) - wanted[k]) > math.pi
    ]
    smooth = _smoothed(line, obstacles, radius)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(smooth, axis=0).T))])
    shares = along / along[-1] if along[-1] else along
    # A part of a planned way was drawn where as large a part of the carried one was.
    places = np.linspace(0.0, 1.0, len(carried.points))
    planned = Way(
        smooth,
        np.interp(shares, places, carried.sources),
        np.stack([np.interp(shares, places, column) for column in carried.drawn.T], axis=1),
    )
    sentence = "Passes {} on another side than drawn: on that side there is no way."
    changes = [Change(ChangeReason.OTHER_SIDE, 0, 0, sentence.format(name)) for name in odd]
    return planned.part(1, len(smooth) - 1), changes


def _swept(line: FloatArray, place: FloatArray) -> float:
    """Return by how much a line turns around a place from end to end, in radians."""
    around = (line[:, 0] - place[0]) + 1j * (line[:, 1] - place[1])
    around = np.where(np.abs(around) < 1e-12, 1e-12, around)
    return float(np.angle(around[1:] / around[:-1]).sum())


def _barrier(carried: Way, landmarks: Landmarks, k: int, obstacles: Obstacles) -> FloatArray:
    """Return the line behind an object, seen from where a way should pass it, shape (2, 2)."""
    centre = landmarks.carried[k]
    away = np.hypot(*(carried.points - centre).T)
    nearest = carried.points[int(np.argmin(away))]
    back = centre - nearest
    # Where the way leads right through the middle, the side is that of the drawing.
    if np.hypot(*back) < obstacles.resolution:
        along = carried.points[-1] - carried.points[0]
        left = np.sign(_swept(carried.drawn, landmarks.drawn[k])) or 1.0
        back = left * np.array([-along[1], along[0]]) if along.any() else np.array([1.0, 0.0])
    length = float(np.hypot(*np.ptp(carried.points, axis=0))) + _MARGIN
    end: FloatArray = centre + back / np.hypot(*back) * 2.0 * length
    return np.stack([centre, end])


def _planned(
    carried: Way, obstacles: Obstacles, radius: float, barriers: Sequence[FloatArray]
) -> FloatArray | None:
    """Return the cheapest way between the ends of a carried part; None if there is none."""
    cells = obstacles.cells(carried.points)
    within = ((cells >= 0) & (cells < obstacles.blocked.shape)).all(axis=1)
    margin = math.ceil(max(_MARGIN, 8.0 * radius) / obstacles.resolution)
    while True:
        window = Window.around(obstacles, cells[within], margin)
        found = _cheapest(carried, cells, window, obstacles, radius, barriers)
        if found is not None or window.is_all_of(obstacles):
            return found
        margin *= 4


def _cheapest(
    carried: Way,
    cells: IntArray,
    window: Window,
    obstacles: Obstacles,
    radius: float,
    barriers: Sequence[FloatArray],
) -> FloatArray | None:
    room = window.of(obstacles.clearance)
    shape = room.shape
    open_ = room >= obstacles.needed(radius)
    for barrier in barriers:
        open_ = open_ & ~_drawn(barrier, obstacles, window, shape)
    ends = cells[[0, -1]] - window.low
    open_[tuple(ends.T)] = True
    stray = _strayed(carried, obstacles, window, shape)
    unit = max(radius, 2.0 * obstacles.resolution)
    costs = 1.0 + _STRAY * np.minimum(stray / unit, 20.0) ** 2 / 20.0
    costs += _HUG * np.clip(2.0 - room / unit, 0.0, 1.0) ** 2
    if not _joined(open_, ends):
        return None
    costs[~open_] = -1.0
    path = _path(costs, ends)
    points = obstacles.places(path + window.low)
    points[0], points[-1] = carried.points[0], carried.points[-1]
    return points if len(points) > 1 else carried.points[[0, -1]]


def _path(costs: FloatArray, ends: IntArray) -> IntArray:
    """Return the cells of the cheapest way; on many cells, near the cheapest of coarser ones."""
    coarse = math.isqrt(costs.size // _MANY_CELLS)
    if coarse > 1:
        corridor = _corridor(costs, ends, coarse)
        if corridor is not None and _joined(corridor, ends):
            costs = np.where(corridor, costs, -1.0)
    return _searched(costs, ends)


def _corridor(costs: FloatArray, ends: IntArray, size: int) -> BoolArray | None:
    """Return what is near the cheapest way over blocks of cells that are wholly open."""
    rows, columns = (-(-side // size) for side in costs.shape)
    margins = [
        (0, count * size - side) for count, side in zip((rows, columns), costs.shape, strict=True)
    ]
    blocks = np.pad(costs, margins, constant_values=-1.0).reshape(rows, size, columns, size)
    coarse = np.where(blocks.min(axis=(1, 3)) < 0.0, -1.0, blocks[:, 0, :, 0])
    first, last = ends // size
    for end in (first, last):
        near = coarse[max(0, end[0] - 1) : end[0] + 2, max(0, end[1] - 1) : end[1] + 2]
        near[near < 0.0] = coarse.max()
    if not _joined(coarse > 0.0, np.array([first, last])):
        return None
    path = _searched(coarse, np.array([first, last]))
    drawn = np.zeros((rows, columns), dtype=np.uint8)
    drawn[tuple(path.T)] = 1
    wide = cv2.dilate(drawn, np.ones((5, 5), dtype=np.uint8)).astype(bool)
    fine = wide.repeat(size, axis=0).repeat(size, axis=1)[: costs.shape[0], : costs.shape[1]]
    return np.asarray(fine & (costs > 0.0))


def _searched(costs: FloatArray, ends: IntArray) -> IntArray:
    from skimage.graph import MCP_Geometric

    planner = MCP_Geometric(costs, fully_connected=True)
    planner.find_costs([tuple(ends[0])], [tuple(ends[1])])
    return np.array(planner.traceback(tuple(ends[1])), dtype=np.int64)


def _joined(open_: BoolArray, ends: IntArray) -> bool:
    """Whether there is any way between two cells; a search that finds none would visit all."""
    _, labels = cv2.connectedComponents(open_.astype(np.uint8), connectivity=8)
    first, second = (labels[tuple(end)] for end in ends)
    return bool(first == second)


def _strayed(
    carried: Way, obstacles: Obstacles, window: Window, shape: tuple[int, ...]
) -> FloatArray:
    """Return how far cells are from a carried way."""
    off = (~_drawn(carried.points, obstacles, window, shape)).astype(np.uint8)
    away = cv2.distanceTransform(off, cv2.DIST_L2, cv2.DIST_MASK_5)
    found: FloatArray = away.astype(np.float64) * obstacles.resolution
    return found


def _drawn(
    line: FloatArray, obstacles: Obstacles, window: Window, shape: tuple[int, ...]
) -> BoolArray:
    """Return the cells of a window that a line goes through, and such that none gets across."""
    picture = np.zeros(shape, dtype=np.uint8)
    steps = obstacles.cells(line) - window.low
    cv2.polylines(
        picture, [steps[:, ::-1].astype(np.int32)], isClosed=False, color=1, lineType=cv2.LINE_4
    )
    return picture.astype(bool)


def _smoothed(line: FloatArray, obstacles: Obstacles, radius: float) -> FloatArray:
    """Return a line pulled smooth between its ends, as far as it stays clear."""
    room = obstacles.needed(radius) + _SLACK * obstacles.resolution
    points = sampled(line, 2.0 * obstacles.resolution)
    for _ in range(_SMOOTHINGS):
        for odd in (1, 2):
            middle = np.arange(odd, len(points) - 1, 2)
            if not len(middle):
                continue
            moved = 0.5 * points[middle] + 0.25 * (points[middle - 1] + points[middle + 1])
            kept = _legs_clear(points, middle, moved, obstacles, room)
            points[middle[kept]] = moved[kept]
    return points


def _legs_clear(
    points: FloatArray,
    middle: IntArray,
    moved: FloatArray,
    obstacles: Obstacles,
    radius: float,
) -> BoolArray:
    """Return which points may move: those whose legs to both neighbours stay clear."""
    legs = [moved[None] + _SHARES * (points[middle + step] - moved)[None] for step in (-1, 1)]
    samples = np.concatenate([moved[None], *legs])
    clear = obstacles.clear(samples.reshape(-1, 2), radius).reshape(samples.shape[:2])
    return np.asarray(clear.all(axis=0))
