"""Whichever search fits: a proof where one comes fast, a good map in any case."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace
from typing import TypeVar

import numpy as np
from pydantic import Field

from sketchmatch.api import MatchProblem, Outcome, Params, Searcher, SearchProgress
from sketchmatch_builtin.searchers.direct import Direct, evolve
from sketchmatch_builtin.searchers.exact import FEW, Exact, branch_and_bound, log_maps

__all__ = ["Auto"]

_Result = TypeVar("_Result")

_MANY = 64.0
"""Logarithm to base 2 of the number of maps up to which a proof is tried: 20 objects have 61."""


class Auto(Searcher):
    """Chooses the search by the number of object maps and the time available.

    If maps are few, as with up to 11 objects, ``exact`` proves the best one in milliseconds. Up to
    about 20 objects, or 10 in a map of 50, ``direct`` searches for the best map, and ``exact`` then
    tries to prove that none is better, or finds it: until the time budget ends or, without one, for
    ``proof_nodes``. Beyond that, only ``direct`` runs. A note of the result states what was done.

    Examples
    --------
    The note says what it did:

    >>> from sketchmatch.testing import matching_problem
    >>> problem, truth = matching_problem(np.random.default_rng(0), objects=5)
    >>> *_, last = Auto().search(problem, np.random.default_rng(0))
    >>> last.note
    'exact tried all maps that could be better'
    >>> problem, truth = matching_problem(np.random.default_rng(0), objects=12)
    >>> *_, last = Auto().search(problem, np.random.default_rng(0))
    >>> last.note
    'direct searched, then exact proved that no object map is better'
    """

    name = "auto"
    summary = "Exact if a proof is fast, otherwise direct, with a proof if there is time."

    class Params(Params):
        """Parameters of the choice."""

        proof_nodes: int = Field(
            40_000,
            ge=0,
            le=1_000_000_000,
            description="Nodes of the search trees after which a proof is abandoned if there is no "
            "time budget: 1 to 2 s. 0 omits proofs, except where maps are few.",
        )

    params: Params

    @classmethod
    def warm_up(cls) -> None:
        """Compile the kernels."""
        Direct.warm_up()
        Exact.warm_up()

    def search(
        self, problem: MatchProblem, rng: np.random.Generator
    ) -> Generator[SearchProgress, None, Outcome]:
        """Search, and prove what can be proved."""
        bits = log_maps(problem.table)
        if bits < FEW:
            work = Exact().search(problem, rng)
            _, outcome = yield from _noted(work, "exact tried all maps that could be better")
            return outcome
        limit = self.params.proof_nodes if problem.time_budget is None else None
        if bits >= _MANY or limit == 0:
            work = Direct().search(problem, rng)
            why = "there are too many maps" if bits >= _MANY else "proof_nodes is 0"
            _, outcome = yield from _noted(work, f"direct searched; no proof was tried: {why}")
            return outcome
        evolution = evolve(problem, Direct.Params(), rng, upper_bound=1.0)
        _, evolved = yield from _noted(evolution, "direct searched; there was no time for a proof")
        proof = branch_and_bound(problem, evolved, Exact.Params(node_limit=limit))
        last, outcome = yield from _noted(
            proof, "direct searched, then exact for something better; there is no proof yet"
        )
        if outcome is Outcome.OPTIMAL:
            note = "direct searched, then exact proved that no object map is better"
        else:
            outcome = evolved.outcome
            note = "direct searched; exact gave up proving that no object map is better"
        yield replace(last, note=note)
        return outcome


def _noted(
    work: Generator[SearchProgress, None, _Result], note: str
) -> Generator[SearchProgress, None, tuple[SearchProgress, _Result]]:
    """Put a note on all progress of a search; return the last, and what the search returns."""
    while True:
        try:
            last = replace(next(work), note=note)
        except StopIteration as stop:
            return last, stop.value
        yield last
