"""Rooms that open into another place wider than any door, and yet are rooms of their own."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from sketchmatch_builtin.segmenters._cells import Mask
from sketchmatch_builtin.segmenters._doorways import (
    Labels,
    along_borders,
    bodies,
    passages,
    roomed,
    widths,
    without_borders,
)

__all__ = ["divided_at_openings"]

# Of its convex hull: what fills as much of it is one room, however wide its parts are joined.
_WHOLE = 0.9
# What fills less of it goes around others, as a corridor does that is of one width.
_AROUND = 0.2
# Of a leaf's own width: what opens wider belongs to what it opens into.
_OPEN = 0.8
# Widths of openings are tried up to twice the doorway's, each by so much wider than the last.
_STEP, _STEPS = 1.2, 4


def divided_at_openings(free: Mask, door: float, least: float) -> Mask:
    """Return what :func:`divided` does, with leaves cut off as rooms of their own.

    A leaf is a convex part of a room that is not, joined to the rest at one place that is wider
    than a doorway but narrower than the leaf; the rest is no smaller, and stays in one piece. At
    corridors that go around others, and fill little of their hulls, none is sought.

    Parameters
    ----------
    free
        1 where a cell is free, 0 elsewhere.
    door
        Widest doorway, in cells.
    least
        Area in cells of the smallest room.
    """
    free, labels = roomed(free, door, least)
    _number_leaves(labels, door, least)
    return without_borders(free, labels)


def _number_leaves(labels: Labels, door: float, least: float) -> None:
    """Give the leaves of rooms, of which each cell has the number, numbers of their own."""
    inside = ((labels > 0) & ~along_borders(labels)).view(np.uint8)
    _, pieces, statistics, _ = cv2.connectedComponentsWithStats(inside, connectivity=8)
    last = int(labels.max())
    large = np.flatnonzero(statistics[1:, cv2.CC_STAT_AREA] >= 2.0 * least) + 1
    for k in large.tolist():
        x, y, columns, rows, _ = statistics[k].tolist()
        # With the cells along its borders.
        window = labels[y - 1 : y + rows + 1, x - 1 : x + columns + 1]
        within = pieces[y - 1 : y + rows + 1, x - 1 : x + columns + 1] == k
        room = np.pad((window == window[within][0]).view(np.uint8), 1)
        if _AROUND <= _filling(room) < _WHOLE:
            for leaf in _leaves(room, door, least):
                last += 1
                window[leaf[1:-1, 1:-1] > 0] = last


def _leaves(room: Mask, door: float, least: float) -> Iterator[Mask]:
    """Yield the leaves of a room in a frame of cells that are not, each of what is left."""
    width, cells = widths(room), cv2.countNonZero(room)
    for opening in door * _STEP ** np.arange(1, _STEPS + 1):
        if width.max() <= opening / 2.0 + 0.5:
            return
        parts = bodies(room, width, opening, least)
        count = int(parts.max()) + 1
        if count <= 2:
            continue
        widest = np.zeros(count, np.float32)
        np.maximum.at(widest, parts.reshape(-1), width.reshape(-1))
        pairs, passage = passages(parts, width)
        whole = room
        for k in range(1, count):
            joins = passage[(pairs == k).any(axis=1)].max(initial=0.0)
            if not 0.0 < joins < _OPEN * widest[k] or widest[k] <= opening / 2.0 + 0.5:
                continue
            leaf = (parts == k).view(np.uint8)
            size = cv2.countNonZero(leaf)
            rest = room & (1 - leaf)
            if (
                least <= size <= cells - size
                and _filling(leaf) >= _WHOLE
                and _is_whole(rest, least)
            ):
                yield leaf
                room, cells = rest, cells - size
        if room is not whole:
            width = widths(room)


def _is_whole(room: Mask, least: float) -> bool:
    """Whether one piece alone of what is left of a room may be a room."""
    _, _, statistics, _ = cv2.connectedComponentsWithStats(room, connectivity=4)
    return int(np.count_nonzero(statistics[1:, cv2.CC_STAT_AREA] >= least)) == 1


def _filling(mask: Mask) -> float:
    """Return how much of the convex hull of a mask's cells it fills."""
    borders, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    hull = cv2.convexHull(np.concatenate(borders)).reshape(-1, 2)
    steps = np.abs(np.roll(hull, -1, axis=0) - hull)
    # By Pick's theorem: how many cells' middles lie in the hull or on its border.
    held = cv2.contourArea(hull) + np.gcd(*steps.T).sum() / 2.0 + 1.0
    return float(cv2.countNonZero(mask) / held)
