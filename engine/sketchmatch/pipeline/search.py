"""From a comparison to the best map, of all objects or of those that have a partner."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from sketchmatch.api import MatchProblem, Outcome, Searcher, SearchProgress
from sketchmatch.errors import AnswerUnavailableError
from sketchmatch.model import BoolArray, ConfidenceWeights, IntArray, Scene
from sketchmatch.pipeline.clock import Clock
from sketchmatch.pipeline.compare import Comparison
from sketchmatch.pipeline.guard import (
    FEWEST,
    blaming,
    checked_outcome,
    checked_progress,
    inspecting,
)
from sketchmatch.pipeline.obeying import Obedience, first_parts, obedience, ruled_out
from sketchmatch.pipeline.slices import retold
from sketchmatch.pipeline.unmatched import Part, PartSearch, Rival, part_of, trials
from sketchmatch.registry import Registry

__all__ = ["Goal", "Search", "search"]


@dataclass(frozen=True)
class Goal:
    """What is sought.

    Attributes
    ----------
    weights
        Of the parts of ζ.
    price
        Of leaving all objects of the template out; infinite where none may be left out.
    alternatives
        How many maps beside the best are wanted.
    shown
        How many of these the caller wants to see.
    seed
        Of everything random.
    at_once
        Whether the searcher or the judge finds out by itself which objects to leave out, so that
        no parts of the template are searched.
    allowed, pinned, names
        What the caller knows of objects, and their labels, as in
        :class:`~sketchmatch.api.MatchProblem`.
    start, elsewhere
        What was found a moment ago, where a quick answer is sought, as in
        :class:`~sketchmatch.api.MatchProblem` and :class:`~sketchmatch.api.JudgeProblem`.
    """

    weights: ConfidenceWeights
    price: float = math.inf
    alternatives: int = 0
    shown: int = 0
    seed: int = 0
    at_once: bool = False
    allowed: BoolArray | None = None
    pinned: IntArray | None = None
    names: IntArray | None = None
    start: tuple[IntArray, ...] = ()
    elsewhere: float | None = None


@dataclass(frozen=True, eq=False)
class Search:
    """What a search has come to.

    Attributes
    ----------
    best
        The map that is worth most.
    iterations, evaluations
        Of the searcher, in all parts together.
    rivals
        The best maps of the other parts.
    """

    best: PartSearch
    iterations: int = 0
    evaluations: int = 0
    rivals: tuple[Rival, ...] = ()


def search(
    comparison: Comparison, searcher: Searcher, goal: Goal, registry: Registry, clock: Clock
) -> Generator[Search, None, Search]:
    """Search all that is to be searched.

    Yields
    ------
    Search
        What it has come to, at each step of the searcher.

    Returns
    -------
    Search
        The end of it, with ``Outcome.TIME_BUDGET`` if that was the end of the clock's budget.

    Raises
    ------
    PluginError
        If the searcher breaks its contract.
    AnswerUnavailableError
        If every map is ruled out.
    """
    whole = Part.whole(comparison.table, comparison.own)
    weights = goal.weights.searched
    first, fixed = [tuple(range(whole.objects))], frozenset[int]()
    if (pinned := goal.pinned) is not None:
        goal = replace(goal, allowed=ruled_out(goal.allowed, pinned, whole.table))
        fixed = frozenset(np.flatnonzero(pinned >= 0).tolist())
    if goal.allowed is not None:
        first = first_parts(goal.allowed, fixed)
        fewest = whole.objects if goal.price == math.inf else min(FEWEST, whole.objects)
        if len(first[0]) < fewest:
            raise AnswerUnavailableError("no object map agrees with all pins; pin fewer objects")
    plan = trials(first, weights, math.inf if goal.at_once else goal.price, fixed)
    trial, so_far, rivals = next(plan), None, list[Rival]()
    while True:
        part = yield from retold(part_of(whole, trial.kept), _still(so_far))
        obeying, allowed = None, part.known(goal.allowed)
        if allowed is not None and not allowed.all():
            work = obedience(part, weights, allowed)
            obeying = yield from retold(work, _still(so_far))
        share = trial.share * clock.left()
        problem = _problem(comparison, part, obeying, goal, share)
        run = _searched(part, problem, obeying, searcher, goal, registry, clock, so_far)
        found, total = yield from run
        if so_far is not None:
            worse = so_far.best if total.best is found else found
            rivals.append(worse.rival(weights))
        so_far = replace(total, rivals=tuple(rivals))
        try:
            trial = plan.send(found)
        except StopIteration:
            return so_far
        if clock.left() <= 0.0:
            return replace(so_far, best=replace(so_far.best, outcome=Outcome.TIME_BUDGET))


def _still(so_far: Search | None) -> Callable[[float], Iterable[Search]]:
    """Return what tells of a search that it stands where it stood."""
    return lambda _: () if so_far is None else (so_far,)


def _searched(
    part: Part,
    problem: MatchProblem,
    obeying: Obedience | None,
    searcher: Searcher,
    goal: Goal,
    registry: Registry,
    clock: Clock,
    so_far: Search | None,
) -> Generator[Search, None, tuple[PartSearch, Search]]:
    """Run the searcher on a part until it ends, or its time does.

    Returns
    -------
    PartSearch, Search
        What came of the part, and of it and of what was searched before.
    """
    seconds = math.inf if problem.time_budget is None else problem.time_budget
    until = time.monotonic() + seconds
    found: PartSearch | None = None
    told: SearchProgress | None = None
    with _searching(searcher, problem, goal.seed, registry) as work:
        while True:
            with blaming(searcher, registry):
                try:
                    told = checked_progress(next(work), problem, told)
                except StopIteration as stop:
                    if found is None:
                        raise ValueError("it ended without any answer") from None
                    found = replace(found, outcome=checked_outcome(stop.value))
                    break
            found = PartSearch(part, told) if obeying is None else obeying.read(told, found)
            if time.monotonic() > until or clock.left() <= 0.0:
                break
            yield _total(so_far, found, goal.price)
    if obeying is not None:
        found = obeying.mended(found)
    return found, _total(so_far, found, goal.price)


def _problem(
    comparison: Comparison, part: Part, obeying: Obedience | None, goal: Goal, seconds: float
) -> MatchProblem:
    table, weights = part.table, goal.weights.searched
    if obeying is not None:
        table, weights = obeying.table, obeying.searched
    there_are = math.perm(table.argument_objects, table.template_objects) - 1
    return MatchProblem(
        table,
        weights,
        min(goal.alternatives, there_are),
        seconds if seconds < math.inf else None,
        scenes=cache(partial(_scenes, comparison, part)),
        swapped=comparison.swapped,
        partial=goal.at_once and goal.price < math.inf,
        allowed=part.known(goal.allowed),
        pinned=part.known(goal.pinned),
        names=part.known(goal.names),
        start=() if part.left_out else goal.start,
    )


def _scenes(comparison: Comparison, part: Part) -> tuple[Scene, Scene]:
    """Return the template's objects of a part, and the argument."""
    template, argument = comparison.scenes
    if part.left_out:
        template = Scene(tuple(template.objects[k] for k in part.kept.tolist()))
    return template, argument


def _total(so_far: Search | None, found: PartSearch, price: float) -> Search:
    """Return what a search has come to with the search of one more part."""
    done = (found.best.iteration, found.best.evaluations)
    if so_far is None:
        return Search(found, *done)
    better = found if found.value(price) > so_far.best.value(price) else so_far.best
    return Search(better, so_far.iterations + done[0], so_far.evaluations + done[1])


@contextmanager
def _searching(
    searcher: Searcher, problem: MatchProblem, seed: int, registry: Registry
) -> Iterator[Generator[SearchProgress, None, Outcome]]:
    """Start a search, and stop it in the end."""
    with blaming(searcher, registry):
        work = searcher.search(problem, np.random.default_rng(seed))
        if not isinstance(work, Generator):
            raise TypeError(f"its search is a {type(work).__name__}, not a generator")
    with inspecting(searcher, registry, problem.table):
        try:
            yield work
        finally:
            with blaming(searcher, registry):
                work.close()
