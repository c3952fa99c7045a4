"""Checking all that a distribution offers, in another process, which can be ended.

A check that does not even end when its time is over, since it holds up the interpreter, and one
that ends its process have failed; what is left to check is checked in a new process.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import time
from collections import Counter
from collections.abc import Generator, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import EntryPoint, PackageNotFoundError, entry_points
from importlib.metadata import distribution as installed
from multiprocessing.connection import Connection, wait
from typing import TYPE_CHECKING, Any

from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.registry import discover
from sketchmatch.registry.discovery import ENTRY_POINT_GROUP
from sketchmatch.testing.conformance import readers
from sketchmatch.testing.conformance.checking import plugin_checks
from sketchmatch.testing.conformance.contract import (
    TIME_LIMIT,
    CheckResult,
    CheckState,
    PluginCheck,
)
from sketchmatch.testing.conformance.time_limit import HELD_UP

if TYPE_CHECKING:
    from multiprocessing.context import SpawnProcess

__all__ = ["Checked", "check_distribution"]

_LOADING = 180.0
_DYING = 2.0
_ENDLESS = 2
"""Checks of one algorithm that may never end; the others are skipped then."""

_LOADS = ("loads", "Load, and offer algorithms that derive from the five interfaces.")
_spawning = multiprocessing.get_context("spawn")


@dataclass(frozen=True)
class Checked:
    """What came of one check of what a distribution offers.

    Attributes
    ----------
    kind, algorithm
        What was checked; empty where the distribution as a whole was.
    result
        What came of it.
    """

    kind: str
    algorithm: str
    result: CheckResult


@dataclass(frozen=True)
class _Planned:
    """A check to come."""

    kind: str
    algorithm: str
    name: str
    demand: str
    time_limit: float

    def failed(self, seen: str, seconds: float, *, overdue: bool) -> Checked:
        return self._checked(CheckState.FAILED, seen, seconds, overdue=overdue)

    def skipped(self, reason: str) -> Checked:
        return self._checked(CheckState.SKIPPED, reason, 0.0, overdue=False)

    def _checked(self, state: CheckState, seen: str, seconds: float, *, overdue: bool) -> Checked:
        result = CheckResult(self.name, self.demand, state, seen, seconds, overdue)
        return Checked(self.kind, self.algorithm, result)


@dataclass(frozen=True)
class _Plan:
    """What the other process found: what is wrong with the distribution, and what to check."""

    problems: tuple[str, ...]
    checks: tuple[_Planned, ...]


def check_distribution(distribution: str, time_limit: float = TIME_LIMIT) -> Iterator[Checked]:
    """Put every class that a distribution offers to every contract of its kind.

    Nothing of it is imported in this process.

    Parameters
    ----------
    distribution
        Its name.
    time_limit
        Seconds that each check may take, and a warm-up five times as many.

    Returns
    -------
    iterator of Checked
        What came of each check, as soon as it is known; first of all, of loading it.

    Raises
    ------
    InvalidInputError
        If it is not installed, or offers no plugin.
    """
    _entries(distribution)
    return _results(distribution, time_limit)


def _results(distribution: str, time_limit: float) -> Iterator[Checked]:
    began = time.monotonic()
    plan: _Plan | None = None
    at, endless = 0, Counter[tuple[str, str]]()
    while plan is None or at < len(plan.checks):
        with _process(distribution, at, time_limit) as process:
            try:
                found = process.received(_LOADING)
            except _GoneError as gone:
                where = "" if plan is None else ", though it did before"
                yield _loading(began, f"it {gone} while it was loaded{where}")
                return
            if plan is None:
                plan = found
                for problem in plan.problems or ("",):
                    yield _loading(began, problem)
            at = yield from _answers(process, plan.checks, at, endless)
        if at < len(plan.checks):
            at = yield from _without_the_endless(plan.checks, at, endless)


def _entries(distribution: str) -> tuple[EntryPoint, ...]:
    """Return the entry points by which a distribution offers algorithms.

    Raises
    ------
    InvalidInputError
        If it is not installed, or has none.
    """
    try:
        found = tuple(installed(distribution).entry_points.select(group=ENTRY_POINT_GROUP))
    except (PackageNotFoundError, ValueError):  # nor is the empty name that of one
        problem = "is not installed here"
    else:
        if found:
            return found
        problem = f"has no entry point in the group {ENTRY_POINT_GROUP}"
    known = {point.dist.name for point in entry_points(group=ENTRY_POINT_GROUP) if point.dist}
    raise InvalidInputError(
        Reason.INVALID_FIELD,
        "DISTRIBUTION",
        f"{quoted(distribution)} {problem}; choose one of: {', '.join(sorted(known))}",
    )


class _GoneError(Exception):
    """Another process ended, or had to be ended; says how."""


class _Process:
    """Another process that checks, and the pipe from it."""

    def __init__(self, process: SpawnProcess, connection: Connection) -> None:
        self._process = process
        self._connection = connection

    def received(self, seconds: float) -> Any:
        """Return the next message.

        Raises
        ------
        _GoneError
            If the process ends before, or has none in time.
        """
        if not wait([self._connection, self._process.sentinel], seconds):
            raise _GoneError(f"did not end within {seconds:g} s")
        with suppress(EOFError, OSError):
            if self._connection.poll():
                return self._connection.recv()
        self._process.join(_DYING)
        code = self._process.exitcode or 0
        how = f"signal {-code}" if code < 0 else f"exit code {code}"
        raise _GoneError(f"ended its process ({how})")


@contextmanager
def _process(distribution: str, first: int, time_limit: float) -> Iterator[_Process]:
    """Lend a process that checks a distribution, from one check on."""
    ours, theirs = _spawning.Pipe(duplex=False)
    process = _spawning.Process(
        target=_live,
        args=(theirs, distribution, first, time_limit),
        name=f"sketchmatch-check-{distribution}",
        daemon=True,
    )
    process.start()
    theirs.close()
    try:
        yield _Process(process, ours)
    finally:
        process.kill()
        process.join()
        ours.close()


def _live(connection: Connection, distribution: str, first: int, time_limit: float) -> None:
    """Check a distribution, and send what came of it; the entry of the other process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever started it ends it
    os.dup2(2, 1)  # standard output is the caller's; what a plugin prints is no part of it
    registry = discover(_entries(distribution))
    checks = [
        (item.kind, item.name, check)
        for item in sorted(registry.algorithms, key=lambda item: (item.kind, item.name))
        for check in plugin_checks(item.algorithm, time_limit)
    ] + [
        ("reader", item.name, PluginCheck.of(contract, item.reader, time_limit))
        for item in sorted(registry.readers, key=lambda item: item.name)
        for contract in readers.CONTRACTS
    ]
    planned = (_planned(kind, name, check) for kind, name, check in checks)
    connection.send(_Plan(registry.problems, tuple(planned)))
    for _, _, check in checks[first:]:
        result = check.result()
        connection.send(result)
        if result.overdue:  # it may go on, and be in the way of all others
            break
    connection.close()
    os._exit(0)  # whatever threads are left


def _planned(kind: str, algorithm: str, check: PluginCheck) -> _Planned:
    limit = math.inf if check.time_limit is None else check.time_limit
    return _Planned(str(kind), algorithm, check.name, check.demand, limit)


def _loading(began: float, problem: str) -> Checked:
    state = CheckState.FAILED if problem else CheckState.PASSED
    return Checked("", "", CheckResult(*_LOADS, state, problem, time.monotonic() - began))


def _answers(
    process: _Process, checks: tuple[_Planned, ...], at: int, endless: Counter[tuple[str, str]]
) -> Generator[Checked, None, int]:
    """Yield what comes of the checks until the process ends; return which is the next."""
    for k in range(at, len(checks)):
        each, began = checks[k], time.monotonic()
        try:
            result = process.received(each.time_limit + HELD_UP + _DYING)
        except _GoneError as gone:
            seconds = time.monotonic() - began
            overdue = seconds >= each.time_limit
            limit = f"did not end within {each.time_limit:g} s, and held up the interpreter"
            endless[each.kind, each.algorithm] += overdue
            yield each.failed(f"it {limit if overdue else gone}", seconds, overdue=overdue)
            return k + 1
        endless[each.kind, each.algorithm] += result.overdue
        yield Checked(each.kind, each.algorithm, result)
        if result.overdue:
            return k + 1
    return len(checks)


def _without_the_endless(
    checks: tuple[_Planned, ...], at: int, endless: Counter[tuple[str, str]]
) -> Generator[Checked, None, int]:
    """Skip what is left of an algorithm whose checks never end; return which is the next."""
    for each in checks[at:]:
        if endless[each.kind, each.algorithm] < _ENDLESS:
            break
        yield each.skipped(f"{_ENDLESS} checks before did not end")
        at += 1
    return at
