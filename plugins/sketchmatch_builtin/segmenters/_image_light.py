"""The sheet of paper in a picture, which of light and dark is ink, and the light on the paper."""

from __future__ import annotations

from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = [
    "PAPER_CONTRAST",
    "Mask",
    "Shade",
    "continued",
    "edgeless",
    "find_sheet",
    "is_light_on_dark",
    "negative",
    "odd",
    "paper_light",
]

Mask = NDArray[np.uint8]

Shade = Literal["auto", "dark", "light"]
"""Whether ink is darker or lighter than what it is drawn on, or the picture decides."""

PAPER_CONTRAST = 32
"""Grey levels between the darkest and the lightest spot, after smoothing, of paper alone."""

# Lines thinner than this share of the larger side are never taken for a change of the light.
_THICKEST_LINE = 0.05
# What a shape that the picture's border cuts returns at most of the light.
_CUT = 0.55
# Within this share of the larger side, ink falls at its rim by at least this share of its depth.
_RIM = 0.01
_SHARP = 0.45
# What is drawn on a sheet covers at least this share of it, and is narrower than this share of the
# picture's larger side.
_DRAWN = 1e-3
_WIDEST_SHAPE = 0.3


def odd(length: float) -> int:
    """Return the largest odd number up to a length, or the one above an even one."""
    return 2 * int(length / 2.0) + 1


# The sheet of paper


def find_sheet(small: Mask) -> Mask | None:
    """Return what is drawn on, if the picture shows more: a sheet of paper on a table, a board.

    It is a quadrilateral with something drawn on it, lighter or darker than all around. Where there
    are two, as a board on a sheet, the larger one is taken.
    """
    if min(small.shape) < 64:
        return None
    found = (_light_quadrilateral(picture) for picture in (small, negative(small)))
    sheets = [sheet for sheet in found if sheet is not None]
    return max(sheets, key=lambda sheet: int(sheet.sum()), default=None)


def negative(picture: Mask) -> Mask:
    """Return a picture with light and dark exchanged."""
    return np.asarray(255 - picture, np.uint8)


def _closed(picture: Mask, kernel: Mask) -> Mask:
    """Return the morphological closing of a picture that goes on beyond its border.

    Otherwise it would fill a shadow's corner there, and a strip of a table.
    """
    reach = len(kernel)
    wide = cv2.copyMakeBorder(picture, reach, reach, reach, reach, cv2.BORDER_REPLICATE)
    closed = np.asarray(cv2.morphologyEx(wide, cv2.MORPH_CLOSE, kernel), np.uint8)
    return closed[reach:-reach, reach:-reach]


def _light_quadrilateral(picture: Mask) -> Mask | None:
    side = max(picture.shape)
    # Without what is drawn on it, the sheet is one light area.
    kernel = np.ones((odd(0.03 * side),) * 2, np.uint8)
    plain = _closed(picture, kernel)
    low, high = int(plain.min()), int(plain.max())
    if high - low < PAPER_CONTRAST:
        return None
    best, most = None, 0.25 * plain.size
    for level in np.linspace(low, high, 18)[1:-1]:
        light = np.asarray(plain > level, np.uint8)
        contours, _ = cv2.findContours(light, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        largest = max(contours, key=cv2.contourArea)
        area = cv2.contourArea(largest)
        if most < area < 0.98 * plain.size:
            corners = _four_corners(largest, area)
            if corners is not None and _stands_out(plain, light, corners):
                best, most = corners, area
    if best is None:
        return None
    mask = np.zeros(picture.shape, np.uint8)
    cv2.fillConvexPoly(mask, best, 1)
    sheet = np.asarray(cv2.erode(mask, np.ones((odd(0.025 * side),) * 2, np.uint8)), np.uint8)
    return sheet if _is_drawn_on(picture, sheet) else None


def _is_drawn_on(picture: Mask, sheet: Mask) -> bool:
    """Return whether anything is on a sheet: a filled shape of one colour is no sheet."""
    wide = np.ones((odd(_WIDEST_SHAPE * max(picture.shape)),) * 2, np.uint8)
    drawn = np.zeros_like(picture)
    for finding in (cv2.MORPH_BLACKHAT, cv2.MORPH_TOPHAT):
        drawn = np.maximum(drawn, cv2.morphologyEx(picture, finding, wide))
    return float(np.mean(drawn[sheet > 0] >= 0.5 * PAPER_CONTRAST)) >= _DRAWN


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
    near = np.ones((odd(0.01 * max(light.shape)),) * 2, np.uint8)
    outside = np.asarray(cv2.dilate(inside, near), np.uint8) == 0
    if outside.sum() < 0.005 * light.size or light[outside].mean() > 0.1:
        return False
    edge = np.concatenate([light[0], light[-1], light[:, 0], light[:, -1]])
    if edge.mean() > 0.5:
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
    even = np.asarray(cv2.medianBlur(small, 3) if min(small.shape) >= 64 else small, np.uint8)
    plain = _closed(even, kernel)
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
            deep = np.asarray(cv2.subtract(raised, plain), np.uint8)
            pits = np.asarray(deep >= 0.25 * PAPER_CONTRAST, np.uint8)
            return np.where(edgeless(deep, pits), plain, raised).astype(np.uint8)


def edgeless(depth: Mask, marked: Mask) -> NDArray[np.bool_]:
    """Return which marked pieces fade out instead of ending, as glare and smears on a board do.

    Over a few pixels at its rim, ink falls by most of what it falls over four times as many.

    Parameters
    ----------
    depth
        How much darker the picture is than its paper.
    marked
        1 in the pieces.
    """
    width = odd(max(5.0, _RIM * max(depth.shape)))
    near, wide = np.ones((width, width), np.uint8), np.ones((4 * width + 1,) * 2, np.uint8)
    even = np.asarray(cv2.GaussianBlur(depth, (0, 0), 0.2 * width), np.uint8)
    count, labels = cv2.connectedComponents(marked, connectivity=8)
    rim = np.asarray(marked > np.asarray(cv2.erode(marked, np.ones((3, 3), np.uint8))))
    step, fall = (
        np.bincount(
            labels[rim],
            np.asarray(cv2.morphologyEx(even, cv2.MORPH_GRADIENT, window))[rim],
            minlength=count,
        )
        for window in (near, wide)
    )
    fading = step < _SHARP * fall
    fading[0] = False
    return np.asarray(fading[labels])


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
