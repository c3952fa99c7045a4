"""One match from two sources to a result, as a stream of events."""

from __future__ import annotations

import math
import time
import uuid
from collections.abc import Generator, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
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
from sketchmatch.errors import AnswerUnavailableError, InvalidInputError
from sketchmatch.kernels.evidence import SelfRelations
from sketchmatch.model import (
    ConfidenceWeights,
    FloatArray,
    RelationTable,
    Scene,
    SceneDescriptor,
    Source,
)
from sketchmatch.pipeline import reading
from sketchmatch.pipeline.alternatives import best_others, exchange_confidences, partner_margins
from sketchmatch.pipeline.calibration import CALIBRATED_SIMILARITY, Calibration, calibrated
from sketchmatch.pipeline.correspond import (
    fmap_confidence,
    global_dilation,
    global_rotation,
)
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.evidence import compare_objects, rotation_weights, weigh_objects
from sketchmatch.pipeline.limits import check_comparisons, check_histograms
from sketchmatch.pipeline.plugins import blaming, checked_progress, inspecting, segmented
from sketchmatch.pipeline.probability import UNKNOWN, Likelihood, likelihood
from sketchmatch.pipeline.relate import check_exponent, relate
from sketchmatch.pipeline.request import (
    MatchRequest,
    alternatives_wanted,
    check_objects_weighed,
    price_in_force,
)
from sketchmatch.pipeline.result import (
    AlternativeMap,
    MatchResult,
    ObjectMatch,
    Statistics,
)
from sketchmatch.pipeline.selection import UNCONFIGURED, Defaults, Pipeline, resolve
from sketchmatch.pipeline.unmatched import (
    Found,
    Part,
    Rival,
    omission_confidences,
    part_of,
    trials,
)
from sketchmatch.pipeline.words import nearest_relations
from sketchmatch.registry import Registry

__all__ = [
    "Accepted",
    "Finished",
    "MatchEvent",
    "Phase",
    "Progress",
    "Segmented",
    "run_match",
]

_PROGRESS_EVERY = 0.05
_Value = TypeVar("_Value")


class Phase(StrEnum):
    """What a match is doing; the same names as ``sketchmatch.v1.Phase``."""

    SEGMENT = "SEGMENT"
    DESCRIBE = "DESCRIBE"
    RELATE = "RELATE"
    SEARCH = "SEARCH"


@dataclass(frozen=True)
class Accepted:
    """The request is sound and work begins.

    Attributes
    ----------
    match_id
        Unique to this match.
    seed, pipeline, weights
        Those in force.
    unmatched_price
        The price in force, or None where every object of the smaller scene must find a partner.
    """

    match_id: str
    seed: int
    pipeline: Pipeline
    weights: ConfidenceWeights
    unmatched_price: float | None


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
        profile = defaults.named(request.profile)
        self.weights = ConfidenceWeights(*(request.weights or profile.weights or ()))
        check_objects_weighed(self.weights, self.pipeline.searcher)
        self.price = price_in_force(request, profile, self.weights, self.pipeline.searcher)
        self.own: SelfRelations | None = None

    def run(self) -> Generator[MatchEvent, None, None]:
        price = self.price if self.price < math.inf else None
        yield Accepted(self.match_id, self.request.seed, self.pipeline, self.weights, price)
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
        count = alternatives_wanted(self.request.alternatives, sketch.scene, map_.scene)
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
            whole = Part.whole(table, self.own)
            found, rivals = yield from self.search(whole, exchanged, count)
        yield Finished(self.result(sketch, map_, drawn, exchanged, found, rivals, count))

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
        similarity, share = self.pipeline.similarity, 0.4 if self.weights.of_objects else 1.0
        comparing = relate(*descriptors, similarity)
        table = yield from self.watched(Phase.RELATE, similarity, comparing, (0.0, share))
        if self.weights.distance:
            counts = rotation_weights(scenes[0], self.weights.distance)
            table = replace(table, rotation_weights=counts)
        if not self.weights.of_objects:
            return table
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
        self, whole: Part, exchanged: bool, count: int
    ) -> Generator[MatchEvent, None, tuple[Found, list[Rival]]]:
        """Search all that is to be searched; return the best, and what else was found."""
        self.effort = (0, 0)
        plan = trials(whole.objects, self.weights.searched, self.price)
        trial, rivals = next(plan), list[Rival]()
        best: Found | None = None
        while True:
            part = yield from self.parted(whole, trial.kept, best, exchanged)
            found = yield from self.searched(part, trial.share, best, exchanged, count)
            former = best
            best = found if best is None else self.better(found, best)
            if former is not None:
                worse = former if best is found else found
                rivals.append(worse.rival(self.weights.searched))
            try:
                trial = plan.send(found)
            except StopIteration:
                return best, rivals
            if self.out_of_time():
                return replace(best, outcome=Outcome.TIME_BUDGET), rivals

    def parted(
        self, whole: Part, kept: tuple[int, ...], former: Found | None, exchanged: bool
    ) -> Generator[MatchEvent, None, Part]:
        """Return a part of what is to be searched."""
        work = part_of(whole, kept)
        while True:
            try:
                next(work)
            except StopIteration as stop:
                return stop.value  # type: ignore[no-any-return]
            if former is not None and self.may_report():
                yield self.progress(former, exchanged)

    def searched(
        self, part: Part, share: float, former: Found | None, exchanged: bool, count: int
    ) -> Generator[MatchEvent, None, Found]:
        """Run the searcher on a part until it ends, or its share of the time budget does.

        Progress shows the best of this and of what was found before.
        """
        searcher, table = self.pipeline.searcher, part.table
        there_are = math.perm(table.argument_objects, table.template_objects) - 1
        left = share * self.time_left()
        problem = MatchProblem(
            table,
            self.weights.searched,
            min(count, there_are),
            left if left < math.inf else None,
        )
        until = time.monotonic() + left
        iterations, evaluations = self.effort
        found: Found | None = None
        with self.searching(searcher, problem) as work:
            while True:
                with blaming(searcher, self.registry):
                    try:
                        before = None if found is None else found.best
                        best = checked_progress(next(work), problem, before)
                    except StopIteration as stop:
                        if found is None:
                            raise ValueError("it ended without any answer") from None
                        return replace(found, outcome=Outcome(stop.value or Outcome.CONVERGED))
                found = Found(part, best)
                self.effort = (iterations + best.iteration, evaluations + best.evaluations)
                if time.monotonic() > until:
                    return found
                if self.may_report():
                    yield self.progress(self.better(found, former), exchanged)

    def better(self, found: Found, former: Found | None) -> Found:
        """Return what is worth more."""
        if former is None or found.value(self.price) > former.value(self.price):
            return found
        return former

    def progress(self, found: Found, exchanged: bool) -> Progress:
        """Return how far the search is, with the best so far."""
        iterations, evaluations = self.effort
        return Progress(
            Phase.SEARCH,
            self.reported - self.started,
            iteration=iterations,
            evaluations=evaluations,
            confidence=found.best.confidence,
            upper_bound=found.best.upper_bound,
            matches=reading.matches(found.mapped, exchanged, found.part.kept),
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
        exchanged: bool,
        found: Found,
        rivals: list[Rival],
        count: int,
    ) -> MatchResult:
        """Read what was found from sketch to map; ``drawn`` describes the sketch."""
        part, mapped, last = found.part, found.mapped, found.best
        table, kept, fmap = part.table, part.kept, last.fmap
        weights = self.weights.searched
        best = fmap_confidence(fmap, table, weights, part.own)
        exchanges = exchange_confidences(mapped, table, weights)
        others = best_others(mapped, last.alternatives, exchanges, table, weights, count, part.own)
        margins = partner_margins(mapped, best.total, others, exchanges)
        rivals += [Rival(kept, part.objects, other.mapped, other.confidence) for other in others]
        rivals.sort(key=lambda rival: -rival.value(self.price))
        likelihood = self.likelihood(found, exchanges, rivals)
        matched = mapped.partners if exchanged else kept
        relations = nearest_relations(sketch.scene, drawn, matched.tolist())
        rotation, dilation = global_rotation(fmap, table), global_dilation(fmap, table)
        bound = last.upper_bound
        if bound is not None:
            bound = max(bound, best.total)  # ζ was taken anew, and may differ by rounding
        self.seconds["total"] = self.elapsed()
        return MatchResult(
            matches=reading.matches(
                mapped, exchanged, kept, margins, likelihood.of_objects, relations
            ),
            omap_confidence=mapped.confidence,
            confidence=best,
            fmap=reading.correspondences(fmap, table, exchanged, kept),
            rotation=reading.half_turned(-rotation if exchanged else rotation),
            scale=1.0 / dilation if exchanged else dilation,
            outcome=found.outcome,
            upper_bound=bound,
            seed=self.request.seed,
            match_id=self.match_id,
            statistics=Statistics(*self.effort, MappingProxyType(self.seconds)),
            sketch=sketch.scene,
            map=map_.scene,
            warnings=(
                *(f"sketch: {warning}" for warning in sketch.warnings),
                *(f"map: {warning}" for warning in map_.warnings),
            ),
            alternatives=tuple(
                AlternativeMap(
                    reading.matches(rival.mapped, exchanged, rival.kept),
                    rival.confidence,
                    rival.mapped.confidence,
                )
                for rival in rivals[:count]
            ),
            search_note=last.note,
            sketch_route=sketch.route,
            probability=likelihood.of_map,
        )

    def likelihood(
        self, found: Found, exchanges: FloatArray | None, rivals: list[Rival]
    ) -> Likelihood:
        """Return how likely the answer is right, where that was learned for such matches."""
        calibration = self.calibration()
        if calibration is None or exchanges is None:
            return UNKNOWN
        weights = self.weights.searched
        omissions = omission_confidences(found.best.fmap, found.part.table, weights)
        return likelihood(found, exchanges, omissions, rivals, calibration)

    def calibration(self) -> Calibration | None:
        """Return the calibration for this match, if there is one."""
        pipeline = self.pipeline
        if pipeline.similarity.name != CALIBRATED_SIMILARITY or pipeline.histogram.exponent:
            return None
        return calibrated(self.weights) if pipeline.searcher.object_consistent else None

    def elapsed(self) -> float:
        return time.monotonic() - self.started

    def time_left(self) -> float:
        budget = self.request.time_budget
        return math.inf if budget is None else max(0.0, budget - self.elapsed())

    def out_of_time(self) -> bool:
        return self.time_left() <= 0.0

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
