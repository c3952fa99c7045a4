"""How long whole matches take: sketches of a part of a map, on one core, with warm kernels.

Run it with ``make bench-match``; ``ARGS="--searchers direct,auto"`` compares searchers with the
default. All rows of a size are measured in the same run, on the same sketches.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import mean, median

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from sketchmatch import match
from sketchmatch.pipeline.warmup import warm_up
from sketchmatch.registry import Kind, default_registry
from tests.experiments.drawings import Drawing
from tests.experiments.generators import KINDS, sample

_SIZES = ((8, 20), (8, 52), (10, 127))
_SKETCHES = 20
_DEFAULT = "default"
_WIDTH = 108

_NOTES = """\
Sketches of neighbours among the objects of a map, by the generators of tests/experiments that \
nothing is learned from, in turn; no time budget. p50 and p95 of whole calls of sketchmatch.match \
on two scenes. Of a stage: the median in ms, and its share of all the time. \
right: share of sketches matched wholly right."""


@dataclass(frozen=True)
class Timed:
    """One match: how long it took, where, and whether it is wholly right."""

    seconds: float
    stages: Mapping[str, float]
    right: bool

    @classmethod
    def of(cls, drawing: Drawing, searcher: Mapping[str, str]) -> Timed:
        """Match a sketch."""
        started = time.perf_counter()
        result = match(drawing.scene, drawing.map, **searcher)
        seconds = time.perf_counter() - started
        truth = {k: int(c) for k, c in enumerate(drawing.truth) if c >= 0}
        stages = {
            k: v for k, v in result.statistics.seconds.items() if k not in ("total", "segment")
        }
        return cls(seconds, stages, result.object_map == truth)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print."""
    options = _options(arguments)
    _alone()
    warm_up(default_registry())
    console = Console()
    if not console.is_terminal:
        console = Console(width=_WIDTH)
    rows = {}
    for drawn, mapped in _SIZES:
        drawings = [_drawing(number, drawn, mapped) for number in range(options.sketches)]
        for method in (_DEFAULT, *options.searchers):
            rows[f"{drawn} × {mapped}", method] = list(_matched(drawings, method))
    console.print(_table(rows))
    console.print(_NOTES, highlight=False)


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    known = [item.name for item in default_registry().of_kind(Kind.SEARCHER)]
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--sketches", type=int, default=_SKETCHES, help="of each size")
    parser.add_argument("--searchers", help=f"some of {','.join(known)}, beside the default")
    options = parser.parse_args(arguments)
    if options.sketches <= 0:
        parser.error("--sketches must be positive")
    options.searchers = options.searchers.split(",") if options.searchers else []
    if unknown := [name for name in options.searchers if name not in known]:
        parser.error(f"no searcher is called {', '.join(unknown)}; there are {', '.join(known)}")
    return options


def _alone() -> None:
    """Stay on one core, where the system lets us."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def _drawing(number: int, drawn: int, mapped: int) -> Drawing:
    return sample(KINDS[number % len(KINDS)], number, objects=mapped, drawn=drawn)


def _matched(drawings: Sequence[Drawing], method: str) -> Iterator[Timed]:
    """Match each sketch, after one match that does not count."""
    searcher = {} if method == _DEFAULT else {"searcher": method}
    Timed.of(drawings[0], searcher)
    for drawing in track(drawings, method, console=Console(stderr=True), transient=True):
        yield Timed.of(drawing, searcher)


def _table(rows: Mapping[tuple[str, str], Sequence[Timed]]) -> Table:
    stages = dict.fromkeys(stage for runs in rows.values() for run in runs for stage in run.stages)
    table = Table(title="whole matches on one core", title_justify="left")
    for column in ("objects", "method"):
        table.add_column(column, no_wrap=True)
    for column in ("sketches", "p50 ms", "p95 ms", "right", *stages):
        table.add_column(column, justify="right")
    before = ""
    for (size, method), runs in rows.items():
        if before and size != before:
            table.add_section()
        figures = (str(len(runs)), *_percentiles(runs), f"{mean(run.right for run in runs):.0%}")
        table.add_row("" if size == before else size, method, *figures, *_by_stage(runs, stages))
        before = size
    return table


def _percentiles(runs: Sequence[Timed]) -> list[str]:
    seconds = [run.seconds for run in runs]
    return [f"{1e3 * np.quantile(seconds, share):,.1f}" for share in (0.5, 0.95)]


def _by_stage(runs: Sequence[Timed], stages: Mapping[str, None]) -> list[str]:
    total = sum(run.seconds for run in runs)
    found = {stage: [run.stages.get(stage, 0.0) for run in runs] for stage in stages}
    return [f"{1e3 * median(each):,.1f} ({sum(each) / total:.0%})" for each in found.values()]


if __name__ == "__main__":
    main()
