"""Free space cut where its width changes: the narrow beside the wide is a place of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from sketchmatch.model import FloatArray, IntArray
from sketchmatch_builtin.segmenters._cells import Mask
from sketchmatch_builtin.segmenters._doorways import along_borders, grow
from sketchmatch_builtin.segmenters._merging import groups

__all__ = ["divided_by_width"]

_Labels = NDArray[np.int32]
_Widths = NDArray[np.float32]

# Widths that differ by a smaller factor are the same.
_STEP = 1.16
_NEARLY = 0.999 / _STEP
# Of the square of its greatest half width: what has a smaller area is a doorway, or a corner.
_SMALLEST = 2.0
# Of the square of its chord: what a half disc covers at most.
_SEGMENT = 0.4


def divided_by_width(
    free: Mask, shares: Sequence[float], narrowest: float
) -> list[Callable[[float], Mask]]:
    """Return, for each share, what cuts free space along the borders between places.

    It takes the area in cells of the smallest place, and what is smaller belongs to those that it
    touches. It returns the free cells without those along the borders: places are components of
    cells joined by sides or corners.

    How wide free space is at a cell is the widest disc within it that covers the cell. From the
    widest cells down, each joins the places that it touches, that a disc of this width can be moved
    to, and that are nowhere more than 1 / share times as wide: these become one by that. It
    begins a new one where there are none. Between two places the border runs straight.

    Parameters
    ----------
    free
        1 where a cell is free, 0 elsewhere.
    shares
        Of the width of the wider place: what is narrower is another place.
    narrowest
        Half the width, in cells, from which a place counts.
    """
    x, y, columns, rows = cv2.boundingRect(free)
    window = np.s_[y : y + rows, x : x + columns]
    framed = np.pad(free[window], 1)

    def cut(places: _Places, least: float) -> Mask:
        found = np.zeros_like(free)
        found[window] = _without_borders(framed, places, least)[1:-1, 1:-1]
        return found

    return [partial(cut, places) for places in _divided(framed, shares, narrowest)]


def _divided(free: Mask, shares: Sequence[float], narrowest: float) -> list[_Places]:
    """Return the places, for each share, of free cells in a frame of cells that are not."""
    distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    inside = free > 0
    cuts = [_Places(np.zeros(free.shape, np.int32)) for _ in shares]
    width = float(distance.max())
    while width >= narrowest:
        rest = distance < width
        away, way = cv2.distanceTransformWithLabels(
            rest.view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_CCOMP
        )
        covered = (away < width) & inside
        level = _Level.of(np.asarray(way, dtype=np.int32), ~rest, width)
        for places, share in zip(cuts, shares, strict=True):
            places.add(covered & (places.labels == 0), level, share)
        width /= _STEP
    return cuts


def _without_borders(free: Mask, places: _Places, least: float) -> Mask:
    """Return the free cells without those along the borders of places that are large enough."""
    labels, widest = places.labels, places.widest
    area = np.bincount(labels.reshape(-1), minlength=len(widest))
    large = area >= np.maximum(_SMALLEST * widest**2, least)
    large[0] = False
    labels = np.where(large, np.arange(len(large)), 0).astype(np.int32)[labels]
    grow(free, labels)
    _straighten(labels, widest)
    return np.asarray(free & (labels > 0) & ~along_borders(labels), dtype=np.uint8)


def _straighten(labels: _Labels, widest: FloatArray) -> None:
    """Let places end straight across, where discs of the wider one bulge into the narrower."""
    meeting = along_borders(labels).view(np.uint8)
    _, pieces, boxes, _ = cv2.connectedComponentsWithStats(meeting, connectivity=8)
    for k, (x, y, columns, rows, _) in enumerate(boxes[1:].tolist(), start=1):
        window = labels[y : y + rows, x : x + columns]
        border = pieces[y : y + rows, x : x + columns] == k
        both = np.unique(window[border])
        if len(both) != 2:
            continue
        narrow, wide = both[np.argsort(widest[both], kind="stable")]
        hull = cv2.convexHull(cv2.findNonZero(border.view(np.uint8)))
        across = np.zeros(window.shape, np.uint8)
        cv2.fillConvexPoly(across, hull, (1,))
        chord = float(np.hypot(columns, rows))
        bulge = (across > 0) & (window == wide)
        if bulge.sum() <= _SEGMENT * chord**2:
            window[bulge] = narrow


@dataclass(frozen=True)
class _Level:
    """Where discs of one width fit.

    Attributes
    ----------
    width
        Half of it, in cells.
    way
        Shape (rows * columns,), among which cells that a disc fits the nearest is, for each cell.
    cell_of
        For each of these ways the flat index of such a cell.
    """

    width: float
    way: _Labels
    cell_of: IntArray

    @classmethod
    def of(cls, way: _Labels, fits: NDArray[np.bool_], width: float) -> _Level:
        """Return the level of a width, where it is known which cells a disc fits."""
        cells, way = np.flatnonzero(fits), way.reshape(-1)
        cell_of = np.zeros(int(way.max()) + 1, np.int64)
        cell_of[way[cells]] = cells
        return cls(width, way, cell_of)


@dataclass
class _Places:
    """Cells so far, by the number of their place; 0 where none is.

    Attributes
    ----------
    labels
        Shape (rows, columns).
    widest
        Shape (places + 1,), half of the width of each where it is widest, in cells.
    within
        Shape (places + 1,), the flat index of a cell where a disc of each that was added fits.
    meeting
        Shape (2, k), places that touch and are not one as yet.
    """

    labels: _Labels
    widest: FloatArray = field(default_factory=lambda: np.zeros(1))
    within: IntArray = field(default_factory=lambda: np.zeros(1, np.int64))
    meeting: IntArray = field(default_factory=lambda: np.zeros((2, 0), np.int64))

    def add(self, new: NDArray[np.bool_], level: _Level, share: float) -> None:
        """Add cells that discs of a width cover."""
        cells, before = np.flatnonzero(new), len(self.widest)
        if not (cells.size or self.meeting.size):
            return
        parts, ways = _parts(new, cells, level)
        parts += before
        flat = self.labels.reshape(-1)
        flat[cells] = parts
        within = np.append(self.within, level.cell_of[ways])
        widest = np.append(self.widest, np.full(len(ways), level.width))
        touching = _touching(self.labels, cells, len(widest))
        meeting = np.concatenate([self.meeting, touching], axis=1)
        first, second = level.way[within][meeting]
        least, most = np.sort(widest[meeting], axis=0)
        # The widest discs of one place may fit in spots apart from each other, and cover it all.
        enough = np.where(least > level.width, _NEARLY, share) * most
        joined = (first == second) & (level.width >= enough)
        group = groups(len(widest), meeting[:, joined]).astype(np.int32)
        self.widest = np.zeros(group.max() + 1)
        np.maximum.at(self.widest, group, widest)
        self.within = np.zeros(len(self.widest), np.int64)
        self.within[group] = within
        if (group[:before] == np.arange(before)).all():
            flat[cells] = group[parts]
        else:
            self.labels = group[self.labels]
        apart = np.sort(group[meeting], axis=0)
        self.meeting = np.unique(apart[:, apart[0] != apart[1]], axis=1).astype(np.int64)


def _parts(new: NDArray[np.bool_], cells: IntArray, level: _Level) -> tuple[_Labels, IntArray]:
    """Return the part of each new cell, a component of one way, and the way of each part."""
    _, components = cv2.connectedComponents(new.view(np.uint8), connectivity=8)
    most = len(level.cell_of)
    keys = components.reshape(-1)[cells].astype(np.int64) * most + level.way[cells]
    found, part = np.unique(keys, return_inverse=True)
    return part.reshape(-1).astype(np.int32), found % most


def _touching(labels: _Labels, cells: IntArray, count: int) -> IntArray:
    """Return which of so many labels share a side or a corner at some cells, each pair once.

    Returns
    -------
    ndarray
        Shape (2, k).
    """
    flat, columns = labels.reshape(-1), labels.shape[1]
    own = flat[cells]
    found = []
    for step in (row + column for row in (-columns, 0, columns) for column in (-1, 0, 1)):
        beside = flat[cells + step]
        other = np.flatnonzero((beside > 0) & (beside != own))
        low, high = np.sort([beside[other], own[other]], axis=0).astype(np.int64)
        found.append(np.unique(low * count + high))
    return np.stack(np.divmod(np.unique(np.concatenate(found)), count))
