"""The sheet of paper in a picture, which of light and dark is ink, and the light on the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = [
    "PAPER_CONTRAST",
    "Mask",
    "continued",
    "find_sheet",
    "is_light_on_dark",
    "odd",
    "paper_light",
]

Mask = NDArray[np.uint8]

PAPER_CONTRAST = 32
"""Grey levels between the darkest and the lightest spot, after smoothing, of paper alone."""

# Lines thinner than this share of the larger side are never taken for a change of the light.
_THICKEST_LINE = 0.05
# What a shape that the picture's border cuts returns at most of the light.
_CUT = 0.55


def odd(length: float) -> int:
    """Return the largest odd number up to a length, or the one above an even one."""
    return 2 * int(length / 2.0) + 1


# The sheet of paper


@dataclass(frozen=True)
class _Sheet:
    mask: Mask
    inverted: bool


def find_sheet(small: Mask) -> _Sheet | None:
    """Return the sheet of paper on a table, if the picture shows one: a light quadrilateral.

    Whichever of the negative and the picture shows a sheet is taken, and the picture first.
    """
    if min(small.shape) < 64:
        return None
    for inverted in (False, True):
        picture = np.asarray(255 - small if inverted else small, np.uint8)
        found = _light_quadrilateral(picture)
        if found is not None:
            return _Sheet(found, inverted)
    return None


def _light_quadrilateral(picture: Mask) -> Mask | None:
    side = max(picture.shape)
    # Without what is drawn on it, the sheet is one light area.
    plain = cv2.morphologyEx(picture, cv2.MORPH_CLOSE, np.ones((odd(0.03 * side),) * 2, np.uint8))
    low, high = int(plain.min()), int(plain.max())
    if high - low < PAPER_CONTRAST:
        return None
    best, most = None, 0.25 * plain.size
    for level in np.linspace(low, high, 18)[1:-1]:
        light = np.asarray(plain > level, np.uint8)
        contours, _ = cv2.findContours(light, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        largest = max(contours, key=cv2.contourArea)
        area = cv2.contourArea(largest)
        if most < area < 0.93 * plain.size:
            corners = _four_corners(largest, area)
            if corners is not None and _stands_out(plain, light, corners):
                best, most = corners, area
    if best is None:
        return None
    mask = np.zeros(picture.shape, np.uint8)
    cv2.fillConvexPoly(mask, best, 1)
    return np.asarray(cv2.erode(mask, np.ones((odd(0.025 * side),) * 2, np.uint8)), np.uint8)


def _four_corners(contour: Any, area: float) -> Any:
    """Return the quadrilateral that a contour is, or None where it is another shape."""
    hull = cv2.convexHull(contour)
    for share in (0.02, 0.03, 0.05):
        corners = cv2.approxPolyDP(hull, share * cv2.arcLength(hull, True), True)
        if len(corners) == 4:
            fits = min(area, cv2.contourArea(corners)) / max(cv2.contourArea(hull), 1.0)
            return corners if fits > 0.93 else None
    return None


def _stands_out(plain: Any, light: Mask, corners: Any) -> bool:
    """Return whether a step in lightness, not a slope, parts a sheet from all around it."""
    inside = np.zeros(light.shape, np.uint8)
    cv2.fillConvexPoly(inside, corners, 1)
    wide = np.ones((odd(0.03 * max(light.shape)),) * 2, np.uint8)
    if light[inside > 0].mean() < 0.7:
        return False
    outside = np.asarray(cv2.dilate(inside, wide), np.uint8) == 0
    if outside.sum() < 0.02 * light.size or light[outside].mean() > 0.1:
        return False
    edge = np.concatenate([light[0], light[-1], light[:, 0], light[:, -1]])
    if edge.mean() > 0.25:
        return False
    inner = cv2.erode(plain, wide, borderType=cv2.BORDER_REPLICATE)
    rim = np.asarray(cv2.morphologyEx(inside, cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8))) > 0
    step = cv2.dilate(plain, wide).astype(np.int16) - inner
    return bool(np.mean(step[rim] >= 0.75 * PAPER_CONTRAST) > 0.8)


def continued(picture: Mask, sheet: Mask) -> Mask:
    """Return a picture with its sheet's border continued to where the sheet is not."""
    _, nearest = cv2.distanceTransformWithLabels(
        1 - sheet, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    values = np.zeros(int(nearest.max()) + 1, np.uint8)
    values[nearest[sheet > 0]] = picture[sheet > 0]
    return np.asarray(values[nearest], np.uint8)


# Light


def is_light_on_dark(small: Mask) -> bool:
    """Return whether the ink is the lighter of the two; the negative gives the opposite answer.

    The two are parted at Otsu's threshold [1]_, and what lies along the border is paper. Where the
    border has both, ink is what is rare nearby.

    References
    ----------
    .. [1] N. Otsu, "A threshold selection method from gray-level histograms", IEEE TSMC 9(1), 1979.
    """
    level = small.astype(np.float64) - _slope(small)
    levels = np.zeros(small.shape, np.uint8)
    cv2.normalize(level, levels, 0, 255, cv2.NORM_MINMAX, cv2.CV_8U)
    _, found = cv2.threshold(levels, 0, 1, cv2.THRESH_BINARY_INV | cv2.THRESH_OTSU)
    dark = np.asarray(found, np.uint8)
    border = np.concatenate([dark[0], dark[-1], dark[:, 0], dark[:, -1]]).mean()
    if not 0.1 <= border <= 0.9:
        return bool(border > 0.5)
    window = min(255, odd(max(3.0, 0.25 * max(small.shape))))
    rare = small.astype(np.float64) - cv2.medianBlur(small, window)
    return float((rare**3).sum()) > 0.0


def _slope(small: Mask) -> NDArray[Any]:
    """Return the quadratic surface through a picture by least squares: the light's slow change."""
    rows, columns = small.shape
    y, x = np.mgrid[-1 : 1 : rows * 1j, -1 : 1 : columns * 1j]
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1).reshape(-1, 6)
    fit, *_ = np.linalg.lstsq(terms, small.reshape(-1).astype(np.float64), rcond=None)
    surface = np.asarray((terms @ fit).reshape(rows, columns))
    return np.asarray(surface - surface.mean())


def paper_light(small: Mask) -> Mask:
    """Return how light the paper is everywhere, as if nothing were drawn on it.

    Closing takes out lines. What is then darker than all around it is filled ink, and is raised
    to the lowest level over which it drains to the border: morphological reconstruction [1]_.
    Shadows come in over the border and stay, unless they are as short and dark there as a filled
    shape that the border, but no corner, cuts.

    References
    ----------
    .. [1] L. Vincent, "Morphological grayscale reconstruction in image analysis", IEEE
       Transactions on Image Processing 2(2), 1993.
    """
    side = max(small.shape)
    kernel = np.ones((odd(max(3.0, _THICKEST_LINE * side)),) * 2, np.uint8)
    even = cv2.medianBlur(small, 3) if min(small.shape) >= 64 else small
    # Continued beyond the border, so that closing does not fill a shadow's corner there.
    reach = len(kernel)
    wide = cv2.copyMakeBorder(even, reach, reach, reach, reach, cv2.BORDER_REPLICATE)
    closed = np.asarray(cv2.morphologyEx(wide, cv2.MORPH_CLOSE, kernel), np.uint8)
    plain = closed[reach:-reach, reach:-reach]
    raised = np.full_like(plain, 255)
    ring = _border(plain)
    level = _closed_ring(ring, side // 3)
    cut = _clear_of(ring < _CUT * level, small.shape)
    _set_border(raised, np.where(cut, level, ring).astype(np.uint8))
    three = np.ones((3, 3), np.uint8)
    floor = plain.copy()
    _set_border(floor, _border(raised))
    while True:
        before = raised
        for _ in range(16):
            raised = np.maximum(cv2.erode(raised, three), floor)
        if (raised == before).all():
            return np.asarray(raised, np.uint8)


def _border(picture: Mask) -> Mask:
    """Return the border's pixels, once around."""
    top, right = picture[0], picture[1:, -1]
    bottom, left = picture[-1, -2::-1] if len(picture) > 1 else top[:0], picture[-2:0:-1, 0]
    if picture.shape[1] == 1:
        left = left[:0]
    return np.concatenate([top, right, bottom, left])


def _set_border(picture: Mask, ring: Mask) -> None:
    rows, columns = picture.shape
    a, b, c = columns, columns + rows - 1, 2 * columns + rows - 2
    picture[0] = ring[:a]
    picture[1:, -1] = ring[a:b]
    if rows > 1 and columns > 1:
        picture[-1, -2::-1] = ring[b:c]
        picture[-2:0:-1, 0] = ring[c:]


def _clear_of(marked: NDArray[np.bool_], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return which marked pixels of the border are in no run that goes around a corner."""
    rows, columns = shape
    corners = {0, columns - 1, columns + rows - 2, 2 * columns + rows - 3}
    clear = marked.copy()
    for corner in corners:
        for step in (1, -1):
            at = corner
            while clear[at % len(clear)]:
                clear[at % len(clear)] = False
                at += step
            clear[corner % len(clear)] = marked[corner % len(clear)]
        clear[corner % len(clear)] = False
    return clear


def _closed_ring(ring: Mask, length: int) -> Mask:
    around = np.concatenate([ring, ring, ring])[None, :]
    kernel = np.ones((1, odd(max(3, length))), np.uint8)
    closed = np.asarray(cv2.morphologyEx(around, cv2.MORPH_CLOSE, kernel), np.uint8)
    return closed[0, len(ring) : 2 * len(ring)]
