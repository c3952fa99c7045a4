"""Simulated annealing over object maps."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from typing import NamedTuple

import numpy as np
from pydantic import Field

from sketchmatch import api
from sketchmatch.api import MatchProblem, Outcome, Searcher, SearchProgress
from sketchmatch.api.kernels import (
    MapState,
    confidence_after,
    empty_map_state,
    kernel,
    make_move,
    map_confidence,
    place_map,
)
from sketchmatch.model import FloatArray, Fmap, IntArray, RelationTable

__all__ = ["Annealing"]

_REPORT_EVERY = 0.02
"""Seconds; a searcher must yield every 50 ms."""

_ENTRIES = 30_000
"""Entries of the relation table to read between two pauses, in a few milliseconds."""

_SAMPLES = 100
"""Random moves that are weighed to find out how hot it should be."""

_GAIN = 1e-12
"""Less is rounding."""


class Annealing(Searcher):
    """Lets an object map crystallise: moves that lower ζ become rarer as it cools.

    A move gives an object another partner; the object that has that partner, if any, takes the
    old one in exchange. One sweep proposes every move once, in order. A move that lowers ζ by d is
    made with probability exp(−d/T) (Metropolis). The temperature T falls geometrically from sweep
    to sweep, in proportion to what random moves do to ζ, so that the parameters suit problems of
    any size. At last only moves that raise ζ are made, until there is none. Then the next run
    begins with a new random map.

    Any map that objects induce is consistent, so the search never meets an illegal FMAP.

    References
    ----------
    S. Kirkpatrick, C. D. Gelatt, M. P. Vecchi, "Optimization by simulated annealing", Science
    220(4598), 1983.

    D. T. Connolly, "An improved annealing scheme for the QAP", European Journal of Operational
    Research 46(1), 1990: moves in order instead of at random, temperatures from a sample of moves.
    """

    name = "annealing"
    summary = "Simulated annealing over object maps."

    class Params(api.Params):
        """How slowly it cools, and how often."""

        sweeps: int = Field(
            default=50, ge=1, le=1_000_000, description="Sweeps of a run, while it cools."
        )
        hottest: float = Field(
            default=0.8,
            gt=0,
            le=100,
            description="Temperature of the first sweep, in standard deviations of what random "
            "moves do to ζ.",
        )
        coldest: float = Field(
            default=0.25,
            gt=0,
            le=100,
            description="Temperature of the last sweep, in the same unit.",
        )
        patience: int = Field(
            default=10,
            ge=1,
            le=1_000_000,
            description="Runs without a better best after which it ends.",
        )
        runs: int = Field(
            default=1000, ge=1, le=1_000_000, description="Limit on the number of runs."
        )

    params: Params

    @classmethod
    def warm_up(cls) -> None:
        """Compile the kernels."""
        ones = np.ones((3, 3))
        problem = MatchProblem(RelationTable(ones, ones, ones, 3, 3))
        list(cls(cls.Params(runs=1)).search(problem, np.random.default_rng(0)))

    def search(
        self, problem: MatchProblem, rng: np.random.Generator
    ) -> Generator[SearchProgress, None, Outcome]:
        """Anneal again and again until nothing better was found for ``patience`` runs."""
        walk = _Walk(problem, rng)
        stale, told = 0, -np.inf
        for _ in range(self.params.runs):
            before = walk.best
            for _ in walk.run(self.params):
                if time.monotonic() - told > _REPORT_EVERY:
                    yield walk.progress()
                    told = time.monotonic()
            stale = 0 if walk.best > before + _GAIN else stale + 1
            if stale == self.params.patience:
                break
        yield walk.progress()
        return Outcome.CONVERGED if stale == self.params.patience else Outcome.ITERATION_LIMIT


class _Walk:
    """A walk from map to map, and the best map on its way."""

    def __init__(self, problem: MatchProblem, rng: np.random.Generator) -> None:
        self.table, self.rng = problem.table, rng
        self.state = empty_map_state(problem.table, problem.weights)
        self.found = _Found(np.zeros(problem.table.template_objects, dtype=np.int64), np.zeros(1))
        self.found.confidence[0] = -1.0
        self.sweeps = self.evaluations = 0

    @property
    def best(self) -> float:
        """The highest ζ so far; below 0 before there is any."""
        return float(self.found.confidence[0])

    def run(self, params: Annealing.Params) -> Iterator[None]:
        """Walk from a random map until it is cold and no move helps, with pauses."""
        objects, others = self.table.template_objects, self.table.argument_objects
        place_map(self.state, self.rng.permutation(others)[:objects])
        _keep(self.state, self.found)
        spread = _spread(self.state, self.found, self.rng, _SAMPLES)
        self.evaluations += 1 + _SAMPLES
        yield
        for temperature in spread * np.geomspace(params.hottest, params.coldest, params.sweeps):
            yield from self._sweep(float(temperature))
        while (yield from self._sweep(0.0)) > 0:
            pass

    def _sweep(self, temperature: float) -> Generator[None, None, int]:
        """Propose every move once and return how many were made."""
        size = self.table.template_objects * self.table.argument_objects
        step = max(1, _ENTRIES // (2 * self.table.template_objects))
        made = 0
        for first in range(0, size, step):
            last = min(first + step, size)
            tally = _propose(self.state, self.found, self.rng, first, last, temperature)
            self.evaluations += tally[0]
            made += tally[1]
            yield
        self.sweeps += 1
        return made

    def progress(self) -> SearchProgress:
        """Return the state as the host sees it."""
        fmap = Fmap.from_object_map(self.found.partners, self.table.argument_objects)
        return SearchProgress(fmap, self.best, self.sweeps, self.evaluations)


class _Found(NamedTuple):
    """The best map so far, changed in place: its partners, shape (N,), and its ζ, shape (1,)."""

    partners: IntArray
    confidence: FloatArray


@kernel
def _propose(
    state: MapState,
    found: _Found,
    rng: np.random.Generator,
    first: int,
    last: int,
    temperature: float,
) -> tuple[int, int]:
    """Propose the moves with these numbers; return how many were weighed and how many made."""
    others = state.holders.size
    here = map_confidence(state)
    weighed = made = 0
    for move in range(first, last):
        a, c = move // others, move % others
        # An exchange with an object before a has been proposed already.
        if 0 <= state.holders[c] <= a:
            continue
        gain = confidence_after(state, a, c) - here
        weighed += 1
        if gain > _GAIN or (temperature > 0.0 and rng.random() < np.exp(gain / temperature)):
            here = make_move(state, a, c)
            made += 1
            _keep(state, found)
    return weighed, made


@kernel
def _spread(state: MapState, found: _Found, rng: np.random.Generator, samples: int) -> float:
    """Make random moves and return the standard deviation of what they do to ζ."""
    objects, others = state.partners.size, state.holders.size
    total = squares = 0.0
    here = map_confidence(state)
    for _ in range(samples):
        a, c = int(rng.random() * objects), int(rng.random() * others)
        if c != state.partners[a]:
            there = make_move(state, a, c)
            total += there - here
            squares += (there - here) ** 2
            here = there
            _keep(state, found)
    return float(np.sqrt(max(0.0, squares / samples - (total / samples) ** 2)))


@kernel
def _keep(state: MapState, found: _Found) -> None:
    """Remember the current map if it is the best so far."""
    value = map_confidence(state)
    if value > found.confidence[0]:
        found.confidence[0] = value
        found.partners[:] = state.partners
