"""How fast histograms and relation tables are: by vertices, by plugin, on a real map, by objects.

Run it with ``make bench-histograms``. Figures of one table are measured in the same run; each is
the least of several, as noise only adds. "ns / edge pair" is what two edges that share some line
cost in a direction and its opposite together, all else included; "growth" is the time over that of
the row above.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from sketchmatch.api import Histogram, Similarity
from sketchmatch.model import RelationTable, Scene, SceneDescriptor, object_pairs
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.slices import finish
from sketchmatch.registry import Kind, default_registry
from sketchmatch.testing import random_scene
from tests.tools import ROOT

VERTICES = (8, 20, 50, 100, 200, 400, 800, 1600, 3200)
OBJECTS = (8, 20, 50, 100)
REAL_MAP = ROOT.parent / "shared" / "data" / "ogm" / "nav2-depot" / "depot.yaml"
_DIRECTIONS = 180
_SECONDS = 0.3


def main() -> None:
    """Measure and print."""
    console = Console()
    for name in ("constant", "gravitational"):
        console.print(by_vertices(name, VERTICES))
    console.print(by_plugin(VERTICES[1], _real_scene(REAL_MAP)))
    console.print(by_objects(OBJECTS))


def by_vertices(name: str, vertices: Iterable[int]) -> Table:
    """Return the times of one pair of objects, smooth and jagged, by their numbers of vertices."""
    table = Table(title=f"{name}: one pair, {_DIRECTIONS} directions", title_justify="left")
    table.add_column("vertices each", justify="right")
    for shape in ("regular", "jagged"):
        for column in ("ms", "ns / edge pair", "growth"):
            table.add_column(f"{shape}: {column}", justify="right")
    histogram = _algorithm(Kind.HISTOGRAM, name)
    before: dict[str, float] = {}
    for count in vertices:
        cells = []
        for shape, jagged in (("regular", False), ("jagged", True)):
            scene = _two_outlines(count, jagged)
            seconds = _least(partial(histogram.describe, scene, object_pairs(2)))
            growth = f"{seconds / before[shape]:.2f}" if shape in before else ""
            before[shape] = seconds
            cells += [f"{1e3 * seconds:.3f}", f"{1e9 * seconds / edge_pairs(scene):.1f}", growth]
        table.add_row(str(count), *cells)
    return table


def by_plugin(vertices: int, scene: Scene | None) -> Table:
    """Return the times of every histogram for one pair and for a real map."""
    table = Table(title="all histograms", title_justify="left")
    table.add_column("histogram")
    table.add_column(f"two {vertices}-gons, ms", justify="right")
    if scene is not None:
        corners = len(scene.edges.starts)
        table.add_column(f"real map, {len(scene)} objects, {corners} vertices, ms", justify="right")
    two = _two_outlines(vertices, jagged=False)
    for name in names(Kind.HISTOGRAM):
        # A pixel must be smaller than the smallest object of the real map.
        fine = {"pixels": 1024} if name == "raster" else {}
        histogram = _algorithm(Kind.HISTOGRAM, name, **fine)
        cells = [f"{1e3 * _least(partial(histogram.describe, two, object_pairs(2))):.3f}"]
        if scene is not None:
            cells.append(f"{1e3 * _least(partial(_described, scene, histogram)):.1f}")
        table.add_row(name, *cells)
    if scene is None:
        table.caption = f"{REAL_MAP} is missing; the real map is left out"
    return table


def by_objects(objects: Iterable[int]) -> Table:
    """Return the times of describing a scene and of relating it with another one of its size."""
    measures = names(Kind.SIMILARITY)
    table = Table(title="relation tables of random scenes", title_justify="left")
    table.add_column("objects", justify="right")
    for column in ("describe, ms", *(f"relate, {name}, ms" for name in measures)):
        table.add_column(column, justify="right")
    table.add_column("peak memory of this process, MB", justify="right")
    constant = _algorithm(Kind.HISTOGRAM, "constant")
    for count in objects:
        rng = np.random.default_rng(count)
        scenes = [random_scene(rng, count) for _ in range(2)]
        first, second = (_described(scene, constant) for scene in scenes)
        cells = [f"{1e3 * _least(partial(_described, scenes[0], constant)):.1f}"]
        for name in measures:
            measure = _algorithm(Kind.SIMILARITY, name)
            seconds = _least(partial(_related, first, second, measure))
            cells.append(f"{1e3 * seconds:.1f}")
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        table.add_row(str(count), *cells, f"{peak:.0f}")
    return table


def edge_pairs(scene: Scene) -> int:
    """Count the pairs of edges of two objects that share some line, over half of the directions."""
    starts, ends, offsets = scene.edges
    count = 0
    for k in range(_DIRECTIONS // 2):
        angle = 2.0 * np.pi * k / _DIRECTIONS
        across = np.array([-np.sin(angle), np.cos(angle)])
        ends_of_edges = np.sort([starts @ across, ends @ across], axis=0)
        (low_a, high_a), (low_b, high_b) = (
            ends_of_edges[:, offsets[k] : offsets[k + 1]] for k in range(2)
        )
        # Two intervals share something unless one ends before the other begins.
        after = np.searchsorted(np.sort(high_a), low_b, side="right").sum()
        before = len(low_b) * len(low_a) - np.searchsorted(np.sort(low_a), high_b).sum()
        count += len(low_a) * len(low_b) - int(after) - int(before)
    return count


def _two_outlines(vertices: int, jagged: bool) -> Scene:
    """Return two round objects side by side, or jagged by an edge's length as cells make them."""
    rng = np.random.default_rng(vertices)
    polygons = []
    for x in (0.0, 3.0):
        angles = 2.0 * np.pi * (np.arange(vertices) + rng.uniform()) / vertices
        edge = 2.0 * np.pi / vertices
        radii = 1.0 + (edge * rng.uniform(-0.5, 0.5, vertices) if jagged else 0.0)
        polygons.append(np.stack([x + radii * np.cos(angles), radii * np.sin(angles)], axis=1))
    return Scene.from_polygons(polygons)


def _real_scene(path: Path) -> Scene | None:
    if not path.exists():
        return None
    from sketchmatch.io import read_source

    segmenter = default_registry().find(Kind.SEGMENTER, "occupancy-grid").algorithm
    return segmenter(segmenter.Params(min_size=0.05)).segment(read_source(path)).scene


def _described(scene: Scene, histogram: Histogram) -> SceneDescriptor:
    return finish(describe(scene, histogram))


def _related(first: SceneDescriptor, second: SceneDescriptor, measure: Similarity) -> RelationTable:
    return finish(relate(first, second, measure))


def names(kind: Kind) -> list[str]:
    """Return the names of all algorithms of a kind."""
    return [item.name for item in default_registry().of_kind(kind)]


def _algorithm(kind: Kind, name: str, **params: Any) -> Any:
    algorithm = default_registry().find(kind, name).algorithm
    return algorithm(algorithm.Params(**params))


def _least(work: Callable[[], object]) -> float:
    """Return the least seconds of several runs, after one that does not count."""
    work()
    least, spent = np.inf, 0.0
    while spent < _SECONDS:
        started = time.perf_counter()
        work()
        seconds = time.perf_counter() - started
        least, spent = min(least, seconds), spent + seconds
    return float(least)


if __name__ == "__main__":
    main()
