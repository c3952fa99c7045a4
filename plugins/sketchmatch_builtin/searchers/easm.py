"""The evolutionary algorithm for scene matching."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
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
    breed_object_maps,
    breed_pair_maps,
    found_object_maps,
    found_pair_maps,
    judge_object_maps,
    judge_pair_maps,
)

__all__ = ["Easm"]

_REPORT_EVERY = 0.02
# What is judged between two looks at the clock: about 10 ms.
_SLICE_ENTRIES = 200_000


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
        state = self._state(problem, rng)
        chunk = max(1, _SLICE_ENTRIES // problem.table.template_pairs)
        best, stale, evaluations, reported = -1.0, -1, 0, -np.inf
        for generation in range(params.generations + 1):
            bred = state.breed() if generation else state.found()
            for first in range(0, max(1, bred), chunk):
                last = min(bred, first + chunk)
                state.judge(state.offspring[first:last])
                evaluations += last - first
                if time.monotonic() - reported > _REPORT_EVERY:
                    reported = time.monotonic()
                    yield self._progress(problem, state, generation, evaluations)
            stale = 0 if state.fitness[0] > best else stale + 1
            best = float(state.fitness[0])
            if stale == params.patience:
                break
        last_progress = self._progress(problem, state, generation, evaluations)
        # Several FMAPs may lead to one object map, so there are more than are wanted.
        others = state.population[1 : 1 + 4 * problem.alternatives]
        alternatives = tuple(self._fmap(other, problem) for other in others)
        yield replace(last_progress, alternatives=alternatives)
        return Outcome.CONVERGED if stale == params.patience else Outcome.ITERATION_LIMIT

    def _state(self, problem: MatchProblem, rng: np.random.Generator) -> _State:
        """Return an empty population and what works on it in place."""
        table, params = problem.table, self.params
        by_object = params.consistency == "object"
        size = params.population or min(max(100, 25 * table.argument_objects), 400)
        genes = table.template_objects if by_object else table.template_pairs
        population, fitness = np.empty((size, genes), dtype=np.int64), np.empty(size)
        offspring = np.empty((2 * size, genes), dtype=np.int64)
        relations = (
            table.similarity,
            table.cosine,
            table.sine,
            table.normalized_dilation,
            np.array(problem.weights, dtype=np.float64),
        )
        rates = (params.crossover_rate, params.exchange_rate, params.mutation_rate)

        def judge(some: IntArray) -> None:
            if by_object:
                judge_object_maps(population, fitness, some, pairs, columns, relations)
            else:
                judge_pair_maps(population, fitness, some, relations)

        if by_object:
            pairs = object_pairs(table.template_objects)
            columns = correspondences(table.argument_objects)
            found = partial(found_object_maps, population, fitness, offspring, len(columns), rng)
            breed = partial(
                breed_object_maps, population, offspring, pairs, len(columns), rates, rng
            )
        else:
            others = table.argument_pairs
            found = partial(found_pair_maps, population, fitness, offspring, others, rng)
            breed = partial(breed_pair_maps, population, offspring, others, rates, rng)
        return _State(population, fitness, offspring, found, breed, judge)

    def _progress(
        self, problem: MatchProblem, state: _State, generation: int, evaluations: int
    ) -> SearchProgress:
        fmap = self._fmap(state.population[0], problem)
        return SearchProgress(fmap, float(state.fitness[0]), generation, evaluations)

    def _fmap(self, individual: IntArray, problem: MatchProblem) -> Fmap:
        if self.params.consistency == "pairwise":
            return Fmap(individual.copy())
        return Fmap.from_object_map(individual, problem.table.argument_objects)


@dataclass(frozen=True)
class _State:
    """A population, sorted, with its offspring, and the steps of the evolution."""

    population: IntArray
    fitness: FloatArray
    offspring: IntArray
    found: Callable[[], int]
    breed: Callable[[], int]
    judge: Callable[[IntArray], None]
