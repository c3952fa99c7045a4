"""The fuzzy sequential nearest neighbour approach, driven by a particle swarm."""

from __future__ import annotations

from collections.abc import Generator
from typing import Literal

import numpy as np
from pydantic import Field

from sketchmatch.api import MatchProblem, Outcome, Searcher, SearchProgress
from sketchmatch.model import RelationTable
from sketchmatch_builtin.searchers._growers import (
    Found,
    FsnnGrower,
    NnGrower,
    Slices,
    fit_membership,
    random_seed_point,
    read_features,
    reported,
)
from sketchmatch_builtin.searchers._swarm import SwarmParams, swarm

__all__ = ["FsnnPso"]


class FsnnPso(Searcher):
    """Grows FMAPs by fuzzy closeness from seed points that a particle swarm chooses.

    The first entry is the histogram correspondence nearest to the seed point in (σ̂, R̂, L̂). Each
    next one has the highest mean closeness to those already in the FMAP, weighted by their own
    confidence. An FMAP is one-to-one and contains no histogram together with its dual, but need not
    lead to a consistent object map. The scale of a sketch has no effect, as in ``nn``.

    An FMAP depends only on its first entry: C(0) is a factor of all that follows. So there are at
    most Q·Q' FMAPs (1,568 for 8 objects on 8), however large the swarm; ``first = "every"`` grows
    each of them once, which takes less time than a swarm that evaluates as many.

    The mean and the variance of distances, which closeness depends on, are exact up to about
    13 × 13 objects and estimated from 2²⁰ random pairs beyond. The search begins with a random
    FMAP and one grown by distance alone, so that there is an answer while it prepares.

    References
    ----------
    "Scene Matching Between a Quantitative Map and a Qualitative Hand Drawn Sketch", thesis,
    sections 3.6 and 3.7.1, after Sjahputera and Keller (2006).

    Examples
    --------
    A swarm of ten that moves until five iterations brought nothing better:

    >>> from sketchmatch.testing import is_legal, is_object_consistent, matching_problem
    >>> problem, truth = matching_problem(np.random.default_rng(0), objects=5, missing=1)
    >>> searcher = FsnnPso(FsnnPso.Params(particles=10, patience=5))
    >>> *_, last = searcher.search(problem, np.random.default_rng(0))
    >>> is_legal(last.fmap, problem.table), is_object_consistent(last.fmap, problem.table)
    (True, True)
    >>> round(last.confidence, 2), last.evaluations  # an FMAP depends on its first entry alone
    (0.97, 34)
    """

    name = "fsnn-pso"
    summary = "Particle swarm over seed points, FMAPs grown by fuzzy closeness (FSNN)."
    object_consistent = False

    class Params(SwarmParams):
        """Parameters of closeness and of the swarm; α, k and the velocity as in the thesis."""

        alpha: float = Field(
            10.0, gt=0, le=1e6, description="α, how steeply closeness falls with distance."
        )
        first: Literal["swarm", "every"] = Field(
            "swarm",
            description="Which entries FMAPs grow from: those that the swarm finds, or every one, "
            "regardless of the swarm's parameters.",
        )
        k: float = Field(
            1.0,
            ge=0,
            le=1000,
            description="Closeness is one half k variances below the mean distance.",
        )

    params: Params

    @property
    def most_maps(self) -> int | None:
        """Those of the swarm; where every entry is the first of one, the scenes say how many."""
        return self.params.most_maps if self.params.first == "swarm" else None

    @classmethod
    def warm_up(cls) -> None:
        """Compile the kernels, those for large scenes too."""
        three = np.ones((3, 3))
        problem = MatchProblem(RelationTable(three, three, three, 3, 3))
        params = cls.Params(particles=2, iterations=1)
        list(cls(params).search(problem, np.random.default_rng(0)))

    def search(
        self, problem: MatchProblem, rng: np.random.Generator
    ) -> Generator[SearchProgress, None, Outcome]:
        """Move the swarm until nothing better was found for ``patience`` iterations."""
        return reported(problem, rng, lambda found: self._fly(problem, found, rng))

    def _fly(
        self, problem: MatchProblem, found: Found, rng: np.random.Generator
    ) -> Slices[Outcome]:
        params = self.params
        features = yield from read_features(problem.table, params.folded)
        yield from NnGrower(features, found).grow(random_seed_point(rng, params.folded))
        membership = yield from fit_membership(features, params.alpha, params.k, rng)
        grower = FsnnGrower(features, membership, found)
        if params.first == "swarm":
            return (yield from swarm(grower, params, found, rng))
        rows, pairs = features.similarity.shape
        for found.iteration, first in enumerate(np.ndindex(rows, 2 * pairs), 1):
            yield from grower.grow_from(*first)
            yield
        return Outcome.CONVERGED
