"""Routes kept out of obstacles: planned again where the warp leads into one.

A part of a route that comes too near to obstacles, and a little before and behind it, is replaced
by the cheapest way between its ends (scikit-image's ``MCP_Geometric``, Dijkstra's algorithm on
cells), which stays near the carried route and rather in the middle of free space, and then is
pulled smooth. Objects are passed on the side on which they were drawn: the way that led past one
on the other side is closed, and planned again, as long as that does not make it far longer.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np
import shapely

from sketchmatch.kernels.smoothing import pull_smooth
from sketchmatch.model import BoolArray, FloatArray, IntArray
from sketchmatch.model.arrays import Float32Array
from sketchmatch.transfers.features import Change, ChangeReason
from sketchmatch.transfers.obstacles import Obstacles, Window, sampled

__all__ = ["Landmarks", "Way", "kept_clear"]

_MARGIN = 2.0
"""Metres, or radii times 8, around a part that is planned again, at first."""
_STRAY = 1.0
_FARTHEST_STRAY = 20.0
"""In radii: how far from the carried way it is all one."""
_HUG = 0.5
_SMOOTHINGS = 40
_SLACK = 0.5
"""In cells: how much farther away a line stays that is pulled smooth, to be simplified."""
_PARTS = 16
"""Into how many parts a leg is cut where it is pulled smooth."""
_MOST_BARRIERS = 6
_DETOUR = 2.0
"""How much longer a way may be for the sake of the sides on which it passes objects."""
_LEAD = 3.0
"""Radii, or three times so many cells: how far before an obstacle, and behind it, a way may leave
the carried one, so that it does not turn at a corner."""
_MOST_STRETCHES = 8
_MANY_CELLS = 400_000
"""Four times more than these are first searched by blocks, about so many."""
_PIECE = 100
"""Blocks along a way that is searched at once."""
_NEAR_BLOCKS = 2
"""How far it may be from them."""


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
        return self.at(slice(first, last + 1))

    def at(self, chosen: slice | IntArray) -> Way:
        """Return the way through some of its points."""
        return Way(self.points[chosen], self.sources[chosen], self.drawn[chosen])

    def __add__(self, other: Way) -> Way:
        return Way(
            np.vstack([self.points, other.points]),
            np.concatenate([self.sources, other.sources]),
            np.vstack([self.drawn, other.drawn]),
        )


def kept_clear(
    way: Way, obstacles: Obstacles, radius: float, landmarks: Landmarks, unit: str = "m"
) -> Generator[None, None, tuple[Way | None, tuple[Change, ...]]]:
    """Return a way that keeps its distance from obstacles, and what was changed.

    It yields after each search, so that it can be stopped.

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
    if clear.sum() < 2:
        share = "Nearly all" if clear.any() else "All"
        where = "is blocked" if obstacles.inside(way.points).any() else "is beyond the grid"
        return None, (Change(ChangeReason.UNREACHABLE, 0, 0, f"{share} of it {where}."),)
    first, last = (int(k) for k in np.flatnonzero(clear)[[0, -1]])
    changes: list[Change] = []
    kept = obstacles.kept(radius)
    if first > 0:
        changes.append(_moved(way, 0, first, ChangeReason.MOVED_START, "begins", unit))
    done = way.part(first, first)
    at = joint = first
    lead = _LEAD * max(radius, 3.0 * obstacles.resolution)
    along = _along(way.points)
    while at < last:
        if clear[at + 1]:
            blocked = np.flatnonzero(~clear[at + 1 : last + 1])
            until = at + int(blocked[0]) if blocked.size else last
            done, at = done + way.part(at + 1, until), until
            continue
        leave = max(joint, int(np.searchsorted(along, along[at] - lead)))
        # What is clear may be the hollow of a thing of which only the outline was seen.
        missed: list[int] = []
        for beyond in _reappearing(clear[: last + 1], along, at, 2.0 * lead):
            again = int(np.searchsorted(along, along[beyond] + lead, side="right")) - 1
            still = np.flatnonzero(~clear[beyond : min(again, last) + 1])
            again = beyond + int(still[0]) - 1 if still.size else min(again, last)
            found, sides = yield from _around(way, leave, again, obstacles, radius, landmarks)
            if found is not None:
                break
            missed.append(beyond)
        if found is None:
            sentence = (
                f"Nothing after point {len(done.points)} can be reached: obstacles leave no way "
                f"with {kept:.6g} {unit} to each side; the route ends there."
            )
            end = len(done.points) - 1
            changes.append(Change(ChangeReason.UNREACHABLE, end, end, sentence))
            return _finished(done, changes)
        begin = len(done.points) - 1 - (at - leave)
        done = done.part(0, begin) + found
        named = _named(way.part(at, beyond), landmarks)
        without = min(missed, default=beyond) < beyond
        left_out = "; what was drawn in between cannot be reached" if without else ""
        sentence = f"Led around{named}, to stay {kept:.6g} {unit} away from obstacles{left_out}."
        changes.append(Change(ChangeReason.OBSTACLE, begin, len(done.points) - 1, sentence))
        changes += [replace(each, first=begin, last=len(done.points) - 1) for each in sides]
        at = joint = again
    if last < len(way.points) - 1:
        end = len(done.points) - 1
        moved = _moved(way, len(way.points) - 1, last, ChangeReason.MOVED_END, "ends", unit)
        changes.append(replace(moved, first=end, last=end))
    return _finished(done, changes)


def _reappearing(clear: BoolArray, along: FloatArray, at: int, long: float) -> list[int]:
    """Return where stretches that are clear begin after a point that ends one, long ones first.

    Between two obstacles near each other the way need not return to the carried one.
    """
    begins = at + 1 + np.flatnonzero(clear[at + 1 :] & ~clear[at:-1])
    ends = np.append(np.flatnonzero(clear[at + 1 : -1] & ~clear[at + 2 :]) + at + 1, len(clear) - 1)
    ends = ends[np.searchsorted(ends, begins)]
    short = (along[ends] - along[begins] < long) & (ends < len(clear) - 1)
    order = np.argsort(short[:_MOST_STRETCHES], kind="stable")
    return [int(k) for k in begins[order]]


def _finished(done: Way, changes: list[Change]) -> tuple[Way | None, tuple[Change, ...]]:
    if len(done.points) < 2:
        return None, tuple(replace(each, first=0, last=0) for each in changes)
    return done, tuple(changes)


def _clear_stretches(way: Way, obstacles: Obstacles, radius: float) -> BoolArray:
    """Return which points are clear; a point after a leg that is not clear counts as none."""
    clear = obstacles.clear(way.points, radius)
    clear[1:] &= obstacles.legs_clear(way.points, radius) | ~clear[:-1]
    return clear


def _moved(way: Way, given: int, taken: int, reason: ChangeReason, verb: str, unit: str) -> Change:
    away = float(np.hypot(*(way.points[taken] - way.points[given])))
    sentence = f"It {verb} {away:.2g} {unit} from where it was carried to, because of obstacles."
    return Change(reason, 0, 0, sentence)


def _named(part: Way, landmarks: Landmarks) -> str:
    """Return which object a part of a way led into, for people; nothing where it is none."""
    line = shapely.LineString(part.points)
    away = shapely.distance(shapely.points(landmarks.carried), line) / landmarks.sizes
    nearest = int(np.argmin(away))
    return f" {landmarks.names[nearest]}" if away[nearest] <= 1.0 else ""


def _around(
    way: Way, first: int, last: int, obstacles: Obstacles, radius: float, landmarks: Landmarks
) -> Generator[None, None, tuple[Way | None, list[Change]]]:
    """Return a way from one clear point to another, without the first, and what is odd of it."""
    carried = way.part(first, last)
    wanted = [_swept(carried.drawn, place) for place in landmarks.drawn]

    def on_other_side(line: FloatArray) -> list[int]:
        places = enumerate(landmarks.carried)
        return [k for k, place in places if abs(_swept(line, place) - wanted[k]) > math.pi]

    barriers: list[FloatArray] = []
    closed: set[int] = set()
    found = line = yield from _planned(carried, obstacles, radius, barriers)
    if line is None:
        # A passage that is little wider than the robot may have no middle of a cell to go along.
        window = _window(carried, obstacles, radius)
        if window.of(obstacles.blocked).size > _MANY_CELLS:
            return None, []
        obstacles, radius = obstacles.finer(window), obstacles.kept(radius)
        found = line = yield from _planned(carried, obstacles, radius, barriers)
        if line is None:
            return None, []
    odd = on_other_side(line)
    longest = _DETOUR * _along(line)[-1] + max(_MARGIN, 8.0 * radius)
    while found is not None and len(closed) < _MOST_BARRIERS:
        wrong = on_other_side(found)
        if len(wrong) < len(odd) and _along(found)[-1] <= longest:
            line, odd = found, wrong
        more = set(wrong) - closed
        if not more:
            break
        closed |= more
        barriers += [_barrier(carried, landmarks, k, obstacles) for k in sorted(more)]
        found = yield from _planned(carried, obstacles, radius, barriers)
    smooth = _smoothed(line, obstacles, radius)
    along = _along(smooth)
    shares = along / along[-1] if along[-1] else along
    # A part of a planned way was drawn where as large a part of the carried one was.
    places = np.linspace(0.0, 1.0, len(carried.points))
    planned = Way(
        smooth,
        np.interp(shares, places, carried.sources),
        np.stack([np.interp(shares, places, column) for column in carried.drawn.T], axis=1),
    )
    sentence = (
        "Passes {} on another side than drawn: the drawn side has no way, or a far longer one."
    )
    changes = [
        Change(ChangeReason.OTHER_SIDE, 0, 0, sentence.format(landmarks.names[k])) for k in odd
    ]
    return planned.part(1, len(smooth) - 1), changes


def _along(line: FloatArray) -> FloatArray:
    """Return how far along a line each of its points is."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])


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
) -> Generator[None, None, FloatArray | None]:
    """Return the cheapest way between the ends of a carried part; None if there is none."""
    cells, wider = obstacles.cells(carried.points), 1
    while True:
        window = _window(carried, obstacles, radius, wider)
        open_ = window.of(obstacles.clearance) >= obstacles.needed(radius)
        for barrier in barriers:
            open_ &= ~_drawn(obstacles.cells(barrier) - window.low, open_.shape)
        first, last = carried.points[[0, -1]]
        begin = obstacles.beside(first, radius, open_, window.low)
        end = obstacles.beside(last, radius, open_, window.low)
        yield
        if begin is not None and end is not None and _joined(open_, ends := np.stack([begin, end])):
            ground = _Ground(open_, window, cells - window.low, obstacles, radius)
            path = yield from _path(ground, ends)
            return np.vstack([first, obstacles.places(path + window.low), last])
        if window.is_all_of(obstacles):
            return None
        wider *= 4


def _window(carried: Way, obstacles: Obstacles, radius: float, wider: int = 1) -> Window:
    """Return the part of the grid around a carried part."""
    within = obstacles.cells(carried.points[obstacles.inside(carried.points)])
    margin = math.ceil(max(_MARGIN, 8.0 * radius) / obstacles.resolution)
    return Window.around(obstacles, within, margin * wider)


@dataclass(frozen=True, eq=False)
class _Ground:
    """What there is to go by in a window.

    Attributes
    ----------
    open
        Which cells of the window may be crossed.
    window
        Where it is.
    carried
        The cells of the carried way, from the window's corner.
    obstacles, radius
        What is kept away from, and how far.
    """

    open: BoolArray
    window: Window
    carried: IntArray
    obstacles: Obstacles
    radius: float

    def costs(self, low: IntArray, high: IntArray) -> FloatArray:
        """Return what each cell of a rectangle costs; below 0 where nobody may go."""
        around = math.ceil(_FARTHEST_STRAY * self._unit / self.obstacles.resolution)
        least, shape = np.maximum(low - around, 0), self.open.shape
        most = np.minimum(high + around, shape)
        away = _away(self.carried - least, tuple(most - least))
        part = _part(low, high)
        costs = self._priced(
            away[_part(low - least, high - least)], self.window.of(self.obstacles.clearance)[part]
        )
        costs[~self.open[part]] = -1.0
        return costs

    def blocks(self, size: int) -> FloatArray:
        """Return what blocks of cells cost; below 0 where they are not wholly open."""
        shape = tuple(-(-side // size) for side in self.open.shape)
        margins = [(0, c * size - side) for c, side in zip(shape, self.open.shape, strict=True)]
        whole = np.pad(self.open, margins).reshape(shape[0], size, shape[1], size).all(axis=(1, 3))
        room = self.window.of(self.obstacles.clearance)[::size, ::size]
        costs = self._priced(size * _away(self.carried // size, shape), room)
        costs[~whole] = -1.0
        return costs

    @property
    def _unit(self) -> float:
        return max(self.radius, 2.0 * self.obstacles.resolution)

    def _priced(self, away: FloatArray, room: Float32Array) -> FloatArray:
        stray = away * (self.obstacles.resolution / self._unit)
        costs: FloatArray = np.minimum(stray, _FARTHEST_STRAY) ** 2
        costs *= _STRAY / _FARTHEST_STRAY
        costs += 1.0 + _HUG * np.clip(2.0 - room / self._unit, 0.0, 1.0) ** 2
        return costs


def _part(low: IntArray, high: IntArray) -> tuple[slice, slice]:
    return slice(int(low[0]), int(high[0])), slice(int(low[1]), int(high[1]))


def _path(ground: _Ground, ends: IntArray) -> Generator[None, None, IntArray]:
    """Return the cells of the cheapest way; on many cells, near the cheapest over blocks of them.

    Blocks are as large as leaves few of them, and smaller where there is no way over such.
    """
    shape = np.array(ground.open.shape)
    size = math.isqrt(ground.open.size // _MANY_CELLS)
    while size > 1:
        found = yield from _path_by_blocks(ground, ends, size)
        if found is not None:
            return found
        size = 2 if size == 3 else size // 2
    return _searched(ground.costs(np.zeros(2, dtype=np.int64), shape), ends)


def _path_by_blocks(
    ground: _Ground, ends: IntArray, size: int
) -> Generator[None, None, IntArray | None]:
    """Return a way that stays near the cheapest over blocks that are wholly open, if there is one.

    It is searched in pieces, from block to block: what a piece takes does not grow with the grid.
    """
    costs = ground.blocks(size)
    whole = costs > 0.0
    over = ends // size
    dearest = costs.max()
    for end in ends:
        for block in _blocks_beside(ground.open, end, size):
            if costs[block] < 0.0:
                costs[block] = dearest
    yield
    if not _joined(costs > 0.0, over):
        return None
    blocks = _searched(costs, over)
    yield
    stops = [k for k in range(_PIECE, len(blocks) - _PIECE // 2, _PIECE) if whole[tuple(blocks[k])]]
    places = [ends[0], *(blocks[k] * size + size // 2 for k in stops), ends[1]]
    found: list[IntArray] = []
    for k, (first, last) in enumerate(pairwise([0, *stops, len(blocks) - 1])):
        piece = _piece(ground, blocks[first : last + 1], size, np.array(places[k : k + 2]))
        if piece is None:
            return None
        found.append(piece if not k else piece[1:])
        yield
    return np.vstack(found)


def _blocks_beside(open_: BoolArray, end: IntArray, size: int) -> list[tuple[int, int]]:
    """Return the block of a cell, and of those next to it which it leads to without others."""
    low = np.maximum(end // size - 1, 0) * size
    high = np.minimum((end // size + 2) * size, open_.shape)
    part = np.ascontiguousarray(open_[_part(low, high)]).astype(np.uint8)
    _, labels = cv2.connectedComponents(part, connectivity=8)
    reached = np.argwhere(labels == labels[tuple(end - low)]) + low
    return [(int(row), int(column)) for row, column in np.unique(reached // size, axis=0)]


def _piece(ground: _Ground, blocks: IntArray, size: int, ends: IntArray) -> IntArray | None:
    """Return the cheapest way between two cells that stays near a row of blocks, if any does."""
    low = np.maximum(blocks.min(axis=0) - _NEAR_BLOCKS, 0)
    drawn = np.zeros(blocks.max(axis=0) + _NEAR_BLOCKS + 1 - low, dtype=np.uint8)
    drawn[tuple((blocks - low).T)] = 1
    wide = cv2.dilate(drawn, np.ones((2 * _NEAR_BLOCKS + 1,) * 2, dtype=np.uint8)).astype(bool)
    corner = low * size
    high = np.minimum(corner + np.array(wide.shape) * size, ground.open.shape)
    costs = ground.costs(corner, high)
    near = wide.repeat(size, axis=0).repeat(size, axis=1)[: costs.shape[0], : costs.shape[1]]
    costs[~near] = -1.0
    if not _joined(costs > 0.0, ends - corner):
        return None
    found: IntArray = _searched(costs, ends - corner) + corner
    return found


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


def _away(line: IntArray, shape: tuple[int, ...]) -> FloatArray:
    """Return how far the cells of a picture are from a line of cells, in cells."""
    off = (~_drawn(line, shape)).astype(np.uint8)
    return cv2.distanceTransform(off, cv2.DIST_L2, cv2.DIST_MASK_5).astype(np.float64)


def _drawn(line: IntArray, shape: tuple[int, ...]) -> BoolArray:
    """Return the cells of a picture that a line goes through, and such that none gets across."""
    picture = np.zeros(shape, dtype=np.uint8)
    steps = line[:, ::-1].astype(np.int32)
    cv2.polylines(picture, [steps], isClosed=False, color=1, lineType=cv2.LINE_4)
    return picture.astype(bool)


def _smoothed(line: FloatArray, obstacles: Obstacles, radius: float) -> FloatArray:
    """Return a line pulled smooth between its ends, as far as it stays clear."""
    # Half a part of a leg is less than the slack: between the places that are looked at, too, it
    # stays clear.
    room = obstacles.kept(radius) / obstacles.resolution + _SLACK
    points = sampled(line, 2.0 * obstacles.resolution)
    found = obstacles.local(points)
    pull_smooth(found, obstacles.room, room, _SMOOTHINGS, _PARTS)
    smooth = obstacles.placed(found)
    smooth[[0, -1]] = points[[0, -1]]
    return smooth
