"""The contours of a picture's ink, and which lies in which."""

from __future__ import annotations

import math
from collections.abc import Container
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from sketchmatch_builtin.segmenters._image_light import Mask
from sketchmatch_builtin.segmenters._strokes_marks import typical_span

__all__ = ["Drawing", "Shape", "without_specks"]

# Lines end, for thickness, at this share of the larger side: thicker ones are filled shapes.
_THICKEST_PEN = 0.012
# A frame's box is at least this share of the drawing's.
_FRAME = 0.6
# A room is around so many shapes at least, and so many times as large as the typical one, and has
# at least this share of the drawing's span.
_FEWEST, _LARGER, _SPREAD = 3, 3.0, 0.3


@dataclass(frozen=True)
class Shape:
    """A filled mask, shape (rows, columns), and where its pixel (0, 0) lies, x and y."""

    mask: Mask
    corner: tuple[int, int]


class Drawing:
    """The shapes of a picture, and which lies in which; a shape is the index of its contour."""

    def __init__(self, ink: Mask, least: float) -> None:
        self._ink = ink
        self._contours, hierarchy = cv2.findContours(ink, cv2.RETR_TREE, cv2.CHAIN_APPROX_NONE)
        self._parents = np.zeros(0, np.int64) if hierarchy is None else hierarchy[0][:, 3]
        # Pick's theorem: the pixels within a contour, from its area between pixel centres.
        areas = np.array([cv2.contourArea(c) for c in self._contours])
        lengths = np.array([len(c) for c in self._contours])
        self._pixels, self._lengths = areas + lengths / 2.0 + 1.0, lengths
        self._large, self._side = self._pixels >= least, math.sqrt(least)

    def outermost(self) -> list[int]:
        """Return the large shapes that lie in no other."""
        return self._children([-1])

    def inside(self, shape: int) -> list[int]:
        """Return the large shapes that lie in the holes of a shape."""
        return self._children(np.flatnonzero(self._parents == shape))

    def frame(self, shapes: list[int]) -> int | None:
        """Return the shape around at least two others that spans most of the drawing.

        Between it and these there may be others of that kind, as where walls are double lines.
        """
        if not shapes:
            return None
        boxes = np.array([self.box(shape) for shape in shapes])
        low, high = boxes[:, :2].min(axis=0), (boxes[:, :2] + boxes[:, 2:]).max(axis=0)
        least = _FRAME * float(np.prod(high - low))
        largest = shapes[int((boxes[:, 2] * boxes[:, 3]).argmax())]
        inside = [largest]
        while len(inside) == 1 and math.prod(self.box(inside[0])[2:]) >= least:
            inside = self.inside(inside[0])
        return largest if len(inside) >= 2 else None

    def room(self, shapes: list[int]) -> int | None:
        """Return a shape around others that is far larger than these, as the walls of a room are.

        There may be several, none of which spans most of the drawing.
        """
        spans = {shape: max(self.box(shape)[2:]) for shape in shapes}
        inside = {shape: self.inside(shape) for shape in shapes}
        around = [shape for shape in shapes if len(inside[shape]) >= _FEWEST]
        if not around:
            return None
        others = [spans[shape] for shape in shapes if shape not in around]
        others += [max(self.box(each)[2:]) for shape in around for each in inside[shape]]
        boxes = np.array([self.box(shape) for shape in shapes])
        whole = float(np.ptp(np.concatenate([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]]), 0).max())
        least = max(_LARGER * typical_span(others), _SPREAD * whole)
        return next((shape for shape in around if spans[shape] >= least), None)

    def drawn_against(self, frame: int) -> list[int]:
        """Return the small empty faces between a frame and lines that end on it."""
        holes = np.flatnonzero((self._parents == frame) & self._large)
        most = 0.25 * self._pixels[holes].max(initial=0.0)
        return [
            int(hole) for hole in holes if self._pixels[hole] < most and not self._children([hole])
        ]

    def box(self, shape: int) -> tuple[int, int, int, int]:
        """Return x, y, width and height."""
        x, y, width, height = cv2.boundingRect(self._contours[shape])
        return x, y, width, height

    def filled(self, shape: int) -> Shape:
        """Return a shape and all that it encloses."""
        x, y, width, height = self.box(shape)
        mask = np.zeros((height, width), np.uint8)
        cv2.drawContours(mask, [self._contours[shape]], 0, 1, cv2.FILLED, offset=(-x, -y))
        return Shape(mask, (x, y))

    def ink_of(self, shape: int) -> Mask:
        """Return the ink within a shape's box."""
        x, y, width, height = self.box(shape)
        return self._ink[y : y + height, x : x + width]

    def pen(self) -> float:
        """Return how wide the lines are, from the shapes that have much more inside than ink.

        0 where all shapes are filled.
        """
        thickest = _THICKEST_PEN * max(self._ink.shape)
        holes = np.bincount(
            self._parents[self._parents >= 0],
            self._pixels[self._parents >= 0],
            minlength=len(self._parents),
        )
        widths, lengths = [], []
        for shape in map(int, np.flatnonzero(self._large)):
            if self._depth(shape) % 2:
                continue
            ink = self._pixels[shape] - holes[shape]
            around = self._lengths[shape] + self._lengths[self._parents == shape].sum()
            hull = cv2.contourArea(cv2.convexHull(self._contours[shape]))
            width = 2.0 * ink / max(around, 1)
            if width <= thickest and ink < 0.5 * hull:
                widths.append(width)
                lengths.append(around)
        if not widths:
            return 0.0
        order = np.argsort(widths)
        share = np.cumsum(np.array(lengths)[order])
        return float(np.array(widths)[order][np.searchsorted(share, share[-1] / 2.0)])

    def beside(self, shapes: list[int]) -> list[int]:
        """Return all shapes that lie in what some lie in, small ones, too."""
        return [int(k) for k in np.flatnonzero(np.isin(self._parents, self._parents[shapes]))]

    def loose(self, shapes: list[int], lines: list[int], writing: Container[int]) -> Mask:
        """Return the ink of lines and of long pieces of lines that lie in no other shape."""
        ink = np.zeros_like(self._ink)
        holes = {int(self._parents[shape]) for shape in shapes} or {-1}
        for shape in map(int, np.flatnonzero(~self._large & (self._lengths >= 2.0 * self._side))):
            if self._parents[shape] not in holes:
                continue
            if max(self.box(shape)[2:]) < self._side or shape in writing:
                continue
            cv2.drawContours(ink, [self._contours[shape]], 0, 1, cv2.FILLED)
        for shape in lines:
            cv2.drawContours(ink, [self._contours[shape]], 0, 1, cv2.FILLED)
        if -1 not in holes:
            around = np.zeros_like(self._ink)
            for hole in holes:
                cv2.drawContours(around, [self._contours[hole]], 0, 1, cv2.FILLED)
            ink &= around
        return ink & self._ink

    def _depth(self, shape: int) -> int:
        depth = 0
        while self._parents[shape] >= 0:
            shape, depth = int(self._parents[shape]), depth + 1
        return depth

    def _children(self, parents: Any) -> list[int]:
        return [int(k) for k in np.flatnonzero(np.isin(self._parents, parents) & self._large)]


def without_specks(ink: Mask, side: float) -> Mask:
    """Return the ink without pieces much smaller than the smallest shape."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(ink, connectivity=8)
    extent = stats[:, cv2.CC_STAT_WIDTH : cv2.CC_STAT_HEIGHT + 1].max(axis=1)
    keep = (extent >= 0.25 * side).astype(np.uint8)
    keep[0] = 0
    return ink if keep.sum() == count - 1 else np.asarray(keep[labels], np.uint8)
