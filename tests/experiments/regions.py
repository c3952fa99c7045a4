"""Regions that people drew of one building from memory, matched with its plan.

``python -m tests.experiments.regions`` prints, for each drawing of ``rooms-rsi``, for both halves
of them and for the maps of ``robot-maps-hih``, what annotators say of the answer:

- of the regions, of sketch and plan, whose partners they agree on, how many have such a partner;
- of the groups that are answered, one region of the sketch and one of the plan or several where
  several are one on the other side, how many are right by each of them;
- of the sets of regions that each says belong together, how many are found, by a group each, so
  that one group of all finds one.

An annotator marks a region by points: a region holds those that lie in it, or within two pixels of
it. A group is right where a set has points on both sides of it, and judged where one has on either.
Nothing is tuned on the second half.

Then, of sketches of whole floors of ``floors-ipa``, bent and with each room's size and place drawn
wrong, how many groups are told, and how many of them are right: where two rooms are drawn as one,
and where two, or half of all, are left out, which are no part of any other.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np
import shapely
import shapely.affinity
from scipy.optimize import linear_sum_assignment

import sketchmatch
from sketchmatch.io import read_source
from sketchmatch.model import BoolArray, FloatArray, Image, Scene
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.events import Finished
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch.pipeline.result import MatchResult
from sketchmatch.registry import default_registry
from sketchmatch_builtin.segmenters.rooms import RoomSegmenter
from tests.tools import ROOT

__all__ = ["HALVES", "ROBOT_MAPS", "RSI", "Held", "Tally", "annotated", "answered", "tally"]

RSI = ROOT.parent / "shared" / "data" / "sketches" / "rooms-rsi"

HALVES = {
    "tuned on": ("00", "02", "04", "06", "08", "10"),
    "held out": ("01", "03", "05", "07", "09", "11"),
}
ROBOT_MAPS = ("01", "02")
FLOORS = RSI.parents[1] / "floors-ipa"
SMALL_FLOORS = ("Freiburg101_scan", "Freiburg52_scan", "lab_c_scan")
SKETCHES = 20
"""Of each floor."""
_NEAR = 2.0

Group: TypeAlias = tuple[Sequence[int], Sequence[int]]
"""Regions of the sketch, and of the plan, by index."""

Points: TypeAlias = list[tuple[float, float]]
"""(x, y) in pixels from the top left."""

Held: TypeAlias = tuple[BoolArray, BoolArray]
"""Which regions of the sketch, and of the plan, have a point of which set: (regions, sets)."""


@dataclass(frozen=True)
class Tally:
    """What annotators say of an answer.

    Attributes
    ----------
    agreed, matched
        Regions whose partners all annotators agree on, and those of them that have one.
    judged, right
        Groups of the answer that an annotator says something of, and those that are right.
    sets, found
        Sets of regions that belong together, and those that the answer has.
    """

    agreed: int = 0
    matched: int = 0
    judged: int = 0
    right: int = 0
    sets: int = 0
    found: int = 0

    def __add__(self, other: Tally) -> Tally:
        return Tally(
            *(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True))
        )

    def __str__(self) -> str:
        return (
            f"{self.matched:2} of {self.agreed:2} regions, "
            f"{self.right:2} of {self.judged:2} groups, {self.found:2} of {self.sets:2} sets"
        )


def annotated(path: Path) -> list[tuple[Points, Points]]:
    """Read the sets of an annotator that have points of the sketch and of the plan."""
    found: list[tuple[Points, Points]] = []
    side = 0
    for line in path.read_text(encoding="ascii").splitlines():
        words = line.split()
        if line.startswith("#"):
            if "match" in line:
                found.append(([], []))
            side = 0 if "map1" in line else 1
        elif words:
            row, column = map(float, words)
            found[-1][side].append((column, row))
    return [both for both in found if all(both)]


def groups_of(result: MatchResult) -> list[Group]:
    """Return the lines of a result, or the groups that they are part of."""
    groups: list[Group] = [(each.sketch_objects, each.map_objects) for each in result.groups]
    return groups + [
        ([a], [b])
        for a, b in result.object_map.items()
        if not any(a in drawn and b in mapped for drawn, mapped in groups)
    ]


def tally(groups: Iterable[Group], annotators: Sequence[Held]) -> Tally:
    """Count what is right of groups of regions, by each annotator and by all."""
    groups = [(list(drawn), list(mapped)) for drawn, mapped in groups]
    counted = Tally(*_agreed(groups, annotators))
    for here, there in annotators:
        held = [(here[a].any(axis=0), there[b].any(axis=0)) for a, b in groups]
        both = np.array([a & b for a, b in held], dtype=bool).reshape(len(held), here.shape[1])
        rows, columns = linear_sum_assignment(both, maximize=True)
        counted += Tally(
            judged=sum(bool((a | b).any()) for a, b in held),
            right=int(both.any(axis=1).sum()),
            sets=here.shape[1],
            found=int(both[rows, columns].sum()),
        )
    return counted


def _agreed(groups: Sequence[Group], annotators: Sequence[Held]) -> tuple[int, int]:
    """Return how many regions have partners that all agree on, and how many of them have one."""
    partners = [(here[:, None] & there[None]).any(axis=2) for here, there in annotators]
    agreed = np.logical_and.reduce(partners)
    answer = np.zeros_like(agreed)
    for drawn, mapped in groups:
        answer[np.ix_(drawn, mapped)] = True
    # Of several partners, all annotators must have one, but not the same one.
    right = [each & answer for each in partners]
    matched = [np.logical_and.reduce([each.any(axis=side) for each in right]) for side in (1, 0)]
    counts = [
        (int(known.sum()), int((known & found).sum()))
        for known, found in zip((agreed.any(axis=1), agreed.any(axis=0)), matched, strict=True)
    ]
    return counts[0][0] + counts[1][0], counts[0][1] + counts[1][1]


def answered(sketch: Path, plan: Path, truths: Sequence[Path]) -> Tally:
    """Match a drawing with a plan, and count by what annotators say."""
    sources = [read_source(sketch), read_source(plan)]
    result = sketchmatch.match(*sources, sketch_segmenter="rooms", map_segmenter="rooms")
    heights = [len(each.pixels) for each in sources if isinstance(each, Image)]
    held: list[Held] = []
    for path in truths:
        drawn, mapped = zip(*annotated(path), strict=True)
        held.append(
            (
                _points_held(result.sketch, drawn, heights[0]),
                _points_held(result.map, mapped, heights[1]),
            )
        )
    return tally(groups_of(result), held)


def _points_held(scene: Scene, sets: Sequence[Points], height: int) -> BoolArray:
    regions = [item.polygon.buffer(_NEAR) for item in scene.objects]
    return np.array(
        [
            [any(region.contains(shapely.Point(x, height - y)) for x, y in of) for of in sets]
            for region in regions
        ]
    )


def drawing(name: str) -> Tally:
    """Return what two annotators say of a drawing from memory, matched with the plan."""
    truths = [
        RSI / "truth" / f"annotator-{annotator}" / f"gt_{name}_model_simple.dat"
        for annotator in (1, 2)
    ]
    return answered(RSI / "sketches" / f"{name}.png", RSI / "model_simple.png", truths)


def robot_map(name: str) -> Tally:
    """Return what the annotator says of a robot's map, matched with the plan of its flat."""
    folder = RSI / "robot-maps-hih"
    return answered(
        folder / f"HIH_{name}.png", folder / "layout.png", [folder / f"truth_{name}.dat"]
    )


def floors(
    name: str, kind: Literal["one", "two", "half"], rng: np.random.Generator
) -> tuple[int, int, int]:
    """Match a sketch of a floor that draws two rooms as one, or leaves two or half of all out.

    Returns
    -------
    int, int, int
        How many groups there are, are told, and are right.
    """
    grid = read_source(FLOORS / f"{name}.png")
    found = RoomSegmenter().segment(grid)
    rooms = [item.polygon for item in found.scene.objects]
    pair = tuple(found.passages[rng.integers(len(found.passages))])
    if kind != "one":
        count = 2 if kind == "two" else len(rooms) // 2
        pair = tuple(rng.choice(len(rooms), count, replace=False).tolist())
    drawn = [room for k, room in enumerate(rooms) if k not in pair]
    if kind == "one":
        drawn.append(_joined(*(rooms[k] for k in pair)))
    sketch = Scene.from_polygons(_misdrawn(drawn, max(np.ptp(found.scene.bounds[::2]), 1.0), rng))
    (told,) = (
        event.result.groups
        for event in Engine(default_registry()).match(MatchRequest(sketch, found))
        if isinstance(event, Finished)
    )
    truth = ((len(drawn) - 1,), tuple(sorted(pair)))
    right = sum((each.sketch_objects, each.map_objects) == truth for each in told)
    return int(kind == "one"), len(told), right if kind == "one" else 0


def _joined(a: shapely.Polygon, b: shapely.Polygon) -> shapely.Polygon:
    reach = a.distance(b)
    parts = shapely.get_parts(shapely.union(a.buffer(reach), b.buffer(reach)).buffer(-reach))
    return max(parts, key=lambda part: part.area)


def _misdrawn(
    rooms: list[shapely.Polygon], extent: float, rng: np.random.Generator
) -> list[shapely.Polygon]:
    """Return rooms bent together by a twentieth of the floor, and each drawn wrong by itself."""
    waves, phases = 0.5 * rng.normal(size=(2, 2)) / extent, 3.0 * rng.normal(size=2)
    turn = rng.uniform(0.0, 360.0)

    def bent(points: FloatArray) -> FloatArray:
        away = np.sin(2.0 * np.pi * points @ waves.T + phases)
        return np.asarray(points + 0.025 * extent * away)

    drawn = []
    for room in rooms:
        parts = shapely.get_parts(shapely.transform(room, bent).buffer(0.0).simplify(extent / 500))
        size = np.exp(0.15 * rng.normal())
        shape = shapely.affinity.scale(
            max(parts, key=lambda part: part.area), size, size * np.exp(0.1 * rng.normal())
        )
        moved = shapely.affinity.translate(shape, *(0.01 * extent * rng.normal(size=2)))
        drawn.append(shapely.affinity.rotate(moved, turn, origin=(0.0, 0.0)))
    return drawn


def main() -> None:
    """Print the tables."""
    for half, names in HALVES.items():
        total = Tally()
        for name in names:
            counted = drawing(name)
            total += counted
            print(f"{name:>10}: {counted}", flush=True)
        print(f"{half:>10}: {total}")
    for name in ROBOT_MAPS:
        print(f"{'HIH_' + name:>10}: {robot_map(name)}")
    kinds: dict[Literal["one", "two", "half"], str] = {
        "one": "draw two rooms as one",
        "two": "leave two out",
        "half": "leave half of all out",
    }
    for kind, what in kinds.items():
        rng = np.random.default_rng(18)
        there, told, right = np.sum(
            [floors(name, kind, rng) for name in SMALL_FLOORS for _ in range(SKETCHES)], axis=0
        )
        sketches = f"of {SKETCHES * len(SMALL_FLOORS)} sketches"
        print(f"{sketches} that {what}: {told} groups told, {right} right, {there} there are")


if __name__ == "__main__":
    main()
