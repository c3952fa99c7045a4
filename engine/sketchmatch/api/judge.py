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
        The maps met, at least one. First the best that was found, then the others, what is worth
        most first: ζ less the price of the template objects that a map leaves out.
    swapped
        Whether the template is the map, and the argument the sketch.
    price
        Of leaving all template objects out, in units of ζ; infinite where none may be left out.
    alternatives
        How many maps beside the best are wanted, be it to see them or to know what competes.
    allowed
        Shape (N, N'): which pairings the caller does not rule out; None where none is ruled out.
    pinned
        int64, shape (N,): the argument object that a template object is known to be, −1 where
        nothing is known; None where of none. In ``allowed`` all that contradicts is ruled out.
    names
        int64, shape (N, N'): 1 where both objects have a label and these mean the same, −1 where
        they do not, 0 where one has none; None where a side has no labels at all.
    exchanges
        Shape (k, N'): ζ after each exchange in the first candidate, of its k matched objects;
        None where there are too many.
    omissions
        Shape (k,): ζ of the first candidate without each of them; None where there are too many.
    usual
        Whether relations are those of the default similarity on histograms of constant forces,
        found by a searcher of object maps; what was learned of ζ holds for no others.
    elsewhere
        How likely the sketch shows another place, as it was judged a moment ago, before something
        was drawn or erased. Where it is given, a judge may take it for granted, to be quick, and
        go by the candidates alone; the host asks again without it.
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


@dataclass(frozen=True, eq=False)
class JudgedMap:
    """An object map as it is judged.

    Attributes
    ----------
    partners
        As in :class:`Candidate`: that of one, or another.
    probability
        How likely it is right as a whole, and the place is the one sketched; None where unknown.
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
        All different, the answer first and then the next best ones; all that are about as likely,
        however few the caller wants to see. One at most is right: their probabilities are 1
        together, or less.
    lines
        Shape (N, N' + 1): how likely each template object's partner is each argument object, and,
        last, none of them, as where the sketch shows another place: 1 together, or less. None
        where unknown. No map is likelier than one of its lines.
    elsewhere
        How likely the sketch does not show this place at all; None where unknown.
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

        Then objects may stay without partner on both sides unless a request says otherwise, and no
        searcher is asked again for parts of the template.
        """
        return False

    def price(self, weights: ConfidenceWeights) -> float:  # noqa: ARG002
        """Return what a map loses that leaves all template objects out, in units of ζ.

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
