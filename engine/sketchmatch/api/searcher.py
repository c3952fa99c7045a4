"""The interface of searchers: from relations to the best histogram map."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from sketchmatch.api._algorithm import Algorithm
from sketchmatch.model import BoolArray, Fmap, IntArray, RelationTable, Scene, Weights

__all__ = ["MatchProblem", "Outcome", "SearchProgress", "Searcher"]


class Outcome(StrEnum):
    """Why a search ended; the same names as ``sketchmatch.v1.Outcome``."""

    CONVERGED = "CONVERGED"
    """It found nothing better for as long as it waits."""

    OPTIMAL = "OPTIMAL"
    """No object map has a higher ζ, and that is proved."""

    TIME_BUDGET = "TIME_BUDGET"
    """The host stopped it by then; a searcher does not return it."""

    ITERATION_LIMIT = "ITERATION_LIMIT"
    """It has done as much as its parameters allow."""

    SERVER_STOPPING = "SERVER_STOPPING"
    """The host stopped it because it is about to stop itself; a searcher does not return it."""


@dataclass(frozen=True)
class MatchProblem:
    """What a searcher is given.

    Attributes
    ----------
    table
        Similarity, rotation and dilation of every histogram correspondence, and their weights. The
        template has at most as many objects as the argument.
    weights
        Weights of the three parts of ζ: ζσ (replaced by the mean evidence if the table holds any),
        ζR and ζL. If the caller rules out pairings, the evidence contains that and weighs more:
        this ζ then orders maps as the true one, which the host reports.
    alternatives
        How many object maps besides the best are wanted.
    time_budget
        Seconds left for the search, or None for no limit; the host stops the search by then.
    scenes
        Returns the template and the argument themselves, for a searcher that uses more than their
        relations; None if there are none.
    swapped
        Whether the template is the map, and the argument the sketch.
    partial
        Whether template objects may stay without partner.
    allowed
        Shape (N, N'): the pairings that the caller does not rule out; None if none is ruled out. A
        searcher may ignore it: ζ of maps with other pairings is below that of all others.
    pinned
        int64, shape (N,): the argument object that a template object is known to be, −1 if unknown;
        None if unknown for all. ``allowed`` rules out all that contradicts it.
    names
        int64, shape (N, N'): 1 if both objects have labels that mean the same, −1 if these differ,
        0 if one has none; None if a side has no labels at all.
    start
        Object maps that were right a moment ago, before something was drawn or erased, the best
        first; each int64, shape (N,), −1 for an object without partner. A searcher that is ``warm``
        searches only near these, to be quick; the host asks again without them. Other searchers
        never get them.
    """

    table: RelationTable
    weights: Weights = (1.0, 1.0, 1.0)
    alternatives: int = 0
    time_budget: float | None = None
    scenes: Callable[[], tuple[Scene, Scene]] | None = None
    swapped: bool = False
    partial: bool = False
    allowed: BoolArray | None = None
    pinned: IntArray | None = None
    names: IntArray | None = None
    start: tuple[IntArray, ...] = ()


@dataclass(frozen=True)
class SearchProgress:
    """The state of a search.

    Attributes
    ----------
    fmap
        The best legal FMAP so far.
    confidence
        Its ζ. It never falls during a search.
    iteration
        Iterations done.
    evaluations
        FMAPs evaluated.
    upper_bound
        A ζ that no FMAP of an object map exceeds, or None if the searcher proves nothing.
    alternatives
        Good legal FMAPs besides the best, in any order; the host picks the best of them that lead
        to other object maps. Only those of the last progress count.
    note
        One sentence on what the searcher did; empty if it reports nothing.
    maps
        Further object maps for the judge, in any order, from a searcher that is ``partial``: each
        int64, shape (N,), with −1 for a template object without partner. Only those of the last
        progress count.
    """

    fmap: Fmap
    confidence: float
    iteration: int
    evaluations: int
    upper_bound: float | None = None
    alternatives: tuple[Fmap, ...] = ()
    note: str = ""
    maps: tuple[IntArray, ...] = ()


class Searcher(Algorithm, ABC):
    """Looks for the FMAP with the highest confidence ζ.

    What speaks for an entry beside rotation and dilation is σ, unless the request weighs shapes and
    sizes of objects; a searcher reads it from ``table.entry_evidence``. What the rotation of a
    template pair counts for is in ``table.rotation_weights``, and so in ``table.cosine`` and
    ``table.sine``. All of :mod:`sketchmatch.api.kernels` reads these.
    """

    @property
    def object_consistent(self) -> bool:
        """Whether each FMAP that it yields follows from one object map.

        If it is False, by ``object_consistent = False`` in the class or a property that depends on
        the parameters, the host refuses requests that weigh shapes and sizes of objects.
        """
        return True

    @property
    def partial(self) -> bool:
        """Whether it finds maps that leave objects out by itself, where a problem lets it.

        It reports them in ``SearchProgress.maps``, and is asked once, for all of the template;
        other searchers are asked again for parts of it.
        """
        return False

    @property
    def warm(self) -> bool:
        """Whether it is quick if a problem has maps to start with: ``MatchProblem.start``."""
        return False

    @property
    def most_maps(self) -> int | None:
        """Largest number of maps that its parameters allow, whatever the scenes.

        It grows, breeds or improves each of them, and has at most as many iterations. A server may
        refuse what exceeds its limit. None, the default, means that no parameter determines it.
        """
        return None

    @abstractmethod
    def search(
        self, problem: MatchProblem, rng: np.random.Generator
    ) -> Generator[SearchProgress, None, Outcome]:
        """Search, yielding the state at least every 50 ms.

        The host stops a search by closing the generator; a searcher needs no code for deadlines,
        cancellation or streams. The same generator state gives the same run, so nothing random may
        depend on the clock.

        Parameters
        ----------
        problem
            The relations and the weights; they must not be changed.
        rng
            The only source of randomness.

        Yields
        ------
        SearchProgress
            The best FMAP so far; at least one before it returns.

        Returns
        -------
        Outcome
            CONVERGED, OPTIMAL or ITERATION_LIMIT.
        """
