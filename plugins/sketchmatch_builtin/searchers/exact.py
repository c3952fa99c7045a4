"""Branch and bound over object maps, with a proof that the best was found."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator

import numpy as np
from pydantic import Field

from sketchmatch.api import MatchProblem, Outcome, Params, Searcher, SearchProgress
from sketchmatch.model import (
    FloatArray,
    IntArray,
    RelationTable,
    correspondences,
    object_pairs,
)
from sketchmatch.model.arrays import sealed
from sketchmatch_builtin.searchers._backtrack import (
    DEPTH,
    EVIDENCE,
    LEAVES,
    STEPS,
    backtrack,
    first_path,
)
from sketchmatch_builtin.searchers._branch import CELL, NODES, VISITED, search_cells
from sketchmatch_builtin.searchers._branch import first_place as first_descent
from sketchmatch_builtin.searchers._cells import (
    END,
    EVALUATIONS,
    FIRST_QUANTILE,
    NEXT,
    QUANTILES,
    ROTATION,
    ROUNDING,
    TOLERANCE,
    Cells,
    divide_cells,
    first_cell,
)
from sketchmatch_builtin.searchers._cells import first_place as first_division
from sketchmatch_builtin.searchers._fixed import empty_fixed
from sketchmatch_builtin.searchers._ranking import ranked_fmaps
from sketchmatch_builtin.searchers._relations import Relations, read_slices
from sketchmatch_builtin.searchers._residual import empty_tree
from sketchmatch_builtin.searchers.direct import Direct, Evolved, evolve

__all__ = ["FEW", "Exact", "branch_and_bound", "log_maps"]

_BUDGET = 3_000_000
"""Costs to look at, or the like, between two yields: 10 to 40 ms."""

_STEPS = 50_000
"""Of the search where maps are few, between two yields: about 20 ms."""

FEW = 26.0
"""Logarithm to base 2 of the number of maps below which these are few."""

_MOST_BYTES = 500_000_000
"""Of the candidates in cells; where it would be more they stay as wide as they are."""

_ROOM = 256
"""Cells that there is room for at first."""

_MOST_LAYERS = 512
"""Intervals of a quantile at most, where dilations differ so widely that more would be needed."""


class Exact(Searcher):
    """Finds the object map with the highest ζ and proves that there is none better.

    The search starts from a few maps that climb as those of ``direct`` do. Cells of rotation and
    dilation are then bounded [1]_ [2]_ and halved; those that may contain a better map than the
    best so far are searched depth first, under bounds by dual ascent [3]_ over linear assignments
    [4]_. The upper bound holds at every moment and finally equals ζ: no map is better by more than
    1e-9. The alternatives are the best other maps met on the way, not proved to be the next best.

    References
    ----------
    .. [1] P. C. Gilmore, "Optimal and suboptimal algorithms for the quadratic assignment problem",
       J. SIAM 10, 1962.
    .. [2] E. L. Lawler, "The quadratic assignment problem", Management Science 9, 1963.
    .. [3] P. Hahn, T. Grant, "Lower bounds for the quadratic assignment problem based upon a dual
       formulation", Operations Research 46(6), 1998.
    .. [4] R. Jonker, A. Volgenant, "A shortest augmenting path algorithm for dense and sparse
       linear assignment problems", Computing 38, 1987.

    Examples
    --------
    A sketch of four of the five things on a map:

    >>> from sketchmatch.testing import best_object_map, mapped_pairs, matching_problem
    >>> problem, truth = matching_problem(np.random.default_rng(0), objects=5, missing=1)
    >>> *_, last = Exact().search(problem, np.random.default_rng(0))
    >>> bool(last.upper_bound == last.confidence)
    True
    >>> truth.tolist(), mapped_pairs(last.fmap, problem.table)[:3]
    ([4, 1, 3, 0], [(4, 1), (4, 3), (4, 0)])

    Nothing is better, as trying every object map says too:

    >>> zeta, partners = best_object_map(problem.table)
    >>> partners, abs(zeta - last.confidence) < 1e-9
    ((4, 1, 3, 0), True)
    """

    name = "exact"
    summary = "Branch and bound with a proof: the best object map and a bound that equals it."

    class Params(Params):
        """Parameters of the search; none changes the optimum, all the time that it takes."""

        starts: int | None = Field(
            None,
            ge=1,
            le=100_000,
            description="Maps that climb before the proof begins; by default half the number of "
            "objects in the smaller scene.",
        )
        cell_angle: float = Field(
            24.0,
            ge=2.0,
            le=360.0,
            description="Width to which cells of rotation are halved; up to four times as wide if "
            "there are few maps.",
            json_schema_extra={"unit": "°"},
        )
        cell_dilation: float = Field(
            0.22,
            ge=0.01,
            le=100.0,
            description="Width in units of L̂ to which cells of dilation are halved; up to four "
            "times as wide if there are few maps.",
        )
        node_limit: int | None = Field(
            None,
            ge=1,
            description="Cells and nodes of the search trees at which to stop; no limit by "
            "default.",
        )

    params: Params

    @classmethod
    def warm_up(cls) -> None:
        """Compile the kernels."""
        rng = np.random.default_rng(0)
        similarity, rotation, dilation = rng.uniform(0.1, 0.9, (3, 3, 3))
        table = RelationTable(similarity, rotation, dilation, 3, 3)
        list(cls().search(MatchProblem(table), rng))

    def search(
        self, problem: MatchProblem, rng: np.random.Generator
    ) -> Generator[SearchProgress, None, Outcome]:
        """Search until nothing better is possible."""
        starts = self.params.starts or (problem.table.template_objects + 1) // 2
        start = Direct.Params(offspring=starts)
        evolved = yield from evolve(problem, start, rng, upper_bound=1.0)
        return (yield from branch_and_bound(problem, evolved, self.params))


def branch_and_bound(
    problem: MatchProblem, start: Evolved, params: Exact.Params
) -> Generator[SearchProgress, None, Outcome]:
    """Prove that the best of some object maps is the best of all, or find the one that is.

    Parameters
    ----------
    problem
        As for any searcher.
    start
        What to begin with; its maps are replaced by better ones.
    params
        Those of :class:`Exact`.

    Yields
    ------
    SearchProgress
        ``iteration`` goes on to count cells and nodes; the upper bound never rises.

    Returns
    -------
    Outcome
        OPTIMAL, or ITERATION_LIMIT where the node limit or memory did not suffice.
    """
    search = _Search(problem, start, params)
    stages = [search.divide(), search.descend()]
    if log_maps(problem.table) < FEW:
        stages = [search.backtrack()]
    for stage in (search.read(), *stages):
        for _ in stage:
            yield search.progress()
    outcome = search.conclude()
    yield search.progress()
    return outcome


def log_maps(table: RelationTable) -> float:
    """Return the logarithm to base 2 of the number of object maps."""
    objects, others = table.template_objects, table.argument_objects
    return (math.lgamma(others + 1) - math.lgamma(others - objects + 1)) / math.log(2.0)


class _Search:
    """The state of a search; its stages yield where it may pause."""

    def __init__(self, problem: MatchProblem, start: Evolved, params: Exact.Params) -> None:
        self.table, self.found, self.params = problem.table, start.found, params
        shape = self.table.similarity.shape
        self.relations = Relations(
            pairs=object_pairs(self.table.template_objects),
            columns=correspondences(self.table.argument_objects),
            evidence=self.table.entry_evidence,
            cosine=np.empty(shape),
            sine=np.empty(shape),
            dilation=np.empty(shape),
            rotation_weights=self.table.rotation_weights,
            # Products of losses with tiny weights would lose all digits.
            shares=np.array(problem.weights) / sum(problem.weights),
        )
        self.iterations, self.evaluations = start.iterations, start.evaluations
        self.upper_bound = 1.0
        self.spread = 0.0
        self.cells = first_cell(
            (self.table.template_objects, self.table.argument_objects), 0.0, 0.0
        )
        self.given_up = np.full(1, -np.inf)
        self.last_iteration = self.iterations + (params.node_limit or 2**62)

    def read(self) -> Iterator[None]:
        """Take cosines, sines and logarithms of the relation table."""
        relations = self.relations
        cosine, sine, level = relations.cosine, relations.sine, relations.dilation
        least, most = math.inf, -math.inf
        for rows in read_slices(self.table, cosine, sine, level):
            if rows.start > 0:
                yield
            least = min(least, float(level[rows].min()))
            most = max(most, float(level[rows].max()))
        self.relations = relations._replace(
            cosine=sealed(cosine), sine=sealed(sine), dilation=sealed(level)
        )
        self.spread = most - least
        self.cells = first_cell(self.cells.allowed.shape[1:], least, most)

    def backtrack(self) -> Iterator[None]:
        """Search all maps depth first."""
        path = first_path(self.relations, self.table.argument_objects, self.evaluations)
        w_s, w_r, w_l = self.relations.shares
        self.upper_bound = w_s * path.rest[EVIDENCE, 0] / len(path.levels[0]) + w_r + w_l
        before = self.iterations
        while path.place[DEPTH] >= 0 and self.iterations < self.last_iteration:
            steps = min(_STEPS, self.last_iteration - self.iterations)
            backtrack(self.relations, self.found, path, steps)
            self.iterations = before + int(path.place[STEPS])
            self.evaluations = int(path.place[LEAVES])
            if path.place[DEPTH] >= 0:
                yield
        if path.place[DEPTH] < 0:
            self.cells.bounds[:] = -np.inf

    def divide(self) -> Iterator[None]:
        """Bound cells and halve those that stay open, until they are small."""
        leaders = np.empty(self.cells.allowed.shape[1:])
        smallest, done = self._smallest_cell(), self.iterations
        place, work = first_division(self.evaluations), 0
        while place[NEXT] < place[END] and self.iterations < self.last_iteration:
            if place[END] + 2 > len(self.cells.bounds):
                open_ = np.flatnonzero(self.cells.bounds[: place[END]] > self._best)
                if 2 * len(open_) * self.cells.allowed[0].size > _MOST_BYTES:
                    return
                done += int(place[NEXT])
                place[NEXT], place[END] = np.searchsorted(open_, place[NEXT]), len(open_)
                done -= int(place[NEXT])
                room = np.zeros(max(_ROOM, 2 * len(open_)), dtype=np.int64)
                room[: len(open_)] = open_
                self._keep(room)
                self.cells.bounds[len(open_) :] = -np.inf
            work += divide_cells(
                self.relations,
                self.found,
                self.spread,
                self.cells,
                leaders,
                smallest,
                place,
                _BUDGET - work,
            )
            self.iterations = done + int(place[NEXT])
            self.evaluations = int(place[EVALUATIONS])
            if work >= _BUDGET:
                yield
                work = 0

    def descend(self) -> Iterator[None]:
        """Search the cells that are left, the one with the highest bound first."""
        order = np.argsort(-self.cells.bounds, kind="stable")
        self._keep(order[self.cells.bounds[order] > self._best])
        if not len(self.cells.bounds):
            return
        tree = empty_tree(*self.cells.allowed.shape[1:])
        fixed = empty_fixed(self.table.template_objects)
        place = first_descent(self.evaluations)
        before = self.iterations
        limit = self.last_iteration - before
        while place[CELL] < len(self.cells.bounds) and place[NODES] < limit:
            search_cells(
                self.relations,
                self.found,
                self.spread,
                self.cells,
                tree,
                fixed,
                place,
                self.given_up,
                _BUDGET,
                limit,
            )
            self.cells.bounds[: place[CELL]] = -np.inf
            self.iterations = before + int(place[NODES])
            self.evaluations = int(place[VISITED])
            yield

    def conclude(self) -> Outcome:
        """Draw the conclusion from what is left."""
        if max(self.cells.bounds.max(initial=-math.inf), self.given_up[0]) > self._best:
            return Outcome.ITERATION_LIMIT
        self.upper_bound = float(self.found.values[0])
        return Outcome.OPTIMAL

    def progress(self) -> SearchProgress:
        """Return the state as the host sees it."""
        best = float(self.found.values[0])
        left = max(float(self.cells.bounds.max(initial=best)), float(self.given_up[0]))
        self.upper_bound = max(best, min(self.upper_bound, left))
        fmaps = ranked_fmaps(self.found, self.table.argument_objects)
        return SearchProgress(
            fmaps[0], best, self.iterations, self.evaluations, self.upper_bound, tuple(fmaps[1:])
        )

    @property
    def _best(self) -> float:
        """The bound up to which a cell holds nothing better than the best map."""
        return float(self.found.values[0]) + TOLERANCE

    def _smallest_cell(self) -> FloatArray:
        """Return half the widths that cells are halved down to, in rotation and dilation.

        With few maps a search is over sooner than many cells are bounded.
        """
        factor = 2.0 ** min(2.0, max(0.0, (44.0 - log_maps(self.table)) / 14.0))
        angle = math.radians(self.params.cell_angle)
        dilation = max(self.params.cell_dilation, self.spread / _MOST_LAYERS)
        smallest = np.full(1 + len(QUANTILES), dilation)
        smallest[ROTATION] = angle
        smallest *= 0.5 * factor * (1.0 + ROUNDING)
        _, share_r, share_l = self.relations.shares
        if self.table.template_pairs == 1 or share_r == 0.0:
            smallest[ROTATION] = math.inf
        if self.table.template_pairs == 1 or share_l == 0.0:
            smallest[FIRST_QUANTILE:] = math.inf
        return smallest

    def _keep(self, which: IntArray) -> None:
        """Put certain cells in the place of all."""
        boxes, bounds, allowed = self.cells
        self.cells = Cells(boxes[which], bounds[which], allowed[which])
