"""Lays the sketch upon the map: poses from pairs of objects, and the object maps they lead to."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import closing

import numpy as np
from pydantic import Field

from sketchmatch.api import MatchProblem, Outcome, Params, Searcher, SearchProgress
from sketchmatch.api.kernels import empty_map_state, place_map
from sketchmatch.model import Fmap, IntArray, RelationTable
from sketchmatch_builtin.alignment import (
    completed,
    laid_maps,
    near_maps,
    sides_of,
    template_maps,
)
from sketchmatch_builtin.searchers.auto import Auto

__all__ = ["Align"]

_NEAR = 10
"""The best maps near those that it starts with, to complete."""

_OFFERED = 10
"""Maps to complete between two pauses."""


class Align(Searcher):
    """Matches the objects themselves in one frame; some of either side may stay unmatched.

    Laying two sketched objects on two mapped ones gives a pose: a rotation, a scale and a
    translation. All such poses are tried, unless the sizes and shapes of the four objects
    contradict it. A pose is scored by how well all sketched objects then lie on mapped ones of the
    same size and length; how much larger or smaller than the distances between them the sketch
    shows objects is estimated with it. The weights are robust, those of Student's t [2]_, so that
    one object far off rules out nothing. Under the best poses, a linear assignment gives each
    object its partner, or none, and the pose is fitted again to these, a few times. The maps that
    single changes make of the best of these are offered as well.

    Relations without scenes, which never occur in a match, are searched as ``auto`` does.

    Relations are not compared: ζ only decides which of these maps, completed if they leave objects
    out, is the best histogram map. A judge that looks at the maps themselves makes the most of
    them. Matching the objects themselves is future work in the thesis [1]_.

    References
    ----------
    .. [1] "Scene Matching Between a Quantitative Map and a Qualitative Hand Drawn Sketch", thesis,
       section 5.
    .. [2] K. Lange, R. Little, J. Taylor, "Robust statistical modeling using the t distribution",
       Journal of the American Statistical Association 84, 1989.

    Examples
    --------
    A sketch of 8 of the 20 things of a map:

    >>> from sketchmatch.testing import matching_problem
    >>> problem, truth = matching_problem(np.random.default_rng(0), objects=20, missing=12)
    >>> *_, last = Align().search(problem, np.random.default_rng(0))
    >>> right = Fmap.from_object_map(truth, 20)
    >>> bool((last.fmap.entries == right.entries).all())
    True
    """

    name = "align"
    summary = (
        "The default: lays the sketch on the map, and may leave objects of either side unmatched."
    )
    default = True

    class Params(Params):
        """Parameters of the search."""

        poses: int = Field(
            60,
            ge=1,
            le=10_000,
            description="How many different maps of the best poses are refined.",
        )
        maps: int = Field(
            20, ge=1, le=10_000, description="How many of the best maps are passed to the judge."
        )

    params: Params

    @property
    def partial(self) -> bool:
        """It leaves objects out by itself."""
        return True

    @property
    def warm(self) -> bool:
        """Beside a few other poses, it tries those of the maps that it starts with."""
        return True

    @classmethod
    def warm_up(cls) -> None:
        """Compile the kernels."""
        from sketchmatch.testing import matching_problem

        problem, _ = matching_problem(np.random.default_rng(0), objects=4)
        list(cls().search(problem, np.random.default_rng(0)))

    def search(
        self,
        problem: MatchProblem,
        rng: np.random.Generator,
    ) -> Generator[SearchProgress, None, Outcome]:
        """Lay the sketch upon the map in every way that may be right."""
        if problem.scenes is None:
            return (yield from Auto().search(problem, rng))
        sides = sides_of(
            problem.scenes(), problem.swapped, problem.allowed, problem.pinned, problem.names
        )
        best = _Best(problem)
        best.offer(completed(None, sides))
        yield best.progress(0)
        poses = 0
        if problem.start:
            start = [sides.drawn_partners(each) for each in problem.start]
            laid = near_maps(sides, start, self.params.maps, problem.partial)
            offered = laid[:_NEAR]
        else:
            with closing(laid_maps(sides, self.params.poses, partial=problem.partial)) as work:
                while True:
                    try:
                        poses = next(work)
                    except StopIteration as stop:
                        laid = offered = stop.value[: self.params.maps]
                        break
                    yield best.progress(poses)
        for k, each in enumerate(offered):
            best.offer(completed(each, sides))
            if (k + 1) % _OFFERED == 0:
                yield best.progress(poses)
        # A judge that is to be quick goes by these alone.
        maps = template_maps(laid, sides)
        yield best.progress(poses, tuple(maps) if problem.partial else ())
        return Outcome.CONVERGED


class _Best:
    """The complete maps met, by ζ."""

    def __init__(self, problem: MatchProblem) -> None:
        self.table: RelationTable = problem.table
        self.alternatives = problem.alternatives
        self.state = empty_map_state(problem.table, problem.weights)
        self.met: dict[bytes, tuple[float, IntArray]] = {}

    def offer(self, partners: IntArray) -> None:
        """Take a map that gives every template object a partner."""
        key = partners.tobytes()
        if key not in self.met:
            self.met[key] = (place_map(self.state, partners), partners)

    def progress(self, poses: int, maps: tuple[IntArray, ...] = ()) -> SearchProgress:
        """Return the state as the host sees it."""
        ranked = sorted(self.met.values(), key=lambda each: -each[0])[: self.alternatives + 1]
        fmaps = [Fmap.from_object_map(each, self.table.argument_objects) for _, each in ranked]
        return SearchProgress(
            fmaps[0],
            ranked[0][0],
            len(self.met),
            poses + len(self.met),
            alternatives=tuple(fmaps[1:]),
            maps=maps,
        )
