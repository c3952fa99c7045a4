"""Halls where much is alike, and people who recall them by what stands beside what.

One more kind of place and of people to learn from, beside those of
:mod:`tests.experiments.training`: shelves in aisles, tables with seats, seats in arcs, things along
a rim. Who draws them spaces things more evenly than they stand, lets the page drift, moves what is
near each other as one, takes sizes for more alike than they are, and headings for straighter. What
the study measures with is made otherwise, by ``tests.experiments.generators``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely

from sketchmatch.model import FloatArray, Scene
from sketchmatch.testing import spacing

__all__ = ["hall", "recalled"]

_APART = 0.06
_AISLE = 1.3
_RARE = 0.35
_BETTER, _SMALLER = 0.92, 0.97
_CORNERS = 16


def hall(rng: np.random.Generator, objects: int) -> Scene:
    """Return so many things of a hall: those around one of them, in zones side by side."""
    zones = (_aisles, _tables, _arcs, _rim)
    some = [zones[k] for k in rng.permutation(len(zones))[: rng.integers(1, len(zones) + 1)]]
    columns, rare = int(rng.integers(1, 4)), rng.uniform(0.0, _RARE)
    placed: list[FloatArray] = []
    corner, depth, count = np.zeros(2), 0.0, 0
    while len(placed) < objects:
        if count and count % columns == 0:
            corner = np.array([0.0, depth + _AISLE])
        rings = _standing_apart(some[rng.integers(len(some))](rng))
        corners = np.concatenate(rings)
        moved = corner - corners.min(axis=0)
        placed += [ring + moved for ring in rings if rng.random() > rare]
        far = corners.max(axis=0) + moved
        corner = np.array([far[0] + _AISLE, corner[1]])
        depth, count = max(depth, float(far[1])), count + 1
    middles = np.array([ring.mean(axis=0) for ring in placed])
    nearest = np.argsort(np.hypot(*(middles - middles[rng.integers(len(middles))]).T))
    heading = _turning(rng.uniform(0.0, 7.0))
    return Scene.from_polygons([placed[k] @ heading for k in rng.permutation(nearest[:objects])])


def recalled(
    things: Sequence[FloatArray], place: Scene, rng: np.random.Generator
) -> list[FloatArray]:
    """Return things of a place as they are drawn by somebody who recalls them.

    Where drawn things meet, all are drawn again, a little better and smaller.
    """
    unit, care = spacing(place), 1.0
    polygons = [shapely.Polygon(ring) for ring in things]
    centres = np.array([shapely.get_coordinates(each.centroid)[0] for each in polygons])
    bare = [ring - centre for ring, centre in zip(things, centres, strict=True)]
    strength = rng.uniform(0.25, 1.0)
    shape = int(rng.choice(3, p=(0.5, 0.35, 0.15)))
    straight, alike = rng.random() < 0.5, rng.uniform(0.0, 0.8)
    small = 0.95 * math.exp(-abs(rng.normal(0.0, 0.2)))
    page = _turning(rng.uniform(0.0, 7.0)) * math.exp(rng.uniform(-1.0, 1.0))
    while True:
        where = _places(centres, unit, care * strength, rng)
        rings = _outlines(bare, care * strength, shape, straight, alike * care, rng)
        drawn = [small * ring + centre for ring, centre in zip(rings, where, strict=True)]
        if _apart(drawn):
            return [ring @ page for ring in drawn]
        care, small = care * _BETTER, small * _SMALLER


def _places(
    centres: FloatArray, unit: float, strength: float, rng: np.random.Generator
) -> FloatArray:
    """Return where things are recalled."""
    frame = _turning(rng.uniform(0.0, 7.0) if rng.random() < 0.5 else 0.0)
    own = (centres - centres.mean(axis=0)) @ frame
    extent = float(np.abs(own).max()) + 1e-9
    evenly = strength * rng.uniform(0.0, 0.35)
    for axis in (0, 1):
        order = np.argsort(np.argsort(own[:, axis], kind="stable"), kind="stable")
        even = np.quantile(own[:, axis], (0.0, 1.0)) @ np.array(
            [1.0 - order / max(1, len(own) - 1), order / max(1, len(own) - 1)]
        )
        own[:, axis] += evenly * (even - own[:, axis])
    # The page drifts smoothly: neighbours are wrong alike.
    for _ in range(2):
        wave = rng.normal(0.0, 1.6 / extent, 2)
        drift = rng.normal(0.0, 0.3 * unit * strength, 2)
        own = own + np.sin(own @ wave + rng.uniform(0.0, 7.0))[:, None] * drift
    stretch = rng.normal(0.0, 0.12 * strength) * np.array([1.0, -1.0])
    own = own * np.exp(stretch) @ np.array([[1.0, rng.normal(0.0, 0.08 * strength)], [0.0, 1.0]])
    growth = 1.0 + strength * rng.normal(0.0, 0.12, 2) @ (own / extent).T
    own = own * growth[:, None]
    heads = centres[rng.permutation(len(centres))[: rng.integers(1, 5)]]
    group = np.hypot(*(centres[:, None] - heads).transpose(2, 0, 1)).argmin(axis=1)
    own = own + rng.normal(0.0, strength * rng.uniform(0.0, 0.25) * unit, heads.shape)[group]
    apart: FloatArray = own + rng.normal(0.0, strength * rng.uniform(0.02, 0.22) * unit, own.shape)
    return apart @ frame.T


def _outlines(
    rings: Sequence[FloatArray],
    strength: float,
    shape: int,
    straight: bool,
    alike: float,
    rng: np.random.Generator,
) -> list[FloatArray]:
    """Return outlines as they are recalled: themselves, or boxes, or ellipses for all."""
    areas = np.log([shapely.Polygon(ring).area for ring in rings]) / 2.0
    sized = strength * rng.uniform(0.02, 0.25)
    sizes = alike * (areas.mean() - areas) + rng.normal(0.0, sized, len(rings))
    stretched, turned = strength * rng.uniform(0.0, 0.2), strength * rng.uniform(0.0, 0.2)
    found = []
    for ring, size in zip(rings, sizes, strict=True):
        around = shapely.get_coordinates(shapely.minimum_rotated_rectangle(shapely.Polygon(ring)))
        sides = np.diff(around[:3], axis=0)
        outline = ring
        if shape:
            form = _box() if shape == 1 else _round()
            area = shapely.Polygon(ring).area / shapely.Polygon(form @ sides).area
            outline = form @ sides * math.sqrt(area)
        if straight:
            heading = math.atan2(sides[0, 1], sides[0, 0])
            nearest = np.rint(heading / (np.pi / 2.0)) * np.pi / 2.0
            outline = outline @ _turning(heading - nearest)
        outline = outline * np.exp(rng.normal(0.0, stretched, 2))
        found.append(outline @ _turning(rng.normal(0.0, turned)) * math.exp(size))
    return found


def _aisles(rng: np.random.Generator) -> list[FloatArray]:
    """Return rows of like shelves, back to back or not, some of them short, and a counter."""
    long, deep = rng.uniform(0.9, 2.4), rng.uniform(0.4, 0.8)
    gap, between = rng.uniform(0.15, 0.9), rng.uniform(0.6, 1.6)
    shifted = rng.choice((0.0, 0.5)) * (long + gap)
    rings = []
    for row in range(int(rng.integers(2, 5))):
        for column in range(int(rng.integers(2, 5))):
            short = rng.choice((1.0, 0.5), p=(0.8, 0.2))
            centre = column * (long + gap) + (row % 2) * shifted, row * (deep + between)
            rings.append(_box(long * short, deep) + centre + rng.normal(0.0, 0.04, 2))
    rings.append(_l(rng) * rng.uniform(1.2, 2.0) + [-1.8, rng.uniform(0.0, 2.0)])
    return rings


def _tables(rng: np.random.Generator) -> list[FloatArray]:
    """Return tables of a few kinds anyhow, each with some of its seats."""
    kinds = [(rng.random() < 0.5, rng.uniform(0.7, 1.6), rng.uniform(0.7, 1.1)) for _ in range(2)]
    seat, step = rng.uniform(0.3, 0.5), rng.uniform(2.4, 3.4)
    seats = int(rng.integers(1, 5))
    rings = []
    for spot in range(int(rng.integers(2, 6))):
        is_round, long, wide = kinds[rng.integers(2)]
        wide = long if is_round else wide
        heading = _turning(
            rng.integers(4) * np.pi / 4.0 if rng.random() < 0.7 else rng.uniform(0.0, 7.0)
        )
        centre = np.array([spot % 3, spot // 3]) * step + rng.uniform(-0.3, 0.3, 2)
        table = _round(long, wide) if is_round else _box(long, wide)
        rings.append(table @ heading + centre)
        for side in rng.permutation(4)[:seats]:
            angle = side * np.pi / 2.0
            away = 0.5 * (long if side % 2 == 0 else wide) + 0.5 * seat + rng.uniform(0.1, 0.35)
            at = away * np.array([math.cos(angle), math.sin(angle)])
            rings.append((_box(seat, seat) + at) @ heading + centre)
    return rings


def _arcs(rng: np.random.Generator) -> list[FloatArray]:
    """Return seats in arcs around a stage."""
    seat, wide = rng.uniform(0.35, 0.7), rng.uniform(0.9, 1.6)
    rings = [_round(rng.uniform(1.0, 2.4), rng.uniform(0.8, 1.6))]
    for row in range(int(rng.integers(1, 4))):
        radius = 2.0 + row * (seat + rng.uniform(0.4, 0.8))
        for angle in np.arange(-1.2, 1.2, (seat + wide * 0.5) / radius):
            ring = _box(seat, seat * wide) @ _turning(-angle)
            rings.append(ring + radius * np.array([math.cos(angle), math.sin(angle)]))
    return rings


def _rim(rng: np.random.Generator) -> list[FloatArray]:
    """Return cases along four sides, facing inwards, and others of any shape amid them."""
    width, depth = rng.uniform(4.0, 7.0, 2)
    deep = rng.uniform(0.4, 0.7)
    rings = []
    for side, (far, long) in enumerate(((depth, width), (width, depth)) * 2):
        at = -long / 2.0 + rng.uniform(0.4, 1.0)
        while at < long / 2.0 - 0.8:
            extent = rng.uniform(0.5, 1.8)
            away = far / 2.0 - deep / 2.0
            rings.append(
                (_box(extent, deep) + np.array([at + extent / 2.0, away]))
                @ _turning(side * np.pi / 2)
            )
            at += extent + rng.uniform(0.1, 1.0)
    for _ in range(int(rng.integers(1, 5))):
        form = (_l(rng), _round(1.0, rng.uniform(0.6, 1.0)), _box(1.0, rng.uniform(0.4, 1.0)))
        ring = form[rng.integers(3)] * rng.uniform(0.5, 1.4)
        centre = rng.uniform(-0.5, 0.5, 2) * (width - 2.2, depth - 2.2)
        rings.append(ring @ _turning(rng.uniform(0.0, 7.0)) + centre)
    return rings


def _standing_apart(rings: Sequence[FloatArray]) -> list[FloatArray]:
    """Return what stands clear of all before it."""
    kept: list[FloatArray] = []
    outlines: list[shapely.Polygon] = []
    for ring in rings:
        outline = shapely.Polygon(ring)
        if not outlines or shapely.distance(outlines, outline).min() > _APART:
            kept.append(ring)
            outlines.append(outline)
    return kept


def _apart(rings: Sequence[FloatArray]) -> bool:
    outlines = [shapely.Polygon(ring) for ring in rings]
    first, second = shapely.STRtree(outlines).query(outlines, predicate="intersects")
    return bool((first == second).all())


def _box(width: float = 1.0, height: float = 1.0) -> FloatArray:
    return np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]) * (width, height)


def _round(width: float = 1.0, height: float = 1.0) -> FloatArray:
    angles = np.arange(_CORNERS) * (2.0 * np.pi / _CORNERS)
    return 0.5 * np.column_stack([np.cos(angles), np.sin(angles)]) * (width, height)


def _l(rng: np.random.Generator) -> FloatArray:
    a, b = rng.uniform(0.3, 0.6, 2)
    return np.array([[0, 0], [1, 0], [1, a], [b, a], [b, 1], [0, 1]]) - 0.5


def _turning(angle: float) -> FloatArray:
    """Return the matrix by which rows of points are turned clockwise."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])
