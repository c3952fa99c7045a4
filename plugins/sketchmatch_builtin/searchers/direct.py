"""Memetic search over object maps."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from sketchmatch.api import MatchProblem, Outcome, Params, Searcher, SearchProgress
from sketchmatch.api.kernels import empty_map_state, place_map
from sketchmatch.model import RelationTable, object_pairs
from sketchmatch_builtin.searchers._memetic import Plan, admit, breed, offer
from sketchmatch_builtin.searchers._moves import (
    GAIN,
    climb,
    empty_moves,
    read_relations,
    renew_moves,
    weigh_moves,
)
from sketchmatch_builtin.searchers._ranking import Ranking, empty_ranking, ranked_fmaps

__all__ = ["Direct", "Evolved", "evolve"]

_REPORT_EVERY = 0.02
_VALUES = 100_000
"""Values of the relation table to read between two pauses."""

_ENTRIES = 1_000_000
"""Entries to read between two pauses of a climb."""


class Direct(Searcher):
    """Matches the objects themselves by evolution of object maps, each a local optimum.

    Matching objects instead of histograms is the thesis's closing idea [1]_, evolution with local
    search a memetic algorithm [2]_.

    The first maps are made for global rotations over the full turn and any dilation: each object
    takes a partner that, on average over all others, lies in the same direction, as far away, and
    is as similar. Then the better maps of the population cross with each other, or with a new map
    for their own rotation and dilation. Before it competes, every map climbs to a local optimum
    under two moves: exchanging the partners of two objects, and moving one object to an unused
    partner. All moves of a map are evaluated at once, each in constant time [3]_, and ζ is exact.

    The alternatives are the best other maps met, completed by all single moves from them.

    References
    ----------
    .. [1] "Scene Matching Between a Quantitative Map and a Qualitative Hand Drawn Sketch", thesis,
       section 5.
    .. [2] P. Moscato, "On evolution, search, optimization, genetic algorithms and martial arts:
       towards memetic algorithms", 1989.
    .. [3] É. Taillard, "Robust taboo search for the quadratic assignment problem", Parallel
       Computing 17, 1991.

    Examples
    --------
    A sketch of 12 things and a map of 20: too many object maps to try them all.

    >>> from sketchmatch.model import Fmap
    >>> from sketchmatch.testing import matching_problem
    >>> problem, truth = matching_problem(np.random.default_rng(0), objects=20, missing=8)
    >>> searcher = Direct(Direct.Params(offspring=100))
    >>> *_, last = searcher.search(problem, np.random.default_rng(0))
    >>> right = Fmap.from_object_map(truth, 20)
    >>> bool((last.fmap.entries == right.entries).all())
    True
    >>> last.iteration, last.upper_bound  # maps that climbed; it proves nothing
    (100, None)
    """

    name = "direct"
    summary = "Memetic search over object maps, good to 100 x 100 objects."

    class Params(Params):
        """Parameters of the evolution."""

        population: int | None = Field(
            None,
            ge=2,
            le=10_000,
            description="Number of object maps in the population; by default 60, proportionally "
            "fewer beyond 50 template objects.",
        )
        tournament: int = Field(
            4,
            ge=1,
            le=1000,
            description="Number of random maps of which the best becomes a parent.",
        )
        renewal_rate: float = Field(
            0.5,
            ge=0,
            le=1,
            description="Probability that a parent crosses with a new map instead of another "
            "parent.",
        )
        exchange_rate: float = Field(
            0.3,
            ge=0,
            le=1,
            description="Probability that an object takes its partner from the second parent.",
        )
        variety: float = Field(
            0.03, ge=0, le=10, description="Randomness of new maps, in units of ζ."
        )
        offspring: int = Field(
            100_000, ge=1, le=1_000_000_000, description="Limit on the number of maps that climb."
        )
        patience: int | None = Field(
            None,
            ge=1,
            le=1_000_000_000,
            description="Maps without an improvement after which the search has converged; by "
            "default 200, and 40 more for each argument object that a map leaves over, up to 30 of "
            "these; fewer beyond 30 template objects.",
        )

    params: Params

    @property
    def most_maps(self) -> int:
        """All that climb."""
        return self.params.offspring

    @classmethod
    def warm_up(cls) -> None:
        """Compile the kernels."""
        rng = np.random.default_rng(0)
        similarity, rotation, dilation = rng.uniform(0.1, 0.9, (3, 3, 6))
        table = RelationTable(similarity, rotation, dilation, 3, 4)
        params = cls.Params(population=2, offspring=4)
        list(cls(params).search(MatchProblem(table, alternatives=1), rng))

    def search(
        self, problem: MatchProblem, rng: np.random.Generator
    ) -> Generator[SearchProgress, None, Outcome]:
        """Evolve until nothing better was found for ``patience`` maps."""
        evolved = yield from evolve(problem, self.params, rng)
        return evolved.outcome


@dataclass(frozen=True)
class Evolved:
    """What an evolution leads to.

    Attributes
    ----------
    outcome
        Why it ended.
    found
        The best maps met.
    iterations, evaluations
        Maps that climbed, and maps evaluated.
    """

    outcome: Outcome
    found: Ranking
    iterations: int
    evaluations: int


def evolve(
    problem: MatchProblem,
    params: Direct.Params,
    rng: np.random.Generator,
    upper_bound: float | None = None,
) -> Generator[SearchProgress, None, Evolved]:
    """Search as :class:`Direct` does, for others that build on it.

    Parameters
    ----------
    problem, params, rng
        As for any searcher.
    upper_bound
        What every progress says about it.

    Returns
    -------
    Evolved
        The maps, one more than there are alternatives wanted.
    """
    evolution = _Evolution(problem, params, rng, upper_bound)
    yield evolution.progress()
    reported = time.monotonic()
    for stage in (evolution.prepare(), evolution.run(), evolution.explore()):
        for _ in stage:
            if time.monotonic() - reported > _REPORT_EVERY:
                yield evolution.progress()
                reported = time.monotonic()
    yield evolution.progress()
    return Evolved(evolution.outcome(), evolution.kept, evolution.born, evolution.evaluations)


def _population(objects: int) -> int:
    """Return a population: where each map takes long, better maps come sooner from fewer."""
    return max(10, 60 * 50 // max(objects, 50))


def _patience(objects: int, others: int) -> int:
    """Return a patience: more where there are many maps, less where each takes long."""
    patience = 200 + 40 * min(others - objects, 30)
    share: float = (30 / max(objects, 30)) ** 1.5
    return round(share * patience)


class _Evolution:
    """The state of a search; its stages yield, every 10 ms or so, where it may pause."""

    def __init__(
        self,
        problem: MatchProblem,
        params: Direct.Params,
        rng: np.random.Generator,
        upper_bound: float | None,
    ) -> None:
        self.table, self.params, self.rng = problem.table, params, rng
        self.upper_bound = upper_bound
        self.plan = Plan(
            params.tournament, params.renewal_rate, params.exchange_rate, params.variety
        )
        objects, others = self.table.template_objects, self.table.argument_objects
        self.state = empty_map_state(self.table, problem.weights)
        self.moves = empty_moves(objects, others, self.table.evidence is not None)
        self.leanings = np.zeros((objects, others, 3))
        self.members = empty_ranking(params.population or _population(objects), objects)
        self.kept = empty_ranking(problem.alternatives + 1, objects)
        self.patience = params.patience or _patience(objects, others)
        self.born = self.stale = 0
        first = rng.permutation(others)[:objects]
        place_map(self.state, first)
        admit(self.state, self.kept, self.kept)

    def prepare(self) -> Iterator[None]:
        """Read the relation table."""
        pairs = object_pairs(self.table.template_objects)
        others = object_pairs(self.table.argument_objects)
        size = self.table.similarity.size
        for first in range(0, size, _VALUES):
            last = min(first + _VALUES, size)
            read_relations(self.state, self.moves, pairs, others, first, last, self.leanings)
            yield

    def run(self) -> Iterator[None]:
        """Breed, climb and select."""
        while self.born < self.params.offspring and self.stale < self.patience:
            breed(
                self.state, self.moves, self.members, self.leanings, self.born, self.plan, self.rng
            )
            self.moves.status[:] = 0
            floor = float(self.members.values[-1])
            while not climb(self.state, self.moves, floor, _ENTRIES):
                yield
            better = admit(self.state, self.members, self.kept)
            self.born += 1
            self.stale = 0 if better else self.stale + 1
            yield

    def explore(self) -> Iterator[None]:
        """Complete the alternatives by what single moves from the best maps lead to."""
        kept, explored = self.kept, set()
        while len(kept.values) > 1:
            maps = kept.maps[kept.values >= 0.0]
            left = [k for k in range(len(maps)) if maps[k].tobytes() not in explored]
            if not left:
                return
            partners = maps[left[0]]
            explored.add(partners.tobytes())
            place_map(self.state, partners)
            renew_moves(self.state, self.moves)
            yield
            for a in range(self.table.template_objects):
                weigh_moves(self.state, self.moves, a, float(kept.values[-1]) + GAIN)
                offer(self.state, self.moves, a, kept)
                yield

    def outcome(self) -> Outcome:
        """Return why it is over."""
        if self.stale >= self.patience:
            return Outcome.CONVERGED
        return Outcome.ITERATION_LIMIT

    @property
    def evaluations(self) -> int:
        """Number of maps evaluated so far."""
        return 1 + self.born + int(self.moves.evaluations[0])

    def progress(self) -> SearchProgress:
        """Return the state as the host sees it."""
        fmaps = ranked_fmaps(self.kept, self.table.argument_objects)
        return SearchProgress(
            fmaps[0],
            float(self.kept.values[0]),
            self.born,
            self.evaluations,
            self.upper_bound,
            tuple(fmaps[1:]),
        )
