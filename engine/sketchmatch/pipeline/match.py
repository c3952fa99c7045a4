"""One match from two sources to a result, as a stream of events."""

from __future__ import annotations

import math
import time
import uuid
from collections.abc import Generator, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType
from typing import TypeVar

import numpy as np

from sketchmatch.api import (
    Algorithm,
    MatchProblem,
    Outcome,
    Searcher,
    SearchProgress,
    Segmentation,
    Segmenter,
)
from sketchmatch.errors import AnswerUnavailableError, InvalidInputError, Reason
from sketchmatch.kernels.evidence import SelfRelations
from sketchmatch.model import (
    ConfidenceWeights,
    RelationTable,
    RequestWeights,
    Scene,
    SceneDescriptor,
    Source,
)
from sketchmatch.pipeline import reading
from sketchmatch.pipeline.alternatives import best_others, exchange_confidences, partner_margins
from sketchmatch.pipeline.correspond import (
    fmap_confidence,
    global_dilation,
    global_rotation,
    object_map,
    occm,
)
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.evidence import compare_objects, weigh_objects
from sketchmatch.pipeline.limits import check_comparisons, check_histograms
from sketchmatch.pipeline.plugins import blaming, checked_progress, inspecting, segmented
from sketchmatch.pipeline.relate import check_exponent, relate
from sketchmatch.pipeline.result import (
    AlternativeMap,
    MatchResult,
    ObjectMatch,
    Statistics,
)
from sketchmatch.pipeline.selection import UNCONFIGURED, Defaults, Pipeline, Selection, resolve
from sketchmatch.pipeline.words import nearest_relations
from sketchmatch.registry import Registry

__all__ = [
    "Accepted",
    "Finished",
    "MatchEvent",
    "MatchRequest",
    "Phase",
    "Progress",
    "Segmented",
    "run_match",
]

_PROGRESS_EVERY = 0.05
_MAX_SEED = 2**64 - 1
_MAX_WEIGHT = 1e6
_MAX_ALTERNATIVES = 100
_ALTERNATIVES = 3
_Value = TypeVar("_Value")


class Phase(StrEnum):
    """What a match is doing; the same names as ``sketchmatch.v1.Phase``."""

    SEGMENT = "SEGMENT"
    DESCRIBE = "DESCRIBE"
    RELATE = "RELATE"
    SEARCH = "SEARCH"


@dataclass(frozen=True)
class MatchRequest:
    """What to match, and how.

    Attributes
    ----------
    sketch, map
        Sources, or scenes that need no segmentation.
    selection
        Algorithms and parameters, by stage.
    seed
        0 … 2⁶⁴−1; the same request with the same seed gives the same result.
    time_budget
        Seconds after which the best answer so far is given, or None for no limit.
    weights
        Of ζσ, ζR and ζL in ζ, and of ζS and ζM where there are five.
    alternatives
        How many of the next best object maps the result shall hold; None for 3, or as many as
        there are.
    profile
        Name of the profile to take the rest from; empty for the default one.
    """

    sketch: Source | Scene
    map: Source | Scene
    selection: Selection = field(default_factory=lambda: MappingProxyType({}))
    seed: int = 0
    time_budget: float | None = None
    weights: RequestWeights = (1.0, 1.0, 1.0)
    alternatives: int | None = None
    profile: str = ""

    def __post_init__(self) -> None:
        if not (isinstance(self.seed, int) and 0 <= self.seed <= _MAX_SEED):
            raise InvalidInputError(
                Reason.INVALID_FIELD, "seed", f"is {self.seed}; give an integer 0 … 2**64 − 1"
            )
        if self.time_budget is not None and not 0 < self.time_budget < math.inf:
            raise InvalidInputError(
                Reason.INVALID_FIELD,
                "time_budget",
                f"is {self.time_budget:g} s; give a positive time or none at all",
            )
        names = ConfidenceWeights._fields
        if len(self.weights) not in (3, len(names)):
            raise InvalidInputError(
                Reason.INVALID_FIELD,
                "weights",
                f"are {len(self.weights)} numbers; give three, {', '.join(names[:3])}, "
                f"or five, with {' and '.join(names[3:])}",
            )
        for name, weight in zip(names, self.weights, strict=False):
            if not 0 <= weight <= _MAX_WEIGHT:
                raise InvalidInputError(
                    Reason.INVALID_FIELD,
                    f"weights.{name}",
                    f"is {weight:g}; give a number from 0 to {_MAX_WEIGHT:g}",
                )
        if self.alternatives is not None and not 0 <= self.alternatives <= _MAX_ALTERNATIVES:
            raise InvalidInputError(
                Reason.INVALID_FIELD,
                "alternatives",
                f"is {self.alternatives}; give a number from 0 to {_MAX_ALTERNATIVES}",
            )
        if sum(self.weights) == 0:
            raise InvalidInputError(
                Reason.INVALID_FIELD, "weights", "are all zero; give at least one above zero"
            )

    @property
    def confidence_weights(self) -> ConfidenceWeights:
        """The weights by name, all five."""
        return ConfidenceWeights(*self.weights)


@dataclass(frozen=True)
class Accepted:
    """The request is sound and work begins."""

    match_id: str
    seed: int
    pipeline: Pipeline


@dataclass(frozen=True)
class Segmented:
    """Both scenes are known."""

    sketch: Segmentation
    map: Segmentation


@dataclass(frozen=True)
class Progress:
    """Where a match stands.

    Attributes
    ----------
    phase
        What it is doing.
    elapsed
        Seconds since it was accepted.
    fraction
        Share of the phase that is done, where known.
    iteration, evaluations, confidence, upper_bound
        The search so far, as in :class:`~sketchmatch.api.SearchProgress`.
    matches
        The object map that follows from its best FMAP, as in the result.
    """

    phase: Phase
    elapsed: float
    fraction: float | None = None
    iteration: int = 0
    evaluations: int = 0
    confidence: float | None = None
    upper_bound: float | None = None
    matches: tuple[ObjectMatch, ...] = ()

    @property
    def object_map(self) -> dict[int, int]:
        """Sketch index → map index of the best map so far; empty before the search."""
        return {match.sketch_object: match.map_object for match in self.matches}


@dataclass(frozen=True)
class Finished:
    """The end of a match."""

    result: MatchResult


MatchEvent = Accepted | Segmented | Progress | Finished


def run_match(
    request: MatchRequest, registry: Registry, defaults: Defaults = UNCONFIGURED
) -> Generator[MatchEvent, None, None]:
    """Match, yielding Accepted, Segmented, some Progress (at most 20 a second) and Finished.

    Closing the generator stops the work; between two events it works 50 ms or less, but for a
    plugin that is slower in one step.

    Raises
    ------
    InvalidInputError
        If the request cannot be used.
    AnswerUnavailableError
        If the time budget ends before there is any answer.
    PluginError
        If a plugin breaks its contract.
    """
    return _Match(request, registry, defaults).run()


class _Match:
    """The state of one running match."""

    def __init__(self, request: MatchRequest, registry: Registry, defaults: Defaults) -> None:
        self.request = request
        self.registry = registry
        self.match_id = uuid.uuid4().hex
        self.started = time.monotonic()
        self.reported = -math.inf
        self.seconds: dict[str, float] = {}
        try:
            self.pipeline = resolve(
                registry,
                request.selection,
                None if isinstance(request.sketch, Scene) else request.sketch,
                None if isinstance(request.map, Scene) else request.map,
                defaults,
                request.profile,
            )
        except InvalidInputError as error:
            raise error.within("pipeline") from None
        self.weights = request.confidence_weights
        _check_weights(self.weights, self.pipeline.searcher)
        self.own: SelfRelations | None = None

    def run(self) -> Generator[MatchEvent, None, None]:
        yield Accepted(self.match_id, self.request.seed, self.pipeline)
        if self.may_report():
            yield Progress(Phase.SEGMENT, self.reported - self.started)
        with self.timed("segment"):
            sketch = self.segmented("sketch", self.request.sketch, self.pipeline.sketch_segmenter)
            self.check_budget(Phase.SEGMENT)
            map_ = self.segmented("map", self.request.map, self.pipeline.map_segmenter)
        check_histograms("sketch", sketch.scene, self.pipeline.histogram)
        check_histograms("map", map_.scene, self.pipeline.histogram)
        check_comparisons(sketch.scene, map_.scene)
        check_exponent(self.pipeline.histogram.exponent)
        yield Segmented(sketch, map_)
        count = _alternatives_wanted(self.request.alternatives, sketch.scene, map_.scene)
        exchanged = len(sketch.scene) > len(map_.scene)
        with self.timed("describe"):
            drawn = yield from self.described("sketch", sketch.scene)
            mapped = yield from self.described("map", map_.scene)
        scenes, descriptors = (sketch.scene, map_.scene), (drawn, mapped)
        with self.timed("relate"):
            if exchanged:
                scenes, descriptors = scenes[::-1], descriptors[::-1]
            table = yield from self.related(scenes, descriptors)
        with self.timed("search"):
            found, outcome = yield from self.search(table, exchanged, count)
        yield Finished(self.result(sketch, map_, drawn, table, exchanged, found, outcome, count))

    def described(self, side: str, scene: Scene) -> Generator[MatchEvent, None, SceneDescriptor]:
        """Return the histograms of one side."""
        histogram = self.pipeline.histogram
        try:
            work = describe(scene, histogram)
            with inspecting(histogram, self.registry, scene):
                return (yield from self.watched(Phase.DESCRIBE, histogram, work))
        except InvalidInputError as error:
            raise error.within(side) from None

    def related(
        self, scenes: tuple[Scene, Scene], descriptors: tuple[SceneDescriptor, SceneDescriptor]
    ) -> Generator[MatchEvent, None, RelationTable]:
        """Return the relations of template and argument, and the evidence that is asked for."""
        similarity = self.pipeline.similarity
        comparing = relate(*descriptors, similarity)
        if not self.weights.of_objects:
            return (yield from self.watched(Phase.RELATE, similarity, comparing))
        table = yield from self.watched(Phase.RELATE, similarity, comparing, (0.0, 0.4))
        directions = self.pipeline.histogram.params.directions
        work = compare_objects(*scenes, directions)
        self.own = yield from self.watched(Phase.RELATE, None, work, (0.4, 0.5))
        weighing = weigh_objects(table, self.own, self.weights)
        return (yield from self.watched(Phase.RELATE, None, weighing, (0.5, 1.0)))

    def segmented(
        self, side: str, source: Source | Scene, segmenter: Segmenter | None
    ) -> Segmentation:
        """Return the objects of one side."""
        if isinstance(source, Scene):
            return Segmentation(source)
        assert segmenter is not None
        return segmented(source, segmenter, self.registry, f"{side}.{source.field}")

    def watched(
        self,
        phase: Phase,
        algorithm: Algorithm | None,
        work: Generator[float, None, _Value],
        part: tuple[float, float] = (0.0, 1.0),
    ) -> Generator[MatchEvent, None, _Value]:
        """Run a part of a phase, maybe an algorithm's, to its end, passing its progress on."""
        begin, end = part
        while True:
            self.check_budget(phase)
            with blaming(algorithm, self.registry) if algorithm else nullcontext():
                try:
                    fraction = next(work)
                except StopIteration as stop:
                    return stop.value  # type: ignore[no-any-return]
            if self.may_report():
                done = begin + (end - begin) * fraction
                yield Progress(phase, self.reported - self.started, done)

    def search(
        self, table: RelationTable, exchanged: bool, count: int
    ) -> Generator[MatchEvent, None, tuple[SearchProgress, Outcome]]:
        """Run the searcher until it ends or the time budget does."""
        searcher = self.pipeline.searcher
        budget = self.request.time_budget
        left = None if budget is None else max(0.0, budget - self.elapsed())
        problem = MatchProblem(table, self.weights.searched, count, left)
        best: SearchProgress | None = None
        with self.searching(searcher, problem) as work:
            while True:
                with blaming(searcher, self.registry):
                    try:
                        best = checked_progress(next(work), problem, best)
                    except StopIteration as stop:
                        if best is None:
                            raise ValueError("it ended without any answer") from None
                        return best, Outcome(stop.value or Outcome.CONVERGED)
                if self.out_of_time():
                    return best, Outcome.TIME_BUDGET
                if self.may_report():
                    mapped = object_map(occm(best.fmap, table))
                    yield Progress(
                        Phase.SEARCH,
                        self.reported - self.started,
                        iteration=best.iteration,
                        evaluations=best.evaluations,
                        confidence=best.confidence,
                        upper_bound=best.upper_bound,
                        matches=reading.matches(mapped, exchanged),
                    )

    @contextmanager
    def searching(
        self, searcher: Searcher, problem: MatchProblem
    ) -> Iterator[Generator[SearchProgress, None, Outcome]]:
        """Start a search, and stop it in the end."""
        with blaming(searcher, self.registry):
            work = searcher.search(problem, np.random.default_rng(self.request.seed))
            if not isinstance(work, Generator):
                raise TypeError(f"its search is a {type(work).__name__}, not a generator")
        with inspecting(searcher, self.registry, problem.table):
            try:
                yield work
            finally:
                with blaming(searcher, self.registry):
                    work.close()

    def result(
        self,
        sketch: Segmentation,
        map_: Segmentation,
        drawn: SceneDescriptor,
        table: RelationTable,
        exchanged: bool,
        found: SearchProgress,
        outcome: Outcome,
        count: int,
    ) -> MatchResult:
        """Read what was found from sketch to map; ``drawn`` describes the sketch."""
        weights = self.weights.searched
        mapped = object_map(occm(found.fmap, table))
        best = fmap_confidence(found.fmap, table, weights, self.own)
        exchanges = exchange_confidences(mapped, table, weights)
        others = best_others(mapped, found.alternatives, exchanges, table, weights, count, self.own)
        margins = partner_margins(mapped, best.total, others, exchanges)
        matched = mapped.partners.tolist() if exchanged else range(len(mapped.partners))
        relations = nearest_relations(sketch.scene, drawn, matched)
        rotation = global_rotation(found.fmap, table)
        dilation = global_dilation(found.fmap, table)
        bound = found.upper_bound
        if bound is not None:
            bound = max(bound, best.total)  # ζ was taken anew, and may differ by rounding
        self.seconds["total"] = self.elapsed()
        return MatchResult(
            matches=reading.matches(mapped, exchanged, margins, relations),
            omap_confidence=mapped.confidence,
            confidence=best,
            fmap=reading.correspondences(found.fmap, table, exchanged),
            rotation=reading.half_turned(-rotation if exchanged else rotation),
            scale=1.0 / dilation if exchanged else dilation,
            outcome=outcome,
            upper_bound=bound,
            seed=self.request.seed,
            match_id=self.match_id,
            statistics=Statistics(
                found.iteration, found.evaluations, MappingProxyType(self.seconds)
            ),
            sketch=sketch.scene,
            map=map_.scene,
            warnings=(
                *(f"sketch: {warning}" for warning in sketch.warnings),
                *(f"map: {warning}" for warning in map_.warnings),
            ),
            alternatives=tuple(
                AlternativeMap(
                    reading.matches(other.mapped, exchanged),
                    other.confidence,
                    other.mapped.confidence,
                )
                for other in others
            ),
            search_note=found.note,
            sketch_route=sketch.route,
        )

    def elapsed(self) -> float:
        return time.monotonic() - self.started

    def out_of_time(self) -> bool:
        budget = self.request.time_budget
        return budget is not None and self.elapsed() > budget

    def check_budget(self, phase: Phase) -> None:
        if self.out_of_time():
            raise AnswerUnavailableError(
                f"the time budget of {self.request.time_budget:g} s ended in phase "
                f"{phase.lower()}, before there was any answer; "
                "allow more time or match fewer objects"
            )

    def may_report(self) -> bool:
        """Whether enough time has passed since the last progress was reported."""
        now = time.monotonic()
        if now - self.reported < _PROGRESS_EVERY:
            return False
        self.reported = now
        return True

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        started = time.monotonic()
        yield
        self.seconds[stage] = time.monotonic() - started


def _check_weights(weights: ConfidenceWeights, searcher: Searcher) -> None:
    """Refuse to compare objects where the search compares nothing but pairs."""
    if weights.of_objects and not searcher.object_consistent:
        name = "shape" if weights.shape > 0 else "size"
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            f"weights.{name}",
            f"compares objects, and the searcher {searcher.name!r}, as it is set here, maps pairs "
            "that need not lead to one map of objects; choose another, such as 'auto', or weight 0",
        )


def _alternatives_wanted(requested: int | None, sketch: Scene, map_: Scene) -> int:
    """Return how many object maps beside the best there shall be."""
    few, many = sorted((len(sketch), len(map_)))
    there_are = math.perm(many, few) - 1
    if requested is None:
        return min(_ALTERNATIVES, there_are)
    if requested > there_are:
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            "alternatives",
            f"is {requested}, but {few} objects in {many} have {there_are} other maps; "
            "ask for no more",
        )
    return requested
