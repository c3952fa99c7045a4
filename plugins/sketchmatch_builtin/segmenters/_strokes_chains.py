"""Open strokes joined end to end to closed chains, those with the smallest gaps first."""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from sketchmatch.model import FloatArray, IntArray

from ._strokes_outline import areas_of, total_of
from ._strokes_trace import SAMPLES, Trace, span_of

__all__ = ["Chain", "closed_chains"]

_TAIL_SAMPLES = 16
_AT_ONCE = 2048
# Where a stroke may be cut at either end to meet another one: shares of its length and its span.
_TAIL = 0.45
_TAIL_SPAN = 0.5
# What a cut costs of what a gap as long does.
_CUT = 0.25
# How much more a gap costs that the pen would have to turn back for.
_TURN = 0.1
# Ends farther apart than this share of the larger stroke's span are never weighed.
_REACH = 0.75
_NEIGHBOURS = 8
_MOST_STROKES = 8
# Gaps may make up this share of a chain, and it must be this round: 4π·area / perimeter². A bar
# of 1 : 18 is as round; two lines along each other are less.
_OPEN = 0.3
_ROUND = 0.15
# Strokes that cross each other halfway enclose separate areas: one must be this much of all.
_WHOLE = 0.85
# A chain of strokes that close by themselves must be open this much less than they are.
_BETTER = 0.5
# Steps of the search for a chain, and of all such searches together, so that clutter stays cheap.
_STEPS, _ALL_STEPS = 64, 30_000
_BRANCHES = 5


@dataclass(frozen=True, eq=False)
class Chain:
    """Strokes that close together.

    Attributes
    ----------
    strokes
        Their indices, in the order along the outline.
    line
        The closed line: the strokes, their tails cut, and what joins them.
    open
        What joins them, as a share of the line's length.
    """

    strokes: tuple[int, ...]
    line: shapely.LineString
    open: float


@dataclass(frozen=True, order=True, slots=True)
class _Joint:
    """How an end is joined to another: ``cut`` of this end, ``other_cut`` of the other one."""

    other: int
    cost: float
    gap: float
    cut: float
    other_cut: float


@dataclass(frozen=True)
class _Cycle:
    cost: float
    strokes: tuple[int, ...]
    joints: tuple[_Joint, ...]
    gaps: float


def closed_chains(
    strokes: Sequence[Trace], own_gaps: Sequence[float], max_gap: float
) -> list[Chain]:
    """Return closed chains of two or more strokes, each stroke in one at most.

    From every stroke the cheapest way through joints back to its other end is searched, and the
    chains are taken in the order of what their gaps are of their length. A joint costs its gap
    and some of the tails that it cuts.

    Parameters
    ----------
    strokes
        The strokes, at least those that are open.
    own_gaps
        Gap that each would close by itself with, infinite if it does not. A chain must be far
        less open than the strokes in it that could do without.
    max_gap
        Longest gap, as a share of the chain's span.
    """
    if len(strokes) < 2:
        return []
    search = _Search(strokes, own_gaps, max_gap)
    used: set[int] = set()
    heap = [
        (cycle.cost, start, cycle)
        for start in range(len(strokes))
        if (cycle := search.from_(start, used))
    ]
    heapq.heapify(heap)
    chains = []
    while heap:
        _, start, cycle = heapq.heappop(heap)
        if used.isdisjoint(cycle.strokes):
            used.update(cycle.strokes)
            chains.append(search.chain(cycle))
        elif start not in used and (other := search.from_(start, used)):
            heapq.heappush(heap, (other.cost, start, other))
    return chains


class _Search:
    """The ends of strokes, and how they can be joined. End 2k begins stroke k, 2k + 1 ends it."""

    def __init__(self, strokes: Sequence[Trace], own_gaps: Sequence[float], max_gap: float) -> None:
        self.strokes = strokes
        self.own_gaps = own_gaps
        self.max_gap = max_gap
        self.joints = self._joints()

    def _joints(self) -> list[list[_Joint]]:
        """Return for each end the ends that it may be joined to, the cheapest first."""
        tails, cuts = self._tails()
        joints: list[list[_Joint]] = [[] for _ in range(len(tails))]
        pairs = _neighbours(tails[:, 0], np.repeat([stroke.span for stroke in self.strokes], 2))
        for start in range(0, len(pairs), _AT_ONCE):
            first, second = pairs[start : start + _AT_ONCE].T
            apart = np.hypot(*(tails[first, :, None] - tails[second, None]).transpose(3, 0, 1, 2))
            cost = apart + _CUT * (cuts[first, :, None] + cuts[second, None])
            at, other_at = np.divmod(cost.reshape(len(first), -1).argmin(axis=1), tails.shape[1])
            rows = np.arange(len(first))
            gaps = apart[rows, at, other_at]
            # 0 where the pen goes straight on, 1 at a right angle, 2 where it turns back.
            turning = 1.0 + (_heading(tails, first) * _heading(tails, second)).sum(axis=1)
            costs = cost[rows, at, other_at] + _TURN * turning * gaps
            cut, other_cut = cuts[first, at], cuts[second, other_at]
            for a, b, *how in zip(
                *(column.tolist() for column in (first, second, costs, gaps, cut, other_cut)),
                strict=True,
            ):
                joints[a].append(_Joint(b, *how))
                joints[b].append(_Joint(a, how[0], how[1], how[3], how[2]))
        for of_end in joints:
            of_end.sort(key=lambda joint: joint.cost)
        return joints

    def _tails(self) -> tuple[FloatArray, FloatArray]:
        """Return points from each end on, shape (ends, _TAIL_SAMPLES, 2), and how far they are."""
        points, cuts = [], []
        for stroke in self.strokes:
            longest = min(_TAIL * stroke.length, _TAIL_SPAN * stroke.span)
            at = np.linspace(0.0, longest, _TAIL_SAMPLES)
            points += [stroke.at(at), stroke.at(stroke.length - at)]
            cuts += [at, at]
        return np.stack(points), np.stack(cuts)

    def from_(self, start: int, used: set[int]) -> _Cycle | None:
        """Return the cheapest closed chain through a stroke that leaves out those used."""
        if start in used or not self.joints[2 * start]:
            return None
        ways: list[tuple[float, tuple[int, ...], tuple[_Joint, ...]]] = [(0.0, (start,), ())]
        for _ in range(min(_STEPS, max(8, _ALL_STEPS // len(self.strokes)))):
            if not ways:
                break
            cost, passed, joints = heapq.heappop(ways)
            if len(joints) == len(passed):
                if cycle := self._cycle(passed, joints):
                    return cycle
                continue
            end = joints[-1].other ^ 1 if joints else 2 * start + 1
            free = 0
            for joint in self.joints[end]:
                stroke = joint.other // 2
                if joint.other == 2 * start and len(passed) > 1:
                    heapq.heappush(ways, (cost + joint.cost, passed, (*joints, joint)))
                elif free < _BRANCHES and stroke not in used and stroke not in passed:
                    free += 1
                    if len(passed) < _MOST_STROKES:
                        way = (cost + joint.cost, (*passed, stroke), (*joints, joint))
                        heapq.heappush(ways, way)
        return None

    def _cycle(self, passed: tuple[int, ...], joints: tuple[_Joint, ...]) -> _Cycle | None:
        """Return a closed chain, or None if it is too open or too thin to be an outline."""
        span = span_of(np.concatenate([self.strokes[k].samples for k in passed]))
        gaps = [joint.gap for joint in joints]
        own = [gap for gap in (self.own_gaps[k] for k in passed) if gap < math.inf]
        if max(gaps) > self.max_gap * span or (own and sum(gaps) > _BETTER * sum(own)):
            return None
        ring = np.concatenate(self._pieces(passed, joints))
        length = float(np.hypot(*np.diff(ring, axis=0, append=ring[:1]).T).sum())
        x, y = (ring - ring[0]).T
        area = 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
        if sum(gaps) > _OPEN * length or 4.0 * np.pi * area < _ROUND * length**2:
            return None
        areas = areas_of(shapely.LineString(np.concatenate([ring, ring[:1]])))
        if not areas or areas[0].area < _WHOLE * total_of(areas):
            return None
        return _Cycle(sum(joint.cost for joint in joints) / length, passed, joints, sum(gaps))

    def _pieces(self, passed: tuple[int, ...], joints: tuple[_Joint, ...]) -> list[FloatArray]:
        """Return the strokes of a chain one after the other, their tails cut, roughly."""
        pieces = []
        before = joints[-1]
        for k, after in zip(passed, joints, strict=True):
            stroke = self.strokes[k]
            at = np.linspace(before.other_cut, stroke.length - after.cut, SAMPLES)
            pieces.append(stroke.at(stroke.length - at if before.other % 2 else at))
            before = after
        return pieces

    def chain(self, cycle: _Cycle) -> Chain:
        """Return a chain with all points of its strokes."""
        pieces = []
        before = cycle.joints[-1]
        for k, after in zip(cycle.strokes, cycle.joints, strict=True):
            stroke = self.strokes[k]
            if before.other % 2:
                piece = stroke.part(after.cut, stroke.length - before.other_cut)[::-1]
            else:
                piece = stroke.part(before.other_cut, stroke.length - after.cut)
            pieces.append(piece)
            before = after
        ring = np.concatenate([*pieces, pieces[0][:1]])
        line = shapely.LineString(ring)
        return Chain(cycle.strokes, line, cycle.gaps / line.length)


def _heading(tails: FloatArray, ends: IntArray) -> FloatArray:
    """Return the unit vectors in which the pen would leave strokes at their ends."""
    step = tails[ends, 0] - tails[ends, _TAIL_SAMPLES // 4]
    return np.asarray(step / np.maximum(np.linalg.norm(step, axis=1), 1e-300)[:, None])


def _neighbours(ends: FloatArray, spans: FloatArray) -> IntArray:
    """Return the pairs of near ends of different strokes, shape (k, 2): each end's nearest few."""
    count = min(_NEIGHBOURS, len(ends) - 2)
    pairs = []
    for start in range(0, len(ends), 256):
        rows = np.arange(start, min(start + 256, len(ends)))
        apart = np.hypot(*(ends[rows, None] - ends[None, :]).transpose(2, 0, 1))
        apart[rows - start, rows] = apart[rows - start, rows ^ 1] = np.inf
        nearest = np.argpartition(apart, count - 1, axis=1)[:, :count]
        near = np.take_along_axis(apart, nearest, axis=1)
        row, column = np.nonzero(near <= _REACH * np.maximum(spans[rows, None], spans[nearest]))
        pairs.append(np.stack([rows[row], nearest[row, column]], axis=1))
    return np.unique(np.sort(np.concatenate(pairs), axis=1), axis=0)
