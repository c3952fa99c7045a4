"""Many cases in several processes: the same records whatever their number, in the same order."""

from __future__ import annotations

import multiprocessing
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from tests.experiments.cases import NOTHING, Record, Removal, cases, evaluate
from tests.experiments.methods import warm_up
from tests.experiments.study import Style

__all__ = ["PROCESSES", "Work", "run", "run_all"]

PROCESSES = 2

_CHUNK = 2


@dataclass(frozen=True)
class Work:
    """What is to be done with one sketch: each removal, on each map, with each method.

    Attributes
    ----------
    place, number, style, removals, grids
        As for :func:`tests.experiments.cases.cases`.
    methods
        Names in :data:`tests.experiments.methods.METHODS`.
    """

    place: str
    number: int
    style: Style
    removals: tuple[Removal, ...] = (NOTHING,)
    grids: tuple[bool, ...] = (False,)
    methods: tuple[str, ...] = ("easm", "auto")

    def done(self) -> list[Record]:
        """Do it."""
        found = cases(self.place, self.number, self.style, self.removals, grids=self.grids)
        return [evaluate(case, method) for case in found for method in self.methods]


def run(works: Sequence[Work], title: str, *, processes: int = PROCESSES) -> list[Record]:
    """Do all work, showing progress on the error stream: :func:`run_all` of one experiment."""
    return run_all({title: works}, processes=processes)[title]


def run_all(
    experiments: Mapping[str, Sequence[Work]], *, processes: int = PROCESSES
) -> dict[str, list[Record]]:
    """Do the work of several experiments, showing progress on the error stream.

    Parameters
    ----------
    experiments
        What is to be done, by what progress calls it.
    processes
        How many processes share it; 1 stays in this one.

    Returns
    -------
    dict
        For each experiment its records, in the order of the works.
    """
    with _workers(experiments, processes) as do, _progress(experiments) as advanced:
        records: dict[str, list[Record]] = {}
        for title, works in experiments.items():
            records[title] = []
            for each in do(works):
                records[title] += each
                advanced(title)
    return records


_Doing = Callable[[Sequence[Work]], Iterable[list[Record]]]


@contextmanager
def _workers(experiments: Mapping[str, Sequence[Work]], processes: int) -> Iterator[_Doing]:
    methods = {
        method for works in experiments.values() for work in works for method in work.methods
    }
    if processes == 1:
        warm_up(methods)
        yield lambda works: map(Work.done, works)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, context, warm_up, (methods,)) as pool:
        yield lambda works: pool.map(Work.done, works, chunksize=_CHUNK)


@contextmanager
def _progress(experiments: Mapping[str, Sequence[Work]]) -> Iterator[Callable[[str], None]]:
    """Show a bar for each experiment on a terminal, and a line when it is done elsewhere."""
    console = Console(file=sys.stderr)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    started = time.perf_counter()
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        tasks = {
            title: progress.add_task(title, total=len(works))
            for title, works in experiments.items()
        }

        def advanced(title: str) -> None:
            progress.advance(tasks[title])
            task = progress.tasks[tasks[title]]
            if not console.is_terminal and task.finished:
                seconds = time.perf_counter() - started
                console.print(f"{title}: {len(experiments[title])} sketches, {seconds:.0f} s")

        yield advanced
