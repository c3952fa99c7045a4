"""Furnished rooms along a corridor, and people who remember their order better than their measures.

Rooms hold much that is alike: rows of desks, chairs around tables, beds along a wall. Who draws
them straightens headings, lets things line up, knows sizes as small, medium and large, keeps the
order along both walls but not the distances, moves what belongs together as one, and draws what
is near larger than what is far.

No number of the engine was or will be learned from this: it is what the study measures with.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import shapely

from sketchmatch.model import BoolArray, FloatArray, Scene
from sketchmatch.testing import spacing
from tests.experiments.generators import outlines
from tests.experiments.people import Shapes

__all__ = ["drawn", "furnished", "thing"]

_GAP = 0.04
_CORRIDOR = 1.8

# What people do, in shares of the spacing or as standard deviations of logarithms.
_GRID = 0.5
_SNAPPED = 0.6
_WARP = 0.25
_KNOTS = 4
_GROUP = 0.15
_NEAR = 0.35
_HAND = 0.06
_TILT = 0.1
_SMALLER = 0.93
_CLASSES = 3
_ASPECTS = np.array([1.0, 1.5, 2.4])


def furnished(rng: np.random.Generator, objects: int) -> list[FloatArray]:
    """Return the outlines of a floor's furniture: as many rooms as it takes, on both sides."""
    placed: list[FloatArray] = []
    edges = [0.0, 0.0]
    while len(placed) < objects:
        side = int(edges[1] < edges[0])
        width, depth = rng.uniform(4.5, 7.5), rng.uniform(4.0, 6.0)
        room = _room(rng, width, depth)
        corner = np.array([edges[side], _CORRIDOR / 2.0])
        mirrored = np.array([1.0, 1.0 if side else -1.0])
        placed += [(ring + corner) * mirrored for ring in room]
        edges[side] += width + 0.2
    # The last room is one that was furnished less.
    return placed[:objects]


def thing(rng: np.random.Generator) -> FloatArray:
    """Return a thing around the origin as it may stand in any room."""
    makers: tuple[Callable[[], FloatArray], ...] = (
        lambda: _box(rng.uniform(0.9, 1.5), rng.uniform(0.4, 0.7)),
        lambda: _box(0.5, 0.5),
        lambda: _round(rng.uniform(0.45, 0.9)),
    )
    return outlines.turned(makers[rng.integers(3)](), outlines.TURNS * rng.integers(4) / 4.0)


def drawn(
    things: Sequence[FloatArray], room: Scene, shapes: Shapes, rng: np.random.Generator
) -> list[FloatArray]:
    """Return things of a room as they are drawn from memory.

    Things that would meet are drawn smaller until they do not.
    """
    unit = spacing(room)
    polygons = [shapely.Polygon(ring) for ring in things]
    centres = np.array([shapely.get_coordinates(each.centroid)[0] for each in polygons])
    straight = [_straightened(ring, shapes) for ring in things]
    sizes = _remembered_sizes(np.sqrt([each.area for each in polygons]), room, rng)
    places = _warped(_shifted(_aligned(centres, unit, rng), unit, rng), rng)
    places, growth = _seen_from_one_side(places, rng)
    sizes *= growth
    while True:
        rings = [
            ring * size + place for ring, size, place in zip(straight, sizes, places, strict=True)
        ]
        meeting = _meeting(rings)
        if not meeting.any():
            break
        sizes[meeting] *= _SMALLER
    quarter = outlines.TURNS * rng.integers(4) / 4.0
    heading = quarter + rng.normal(0.0, _TILT)
    scale = float(np.exp(rng.uniform(-1.0, 1.0)))
    return [outlines.turned(ring, heading) * scale for ring in rings]


def _room(rng: np.random.Generator, width: float, depth: float) -> list[FloatArray]:
    """Return the furniture of a room, the corner nearest the corridor's start at the origin."""
    kinds = (_office, _ward, _meeting_room, _living_room)
    placed: list[FloatArray] = []
    wanted = [
        *kinds[rng.integers(len(kinds))](rng, width, depth),
        *_along_walls(rng, width, depth),
    ]
    for ring in wanted:
        low, high = ring.min(axis=0), ring.max(axis=0)
        if (low < 0.02).any() or high[0] > width - 0.02 or high[1] > depth - 0.02:
            continue
        outline = shapely.Polygon(ring)
        if all(shapely.Polygon(other).distance(outline) >= _GAP for other in placed):
            placed.append(ring)
    return placed


def _office(rng: np.random.Generator, width: float, depth: float) -> list[FloatArray]:
    """Return rows of like desks, most with a chair."""
    desk, pitch = rng.uniform(1.2, 1.6), rng.uniform(1.9, 2.3)
    rings = []
    for y in np.arange(1.1, depth - 0.8, rng.uniform(1.7, 2.2)):
        for x in np.arange(desk / 2.0 + 0.3, width - desk / 2.0, pitch):
            if rng.random() < 0.15:
                continue
            rings.append(_box(desk, 0.75, x, y))
            if rng.random() < 0.6:
                aside, away = rng.uniform(-0.3, 0.3), rng.uniform(0.68, 0.8)
                rings.append(_box(0.5, 0.5, x + aside, y - away))
    return rings


def _ward(rng: np.random.Generator, width: float, depth: float) -> list[FloatArray]:
    """Return beds with their heads to a wall, and small tables beside some."""
    rings = []
    for x in np.arange(0.7, width - 0.7, rng.uniform(1.8, 2.3)):
        rings.append(_box(0.95, 2.0, x, depth - 1.1))
        if rng.random() < 0.6:
            rings.append(_box(0.4, 0.45, x + 0.8, depth - 0.3))
    return rings


def _meeting_room(rng: np.random.Generator, width: float, depth: float) -> list[FloatArray]:
    """Return a table and chairs around it, not on every place."""
    long, wide = rng.uniform(1.8, 2.8), rng.uniform(1.0, 1.3)
    x, y = np.array([width, depth]) * rng.uniform(0.42, 0.58, 2)
    rings = [_box(long, wide, x, y)]
    for side in (-1.0, 1.0):
        for along in np.arange(-long / 2.0 + 0.4, long / 2.0 - 0.2, 0.75):
            if rng.random() < 0.6:
                aside, away = rng.uniform(-0.1, 0.1), wide / 2.0 + rng.uniform(0.32, 0.6)
                rings.append(_box(0.48, 0.48, x + along + aside, y + side * away))
        if rng.random() < 0.5:
            rings.append(_box(0.48, 0.48, x + side * (long / 2.0 + 0.4), y))
    return rings


def _living_room(rng: np.random.Generator, width: float, depth: float) -> list[FloatArray]:
    """Return a sofa, a low table, armchairs and a round dining table with stools."""
    x, y = rng.uniform(1.6, width - 1.6), depth - 0.6
    corner = outlines.l_shape(1.5, 0.45) * 1.6 + [x, y - 0.3]
    rings = [corner if rng.random() < 0.5 else _box(2.0, 0.85, x, y)]
    rings.append(_box(1.0, 0.6, x + rng.uniform(-0.3, 0.3), y - 1.6))
    for side in (-1.0, 1.0):
        aside = side * rng.uniform(1.3, 1.7)
        rings += [_box(0.8, 0.8, x + aside, y - 1.7)] * (rng.random() < 0.6)
    x, y = rng.uniform(1.2, width - 1.2), rng.uniform(1.1, 1.4)
    rings.append(_round(rng.uniform(1.0, 1.2), x, y))
    for angle in outlines.TURNS * (np.arange(4) + rng.uniform(0.0, 1.0)) / 4.0:
        away = rng.uniform(0.85, 0.95)
        if rng.random() < 0.6:
            rings.append(_round(0.42, x + away * np.cos(angle), y + away * np.sin(angle)))
    return rings


def _along_walls(rng: np.random.Generator, width: float, depth: float) -> list[FloatArray]:
    """Return cupboards and shelves, each somewhere along a wall, and a plant in a corner."""
    rings = []
    for _ in range(int(rng.integers(2, 5))):
        long, deep, along = rng.uniform(0.8, 2.0), rng.uniform(0.35, 0.6), rng.uniform(0.15, 0.85)
        near = deep / 2.0 + 0.05
        rings.append(
            (
                _box(deep, long, near, along * depth),
                _box(deep, long, width - near, along * depth),
                _box(long, deep, along * width, near),
                _box(long, deep, along * width, depth - near),
            )[rng.integers(4)]
        )
    x, y = np.where(rng.random(2) < 0.5, 0.4, np.array([width, depth]) - 0.4)
    rings.append(_round(rng.uniform(0.4, 0.55), x, y))
    return rings


def _box(width: float, height: float, x: float = 0.0, y: float = 0.0) -> FloatArray:
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    ring: FloatArray = corners * [width / 2.0, height / 2.0] + [x, y]
    return ring


def _round(diameter: float, x: float = 0.0, y: float = 0.0) -> FloatArray:
    ring: FloatArray = outlines.ellipse() * (diameter / outlines.WIDTH) + [x, y]
    return ring


def _straightened(ring: FloatArray, shapes: Shapes) -> FloatArray:
    """Return a thing's outline of area 1 along the walls, in one of few proportions."""
    low, high = ring.min(axis=0), ring.max(axis=0)
    width, height = high - low
    kept = shapely.Polygon(ring).area / (width * height)
    aspect = _ASPECTS[np.abs(np.log(_ASPECTS) - abs(np.log(width / height))).argmin()]
    aspect = aspect if width >= height else 1.0 / aspect
    if shapes is Shapes.OUTLINES:
        # Whatever is neither round nor has an arm is a box, and so is remembered.
        if len(ring) > 6:
            return outlines.ellipse(aspect)
        if kept < 0.9:
            return outlines.of_area_one((ring - low) / (width, height) * (aspect, 1.0))
    return outlines.ellipse(aspect) if shapes is Shapes.ELLIPSES else outlines.box(aspect)


def _remembered_sizes(sizes: FloatArray, room: Scene, rng: np.random.Generator) -> FloatArray:
    """Return sizes as small, medium or large, of what there is in the room."""
    known = np.sort([np.log(item.area) / 2.0 for item in room.objects])
    classes = np.array([part.mean() for part in np.array_split(known, _CLASSES)])
    nearest = np.abs(np.log(sizes)[:, None] - classes).argmin(axis=1)
    remembered: FloatArray = np.exp(classes[nearest] + rng.normal(0.0, _HAND, len(sizes)))
    return remembered


def _aligned(centres: FloatArray, unit: float, rng: np.random.Generator) -> FloatArray:
    """Return places drawn towards the lines of a grid, so that things line up."""
    pitch, origin = _GRID * unit, rng.uniform(0.0, 1.0, 2)
    snapped = (np.rint(centres / pitch - origin) + origin) * pitch
    aligned: FloatArray = centres + _SNAPPED * (snapped - centres)
    return aligned


def _shifted(places: FloatArray, unit: float, rng: np.random.Generator) -> FloatArray:
    """Return places with each of up to three groups moved as one."""
    heads = places[rng.permutation(len(places))[:3]]
    group = np.hypot(*(places[:, None] - heads).transpose(2, 0, 1)).argmin(axis=1)
    shifted: FloatArray = places + rng.normal(0.0, _GROUP * unit, heads.shape)[group]
    return shifted


def _warped(places: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return places with distances along each wall stretched here and shrunk there."""
    warped = np.empty_like(places)
    for axis, own in enumerate(places.T):
        knots = np.linspace(own.min(), own.max(), _KNOTS)
        steps = np.diff(knots) * np.exp(rng.normal(0.0, _WARP, _KNOTS - 1))
        warped[:, axis] = np.interp(own, knots, np.concatenate([[0.0], steps.cumsum()]))
    return warped


def _seen_from_one_side(
    places: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return places, and by how much things there are drawn larger: the nearer, the more."""
    axis, side = int(rng.integers(2)), bool(rng.integers(2))
    middle, extent = places.mean(axis=0), np.ptp(places, axis=0).max()
    depth = (places[:, axis] - places[:, axis].min()) / extent
    depth = depth.max() - depth if side else depth
    growth = 1.0 + rng.uniform(0.0, _NEAR) * depth
    seen = places.copy()
    seen[:, 1 - axis] = middle[1 - axis] + (places[:, 1 - axis] - middle[1 - axis]) * growth
    return seen, growth


def _meeting(rings: Sequence[FloatArray]) -> BoolArray:
    """Return which outlines meet another."""
    polygons = [shapely.Polygon(ring) for ring in rings]
    first, second = shapely.STRtree(polygons).query(polygons, predicate="intersects")
    meeting = np.zeros(len(rings), dtype=bool)
    meeting[first[first != second]] = True
    return meeting
