"""From what a search came to, to what the judge makes of it."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterable
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any

import numpy as np

from sketchmatch.api import Candidate, Judge, JudgedMap, Judgement, JudgeProblem
from sketchmatch.errors import quoted
from sketchmatch.model import (
    Confidence,
    FloatArray,
    Fmap,
    IntArray,
    ObjectMap,
    Weights,
)
from sketchmatch.model.arrays import sealed
from sketchmatch.pipeline.alternatives import exchange_confidences, other_maps
from sketchmatch.pipeline.clock import Clock
from sketchmatch.pipeline.compare import Comparison
from sketchmatch.pipeline.correspond import fmap_confidence, induced_map, map_confidence
from sketchmatch.pipeline.guard import blaming, breaks_pins, check_map, checked_array, inspecting
from sketchmatch.pipeline.search import Goal, Search
from sketchmatch.pipeline.unmatched import Part, Rival, omission_confidences, part_of
from sketchmatch.registry import Registry

__all__ = [
    "Considered",
    "Judged",
    "check_maps",
    "check_probabilities",
    "considered",
    "judged",
    "problem_of",
]

# Probabilities that should be the same may come from different sums.
_ROUNDING = 1e-9
_SUMMED = 1e-6


@dataclass(frozen=True, eq=False)
class Considered:
    """A map that is looked at closely.

    Attributes
    ----------
    part
        The objects that it matches, and their relations.
    fmap
        Its histogram map, into the table of the part.
    rival
        The map itself, with ζ.
    exchanges
        Shape (k, N'): ζ after each exchange in it, as
        :func:`sketchmatch.pipeline.alternatives.exchange_confidences` returns it, or None.
    told
        ζ as the searcher told it, which its sums may round otherwise.
    """

    part: Part
    fmap: Fmap
    rival: Rival
    exchanges: FloatArray | None
    told: float

    @property
    def mapped(self) -> ObjectMap:
        """The object map, of the objects of the part alone."""
        return self.rival.mapped

    @property
    def confidence(self) -> Confidence:
        """ζ, and its parts."""
        return self.rival.confidence

    @property
    def partners(self) -> IntArray:
        """The map of the whole template, shape (N,), −1 for an object that is left out."""
        return self.rival.partners


@dataclass(frozen=True, eq=False)
class Judged:
    """What a judge made of a search.

    Attributes
    ----------
    judgement
        What it says.
    answer
        The map that it puts first.
    others
        The maps that follow, in its order.
    """

    judgement: Judgement
    answer: Considered
    others: tuple[Rival, ...]


def judged(
    comparison: Comparison,
    found: Search,
    goal: Goal,
    judge: Judge,
    registry: Registry,
    usual: bool = True,
    clock: Clock | None = None,
) -> Generator[float, None, Judged]:
    """Ask the judge which of the maps met is the answer.

    Parameters
    ----------
    comparison, found, goal
        What was searched, what came of it, and what was sought.
    judge, registry
        Who judges, and where it comes from.
    usual
        As in :class:`~sketchmatch.api.JudgeProblem`.
    clock
        Tells how much time is left; None for no limit.

    Yields
    ------
    float
        The share that is done of what takes time.

    Raises
    ------
    PluginError
        If the judge breaks its contract.
    """
    whole, weights = Part.whole(comparison.table, comparison.own), goal.weights.searched
    first, others = yield from considered(comparison, found, goal)
    problem = problem_of(comparison, first, others, goal, usual)
    if clock is not None and (left := clock.left()) < math.inf:
        problem = replace(problem, time_budget=left)
    with inspecting(judge, registry, problem), blaming(judge, registry):
        judgement = judge.judge(problem)
        check_maps(judgement, problem)
        check_probabilities(judgement, problem)
    known = {each.partners.tobytes(): each for each in (first.rival, *others)}
    ranked = [
        known.get(each.partners.tobytes()) or _rival(each.partners, whole, weights)
        for each in judgement.maps
    ]
    answer = first
    if ranked[0] is not first.rival:
        answer = yield from _considered(ranked[0], whole, goal)
    return Judged(judgement, answer, tuple(ranked[1:]))


def considered(
    comparison: Comparison, found: Search, goal: Goal
) -> Generator[float, None, tuple[Considered, tuple[Rival, ...]]]:
    """Return the maps that may be the answer to a search: the first, and the others.

    The first is the best that the search found, or a map that the searcher tells of beside and
    that is worth more; of the others, what is worth most comes first.

    Yields
    ------
    float
        The share that is done of what takes time.
    """
    whole, weights = Part.whole(comparison.table, comparison.own), goal.weights.searched
    searched, part = found.best, found.best.part
    exchanges = _exchanges(searched.mapped, part, goal)
    best = searched.rival(weights)
    beside = [_rival(part.in_whole(each), whole, weights) for each in searched.best.maps]
    near = other_maps(
        searched.mapped,
        searched.best.alternatives,
        exchanges,
        part.table,
        weights,
        goal.alternatives,
        part.own,
    )
    alike = [Rival(part.kept, part.objects, other.mapped, other.confidence) for other in near]
    met = [each for each in (best, *found.rivals, *alike, *beside) if _is_possible(each, goal)]

    def worth(rival: Rival) -> float:
        return rival.value(goal.price)

    leader = max((each for each in (best, *beside) if _is_possible(each, goal)), key=worth)
    others = {each.partners.tobytes(): each for each in sorted(met, key=worth)}
    others.pop(leader.partners.tobytes())
    ranked = tuple(sorted(others.values(), key=lambda each: -worth(each)))
    if leader is best:
        told = searched.best.confidence
        return Considered(part, searched.best.fmap, best, exchanges, told), ranked
    return (yield from _considered(leader, whole, goal)), ranked


def problem_of(
    comparison: Comparison,
    first: Considered,
    others: Iterable[Rival],
    goal: Goal,
    usual: bool = True,
) -> JudgeProblem:
    """Return what the judge is given of the maps that :func:`considered` returns."""
    template, argument = comparison.scenes
    exchanges, part = first.exchanges, first.part
    omissions = omission_confidences(first.fmap, part.table, goal.weights.searched)
    if omissions is not None and goal.pinned is not None:
        omissions = np.where(goal.pinned[part.kept] >= 0, -np.inf, omissions)
    return JudgeProblem(
        template,
        argument,
        comparison.table,
        goal.weights,
        (
            Candidate(first.partners, replace(first.confidence, total=first.told)),
            *(Candidate(each.partners, each.confidence) for each in others),
        ),
        comparison.swapped,
        goal.price,
        goal.alternatives,
        goal.allowed,
        goal.pinned,
        goal.names,
        None if exchanges is None else sealed(exchanges),
        None if omissions is None else sealed(omissions),
        usual,
        goal.elsewhere,
    )


def check_maps(judgement: Any, problem: JudgeProblem) -> None:
    """Refuse what is no judgement of one object map or more, all different and possible.

    Raises
    ------
    TypeError, ValueError
        With a sentence that tells what a judge did.
    """
    if not isinstance(judgement, Judgement):
        raise TypeError(f"it returned a {type(judgement).__name__}, not a Judgement")
    maps = judgement.maps
    if not (isinstance(maps, tuple) and all(isinstance(each, JudgedMap) for each in maps)):
        raise TypeError("its maps are not a tuple of JudgedMap")
    if not maps:
        raise ValueError("it returned no map")
    for each in maps:
        check_map(each.partners, problem)
    if len({each.partners.tobytes() for each in maps}) < len(maps):
        raise ValueError("it returned a map twice")


def check_probabilities(judgement: Judgement, problem: JudgeProblem) -> None:
    """Refuse probabilities that are none, or contradict each other.

    Raises
    ------
    TypeError, ValueError
        With a sentence that tells what a judge did.
    """
    lines, elsewhere = judgement.lines, judgement.elsewhere
    table = problem.table
    if lines is not None:
        checked_array(lines, (table.template_objects, table.argument_objects + 1), most=1.0)
        sums = lines.sum(axis=1)
        if sums.max() > 1.0 + _SUMMED:
            k = int(sums.argmax())
            raise ValueError(
                f"the probabilities of its lines of template object {k} sum to {sums[k]:g}, which "
                "is more than 1"
            )
    if elsewhere is not None:
        _check_probability("elsewhere", elsewhere)
    for each in judgement.maps:
        if each.probability is None:
            continue
        _check_probability("probability of a map", each.probability)
        if elsewhere is not None and each.probability > 1.0 - elsewhere + _ROUNDING:
            raise ValueError(
                f"its map is right with probability {each.probability:g}, but the place is another "
                f"one with {elsewhere:g}"
            )
        if lines is not None:
            least = lines[np.arange(len(lines)), each.partners].min()  # −1 is the last, of none
            if each.probability > least + _ROUNDING:
                raise ValueError(
                    f"its map is right with probability {each.probability:g}, but one of its lines "
                    f"only with {least:g}"
                )

    together = sum(float(each.probability or 0.0) for each in judgement.maps)
    if together > 1.0 + _SUMMED:
        raise ValueError(
            f"the probabilities of its {len(judgement.maps)} maps sum to {together:g}, which is "
            "more than 1"
        )


def _considered(rival: Rival, whole: Part, goal: Goal) -> Generator[float, None, Considered]:
    """Return a map with its relations, and ζ of the histogram map that it induces."""
    weights = goal.weights.searched
    part = yield from part_of(whole, rival.kept.tolist())
    fmap = Fmap.from_object_map(rival.mapped.partners, part.table.argument_objects)
    mapped = induced_map(rival.partners, whole.table)
    confidence = fmap_confidence(fmap, part.table, weights, part.own)
    exchanges = _exchanges(mapped, part, goal)
    known = Rival(part.kept, part.objects, mapped, confidence)
    return Considered(part, fmap, known, exchanges, confidence.total)


def _rival(partners: IntArray, whole: Part, weights: Weights) -> Rival:
    """Return an object map of the whole template with ζ."""
    confidence = map_confidence(partners, whole.table, weights, whole.own)
    kept = np.flatnonzero(partners >= 0)
    return Rival(kept, whole.objects, induced_map(partners, whole.table), confidence)


def _is_possible(rival: Rival, goal: Goal) -> bool:
    """Whether a map keeps to what the caller knows."""
    if goal.allowed is not None and not goal.allowed[rival.kept, rival.mapped.partners].all():
        return False
    return goal.pinned is None or not breaks_pins(rival.partners, goal.pinned)


def _exchanges(mapped: ObjectMap, part: Part, goal: Goal) -> FloatArray | None:
    """Return ζ after each exchange in a map, −inf where the caller rules it out, or None."""
    exchanges = exchange_confidences(mapped, part.table, goal.weights.searched)
    if exchanges is None or goal.allowed is None:
        return exchanges
    possible, partners = goal.allowed[part.kept], mapped.partners
    # Where h is held, its holder takes what g had.
    possible[:, partners] &= possible[:, partners].T
    return np.where(possible, exchanges, -np.inf)


def _check_probability(name: str, given: Any) -> None:
    if not (isinstance(given, Real) and 0.0 <= float(given) <= 1.0):
        raise ValueError(f"its {name} is {quoted(given)}, not a number within 0 … 1")
