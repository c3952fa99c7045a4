"""Filled areas of different colours, each as a shape of its own."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sketchmatch_builtin.segmenters._image_drawing import Shape
from sketchmatch_builtin.segmenters._image_ink import Ink
from sketchmatch_builtin.segmenters._image_light import Mask

__all__ = ["areas_of_colours"]

# Colours closer than this, in 1/255, are one: what a crayon's pressure and JPEG change.
_ALIKE = 20
# Closer than this are the same, but for noise.
_SAME = 8
# A colour that covers less than this share of all evenly filled ink is a seam or a blemish.
_RARE = 0.01
# Colours are counted on a grid of this step, and at most so many of its cells looked at.
_STEP = 4
_MOST_CELLS = 256

_Colours = NDArray[np.float64]


def areas_of_colours(ink: Ink, shapes: list[Shape], least: float) -> list[Shape]:
    """Part shapes into their evenly filled areas of one colour each.

    Colours are compared in the CIE Lab space with the paper as its white, so that hues of the same
    lightness differ; shades of a grey picture are compared by the light that they absorb. Pixels
    beside an edge, where one colour blends into another, take the colour of the nearest pixel that
    is not; colours are the peaks of the histogram of the others.

    Parameters
    ----------
    ink
        The ink that the shapes were traced from.
    shapes
        Filled shapes.
    least
        Pixels that an area has at least.

    Returns
    -------
    list
        The areas; a shape that has none of at least that size is returned as it is.
    """
    found = []
    for shape in shapes:
        areas = _areas(ink, shape, least)
        found.extend(areas if areas else [shape])
    return found


def _areas(ink: Ink, shape: Shape, least: float) -> list[Shape]:
    rows, columns = shape.mask.shape
    x, y = shape.corner
    colours, paper = _colours(ink.absorbed[y : y + rows, x : x + columns])
    filled = np.asarray(shape.mask, np.uint8)
    three = np.ones((3, 3), np.uint8)
    range_ = cv2.subtract(cv2.dilate(colours, three), cv2.erode(colours, three))
    steepest = np.asarray(range_, np.uint8).reshape(rows, columns, -1).max(axis=2)
    even = np.asarray((filled > 0) & (steepest <= _ALIKE // 2), np.uint8)
    if even.sum() < least:
        return []
    colours = colours.reshape(rows, columns, -1)
    seen, which, counts = np.unique(
        _packed(colours[even > 0]), return_inverse=True, return_counts=True
    )
    distinct = _unpacked(seen, colours.shape[2])
    peaks = _peaks(distinct, counts)
    nearest = np.stack([np.linalg.norm(distinct - peak, axis=1) for peak in peaks]).argmin(axis=0)
    _, labels = cv2.distanceTransformWithLabels(
        1 - even, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    seeds = np.zeros(int(labels.max()) + 1, np.int64)
    seeds[labels[even > 0]] = nearest[which.reshape(-1)]
    classes = seeds[labels]
    areas = []
    for k, peak in enumerate(peaks):
        if float(np.linalg.norm(peak - paper)) < _ALIKE:
            continue
        area = np.asarray((classes == k) & (filled > 0), np.uint8)
        areas.extend(_large_pieces(area, shape.corner, least))
    return areas


def _colours(absorbed: Mask) -> tuple[Mask, _Colours]:
    """Return colours as points of a space where distances matter, and where paper lies in it."""
    if absorbed.shape[2] == 1:
        grey = np.ascontiguousarray(absorbed[:, :, 0])
        return np.asarray(cv2.medianBlur(grey, 5), np.uint8), np.zeros(1)
    lab = cv2.cvtColor(np.ascontiguousarray(255 - absorbed), cv2.COLOR_RGB2Lab)
    return np.asarray(cv2.medianBlur(lab, 5), np.uint8), np.array([255.0, 128.0, 128.0])


def _packed(colours: Mask) -> NDArray[np.uint32]:
    """Return one number for each colour, so that equal ones can be counted fast."""
    code = np.zeros(len(colours), np.uint32)
    for axis in range(colours.shape[1]):
        code = np.asarray(code << 8 | colours[:, axis], np.uint32)
    return code


def _unpacked(codes: NDArray[np.uint32], axes: int) -> _Colours:
    shifts = [8 * axis for axis in range(axes - 1, -1, -1)]
    return np.stack([codes >> shift & 255 for shift in shifts], axis=1).astype(np.float64)


def _peaks(distinct: _Colours, counts: NDArray[Any]) -> list[_Colours]:
    """Return the colours that stand out of a histogram, the most frequent first."""
    _, which = np.unique(distinct // _STEP, axis=0, return_inverse=True)
    sizes = np.bincount(which.reshape(-1), counts)
    sums = [np.bincount(which.reshape(-1), counts * axis) for axis in distinct.T]
    middles: _Colours = np.stack(sums, axis=1) / sizes[:, None]
    most = np.argsort(-sizes, kind="stable")
    peaks: list[_Colours] = []
    for cell in most[:_MOST_CELLS]:
        peak = middles[cell]
        for _ in range(3):  # uphill, to the middle of the colours around
            near = np.linalg.norm(middles - peak, axis=1) <= _SAME
            if not near.any() or sizes[near].sum() < _RARE * sizes.sum():
                break
            peak = np.average(middles[near], axis=0, weights=sizes[near])
        else:
            if all(float(np.linalg.norm(peak - other)) >= _ALIKE for other in peaks):
                peaks.append(peak)
    return peaks or [middles[most[0]]]


def _large_pieces(area: Mask, corner: tuple[int, int], least: float) -> list[Shape]:
    pieces = []
    contours, _ = cv2.findContours(area, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    for contour in contours:
        x, y, width, height = cv2.boundingRect(contour)
        mask = np.zeros((height, width), np.uint8)
        cv2.drawContours(mask, [contour], 0, 1, cv2.FILLED, offset=(-x, -y))
        if mask.sum() >= least:
            pieces.append(Shape(mask, (corner[0] + x, corner[1] + y)))
    return pieces
