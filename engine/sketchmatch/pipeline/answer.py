"""From what the judge says, to the answer: read from sketch to map, and how sure it is."""

from __future__ import annotations

import numpy as np

from sketchmatch.api import Outcome, Segmentation
from sketchmatch.pipeline import reading
from sketchmatch.pipeline.alternatives import partner_margins
from sketchmatch.pipeline.clock import Clock
from sketchmatch.pipeline.compare import Comparison
from sketchmatch.pipeline.correspond import global_dilation, global_rotation
from sketchmatch.pipeline.judge import Judged
from sketchmatch.pipeline.result import AlternativeMap, MatchResult, Statistics
from sketchmatch.pipeline.said import said
from sketchmatch.pipeline.search import Goal, Search
from sketchmatch.pipeline.words import nearest_relations

__all__ = ["answer"]


def answer(
    comparison: Comparison,
    found: Search,
    judged: Judged,
    goal: Goal,
    segmentations: tuple[Segmentation, Segmentation],
    match_id: str,
    clock: Clock,
) -> MatchResult:
    """Return the answer to a match.

    Parameters
    ----------
    comparison, found, judged, goal
        What was searched, what came of it, what the judge made of that, and what was sought.
    segmentations
        Of sketch and map.
    match_id
        Unique to the match.
    clock
        Of the match.
    """
    swapped, best = comparison.swapped, judged.answer
    mapped, table, kept, fmap = best.mapped, best.part.table, best.part.kept, best.fmap
    alike = (other for other in judged.others if np.array_equal(other.kept, kept))
    margins = partner_margins(mapped, best.confidence.total, alike, best.exchanges)
    matched = mapped.partners if swapped else kept
    relations = nearest_relations(comparison.sketch, comparison.sketch_descriptor, matched.tolist())
    rotation, dilation = global_rotation(fmap, table), global_dilation(fmap, table)
    outcome, bound = _proved(found, judged)
    if outcome is Outcome.TIME_BUDGET and clock.curtailed:
        outcome = Outcome.SERVER_STOPPING
    sketch, map_ = segmentations
    sides = len(sketch.scene), len(map_.scene)
    says = said(judged.judgement, *sides, swapped, goal.shown)
    likely = None if says.of_objects is None else says.of_objects[matched]
    return MatchResult(
        matches=reading.matches(mapped, swapped, kept, margins, likely, relations),
        omap_confidence=mapped.confidence,
        confidence=best.confidence,
        fmap=reading.correspondences(fmap, table, swapped, kept),
        rotation=reading.half_turned(-rotation if swapped else rotation),
        scale=1.0 / dilation if swapped else dilation,
        outcome=outcome,
        upper_bound=bound,
        seed=goal.seed,
        match_id=match_id,
        statistics=Statistics(
            found.iterations,
            found.evaluations,
            {**clock.seconds, "total": clock.spent()},
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
                probability,
            )
            for rival, probability in zip(judged.others, says.of_alternatives, strict=False)
        ),
        search_note=found.best.best.note,
        sketch_route=sketch.route,
        probability=says.of_map,
        place_probability=says.of_place,
        ambiguity=says.ambiguity,
        provisional=bool(goal.start),
        unmatched_sketch_probabilities=says.of_unmatched,
    )


def _proved(found: Search, judged: Judged) -> tuple[Outcome, float | None]:
    """Return why the search ended and its upper bound, as far as they are true of the answer."""
    searched, best = found.best, judged.answer
    outcome, bound = searched.outcome, searched.best.upper_bound
    same_objects = np.array_equal(best.part.kept, searched.part.kept)
    if outcome is Outcome.OPTIMAL and not (
        same_objects and np.array_equal(best.mapped.partners, searched.mapped.partners)
    ):
        outcome = Outcome.CONVERGED  # proved of another map, which the judge did not take
    if bound is None or not same_objects:
        return outcome, None
    return outcome, max(bound, best.confidence.total)  # ζ was taken anew, and may be rounded
