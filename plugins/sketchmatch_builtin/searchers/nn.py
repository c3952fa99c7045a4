"""The nearest neighbour approach."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
from pydantic import Field

from sketchmatch.api import MatchProblem, Outcome, Searcher, SearchProgress
from sketchmatch.model import RelationTable
from sketchmatch_builtin.searchers._growers import (
    Found,
    GrowthParams,
    NnGrower,
    Slices,
    random_seed_point,
    read_features,
    reported,
)

__all__ = ["Nn"]


class Nn(Searcher):
    """Grows one FMAP from each of several random seed points and keeps the best [1]_.

    Histogram correspondences enter the FMAP in the order of their Euclidean distance from the seed
    point in (σ̂, R̂, L̂), unless they conflict with one that is in it. It is one-to-one and
    contains no histogram together with its dual, but need not lead to a consistent object map. The
    search begins with a random FMAP.

    L̂ of seed points is relative to the mean of all L̂, which changes no distance between
    correspondences: the thesis draws it from ±0.5, as if sketch and map had one scale. The thesis
    leaves the number of seed points open.

    References
    ----------
    .. [1] "Scene Matching Between a Quantitative Map and a Qualitative Hand Drawn Sketch", thesis,
       section 3.5, after Sjahputera and Keller (2005).

    Examples
    --------
    The best of what 50 seed points lead to is legal, and leads to no object map here:

    >>> from sketchmatch.testing import is_legal, is_object_consistent, matching_problem
    >>> problem, truth = matching_problem(np.random.default_rng(0), objects=5, missing=1)
    >>> searcher = Nn(Nn.Params(seed_points=50))
    >>> *_, last = searcher.search(problem, np.random.default_rng(0))
    >>> is_legal(last.fmap, problem.table), is_object_consistent(last.fmap, problem.table)
    (True, False)
    >>> round(last.confidence, 2), last.evaluations  # of each seed point, and of the random FMAP
    (0.95, 51)
    """

    name = "nn"
    summary = "Nearest neighbours of random seed points (the thesis's baseline)."
    object_consistent = False

    class Params(GrowthParams):
        """How often it tries, and what R̂ is."""

        seed_points: int = Field(
            1000, ge=1, le=10_000_000, description="Number of random seed points."
        )

    params: Params

    @property
    def most_maps(self) -> int:
        """One of each seed point."""
        return self.params.seed_points

    @classmethod
    def warm_up(cls) -> None:
        """Compile the kernels."""
        one = np.ones((1, 1))
        problem = MatchProblem(RelationTable(one, one, one, 2, 2))
        list(cls(cls.Params(seed_points=1)).search(problem, np.random.default_rng(0)))

    def search(
        self, problem: MatchProblem, rng: np.random.Generator
    ) -> Generator[SearchProgress, None, Outcome]:
        """Grow an FMAP from each seed point."""
        return reported(problem, rng, lambda found: self._grow_all(problem, found, rng))

    def _grow_all(
        self, problem: MatchProblem, found: Found, rng: np.random.Generator
    ) -> Slices[Outcome]:
        folded = self.params.folded
        grower = NnGrower((yield from read_features(problem.table, folded)), found)
        for iteration in range(1, self.params.seed_points + 1):
            yield from grower.grow(random_seed_point(rng, folded))
            found.iteration = iteration
            yield
        return Outcome.ITERATION_LIMIT
