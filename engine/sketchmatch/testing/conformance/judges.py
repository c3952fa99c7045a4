"""Contracts of judges."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import replace
from functools import lru_cache, partial
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sketchmatch.api import Judge, Judgement, JudgeProblem
from sketchmatch.model import ConfidenceWeights, RelationTable
from sketchmatch.model.arrays import sealed
from sketchmatch.pipeline.judge import check_maps, check_probabilities
from sketchmatch.testing.conformance.contract import (
    BrokenError,
    Contract,
    refused_as_broken,
    require,
)
from sketchmatch.testing.conformance.use import Use, contracts_of_use, view_within
from sketchmatch.testing.problems import judging_problem

__all__ = ["CONTRACTS"]

_HIGHEST_PRICE = 1e3


def maps_are_possible(algorithm: type[Judge]) -> None:
    """Return a Judgement of one object map or more, all different, none of them ruled out."""
    for problem in _problems():
        judgement = algorithm().judge(problem)
        with refused_as_broken():
            check_maps(judgement, problem)


def probabilities_agree(algorithm: type[Judge]) -> None:
    """Give probabilities within 0 … 1; let no map be likelier than a line of it, or the place."""
    for problem in _problems():
        judgement = algorithm().judge(problem)
        if isinstance(judgement, Judgement):
            with refused_as_broken():
                check_probabilities(judgement, problem)


def price_is_a_number(algorithm: type[Judge]) -> None:
    """Have a price above 0, at most 1000, for any weights."""
    for weights in (ConfidenceWeights(), ConfidenceWeights(1.0, 0.0, 3.0, 2.0, 0.5, 1.0)):
        price = algorithm().price(weights)
        fits = isinstance(price, Real) and 0.0 < float(price) <= _HIGHEST_PRICE
        require(fits, f"of {tuple(weights)} its price is {price!r}")


def odd_problems_are_judged(algorithm: type[Judge]) -> None:
    """Judge two objects, one candidate, pins, labels and a map of fewer objects like any others."""
    for what, problem in _odd_problems().items():
        try:
            judgement = algorithm().judge(problem)
            with refused_as_broken():
                check_maps(judgement, problem)
                check_probabilities(judgement, problem)
        except BrokenError as broken:
            raise BrokenError(f"with {what}, {broken}") from None
        except Exception as error:
            raise BrokenError(f"with {what}, it raised {type(error).__name__}: {error}") from error


def _uses() -> Iterator[Use]:
    for problem in _problems():
        inputs: dict[str, NDArray[Any]] = {}

        def own(name: str, array: NDArray[Any], inputs: dict[str, NDArray[Any]] = inputs) -> Any:
            return inputs.setdefault(name, view_within(array))

        table = problem.table
        arrays = {name: own(f"table.{name}", getattr(table, name)) for name in _ARRAYS}
        given = replace(
            problem,
            table=RelationTable(
                **arrays,
                template_objects=table.template_objects,
                argument_objects=table.argument_objects,
            ),
            candidates=tuple(
                replace(each, partners=own(f"candidates[{k}].partners", each.partners))
                for k, each in enumerate(problem.candidates)
            ),
            exchanges=own("exchanges", problem.exchanges),  # type: ignore[arg-type]
        )
        objects = f"{table.template_objects} on {table.argument_objects} objects"
        yield Use(f"a problem of {objects}", inputs, partial(_answer, given))


def _answer(problem: JudgeProblem, judge: Judge) -> Hashable:
    judgement = judge.judge(problem)
    maps = tuple((each.partners.tobytes(), each.probability) for each in judgement.maps)
    lines = None if judgement.lines is None else judgement.lines.tobytes()
    return maps, lines, judgement.elsewhere


CONTRACTS: tuple[Contract, ...] = (
    maps_are_possible,
    probabilities_agree,
    price_is_a_number,
    odd_problems_are_judged,
    *contracts_of_use(_uses),
)

_ARRAYS = ("similarity", "rotation", "dilation")


@lru_cache(maxsize=1)
def _problems() -> tuple[JudgeProblem, ...]:
    rng = np.random.default_rng(11)
    return (
        judging_problem(rng, 6, missing=1, distortion=2.0)[0],
        judging_problem(rng, 7, missing=2, extra=1, price=0.1)[0],
        judging_problem(rng, 7, missing=2, swapped=True)[0],
    )


@lru_cache(maxsize=1)
def _odd_problems() -> dict[str, JudgeProblem]:
    rng = np.random.default_rng(13)
    usual, truth = judging_problem(rng, 5, missing=1)
    partial_, _ = judging_problem(rng, 7, missing=1, price=0.2)
    labels = np.where(rng.random((4, 5)) < 0.3, 1, -1)
    pinned = {0: int(truth[0]), 2: int(truth[2])}
    return {
        "2 on 2 objects": judging_problem(rng, 2)[0],
        "2 on 4 objects": judging_problem(rng, 4, missing=2, price=0.2)[0],
        "one candidate": replace(usual, candidates=usual.candidates[:1]),
        "no alternatives": judging_problem(rng, 5, missing=1, alternatives=0)[0],
        "pins": judging_problem(np.random.default_rng(13), 5, missing=1, pinned=pinned)[0],
        "labels": replace(usual, names=sealed(labels)),
        "too many objects for exchanges": replace(partial_, exchanges=None, omissions=None),
        "a map of fewer objects": judging_problem(rng, 5, missing=1, swapped=True, price=0.1)[0],
        "other relations": replace(usual, usual=False),
        "other weights": judging_problem(rng, 5, weights=ConfidenceWeights(1, 2, 3))[0],
        "shapes weighed": judging_problem(
            rng, 5, weights=ConfidenceWeights(1, 3.8, 0.05, 2.9, 0.58, 1)
        )[0],
    }
