"""The nearest neighbour approach, its seed points chosen by a particle swarm."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from sketchmatch.api import MatchProblem, Outcome, Searcher, SearchProgress
from sketchmatch.model import RelationTable
from sketchmatch_builtin.searchers._growers import (
    Found,
    NnGrower,
    Slices,
    read_features,
    reported,
)
from sketchmatch_builtin.searchers._swarm import SwarmParams, swarm

__all__ = ["NnPso"]


class NnPso(Searcher):
    """Grows FMAPs as ``nn`` does, from seed points that a particle swarm chooses.

    The swarm has a star neighbourhood and ζ as its fitness. The search begins with a random FMAP.
    The scale of a sketch has no effect, as in ``nn``.

    References
    ----------
    "Scene Matching Between a Quantitative Map and a Qualitative Hand Drawn Sketch", thesis,
    sections 3.5 and 3.7.1, after Sjahputera and Keller (2005).

    Examples
    --------
    A swarm of ten that moves until five iterations brought nothing better:

    >>> from sketchmatch.testing import is_legal, is_object_consistent, matching_problem
    >>> problem, truth = matching_problem(np.random.default_rng(0), objects=5, missing=1)
    >>> searcher = NnPso(NnPso.Params(particles=10, patience=5))
    >>> *_, last = searcher.search(problem, np.random.default_rng(0))
    >>> is_legal(last.fmap, problem.table), is_object_consistent(last.fmap, problem.table)
    (True, False)
    >>> round(last.confidence, 2), last.evaluations
    (0.97, 71)
    """

    name = "nn-pso"
    summary = "Particle swarm over seed points, FMAPs grown by distance."
    object_consistent = False

    class Params(SwarmParams):
        """Parameters of the swarm; the thesis leaves particles, c1, c2 and iterations open."""

    params: Params

    @property
    def most_maps(self) -> int:
        """Those of the swarm."""
        return self.params.most_maps

    @classmethod
    def warm_up(cls) -> None:
        """Compile the kernels."""
        one = np.ones((1, 1))
        problem = MatchProblem(RelationTable(one, one, one, 2, 2))
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
        features = yield from read_features(problem.table, self.params.folded)
        grower = NnGrower(features, found)
        return (yield from swarm(grower, self.params, found, rng))
