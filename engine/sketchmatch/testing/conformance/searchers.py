"""Contracts of searchers."""

from __future__ import annotations

import inspect
import math
import random
import threading
import time
from collections.abc import Callable, Hashable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import pairwise
from time import perf_counter  # the real one, whatever a check does to the module
from typing import Any
from unittest import mock

import numpy as np

from sketchmatch.api import MatchProblem, Outcome, Searcher, SearchProgress
from sketchmatch.model import Fmap, RelationTable, Weights, pair_count
from sketchmatch.model.arrays import sealed
from sketchmatch.pipeline.guard import check_map
from sketchmatch.testing.conformance.contract import (
    BrokenError,
    Contract,
    refused_as_broken,
    require,
    require_applicable,
)
from sketchmatch.testing.conformance.use import Use, contracts_of_use, view_within
from sketchmatch.testing.oracle import (
    best_object_map,
    is_legal,
    is_object_consistent,
    score_fmap,
)
from sketchmatch.testing.problems import matching_problem, random_relations
from sketchmatch.testing.sketches import random_scene

__all__ = ["CONTRACTS", "Run", "large_problem", "posed", "run"]

_CLOSE = 1e-9
_LONGEST_RUN = 20.0
_LONGEST_STEP = 0.5
_LONGEST_END = 0.1
_WATCHED = 1.5
_HURRY = 100.0
_ATTEMPTS = 5
_OF_PAIRS = "it says object_consistent = False"
_ARRAYS = (
    "similarity",
    "rotation",
    "dilation",
    "normalized_dilation",
    "cosine",
    "sine",
    "rotation_weights",
)
_OUTCOMES = (Outcome.CONVERGED, Outcome.OPTIMAL, Outcome.ITERATION_LIMIT)


@dataclass(frozen=True)
class Run:
    """One whole search: what it yielded, and what it returned."""

    seen: tuple[SearchProgress, ...]
    outcome: Any

    @property
    def answer(self) -> Hashable:
        """What must not differ between two runs; how often it yields may."""
        last = self.seen[-1]
        return last.fmap.entries.tobytes(), last.confidence, last.iteration, self.outcome


def run(searcher: Searcher, problem: MatchProblem, seed: int = 0) -> Run:
    """Search to the end."""
    work, seen = searcher.search(problem, np.random.default_rng(seed)), []
    ending = perf_counter() + _LONGEST_RUN
    while True:
        try:
            seen.append(next(work))
        except StopIteration as stop:
            require(seen, "a search ended without yielding anything")
            return Run(tuple(seen), stop.value)
        if perf_counter() > ending:
            raise BrokenError(f"a search of some objects has not ended after {_LONGEST_RUN:g} s")


def large_problem() -> MatchProblem:
    """Return a problem that no search is done with at once."""
    return posed(random_relations(np.random.default_rng(8), 12, 14))


def posed(
    table: RelationTable, weights: Weights = (1.0, 1.0, 1.0), *, alternatives: int = 0
) -> MatchProblem:
    """Return the problem of a table, with scenes of as many objects, as the host gives them."""
    rng = np.random.default_rng(11)
    template, argument = (
        random_scene(rng, objects) for objects in (table.template_objects, table.argument_objects)
    )
    return MatchProblem(table, weights, alternatives, scenes=lambda: (template, argument))


def search_returns_a_generator(algorithm: type[Searcher]) -> None:
    """Write search() as a generator function, so that the host can close it."""
    work = algorithm().search(_problems()[0], np.random.default_rng(0))
    require(inspect.isgenerator(work), f"search() returned a {type(work).__name__}")
    work.close()


def search_yields_progress(algorithm: type[Searcher]) -> None:
    """Yield SearchProgress, once or more before the search ends, and nothing else."""
    for problem in _problems():
        for progress in _run(algorithm, problem).seen:
            fits = isinstance(progress, SearchProgress)
            require(fits, f"it yielded a {type(progress).__name__}")


def search_returns_an_outcome(algorithm: type[Searcher]) -> None:
    """Return one of Outcome.CONVERGED, OPTIMAL and ITERATION_LIMIT."""
    for problem in _problems():
        outcome = _run(algorithm, problem).outcome
        require(outcome in _OUTCOMES, f"it returned {outcome!r}")


def fmaps_are_legal(algorithm: type[Searcher]) -> None:
    """Map every template pair, one-to-one, and never to a pair and its dual."""
    for problem in _problems():
        for progress in _run(algorithm, problem).seen:
            _legal(progress.fmap, problem.table)


def alternatives_are_legal(algorithm: type[Searcher]) -> None:
    """Give legal FMAPs as the alternatives of the last progress, too."""
    for problem in _problems():
        for fmap in _run(algorithm, problem).seen[-1].alternatives:
            _legal(fmap, problem.table)


def confidence_is_zeta(algorithm: type[Searcher]) -> None:
    """Give as confidence the ζ of the FMAP, to 1e-9."""
    for problem in _problems():
        for progress in _run(algorithm, problem).seen:
            _scored(progress, problem)


def confidence_never_falls(algorithm: type[Searcher]) -> None:
    """Never let ζ fall during a search."""
    for problem in _problems():
        values = [progress.confidence for progress in _run(algorithm, problem).seen]
        for before, after in pairwise(values):
            require(after >= before, f"ζ fell from {before:.9f} to {after:.9f}")


def upper_bound_is_true(algorithm: type[Searcher]) -> None:
    """Claim no upper bound below ζ of any object map, or of the FMAP beside it."""
    for problem in _problems():
        best = _best(problem)
        for progress in _run(algorithm, problem).seen:
            bound = math.inf if progress.upper_bound is None else progress.upper_bound
            most = max(best, progress.confidence)
            require(bound >= most - _CLOSE, f"it claims {bound:.9f}, and a map has {most:.9f}")


def upper_bound_never_rises(algorithm: type[Searcher]) -> None:
    """Never let the upper bound rise during a search."""
    for problem in _problems():
        bounds = _bounds(_run(algorithm, problem))
        for before, after in pairwise(bounds):
            require(after <= before + _CLOSE, f"it rose from {before:.9f} to {after:.9f}")


def optimal_is_optimal(algorithm: type[Searcher]) -> None:
    """Return Outcome.OPTIMAL only with a ζ that no object map exceeds."""
    for problem in _problems():
        found = _run(algorithm, problem)
        best, own = _best(problem), found.seen[-1].confidence
        require(
            found.outcome is not Outcome.OPTIMAL or own >= best - _CLOSE,
            f"it returned OPTIMAL with ζ = {own:.9f}, and a map has {best:.9f}",
        )


def object_maps_are_kept_to(algorithm: type[Searcher]) -> None:
    """Yield FMAPs that follow from object maps alone, or say object_consistent = False."""
    require_applicable(algorithm().object_consistent, _OF_PAIRS)
    for problem in _problems():
        for progress in _run(algorithm, problem).seen:
            fmap, table = progress.fmap, problem.table
            require(
                is_object_consistent(fmap, table) or not is_legal(fmap, table),
                "it says object_consistent, and an FMAP leads to no object map",
            )


def maps_beside_are_possible(algorithm: type[Searcher]) -> None:
    """Tell in SearchProgress.maps object maps of three objects or more, and none ruled out."""
    require_applicable(algorithm().partial, "it says partial = False")
    for problem in _partial_problems():
        for partners in run(algorithm(), problem).seen[-1].maps:
            with refused_as_broken():
                check_map(partners, problem)


def iterations_are_no_more_than_maps(algorithm: type[Searcher]) -> None:
    """Have no more iterations than ``most_maps`` says, where it says how many maps there are."""
    most = algorithm().most_maps
    require_applicable(most is not None, "it says most_maps = None")
    for problem in _problems():
        made = _run(algorithm, problem).seen[-1].iteration
        within = most is None or made <= most
        require(within, f"it says most_maps = {most}, and has made {made} iterations")


def starts_are_taken(algorithm: type[Searcher]) -> None:
    """With ``warm``, answer a problem that has maps to start with like any other."""
    require_applicable(algorithm().warm, "it says warm = False")
    for problem in _partial_problems():
        partners = np.arange(problem.table.template_objects)
        partners[-1] = -1
        started = replace(problem, start=(sealed(partners),))
        for progress in run(algorithm(), started).seen:
            _legal(progress.fmap, started.table)
            _scored(progress, started)


def evidence_is_weighed(algorithm: type[Searcher]) -> None:
    """Take table.entry_evidence for σ, or say object_consistent = False."""
    require_applicable(algorithm().object_consistent, _OF_PAIRS)
    for progress in run(algorithm(), _problem_with_evidence()).seen:
        _scored(progress, _problem_with_evidence())


def rotations_are_weighed(algorithm: type[Searcher]) -> None:
    """Let the rotation of each template pair count for its weight, as table.cosine does."""
    for progress in run(algorithm(), _problem_with_rotation_weights()).seen:
        _scored(progress, _problem_with_rotation_weights())


def odd_problems_are_solved(algorithm: type[Searcher]) -> None:
    """Search two objects, two among many, alike relations and zero weights like any others."""
    for what, problem in _odd_problems().items():
        try:
            for progress in run(algorithm(), problem).seen:
                _legal(progress.fmap, problem.table)
                _scored(progress, problem)
        except BrokenError as broken:
            raise BrokenError(f"with {what}, {broken}") from None
        except Exception as error:
            raise BrokenError(f"with {what}, it raised {type(error).__name__}: {error}") from error


def randomness_is_the_generators(algorithm: type[Searcher]) -> None:
    """Draw from the generator given alone, not from np.random or random."""
    before = _global_states()
    run(algorithm(), _problems()[0])
    moved = [name for name, state in _global_states().items() if state != before[name]]
    require(not moved, f"it drew from the global generator of {' and '.join(moved)}")


def clock_plays_no_part(algorithm: type[Searcher]) -> None:
    """Find the same, without a time budget, when the clock goes a hundred times as fast."""
    for problem in _problems():
        usual = run(algorithm(), problem).answer
        repeats = usual == _run(algorithm, problem).answer
        require_applicable(repeats, "two runs by the same clock differ already")
        with _hurried_clock():
            hurried = run(algorithm(), problem).answer
        require(hurried == usual, "it found another answer, or after other iterations")


def yields_come_promptly(algorithm: type[Searcher]) -> None:
    """Yield every 50 ms or so; half a second, for 12 on 14 objects, is too long."""
    algorithm.warm_up()
    gap = _least(lambda: max(_gaps(algorithm)), _LONGEST_STEP)
    require(gap <= _LONGEST_STEP, f"it took {gap:.2f} s from one yield to the next")


def closing_ends_the_search(algorithm: type[Searcher]) -> None:
    """End within 0.1 s when closed after any yield, and leave no thread."""
    algorithm.warm_up()
    for after in (1, 2, 3, 5, 8):
        known = set(threading.enumerate())
        took = _least(partial(_closed, algorithm, after), _LONGEST_END)
        require(took <= _LONGEST_END, f"closing it after yield {after} took {took:.2f} s")
        left = [thread for thread in threading.enumerate() if thread not in known]
        for thread in left:
            thread.join(_LONGEST_END)
        alive = [thread.name for thread in left if thread.is_alive()]
        require(not alive, f"closed after yield {after}, it left thread {', '.join(alive)} running")


def _uses() -> Iterator[Use]:
    for seed in (1, 2):
        table = random_relations(np.random.default_rng(seed), 4, 6)
        similarity, rotation = view_within(table.similarity), view_within(table.rotation)
        dilation = view_within(table.dilation)
        own = RelationTable(similarity, rotation, dilation, 4, 6)  # it holds these, and no copies
        problem = posed(own, (1.0, 2.0, 0.5), alternatives=2)
        inputs = {f"table.{name}": getattr(own, name) for name in _ARRAYS}
        yield Use("a problem of 4 on 6 objects", inputs, partial(_answer, problem))


def _answer(problem: MatchProblem, searcher: Searcher) -> Hashable:
    return run(searcher, problem).answer


CONTRACTS: tuple[Contract, ...] = (
    search_returns_a_generator,
    search_yields_progress,
    search_returns_an_outcome,
    fmaps_are_legal,
    alternatives_are_legal,
    confidence_is_zeta,
    confidence_never_falls,
    upper_bound_is_true,
    upper_bound_never_rises,
    optimal_is_optimal,
    object_maps_are_kept_to,
    maps_beside_are_possible,
    iterations_are_no_more_than_maps,
    starts_are_taken,
    evidence_is_weighed,
    rotations_are_weighed,
    odd_problems_are_solved,
    randomness_is_the_generators,
    clock_plays_no_part,
    yields_come_promptly,
    closing_ends_the_search,
    *contracts_of_use(_uses),
)


@lru_cache(maxsize=1)
def _problems() -> tuple[MatchProblem, ...]:
    rng = np.random.default_rng(6)
    return (
        posed(random_relations(rng, 4, 6), alternatives=2),
        posed(random_relations(rng, 5, 5), (1.0, 2.0, 0.5), alternatives=2),
    )


@lru_cache(maxsize=1)
def _partial_problems() -> tuple[MatchProblem, ...]:
    drawn, _ = matching_problem(np.random.default_rng(12), 7, missing=2, extra=1)
    drawn = replace(drawn, partial=True, alternatives=3)
    table = drawn.table
    allowed = np.ones((table.template_objects, table.argument_objects), dtype=bool)
    allowed[0], allowed[1:, 2] = np.arange(table.argument_objects) == 2, False
    pinned = np.where(np.arange(table.template_objects) == 0, 2, -1)
    return drawn, replace(drawn, allowed=sealed(allowed), pinned=sealed(pinned))


@lru_cache(maxsize=1)
def _problem_with_evidence() -> MatchProblem:
    rng = np.random.default_rng(9)
    table = random_relations(rng, 4, 5)
    evidence = rng.uniform(0.0, 1.0, (table.template_pairs, 2 * table.argument_pairs))
    return posed(replace(table, evidence=evidence), alternatives=2)


@lru_cache(maxsize=1)
def _problem_with_rotation_weights() -> MatchProblem:
    table = random_relations(np.random.default_rng(10), 4, 5)
    weights = np.linspace(0.2, 3.0, table.template_pairs)
    return posed(replace(table, rotation_weights=weights), alternatives=2)


def _odd_problems() -> dict[str, MatchProblem]:
    rng = np.random.default_rng(7)
    usual = random_relations(rng, 4, 5)
    return {
        "2 on 2 objects": posed(random_relations(rng, 2, 2)),
        "2 on 5 objects": posed(random_relations(rng, 2, 5), alternatives=2),
        "3 on 3 objects": posed(random_relations(rng, 3, 3), alternatives=9),
        "equal relations": posed(_alike(4, 5, 0.5)),
        "σ = 0 throughout": posed(_alike(4, 4, 0.0)),
        "σ = 1 throughout": posed(_alike(3, 5, 1.0)),
        "weights 1, 0, 0": posed(usual, (1.0, 0.0, 0.0)),
        "weights 0, 1, 0": posed(usual, (0.0, 1.0, 0.0)),
        "weights 0, 0, 1": posed(usual, (0.0, 0.0, 1.0)),
    }


def _alike(template_objects: int, argument_objects: int, sigma: float) -> RelationTable:
    shape = (pair_count(template_objects), pair_count(argument_objects))
    return RelationTable(
        np.full(shape, sigma), np.zeros(shape), np.ones(shape), template_objects, argument_objects
    )


@lru_cache(maxsize=8)
def _run(algorithm: type[Searcher], problem: MatchProblem) -> Run:
    return run(algorithm(), problem)


@lru_cache(maxsize=8)
def _best(problem: MatchProblem) -> float:
    return best_object_map(problem.table, problem.weights)[0]


def _bounds(found: Run) -> list[float]:
    return [p.upper_bound for p in found.seen if p.upper_bound is not None]


def _legal(fmap: Fmap, table: RelationTable) -> None:
    entries = fmap.entries
    pairs, most = table.template_pairs, 2 * table.argument_pairs
    require(entries.shape == (pairs,), f"an FMAP has shape {entries.shape} for {pairs} pairs")
    inside = (entries >= 0) & (entries < most)
    require(inside.all(), f"an FMAP has an entry outside 0 … {most - 1}: {entries.tolist()}")
    require(is_legal(fmap, table), f"an FMAP uses a pair or its dual twice: {entries.tolist()}")


def _scored(progress: SearchProgress, problem: MatchProblem) -> None:
    zeta = score_fmap(progress.fmap, problem.table, problem.weights).total
    claimed = progress.confidence
    require(abs(claimed - zeta) <= _CLOSE, f"it claims ζ = {claimed:.9f} where it is {zeta:.9f}")


def _global_states() -> dict[str, Any]:
    state = np.random.get_state(legacy=False)  # noqa: NPY002 - it is what is watched
    return {"np.random": repr(state), "random": random.getstate()}


@contextmanager
def _hurried_clock() -> Iterator[None]:
    with ExitStack() as stack:
        for name in ("monotonic", "perf_counter", "time", "process_time"):
            stack.enter_context(mock.patch.object(time, name, _hurried(getattr(time, name))))
        yield


def _hurried(clock: Callable[[], float]) -> Callable[[], float]:
    start = clock()
    return lambda: start + _HURRY * (clock() - start)


def _least(measure: Callable[[], float], limit: float) -> float:
    """Measure again, some times, while it is beyond a limit: the machine may have been busy."""
    least = math.inf
    for _ in range(_ATTEMPTS):
        least = min(least, measure())
        if least <= limit:
            break
    return least


def _gaps(algorithm: type[Searcher]) -> Iterator[float]:
    """Yield the times between the first yields of a search."""
    work = algorithm().search(large_problem(), np.random.default_rng(0))
    begun = before = perf_counter()
    for _ in work:
        now = perf_counter()
        yield now - before
        if now - begun > _WATCHED:
            break
        before = now
    work.close()


def _closed(algorithm: type[Searcher], after: int) -> float:
    """Return how long it takes to close a search after so many yields."""
    work = algorithm().search(large_problem(), np.random.default_rng(0))
    for _ in range(after):
        if next(work, None) is None:
            break
    begun = perf_counter()
    work.close()
    return perf_counter() - begun
