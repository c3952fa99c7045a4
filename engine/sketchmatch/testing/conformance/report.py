"""What is worth knowing about a searcher, and no contract asks for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from sketchmatch.model import Fmap
from sketchmatch.testing.conformance.searchers import posed, run
from sketchmatch.testing.oracle import best_object_map, is_object_consistent
from sketchmatch.testing.problems import matching_problem, random_relations

__all__ = ["SearchReport", "search_report"]


@dataclass(frozen=True)
class SearchReport:
    """How well a searcher performs on small problems, each with another seed.

    Attributes
    ----------
    problems
        How many of each of the following.
    object_consistent
        Random problems whose answer is the FMAP of an object map.
    optimal
        Random problems whose answer is as good as the best object map, or better.
    true
        Sketches drawn without a fault, 5 of 6 objects, whose answer is the truth.
    """

    problems: int
    object_consistent: int
    optimal: int
    true: int


def search_report(algorithm: type[Any], problems: int = 10) -> SearchReport:
    """Search some small problems, and report the results.

    Parameters
    ----------
    algorithm
        A searcher's class.
    problems
        How many problems of each sort.
    """
    consistent = optimal = true = 0
    for seed in range(problems):
        rng = np.random.default_rng(seed)
        problem = posed(random_relations(rng, 4, 5))
        last = run(algorithm(), problem, seed).seen[-1]
        consistent += is_object_consistent(last.fmap, problem.table)
        optimal += last.confidence >= best_object_map(problem.table)[0] - 1e-9
        drawn, truth = matching_problem(rng, 6, missing=1, distortion=0.0)
        found = run(algorithm(), drawn, seed).seen[-1].fmap
        true += np.array_equal(found.entries, Fmap.from_object_map(truth, 6).entries)
    return SearchReport(problems, consistent, optimal, int(true))
