"""The evolutionary algorithm for scene matching."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from functools import partial
from typing import Literal

import numpy as np
from pydantic import Field

from sketchmatch.api import MatchProblem, Outcome, Params, Searcher, SearchProgress
from sketchmatch.model import (
    FloatArray,
    Fmap,
    IntArray,
    RelationTable,
    correspondences,
    object_pairs,
)
from sketchmatch_builtin.searchers._evolution import (
    evolve_object_maps,
    evolve_pair_maps,
    found_object_maps,
    found_pair_maps,
)

__all__ = ["Easm"]

_REPORT_EVERY = 0.02


class Easm(Searcher):
    """Evolves a population of FMAPs by uniform cross-over, mutation and survival of the fittest.

    Parents are drawn at random; parents and offspring compete; an FMAP is in the population at
    most once. After cross-over or mutation, elements in conflict change at random until the FMAP
    is legal. Under ``consistency = "object"`` the elements of the crossed FMAP are visited in
    random order and those that agree with the ones kept before are kept, so that the child mixes
    histogram correspondences of both parents and still follows from one object map.

    Source: thesis, section 3.8. The thesis leaves the size of the population open.
    """

    name = "easm"
    summary = "Evolutionary algorithm over histogram maps (the thesis's method)."

    class Params(Params):
        """Parameters of the evolution; rates as in the thesis."""

        consistency: Literal["object", "pairwise"] = Field(
            "object",
            description="What makes an FMAP legal: 'object', it follows from one object map; "
            "'pairwise', it is one-to-one and holds no histogram beside its dual.",
        )
        population: int | None = Field(
            None,
            ge=2,
            le=100_000,
            description="Number of FMAPs that live at once; when left out, 25 for each object of "
            "the larger scene, at least 100 and at most 400.",
        )
        crossover_rate: float = Field(
            0.7, ge=0, le=1, description="Pc, probability that two parents cross over."
        )
        exchange_rate: float = Field(
            0.5,
            ge=0,
            le=1,
            description="Px, probability that an element is swapped in a cross-over.",
        )
        mutation_rate: float = Field(
            0.3, ge=0, le=1, description="Pm, probability that a parent mutates."
        )
        generations: int = Field(
            20_000, ge=1, le=10_000_000, description="Limit on the number of generations."
        )
        patience: int = Field(
            400,
            ge=1,
            le=10_000_000,
            description="Generations without a better best after which it has converged.",
        )

    params: Params

    @classmethod
    def warm_up(cls) -> None:
        """Compile the kernels for both meanings of a legal FMAP."""
        one = np.ones((1, 1))
        table = RelationTable(one, one, one, 2, 2)
        for consistency in ("object", "pairwise"):
            params = cls.Params(consistency=consistency, population=2, generations=1)
            list(cls(params).search(MatchProblem(table), np.random.default_rng(0)))

    def search(
        self, problem: MatchProblem, rng: np.random.Generator
    ) -> Generator[SearchProgress, None, Outcome]:
        """Evolve until nothing better was found for ``patience`` generations."""
        params = self.params
        population = self._empty_population(problem)
        fitness = np.empty(len(population))
        found, evolve = self._operators(problem, population, fitness, rng)
        evaluations = found()
        best, stale, reported = float(fitness[0]), 0, -np.inf
        for generation in range(1, params.generations + 1):
            evaluations += evolve()
            stale = 0 if fitness[0] > best else stale + 1
            best = float(fitness[0])
            last = stale == params.patience or generation == params.generations
            if last or time.monotonic() - reported > _REPORT_EVERY:
                reported = time.monotonic()
                fmap = self._fmap(population[0], problem)
                yield SearchProgress(fmap, best, generation, evaluations)
            if stale == params.patience:
                return Outcome.CONVERGED
        return Outcome.ITERATION_LIMIT

    def _empty_population(self, problem: MatchProblem) -> IntArray:
        table = problem.table
        by_object = self.params.consistency == "object"
        genes = table.template_objects if by_object else table.template_pairs
        size = self.params.population or min(max(100, 25 * table.argument_objects), 400)
        return np.empty((size, genes), dtype=np.int64)

    def _operators(
        self,
        problem: MatchProblem,
        population: IntArray,
        fitness: FloatArray,
        rng: np.random.Generator,
    ) -> tuple[Callable[[], int], Callable[[], int]]:
        """Return what fills the population and what runs one generation, both in place."""
        table, params = problem.table, self.params
        offspring = np.empty((2 * len(population), population.shape[1]), dtype=np.int64)
        relations = (
            table.similarity,
            table.cosine,
            table.sine,
            table.normalized_dilation,
            np.array(problem.weights, dtype=np.float64),
        )
        rates = (params.crossover_rate, params.exchange_rate, params.mutation_rate)
        state = (population, fitness, offspring)
        if params.consistency == "pairwise":
            return (
                partial(found_pair_maps, *state, relations, rng),
                partial(evolve_pair_maps, *state, relations, rates, rng),
            )
        pairs = object_pairs(table.template_objects)
        columns = correspondences(table.argument_objects)
        return (
            partial(found_object_maps, *state, pairs, columns, relations, rng),
            partial(evolve_object_maps, *state, pairs, columns, relations, rates, rng),
        )

    def _fmap(self, individual: IntArray, problem: MatchProblem) -> Fmap:
        if self.params.consistency == "pairwise":
            return Fmap(individual)
        return Fmap.from_object_map(individual, problem.table.argument_objects)
