"""The searcher obeys the contract, finds what enumeration finds, and gains by cooling slowly."""

import itertools

import numpy as np
import pytest

from sketchmatch.api import MatchProblem, Outcome
from sketchmatch.api.kernels import empty_map_state, place_map
from sketchmatch.model import RelationTable, pair_count
from sketchmatch.testing import parametrize_plugins
from sketchmatch_example_searcher.annealing import Annealing


@parametrize_plugins([Annealing])
def test_it_obeys_the_contract(check):
    check()


def random_problem(seed, objects, others):
    """Return relations with no order in them, which are the hardest."""
    rng = np.random.default_rng(seed)
    shape = (pair_count(objects), pair_count(others))
    table = RelationTable(
        rng.uniform(0.0, 1.0, shape),
        rng.uniform(0.0, 2.0 * np.pi, shape),
        np.exp(rng.normal(0.0, 0.3, shape)),
        objects,
        others,
    )
    return MatchProblem(table, (1.0, 1.0, 0.5))


def run(problem, seed=0, **params):
    """Return everything that a search yields, and why it ended."""
    search = Annealing(Annealing.Params(**params)).search(problem, np.random.default_rng(seed))
    seen = []
    while True:
        try:
            seen.append(next(search))
        except StopIteration as end:
            return seen, end.value


def confidence(problem, partners):
    """Return ζ of an object map."""
    state = empty_map_state(problem.table, problem.weights)
    return place_map(state, np.array(partners))


@pytest.mark.parametrize(("objects", "others"), [(2, 2), (2, 5), (5, 5), (4, 6)])
@pytest.mark.parametrize("seed", range(5))
def test_it_finds_the_best_of_all_object_maps(seed, objects, others):
    problem = random_problem(seed, objects, others)
    seen, outcome = run(problem, seed)
    best = max(confidence(problem, p) for p in itertools.permutations(range(others), objects))
    assert seen[-1].confidence == pytest.approx(best, abs=1e-9)
    assert outcome is Outcome.CONVERGED


@pytest.mark.parametrize("seed", range(5))
def test_it_beats_as_many_random_maps(seed):
    problem = random_problem(seed, 12, 14)
    seen, _ = run(problem, seed, runs=1)
    rng = np.random.default_rng(seed)
    by_chance = max(confidence(problem, rng.permutation(14)[:12]) for _ in range(3000))
    assert seen[-1].confidence > by_chance + 0.05


def test_slow_cooling_beats_a_plain_descent():
    problems = [random_problem(seed, 10, 10) for seed in range(5)]

    def mean(**params):
        return np.mean([run(problem, **params)[0][-1].confidence for problem in problems])

    cold = mean(runs=1, sweeps=1, hottest=1e-9, coldest=1e-9)
    assert mean(runs=1, sweeps=200) > cold + 0.02


def test_it_says_how_far_it_came():
    seen, outcome = run(random_problem(0, 6, 6), runs=2, sweeps=7)
    assert outcome is Outcome.ITERATION_LIMIT
    assert seen[-1].iteration >= 2 * 8  # seven that cool and at least one that is cold, each run
    assert seen[-1].evaluations > seen[-1].iteration


def test_equal_objects_end_it_at_once():
    ones = np.ones((6, 6))
    problem = MatchProblem(RelationTable(ones, ones, ones, 4, 4))
    seen, outcome = run(problem, patience=3)
    assert outcome is Outcome.CONVERGED
    assert seen[-1].confidence == pytest.approx(confidence(problem, range(4)), abs=1e-12)
