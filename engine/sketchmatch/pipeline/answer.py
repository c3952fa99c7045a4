"""From what a search came to, to the answer: read from sketch to map, and how sure it is."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

from sketchmatch.api import Segmentation
from sketchmatch.model import Confidence, FloatArray, Weights
from sketchmatch.pipeline import reading
from sketchmatch.pipeline.alternatives import best_others, exchange_confidences, partner_margins
from sketchmatch.pipeline.calibration import Calibration
from sketchmatch.pipeline.clock import Clock
from sketchmatch.pipeline.compare import Comparison
from sketchmatch.pipeline.correspond import fmap_confidence, global_dilation, global_rotation
from sketchmatch.pipeline.probability import UNKNOWN, likelihood
from sketchmatch.pipeline.result import AlternativeMap, MatchResult, Statistics
from sketchmatch.pipeline.search import Goal, Search
from sketchmatch.pipeline.unmatched import PartSearch, Rival, omission_confidences
from sketchmatch.pipeline.words import nearest_relations

__all__ = ["Considered", "answer", "considered"]


@dataclass(frozen=True, eq=False)
class Considered:
    """The maps that an answer is chosen from.

    Attributes
    ----------
    best
        The best one, of the objects of its part.
    exchanges
        Shape (k, N'): ζ after each exchange in it, as
        :func:`sketchmatch.pipeline.alternatives.exchange_confidences` returns it, or None.
    rivals
        The others that were met, what is worth most first.
    confidence
        ζ of the best, and its parts.
    margins
        Shape (k,): by how much ζ falls with the best other partner of each object, or None.
    weights
        Of ζ.
    """

    best: PartSearch
    exchanges: FloatArray | None
    rivals: tuple[Rival, ...]
    confidence: Confidence
    margins: FloatArray | None
    weights: Weights

    def omissions(self) -> FloatArray | None:
        """Return ζ without each of its objects, shape (k,), or None."""
        return omission_confidences(self.best.best.fmap, self.best.part.table, self.weights)


def considered(found: Search, goal: Goal) -> Considered:
    """Return the maps that an answer to a search is chosen from."""
    best = found.best
    part, mapped, weights = best.part, best.mapped, goal.weights.searched
    table = part.table
    exchanges = exchange_confidences(mapped, table, weights)
    others = best_others(
        mapped,
        best.best.alternatives,
        exchanges,
        table,
        weights,
        goal.alternatives,
        part.own,
    )
    confidence = fmap_confidence(best.best.fmap, table, weights, part.own)
    met = [Rival(part.kept, part.objects, other.mapped, other.confidence) for other in others]
    return Considered(
        best,
        exchanges,
        tuple(sorted((*found.rivals, *met), key=lambda rival: -rival.value(goal.price))),
        confidence,
        partner_margins(mapped, confidence.total, others, exchanges),
        weights,
    )


def answer(
    comparison: Comparison,
    found: Search,
    goal: Goal,
    calibration: Calibration | None,
    segmentations: tuple[Segmentation, Segmentation],
    match_id: str,
    clock: Clock,
) -> MatchResult:
    """Return the answer to a match.

    Parameters
    ----------
    comparison, found, goal
        What was searched, what came of it, and what was sought.
    calibration
        What was learned of such matches; None where nothing was.
    segmentations
        Of sketch and map.
    match_id
        Unique to the match.
    clock
        Of the match.
    """
    maps = considered(found, goal)
    swapped, part, mapped = comparison.swapped, maps.best.part, maps.best.mapped
    last, table, kept = maps.best.best, part.table, part.kept
    likely = UNKNOWN
    if calibration is not None and maps.exchanges is not None:
        likely = likelihood(maps.best, maps.exchanges, maps.omissions(), maps.rivals, calibration)
    matched = mapped.partners if swapped else kept
    relations = nearest_relations(comparison.sketch, comparison.sketch_descriptor, matched.tolist())
    rotation, dilation = global_rotation(last.fmap, table), global_dilation(last.fmap, table)
    bound = last.upper_bound
    if bound is not None:
        bound = max(bound, maps.confidence.total)  # ζ was taken anew, and may differ by rounding
    sketch, map_ = segmentations
    return MatchResult(
        matches=reading.matches(mapped, swapped, kept, maps.margins, likely.of_objects, relations),
        omap_confidence=mapped.confidence,
        confidence=maps.confidence,
        fmap=reading.correspondences(last.fmap, table, swapped, kept),
        rotation=reading.half_turned(-rotation if swapped else rotation),
        scale=1.0 / dilation if swapped else dilation,
        outcome=maps.best.outcome,
        upper_bound=bound,
        seed=goal.seed,
        match_id=match_id,
        statistics=Statistics(
            found.iterations,
            found.evaluations,
            MappingProxyType({**clock.seconds, "total": clock.spent()}),
        ),
        sketch=sketch.scene,
        map=map_.scene,
        warnings=(
            *(f"sketch: {warning}" for warning in sketch.warnings),
            *(f"map: {warning}" for warning in map_.warnings),
        ),
        alternatives=tuple(
            AlternativeMap(
                reading.matches(rival.mapped, swapped, rival.kept),
                rival.confidence,
                rival.mapped.confidence,
            )
            for rival in maps.rivals[: goal.alternatives]
        ),
        search_note=last.note,
        sketch_route=sketch.route,
        probability=likely.of_map,
    )
