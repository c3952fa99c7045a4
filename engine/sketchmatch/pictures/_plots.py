"""A page of relations: a numbered scene, and polar plots of the histograms of its pairs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image

from sketchmatch.model import FloatArray
from sketchmatch.pictures._canvas import Box, Canvas, printable
from sketchmatch.pictures._page import (
    GUTTER,
    HEADER,
    MARGIN,
    PAGE,
    ROW,
    SOFT,
    Entry,
    draw_entry,
    draw_header,
    panel_height,
)
from sketchmatch.pictures._palette import mixed, pair_colour
from sketchmatch.pictures._panel import BORDER, INK, WHITE, Panel, draw_badge, draw_panel
from sketchmatch.pictures._places import Place

__all__ = ["MOST_PLOTS", "Plot", "RelationsPage"]

MOST_PLOTS = 16
"""More would be too small to read."""

_ACROSS = 1600.0
_GAP, _HEAD, _FOOT = 14.0, 56.0, 34.0
# Plots in a row and the width of one, by the number of plots.
_GRIDS = ((1, 1, 500.0), (4, 2, 330.0), (9, 3, 268.0), (MOST_PLOTS, 4, 226.0))


@dataclass(frozen=True)
class Plot:
    """One histogram.

    Attributes
    ----------
    numbers
        Of the object whose direction it describes, and of the one that it is seen from.
    phrase
        What stands between the two numbers.
    degree
        How well it describes the histogram.
    histogram
        Shape (n,), from +x counter-clockwise.
    direction
        The main direction, radians, or None where none shall be marked.
    """

    numbers: tuple[int, int]
    phrase: str
    degree: float
    histogram: FloatArray
    direction: float | None


@dataclass(frozen=True)
class RelationsPage:
    """Header; below it the scene with its labels on the left and a grid of plots on the right.

    Attributes
    ----------
    panel, entries, plots
        The scene, its legend, and the histograms.
    others
        The pairs that are not drawn, each as it is written, for a line at the bottom.
    """

    panel: Panel
    entries: Sequence[Entry]
    plots: Sequence[Plot]
    others: Sequence[str] = ()

    def drawn(self, title: str, caption: str, width: int) -> Image.Image:
        """Return the finished picture."""
        columns, cell = next((c, w) for most, c, w in _GRIDS if len(self.plots) <= most)
        rows = math.ceil(len(self.plots) / columns)
        high = cell + _HEAD + _FOOT - 20.0
        grid = (columns * (cell + _GAP) - _GAP, rows * (high + _GAP) - _GAP)
        left = _ACROSS - 2.0 * MARGIN - GUTTER - grid[0]
        legend = math.ceil(len(self.entries) / 2) * ROW + 20.0 + GUTTER if self.entries else 0.0
        panel = max(panel_height([self.panel], left), min(grid[1] - legend, 1.9 * left))
        bottom = HEADER + max(grid[1], panel + legend)
        note = ROW if self.others else 0.0
        canvas = Canvas((_ACROSS, bottom + note + MARGIN), width, PAGE)
        draw_header(canvas, _ACROSS, title, caption, ())
        draw_panel(canvas, self.panel, (MARGIN, HEADER, MARGIN + left, HEADER + panel))
        if self.entries:
            top = HEADER + panel + GUTTER
            self._draw_legend(canvas, (MARGIN, top, MARGIN + left, top + legend - GUTTER))
        for k, plot in enumerate(self.plots):
            row, column = divmod(k, columns)
            x = MARGIN + left + GUTTER + column * (cell + _GAP)
            y = HEADER + row * (high + _GAP)
            _draw_plot(canvas, plot, (x, y, x + cell, y + high))
        if self.others:
            at = (MARGIN, bottom + 0.8 * ROW)
            canvas.text(at, _listed(canvas, self.others, 16.0), 16.0, SOFT)
        return canvas.finished()

    def _draw_legend(self, canvas: Canvas, box: Box) -> None:
        canvas.rounded(box, 12.0, WHITE, BORDER)
        pitch = (box[2] - box[0] - 24.0) / 2.0
        for k, entry in enumerate(self.entries):
            row, column = divmod(k, 2)
            x, y = box[0] + 20.0 + column * pitch, box[1] + 10.0 + (row + 0.5) * ROW
            draw_entry(canvas, entry, x, y, pitch - 44.0)


def _listed(canvas: Canvas, pairs: Sequence[str], size: float) -> str:
    """Return one line that lists as many pairs as fit and counts the others."""
    best = f"not drawn: {len(pairs)}"
    for shown in range(1, len(pairs) + 1):
        rest = f" and {len(pairs) - shown} more" if shown < len(pairs) else ""
        line = f"not drawn: {'  '.join(pairs[:shown])}{rest}"
        if canvas.text_width(line, size) > _ACROSS - 2.0 * MARGIN:
            break
        best = line
    return best


def _draw_plot(canvas: Canvas, plot: Plot, box: Box) -> None:
    """Draw one histogram as a card: the sentence, the rose of its forces, the figures."""
    canvas.rounded(box, 12.0, WHITE, BORDER)
    grown = 1.0 if box[2] - box[0] < 300.0 else 1.2
    _draw_sentence(canvas, plot, box, grown)
    radius = (box[2] - box[0]) / 2.0 - 28.0
    middle = np.array([(box[0] + box[2]) / 2.0, (box[1] + _HEAD + box[3] - _FOOT) / 2.0])
    _draw_rose(canvas, plot, middle, radius)
    y, size = box[3] - 18.0, 13.0 * grown
    if plot.direction is not None:
        turn = round(math.degrees(plot.direction)) % 360
        canvas.text((box[0] + 14.0, y), f"towards {turn}°", size, SOFT)
    canvas.text((box[2] - 14.0, y), f"degree {plot.degree:.2f}", size, SOFT, anchor="rm")


def _draw_sentence(canvas: Canvas, plot: Plot, box: Box, grown: float) -> None:
    """Write the phrase between the two numbers, in two lines if it must be."""
    size, badge, y = 14.0 * grown, 24.0 * grown, box[1] + 31.0
    for number, x in zip(plot.numbers, (box[0] + 28.0, box[2] - 28.0), strict=True):
        draw_badge(canvas, Place(x, y), number, badge, pair_colour(number))
    words = printable(plot.phrase).split()
    lines = [" ".join(words)]
    if canvas.text_width(lines[0], size) > box[2] - box[0] - 100.0:
        cuts = [(" ".join(words[:k]), " ".join(words[k:])) for k in range(1, len(words))]
        lines = list(min(cuts, key=lambda cut: max(canvas.text_width(part, size) for part in cut)))
    for k, line in enumerate(lines):
        at = ((box[0] + box[2]) / 2.0, y + (k - (len(lines) - 1) / 2.0) * 1.25 * size)
        canvas.text(at, line, size, INK, anchor="mm")


def _draw_rose(canvas: Canvas, plot: Plot, middle: FloatArray, radius: float) -> None:
    """Draw the forces by direction, the largest as long as the radius."""
    circle = _around(np.linspace(0.0, 2.0 * math.pi, 180, endpoint=False))
    canvas.fill([middle + radius * circle], PAGE, 1.0)
    for share in (0.5, 1.0):
        canvas.outline(middle + share * radius * circle, BORDER, 1.2)
    for axis in _around(np.array([0.0, math.pi / 2.0])):
        canvas.line(np.array([middle - radius * axis, middle + radius * axis]), BORDER, 1.2)
    colour, other = (pair_colour(number) for number in plot.numbers)
    peak = float(plot.histogram.max())
    if peak > 0.0:
        angles = 2.0 * math.pi * np.arange(len(plot.histogram)) / len(plot.histogram)
        lengths = radius * np.maximum(plot.histogram, 0.0)[:, None] / peak
        ring = middle + lengths * _around(angles)
        canvas.fill([ring], colour, 0.42)
        canvas.outline(ring, mixed(colour, INK, 0.12), 2.0)
    if plot.direction is not None:
        _draw_pointer(canvas, plot.direction, middle, radius)
    x, y = middle.tolist()
    canvas.rounded((x - 6.0, y - 6.0, x + 6.0, y + 6.0), 6.0, other, WHITE, 1.6)


def _draw_pointer(canvas: Canvas, direction: float, middle: FloatArray, radius: float) -> None:
    """Mark the main direction from the middle to the rim, with a head just beyond it."""
    along, across = _around(np.array([direction, direction + math.pi / 2.0]))
    canvas.line(np.array([middle, middle + radius * along]), INK, 2.0)
    head = [(radius + 9.0) * along, radius * along + 6.0 * across, radius * along - 6.0 * across]
    canvas.fill([middle + np.array(head)], INK, 1.0)


def _around(angles: FloatArray) -> FloatArray:
    """Return the unit vectors of angles in design units, y down, shape (k, 2)."""
    return np.column_stack([np.cos(angles), -np.sin(angles)])
