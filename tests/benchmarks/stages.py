"""Where the time of an 8-object match goes: the bundled living room, stage by stage.

Run it with ``make bench``. Every row is measured in the same run, as median, minimum and maximum;
shares are of the sum of the medians.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from statistics import median
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from sketchmatch.api import MatchProblem
from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH
from sketchmatch.io import read_source
from sketchmatch.model import OccupancyGrid
from sketchmatch.pipeline.correspond import object_map, occm
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.selection import resolve
from sketchmatch.pipeline.slices import finish
from sketchmatch.pipeline.warmup import warm_up
from sketchmatch.registry import default_registry

_REPEATS = 15
_PROCESS_REPEATS = 5


def main() -> None:
    """Measure and print."""
    warm_up(default_registry())
    console = Console()
    console.print(_table("one match in a warm process", _stages()))
    console.print(_table("what a new process adds, kernels in the cache", _start_up()))
    console.print(_table("objects of large maps", _large_maps(), parts=False))


def _stages() -> list[tuple[str, list[float]]]:
    sketch, map_ = read_source(LIVING_ROOM_SKETCH), read_source(LIVING_ROOM_MAP)
    pipeline = resolve(default_registry(), {}, sketch, map_)
    assert pipeline.sketch_segmenter is not None
    assert pipeline.map_segmenter is not None
    sketch_scene = pipeline.sketch_segmenter.segment(sketch).scene
    map_scene = pipeline.map_segmenter.segment(map_).scene
    template = finish(describe(sketch_scene, pipeline.histogram))
    argument = finish(describe(map_scene, pipeline.histogram))
    table = finish(relate(template, argument, pipeline.similarity))

    def search() -> Any:
        rng = np.random.default_rng(0)
        return list(pipeline.searcher.search(MatchProblem(table), rng))[-1]

    fmap = search().fmap
    objects = f"{len(sketch_scene)} and {len(map_scene)} objects"
    return [
        ("read sketch (svg)", _times(partial(read_source, LIVING_ROOM_SKETCH))),
        ("read map (yaml, pgm)", _times(partial(read_source, LIVING_ROOM_MAP))),
        ("segment sketch", _times(partial(pipeline.sketch_segmenter.segment, sketch))),
        ("segment map", _times(partial(pipeline.map_segmenter.segment, map_))),
        (
            f"describe, {objects}",
            _times(
                lambda: [
                    finish(describe(scene, pipeline.histogram))
                    for scene in (sketch_scene, map_scene)
                ]
            ),
        ),
        ("relate", _times(lambda: finish(relate(template, argument, pipeline.similarity)))),
        (f"search ({pipeline.searcher.name})", _times(search)),
        ("object map", _times(lambda: object_map(occm(fmap, table)))),
    ]


def _start_up() -> list[tuple[str, list[float]]]:
    """Measure processes that each do a little more than the one before."""
    steps = [
        ("start Python", "pass"),
        ("import the engine", "import sketchmatch.public"),
        (
            "load plugins and kernels",
            "import sketchmatch.public\n"
            "from sketchmatch.pipeline.warmup import warm_up\n"
            "from sketchmatch.registry import default_registry\n"
            "warm_up(default_registry())",
        ),
    ]
    rows, before = [], 0.0
    for name, code in steps:
        times = _times(
            partial(subprocess.run, [sys.executable, "-c", code], check=True), _PROCESS_REPEATS
        )
        rows.append((name, [max(0.0, seconds - before) for seconds in times]))
        before = median(times)
    return rows


def _large_maps() -> list[tuple[str, list[float]]]:
    """Measure how long maps of pillars in a hall take, by their cells."""
    rows = []
    for side in (1000, 2000, 4000):
        cells = np.zeros((side, side), np.int8)
        cells[:3] = cells[-3:] = cells[:, :3] = cells[:, -3:] = 100
        for row in range(100, side - 100, 200):
            for column in range(100, side - 100, 200):
                cells[row : row + 40, column : column + 30] = 100
        grid = OccupancyGrid(cells, 0.05)
        rows.append((f"{side} x {side} cells", _times(partial(_segmented, grid), 5)))
    return rows


def _segmented(grid: OccupancyGrid) -> None:
    segmenter = resolve(default_registry(), {}, grid, grid).map_segmenter
    assert segmenter is not None
    assert len(segmenter.segment(grid).scene) > 10


def _times(work: Callable[[], object], repeats: int = _REPEATS) -> list[float]:
    """Return the seconds of each of several runs, after one that does not count."""
    seconds = []
    for _ in range(repeats + 1):
        started = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - started)
    return seconds[1:]


def _table(title: str, rows: list[tuple[str, list[float]]], *, parts: bool = True) -> Table:
    """Return a table of rows, as parts of one whole or each for itself."""
    total = sum(median(times) for _, times in rows)
    table = Table(title=title, title_justify="left")
    table.add_column("stage")
    for column in ("median ms", "min ms", "max ms", *(["share"] if parts else [])):
        table.add_column(column, justify="right")
    for name, times in rows:
        figures = [f"{1e3 * value:.2f}" for value in (median(times), min(times), max(times))]
        share = [f"{median(times) / total:.1%}"] if parts else []
        table.add_row(name, *figures, *share)
    if parts:
        table.add_section()
        table.add_row("sum of medians", f"{1e3 * total:.2f}", "", "", "")
    return table


if __name__ == "__main__":
    main()
