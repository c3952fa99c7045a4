"""What stands at a wall: pockets of a room's outline that jut into it.

Between two corners of a room's outline that are near each other lies a pocket: what the outline
goes around in between. A pocket is a thing if it hangs on the wall by a neck, as a shelf does that
touches it with one corner, or if it leans against a wall that runs on straight behind it and fills
its width and depth as a box does; a corner of the building fills one half. Or it stands in a
corner of the room and fills that as a box does, though so does a corner of the building.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.polygon import orient

from sketchmatch.model import FloatArray

__all__ = ["Bounds", "Leans", "Pocket", "at_walls", "is_thick"]

# As shares of how thick a wall is: how far it strays, how wide a slit people do not see, and how
# long a wall runs on both sides of what leans against it.
_STRAY, _SLIT, _STRETCH = 0.25, 0.7, 0.6
# In the same unit: a bar so thin may be one of two sides that were seen of a thing.
_SIDE = 1.15
# The angle by which a room's outline turns where a thing meets the wall.
_CORNER = math.radians(35.0)
# How straight it runs.
_STRAIGHT = math.cos(math.radians(30.0))
# The share of width times depth that a box fills, after all that it lost.
_FULL = 0.68
# How square a corner of a room is that something fills, and by which share it may miss that.
_SQUARE, _OFF = math.cos(math.radians(15.0)), 0.15
# What is this much wider than where it meets the wall leans on nothing.
_BELLY = 0.8
# A neck is at most this share of how thick what hangs on it is somewhere.
_NECK = 0.5
# As a share of how wide it may be at the wall: how far a thing juts out at most.
_DEEPEST = 1.5
# Radii up to this ratio are looked at together, all of them less what rounding discs takes off.
_RADII, _LESS = 1.5, 0.95
# Corners: pockets of more are looked at one by one.
_LONG = 1000
# In cells, what is nothing.
_ROUNDING = 1e-6


class Bounds(NamedTuple):
    """Bounds on what juts into a room, in cells.

    Attributes
    ----------
    widest
        How wide it is at most where it meets the wall.
    thinnest
        What is no thicker is wall.
    smallest
        The side of the smallest square that counts.
    """

    widest: float
    thinnest: float
    smallest: float

    @property
    def stray(self) -> float:
        """How far an outline may leave the line that it follows."""
        return max(_STRAY * self.thinnest, 1.0)

    @property
    def slit(self) -> float:
        """How wide a slit people do not see."""
        return _SLIT * self.thinnest

    @property
    def side(self) -> float:
        """How thick what may be one of two sides that were seen of a thing is at most."""
        return _SIDE * self.thinnest


class Leans(enum.IntEnum):
    """How a pocket meets the wall; of two that overlap, the one counts that comes first here."""

    NOT = 0
    """By a neck."""
    AS_A_BOX = 1
    AS_A_SIDE = 2
    """By a neck, and so thin that it may be a side of a box."""
    IN_A_CORNER = 3


class Pocket(NamedTuple):
    """A pocket of a room's outline.

    Attributes
    ----------
    outline
        Its last edge is where it meets the wall; in a corner, its last two.
    neck, depth
        How long that edge is, and how far the rest is away from it; in a corner, the longer and the
        shorter edge.
    leans
        How it meets the wall.
    """

    outline: shapely.Polygon
    neck: float
    depth: float
    leans: Leans

    @property
    def line(self) -> FloatArray:
        """The line from wall to wall that was seen."""
        walls = 2 if self.leans is Leans.IN_A_CORNER else 1
        return shapely.get_coordinates(self.outline)[:-walls]

    @property
    def order(self) -> tuple[int, float]:
        """Which of two that overlap is taken: the smallest by a neck, the largest box."""
        area = self.outline.area
        return (self.leans, -area if self.leans is Leans.AS_A_BOX else area)


def at_walls(room: shapely.Polygon, sides: shapely.Geometry, bounds: Bounds) -> list[Pocket]:
    """Return what juts out of a room's walls into it, none overlapping another.

    Parameters
    ----------
    room
        Its outline along the middles of the walls' cells; holes do not count.
    sides
        What stands near the walls and may be a side of what juts out of them.
    bounds
        What counts.
    """
    along = shapely.union_all(_simplified(room, bounds.stray))
    plain = along.buffer(-0.5, join_style="mitre")
    around = plain.difference(sides).buffer(-bounds.slit / 2.0, join_style="mitre")
    opened = around.buffer(bounds.slit / 2.0, join_style="mitre")
    found: list[Pocket] = []
    seen: list[tuple[shapely.Polygon, list[_Candidate]]] = []
    for each in (*_simplified(opened, bounds.stray), *_simplified(plain, bounds.stray)):
        if each.area <= bounds.smallest**2:
            continue
        ring = orient(each)
        # Where there is no slit, both are the same but for rounding.
        same = (real for other, real in seen if shapely.equals_exact(ring, other, _ROUNDING))
        known = next(same, None)
        candidates = _candidates(ring, bounds) if known is None else known
        pockets = [_pocket(ring, candidate, bounds) for candidate in candidates]
        seen.append((ring, [c for c, pocket in zip(candidates, pockets, strict=True) if pocket]))
        found += [pocket for pocket in pockets if pocket]
        found += _in_corners(ring, bounds)
    taken: list[Pocket] = []
    for pocket in sorted(found, key=lambda each: each.order):
        if not any(pocket.outline.intersects(other.outline) for other in taken):
            taken.append(pocket)
    return taken


def _simplified(shape: shapely.Geometry, stray: float) -> list[shapely.Polygon]:
    """Return simpler outlines; they begin at the farthest corner, whichever way they are turned."""
    found: list[shapely.Polygon] = []
    for part in shapely.get_parts(shape).tolist():
        points = shapely.get_coordinates(part.exterior)[:-1]
        if not len(points):
            continue
        # Holes do not count.
        middle = shapely.get_coordinates(shapely.Polygon(points).centroid)
        away = np.hypot(*(points - middle).T)
        first = np.roll(points, -int(away.argmax()), axis=0)
        found += shapely.get_parts(shapely.Polygon(first).simplify(stray).buffer(0)).tolist()
    return found


class _Candidate(NamedTuple):
    """Two corners of a ring, the area between, and whether it may hang between them by a neck."""

    first: int
    last: int
    area: float
    may_hang: bool


def _candidates(ring: shapely.Polygon, bounds: Bounds) -> list[_Candidate]:
    """Return what may be a pocket of a ring."""
    points = shapely.get_coordinates(ring.exterior)[:-1]
    corners = np.flatnonzero(_turns(points) > _CORNER)
    spots = np.asarray(shapely.points(points[corners]), dtype=object)
    a, b = shapely.STRtree(spots).query(spots, predicate="dwithin", distance=bounds.widest)
    a, b = corners[a[a != b]], corners[b[a != b]]
    areas = _areas(points, a, b)
    necks = np.linalg.norm(points[a] - points[b], axis=1)
    least = max(1.0, bounds.smallest**2, bounds.thinnest**2)
    counts = (areas > least) & (areas <= ring.area)
    # What neither the least of a box nor the least of what hangs by a neck fits into is neither.
    box = (areas >= _FULL * necks * bounds.thinnest) & (areas <= bounds.widest**2)
    counts &= box | (areas > math.pi * (0.5 * necks / _NECK) ** 2)
    a, b = a[counts], b[counts]
    inner = ring.buffer(-bounds.stray)
    shapely.prepare(inner)
    across = shapely.linestrings(np.stack([points[a], points[b]], axis=1))
    walled = ~shapely.intersects(inner, across)
    a, b, areas = a[walled], b[walled], areas[counts][walled]
    may_lean, may_hang = _may_lean(points, a, b, areas, bounds), _may_hang(ring, a, b)
    columns = (each[may_lean | may_hang] for each in (a, b, areas, may_hang))
    return [_Candidate(*each) for each in zip(*(c.tolist() for c in columns), strict=True)]


def _may_lean(
    points: FloatArray,
    a: NDArray[np.int64],
    b: NDArray[np.int64],
    areas: FloatArray,
    bounds: Bounds,
) -> NDArray[np.bool_]:
    """Whether pockets fill their widths and depths as boxes do, as far as that is soon known."""
    may = areas <= bounds.widest**2
    steps = (b - a) % len(points)
    # What has more corners is no plain box, but few have, and these cost more than they all.
    which = np.flatnonzero(may & (steps < _LONG))
    if not which.size:
        return may
    until = (steps[which] + 1).cumsum()
    of = np.repeat(np.arange(len(which)), steps[which] + 1)
    chain = points[
        (a[which][of] + np.arange(until[-1]) - (until - steps[which] - 1)[of]) % len(points)
    ]
    start, along = points[a[which]], points[b[which]] - points[a[which]]
    away = chain - start[of]
    across = np.abs(away[:, 0] * along[of, 1] - away[:, 1] * along[of, 0])
    necks = np.hypot(*along.T)
    depths = np.maximum.reduceat(across, until - steps[which] - 1) / necks
    filled = areas[which] / (necks * depths)
    may[which] = (
        (depths > bounds.thinnest - _ROUNDING)
        & (depths <= _DEEPEST * bounds.widest + _ROUNDING)
        & (filled >= _FULL - _ROUNDING)
        & (filled <= 1.0 / _BELLY + _ROUNDING)
    )
    return may


def _may_hang(
    ring: shapely.Polygon, a: NDArray[np.int64], b: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Whether discs of the radius of their necks may fit into pockets; if not, none does.

    A pocket whose neck does not cross the ring lies outside of it. There the middles of discs form
    cores, each so far away from the ring that no neck crosses it: it is in a pocket or not, as any
    of its points is. So all pockets of about one radius are decided at once; each by itself, as
    large as it may be, would cost its whole outline.
    """
    points = shapely.get_coordinates(ring.exterior)[:-1]
    across = shapely.linestrings(np.stack([points[a], points[b]], axis=1))
    inner = ring.buffer(-_ROUNDING, join_style="mitre")
    shapely.prepare(inner)
    may = np.asarray(shapely.intersects(inner, across), dtype=np.bool_)
    beside = ~may
    radii = _LESS * 0.5 * np.linalg.norm(points[a] - points[b], axis=1) / _NECK
    about = np.floor(np.log(radii) / math.log(_RADII)).astype(int)
    outside = ring.convex_hull.difference(ring)
    for power in np.unique(about[beside]).tolist():
        which = np.flatnonzero(beside & (about == power))
        cores = shapely.get_parts(outside.buffer(-(_RADII**power)))
        # Of a larger disc, a disc of the rest lies in the core.
        largest = _RADII**power + np.sqrt(shapely.area(cores) / math.pi)
        for core, most in zip(cores.tolist(), largest.tolist(), strict=True):
            fits = which[radii[which] <= most]
            if fits.size and not core.is_empty:
                within = shapely.get_coordinates(core)[0]
                may[fits] |= _encloses(points - within, a[fits], b[fits])
    return may


def _pocket(ring: shapely.Polygon, candidate: _Candidate, bounds: Bounds) -> Pocket | None:
    """Return the pocket between two corners, or None if it is no thing."""
    points, (a, b, area, may_hang) = shapely.get_coordinates(ring.exterior)[:-1], candidate
    chain = _chain(points, a, b)
    neck = math.dist(chain[0], chain[-1])
    depth = _depth(chain)
    leans = (
        bounds.thinnest < depth <= _DEEPEST * bounds.widest
        and area <= bounds.widest**2
        and _FULL <= area / (neck * depth) <= 1.0 / _BELLY
        and _goes_on(points, a, b, _STRETCH * bounds.thinnest)
    )
    # The disc of the thickness that it has at least.
    radius = 0.5 * neck / _NECK
    may_hang = may_hang and area > math.pi * radius**2
    if not leans and not may_hang:
        return None
    outline = shapely.Polygon(chain)
    hangs = may_hang and not outline.buffer(-radius).is_empty
    if not (leans or hangs) or not outline.is_valid or not is_thick(outline, bounds.thinnest):
        return None
    if not hangs:
        return Pocket(outline, neck, depth, Leans.AS_A_BOX)
    thin = outline.buffer(-bounds.side / 2.0).is_empty
    return Pocket(outline, neck, depth, Leans.AS_A_SIDE if thin else Leans.NOT)


def _in_corners(ring: shapely.Polygon, bounds: Bounds) -> Iterator[Pocket]:
    """Yield what fills corners of a ring as boxes do."""
    points = shapely.get_coordinates(ring.exterior)[:-1]
    ways, long = _units(np.roll(points, -1, axis=0) - points, bounds.thinnest)
    corners = _turns(points) > _CORNER
    firsts, lasts = np.flatnonzero(corners & np.roll(long, 1)), np.flatnonzero(corners & long)
    tree = shapely.STRtree(np.asarray(shapely.points(points[lasts]), dtype=object))
    starts = np.asarray(shapely.points(points[firsts]), dtype=object)
    a, b = tree.query(starts, predicate="dwithin", distance=bounds.widest)
    a, b = firsts[a], lasts[b]
    square = _cross(ways[a - 1], ways[b])
    a, b, square = a[square >= _SQUARE], b[square >= _SQUARE], square[square >= _SQUARE]
    # From the first corner on along its wall, and then along the other one to the last.
    before, after, across = ways[a - 1], ways[b], points[b] - points[a]
    sides = np.stack([_cross(across, after), _cross(before, across)]) / square
    box, areas = sides[0] * sides[1] * square, _areas(points, a, b)
    counts = (sides.min(axis=0) > bounds.thinnest) & (sides.max(axis=0) <= bounds.widest)
    counts &= sides.min(axis=0) <= bounds.widest / 2.0
    counts &= (areas > 0.0) & (areas <= (0.5 + _OFF) * box)
    for k in np.flatnonzero(counts).tolist():
        chain, corner = _chain(points, a[k], b[k]), points[a[k]] + sides[0, k] * before[k]
        outline = shapely.Polygon([*chain, corner])
        is_box = _parallel(chain, before[k], after[k]) >= 1.0 - _OFF
        if is_box and outline.is_valid and is_thick(outline, bounds.thinnest):
            yield Pocket(outline, sides[:, k].max(), sides[:, k].min(), Leans.IN_A_CORNER)


def _units(ways: FloatArray, least: float) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return ways of the length 1, and which were at least so long."""
    lengths = np.hypot(*ways.T)
    return ways / np.maximum(lengths, _ROUNDING)[:, None], np.asarray(lengths >= least)


def _parallel(line: FloatArray, *ways: FloatArray) -> float:
    """Return which share of a line runs along one of the ways."""
    steps = np.diff(line, axis=0)
    lengths = np.hypot(*steps.T)
    along = np.max([np.abs(steps @ way) for way in ways], axis=0) >= _SQUARE * lengths
    return float(lengths[along].sum() / lengths.sum())


def is_thick(outline: shapely.Polygon, thinnest: float) -> bool:
    """Whether more than half of it is left when what is thin is taken off."""
    core = outline.buffer(-thinnest / 2.0)
    return bool(core.buffer(thinnest / 2.0).area > 0.5 * outline.area)


def _goes_on(points: FloatArray, a: int, b: int, stretch: float) -> bool:
    """Whether the wall before a pocket and the one after it run on along the line between."""
    along = points[b] - points[a]
    for corner, step in ((a, -1), (b, 1)):
        k = corner
        k = (k + step) % len(points)
        while math.dist(points[k], points[corner]) < stretch:
            k = (k + step) % len(points)
        way = step * (points[k] - points[corner])
        if way @ along < _STRAIGHT * np.linalg.norm(way) * np.linalg.norm(along):
            return False
    return True


def _depth(chain: FloatArray) -> float:
    """Return how far a chain leaves the line through its ends."""
    along, away = chain[-1] - chain[0], chain - chain[0]
    return float(np.abs(away[:, 0] * along[1] - away[:, 1] * along[0]).max() / np.hypot(*along))


def _turns(points: FloatArray) -> FloatArray:
    """Return the angle by which a closed line turns left at each point."""
    before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
    return _angles(before, after)


def _areas(points: FloatArray, a: NDArray[np.int64], b: NDArray[np.int64]) -> FloatArray:
    """Return the area between the way along the ring from each a to its b and the straight one."""
    following = np.roll(points, -1, axis=0)
    steps = points[:, 0] * following[:, 1] - points[:, 1] * following[:, 0]
    until = np.concatenate([[0.0], np.cumsum(steps)])
    way = np.where(a < b, until[b] - until[a], until[-1] - until[a] + until[b])
    back = points[b, 0] * points[a, 1] - points[b, 1] * points[a, 0]
    return np.asarray(-(way + back) / 2.0)


def _encloses(points: FloatArray, a: NDArray[np.int64], b: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether the way along the ring from each a to its b and straight back goes around 0, 0."""
    until = np.concatenate([[0.0], np.cumsum(_angles(points, np.roll(points, -1, axis=0)))])
    way = np.where(a < b, until[b] - until[a], until[-1] - until[a] + until[b])
    return np.asarray(np.abs(way + _angles(points[b], points[a])) > math.pi)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _angles(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return by which angle each point is left of another, seen from 0, 0."""
    return np.asarray(np.arctan2(_cross(before, after), (before * after).sum(axis=1)))


def _chain(points: FloatArray, a: int, b: int) -> FloatArray:
    return points[a : b + 1] if a < b else np.concatenate([points[a:], points[: b + 1]])
