"""Many cases in several processes: the same records whatever their number, in the same order."""

from __future__ import annotations

import multiprocessing
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol, TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from sketchmatch.pipeline.warmup import announcing_compilation
from tests.experiments.cases import NOTHING, Record, Removal, cases, evaluate
from tests.experiments.methods import warm_up
from tests.experiments.study import Style

__all__ = ["PROCESSES", "Task", "Work", "each_of", "run", "run_all"]

PROCESSES = 2

_CHUNK = 2
_TELL_EVERY = 30.0
_Item = TypeVar("_Item")
_Done = TypeVar("_Done")
_Made_co = TypeVar("_Made_co", covariant=True)


class Task(Protocol[_Made_co]):
    """Something to be done that knows how."""

    @property
    def methods(self) -> tuple[str, ...]:
        """Names in :data:`tests.experiments.methods.METHODS`."""

    def done(self) -> list[_Made_co]:
        """Do it."""


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
    experiments: Mapping[str, Sequence[Task[_Done]]], *, processes: int = PROCESSES
) -> dict[str, list[_Done]]:
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
    methods = {
        method for works in experiments.values() for work in works for method in work.methods
    }
    counts = {title: len(works) for title, works in experiments.items()}
    with _workers(processes, methods) as do, _progress(counts) as advanced:
        records: dict[str, list[_Done]] = {}
        for title, works in experiments.items():
            records[title] = []
            for each in do(_done, works):
                records[title] += each
                advanced(title)
    return records


def each_of(
    do: Callable[[_Item], _Done], items: Sequence[_Item], title: str, *, processes: int = PROCESSES
) -> Iterator[_Done]:
    """Yield what comes of each item, in their order, showing progress on the error stream."""
    with _workers(processes) as all_of, _progress({title: len(items)}) as advanced:
        for done in all_of(do, items):
            yield done
            advanced(title)


def _done(task: Task[_Done]) -> list[_Done]:
    return task.done()


@contextmanager
def _workers(processes: int, methods: Iterable[str] = ()) -> Iterator[Callable[..., Any]]:
    """Compile what methods need, and give what maps a function over items, in processes.

    The kernels are compiled here, once; the processes find them in the cache.
    """
    names = tuple(methods)
    with announcing_compilation(partial(print, file=sys.stderr)):
        warm_up(names)
    if processes == 1:
        yield map
        return
    context = multiprocessing.get_context("spawn")
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with ProcessPoolExecutor(processes, context, _begin, (names,)) as pool:
            try:
                yield partial(pool.map, chunksize=_CHUNK)
            except BaseException:
                pool.shutdown(cancel_futures=True)  # it would do all the work before it ends
                raise
    finally:
        signal.signal(signal.SIGTERM, before)


def _begin(methods: Iterable[str]) -> None:
    """Make a process ready, which ends when the first one says so and not by Ctrl-C itself."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warm_up(methods)


@contextmanager
def _progress(counts: Mapping[str, int]) -> Iterator[Callable[[str], None]]:
    """Show a bar for each experiment on a terminal; elsewhere lines, half a minute apart."""
    console = Console(file=sys.stderr)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    started = told = time.perf_counter()
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        tasks = {title: progress.add_task(title, total=count) for title, count in counts.items()}

        def advanced(title: str) -> None:
            nonlocal told
            progress.advance(tasks[title])
            task, now = progress.tasks[tasks[title]], time.perf_counter()
            if not console.is_terminal and (task.finished or now > told + _TELL_EVERY):
                told = now
                done = f"{task.completed:.0f} of {counts[title]} sketches"
                console.print(f"{title}: {done}, {now - started:.0f} s")

        yield advanced
