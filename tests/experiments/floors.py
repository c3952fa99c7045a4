"""Floors of rooms, and people who draw them: one more kind to learn from.

Where things stand apart, rooms fill a floor, lie side by side, and differ in size by far more; and
who draws a floor gets the order of its rooms right, but makes a hall as narrow as a corridor. So a
floor is divided again and again, some neighbours are one room, and some parts lie outside. A sketch
draws each stretch along both axes too long or too short, which keeps rooms apart, then waves, and
each outline by itself. What is drawn and not on the map is one of the parts outside.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
import shapely
import shapely.affinity

from sketchmatch.model import FloatArray, IntArray, Scene
from tests.experiments.drawings import Drawing

__all__ = ["floor_drawing"]

_ROOMS = (4, 5, 6, 6, 7, 8, 8, 10, 12, 16, 20, 28, 36)
_MOST_DRAWN = 12
_ALL = 0.5
_FORGOTTEN = (0.5, 0.3, 0.2)
_EXTRAS = (0.6, 0.3, 0.1)
_ELSEWHERE = 0.35
_NARROWEST = 0.08
_BETTER = 0.9

_Floor: TypeAlias = tuple[list[shapely.Polygon], list[shapely.Polygon]]
"""Rooms, and parts outside."""


def floor_drawing(number: int) -> Drawing:
    """Return a sketch, a map, and the truth; −1 for all where the sketch is of another floor."""
    rng = np.random.default_rng((244949, number))
    style = rng.uniform(0.0, 1.0, 4)
    count = int(rng.choice(_ROOMS))
    floor = _floor(count, style, rng)
    elsewhere = rng.random() < _ELSEWHERE
    there = max(4, round(count * rng.uniform(0.7, 1.4)))
    rooms, outside = _floor(there, style, rng) if elsewhere else floor
    kept = _kept(rooms, rng)
    extra = min(len(outside), int(rng.choice(3, p=_EXTRAS)) if len(kept) > 3 else 0)
    added = rng.permutation(len(outside))[:extra]
    truth = np.array([*kept, *[-1] * extra])
    order = rng.permutation(len(truth))
    every = [*(rooms[k] for k in kept), *(outside[k] for k in added)]
    sketch = _drawn([every[k] for k in order], rng)
    map_ = [_walled(each, 0.02) for each in floor[0]]
    return Drawing(
        Scene.from_polygons(sketch),
        Scene.from_polygons(map_),
        np.full(len(order), -1) if elsewhere else truth[order],
    )


def _floor(count: int, style: FloatArray, rng: np.random.Generator) -> _Floor:
    """Return so many rooms of one size in the mean."""
    uneven, halls, merged, outer = style
    side = math.sqrt(count)
    joins = int(rng.binomial(count, 0.3 * merged))
    away = int(rng.binomial(count, 0.1 + 0.3 * outer))
    width = side * rng.uniform(0.8, 1.25)
    cells = [(0.0, 0.0, width, side)]
    while len(cells) < count + joins + away:
        areas = np.array([(right - left) * (high - low) for left, low, right, high in cells])
        likely = areas ** (0.7 + 1.3 * (1.0 - uneven))
        left, low, right, high = cells.pop(int(rng.choice(len(cells), p=likely / likely.sum())))
        across = (right - left) * math.exp(rng.normal(0.0, 0.5)) > high - low
        share = rng.uniform(0.15 + 0.2 * (1.0 - uneven), 0.5)
        if rng.random() < 0.4 * halls:  # a corridor
            share = min(max(0.3 / (right - left if across else high - low), 0.12), 0.4)
        share = rng.choice((share, 1.0 - share))
        x, y = left + share * (right - left), low + share * (high - low)
        cells += (
            [(left, low, x, high), (x, low, right, high)]
            if across
            else [(left, low, right, y), (left, y, right, high)]
        )
    parts = [shapely.box(*cell) for cell in cells]
    for _ in range(joins):
        a = parts.pop(int(rng.integers(len(parts))))
        shared = shapely.length(shapely.intersection(parts, a))
        both = shapely.union(a, parts[int(shared.argmax())])
        if both.geom_type == "Polygon" and not both.interiors:
            parts[int(shared.argmax())] = both
        else:
            parts.append(a)
    # What lies outside is at the rim, from which walls are seen.
    rim = shapely.length(shapely.intersection(parts, shapely.box(0.0, 0.0, width, side).exterior))
    order = np.argsort(np.where(rim > 0.0, rng.random(len(parts)), 1.0), kind="stable")
    away = min(away, len(parts) - 4)
    return [parts[k] for k in order[away:]], [parts[k] for k in order[:away] if rim[k] > 0.0]


def _kept(rooms: list[shapely.Polygon], rng: np.random.Generator) -> IntArray:
    """Return which rooms are drawn: those around one, less a few."""
    forgotten = int(rng.choice(3, p=_FORGOTTEN))
    count = len(rooms) if rng.random() < _ALL else int(rng.integers(4, _MOST_DRAWN + 1))
    count = min(count, len(rooms), 2 * _MOST_DRAWN)
    centres = shapely.get_coordinates(shapely.centroid(rooms))
    areas = shapely.area(rooms)
    near = np.argsort(np.hypot(*(centres - centres[rng.integers(len(rooms))]).T))[:count]
    # Small rooms are forgotten first.
    first = np.argsort(np.log(areas[near]) + rng.normal(0.0, 1.0, count))
    return rng.permutation(near[first[min(forgotten, max(0, count - 3)) :]])


def _drawn(rooms: list[shapely.Polygon], rng: np.random.Generator) -> list[shapely.Polygon]:
    low, high = np.array(shapely.union_all(rooms).bounds).reshape(2, 2)
    rooms = [shapely.affinity.translate(each, *-low) for each in rooms]
    extent = high - low
    strength = rng.uniform(0.15, 1.0)
    every = np.concatenate([shapely.get_coordinates(each) for each in rooms])
    along = [_stretched(every[:, k], 0.6 * strength, rng) for k in (0, 1)]
    wave, phase = rng.normal(0.0, 0.6, (2, 2)) / extent, rng.uniform(0.0, 7.0, 2)
    bend = strength * rng.uniform(0.0, 0.03) * float(extent.max())
    trembling, thick = strength * rng.uniform(0.0, 0.06), rng.uniform(0.02, 0.15)
    sized, moved = strength * rng.uniform(0.0, 0.15), strength * rng.uniform(0.0, 0.1)
    page = rng.uniform(0.0, 360.0) if rng.random() < 0.6 else 90.0 * rng.integers(4)

    def bent(points: FloatArray) -> FloatArray:
        laid = np.column_stack([np.interp(points[:, k], *along[k]) for k in (0, 1)])
        return laid + bend * np.sin(2.0 * np.pi * laid @ wave.T + phase)

    units = [math.sqrt(room.area) for room in rooms]
    outlines = [
        bent(shapely.get_coordinates(shapely.segmentize(_walled(room, thick), 0.3 * unit)))[:-1]
        for room, unit in zip(rooms, units, strict=True)
    ]
    care = 1.0
    while True:
        found = []
        for outline, unit in zip(outlines, units, strict=True):
            middle = outline.mean(axis=0)
            corners = outline + care * trembling * unit * rng.normal(0.0, 1.0, outline.shape)
            scale = np.exp(care * sized * rng.normal(0.0, 1.0, 2))
            shift = care * moved * unit * rng.normal(0.0, 1.0, 2)
            found.append(shapely.Polygon((corners - middle) * scale + middle + shift))
        first, second = shapely.STRtree(found).query(found, predicate="intersects")
        if (first == second).all() and all(each.is_valid for each in found):
            return [shapely.affinity.rotate(each, page, origin=(0.0, 0.0)) for each in found]
        care *= _BETTER


def _stretched(
    values: FloatArray, strength: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return where lines are, and where they are drawn: each stretch too long or too short."""
    lines = np.unique(values.round(6))
    gaps = np.diff(lines)
    away = strength * rng.normal(0.0, 1.0, len(gaps)) * rng.uniform(0.3, 1.0)
    # People draw what is long too short, and what is short too long.
    away -= strength * rng.uniform(0.0, 0.5) * np.log(gaps / np.median(gaps))
    drawn = np.maximum(gaps * np.exp(away), _NARROWEST * gaps.mean())
    return lines, np.concatenate([[0.0], np.cumsum(drawn)])


def _walled(room: shapely.Polygon, thick: float) -> shapely.Polygon:
    """Return a room within its walls, or as much thinner ones as leave it whole."""
    while True:
        inner = room.buffer(-thick, join_style="mitre")
        if inner.geom_type == "Polygon" and inner.area > 0.3 * room.area:
            return inner
        thick *= 0.7
