"""The interface of judges: from candidate maps to the answer, and how sure it is."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from sketchmatch.api._algorithm import Algorithm
from sketchmatch.model import (
    BoolArray,
    Confidence,
    ConfidenceWeights,
    FloatArray,
    IntArray,
    RelationTable,
    Scene,
)
from sketchmatch.model.arrays import frozen, frozen_floats

__all__ = ["Candidate", "Judge", "JudgeProblem", "JudgedMap", "Judgement"]


@dataclass(frozen=True, eq=False)
class Candidate:
    """An object map that may be the answer.

    Attributes
    ----------
    partners
        int64, shape (N,): the argument object of each template object, −1 for none.
    confidence
        ζ of the FMAP of the objects that have a partner, and its parts.
    """

    partners: IntArray
    confidence: Confidence

    def __post_init__(self) -> None:
        object.__setattr__(self, "partners", frozen(np.asarray(self.partners, dtype=np.int64)))


@dataclass(frozen=True, eq=False)
class JudgeProblem:
    """What a judge is given; none of it may be changed.

    Attributes
    ----------
    template, argument
        The scenes. The template has at most as many objects as the argument.
    table
        How every template pair compares with every argument pair.
    weights
        Of the parts of ζ.
    candidates
        The maps met, at least one: the best one found, then the others, the most valuable first: by
        ζ less the price of the template objects that a map leaves out.
    swapped
        Whether the template is the map, and the argument the sketch.
    price
        Price of leaving out all template objects, in units of ζ; infinite if none may be left out.
    alternatives
        How many maps besides the best are wanted, to show them or to know what competes.
    allowed
        Shape (N, N'): the pairings that the caller does not rule out; None if none is ruled out.
    pinned
        int64, shape (N,): the argument object that a template object is known to be, −1 if unknown;
        None if unknown for all. ``allowed`` rules out all that contradicts it.
    names
        int64, shape (N, N'): 1 if both objects have labels that mean the same, −1 if these differ,
        0 if one has none; None if a side has no labels at all.
    exchanges
        Shape (k, N'): ζ after each exchange of one of the k matched objects in the first candidate;
        None if there are too many.
    omissions
        Shape (k,): ζ of the first candidate without each of them; None if there are too many.
    usual
        Whether relations are those of the default similarity on histograms of constant forces,
        found by a searcher of object maps; what was learned about ζ holds only for these.
    elsewhere
        How likely the sketch shows another place, as judged a moment ago, before something was
        drawn or erased. A judge may then assume it and use only the candidates, to be quick; the
        host asks again without it.
    time_budget
        Seconds that are left, 0 where the search took all of them; None for no limit. The host ends
        no judge: whoever waits for the answer gets it as much later as the judge takes longer.
    """

    template: Scene
    argument: Scene
    table: RelationTable
    weights: ConfidenceWeights
    candidates: tuple[Candidate, ...]
    swapped: bool = False
    price: float = math.inf
    alternatives: int = 0
    allowed: BoolArray | None = None
    pinned: IntArray | None = None
    names: IntArray | None = None
    exchanges: FloatArray | None = None
    omissions: FloatArray | None = None
    usual: bool = True
    elsewhere: float | None = None
    time_budget: float | None = None


@dataclass(frozen=True, eq=False)
class JudgedMap:
    """An object map as it is judged.

    Attributes
    ----------
    partners
        As in :class:`Candidate`: the map of one, or another.
    probability
        Probability that it is right as a whole and the place is the sketched one; None if unknown.
    """

    partners: IntArray
    probability: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "partners", frozen(np.asarray(self.partners, dtype=np.int64)))


@dataclass(frozen=True, eq=False)
class Judgement:
    """What a judge says.

    Attributes
    ----------
    maps
        All different, the answer first, then the next best ones, with all that are about as likely
        even if the caller wants fewer. At most one is right: their probabilities sum to at most 1.
    lines
        Shape (N, N' + 1): probability of each argument object as the partner of each template
        object and, last, of no partner, which includes that the sketch shows another place; rows
        sum to at most 1. None if unknown. No map is more likely than one of its lines.
    elsewhere
        How likely the sketch does not show this place at all; None if unknown.
    """

    maps: tuple[JudgedMap, ...]
    lines: FloatArray | None = None
    elsewhere: float | None = None

    def __post_init__(self) -> None:
        if self.lines is not None:
            object.__setattr__(self, "lines", frozen_floats(self.lines))


class Judge(Algorithm, ABC):
    """Says which of the candidate maps is the answer, and how likely each of them is right."""

    @property
    def partial(self) -> bool:
        """Whether it finds maps that leave objects out by itself.

        If so, objects may stay without partner on both sides unless a request says otherwise, and
        no searcher is asked again for parts of the template.
        """
        return False

    def price(self, weights: ConfidenceWeights) -> float:  # noqa: ARG002
        """Return the price of a map that leaves out all template objects, in units of ζ.

        Parameters
        ----------
        weights
            Of the parts of ζ.
        """
        return 0.4

    @abstractmethod
    def judge(self, problem: JudgeProblem) -> Judgement:
        """Judge the candidates.

        Parameters
        ----------
        problem
            The scenes, the relations and the candidates.
        """
