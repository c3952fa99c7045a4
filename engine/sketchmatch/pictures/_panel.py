"""One panel: a scene on its ground, its objects in their colours, their numbers and labels."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from sketchmatch.model import FloatArray, OccupancyGrid, Scene
from sketchmatch.pictures._canvas import Box, Canvas, printable
from sketchmatch.pictures._markings import Marking, draw_markings
from sketchmatch.pictures._palette import Colour, mixed, readable_on
from sketchmatch.pictures._places import Place, badge_places, label_places
from sketchmatch.pictures._underlay import known_area, painted_cells

__all__ = [
    "ALONE",
    "BORDER",
    "INK",
    "PADDING",
    "WHITE",
    "Panel",
    "badge_size",
    "draw_badge",
    "draw_object",
    "draw_panel",
]

PADDING = (44.0, 60.0, 44.0, 52.0)
WHITE: Colour = (255, 255, 255)
INK: Colour = (23, 32, 51)
BORDER: Colour = (221, 226, 233)
ALONE: Colour = (140, 148, 160)
"""The grey of objects without a partner."""
_PAPER: Colour = (255, 254, 250)
_DOTS: Colour = (229, 226, 215)
# Length of the head of a route's arrow, and half its width.
_HEAD = (13.0, 5.0)


@dataclass(frozen=True)
class Panel:
    """One scene with all that its drawing needs; its objects carry their numbers, from 1.

    Attributes
    ----------
    name
        Written in its upper left corner.
    scene
        The objects.
    colours
        By object; one without a colour is drawn grey and hatched.
    underlay
        The grid under the objects.
    pen
        Whether it is paper and pen.
    metres
        Whether it gets a scale bar.
    badge
        Height of the numbers' badges.
    route
        The way through the scene, shape (k, 2), or None.
    markings
        Points, routes and zones over the objects.
    """

    name: str
    scene: Scene
    colours: Mapping[int, Colour]
    underlay: OccupancyGrid | None = None
    pen: bool = False
    metres: bool = False
    badge: float = 28.0
    route: FloatArray | None = None
    markings: Sequence[Marking] = ()

    def colour(self, index: int) -> Colour:
        """Return an object's colour."""
        return self.colours.get(index, ALONE)

    def area(self) -> Box:
        """Return what is worth showing, in scene units: what is drawn and the room around it."""
        x0, y0, x1, y1 = self.scene.bounds
        lines = [ring for each in self.markings for ring in each.rings]
        for line in lines if self.route is None else [self.route, *lines]:
            (u0, v0), (u1, v1) = line.min(axis=0).tolist(), line.max(axis=0).tolist()
            x0, y0, x1, y1 = min(x0, u0), min(y0, v0), max(x1, u1), max(y1, v1)
        if self.underlay is None:
            return (x0, y0, x1, y1)
        around = 0.75 * max(x1 - x0, y1 - y0)
        u0, v0, u1, v1 = known_area(self.underlay) or (x0, y0, x1, y1)
        return (
            min(x0, max(u0, x0 - around)),
            min(y0, max(v0, y0 - around)),
            max(x1, min(u1, x1 + around)),
            max(y1, min(v1, y1 + around)),
        )


@dataclass(frozen=True)
class _Frame:
    """Scene coordinates to design units: ``scale`` about the middles of both."""

    scale: float
    centre: tuple[float, float]
    middle: tuple[float, float]

    @classmethod
    def fitted(cls, area: Box, box: Box) -> _Frame:
        left, top, right, bottom = PADDING
        inner = (box[0] + left, box[1] + top, box[2] - right, box[3] - bottom)
        width, height = area[2] - area[0], area[3] - area[1]
        scale = min((inner[2] - inner[0]) / width, (inner[3] - inner[1]) / height)
        return cls(scale, _middle(area), _middle(inner))

    def rings(self, rings: Sequence[FloatArray]) -> list[FloatArray]:
        """Return rings in design units."""
        flip = self.scale * np.array([1.0, -1.0])
        return [(ring - self.centre) * flip + self.middle for ring in rings]


def draw_panel(canvas: Canvas, panel: Panel, box: Box) -> None:
    """Draw a panel into its box; smaller objects lie over larger ones."""
    frame = _Frame.fitted(panel.area(), box)
    _draw_ground(canvas, panel, frame, box)
    over_cells = panel.underlay is not None
    rings = [frame.rings(item.rings) for item in panel.scene.objects]
    for k in sorted(range(len(rings)), key=lambda k: -panel.scene.objects[k].area):
        colour, pen = panel.colours.get(k), float(k + 1) if panel.pen else None
        hollow = panel.scene.objects[k].doubtful
        draw_object(canvas, rings[k], colour, pen=pen, over_cells=over_cells, hollow=hollow)
    if panel.route is not None:
        _draw_route(canvas, frame.rings([panel.route])[0])
    draw_markings(canvas, panel.markings, frame.rings, frame.scale, box)
    if panel.metres:
        _draw_scale_bar(canvas, frame.scale, box)
    _draw_names(canvas, panel, [shapely.Polygon(ring[0], ring[1:]) for ring in rings], box)
    if panel.name:
        canvas.text((box[0] + 20.0, box[1] + 27.0), panel.name, 20.0, INK, weight=0.012, halo=WHITE)
    canvas.rounded(box, 14.0, None, BORDER, 1.5)


def _draw_ground(canvas: Canvas, panel: Panel, frame: _Frame, box: Box) -> None:
    if panel.underlay is None:
        canvas.rounded(box, 14.0, _PAPER if panel.pen else WHITE)
        if panel.pen:
            canvas.dots((box[0], box[1] + 24.0, box[2], box[3]), 24.0, 1.1, _DOTS)
        return
    size = (round((box[2] - box[0]) * canvas.scale), round((box[3] - box[1]) * canvas.scale))
    corner = (
        frame.centre[0] + (box[0] - frame.middle[0]) / frame.scale,
        frame.centre[1] - (box[1] - frame.middle[1]) / frame.scale,
    )
    step = 1.0 / (frame.scale * canvas.scale)
    canvas.picture(painted_cells(panel.underlay, size, corner, step), box, 14.0)


def draw_object(
    canvas: Canvas,
    rings: Sequence[FloatArray],
    colour: Colour | None,
    *,
    pen: float | None = None,
    over_cells: bool = False,
    hollow: bool = False,
) -> None:
    """Draw one object, given in design units: in its colour, or grey and hatched without one.

    What is in doubt is ``hollow``: a dashed outline alone.
    ``pen`` is where in its wobble a pen begins; without it, outlines are drawn as by a machine.
    """
    if hollow:
        for ring in rings:
            canvas.dashed(ring, ALONE if colour is None else _edge(colour), 2.4, 7.0, 4.5)
        return
    if over_cells:
        canvas.fill(rings, WHITE, 0.8)
    if colour is None:
        canvas.fill(rings, ALONE, 0.12)
        canvas.hatch(rings, mixed(ALONE, WHITE, 0.35), 9.0, 1.2)
        for ring in rings:
            canvas.dashed(ring, ALONE, 2.0, 7.0, 4.5)
        return
    canvas.fill(rings, colour, 0.42)
    edge = _edge(colour)
    for k, ring in enumerate(rings):
        if pen is not None:
            canvas.pen(ring, mixed(edge, WHITE, 0.45), 1.2, pen + 2.0 + k)
            canvas.pen(ring, edge, 2.8, pen + k)
        else:
            canvas.outline(ring, edge, 2.8)


def _draw_route(canvas: Canvas, points: FloatArray) -> None:
    """Draw a way, given in design units, as a light dashed line with an arrow head at its end."""
    colour = mixed(INK, WHITE, 0.45)
    canvas.dashed(points, colour, 1.6, 8.0, 5.0, ends=True)
    length, half = _HEAD
    away = np.hypot(*(points - points[-1]).T)
    before = np.flatnonzero(away >= length)
    if not before.size:
        return
    # Where the way comes in, not how its last few points tremble.
    heading = (points[-1] - points[before[-1]]) / away[before[-1]]
    back, across = points[-1] - length * heading, half * heading[::-1] * (-1.0, 1.0)
    canvas.fill([np.array([points[-1], back + across, back - across])], colour, 1.0)


def _draw_names(canvas: Canvas, panel: Panel, shapes: Sequence[shapely.Polygon], box: Box) -> None:
    """Write the numbers, then the labels that have room."""
    half = _badge_half(panel.badge, len(shapes))
    bounds = (box[0] + 8.0, box[1] + 46.0, box[2] - 8.0, box[3] - 8.0)
    places = badge_places(shapes, half, bounds)
    texts = {
        k: canvas.truncated(printable(label), 15.0, 150.0)
        for k, label in enumerate(panel.scene.labels)
        if label.strip()
    }
    sizes = {k: (canvas.text_width(text, 15.0), 17.0) for k, text in texts.items()}
    for k, point in label_places(shapes, sizes, places, half, bounds).items():
        ink = mixed(panel.colour(k), INK, 0.72)
        halo = None if shapes[k].contains(shapely.Point(point)) else WHITE
        canvas.text(point, texts[k], 15.0, ink, anchor="mm", halo=halo)
    for k, place in places.items():
        if place.leads_to is not None:
            ends = np.array([[place.x, place.y], place.leads_to])
            canvas.line(ends, _edge(panel.colour(k)), 1.6)
    for k, place in places.items():
        draw_badge(canvas, place, k + 1, panel.badge, panel.colour(k))


def badge_size(count: int) -> float:
    """Return the height of the numbers' badges: smaller where there are many objects."""
    return 28.0 if count <= 16 else 23.0 if count <= 48 else 18.0


def _badge_half(size: float, number: int) -> tuple[float, float]:
    """Return half the width and height of a badge: round, wider for more digits."""
    return (size / 2.0 * (1.0 + 0.22 * max(0, len(str(number)) - 1)), size / 2.0)


def draw_badge(canvas: Canvas, place: Place, number: int, size: float, colour: Colour) -> None:
    """Draw a number in white or dark on a colour."""
    a, b = _badge_half(size, number)
    box = (place.x - a, place.y - b, place.x + a, place.y + b)
    canvas.rounded(box, b, colour, WHITE, 0.075 * size)
    ink = readable_on(colour)
    canvas.text((place.x, place.y), str(number), 0.58 * size, ink, anchor="mm", weight=0.02)


def _draw_scale_bar(canvas: Canvas, scale: float, box: Box) -> None:
    """Draw a round length of 60 … 150 design units in the lower right corner."""
    metres = _round_below(150.0 / scale)
    text = _length_text(metres)
    right, y = box[2] - 22.0, box[3] - 20.0
    left = right - metres * scale
    backing = (left - 22.0 - canvas.text_width(text, 15.0), y - 13.0, right + 10.0, y + 13.0)
    canvas.rounded(backing, 8.0, WHITE, BORDER)
    ends = np.array([[left, y - 5], [left, y + 5], [left, y], [right, y], [right, y + 5]])
    canvas.line(np.vstack([ends, [right, y - 5]]), INK, 1.6)
    canvas.text((left - 10.0, y), text, 15.0, INK, anchor="rm")


def _round_below(length: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is not above ``length``."""
    power = 10.0 ** math.floor(math.log10(length))
    return next(digit * power for digit in (5.0, 2.0, 1.0) if digit * power <= length * 1.0000001)


def _length_text(metres: float) -> str:
    if metres >= 1000.0:
        return f"{metres / 1000.0:g} km"
    return f"{metres:g} m" if metres >= 1.0 else f"{metres * 100.0:g} cm"


def _edge(colour: Colour) -> Colour:
    """Return the outline that goes with a fill."""
    return mixed(colour, INK, 0.12)


def _middle(box: Box) -> tuple[float, float]:
    return ((box[0] + box[2]) / 2.0, (box[1] + box[3]) / 2.0)
