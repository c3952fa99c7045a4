"""The evolutionary algorithm for scene matching."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import Field

from sketchmatch.api import MatchProblem, Outcome, Params, Searcher, SearchProgress
from sketchmatch.api.kernels import fmap_confidence_above
from sketchmatch.model import (
    DILATION_SCALE,
    Fmap,
    IntArray,
    RelationTable,
    correspondences,
    object_pairs,
)
from sketchmatch.model.arrays import sealed
from sketchmatch_builtin.searchers._evolution import (
    EVALUATIONS,
    GENERATION,
    MEMBERS,
    STALE,
    TRIAL,
    Evolution,
    evolve,
    populate,
)
from sketchmatch_builtin.searchers._relations import read_slices

__all__ = ["Easm"]

_REPORT_EVERY = 0.02
# What is drawn and judged between two looks at the clock: 10 ms.
_SLICE_ENTRIES = 50_000
# Of the populations that follow from the scenes.
_LARGEST = 600
# 512 kB of hash codes, to stay in the cache.
_KNOWN = 2**16


class Easm(Searcher):
    """Evolves a population of FMAPs by uniform cross-over, mutation and survival of the fittest.

    Parents are drawn at random; parents and offspring compete; an FMAP is in the population at
    most once. After cross-over or mutation, elements in conflict change at random until the FMAP
    is legal. Under ``consistency = "object"`` the elements of the crossed FMAP are visited in
    random order and those that agree with the ones kept before are kept, so that the child mixes
    histogram correspondences of both parents and still follows from one object map.

    The thesis leaves the size of the population open.

    References
    ----------
    "Scene Matching Between a Quantitative Map and a Qualitative Hand Drawn Sketch", thesis,
    section 3.8.

    Examples
    --------
    A small population finds the truth about a sketch of four things on a map of five:

    >>> from sketchmatch.testing import mapped_pairs, matching_problem
    >>> problem, truth = matching_problem(np.random.default_rng(0), objects=5, missing=1)
    >>> searcher = Easm(Easm.Params(population=20, patience=20))
    >>> *_, last = searcher.search(problem, np.random.default_rng(0))
    >>> truth.tolist(), mapped_pairs(last.fmap, problem.table)[:3]
    ([4, 1, 3, 0], [(4, 1), (4, 3), (4, 0)])
    >>> last.iteration, last.evaluations  # generations, and FMAPs judged
    (30, 450)
    """

    name = "easm"
    summary = "Evolutionary algorithm over histogram maps (the thesis's method)."

    class Params(Params):
        """Parameters of the evolution; rates as in the thesis."""

        consistency: Literal["object", "pairwise"] = Field(
            "object",
            description="What makes an FMAP legal: 'object', it follows from one object map; "
            "'pairwise', it is one-to-one and contains no histogram together with its dual.",
        )
        population: int | None = Field(
            None,
            ge=2,
            le=100_000,
            description="Number of FMAPs in the population; by default twice the square of the "
            "number of objects in the larger scene, at least 100 and at most 600.",
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
            description="Generations without an improvement after which the search has converged.",
        )

    params: Params

    @property
    def object_consistent(self) -> bool:
        """Whether that is what makes an FMAP legal."""
        return self.params.consistency == "object"

    @property
    def most_maps(self) -> int:
        """Those of the largest population there may be, in each generation."""
        return (self.params.population or _LARGEST) * self.params.generations

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
        evolution = self._evolution(problem, rng)
        reported = -np.inf
        for _ in self._steps(problem.table, evolution, rng):
            if time.monotonic() - reported > _REPORT_EVERY:
                yield self._progress(problem, evolution)
                reported = time.monotonic()
        # Several FMAPs may lead to one object map, so there are more than are wanted.
        members = min(1 + 4 * problem.alternatives, evolution.status[MEMBERS])
        alternatives = tuple(self._fmap(evolution, k, problem) for k in range(1, members))
        yield replace(self._progress(problem, evolution), alternatives=alternatives)
        stale = evolution.status[STALE] == params.patience
        return Outcome.CONVERGED if stale else Outcome.ITERATION_LIMIT

    def _steps(
        self, table: RelationTable, evolution: Evolution, rng: np.random.Generator
    ) -> Iterator[None]:
        """Do all the work; the population has a first member at every pause."""
        _begin(table, evolution, rng)
        yield
        for _ in read_slices(table, evolution.cosine, evolution.sine, evolution.dilation):
            yield
        while not populate(evolution, _SLICE_ENTRIES):
            yield
        limits = (self.params.generations, self.params.patience)
        while not evolve(evolution, *limits, _SLICE_ENTRIES):
            yield

    def _evolution(self, problem: MatchProblem, rng: np.random.Generator) -> Evolution:
        """Return a population without members, and relations that are yet to be read."""
        table, params = problem.table, self.params
        by_object = params.consistency == "object"
        size = params.population or min(max(100, 2 * table.argument_objects**2), _LARGEST)
        genes = table.template_objects if by_object else table.template_pairs
        others = table.argument_objects if by_object else table.argument_pairs
        shape = table.similarity.shape
        return Evolution(
            by_object=by_object,
            rates=np.array([params.crossover_rate, params.exchange_rate, params.mutation_rate]),
            pairs=object_pairs(table.template_objects),
            columns=correspondences(table.argument_objects),
            evidence=table.entry_evidence,
            cosine=np.empty(shape),
            sine=np.empty(shape),
            dilation=np.empty(shape),
            weights=np.array(problem.weights, dtype=np.float64),
            individuals=np.empty((3 * size, genes), dtype=np.int64),
            places=np.arange(3 * size),
            fitness=np.full(3 * size, -1.0),
            known=np.zeros(_KNOWN, dtype=np.int64),
            status=np.zeros(7, dtype=np.int64),
            order=np.arange(table.template_pairs),
            entries=np.empty(table.template_pairs, dtype=np.int64),
            holders=np.empty((2, others), dtype=np.int64),
            free=np.empty(others, dtype=np.int64),
            scratch=np.empty(table.template_pairs),
            seed=rng.integers(1, 2**64, 1, dtype=np.uint64),
        )

    def _progress(self, problem: MatchProblem, evolution: Evolution) -> SearchProgress:
        status = evolution.status
        return SearchProgress(
            self._fmap(evolution, 0, problem),
            float(evolution.fitness[0]),
            int(status[GENERATION]),
            int(status[EVALUATIONS]),
        )

    def _fmap(self, evolution: Evolution, rank: int, problem: MatchProblem) -> Fmap:
        individual: IntArray = evolution.individuals[evolution.places[rank]]
        if evolution.by_object:
            return Fmap.from_object_map(individual, problem.table.argument_objects)
        return Fmap(individual.copy())


def _begin(table: RelationTable, evolution: Evolution, rng: np.random.Generator) -> None:
    """Make a random individual the first member, before the relations are read."""
    first = evolution.individuals[0]
    if evolution.by_object:
        first[:] = rng.permutation(table.argument_objects)[: first.size]
        entries = evolution.columns[first[evolution.pairs[:, 0]], first[evolution.pairs[:, 1]]]
    else:
        first[:] = entries = rng.permutation(table.argument_pairs)[: first.size]
    column = entries % table.argument_pairs
    rows = np.arange(table.template_pairs)
    evidence = table.entry_evidence
    own = entries if evidence.shape[1] > table.argument_pairs else column
    rotation, counts = table.rotation[rows, column, None], table.rotation_weights[:, None]
    evolution.fitness[0] = fmap_confidence_above(
        -1.0,
        (entries != column).astype(np.int64),
        evolution.scratch,
        sealed(evidence[rows, own, None]),
        counts * np.cos(rotation),
        counts * np.sin(rotation),
        DILATION_SCALE * np.log(table.dilation[rows, column, None]),
        evolution.weights,
    )[0]
    evolution.status[[MEMBERS, TRIAL, EVALUATIONS]] = 1
    evolution.status[STALE] = -1
