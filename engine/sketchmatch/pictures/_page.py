"""The whole page: header, panels of one size, legend."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image

from sketchmatch.pictures._canvas import Box, Canvas, printable
from sketchmatch.pictures._palette import Colour, mixed
from sketchmatch.pictures._panel import (
    BORDER,
    INK,
    PADDING,
    WHITE,
    Panel,
    draw_badge,
    draw_object,
    draw_panel,
)
from sketchmatch.pictures._places import Place

__all__ = [
    "GUTTER",
    "HEADER",
    "MARGIN",
    "PAGE",
    "ROW",
    "SOFT",
    "Entry",
    "Page",
    "draw_entry",
    "draw_header",
    "panel_height",
]

MARGIN, GUTTER, HEADER, ROW = 36.0, 24.0, 108.0, 38.0
# From the number in the sketch to that on the map.
_PAIR = 40.0
PAGE: Colour = (246, 247, 249)
SOFT: Colour = (98, 112, 134)
_ALERT: Colour = (255, 241, 205)
_ALERT_EDGE: Colour = (222, 164, 32)


@dataclass(frozen=True)
class Entry:
    """One line of the legend.

    Attributes
    ----------
    numbers
        Of an object, or of a pair: in the sketch, then on the map.
    colour
        What these are drawn in.
    name
        What it is called.
    share
        How sure the pair is, 0 … 1, or None.
    said
        The same in words; the number where empty.
    """

    numbers: tuple[int, ...]
    colour: Colour
    name: str
    share: float | None = None
    said: str = ""


@dataclass(frozen=True)
class Page:
    """Header, alert, panels of one size, legend, footnote; from top to bottom."""

    across: float
    panels: Sequence[Panel]
    entries: Sequence[Entry]
    note: str
    alert: str = ""
    footnote: str = ""

    def drawn(
        self, title: str, caption: str, facts: Sequence[tuple[str, str]], width: int
    ) -> Image.Image:
        """Return the finished picture."""
        boxes = self._boxes()
        legend = self._legend_box(boxes[0][3])
        foot = ROW if self.footnote else 0.0
        canvas = Canvas((self.across, legend[3] + foot + MARGIN), width, PAGE)
        draw_header(canvas, self.across, title, caption, facts)
        if self.alert:
            self._draw_alert(canvas)
        for panel, box in zip(self.panels, boxes, strict=True):
            draw_panel(canvas, panel, box)
        if legend[3] > legend[1]:
            self._draw_legend(canvas, legend)
        if self.footnote:
            said = canvas.truncated(printable(self.footnote), 16.0, self.across - 2.0 * MARGIN)
            canvas.text((MARGIN, legend[3] + 0.8 * ROW), said, 16.0, SOFT)
        return canvas.finished()

    def _boxes(self) -> list[Box]:
        """Return the panels' boxes."""
        count = len(self.panels)
        width = (self.across - 2.0 * MARGIN - (count - 1) * GUTTER) / count
        height = panel_height(self.panels, width)
        lefts = [MARGIN + k * (width + GUTTER) for k in range(count)]
        top = HEADER + (ROW + GUTTER if self.alert else 0.0)
        return [(x, top, x + width, top + height) for x in lefts]

    def _draw_alert(self, canvas: Canvas) -> None:
        """Write in a box across the page what is to be known before the answer is used."""
        box = (MARGIN, HEADER - 4.0, self.across - MARGIN, HEADER + ROW + 4.0)
        canvas.rounded(box, 12.0, _ALERT, _ALERT_EDGE, 2.0)
        said = canvas.truncated(printable(self.alert), 22.0, box[2] - box[0] - 40.0)
        middle = (box[1] + box[3]) / 2.0
        canvas.text((MARGIN + 20.0, middle), said, 22.0, INK, weight=0.012)

    def _legend_box(self, top: float) -> Box:
        rows = math.ceil(len(self.entries) / self._columns()) + (1 if self.note else 0)
        if not rows:
            return (MARGIN, top, self.across - MARGIN, top)
        top += GUTTER
        return (MARGIN, top, self.across - MARGIN, top + rows * ROW + 20.0)

    def _columns(self) -> int:
        """Return how many entries share a row, the rows evenly filled."""
        if not self.entries:
            return 1
        named = any(entry.name for entry in self.entries)
        paired = any(len(entry.numbers) > 1 for entry in self.entries)
        least = (340.0 if named else 186.0) + (_PAIR if paired else 0.0)
        most = int((self.across - 2.0 * MARGIN) / least)
        rows = math.ceil(len(self.entries) / most)
        return max(math.ceil(len(self.entries) / rows), min(4, most))

    def _draw_legend(self, canvas: Canvas, box: Box) -> None:
        canvas.rounded(box, 12.0, WHITE, BORDER)
        columns = self._columns()
        pitch = (box[2] - box[0] - 24.0) / columns
        for k, entry in enumerate(self.entries):
            row, column = divmod(k, columns)
            x, y = box[0] + 20.0 + column * pitch, box[1] + 10.0 + (row + 0.5) * ROW
            draw_entry(canvas, entry, x, y, pitch - (44.0 if entry.name else 34.0))
        if self.note:
            _draw_note(canvas, self.note, box[0] + 20.0, box[3] - 10.0 - 0.5 * ROW)


def panel_height(panels: Sequence[Panel], width: float) -> float:
    """Return how high panels of a width are: as the scenes need, within reason."""
    left, top, right, bottom = PADDING
    areas = [panel.area() for panel in panels]
    slope = max((area[3] - area[1]) / (area[2] - area[0]) for area in areas)
    height = (width - left - right) * slope + top + bottom
    return min(max(height, 0.62 * width), 0.96 * width)


def draw_header(
    canvas: Canvas, across: float, title: str, caption: str, facts: Sequence[tuple[str, str]]
) -> None:
    """Write the headline, the line below it, and on the right the facts.

    The last facts give way to the headline, up to a third of the page.
    """
    title, caption = printable(title), printable(caption)
    said = [(printable(name), printable(value)) for name, value in facts]
    widths = [max(canvas.text_width(a, 15.0), canvas.text_width(b, 25.0)) for a, b in said]
    wanted = min(canvas.text_width(title, 34.0), across / 3.0)
    while said and across - 2.0 * MARGIN - sum(widths) - 44.0 * len(said) < wanted:
        said.pop()
        widths.pop()
    right = across - MARGIN
    for (name, value), width in zip(reversed(said), reversed(widths), strict=True):
        left = right - width
        canvas.text((left, 44.0), name, 15.0, SOFT)
        canvas.text((left, 72.0), value, 25.0, INK, weight=0.012)
        canvas.line(np.array([[left - 22.0, 36.0], [left - 22.0, 84.0]]), BORDER, 1.5)
        right = left - 44.0
    room = right - MARGIN
    middle = 47.0 if caption else 60.0
    title = canvas.truncated(title, 34.0, room)
    canvas.text((MARGIN, middle), title, 34.0, INK, weight=0.018)
    if caption:
        canvas.text((MARGIN, 83.0), canvas.truncated(caption, 17.0, room), 17.0, SOFT)


def draw_entry(canvas: Canvas, entry: Entry, x: float, y: float, width: float) -> None:
    """Draw one entry of a legend, from ``x`` on around the height ``y``."""
    for k, number in enumerate(entry.numbers):
        draw_badge(canvas, Place(x + 16.0 + k * _PAIR, y), number, 25.0, entry.colour)
    if len(entry.numbers) > 1:
        _draw_arrow(canvas, x + 16.0 + _PAIR / 2.0, y)
    left, right = x + 40.0 + (len(entry.numbers) - 1) * _PAIR, x + width
    if entry.share is not None:
        share = min(max(entry.share, 0.0), 1.0)
        start = right - 130.0 if entry.name else left
        end = min(start + 80.0, right - 50.0)
        _draw_bar(canvas, (start, y - 3.5, end, y + 3.5), share, entry.colour)
        canvas.text((end + 10.0, y), entry.said or f"{share:.3f}", 16.0, INK)
        right = start - 12.0
    if entry.name:
        canvas.text((left, y), canvas.truncated(entry.name, 16.0, right - left), 16.0, INK)


def _draw_arrow(canvas: Canvas, x: float, y: float) -> None:
    """Draw a small arrow to the right around a point."""
    canvas.line(np.array([[x - 6.0, y], [x + 3.0, y]]), SOFT, 1.4)
    canvas.fill([np.array([[x + 7.0, y], [x + 2.0, y - 3.5], [x + 2.0, y + 3.5]])], SOFT, 1.0)


def _draw_bar(canvas: Canvas, box: Box, share: float, colour: Colour) -> None:
    radius = (box[3] - box[1]) / 2.0
    canvas.rounded(box, radius, mixed(BORDER, WHITE, 0.35))
    if share > 0.0:
        filled = max(share * (box[2] - box[0]), 2.0 * radius)
        canvas.rounded((box[0], box[1], box[0] + filled, box[3]), radius, colour)


def _draw_note(canvas: Canvas, note: str, x: float, y: float) -> None:
    swatch = np.array([[x + 3, y - 10], [x + 29, y - 10], [x + 29, y + 10], [x + 3, y + 10]])
    draw_object(canvas, [swatch], None)
    canvas.text((x + 40.0, y), note, 16.0, SOFT)
