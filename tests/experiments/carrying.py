"""What is carried, measured: ways that people draw, and zones of old maps on new ones.

``python -m tests.experiments.carrying --sketches 100 --maps 20`` prints a table (of others than
those so far where ``--first 1000`` says with which number to begin) of

- ways through rooms, drawn by the study's people, by those of both generators, and by the study's
  where they stretch a room and draw one side of it larger than the other, carried through
  the objects that are the same (the truth, so that no mistake of a match counts): the share of
  things that they pass on the same side as the true way, and of those that it passes closely; how
  much of that a similarity would do, too; how far they are from the true way in units of a
  thing's size, how often they go through a thing, and how often the truth lies within one and
  within two standard deviations of a carried point, along each axis;
- zones on old maps, carried to new scans of the same places, which begin elsewhere, are turned, and
  show a tenth of the things elsewhere; found by a match of the maps: how much the carried and the
  true zone share, as a part of both together.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import shapely
import shapely.affinity

import sketchmatch
from sketchmatch.model import FloatArray, IntArray, OccupancyGrid, Scene
from sketchmatch.pipeline.slices import finish
from sketchmatch.testing import World, plan_tour, random_scene, spacing, survey
from sketchmatch.transfers.carrying import carried, course_between
from sketchmatch.transfers.features import Feature, FeatureKind
from sketchmatch.transfers.obstacles import Obstacles
from tests.experiments.generators import KINDS, sample
from tests.experiments.people import Person, remembered
from tests.experiments.scenes import PLACES, place_named
from tests.experiments.study import STRENGTH
from tests.experiments.ways import drawn_way, swept, true_way

__all__ = ["PEOPLE", "WayCase", "Ways", "carried_ways", "carried_zones", "way_case"]

PEOPLE = ("study", *KINDS, "uneven")
"""Who draws; the last are the study's who draw one side of a room larger than the other."""

_PASSING = math.pi / 4.0
_RADIUS = 0.04
_CLOSE = 0.5
"""Of a thing's size: nearer than this to its outline a way passes it close by."""
_MOVED = 0.1
_STRETCH, _GROWTH = 1.5, 0.5
"""How much longer than wide a room is drawn, and by what share its sides are drawn larger or
smaller than its middle."""


@dataclass(frozen=True, eq=False)
class WayCase:
    """A way, the drawing of it, and the truth: the map's index of each sketched thing."""

    map: Scene
    sketch: Scene
    truth: IntArray
    way: FloatArray
    drawn: FloatArray


@dataclass
class Ways:
    """What was found of ways."""

    ways: int = 0
    passings: int = 0
    same_side: int = 0
    through: int = 0
    close: int = 0
    close_same_side: int = 0
    stiff_same_side: int = 0
    stiff_close_same_side: int = 0
    stiff_through: int = 0
    stiff_away: list[float] = field(default_factory=list)
    undrawable: int = 0
    away: list[float] = field(default_factory=list)
    standardised: list[FloatArray] = field(default_factory=list)

    def row(self, name: str) -> str:
        """Return what was found in a line."""
        misses = np.concatenate(self.standardised)
        within = [float((misses < k).mean()) for k in (1.0, 2.0)]
        return (
            f"{name:8} {self.ways:5} ways {self.passings:5} passings, same side "
            f"{self.same_side / self.passings:.4f}, of {self.close} close ones "
            f"{self.close_same_side / self.close:.4f}, through {self.through}, median away "
            f"{np.median(self.away):.3f} sizes, within 1 σ {within[0]:.2f}, 2 σ {within[1]:.2f}; "
            f"by a similarity alone {self.stiff_same_side / self.passings:.4f}, of close ones "
            f"{self.stiff_close_same_side / self.close:.4f}, through "
            f"{self.stiff_through}, median away {np.median(self.stiff_away):.3f}; "
            f"{self.undrawable} could not be drawn"
        )


def way_case(people: str, number: int) -> WayCase | None:
    """Return a way and its drawing; the same for the same number, None if nobody could draw it."""
    rng = np.random.default_rng([1611, PEOPLE.index(people), number])
    if people in ("study", "uneven"):
        place = (PLACES["A"].furniture, PLACES["B"].furniture, None)[number % 3]
        room = random_scene(rng, int(rng.integers(6, 14))) if place is None else place
        names = [str(k) for k in range(len(room))]
        map_ = Scene.from_polygons([item.rings[0] for item in room.objects], names)
        sketch = remembered(map_, Person(STRENGTH), rng)
        truth = np.array([int(label) for label in sketch.labels])
        if people == "uneven":
            sketch = _uneven(sketch, rng)
    else:
        found = sample(people, number, objects=20, drawn=12)
        sketch = found.scene
        map_ = Scene(tuple(found.map.objects[k] for k in found.truth))
        truth = np.arange(len(map_))
    way = true_way(map_, rng)
    drawn = drawn_way(way, map_, sketch, truth, rng)
    return None if drawn is None else WayCase(map_, sketch, truth, way, drawn)


def _uneven(sketch: Scene, rng: np.random.Generator) -> Scene:
    """Return a sketch stretched in some direction, along which it also grows."""
    axis = np.exp(1j * rng.uniform(-np.pi, np.pi))
    corners = np.vstack([ring for item in sketch.objects for ring in item.rings]) @ [1.0, 1j]
    middle = corners.mean() / axis
    half = float(np.abs((corners / axis - middle).real).max())

    def drawn(ring: FloatArray) -> FloatArray:
        place = ring @ [1.0, 1j] / axis - middle
        along = place.real / half
        # The scale is 1 + growth·along: its integral goes along, itself across.
        there = _STRETCH * half * (along + 0.5 * _GROWTH * along**2)
        moved = axis * (there + 1j * place.imag * (1.0 + _GROWTH * along))
        return np.stack([moved.real, moved.imag], axis=1)

    rings = [[drawn(ring) for ring in item.rings] for item in sketch.objects]
    return Scene.from_polygons(rings, sketch.labels)


def carried_ways(people: str, numbers: range) -> Ways:
    """Carry ways, and measure what comes of them."""
    found = Ways()
    for number in numbers:
        case = way_case(people, number)
        if case is None:
            found.undrawable += 1
            continue
        _measure(case, found)
    return found


def _measure(case: WayCase, found: Ways) -> None:
    feature = Feature(FeatureKind.ROUTE, (case.drawn,))
    pairs = [(k, int(partner)) for k, partner in enumerate(case.truth)]
    course = course_between(case.sketch, case.map, pairs, features=[feature])
    radius = _RADIUS * spacing(case.map)
    obstacles = Obstacles.of_scene(case.map, course.warp(case.drawn), radius)
    (answer,) = finish(carried([feature], course, obstacles, radius))
    assert answer.feature is not None
    points = answer.feature.points
    size = float(np.median([math.sqrt(item.area) for item in case.map.objects]))
    whole = np.arange(len(case.way))
    true = np.stack([np.interp(answer.sources[0], whole, axis) for axis in case.way.T], axis=1)
    found.ways += 1
    found.away.append(float(np.median(np.hypot(*(points - true).T))) / size)
    warped, deviations = course.warp(case.drawn), course.warp.deviations(case.drawn)
    found.standardised.append((np.abs(warped - case.way) / deviations[:, None]).ravel())
    stiff = _by_similarity(case)
    found.stiff_away.append(float(np.median(np.hypot(*(stiff - case.way).T))) / size)
    found.through += _goes_through(points, case.map)
    found.stiff_through += _goes_through(stiff, case.map)
    true_line = shapely.LineString(case.way)
    for item in case.map.objects:
        centre = np.array(item.centroid)
        turn = swept(case.way, centre)
        if abs(turn) <= _PASSING:
            continue
        close = item.polygon.distance(true_line) < _CLOSE * math.sqrt(item.area)
        same = abs(swept(points, centre) - turn) < math.pi
        found.passings += 1
        found.same_side += same
        found.close += close
        found.close_same_side += close and same
        stiff_same = abs(swept(stiff, centre) - turn) < math.pi
        found.stiff_same_side += stiff_same
        found.stiff_close_same_side += close and stiff_same


def _by_similarity(case: WayCase) -> FloatArray:
    """Return the drawn way as turned, scaled and shifted alone, by least squares."""
    drawn = np.array([item.centroid for item in case.sketch.objects]) @ [1.0, 1j]
    places = np.array([case.map.objects[k].centroid for k in case.truth]) @ [1.0, 1j]
    turn, shift = np.linalg.lstsq(
        np.stack([drawn, np.ones_like(drawn)], axis=1), places, rcond=None
    )[0]
    carried_ = turn * (case.drawn @ [1.0, 1j]) + shift
    return np.stack([carried_.real, carried_.imag], axis=1)


def _goes_through(points: FloatArray, scene: Scene) -> bool:
    line = shapely.LineString(points)
    return any(item.polygon.intersects(line) for item in scene.objects)


def carried_zones(numbers: range, zones: int = 6) -> Iterator[list[float]]:
    """Carry zones of old maps to new ones; yield what carried and true ones share, map by map."""
    for number in numbers:
        yield _shared(number, zones)


def _shared(number: int, zones: int) -> list[float]:
    rng = np.random.default_rng([1613, number])
    name = ("A", "B", "14", "18")[number % 4]
    place = place_named(name)
    old = _scanned(place.world, rng)
    turn, shift = rng.uniform(-np.pi, np.pi), rng.uniform(-20.0, 20.0, 2)
    c, s = math.cos(turn), math.sin(turn)
    matrix = np.array([[c, s], [-s, c]])
    furniture = _rearranged(place.furniture, place.room, rng)
    moved = World(
        (np.vstack([place.room, place.room[:1]]) @ matrix + shift,),
        Scene.from_polygons([item.rings[0] @ matrix + shift for item in furniture.objects]).objects,
    )
    new = _scanned(moved, rng)
    given = [_zone(place.room, rng) for _ in range(zones)]
    features = [Feature(FeatureKind.ZONE, (ring,)) for ring in given]
    answer = sketchmatch.carry(features, old, new)
    shares = []
    for ring, each in zip(given, answer.carried, strict=True):
        assert each.feature is not None
        true, there = shapely.Polygon(ring @ matrix + shift), shapely.Polygon(each.feature.points)
        shares.append(float(true.intersection(there).area / true.union(there).area))
    return shares


def _scanned(world: World, rng: np.random.Generator) -> OccupancyGrid:
    return survey(world, rng, poses=plan_tour(world, rng, stops=16, spacing=0.2)).grid


def _rearranged(furniture: Scene, room: FloatArray, rng: np.random.Generator) -> Scene:
    """Return furniture of which a tenth stands elsewhere, clear of all else."""
    outlines = [item.polygon for item in furniture.objects]
    floor = shapely.Polygon(room).buffer(-0.4)
    for k in rng.permutation(len(outlines))[: max(1, round(_MOVED * len(outlines)))]:
        others = shapely.union_all([each for j, each in enumerate(outlines) if j != k])
        low, high = room.min(axis=0), room.max(axis=0)
        for _ in range(500):
            x, y = rng.uniform(low, high) - shapely.get_coordinates(outlines[k].centroid)[0]
            there = shapely.affinity.translate(outlines[k], x, y)
            if floor.contains(there) and there.distance(others) > 0.4:
                outlines[k] = there
                break
    return Scene.from_polygons([shapely.get_coordinates(each.exterior) for each in outlines])


def _zone(room: FloatArray, rng: np.random.Generator) -> FloatArray:
    sides = rng.uniform(1.0, 3.0, 2)
    angle = rng.uniform(0.0, np.pi)
    c, s = math.cos(angle), math.sin(angle)
    box = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]) * sides
    place = rng.uniform(room.min(axis=0) + 1.0, room.max(axis=0) - 1.0)
    ring: FloatArray = box @ np.array([[c, s], [-s, c]]) + place
    return ring


def main() -> None:
    """Measure, and print what was found."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--sketches", type=int, default=100)
    parser.add_argument("--maps", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="number of the first of each")
    given = parser.parse_args()
    ways, maps = (range(given.first, given.first + count) for count in (given.sketches, given.maps))
    for people in PEOPLE if ways else ():
        print(carried_ways(people, ways).row(people), flush=True)
    shares: list[float] = []
    for number, found in zip(maps, carried_zones(maps), strict=True):
        shares += found
        print(f"map {number}: median {np.median(found):.3f}, least {min(found):.3f}", flush=True)
    if shares:
        share = float(np.mean(np.array(shares) >= 0.9))
        print(
            f"zones    {len(shares):5} zones, median shared {np.median(shares):.3f}, at least .9 "
            f"in {share:.3f}"
        )


if __name__ == "__main__":
    main()
