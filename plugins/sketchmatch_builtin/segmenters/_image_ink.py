"""Where the ink is in a picture, whatever the light: scans, photographs, clean drawings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sketchmatch.api import InvalidInputError, Reason
from sketchmatch_builtin.segmenters._image_light import (
    PAPER_CONTRAST,
    Mask,
    Shade,
    continued,
    edgeless,
    find_sheet,
    is_light_on_dark,
    negative,
    odd,
    paper_light,
)

__all__ = ["Ink", "find_ink"]

# Pixels along the larger side at which shapes are looked for, and the light is estimated.
_WORKING_SIDE = 2048
_LIGHT_SIDE = 512
# Ink absorbs at least this share of the light that paper returns, this many standard deviations
# of the paper's texture.
_LEAST_INK = 0.05
_TEXTURE = 4.5
# Filled areas are even to this many grey levels beside one another, and their edges, in pixels,
# twice this wide at most.
_EVEN = 10
_EDGE = 9
# So much of their rim is such an edge where they are fainter than that.
_SHARP = 0.9

_INVERTED = (
    "The picture is light on dark and was read as its negative: set ink to 'dark' if the dark is "
    "what is drawn."
)
_TABLE = (
    "What surrounds the sheet of paper or the board was left out: set frame to 'keep' if it "
    "belongs to the drawing."
)
_RULED = "The paper's ruled lines were left out."


@dataclass(frozen=True)
class Ink:
    """The ink of a picture, at the size at which shapes are looked for.

    Attributes
    ----------
    mask
        Shape (rows, columns), 1 on ink.
    fainter
        Likewise, 1 in pieces of what shows on the paper that were mostly left out, as too faint.
    absorbed
        Shape (rows, columns, 1) for grey and (rows, columns, 3) for red, green and blue: the share
        of the paper's light that is missing, in 1/255.
    scale
        Pixels of the picture in one of the mask, along x and y.
    warnings
        What was decided, one sentence each.
    """

    mask: Mask
    fainter: Mask
    absorbed: Mask
    scale: tuple[float, float]
    warnings: tuple[str, ...]


def find_ink(pixels: Mask, blur: float, whole: bool, shade: Shade, faint: float) -> Ink:
    """Find the ink of a picture.

    In a picture in colour, ink is what absorbs light of any colour, as a yellow pen absorbs blue:
    the channel in which it is darkest counts. The light on the paper is estimated and divided out.
    Ink is then what absorbs at least half as much as the darkest spot nearby, so that faint and
    dark pens are both traced along the middle of their edges [1]_, and clearly more than the
    paper's texture and ruled lines do.

    Parameters
    ----------
    pixels
        Shape (rows, columns), grey, or (rows, columns, 3), red, green and blue.
    blur
        Standard deviation of the Gaussian that evens out noise, in pixels.
    whole
        Whether all of the picture is the drawing; otherwise a table around the sheet is left out.
    shade
        Whether ink is darker or lighter than what it is drawn on; the picture decides with "auto".
    faint
        The share of what the picture's dark ink absorbs that other ink absorbs, but for evenly
        filled areas.

    Raises
    ------
    InvalidInputError
        With the path ``pixels``, if the picture is blank.

    References
    ----------
    .. [1] J. Bernsen, "Dynamic thresholding of gray-level images", ICPR 1986: a threshold halfway
       between the local extremes, with a floor on the contrast.
    """
    rows, columns = pixels.shape[:2]
    view = _view(pixels, blur, whole)
    inverted = is_light_on_dark(view.grey) if shade == "auto" else shade == "light"
    if inverted:  # before anything is rounded, so that a picture and its negative are the same
        view = _view(negative(pixels), blur, whole)
    absorbed = _absorbed(view.channels, [paper_light(some) for some in view.small])
    if view.sheet is not None:
        size = view.channels[0].shape[::-1]
        inside = cv2.resize(view.sheet, size, interpolation=cv2.INTER_NEAREST)
        absorbed *= np.asarray(inside, np.uint8)[:, :, None]
    most = np.ascontiguousarray(absorbed.max(axis=2))
    mask, fainter, ruled = _threshold(most, faint)
    for some in (mask, fainter):
        some[edgeless(most, some)] = 0
    said = (
        (_INVERTED, inverted and shade == "auto"),
        (_TABLE, view.sheet is not None),
        (_RULED, ruled),
    )
    return Ink(
        mask,
        fainter,
        absorbed,
        (columns / mask.shape[1], rows / mask.shape[0]),
        tuple(warning for warning, true in said if true),
    )


@dataclass(frozen=True)
class _View:
    """A picture as ink is looked for in it: its channels, and small ones for the light.

    Where the picture shows a sheet, ``small`` and ``grey``, the most telling of them, continue it
    to where it is not.
    """

    channels: list[Mask]
    small: list[Mask]
    grey: Mask
    sheet: Mask | None


def _view(pixels: Mask, blur: float, whole: bool) -> _View:
    rows, columns = pixels.shape[:2]
    factor = math.ceil(max(rows, columns) / _WORKING_SIDE)
    if factor > 1:
        size = (math.ceil(columns / factor), math.ceil(rows / factor))
        pixels = np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)
    if blur > 0.0:
        pixels = np.asarray(cv2.GaussianBlur(pixels, (0, 0), blur / factor), np.uint8)
    channels = _channels(pixels)
    _check_contrast(channels)
    small = [_reduced(channel, _LIGHT_SIDE) for channel in channels]
    grey = _most_telling(small)
    sheet = None if whole else find_sheet(grey)
    if sheet is not None:
        small = [continued(some, sheet) for some in small]
        grey = continued(grey, sheet)
    return _View(channels, small, grey, sheet)


def _channels(pixels: Mask) -> list[Mask]:
    """Return one channel of a picture that is grey, and three of one in colour."""
    if pixels.ndim == 2:
        return [pixels]
    channels = [np.ascontiguousarray(pixels[:, :, k]) for k in range(3)]
    grey = all((channel == channels[0]).all() for channel in channels[1:])
    return channels[:1] if grey else channels


def _contrast(channel: Mask) -> int:
    return int(channel.max()) - int(channel.min())


def _most_telling(channels: list[Mask]) -> Mask:
    """Return a picture's luminance, or the channel of most contrast where that shows nothing."""
    if len(channels) == 1:
        return channels[0]
    luminance = np.asarray(cv2.cvtColor(np.dstack(channels), cv2.COLOR_RGB2GRAY), np.uint8)
    if _contrast(luminance) >= PAPER_CONTRAST:
        return luminance
    return max(channels, key=_contrast)


def _check_contrast(channels: list[Mask]) -> None:
    contrast = max(map(_contrast, channels))
    if contrast < PAPER_CONTRAST:
        raise InvalidInputError(
            Reason.INVALID_IMAGE,
            "pixels",
            f"is blank: lightest and darkest differ by {contrast} of 255 grey levels; "
            "give a picture with dark shapes on light paper, taken in good light",
        )


def _reduced(picture: Mask, side: int) -> Mask:
    share = side / max(picture.shape)
    if share >= 1.0:
        return picture
    size = tuple(max(1, round(share * length)) for length in picture.shape[::-1])
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)


def _absorbed(channels: list[Mask], lights: list[Mask]) -> Mask:
    """Return the share of the light that is missing in each channel, in 1/255.

    It is a share of the lightest channel's light: of what paper hardly returns, noise is most.
    """
    size = channels[0].shape[::-1]
    papers: list[Mask] = []
    for light in lights:
        smooth = cv2.GaussianBlur(light, (0, 0), 1.0) if min(light.shape) > 3 else light
        papers.append(
            np.asarray(cv2.resize(smooth, size, interpolation=cv2.INTER_LINEAR), np.uint8)
        )
    lightest = np.maximum(np.maximum.reduce(papers), 1)
    missing = [
        cv2.divide(cv2.subtract(paper, channel), lightest, scale=255.0)
        for paper, channel in zip(papers, channels, strict=True)
    ]
    return np.asarray(np.dstack(missing), np.uint8)


# Ink


def _threshold(absorbed: Mask, faint: float) -> tuple[Mask, Mask, bool]:
    """Return the ink, what is too faint for it, and whether ruled lines had to be told from it."""
    bare = max(255.0 * _LEAST_INK, _rough(absorbed))
    shades = np.cumsum(np.bincount(absorbed.ravel(), minlength=256)[::-1])[::-1]
    visible = shades[min(255, math.ceil(bare))]
    if visible == 0:
        return np.zeros_like(absorbed), np.zeros_like(absorbed), False
    # The dark pen's shade: what the darkest 0.4 % of the picture reach, or half of all ink.
    darkest = min(visible / 2.0, 0.004 * absorbed.size)
    pen = int(np.flatnonzero(shades >= darkest).max())
    window = np.ones((max(7, odd(0.012 * max(absorbed.shape))),) * 2, np.uint8)
    floor = max(bare, faint * pen)
    ruling = _ruling(absorbed, floor, pen, window)
    floor = floor if ruling is None else max(floor, ruling)
    half = cv2.dilate(absorbed, window) // 2
    lowest, least = (min(254, math.ceil(level) - 1) for level in (floor, bare))
    mask = np.asarray(absorbed > np.maximum(half, lowest), np.uint8)
    mask |= _pale(absorbed, lowest, window)
    mask |= _alone(absorbed, _pale(absorbed, least, window), mask)
    if ruling is not None or _ruling(absorbed, bare, pen, window) is not None:
        return mask, np.zeros_like(mask), ruling is not None
    pieces = cv2.connectedComponents(np.asarray(absorbed > np.maximum(half, least), np.uint8))[1]
    left_out = 2 * np.bincount(pieces.ravel(), mask.ravel()) < np.bincount(pieces.ravel())
    left_out[0] = False
    return mask, np.asarray(left_out[pieces], np.uint8), False


def _pale(absorbed: Mask, lowest: int, window: Mask) -> Mask:
    """Return evenly filled areas up to their edges, also where they touch darker ones."""
    even = cv2.medianBlur(absorbed, 5)
    three = np.ones((3, 3), np.uint8)
    steep = np.asarray(cv2.subtract(cv2.dilate(even, three), cv2.erode(even, three)), np.uint8)
    plain = np.asarray((steep <= _EVEN) & (np.asarray(even) > lowest), np.uint8)
    wide = np.asarray(cv2.morphologyEx(plain, cv2.MORPH_OPEN, window), np.uint8)
    if not wide.any():
        return wide
    level = cv2.dilate(np.asarray(absorbed * wide, np.uint8), np.ones((_EDGE, _EDGE), np.uint8))
    near = np.asarray(level, np.uint8)
    return np.asarray((near > 0) & (absorbed > np.maximum(near // 2, lowest)), np.uint8)


def _alone(absorbed: Mask, pale: Mask, ink: Mask) -> Mask:
    """Return the pale areas that end at an edge all around, and that no darker ink touches.

    What fades out somewhere is a shadow or a smudge, and what others are drawn on is a floor.
    """
    contours, _ = cv2.findContours(pale, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    areas = np.zeros(pale.shape, np.int32)
    for k, contour in enumerate(contours, 1):
        cv2.drawContours(areas, [contour], 0, k, cv2.FILLED)
    count = len(contours) + 1
    size = np.maximum(np.bincount(areas.ravel(), minlength=count), 1)
    level = (np.bincount(areas.ravel(), absorbed.ravel(), count) / size)[areas]
    darker = np.bincount(areas[(ink > 0) & (absorbed > 2.0 * level)], minlength=count) > 0
    inside = np.asarray(areas > 0, np.uint8)
    rim = np.asarray(inside > np.asarray(cv2.erode(inside, np.ones((3, 3), np.uint8))))
    fall = cv2.morphologyEx(absorbed, cv2.MORPH_GRADIENT, np.ones((_EDGE, _EDGE), np.uint8))
    steep = np.bincount(areas[rim & (np.asarray(fall) >= 0.5 * level)], minlength=count)
    drawn = ~darker & (steep >= _SHARP * np.bincount(areas[rim], minlength=count))
    drawn[0] = False
    return np.asarray(drawn[areas] & (pale > 0), np.uint8)


def _rough(absorbed: Mask) -> float:
    """Return what bare paper may absorb, from differences over a few pixels: mostly of paper."""
    some = absorbed[::2].astype(np.int16)
    if min(some.shape) <= 8:
        return 0.0
    spread = 1.0484 * float(np.median(np.abs(some[:, 8:] - some[:, :-8])))
    return float(np.percentile(some, 30)) + _TEXTURE * spread


def _ruling(absorbed: Mask, floor: float, pen: int, window: Mask) -> float | None:
    """Return the shade between ruled lines and ink, if there are lines all over the picture.

    Ruled lines are fainter than the pen, thinner than a window, straight, span half of the picture,
    and have at least three parallel ones at regular distances; they are looked for with the Hough
    transform [1]_.

    References
    ----------
    .. [1] R. O. Duda, P. E. Hart, "Use of the Hough transformation to detect lines and curves in
       pictures", Communications of the ACM 15(1), 1972.
    """
    strong = np.asarray(absorbed >= 0.65 * pen, np.uint8)
    beside = cv2.dilate(strong, np.ones((7, 7), np.uint8))
    faint = np.asarray((absorbed >= floor) & (beside == 0), np.uint8)
    faint[cv2.dilate(cv2.morphologyEx(faint, cv2.MORPH_OPEN, window), window) > 0] = 0
    if faint.sum() < 2.0 * max(faint.shape):
        return None
    small = _reduced(faint * 255, 700)
    dots = np.asarray(small >= 64, np.uint8)
    found = cv2.HoughLines(dots, 1.0, np.pi / 360.0, int(0.35 * min(dots.shape)))
    if found is None:
        return None
    lines = found[:2000, 0, :]
    for angle in lines[:12:3, 1]:
        turn = np.abs((lines[:, 1] - angle + np.pi / 2) % np.pi - np.pi / 2)
        parallel = lines[turn < np.deg2rad(2.5)]
        away = np.where(np.abs(parallel[:, 1] - angle) > np.pi / 2, -1.0, 1.0) * parallel[:, 0]
        if _regular(np.sort(away)):
            shade = float(np.percentile(absorbed[faint > 0], 90))
            return min(0.65 * pen, (shade + pen) / 2.0)
    return None


def _regular(places: NDArray[Any]) -> bool:
    """Return whether there are at least four distinct places with mostly equal distances."""
    groups = np.split(places, np.flatnonzero(np.diff(places) > 5.0) + 1)
    centres = np.array([group.mean() for group in groups])
    if len(centres) < 4:
        return False
    steps = np.diff(centres)
    unit = float(np.median(steps))
    off = np.abs(steps / unit - np.maximum(1.0, np.rint(steps / unit)))
    return bool(np.mean(off < 0.25) > 0.6)
