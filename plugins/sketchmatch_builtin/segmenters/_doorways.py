"""Free space cut in two wherever it is as narrow as a doorway."""

from __future__ import annotations

import itertools
import math

import cv2
import numpy as np
from numpy.typing import NDArray

from sketchmatch.model import FloatArray, IntArray
from sketchmatch_builtin.segmenters._cells import Mask
from sketchmatch_builtin.segmenters._merging import groups

__all__ = [
    "Labels",
    "along_borders",
    "bodies",
    "divided",
    "doorway",
    "grow",
    "parts_that_meet",
    "passages",
    "roomed",
    "widths",
    "without_borders",
]

Labels = NDArray[np.int32]
_Widths = NDArray[np.float32]

# Of the wider part's width: a passage as wide as this is no doorway, but the same corridor.
_SAME_WIDTH = 0.88
# A place where corridors meet covers at most so many of the largest discs within it; of that disc's
# width is each corridor, two as wide cross at 0.71 of it; and where a corridor ends in such a place
# it is as wide as elsewhere, but for what cells make of it.
_ROUND, _CROSSED, _MOUTH = 1.6, 0.65, 0.92
# Of the mean distance to a wall, which in a square room is a sixth of its side: half that side.
_DOORWAY = 3.0
# A ray of a laser is nowhere twice this share of a doorway wide.
_RAY = 0.1
# What nothing leads into, and is nowhere this share of a doorway wide, is a cupboard or a shaft.
_SHAFT = 0.5
# By how many rows and columns a cell is beside another, and how long the way is to OpenCV, in whole
# parts of 2¹⁶.
_STEPS = [
    (y, x, np.float32({1: 65536, 2: 91750, 5: 143976}[y * y + x * x] / 65536.0))
    for y in range(-2, 3)
    for x in range(-2, 3)
    if y * y + x * x in (1, 2, 5)
]
# The most that two bytes hold.
_MOST_FEW = 65535
# In cells from either side: how wide a cut may be, and a half of it at a corner.
_BORDER = 2


def doorway(free: Mask, most: float) -> float:
    """Return up to how wide, in cells, a passage is a doorway: half of a typical room's width.

    Parameters
    ----------
    free
        1 where a cell is free, 0 elsewhere; at least one is.
    most
        The widest doorway there is, in cells.
    """
    return min(_DOORWAY * float(widths(np.pad(free, 1))[1:-1, 1:-1][free > 0].mean()), most)


def widths(free: Mask) -> _Widths:
    """Return how far each free cell is from the nearest that is not."""
    widths = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(widths, dtype=np.float32)


def divided(free: Mask, door: float, least: float) -> Mask:
    """Return the free cells without those along the borders between rooms.

    Parameters
    ----------
    free
        1 where a cell is free, 0 elsewhere.
    door
        Widest doorway, in cells.
    least
        Area in cells from which a corridor as narrow as a door is a room.

    Returns
    -------
    ndarray
        Shape of ``free``: rooms are components of cells joined by sides or corners. Corners and
        closets that no room reaches are among them, however small, but not rays of a laser
        through glass, nor what is closed and too narrow for anyone.
    """
    return without_borders(*roomed(free, door, least))


def roomed(free: Mask, door: float, least: float) -> tuple[Mask, Labels]:
    """Return free cells, without rays and shafts, and the number of each one's room, both padded.

    Cells that no room reaches have the number 0.
    """
    free = np.pad(free, 1)
    width = widths(free)
    free = _without_shafts(free, width, door)
    free &= _near(width > _RAY * door, 2.0 * _RAY * door)
    return free, _joined(bodies(free, width, door, least), width)


def bodies(free: Mask, width: _Widths, door: float, least: float) -> Labels:
    """Return parts of free space cut at one width, by numbers above 0: free cells that are joined.

    Parameters
    ----------
    free
        1 where a cell is free, 0 elsewhere, and along the border.
    width
        How far each free cell is from the nearest that is not.
    door
        Widest doorway, in cells.
    least
        Area in cells from which a corridor as narrow as a door is a part.
    """
    labels = _with_narrow_rooms(free, _covered(free, width, door / 2.0 + 0.5), least)
    grow(free, labels)
    return labels


def _covered(free: Mask, width: _Widths, radius: float) -> Labels:
    """Return which discs of a radius cover each cell, one label for discs that are joined."""
    cores = (width > radius).astype(np.uint8)
    if not cores.any():
        return np.zeros(free.shape, np.int32)
    labels, reach = _numbered(cores, 8)[0], math.floor(radius)
    away = cv2.distanceTransform(1 - cores, cv2.DIST_L2, cv2.DIST_MASK_5)
    # A core's disc is free, so that within it the nearest core lies on this side of all walls.
    within = (away <= reach) & (free > 0)
    return _nearest(labels, within) if labels.max() > 1 else within.astype(np.int32)


def _nearest(labels: Labels, within: NDArray[np.bool_]) -> Labels:
    """Return for some cells the label of the nearest that has one, and for others 0.

    Of several that are as near it is the highest. The shortest ways lead through these cells.
    """
    away, regions = cv2.distanceTransformWithLabels(
        (labels == 0).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_CCOMP
    )
    cells = np.flatnonzero(labels > 0)
    label_of = np.zeros(int(labels.max()) + 1, np.int32)
    label_of[regions.reshape(-1)[cells]] = labels.reshape(-1)[cells]
    nearest = np.where(within, label_of[regions], 0)
    return _with_highest(nearest, np.asarray(away, dtype=np.float32))


def _with_highest(labels: Labels, away: _Widths) -> Labels:
    """Return labels of the nearest, of several as near the highest, of cells that have one.

    Which of them OpenCV takes depends on how the map lies. A cell has the labels of all cells from
    which the shortest ways to it come, so that what is to be changed begins where labels meet.
    """
    found = np.pad(labels, 2)
    # Labels are few, far below 2²⁴, and so exact as float32, which OpenCV can dilate.
    own = found.astype(np.float32)
    around = cv2.dilate(own, np.ones((5, 5), np.uint8))
    columns, flat = found.shape[1], found.reshape(-1)
    rest = np.flatnonzero((around > own) & (own > 0.0))
    if not rest.size:
        return labels
    distances = np.pad(away, 2, constant_values=np.inf).reshape(-1)
    steps = [(y * columns + x, away_of) for y, x, away_of in _STEPS]
    while rest.size:
        highest = flat[rest]
        for step, length in steps:
            nearer = distances[rest + step] + length == distances[rest]
            np.maximum(highest, flat[rest + step], out=highest, where=nearer)
        changed = highest > flat[rest]
        rest, highest = rest[changed], highest[changed]
        flat[rest] = highest
        beside = []
        for step, length in steps:
            farther = distances[rest] + length == distances[rest + step]
            beside.append((rest + step)[farther & (flat[rest + step] < highest)])
        rest = np.unique(np.concatenate(beside))
        rest = rest[flat[rest] > 0]
    return np.ascontiguousarray(found[2:-2, 2:-2])


def _with_narrow_rooms(free: Mask, labels: Labels, least: float) -> Labels:
    """Add as rooms what is free, without a label, and large: corridors as narrow as a door."""
    rest = ((free > 0) & (labels == 0)).view(np.uint8)
    if cv2.countNonZero(rest) < least:
        return labels
    parts, sizes = _numbered(rest, 4)
    large = sizes >= least
    large[0] = False
    if not large.any():
        return labels
    narrow = np.where(large, np.cumsum(large), 0).astype(np.int32)[parts]
    cut = _cut_again(narrow, least)
    return np.where(cut > 0, labels.max() + cut, labels).astype(np.int32)


def _cut_again(places: Labels, least: float) -> Labels:
    """Cut places, of which each cell has the number, where they are half as wide as typically.

    All of them are narrower than a doorway of the map, and a door joins them all the same.
    """
    width, flat = widths((places > 0).view(np.uint8)), places.reshape(-1)
    count = int(places.max()) + 1
    mean = np.bincount(flat, width.reshape(-1)) / np.maximum(np.bincount(flat), 1)
    fits = width > (_DOORWAY * mean / 2.0 + 0.5).astype(np.float32)[places]
    cores, _ = _numbered(fits.view(np.uint8), 8)
    place_of = np.zeros(int(cores.max()) + 1, np.int32)
    place_of[cores[fits]] = places[fits]
    several = np.bincount(place_of[1:], minlength=count) > 1
    if not several.any():
        return places
    grow(several[places].view(np.uint8), cores)
    rooms = np.bincount(cores.reshape(-1)) >= least
    rooms[0] = False
    cut = np.bincount(place_of[rooms], minlength=count) > 1
    rooms &= cut[place_of]
    numbers = np.where(rooms, np.arange(len(rooms)), 0).astype(np.int32)[cores]
    # What is too small for a room goes to those beside it.
    grow(cut[places].view(np.uint8), numbers)
    return np.where(numbers > 0, count - 1 + numbers, places).astype(np.int32)


def _numbered(mask: Mask, connectivity: int) -> tuple[Labels, IntArray]:
    """Return a mask's components, numbered from 1, and how many cells each number has.

    The highest number wins a cell that is as near to another, and so must not depend on how the
    map lies: the smallest come first, and of equal ones those in the middle of the map.
    """
    _, parts, statistics, centroids = cv2.connectedComponentsWithStats(
        mask, connectivity=connectivity
    )
    sizes = statistics[:, cv2.CC_STAT_AREA].astype(np.int64)
    sizes[0] = 0
    if len(sizes) <= 2:
        return np.asarray(parts, dtype=np.int32), sizes
    middle = (np.array(mask.shape[::-1]) - 1.0) / 2.0
    away = np.hypot(*(centroids - middle).T).round(6)
    order = np.lexsort((away, sizes))
    numbers = np.empty(len(order), np.int32)
    numbers[order] = np.arange(len(order))
    return numbers[parts], sizes[order]


def grow(free: Mask, labels: Labels, most: int | None = None) -> None:
    """Give free cells without a label that of the nearest, in steps from side to side.

    Of several that are as near it is the highest. There are at most so many steps.
    Free cells lie in a frame of cells that are not.
    """
    rest = ((free > 0) & (labels == 0)).view(np.uint8)
    beside = cv2.dilate(rest, cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3)))
    edge = np.flatnonzero((beside > 0) & (labels > 0))
    flat, open_ = labels.reshape(-1), rest.reshape(-1).view(np.bool_)
    steps = np.array([1, -1, labels.shape[1], -labels.shape[1]])[:, None]
    # Only beside what was reached in the last step may anything be reached in the next.
    for _ in itertools.count() if most is None else range(most):
        there = edge + steps
        reached = open_[there]
        cells = there[reached]
        if not cells.size:
            return
        np.maximum.at(flat, cells, flat[edge[reached.nonzero()[1]]])
        open_[cells] = False
        edge = np.unique(cells)


def _joined(labels: Labels, width: _Widths) -> Labels:
    """Join parts whose passage is nearly as wide as the wider of them."""
    count = int(labels.max()) + 1
    widest = np.zeros(count, np.float32)
    np.maximum.at(widest, labels.reshape(-1), width.reshape(-1))
    pairs, passage = passages(labels, width)
    same = passage >= _SAME_WIDTH * widest[pairs].max(axis=1)
    same |= _at_crossings(np.bincount(labels.reshape(-1)), widest, pairs, passage)
    return groups(count, pairs[same].T).astype(np.int32)[labels]


def _at_crossings(
    areas: IntArray, widest: _Widths, pairs: IntArray, passage: FloatArray
) -> NDArray[np.bool_]:
    """Return which pairs are a place where corridors meet or bend, and one of these.

    A larger disc fits there than into any of them, so that they may be cut off.
    """
    sides = []
    for place, corridor in (pairs.T, pairs.T[::-1]):
        leads = areas[place] <= _ROUND * np.pi * widest[place] ** 2
        leads &= passage >= _CROSSED * widest[place]
        sides.append((place, leads & (passage >= _MOUTH * widest[corridor])))
    met = np.concatenate([place[leads] for place, leads in sides])
    count = np.bincount(met, minlength=len(areas))
    found = [leads & (count[place] >= 2) for place, leads in sides]
    return np.asarray(np.logical_or(*found))


def passages(labels: Labels, width: _Widths) -> tuple[IntArray, FloatArray]:
    """Return which labels touch, shape (k, 2), and how wide each passage is, shape (k,)."""
    pairs: list[IntArray] = []
    widths: list[NDArray[np.float32]] = []
    flat, wide, columns = labels.reshape(-1), width.reshape(-1), labels.shape[1]
    for here, there, step in ((np.s_[:, :-1], np.s_[:, 1:], 1), (np.s_[:-1], np.s_[1:], columns)):
        meeting = np.zeros(labels.shape, np.bool_)
        meeting[here] = labels[here] != labels[there]
        at = np.flatnonzero(meeting)
        at = at[(flat[at] > 0) & (flat[at + step] > 0)]
        low, high = np.sort([flat[at], flat[at + step]], axis=0).astype(np.int64)
        # A pair as one number, which sorts as the pair does.
        pairs.append((low << 32) + high)
        widths.append(np.minimum(wide[at], wide[at + step]))
    found, number = np.unique(np.concatenate(pairs), return_inverse=True)
    passage = np.zeros(len(found))
    np.maximum.at(passage, number.reshape(-1), np.concatenate(widths).astype(np.float64))
    return np.stack([found >> 32, found & 0xFFFFFFFF], axis=1), passage


def parts_that_meet(free: Mask, parts: Labels) -> IntArray:
    """Return which parts of free space, cut along their borders, open into each other.

    Parameters
    ----------
    free
        1 where a cell is free, 0 elsewhere.
    parts
        The number of each cell's part, 0 along borders and where it is not free.

    Returns
    -------
    ndarray
        Shape (k, 2), the smaller number first.
    """
    labels = np.pad(parts, 1)
    grow(np.pad(free, 1), labels, _BORDER)
    return passages(labels, np.zeros(labels.shape, np.float32))[0]


def _near(mask: NDArray[np.bool_], reach: float) -> Mask:
    """Return which cells are within reach of a mask; corners of what it is the core of are."""
    if not mask.any():
        return np.zeros(mask.shape, np.uint8)
    away = cv2.distanceTransform(1 - mask.view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    return (away <= reach).view(np.uint8)


def _without_shafts(free: Mask, width: _Widths, door: float) -> Mask:
    """Return free cells without what is closed and too narrow for anyone, as cupboards are."""
    count, parts = cv2.connectedComponents(free, connectivity=8)
    spaces = np.asarray(parts, dtype=np.int32)
    widest = np.zeros(count, np.float32)
    np.maximum.at(widest, spaces.reshape(-1), width.reshape(-1))
    return np.asarray((2.0 * widest >= _SHAFT * door)[spaces], dtype=np.uint8)


def without_borders(free: Mask, labels: Labels) -> Mask:
    """Return free cells without those along borders between rooms, and without the padding."""
    # Cells in a thin wall, which no room reaches by a side, would join by their corners what lies
    # on both sides of it.
    reached = cv2.dilate((labels > 0).view(np.uint8), np.ones((3, 3), np.uint8))
    cut = along_borders(labels) | ((labels == 0) & (reached > 0))
    return np.asarray((free & ~cut)[1:-1, 1:-1], dtype=np.uint8)


def along_borders(labels: Labels) -> NDArray[np.bool_]:
    """Return the cells that touch, by a side or a corner, a cell of another room."""
    around = np.ones((3, 3), np.uint8)
    # OpenCV can dilate these, and the smaller ones faster.
    few = bool(labels.max(initial=0) < _MOST_FEW)
    own: Labels = labels.astype(np.uint16 if few else np.float32)
    highest = cv2.dilate(own, around)
    np.putmask(own, labels == 0, _MOST_FEW if few else np.inf)
    lowest = cv2.erode(own, around)
    return np.asarray((labels > 0) & (highest != lowest))
