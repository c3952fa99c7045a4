"""What grows FMAPs from seed points, by distance (NN) or by fuzzy closeness (FSNN).

Everything here works in slices: a generator that yields None after each.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Callable, Generator, Iterator
from typing import Literal, TypeVar

import numpy as np
from pydantic import Field

from sketchmatch.api import MatchProblem, Outcome, Params, SearchProgress
from sketchmatch.model import DILATION_SCALE, FloatArray, Fmap, IntArray, RelationTable
from sketchmatch_builtin.searchers._neighbours import (
    ClosenessStore,
    Features,
    FuzzyGrowth,
    Membership,
    NearestGrowth,
    distance_sums,
    entries_confidence,
    grow_closest,
    grow_nearest,
    nearest_vector,
    sampled_distance_sums,
)

__all__ = [
    "Found",
    "FsnnGrower",
    "Grower",
    "GrowthParams",
    "NnGrower",
    "Slices",
    "fit_membership",
    "random_seed_point",
    "read_features",
    "reported",
]

SLICE = 500_000
"""Distances or degrees of closeness in a slice: 1 to 10 ms."""
STORE_BYTES = 16 * 2**20
"""Room for the closeness between vectors: all of 8 × 8 objects fit. More gains no time, because
no FMAP grows twice."""
EXACT_PAIRS = 20_000_000
"""Up to so many pairs of vectors, m and v are exact: about 13 × 13 objects."""
SAMPLED_PAIRS = 2**20

_SMALLEST_VARIANCE = 1e-12
_SPARE = 4
_REPORT_EVERY = 0.02

_Result = TypeVar("_Result")
Slices = Generator[None, None, _Result]


class Found:
    """The best FMAPs found so far.

    Parameters
    ----------
    problem
        What is searched.

    Attributes
    ----------
    iteration
        Iterations done; whoever iterates counts them here.
    evaluations
        FMAPs evaluated.
    """

    def __init__(self, problem: MatchProblem) -> None:
        table = problem.table
        self._relations = (
            table.similarity,
            table.rotation,
            table.dilation,
            table.rotation_weights,
        )
        self._weights = np.array(problem.weights, dtype=np.float64)
        # FMAPs that lead to the same object map count once for the caller, so keep more.
        self._room = 1 + _SPARE * problem.alternatives
        self._ranked: list[tuple[float, IntArray]] = []
        self.iteration = 0
        self.evaluations = 0

    def offer(self, entries: IntArray) -> float:
        """Evaluate a legal FMAP, keep a copy if it is among the best, and return its ζ."""
        confidence = entries_confidence(entries, *self._relations, self._weights)
        self.evaluations += 1
        if len(self._ranked) < self._room or confidence > self._ranked[-1][0]:
            self._keep(confidence, entries)
        return confidence

    def progress(self) -> SearchProgress:
        """Return the state of the search."""
        (confidence, best), *others = self._ranked
        alternatives = tuple(Fmap(entries) for _, entries in others)
        return SearchProgress(
            Fmap(best), confidence, self.iteration, self.evaluations, alternatives=alternatives
        )

    def _keep(self, confidence: float, entries: IntArray) -> None:
        place = bisect_right(self._ranked, -confidence, key=lambda item: -item[0])
        before = place - 1
        while before >= 0 and self._ranked[before][0] == confidence:
            if np.array_equal(self._ranked[before][1], entries):
                return
            before -= 1
        self._ranked.insert(place, (confidence, entries.copy()))
        del self._ranked[self._room :]


def reported(
    problem: MatchProblem, rng: np.random.Generator, search: Callable[[Found], Slices[Outcome]]
) -> Generator[SearchProgress, None, Outcome]:
    """Run a search from a random FMAP on, yielding its state now and then and at the end."""
    found = Found(problem)
    found.offer(random_entries(problem.table, rng))
    work, yielded = search(found), -np.inf
    while True:
        if time.monotonic() - yielded > _REPORT_EVERY:
            yielded = time.monotonic()
            yield found.progress()
        try:
            next(work)
        except StopIteration as stop:
            yield found.progress()
            outcome: Outcome = stop.value
            return outcome


def random_entries(table: RelationTable, rng: np.random.Generator) -> IntArray:
    """Return a random FMAP that is one-to-one and holds no histogram beside its dual."""
    rows, pairs = table.template_pairs, table.argument_pairs
    entries = rng.permutation(pairs)[:rows] + pairs * rng.integers(0, 2, rows)
    return entries.astype(np.int64)


class GrowthParams(Params):
    """How histogram correspondences become points."""

    rotation: Literal["circular", "folded"] = Field(
        "circular",
        description="Definition of R̂. circular: R/180°, compared modulo 2, so that all rotations "
        "of a sketch are alike. folded: as printed in the thesis, R/180° up to 180° and back to 0 "
        "beyond; a sketch rotated by 90° is lost then, because a correspondence and its dual are "
        "one point.",
    )

    @property
    def folded(self) -> bool:
        """Whether R̂ is as the thesis prints it."""
        return self.rotation == "folded"


def random_seed_point(rng: np.random.Generator, folded: bool) -> FloatArray:
    """Return σ̂ ~ U[0, 1], R̂ ~ U[0, 1] or, where it is circular, U[0, 2], and L̂ ~ U[−0.5, 0.5].

    L̂ counts from the mean of the table's, as in :class:`Features`: the thesis takes for granted
    that sketch and map have one scale.
    """
    point: FloatArray = rng.random(3) - np.array([0.0, 0.0, 0.5])
    if not folded:
        point[1] *= 2.0
    return point


def read_features(table: RelationTable, folded: bool) -> Slices[Features]:
    """Return the vectors of a relation table.

    L̂ of i → j' is a difference b_j' − a_i, of which only differences count: what is taken from
    all of them changes no distance of two vectors. Less its mean, L̂ of seed points need not know
    in which scale a sketch is drawn.
    """
    # The table's own L̂ would take too long at once.
    level, total = np.empty_like(table.dilation), 0.0
    for first, last in _row_slices(*level.shape):
        level[first:last] = DILATION_SCALE * np.log(table.dilation[first:last])
        total += float(level[first:last].sum())
        yield
    level -= total / level.size
    return Features(table.similarity, table.rotation, level, folded)


def fit_membership(
    features: Features,
    alpha: float,
    k: float,
    rng: np.random.Generator,
    exact_pairs: int = EXACT_PAIRS,
) -> Slices[Membership]:
    """Return μ_close for the mean m and the variance v of all distances (thesis 3.6.1-3.6.3).

    Only distances between vectors that can be in one FMAP count. m and v are exact up to
    ``exact_pairs`` pairs of vectors, beyond that estimated from 2²⁰ pairs drawn at random, whose
    standard error is a thousandth of the distances' standard deviation. Where all distances are
    equal, μ_close is the limit for v → 0, a step at m.
    """
    mean = variance = 0.0
    if len(features.similarity) > 1:
        origin = sampled_distance_sums(features, 64, 0.0, np.random.default_rng(0))[1] / 128
        count, total, square = 0, 0.0, 0.0
        for part in _distance_parts(features, origin, rng, exact_pairs):
            count, total, square = count + part[0], total + part[1], square + part[2]
            yield
        mean = origin + total / count
        variance = max(0.0, square / count - (total / count) ** 2)
    variance = max(variance, _SMALLEST_VARIANCE)
    return Membership(alpha / variance, mean - k * variance)


def _distance_parts(
    features: Features, origin: float, rng: np.random.Generator, exact_pairs: int
) -> Iterator[tuple[int, float, float]]:
    rows, pairs = features.similarity.shape
    vectors = rows * pairs
    if rows * (rows - 1) * pairs * (pairs - 1) // 2 <= exact_pairs:
        for first, last in _row_slices(vectors, vectors):
            yield distance_sums(features, first, last, origin)
    else:
        # A sampled pair costs far more than one in order: its vectors are not in the cache.
        step = SLICE // 32
        for drawn in range(0, SAMPLED_PAIRS // 2, step):
            draws = min(step, SAMPLED_PAIRS // 2 - drawn)
            yield sampled_distance_sums(features, draws, origin, rng)


def _row_slices(rows: int, width: int) -> Iterator[tuple[int, int]]:
    step = max(1, SLICE // (2 * width))
    return ((first, min(first + step, rows)) for first in range(0, rows, step))


class Grower(ABC):
    """Grows one FMAP from a seed point."""

    @abstractmethod
    def grow(self, seed: FloatArray) -> Slices[float]:
        """Grow an FMAP from (σ̂, R̂, L̂), offer it, and return its ζ."""


class NnGrower(Grower):
    """Grows FMAPs by Euclidean distance to the seed point (thesis 3.5).

    Parameters
    ----------
    features
        The vectors.
    found
        Where to offer the FMAPs.
    budget
        Distances in a slice.
    """

    def __init__(self, features: Features, found: Found, budget: int = SLICE) -> None:
        rows, pairs = features.similarity.shape
        self._features, self._found, self._budget = features, found, budget
        self._growth = NearestGrowth(
            np.empty(rows, dtype=np.int64),
            np.empty(pairs, dtype=np.bool_),
            np.empty(rows),
            np.empty(rows, dtype=np.int64),
            np.empty(2, dtype=np.int64),
        )

    def grow(self, seed: FloatArray) -> Slices[float]:
        """Grow an FMAP from (σ̂, R̂, L̂), offer it, and return its ζ."""
        growth = self._growth
        growth.taken[:] = False
        growth.state[:] = 0
        while not grow_nearest(growth, seed, self._features, self._budget):
            yield
        return self._found.offer(growth.entries)


class FsnnGrower(Grower):
    """Grows FMAPs by closeness to the vectors already in them (thesis 3.6).

    The seed point only decides which vector is the first (C(0) is a factor of every aggregate
    confidence), so an FMAP grows from a first vector once and its ζ is remembered.

    Parameters
    ----------
    features
        The vectors.
    membership
        μ_close.
    found
        Where to offer the FMAPs.
    budget
        Degrees of closeness in a slice.
    store_bytes
        Room for the closeness to other vectors of those that come first into an FMAP. There is
        none where one vector would take more than a slice.
    """

    def __init__(
        self,
        features: Features,
        membership: Membership,
        found: Found,
        budget: int = SLICE,
        store_bytes: int = STORE_BYTES,
    ) -> None:
        rows, pairs = features.similarity.shape
        vectors = rows * pairs
        fitting = min(vectors, store_bytes // (16 * vectors))
        capacity = fitting if 2 * vectors <= budget else 0
        self._features, self._membership, self._found = features, membership, found
        self._budget = budget
        self._store = ClosenessStore(
            np.empty((capacity, 2, vectors)),
            np.full(vectors if capacity else 0, -1, dtype=np.int64),
            np.zeros(1, dtype=np.int64),
        )
        self._growth = FuzzyGrowth(
            np.empty(rows, dtype=np.int64),
            np.empty(pairs, dtype=np.int64),
            np.empty((rows, 2, pairs)),
            np.empty((rows, 2, pairs)),
            np.empty(5, dtype=np.int64),
            np.empty(3),
        )
        self._confidences: dict[tuple[int, int], float] = {}

    def grow(self, seed: FloatArray) -> Slices[float]:
        """Grow an FMAP from (σ̂, R̂, L̂), offer it, and return its ζ."""
        first = yield from self._first(seed)
        if first not in self._confidences:
            self._confidences[first] = yield from self.grow_from(*first)
        return self._confidences[first]

    def _first(self, seed: FloatArray) -> Slices[tuple[int, int]]:
        """Return row and entry of the vector nearest to the seed point."""
        rows, pairs = self._features.similarity.shape
        none_taken = np.zeros(pairs, dtype=np.bool_)
        bound, row, entry = np.inf, 0, 0
        for first, last in _row_slices(rows, pairs):
            if first > 0:
                yield
            nearest = nearest_vector(seed, self._features, none_taken, first, last)
            if nearest[0] < bound:
                bound, row, entry = nearest
        return row, entry

    def grow_from(self, row: int, entry: int) -> Slices[float]:
        """Grow an FMAP whose first entry is row → entry, offer it, and return its ζ."""
        growth = self._growth
        growth.entries[:] = -1
        growth.columns[:] = np.arange(growth.columns.size)
        growth.state[:] = (0, 0, 0, row, entry)
        while not grow_closest(growth, self._features, self._membership, self._store, self._budget):
            yield
        return self._found.offer(growth.entries)
