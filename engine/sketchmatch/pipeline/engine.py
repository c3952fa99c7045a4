"""The engine as a whole: algorithms, what a configuration says of them, and limits."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from sketchmatch.api import Histogram, Judge, Searcher, Segmentation, Segmenter, Similarity
from sketchmatch.model import ConfidenceWeights, Scene, SceneDescriptor, Source
from sketchmatch.model.limits import SourceLimits, limited_to
from sketchmatch.pipeline.clock import Clock
from sketchmatch.pipeline.compare import Comparison, check_scenes, compare
from sketchmatch.pipeline.describe import check_histograms, described, with_directions
from sketchmatch.pipeline.events import MatchEvent
from sketchmatch.pipeline.judge import Judged, judged
from sketchmatch.pipeline.match import Check, run_match, unchecked
from sketchmatch.pipeline.memory import Memory
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch.pipeline.search import Goal, Search, search
from sketchmatch.pipeline.segment import segment, segment_side
from sketchmatch.pipeline.selection import (
    SIDES,
    UNCONFIGURED,
    Choice,
    Defaults,
    Pipeline,
    Selection,
    resolve,
    resolve_segmenter,
)
from sketchmatch.registry import Registry, default_registry

__all__ = ["Engine"]


@dataclass(frozen=True)
class Engine:
    """What Python, the command line and the server ask.

    Long steps are generators that yield the share that is done and return their value; whoever
    drives them shows progress, and stops them by closing them.

    Attributes
    ----------
    registry
        The algorithms at hand; left out, all that are installed.
    defaults
        What is taken where a request chooses nothing, and the profiles that it can name.
    limits
        How large a sketch or a map may be.
    memory
        What of scenes need not be described again; None where nothing is remembered.
    check
        As for :func:`~sketchmatch.pipeline.match.run_match`.

    Examples
    --------
    >>> from sketchmatch.pipeline.slices import finish
    >>> scene = Scene.from_polygons([[[0, 0], [2, 0], [2, 1]], [[5, 0], [6, 0], [6, 3]]])
    >>> engine = Engine()
    >>> pipeline = engine.resolve({})
    >>> compared = finish(engine.compare((scene, scene), pipeline.histogram, pipeline.similarity))
    >>> compared.table.similarity.shape
    (1, 1)
    """

    registry: Registry = field(default_factory=default_registry)
    defaults: Defaults = UNCONFIGURED
    limits: SourceLimits = field(default_factory=SourceLimits)
    memory: Memory | None = field(default=None, compare=False)
    check: Check = field(default=unchecked, compare=False)

    @contextmanager
    def limited(self) -> Iterator[None]:
        """Put the limits in force for what is read within the block."""
        with limited_to(self.limits):
            yield

    def match(
        self, request: MatchRequest, match_id: str = "", clock: Clock | None = None
    ) -> Generator[MatchEvent, None, None]:
        """Match, event by event, as :func:`sketchmatch.pipeline.match.run_match` does."""
        return run_match(
            request,
            self.registry,
            self.defaults,
            self.limits,
            match_id,
            clock,
            self.memory,
            self.check,
        )

    def resolve(
        self,
        selection: Selection,
        sketch: Source | None = None,
        map: Source | None = None,  # noqa: A002
        profile: str = "",
    ) -> Pipeline:
        """Set up the algorithms of a match, as :func:`~sketchmatch.pipeline.selection.resolve`."""
        return resolve(self.registry, selection, sketch, map, self.defaults, profile)

    def resolve_segmenter(self, choice: Choice, source: Source, profile: str = "") -> Segmenter:
        """Set up the segmenter for one source that is not to be matched."""
        return resolve_segmenter(self.registry, choice, source, self.defaults, profile)

    def segment(self, source: Source, segmenter: Segmenter, field: str) -> Segmentation:
        """Find the objects of a source, as :func:`~sketchmatch.pipeline.segment.segment` does."""
        with self.limited():
            return segment(source, segmenter, self.registry, field)

    def segment_side(
        self, side: str, given: Source | Scene | Segmentation, pipeline: Pipeline
    ) -> Segmentation:
        """Find the objects of the sketch or of the map of a match."""
        with self.limited():
            return segment_side(side, given, pipeline, self.registry)

    def describe(
        self, scene: Scene, histogram: Histogram, side: str = ""
    ) -> Generator[float, None, SceneDescriptor]:
        """Describe every pair of a scene, once it is known to fit into memory."""
        check_histograms(side or "scene", scene, histogram)
        settled = with_directions(histogram, self.registry, scene)
        return described(scene, settled, self.registry, side, self.memory)

    def compare(
        self,
        scenes: tuple[Scene, Scene],
        histogram: Histogram,
        similarity: Similarity,
        weights: ConfidenceWeights = ConfidenceWeights(),  # noqa: B008 (frozen)
    ) -> Generator[float, None, Comparison]:
        """Compare a sketch with a map, once they are known to fit into memory.

        The weights say whether objects and distances count.
        """
        check_scenes(scenes, histogram)
        return self._compared(scenes, histogram, similarity, weights)

    def search(
        self, comparison: Comparison, searcher: Searcher, goal: Goal, clock: Clock | None = None
    ) -> Generator[Search, None, Search]:
        """Look for the best map, as :func:`~sketchmatch.pipeline.search.search` does."""
        return search(comparison, searcher, goal, self.registry, clock or Clock())

    def judge(
        self, comparison: Comparison, found: Search, goal: Goal, judge: Judge, usual: bool = True
    ) -> Generator[float, None, Judged]:
        """Ask which map is the answer, as :func:`~sketchmatch.pipeline.judge.judged` does."""
        return judged(comparison, found, goal, judge, self.registry, usual)

    def _compared(
        self,
        scenes: tuple[Scene, Scene],
        histogram: Histogram,
        similarity: Similarity,
        weights: ConfidenceWeights,
    ) -> Generator[float, None, Comparison]:
        settled = with_directions(histogram, self.registry, *scenes)
        drawn, mapped = (
            described(scene, settled, self.registry, side, self.memory)
            for side, scene in zip(SIDES, scenes, strict=True)
        )
        descriptors = ((yield from drawn), (yield from mapped))
        return (
            yield from compare(scenes, descriptors, similarity, self.registry, weights, self.memory)
        )
