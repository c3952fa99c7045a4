"""Photographs of drawings with known truth: pen and paper, light, camera, compression.

A scene is drawn with a wobbly pen or filled, on textured and maybe ruled paper, or with chalk on a
board; it is lit unevenly and photographed with a slight perspective, a blur, noise and JPEG
compression. Light multiplies what the paper returns, ink absorbs a share of it, chalk returns more
than the board, and a board reflects a lamp; all are in linear shares of white.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray

from sketchmatch.model import FloatArray, Image, Scene

__all__ = ["Photograph", "photograph"]

# Share of white that chalk returns, and how much of it a board's grain leaves out.
_CHALK, _GRAIN = 0.85, 0.35
# Points are drawn at 1/16 of a pixel, as OpenCV's fixed-point coordinates have it.
_SHIFT = 4


@dataclass(frozen=True)
class Photograph:
    """A picture and the truth about it.

    Attributes
    ----------
    image
        The picture.
    outlines
        For each object of the scene the outer edge of what was drawn, shape (k, 2), in pixels from
        the picture's lower left corner, y up.
    """

    image: Image
    outlines: tuple[FloatArray, ...]


def photograph(
    scene: Scene,
    rng: np.random.Generator,
    *,
    size: tuple[int, int] = (900, 1200),
    fill: float = 0.0,
    pen: float = 0.005,
    darkness: float = 0.75,
    wobble: float = 0.004,
    gap: float = 0.0,
    texture: float = 0.01,
    ruling: Literal["none", "lines", "squares"] = "none",
    ruling_darkness: float = 0.2,
    gradient: float = 0.0,
    vignette: float = 0.0,
    shadow: float = 0.0,
    table: float | None = None,
    perspective: float = 0.0,
    blur: float = 0.0,
    noise: float = 0.0,
    quality: int | None = None,
    scribbles: int = 0,
    board: float | None = None,
    smear: float = 0.0,
    glare: float = 0.0,
) -> Photograph:
    """Draw a scene and take a photograph of it.

    Parameters
    ----------
    scene
        What is drawn; its bounds are fitted into the sheet with a margin.
    rng
        Source of randomness.
    size
        Rows and columns of the picture.
    fill
        Share of the light that the objects' insides absorb; 0 for outlines alone.
    pen, darkness
        Width of the pen as a share of the picture's larger side, and the share of the light that
        its ink absorbs.
    wobble
        Standard deviation of a hand's slow deviations, as a share of the larger side.
    gap
        Share of each outline's size that it does not close by.
    texture
        Standard deviation of what the paper absorbs.
    ruling, ruling_darkness
        Lines printed on the paper, and the share of the light that they absorb.
    gradient, vignette
        How much darker one side, and the corners, are, as shares.
    shadow
        How much darker the part beyond a shadow's edge is; the edge is soft over a few pixels.
    table
        Share of white of a table around the sheet; no table where it is left out.
    perspective
        Standard deviation of the sheet's corners' shift, as a share of the larger side.
    blur, noise
        Standard deviations of the camera's blur, in pixels, and of its noise, in grey levels.
    quality
        JPEG quality, 1 to 100; not compressed where it is left out.
    scribbles
        How many short open lines are drawn beside the objects.
    board
        Share of white that a blackboard returns, on which chalk covers what ink would absorb; paper
        and ink where it is left out.
    smear
        Standard deviation of the share of the board that wiped chalk covers.
    glare
        Share of white that the reflection of a lamp adds at its middle.

    Returns
    -------
    Photograph
        The same for the same scene, settings and generator.
    """
    rows, columns = size
    side = max(size)
    sheet = np.ones(size, np.float32)
    width = max(1, round(pen * side))
    rings = _placed(scene, size, 0.1 if table is None else 0.2)
    drawn = [_wobbled(ring, rng, wobble * side) for ring in rings]
    if ruling != "none":
        _rule(sheet, rng, ruling == "squares", ruling_darkness)
    for ring in drawn:
        if fill > 0.0:
            _ink(sheet, ring, 0, fill)
        if darkness > 0.0:
            _ink(sheet, _with_gap(ring, rng, gap), width, darkness, closed=gap == 0.0)
    for _ in range(scribbles):
        _ink(sheet, _scribble(drawn, rng, size), width, darkness, closed=False)
    grain = rng.normal(0.0, 1.0, (rows, columns)).astype(np.float32)
    grain = np.asarray(cv2.GaussianBlur(grain, (0, 0), 1.2), np.float32)
    grain /= max(float(grain.std()), 1e-9)
    sheet = sheet * (1.0 - texture * grain) if board is None else _chalked(sheet, grain, board)
    if smear > 0.0:
        sheet += smear * (_CHALK - sheet) * _clouds(rng, size)
    turn = _perspective(rng, size, perspective, table is not None)
    outside = 1.0 if table is None else table
    scenery = cv2.warpPerspective(
        sheet,
        turn,
        (columns, rows),
        flags=cv2.INTER_AREA if perspective else cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE if table is None else cv2.BORDER_CONSTANT,
        borderValue=outside,
    )
    picture = 240.0 * scenery * _lit(rng, size, gradient, vignette, shadow)
    if glare > 0.0:
        picture += 240.0 * glare * _spot(rng, size)
    if blur > 0.0:
        picture = np.asarray(cv2.GaussianBlur(picture, (0, 0), blur), np.float64)
    picture = picture + rng.normal(0.0, noise, size)
    pixels = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
    if quality is not None:
        _, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])
        pixels = np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE), np.uint8)
    outer = [shapely.Polygon(ring).buffer(width / 2.0 if darkness else 0.0) for ring in drawn]
    edges = [shapely.get_coordinates(shapely.get_exterior_ring(shape))[:-1] for shape in outer]
    truth = [cv2.perspectiveTransform(ring[None].astype(np.float64), turn)[0] for ring in edges]
    return Photograph(
        Image(pixels),
        tuple(np.stack([ring[:, 0] + 0.5, rows - ring[:, 1] - 0.5], axis=1) for ring in truth),
    )


def _placed(scene: Scene, size: tuple[int, int], margin: float) -> list[FloatArray]:
    """Return the objects' outer rings in the picture's pixels, y down."""
    x0, y0, x1, y1 = scene.bounds
    rows, columns = size
    room = 1.0 - 2.0 * margin
    scale = room * min(columns / (x1 - x0), rows / (y1 - y0))
    shift = np.array([columns - scale * (x1 - x0), rows - scale * (y1 - y0)]) / 2.0
    return [
        np.stack([item.rings[0][:, 0] - x0, y1 - item.rings[0][:, 1]], axis=1) * scale + shift
        for item in scene.objects
    ]


def _wobbled(ring: FloatArray, rng: np.random.Generator, deviation: float) -> FloatArray:
    """Return a ring's line as a hand draws it, with points every few pixels."""
    line = shapely.segmentize(shapely.LinearRing(ring), 3.0)
    points = shapely.get_coordinates(line)[:-1]
    around = np.linspace(0.0, 2.0 * np.pi, len(points), endpoint=False)
    waves = sum(
        np.outer(np.cos(k * around + rng.uniform(0.0, 2.0 * np.pi)), rng.normal(0.0, 1.0 / k, 2))
        for k in range(2, 9)
    )
    bent: FloatArray = points + deviation * np.asarray(waves)
    return bent if shapely.Polygon(bent).is_valid else points


def _with_gap(ring: FloatArray, rng: np.random.Generator, gap: float) -> FloatArray:
    """Return the line from a random point to where it ends short of it."""
    if gap == 0.0:
        return ring
    line = np.roll(ring, -int(rng.integers(len(ring))), axis=0)
    away = np.hypot(*(line - line[0]).T)
    far = np.flatnonzero(away > gap * math.hypot(*np.ptp(ring, axis=0)))
    return line[: int(far[-1]) + 1]


def _ink(
    sheet: NDArray[np.float32], line: FloatArray, width: int, share: float, closed: bool = True
) -> None:
    """Draw a line with a round pen, or fill it where the width is 0: ink on ink is no darker."""
    stroke = np.zeros(sheet.shape, np.uint8)
    points = [np.rint(line * (1 << _SHIFT)).astype(np.int32)]
    if width == 0:
        cv2.fillPoly(stroke, points, 255, cv2.LINE_AA, _SHIFT)
    else:
        cv2.polylines(stroke, points, closed, 255, width, cv2.LINE_AA, _SHIFT)
    np.minimum(sheet, 1.0 - share * stroke.astype(np.float32) / 255.0, out=sheet)


def _scribble(
    drawn: list[FloatArray], rng: np.random.Generator, size: tuple[int, int]
) -> FloatArray:
    """Return a short open line that stays clear of all objects."""
    rows, columns = size
    side = max(size)
    taken = shapely.union_all([shapely.Polygon(ring).buffer(0.02 * side) for ring in drawn])
    for _ in range(200):
        steps = rng.normal(0.0, 1.0, (12, 2)).cumsum(axis=0) * 0.003 * side
        drift = rng.normal(0.0, 1.0, 2) * 0.008 * side
        steps = steps + np.arange(12)[:, None] * drift
        line = steps + rng.uniform(0.1, 0.9, 2) * [columns, rows]
        inside = (line > 0.03 * side).all() and (line < [columns, rows] - 0.03 * np.array(side))
        if np.all(inside) and not shapely.LineString(line).intersects(taken):
            return line
    return np.zeros((2, 2)) - 10.0


def _rule(
    sheet: NDArray[np.float32], rng: np.random.Generator, squared: bool, share: float
) -> None:
    rows, columns = sheet.shape
    step = rng.uniform(0.028, 0.05) * max(sheet.shape)
    width = max(1, round(0.0012 * max(sheet.shape)))
    offset = rng.uniform(0.0, step, 2)
    for y in np.arange(offset[1], rows, step):
        _ink(sheet, np.array([[0.0, y], [columns, y]]), width, share, closed=False)
    for x in np.arange(offset[0], columns, step) if squared else ():
        _ink(sheet, np.array([[x, 0.0], [x, rows]]), width, share, closed=False)


def _chalked(
    sheet: NDArray[np.float32], grain: NDArray[np.float32], board: float
) -> NDArray[np.float32]:
    """Return a board on which chalk covers what ink would absorb on a sheet, but for its grain."""
    covered = np.clip((1.0 - sheet) * (1.0 - _GRAIN * np.abs(grain)), 0.0, 1.0)
    return np.asarray(board + (_CHALK - board) * covered, np.float32)


def _clouds(rng: np.random.Generator, size: tuple[int, int]) -> NDArray[np.float32]:
    """Return the share of each spot that is covered by soft clouds, of standard deviation 1."""
    clouds = rng.normal(0.0, 1.0, size).astype(np.float32)
    clouds = np.asarray(cv2.GaussianBlur(clouds, (0, 0), 0.03 * max(size)), np.float32)
    return np.asarray(np.maximum(clouds / clouds.std(), 0.0), np.float32)


def _spot(rng: np.random.Generator, size: tuple[int, int]) -> NDArray[np.float64]:
    """Return the reflection of a lamp somewhere in a picture, 1 at its middle."""
    rows, columns = size
    y, x = np.mgrid[0.0 : 1.0 : rows * 1j, 0.0 : 1.0 : columns * 1j]
    column, row = rng.uniform(0.2, 0.8, 2)
    return np.asarray(np.exp(-((x - column) ** 2 + (y - row) ** 2) / (2.0 * 0.12**2)))


def _perspective(
    rng: np.random.Generator, size: tuple[int, int], deviation: float, table: bool
) -> NDArray[np.float64]:
    """Return the map from the sheet's pixels to the picture's."""
    rows, columns = size
    corners = np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]], np.float32)
    margin = 0.06 * max(size) if table else 0.0
    inset = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * margin
    moved = corners + inset + rng.normal(0.0, deviation * max(size), (4, 2))
    return np.asarray(
        cv2.getPerspectiveTransform(corners, moved.astype(np.float32)), dtype=np.float64
    )


def _lit(
    rng: np.random.Generator,
    size: tuple[int, int],
    gradient: float,
    vignette: float,
    shadow: float,
) -> NDArray[np.float64]:
    """Return the light on each pixel, 1 where it is brightest."""
    rows, columns = size
    y, x = np.mgrid[-0.5 : 0.5 : rows * 1j, -0.5 : 0.5 : columns * 1j]
    angle, across, offset, soft = rng.uniform([0, 0, -0.2, 0.002], [6.28, 6.28, 0.2, 0.01])
    light = 1.0 - gradient * (0.5 + (x * math.cos(angle) + y * math.sin(angle)) / math.sqrt(2.0))
    light *= 1.0 - vignette * 2.0 * (x * x + y * y)
    beyond = (x * math.cos(across) + y * math.sin(across) - offset) / soft
    light *= 1.0 - shadow / (1.0 + np.exp(np.clip(-beyond, -50.0, 50.0)))
    return np.asarray(light)
