"""Points, routes and zones over a panel, and how sure their places are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from sketchmatch.model import FloatArray
from sketchmatch.pictures._canvas import Box, Canvas, printable
from sketchmatch.pictures._palette import Colour, mixed

__all__ = ["Marking", "draw_markings"]

_ROUTE: Colour = (176, 24, 84)
_ZONE: Colour = (74, 60, 150)
_WHITE: Colour = (255, 255, 255)
_SURE = 2.0
"""Standard deviations that the shade reaches to."""
_HEAD = (16.0, 6.0)
_MOST_SHADED = 400


@dataclass(frozen=True, eq=False)
class Marking:
    """A point, a route or a zone in a scene.

    Attributes
    ----------
    kind
        ``"point"``, ``"route"`` or ``"zone"``.
    rings
        Its lines of points, each of shape (k, 2), in scene units.
    deviations
        For each line, shape (k,), standard deviations along each axis in scene units; empty where
        the places are what they are.
    name
        For people.
    """

    kind: str
    rings: tuple[FloatArray, ...]
    deviations: tuple[FloatArray, ...] = ()
    name: str = ""


def draw_markings(
    canvas: Canvas,
    markings: Sequence[Marking],
    placed: Callable[[Sequence[FloatArray]], list[FloatArray]],
    scale: float,
    box: Box,
) -> None:
    """Draw markings into a panel's box: zones first, then routes and points, and names last.

    Parameters
    ----------
    canvas
        Where.
    markings
        What.
    placed
        Turns lines of scene units into such of design units.
    scale
        Design units for a scene unit.
    box
        Beyond which nothing is drawn.
    """
    frame = shapely.box(*box)
    order = ("zone", "route", "point")
    for marking in sorted(markings, key=lambda each: order.index(each.kind)):
        lines = placed(marking.rings)
        colour = _ZONE if marking.kind == "zone" else _ROUTE
        for line, deviations in zip(lines, marking.deviations, strict=False):
            shade = _shade(line, deviations * scale * _SURE, marking.kind == "zone")
            _fill(canvas, shapely.intersection(shade, frame), colour, 0.16)
        _draw(canvas, marking.kind, lines, colour, frame)
    for marking in markings:
        if marking.name.strip():
            _write(canvas, marking, placed(marking.rings), box)


def _draw(
    canvas: Canvas, kind: str, lines: Sequence[FloatArray], colour: Colour, frame: shapely.Polygon
) -> None:
    if kind == "zone":
        area = shapely.make_valid(shapely.Polygon(lines[0], lines[1:]))
        for part in _polygons(shapely.intersection(area, frame)):
            canvas.hatch(_rings(part), mixed(colour, _WHITE, 0.35), 12.0, 1.0)
        for ring in lines:
            _stroke(canvas, np.vstack([ring, ring[:1]]), colour, frame)
    elif kind == "route":
        _stroke(canvas, lines[0], colour, frame)
        _arrow(canvas, lines[0], colour, frame)
    elif frame.contains(shapely.Point(lines[0][0])):
        circle = shapely.get_coordinates(shapely.Point(lines[0][0]).buffer(6.0))
        canvas.fill([circle], _WHITE, 1.0)
        canvas.outline(circle[:-1], colour, 3.0)


def _stroke(canvas: Canvas, line: FloatArray, colour: Colour, frame: shapely.Polygon) -> None:
    for part in shapely.get_parts(shapely.intersection(shapely.LineString(line), frame)):
        points = shapely.get_coordinates(part)
        if len(points) > 1:
            canvas.line(points, _WHITE, 5.0)
            canvas.line(points, colour, 3.0)


def _arrow(canvas: Canvas, line: FloatArray, colour: Colour, frame: shapely.Polygon) -> None:
    length, half = _HEAD
    away = np.hypot(*(line - line[-1]).T)
    before = np.flatnonzero(away >= length)
    if not before.size or not frame.contains(shapely.Point(line[-1])):
        return
    heading = (line[-1] - line[before[-1]]) / away[before[-1]]
    back, across = line[-1] - length * heading, half * heading[::-1] * (-1.0, 1.0)
    canvas.fill([np.array([line[-1] + 4.0 * heading, back + across, back - across])], colour, 1.0)


def _shade(line: FloatArray, widths: FloatArray, closed: bool) -> shapely.Geometry:
    """Return the area around a line that is as wide as its points are unsure."""
    step = max(1, len(line) // _MOST_SHADED)
    kept = np.unique(np.append(np.arange(0, len(line), step), len(line) - 1))
    line, widths = line[kept], np.maximum(widths[kept], 0.1)
    circles = shapely.buffer(shapely.points(line), widths, quad_segs=6)
    if len(line) == 1:
        return shapely.union_all(circles)
    following = np.roll(circles, -1) if closed else circles[1:]
    pairs = zip(circles, following, strict=False)
    return shapely.union_all(
        [shapely.convex_hull(shapely.union(first, second)) for first, second in pairs]
    )


def _fill(canvas: Canvas, area: shapely.Geometry, colour: Colour, alpha: float) -> None:
    for part in _polygons(area):
        canvas.fill(_rings(part), colour, alpha)


def _polygons(area: shapely.Geometry) -> list[shapely.Polygon]:
    return [part for part in shapely.get_parts(area) if part.geom_type == "Polygon"]


def _rings(polygon: shapely.Polygon) -> list[FloatArray]:
    return [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)]


def _write(canvas: Canvas, marking: Marking, lines: Sequence[FloatArray], box: Box) -> None:
    if marking.kind == "zone":
        point = shapely.make_valid(shapely.Polygon(lines[0], lines[1:])).representative_point()
        x, y = point.x, point.y
    else:
        x, y = lines[0][0].tolist()
        y -= 18.0
    if not (box[0] <= x <= box[2] and box[1] <= y <= box[3]):
        return
    colour = _ZONE if marking.kind == "zone" else _ROUTE
    text = canvas.truncated(printable(marking.name), 16.0, 180.0)
    half = canvas.text_width(text, 16.0) / 2.0 + 6.0
    x = min(max(x, box[0] + half), box[2] - half)
    canvas.text((x, max(y, box[1] + 16.0)), text, 16.0, colour, anchor="mm", halo=_WHITE)
