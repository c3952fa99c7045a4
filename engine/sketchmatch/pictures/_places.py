"""Where numbers and labels go: inside their object where they fit, else beside it, apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.ops import polylabel

from sketchmatch.model import FloatArray
from sketchmatch.pictures._canvas import Box

__all__ = ["Place", "badge_places", "label_places"]

_GAP = 4.0


@dataclass(frozen=True)
class Place:
    """The middle of a badge, and the point of the object that a line leads to if it is away."""

    x: float
    y: float
    leads_to: tuple[float, float] | None = None


def badge_places(
    shapes: Sequence[shapely.Polygon], half: tuple[float, float], bounds: Box
) -> dict[int, Place]:
    """Find a place for each object's badge.

    Parameters
    ----------
    shapes
        All objects of the panel, in design units.
    half
        Half the width and height of a badge.
    bounds
        Where badges may be.

    Returns
    -------
    dict
        By index. A badge lies inside its object, clear of the others, or beside it.
    """
    tree = shapely.STRtree(shapes)
    places = {}
    for index in range(len(shapes)):
        point, radius = _deepest(shapes[index], _in_front(shapes, tree, index))
        if radius >= max(1.3 * half[1], 1.05 * half[0]):
            places[index] = Place(*point)
    for index in sorted(set(range(len(shapes))) - set(places), key=lambda k: shapes[k].area):
        taken = np.array([(place.x, place.y) for place in places.values()]).reshape(-1, 2)
        places[index] = _beside(shapes[index], tree, taken, half, bounds)
    return places


def label_places(
    shapes: Sequence[shapely.Polygon],
    sizes: dict[int, tuple[float, float]],
    badges: dict[int, Place],
    half: tuple[float, float],
    bounds: Box,
) -> dict[int, tuple[float, float]]:
    """Find the middle of each label that has room: under its badge, else around its object."""
    taken = [_around((place.x, place.y), half) for place in badges.values()]
    tree = shapely.STRtree(shapes)
    inside = shapely.box(*bounds)
    places = {}
    for index, (width, height) in sizes.items():
        middle = (width / 2.0, height / 2.0)
        for point in _label_points(shapes[index], badges.get(index), middle, half):
            box = _around(point, middle)
            others = set(tree.query(box, predicate="intersects").tolist()) - {index}
            whole = shapes[index].contains(box) or not shapes[index].intersects(box)
            if (
                whole
                and not others
                and inside.contains(box)
                and not any(box.intersects(other) for other in taken)
            ):
                places[index] = point
                taken.append(box)
                break
    return places


def _deepest(
    shape: shapely.Polygon, cover: shapely.Geometry | None
) -> tuple[tuple[float, float], float]:
    """Return a point deep in a shape's uncovered part, its centroid if fit, and how deep."""
    nowhere = ((shape.centroid.x, shape.centroid.y), 0.0)
    if not shape.is_valid:
        return nowhere
    free = (shape if cover is None else shape.difference(cover)).simplify(0.3)
    parts = [part for part in shapely.get_parts(free) if part.geom_type == "Polygon"]
    part = max(parts, key=lambda item: item.area, default=shapely.Polygon())
    if part.is_empty or not part.is_valid:
        return nowhere
    x0, y0, x1, y1 = part.bounds
    if min(x1 - x0, y1 - y0) < 4.0:
        return nowhere
    point, middle = polylabel(part, 1.0), part.centroid
    depth = part.boundary.distance(point)
    if part.contains(middle) and part.boundary.distance(middle) >= 0.75 * depth:
        point, depth = middle, part.boundary.distance(middle)
    return (point.x, point.y), float(depth)


def _in_front(
    shapes: Sequence[shapely.Polygon], tree: shapely.STRtree, index: int
) -> shapely.Geometry | None:
    """Return what smaller objects, which are drawn later, may cover of an object."""
    area = shapes[index].area
    near = tree.query(shapes[index], predicate="intersects").tolist()
    smaller = [shapes[k] for k in near if k != index and shapes[k].area <= area]
    smaller = [shape for shape in smaller if shape.is_valid]
    return shapely.union_all(smaller) if smaller else None


def _beside(
    shape: shapely.Polygon,
    tree: shapely.STRtree,
    taken: FloatArray,
    half: tuple[float, float],
    bounds: Box,
) -> Place:
    """Return the candidate that disturbs least: clear of objects and badges, near, above."""
    reach = max(half) + _GAP
    points, away = _ring_points(shape, reach)
    outward = points - [shape.centroid.x, shape.centroid.y]
    cost = away / reach - 0.3 * (outward @ [0.6, -0.8]) / np.hypot(*outward.T)
    hits, _ = tree.query(shapely.points(points), predicate="dwithin", distance=reach - 1.0)
    cost += 8.0 * np.bincount(hits, minlength=len(points))
    if len(taken):
        gaps = np.abs(points[:, None] - taken[None]) < 2.0 * np.array(half) + 2.0
        cost += 30.0 * gaps.all(axis=2).sum(axis=1)
    low, high = np.array(bounds[:2]) + half, np.array(bounds[2:]) - half
    cost += 100.0 * ((points < low) | (points > high)).any(axis=1)
    best = int(np.argmin(cost))
    x, y = np.clip(points[best], low, np.maximum(low, high)).tolist()
    near = shapely.shortest_line(shape, shapely.Point(x, y)).coords[0]
    return Place(x, y, (near[0], near[1]))


def _ring_points(shape: shapely.Polygon, reach: float) -> tuple[FloatArray, FloatArray]:
    """Return candidates on rings around a shape and how far each is from it."""
    points, away = [], []
    for k in range(5):
        distance = reach * (1.0 + 0.8 * k)
        ring = shapely.convex_hull(shape).buffer(distance).exterior
        stops = np.linspace(0.0, 1.0, 24 + 8 * k, endpoint=False)
        points.append(shapely.get_coordinates(ring.interpolate(stops, normalized=True)))
        away.append(np.full(len(stops), distance))
    return np.concatenate(points), np.concatenate(away)


def _label_points(
    shape: shapely.Polygon,
    badge: Place | None,
    middle: tuple[float, float],
    half: tuple[float, float],
) -> list[tuple[float, float]]:
    x0, y0, x1, y1 = shape.bounds
    x, y = (x0 + x1) / 2.0, (y0 + y1) / 2.0
    across, down = middle[0] + _GAP + 2.0, middle[1] + _GAP
    inside = [(x, y)]
    if badge is not None:
        step = half[1] + middle[1] + 1.0
        inside = [(badge.x, badge.y + step), (badge.x, badge.y - step)]
    around = [(x, y1 + down), (x, y0 - down), (x1 + across, y), (x0 - across, y)]
    return inside + around


def _around(point: tuple[float, float], half: tuple[float, float]) -> shapely.Polygon:
    (x, y), (a, b) = point, half
    return shapely.box(x - a, y - b, x + a, y + b)
