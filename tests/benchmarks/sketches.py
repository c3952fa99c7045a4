"""How soon a map follows the pen, and what a stored map and former revisions save a match.

Run it with ``make bench-sketches``. The server is a process of its own; the client shares the
machine with it. Look at what the server spends where the machine is busy otherwise: waiting counts
in the times, not in that.

What a match with a stored map takes beside the search is measured twice: by the server's clock,
from accepting the request to the result, and as processor time of all that a worker does, from the
bytes of the request to those of the last event, in this process. Of both the stage ``search`` is
taken off: the search and the judge. What the process in front of the workers spends on a match,
whatever the map, comes in a column of its own.
"""

from __future__ import annotations

import argparse
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from statistics import median, quantiles
from typing import Any
from unittest.mock import patch

import numpy as np
from rich.console import Console
from rich.table import Table

from sketchmatch.api.forces import own_histograms
from sketchmatch.app.jobs import answers
from sketchmatch.app.orders import Order
from sketchmatch.app.remembered import Remembered
from sketchmatch.app.setup import RequestLimits, Setup
from sketchmatch.model import Scene
from sketchmatch.pipeline.clock import Clock
from sketchmatch.pipeline.compare import compare
from sketchmatch.pipeline.describe import described, in_directions
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.memory import Memory
from sketchmatch.pipeline.slices import finish
from sketchmatch.registry import Kind, default_registry
from sketchmatch_client import Client, NotFoundError, match_request, sources
from sketchmatch_proto.v1.source_pb2 import Source
from tests.benchmarks.server import processor_seconds
from tests.processes import server
from tests.server.harness import scene, shapes, turned

_DRAWN = (0, 3, 7, 8, 12, 15, 20, 28)
_MAPPED = 30
_RATE = 20.0
_SIDE = 4000


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--updates", type=int, default=60, help="of the sketch, for each row")
    parser.add_argument("--matches", type=int, default=20, help="with the large map")
    given = parser.parse_args()
    with (
        tempfile.TemporaryDirectory() as folder,
        server("--store", folder) as running,
        Client(running.address, timeout=120) as client,
    ):
        Console().print(_live(client, running.process.pid, given.updates))
        Console().print(_revised(given.updates))
        Console().print(_stored(client, running.process.pid, Path(folder), given.matches))


def _live(client: Client, pid: int, updates: int) -> Table:
    table = Table("updates", "p50 ms", "p95 ms", "most ms", "told", "server ms each")
    table.title = f"pen up to the first map, {len(_DRAWN)} objects on a stored map of {_MAPPED}"
    stored = client.put_scene(scene(_MAPPED, 1)).stored_scene.name
    for pause, name in ((0.4, "one by one"), (1.0 / _RATE, f"{_RATE:g} a second")):
        with _drawing(client, sources.stored_scene(stored)) as (sketch, told):
            for k in range(len(_DRAWN)):
                _draw(sketch, told, k, 0.0)
            time.sleep(1.0)
            spent, asked = processor_seconds(pid), {}
            began = time.perf_counter()
            for k in range(updates):
                time.sleep(max(0.0, began + k * pause - time.perf_counter()))
                revision, at = _draw(sketch, told, k % len(_DRAWN), 0.01 * (k % 7), wait=False)
                asked[revision] = at
            told.wait(revision)
            spent = processor_seconds(pid) - spent
            waits = [1e3 * (told.at[each] - at) for each, at in asked.items() if each in told.at]
        share = f"{len(waits)} of {updates}"
        figures = [median(waits), quantiles(waits, n=20)[-1], max(waits)]
        row = [f"{figure:.1f}" for figure in figures]
        table.add_row(name, *row, share, f"{1e3 * spent / updates:.1f}")
    return table


def _revised(updates: int) -> Table:
    """Measure what a worker computes of a sketch of which one object was drawn anew."""
    table = Table("", "describe", "relate", "within objects")
    table.title = f"one of {len(_DRAWN)} objects changed, processor time in ms"
    registry = default_registry()
    histogram = in_directions(registry.find(Kind.HISTOGRAM, "constant").algorithm(), 180)
    similarity = registry.find(Kind.SIMILARITY, "cross-correlation").algorithm()
    map_ = Scene.from_polygons(shapes(_MAPPED, 1))
    mapped = finish(described(map_, histogram, registry, "map"))
    for name, memory in (("anew", None), ("what changed", Memory())):
        rows = []
        for k in range(updates + 5):
            outlines = list(_OUTLINES)
            outlines[3] = outlines[3] + 0.001 * k
            sketch = Scene.from_polygons(outlines)
            sketch = sketch if memory is None else memory.met(sketch)
            began = time.process_time()
            drawn = finish(described(sketch, histogram, registry, "sketch", memory))
            described_ = time.process_time()
            pair = (sketch, map_), (drawn, mapped)
            finish(compare(*pair, similarity, registry, memory=memory))
            related = time.process_time()
            own_histograms(sketch.objects)
            ended = time.process_time()
            rows.append((described_ - began, related - described_, ended - related))
        figures = [median(column) for column in zip(*rows[5:], strict=True)]
        table.add_row(name, *(f"{1e3 * figure:.2f}" for figure in figures))
    return table


class _Told:
    """When each revision had its first map."""

    def __init__(self, sketch: Any) -> None:
        self.at: dict[int, float] = {}
        self._news = threading.Condition()
        threading.Thread(target=self._watch, args=(sketch,), daemon=True).start()

    def wait(self, revision: int) -> None:
        """Wait until there is a map of a revision."""
        with self._news:
            assert self._news.wait_for(lambda: revision in self.at, 60)

    def _watch(self, sketch: Any) -> None:
        with suppress(NotFoundError):  # the end of it
            for event in sketch.watch():
                if event.HasField("result") or event.HasField("problem"):
                    with self._news:
                        self.at.setdefault(event.revision, time.perf_counter())
                        self._news.notify_all()


@contextmanager
def _drawing(client: Client, map_: Source) -> Iterator[tuple[Any, _Told]]:
    with client.sketch(map_) as sketch:
        yield sketch, _Told(sketch)


_OUTLINES = turned([shapes(_MAPPED, 1)[k] for k in _DRAWN])


def _draw(
    sketch: Any, told: _Told, k: int, shift: float, *, wait: bool = True
) -> tuple[int, float]:
    """Draw an outline; return the revision, and when the pen was lifted."""
    outline = _OUTLINES[k] + shift
    points = np.concatenate([outline, outline[:1]]).tolist()
    lifted = time.perf_counter()
    revision = sketch.update({f"s{k}": points}).revision
    if wait:
        told.wait(revision)
    return revision, lifted


def _stored(client: Client, pid: int, store: Path, matches: int) -> Table:
    table = Table("map", "answer ms", "search", "beside", "segment", "worker beside", "front")
    table.title = f"a match with a map of {_SIDE} x {_SIDE} cells, 8 sketched objects, ms"
    grid = _grid()
    name = client.put_scene(grid).stored_scene.name
    found = client.get_scene(name).stored_scene.scene.objects
    table.caption = f"{len(found)} objects"
    sketch = sources.polygons(
        turned([np.array([[p.x, p.y] for p in found[k].rings[0].points]) for k in range(8)])
    )
    for what, map_ in (("sent along", grid), ("stored", sources.stored_scene(name))):
        rows, spent = [], -processor_seconds(pid, children=False)
        for _ in range(matches + 1):
            began = time.perf_counter()
            statistics = client.match(sketch, map_).result.statistics
            taken = time.perf_counter() - began
            total, search, segment = (
                each.ToTimedelta().total_seconds()
                for each in (
                    statistics.total_elapsed,
                    statistics.search_elapsed,
                    statistics.segment_elapsed,
                )
            )
            rows.append((taken, search, total - search, segment))
        spent += processor_seconds(pid, children=False)
        figures = [median(column) for column in zip(*rows[1:], strict=True)]
        figures += [_worker_beside(store, sketch, map_, matches), spent / (matches + 1)]
        table.add_row(what, *(f"{1e3 * figure:.1f}" for figure in figures))
    return table


def _worker_beside(store: Path, sketch: Source, map_: Source, matches: int) -> float:
    """Return the processor time of what a worker does, but for the search."""
    spent: dict[str, float] = {}

    @contextmanager
    def timing(clock: Clock, stage: str) -> Iterator[None]:
        began, before = time.monotonic(), time.process_time()
        yield
        clock.seconds[stage] = time.monotonic() - began
        spent[stage] = time.process_time() - before

    remembered = Remembered(store / "scenes.sqlite")
    setup = Setup(Engine(default_registry()), RequestLimits())
    setup = remembered.setup(setup, lambda _: None)
    order = Order("a", "MatchRequest", match_request(sketch, map_).SerializeToString())
    found = []
    with patch.object(Clock, "timing", timing):
        for _ in range(matches + 5):
            before = time.process_time()
            for event in answers(order.job(setup.limits.max_request_bytes), setup):
                event.SerializeToString()
            found.append(time.process_time() - before - spent["search"])
    remembered.close()
    return median(found[5:])


def _grid() -> Source:
    """Return a hall with 30 things in it, each of another size."""
    rng = np.random.default_rng(0)
    cells = np.zeros((_SIDE, _SIDE), np.int8)
    cells[:3] = cells[-3:] = cells[:, :3] = cells[:, -3:] = 100
    for k in range(_MAPPED):
        row, column = divmod(k, 6)
        top, left = np.array([300 + 700 * row, 200 + 600 * column]) + rng.integers(0, 200, 2)
        height, width = rng.integers(40, 160, 2)
        cells[top : top + height, left : left + width] = 100
    return sources.occupancy_grid(cells, 0.05)


if __name__ == "__main__":
    main()
