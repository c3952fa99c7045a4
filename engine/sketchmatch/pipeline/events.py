"""What a match tells while it runs."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from sketchmatch.api import Segmentation
from sketchmatch.model import ConfidenceWeights
from sketchmatch.pipeline.result import MatchResult, ObjectMatch
from sketchmatch.pipeline.selection import Pipeline

__all__ = ["Accepted", "Finished", "MatchEvent", "Phase", "Progress", "Segmented"]


class Phase(StrEnum):
    """What a match is doing; the same names as ``sketchmatch.v1.Phase``."""

    COMPILE = "COMPILE"
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

    def __repr__(self) -> str:
        facts = [self.phase, f"{self.elapsed:.2f} s"]
        if self.fraction is not None:
            facts.append(f"{self.fraction:.0%}")
        if self.confidence is not None:
            facts.append(f"confidence {self.confidence:.3f}")
            facts.append(f"{self.evaluations} evaluation{'s' * (self.evaluations != 1)}")
        if self.upper_bound is not None:
            facts.append(f"at most {self.upper_bound:.3f}")
        return f"<{type(self).__name__}: {', '.join(facts)}>"


@dataclass(frozen=True)
class Finished:
    """The end of a match."""

    result: MatchResult


MatchEvent = Accepted | Segmented | Progress | Finished
