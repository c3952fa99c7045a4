"""A canvas with smooth edges: polygons with holes, pen lines, hatching and text on Pillow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from itertools import product

import numpy as np
from anyascii import anyascii
from PIL import Image, ImageChops, ImageDraw, ImageFont

from sketchmatch.model import FloatArray
from sketchmatch.pictures._palette import Colour

__all__ = ["Box", "Canvas", "printable"]

Box = tuple[float, float, float, float]

# Pillow's own font has few glyphs beyond ASCII. These signs are spelled as here.
_SPELLED = {
    "×": "x", "−": "-", "→": "->", "↔": "<->",
    "ζ": "zeta", "Ω": "Omega", "θ": "theta", "σ": "sigma",
}  # fmt: skip
_GLYPHS = frozenset("°±´·»«‘’“”…©™")


class Canvas:
    """A picture that is drawn large and scaled down, in its own design units, y down.

    Parameters
    ----------
    size
        Width and height in design units.
    width
        Pixels of the finished picture's width.
    background
        What it is filled with.
    """

    def __init__(self, size: tuple[float, float], width: int, background: Colour) -> None:
        self.pixels = (width, max(1, round(size[1] * width / size[0])))
        self.oversampling = 3 if width <= 2400 else 2
        self.scale = self.oversampling * width / size[0]
        large = (self.pixels[0] * self.oversampling, self.pixels[1] * self.oversampling)
        self.image = Image.new("RGB", large, background)
        self._draw = ImageDraw.Draw(self.image)

    def finished(self) -> Image.Image:
        """Return the picture at its final size."""
        return self.image.resize(self.pixels, Image.Resampling.LANCZOS)

    def rounded(
        self,
        box: Box,
        radius: float,
        fill: Colour | None,
        outline: Colour | None = None,
        line: float = 1.0,
    ) -> None:
        """Draw a rectangle with round corners."""
        self._draw.rounded_rectangle(
            self._large(box),
            radius * self.scale,
            fill,
            outline,
            self._thick(line) if outline else 0,
        )

    def dots(self, box: Box, pitch: float, radius: float, colour: Colour) -> None:
        """Draw a square pattern of dots, clear of the box's edges."""
        r = radius * self.scale
        xs = np.arange(box[0] + pitch, box[2] - 0.5 * pitch, pitch) * self.scale
        ys = np.arange(box[1] + pitch, box[3] - 0.5 * pitch, pitch) * self.scale
        for x, y in product(xs.tolist(), ys.tolist()):
            self._draw.ellipse((x - r, y - r, x + r, y + r), colour)

    def picture(self, picture: Image.Image, box: Box, radius: float) -> None:
        """Paste a picture of the canvas's large pixels, its corners rounded."""
        mask = Image.new("L", picture.size, 0)
        corner = (picture.width - 1, picture.height - 1)
        ImageDraw.Draw(mask).rounded_rectangle((0, 0, *corner), radius * self.scale, 255)
        x, y, *_ = self._large(box)
        self.image.paste(picture, (x, y), mask)

    def fill(self, rings: Sequence[FloatArray], colour: Colour, alpha: float) -> None:
        """Fill a polygon, holes left out, and let what lies below shine through."""
        corner, mask = self._mask(rings, round(255 * alpha))
        self.image.paste(colour, corner, mask)

    def hatch(self, rings: Sequence[FloatArray], colour: Colour, gap: float, line: float) -> None:
        """Cover a polygon, holes left out, with diagonal lines."""
        corner, mask = self._mask(rings, 255)
        lines = Image.new("L", mask.size, 0)
        draw = ImageDraw.Draw(lines)
        step = gap * self.scale * math.sqrt(2.0)
        first = -((corner[0] + corner[1]) % step)
        for at in np.arange(first, mask.width + mask.height, step).tolist():
            draw.line([(at, 0), (at - mask.height, mask.height)], 255, self._thick(line))
        self.image.paste(colour, corner, ImageChops.multiply(mask, lines))

    def line(self, points: FloatArray, colour: Colour, line: float) -> None:
        """Draw a line through points, shape (k, 2)."""
        flat = (points * self.scale).ravel().tolist()
        self._draw.line(flat, colour, self._thick(line), joint="curve")

    def outline(self, ring: FloatArray, colour: Colour, line: float) -> None:
        """Draw a closed line; a dot where there is no length."""
        if self._dot(ring, colour, line):
            return
        self.line(np.vstack([ring, ring[:2]]), colour, line)

    def dashed(
        self,
        ring: FloatArray,
        colour: Colour,
        line: float,
        dash: float,
        gap: float,
        *,
        ends: bool = False,
    ) -> None:
        """Draw a line, closed or with two ends, in even dashes; a dot where there is no length."""
        if self._dot(ring, colour, line):
            return
        along, closed = _arc_length(ring)
        if ends:
            along, closed = along[:-1], ring
        count = max(2, round(along[-1] / (dash + gap)))
        period = along[-1] / count
        for k in range(count):
            start, stop = k * period, (k + dash / (dash + gap)) * period
            inner = along[(along > start) & (along < stop)]
            self.line(_at(along, closed, np.array([start, *inner, stop])), colour, line)

    def pen(self, ring: FloatArray, colour: Colour, line: float, phase: float) -> None:
        """Draw a closed line as a hand does: pressure varies, the ends overshoot a little."""
        if self._dot(ring, colour, line):
            return
        along, closed = _arc_length(ring)
        length = along[-1]
        stops = np.linspace(0.0, length + min(7.0, length / 8.0), max(8, int(length / 2.5)))
        points = _at(along, closed, stops % length)
        drift = (stops / length) ** 8
        points[:, 0] += 0.5 * np.sin(stops / 17.0 + phase) + 0.8 * drift
        points[:, 1] += 0.5 * np.sin(stops / 23.0 + 2.0 * phase) - 0.8 * drift
        widths = line * (1.0 + 0.28 * np.sin(stops / 31.0 + 3.0 * phase))
        self._brush(points * self.scale, np.maximum(1.0, widths * self.scale), colour)

    def text(
        self,
        at: tuple[float, float],
        text: str,
        size: float,
        colour: Colour,
        *,
        anchor: str = "lm",
        weight: float = 0.0,
        halo: Colour | None = None,
    ) -> None:
        """Write one line; ``weight`` thickens the strokes by a share of the size."""
        where = (at[0] * self.scale, at[1] * self.scale)
        font = self._font(size)
        stroke = round(weight * size * self.scale)
        if halo is not None:
            edge = stroke + round(2.2 * self.scale)
            self._draw.text(where, text, halo, font, anchor, stroke_width=edge, stroke_fill=halo)
        self._draw.text(where, text, colour, font, anchor, stroke_width=stroke, stroke_fill=colour)

    def text_width(self, text: str, size: float) -> float:
        """Return how wide one line is."""
        return self._font(size).getlength(text) / self.scale

    def truncated(self, text: str, size: float, width: float) -> str:
        """Return the text, cut short with an ellipsis where it is wider than ``width``."""
        if self.text_width(text, size) <= width:
            return text
        while text and self.text_width(text + "…", size) > width:
            text = text[:-1]
        return text.rstrip() + "…"

    def _font(self, size: float) -> ImageFont.FreeTypeFont:
        return _font(max(1, round(size * self.scale)))

    def _thick(self, line: float) -> int:
        return max(1, round(line * self.scale))

    def _large(self, box: Box) -> tuple[int, int, int, int]:
        x0, y0, x1, y1 = (round(value * self.scale) for value in box)
        return (x0, y0, x1, y1)

    def _mask(self, rings: Sequence[FloatArray], value: int) -> tuple[tuple[int, int], Image.Image]:
        """Return the polygon's box's upper left corner and its mask, in large pixels."""
        large = [ring * self.scale for ring in rings]
        low = np.floor(large[0].min(axis=0)).astype(int)
        high = np.ceil(large[0].max(axis=0)).astype(int)
        mask = Image.new("L", (int(high[0] - low[0]) + 1, int(high[1] - low[1]) + 1), 0)
        draw = ImageDraw.Draw(mask)
        for k, ring in enumerate(large):
            draw.polygon((ring - low).ravel().tolist(), fill=0 if k else value)
        return (int(low[0]), int(low[1])), mask

    def _dot(self, ring: FloatArray, colour: Colour, line: float) -> bool:
        """Draw a ring too small for a line as a dot; False, and nothing, if it is larger."""
        if np.ptp(ring, axis=0).max() >= 0.5 * line:
            return False
        (x, y), r = (ring[0] * self.scale).tolist(), line * self.scale / 2.0
        self._draw.ellipse((x - r, y - r, x + r, y + r), colour)
        return True

    def _brush(self, points: FloatArray, widths: FloatArray, colour: Colour) -> None:
        """Draw a ribbon of varying width, round at its ends and where it turns sharply."""
        along = np.gradient(points, axis=0)
        along /= np.maximum(np.hypot(*along.T), 1e-9)[:, None]
        across = np.column_stack([-along[:, 1], along[:, 0]]) * widths[:, None] / 2.0
        quads = np.hstack([points + across, points - across])
        quads = np.hstack([quads[:-1], np.roll(quads[1:], 2, axis=1)])
        for quad in quads.tolist():
            self._draw.polygon(quad, colour)
        sharp = np.ones(len(points), dtype=bool)
        sharp[1:-1] = (along[2:] * along[:-2]).sum(axis=1) < 0.9
        half = widths[:, None] / 2.0
        for disc in np.hstack([points - half, points + half])[sharp].tolist():
            self._draw.ellipse(disc, colour)


def printable(text: str) -> str:
    """Return the text on one line in the glyphs that Pillow's own font has.

    What is written in other letters is spelled in Latin ones.

    Examples
    --------
    >>> printable("Küche → 3 m"), printable("кухня")
    ('Kuche -> 3 m', 'kukhnya')
    """
    one_line = " ".join(text.split())
    if one_line.isascii():
        spelled = one_line
    else:
        spelled = "".join(
            char if char in _GLYPHS else _SPELLED.get(char) or anyascii(char) for char in one_line
        )
    return "".join(char for char in spelled if char.isprintable())


@cache
def _font(pixels: int) -> ImageFont.FreeTypeFont:
    font = ImageFont.load_default(pixels)
    if not isinstance(font, ImageFont.FreeTypeFont):
        raise ImportError("Pillow was built without FreeType; install a wheel of Pillow")
    return font


def _arc_length(ring: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far along each corner of the closed ring is, and the closed ring."""
    closed = np.vstack([ring, ring[:1]])
    steps = np.hypot(*np.diff(closed, axis=0).T)
    return np.concatenate([[0.0], np.cumsum(steps)]), closed


def _at(along: FloatArray, closed: FloatArray, stops: FloatArray) -> FloatArray:
    """Return the points at these lengths along a line."""
    return np.column_stack([np.interp(stops, along, closed[:, k]) for k in (0, 1)])
