"""One match from two sources to a result, as a stream of events: each step in turn."""

from __future__ import annotations

import math
import uuid
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, replace
from typing import TypeVar

from sketchmatch.api import Segmentation
from sketchmatch.errors import InvalidInputError
from sketchmatch.model import ConfidenceWeights, Scene
from sketchmatch.model.limits import SourceLimits, limited_to, source_limits
from sketchmatch.pipeline import reading
from sketchmatch.pipeline.answer import answer
from sketchmatch.pipeline.clock import Clock
from sketchmatch.pipeline.compare import Comparison, check_scenes, compare, is_swapped
from sketchmatch.pipeline.cuts import Fit, fitting_cut, groups_of
from sketchmatch.pipeline.describe import described, with_directions
from sketchmatch.pipeline.events import (
    Accepted,
    Finished,
    MatchEvent,
    Phase,
    Progress,
    Segmented,
)
from sketchmatch.pipeline.former import starts
from sketchmatch.pipeline.judge import judged
from sketchmatch.pipeline.knowledge import check_pins_obeyed, knowledge
from sketchmatch.pipeline.memory import Memory
from sketchmatch.pipeline.relate import check_exponent
from sketchmatch.pipeline.request import (
    MatchRequest,
    alternatives_wanted,
    check_objects_weighed,
    finds_partial,
    price_in_force,
)
from sketchmatch.pipeline.result import MatchResult, Statistics
from sketchmatch.pipeline.search import Goal, Search, search
from sketchmatch.pipeline.segment import cuts_of_side
from sketchmatch.pipeline.selection import UNCONFIGURED, Defaults, Pipeline, resolve
from sketchmatch.pipeline.slices import retold
from sketchmatch.pipeline.warmup import loading_kernels
from sketchmatch.registry import Kind, Registry

__all__ = ["Check", "run_match", "unchecked"]

_Value = TypeVar("_Value")

Check = Callable[[Pipeline, tuple[Scene, Scene] | None], None]
"""Raises where algorithms, or these and the scenes that they are to compare, are too much."""

_AMPLE = 10.0
"""Of the time that finding objects takes: what must be left for trying other cuts of them."""

_MOST_CUTS = 12
"""Cuts of a side that are asked for."""


def unchecked(pipeline: Pipeline, scenes: tuple[Scene, Scene] | None) -> None:
    """Let everything pass."""


def run_match(
    request: MatchRequest,
    registry: Registry,
    defaults: Defaults = UNCONFIGURED,
    limits: SourceLimits | None = None,
    match_id: str = "",
    clock: Clock | None = None,
    memory: Memory | None = None,
    check: Check = unchecked,
) -> Generator[MatchEvent, None, None]:
    """Match, yielding Accepted, Segmented, some Progress (at most 20 a second) and Finished.

    Closing the generator stops the work; between two events it works 50 ms or less, but for a
    plugin that is slower in one step, and for kernels that have to be compiled. These are compiled
    before the time budget begins.

    Parameters
    ----------
    request
        What to match.
    registry, defaults
        The algorithms at hand, and what a configuration says of them.
    limits
        How large sources may be; None for those in force.
    match_id
        A name that is unique to the match; one is made where it is empty.
    clock
        With the request's time budget, for whoever may have to curtail it; one is made where there
        is none.
    memory
        What of the scenes need not be described again; None where nothing is remembered.
    check
        Asked at once, before there are scenes, and again before any are compared.

    Raises
    ------
    InvalidInputError
        If the request cannot be used: at once if its choices cannot.
    AnswerUnavailableError
        If the time budget ends before there is any answer.
    PluginError
        If a plugin breaks its contract.
    """
    clock = clock or Clock(request.time_budget)
    plan = _planned(request, registry, defaults, check)
    check(plan.pipeline, None)
    name = match_id or uuid.uuid4().hex
    return _events(request, plan, registry, limits or source_limits(), name, clock, memory)


@dataclass(frozen=True)
class _Plan:
    """The choices of a request, set up.

    Attributes
    ----------
    pipeline
        The algorithms.
    goal
        What is sought, but for how many alternatives: that depends on the scenes.
    usual
        As in :class:`~sketchmatch.api.JudgeProblem`.
    check
        As for :func:`run_match`.
    """

    pipeline: Pipeline
    goal: Goal
    usual: bool
    check: Check


def _planned(request: MatchRequest, registry: Registry, defaults: Defaults, check: Check) -> _Plan:
    try:
        pipeline = resolve(
            registry,
            request.selection,
            None if isinstance(request.sketch, Scene | Segmentation) else request.sketch,
            None if isinstance(request.map, Scene | Segmentation) else request.map,
            defaults,
            request.profile,
        )
    except InvalidInputError as error:
        raise error.within("pipeline") from None
    profile = defaults.named(request.profile)
    weights = ConfidenceWeights(*(request.weights or profile.weights or ()))
    check_objects_weighed(weights, pipeline.searcher)
    check_pins_obeyed(request.pins, pipeline.searcher)
    price = price_in_force(request, profile, weights, pipeline, registry)
    goal = Goal(weights, price, seed=request.seed, at_once=finds_partial(pipeline, registry))
    return _Plan(pipeline, goal, _is_usual(pipeline, registry), check)


def _is_usual(pipeline: Pipeline, registry: Registry) -> bool:
    """Whether relations and maps are of the kind that judges learn from."""
    return (
        pipeline.similarity.name == registry.default(Kind.SIMILARITY)
        and not pipeline.histogram.exponent
        and pipeline.searcher.object_consistent
    )


def _events(
    request: MatchRequest,
    plan: _Plan,
    registry: Registry,
    limits: SourceLimits,
    match_id: str,
    clock: Clock,
    memory: Memory | None,
) -> Generator[MatchEvent, None, None]:
    """Do what is planned."""
    pipeline, goal = plan.pipeline, plan.goal
    price = goal.price if goal.price < math.inf else None
    yield Accepted(match_id, goal.seed, pipeline, goal.weights, price)
    with clock.stopped():
        for _ in loading_kernels(pipeline):
            if clock.is_time_to_tell():
                yield Progress(Phase.COMPILE, clock.elapsed())
    if clock.is_time_to_tell():
        yield Progress(Phase.SEGMENT, clock.elapsed())
    # What is known of single objects is known of those of the first cut; and where each object must
    # have a partner, none is left that may be part of another.
    is_open = price is not None and not request.pins and request.former is None
    with clock.timing("segment"), limited_to(limits):
        cuts = [
            cuts_of_side("sketch", request.sketch, pipeline, registry),
            cuts_of_side("map", request.map, pipeline, registry),
        ]
        sketch = next(cuts[0])
        if memory is not None and not isinstance(request.sketch, Scene | Segmentation):
            sketch = replace(sketch, scene=memory.met(sketch.scene))
        clock.check(Phase.SEGMENT)
        map_ = next(cuts[1])
        drawn, mapped = [sketch], [map_]
        for side, others in ((drawn, cuts[0]), (mapped, cuts[1])):
            while is_open and len(side) < _MOST_CUTS and clock.left() > _AMPLE * clock.spent():
                cut = next(others, None)
                if cut is None:
                    break
                side.append(cut)
    remembered = Memory()

    def matched(sketch: Segmentation, map_: Segmentation) -> Generator[MatchEvent, None, None]:
        return _matched(request, plan, (sketch, map_), registry, match_id, clock, remembered)

    if len(drawn) + len(mapped) > 2:
        fit = yield from fitting_cut(drawn, mapped, matched, clock)
        yield Segmented(fit.sketch, fit.map)
    else:
        work = _matched(request, plan, (sketch, map_), registry, match_id, clock, memory)
        fit = Fit(sketch, map_, (yield from _but_the_end(work)))
    result = fit.result
    if is_open:
        groups = yield from groups_of(fit, matched, clock)
        result = replace(result, groups=groups, statistics=_as_of_now(result.statistics, clock))
    yield Finished(result)


def _but_the_end(
    work: Generator[MatchEvent, None, None],
) -> Generator[MatchEvent, None, MatchResult]:
    """Go on with a match to its end, yielding all but that, and return what came of it."""
    results: list[MatchResult] = []

    def tell(event: MatchEvent) -> Iterator[MatchEvent]:
        if isinstance(event, Finished):
            results.append(event.result)
        else:
            yield event

    yield from retold(work, tell)
    return results[0]


def _matched(
    request: MatchRequest,
    plan: _Plan,
    sides: tuple[Segmentation, Segmentation],
    registry: Registry,
    match_id: str,
    clock: Clock,
    memory: Memory | None,
) -> Generator[MatchEvent, None, None]:
    """Match two scenes, from Segmented to Finished."""
    pipeline, goal = plan.pipeline, plan.goal
    sketch, map_ = sides
    scenes = (sketch.scene, map_.scene)
    check_scenes(scenes, pipeline.histogram)
    check_exponent(pipeline.histogram.exponent)
    pipeline = replace(pipeline, histogram=with_directions(pipeline.histogram, registry, *scenes))
    plan.check(pipeline, scenes)
    yield Segmented(sketch, map_)
    shown = alternatives_wanted(request.alternatives, *scenes)
    # How likely the answer is follows from maps that compete with it, seen or not.
    wanted = max(shown, alternatives_wanted(None, *scenes))
    goal = replace(goal, alternatives=wanted, shown=shown)
    partial = goal.price < math.inf
    known = knowledge(request.pins, request.synonyms, scenes, is_swapped(*scenes), partial)
    goal = replace(goal, allowed=known.allowed, pinned=known.pinned, names=known.names)
    if request.former is not None and pipeline.searcher.warm:
        start = starts(request.former, sketch.scene, len(map_.scene), is_swapped(*scenes))
        goal = replace(goal, start=start, elsewhere=request.former.elsewhere if start else None)
    comparison = yield from _compared(scenes, pipeline, goal.weights, registry, clock, memory)
    with clock.timing("search"):
        work = search(comparison, pipeline.searcher, goal, registry, clock)
        found = yield from _watched_search(work, comparison.swapped, clock)
        judging = judged(comparison, found, goal, pipeline.judge, registry, plan.usual, clock)
        verdict = yield from retold(judging, lambda _: _told(found, comparison.swapped, clock))
    yield Finished(answer(comparison, found, verdict, goal, sides, match_id, clock))


def _as_of_now(so_far: Statistics, clock: Clock) -> Statistics:
    """Return what a match took, with what was tried after it."""
    return replace(so_far, seconds={**clock.seconds, "total": clock.spent()})


def _compared(
    scenes: tuple[Scene, Scene],
    pipeline: Pipeline,
    weights: ConfidenceWeights,
    registry: Registry,
    clock: Clock,
    memory: Memory | None,
) -> Generator[MatchEvent, None, Comparison]:
    """Describe both scenes and compare them."""
    histogram = pipeline.histogram
    with clock.timing("describe"):
        drawn = yield from _watched(
            described(scenes[0], histogram, registry, "sketch", memory), Phase.DESCRIBE, clock
        )
        mapped = yield from _watched(
            described(scenes[1], histogram, registry, "map", memory), Phase.DESCRIBE, clock
        )
    with clock.timing("relate"):
        work = compare(scenes, (drawn, mapped), pipeline.similarity, registry, weights, memory)
        return (yield from _watched(work, Phase.RELATE, clock))


def _watched(
    work: Generator[float, None, _Value], phase: Phase, clock: Clock
) -> Generator[MatchEvent, None, _Value]:
    """Go on with a phase to its end, or that of the time, passing its progress on."""

    def tell(share: float) -> Iterator[Progress]:
        if clock.is_time_to_tell():
            yield Progress(phase, clock.elapsed(), share)
        clock.check(phase)

    clock.check(phase)
    return retold(work, tell)


def _watched_search(
    work: Generator[Search, None, Search], swapped: bool, clock: Clock
) -> Generator[MatchEvent, None, Search]:
    """Go on with a search to its end, passing on what it has come to."""
    return retold(work, lambda so_far: _told(so_far, swapped, clock))


def _told(so_far: Search, swapped: bool, clock: Clock) -> Iterator[Progress]:
    """Tell what a search has come to, if it is time to."""
    if not clock.is_time_to_tell():
        return
    best = so_far.best
    progress = Progress(
        Phase.SEARCH,
        clock.elapsed(),
        iteration=so_far.iterations,
        evaluations=so_far.evaluations,
    )
    if not best.obeys:  # and what is ruled out is not shown
        yield progress
        return
    yield replace(
        progress,
        confidence=best.best.confidence,
        upper_bound=best.best.upper_bound,
        matches=reading.matches(best.mapped, swapped, best.part.kept),
    )
