"""Free space cut in two wherever it is as narrow as a doorway."""

from __future__ import annotations

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
# Of the mean distance to a wall, which in a square room is a sixth of its side: half that side.
_DOORWAY = 3.0
# A ray of a laser is nowhere twice this share of a doorway wide.
_RAY = 0.1
# What nothing leads into, and is nowhere this share of a doorway wide, is a cupboard or a shaft.
_SHAFT = 0.5
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
    """Return parts of free space cut at one width, numbered from 1: free cells that are joined.

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
    distance = cv2.distanceTransform(1 - cores, cv2.DIST_L2, cv2.DIST_MASK_5)
    nearest = _nearest(_numbered(cores, 8)[0])
    # A core's disc is free, so that within it the nearest core lies on this side of all walls.
    nearest[(distance > math.floor(radius)) | (free == 0)] = 0
    return nearest


def _nearest(labels: Labels) -> Labels:
    """Return for each cell the label of the nearest one that has one, of several the highest."""
    found = np.zeros_like(labels)
    # Which of several OpenCV takes depends on the direction, and so all four are asked.
    for turns in range(4):
        turned = np.ascontiguousarray(np.rot90(labels, turns))
        rest = (turned == 0).astype(np.uint8)
        _, regions = cv2.distanceTransformWithLabels(
            rest, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_CCOMP
        )
        label_of = np.zeros(int(regions.max()) + 1, np.int32)
        label_of[regions[rest == 0]] = turned[rest == 0]
        np.maximum(found, np.rot90(label_of[regions], -turns), out=found)
    return found


def _with_narrow_rooms(free: Mask, labels: Labels, least: float) -> Labels:
    """Add as rooms what is free, without a label, and large: corridors as narrow as a door."""
    rest = (free > 0) & (labels == 0)
    parts, sizes = _numbered(rest.view(np.uint8), 4)
    large = sizes >= least
    large[0] = False
    narrow = np.where(large, np.cumsum(large) + labels.max(), 0).astype(np.int32)
    return np.asarray(labels + narrow[parts], dtype=np.int32)


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
    middle = (np.array(mask.shape[::-1]) - 1.0) / 2.0
    away = np.hypot(*(centroids - middle).T).round(6)
    order = np.lexsort((away, sizes))
    numbers = np.empty(len(order), np.int32)
    numbers[order] = np.arange(len(order))
    return numbers[parts], sizes[order]


def grow(free: Mask, labels: Labels) -> None:
    """Give free cells without a label that of the nearest, in steps from side to side.

    Of several that are as near it is the highest.
    """
    flat = labels.reshape(-1)
    rest = np.flatnonzero((free > 0) & (labels == 0))
    steps = (1, -1, labels.shape[1], -labels.shape[1])
    while rest.size:
        found = np.max([flat[rest + step] for step in steps], axis=0)
        if not found.any():
            return
        flat[rest] = found
        rest = rest[found == 0]


def _joined(labels: Labels, width: _Widths) -> Labels:
    """Join parts whose passage is nearly as wide as the wider of them."""
    count = int(labels.max()) + 1
    widest = np.zeros(count, np.float32)
    np.maximum.at(widest, labels.reshape(-1), width.reshape(-1))
    pairs, passage = passages(labels, width)
    same = passage >= _SAME_WIDTH * widest[pairs].max(axis=1)
    return groups(count, pairs[same].T).astype(np.int32)[labels]


def passages(labels: Labels, width: _Widths) -> tuple[IntArray, FloatArray]:
    """Return which labels touch, shape (k, 2), and how wide each passage is, shape (k,)."""
    pairs: list[IntArray] = []
    widths: list[FloatArray] = []
    for here, there in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        a, b = labels[here], labels[there]
        at = np.nonzero((a != b) & (a > 0) & (b > 0))
        pairs.append(np.sort(np.stack([a[at], b[at]], axis=1), axis=1).astype(np.int64))
        widths.append(np.minimum(width[here][at], width[there][at]).astype(np.float64))
    found, number = np.unique(np.concatenate(pairs), axis=0, return_inverse=True)
    passage = np.zeros(len(found))
    np.maximum.at(passage, number.reshape(-1), np.concatenate(widths))
    return found, passage


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
    framed, labels = np.pad(free, 1), np.pad(parts, 1)
    sides = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)
    for _ in range(_BORDER):
        around = cv2.dilate(labels.astype(np.float32), sides).astype(np.int32)
        labels = np.where((labels == 0) & (framed > 0), around, labels)
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
    # Labels are few, far below 2²⁴, and so exact as float32, which OpenCV can dilate.
    own = labels.astype(np.float32)
    highest = cv2.dilate(own, around)
    own[labels == 0] = np.inf
    lowest = cv2.erode(own, around)
    return np.asarray((labels > 0) & (highest != lowest))
