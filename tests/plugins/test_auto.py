"""The ``auto`` searcher: the right search for the size and the time, and a note that says which."""

import itertools
import threading

import numpy as np
import pytest
from pydantic import ValidationError

from sketchmatch.api import MatchProblem, Outcome
from sketchmatch_builtin.searchers import auto as module
from sketchmatch_builtin.searchers.auto import Auto
from sketchmatch_builtin.searchers.direct import Direct
from sketchmatch_builtin.searchers.exact import Exact, log_maps
from tests.oracle import maps as oracle
from tests.oracle.enumeration import best_of_all
from tests.searching import drain
from tests.strategies import random_table

TRUE = 1e-9


@pytest.fixture(scope="module", autouse=True)
def _warm():
    Auto.warm_up()


def run(table, seed=0, searcher=None, **problem):
    work = (searcher or Auto()).search(MatchProblem(table, **problem), np.random.default_rng(seed))
    return drain(work)


def assert_steady(seen, table):
    for progress in seen:
        mapped = oracle.read(progress.fmap.entries, table.argument_objects)
        assert oracle.is_object_legal(mapped, table.template_objects)
        assert progress.note
        assert progress.upper_bound is None or progress.upper_bound >= progress.confidence
    for before, after in itertools.pairwise(seen):
        assert after.confidence >= before.confidence
        assert after.iteration >= before.iteration
        assert after.evaluations >= before.evaluations
        assert before.upper_bound is None or after.upper_bound <= before.upper_bound


@pytest.mark.parametrize(("template", "argument"), [(2, 2), (2, 9), (4, 4), (6, 8), (7, 8)])
def test_few_maps_are_proved(template, argument):
    table = random_table(np.random.default_rng(template), template, argument)
    seen, outcome = run(table, alternatives=2)
    assert_steady(seen, table)
    assert outcome is Outcome.OPTIMAL
    assert seen[-1].confidence == pytest.approx(best_of_all(table)[0], abs=TRUE)
    assert seen[-1].upper_bound == seen[-1].confidence
    assert "exact" in seen[-1].note


def test_more_maps_are_searched_and_then_proved(monkeypatch):
    monkeypatch.setattr(module, "FEW", 0.0)
    for seed in range(5):
        table = random_table(np.random.default_rng(seed), 5, 7)
        seen, outcome = run(table, seed)
        assert_steady(seen, table)
        assert outcome is Outcome.OPTIMAL
        assert seen[-1].confidence == pytest.approx(best_of_all(table)[0], abs=TRUE)
        assert seen[0].upper_bound == 1.0
        assert seen[-1].upper_bound == seen[-1].confidence
        assert "exact proved" in seen[-1].note


@pytest.mark.slow
def test_without_a_time_budget_a_proof_is_given_up_in_the_end():
    # Random relations of 13 objects are far beyond a proof.
    table = random_table(np.random.default_rng(1), 13, 14)
    seen, outcome = run(table, searcher=Auto(Auto.Params(proof_nodes=200)))
    assert_steady(seen, table)
    assert outcome is Outcome.CONVERGED
    assert "gave up" in seen[-1].note
    assert seen[-1].confidence < seen[-1].upper_bound <= 1.0


def test_with_a_time_budget_a_proof_is_tried_for_as_long_as_it_lasts(monkeypatch):
    seen_params = []

    def spy(problem, start, params):
        seen_params.append(params)
        return branch_and_bound(problem, start, params)

    branch_and_bound = module.branch_and_bound
    monkeypatch.setattr(module, "FEW", 0.0)
    monkeypatch.setattr(module, "branch_and_bound", spy)
    table = random_table(np.random.default_rng(2), 4, 5)
    run(table, time_budget=3.0)
    run(table)
    assert [params.node_limit for params in seen_params] == [None, 40_000]


def test_no_proof_is_tried_of_very_many_maps_or_where_it_is_not_wanted():
    many = random_table(np.random.default_rng(3), 22, 24)
    seen, outcome = run(many)
    assert_steady(seen, many)
    assert outcome is Outcome.CONVERGED
    assert seen[-1].upper_bound is None
    assert "too many" in seen[-1].note
    some = random_table(np.random.default_rng(3), 12, 13)
    seen, outcome = run(some, searcher=Auto(Auto.Params(proof_nodes=0)))
    assert (outcome, seen[-1].upper_bound) == (Outcome.CONVERGED, None)
    assert "proof_nodes is 0" in seen[-1].note


@pytest.mark.parametrize(
    ("template", "argument", "bits", "note"),
    [
        (11, 11, 25.3, "exact tried all"),
        (5, 38, 25.8, "exact tried all"),
        (5, 39, 26.04, "no time for a proof"),
        (20, 20, 61.1, "no time for a proof"),
        (16, 24, 63.7, "no time for a proof"),
        (12, 46, 64.01, "too many"),
        (21, 21, 65.5, "too many"),
    ],
)
def test_it_picks_by_the_number_of_maps(template, argument, bits, note):
    table = random_table(np.random.default_rng(0), template, argument)
    assert log_maps(table) == pytest.approx(bits, abs=0.05)
    work = Auto().search(MatchProblem(table), np.random.default_rng(0))
    assert note in next(work).note
    work.close()


def test_it_finds_what_the_searchers_find_that_it_picks():
    few, many = (random_table(np.random.default_rng(4), n, n + 1) for n in (6, 22))
    for table, picked in ((few, Exact()), (many, Direct())):
        last, alone = run(table, 5)[0][-1], run(table, 5, picked)[0][-1]
        assert (last.fmap.entries == alone.fmap.entries).all()
        assert last.evaluations == alone.evaluations


def test_the_same_seed_gives_the_same_run_also_side_by_side():
    table = random_table(np.random.default_rng(6), 12, 13)
    searcher = Auto(Auto.Params(proof_nodes=300))

    def trace():
        # How often it yields follows the clock.
        last = run(table, 9, searcher)[0][-1]
        return last.iteration, last.evaluations, last.upper_bound, last.fmap.entries.tolist()

    alone, together = trace(), []
    threads = [threading.Thread(target=lambda: together.append(trace())) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert together == 3 * [alone]


@pytest.mark.parametrize("value", [-1, 1.5, "many", None])
def test_bad_parameters_are_refused_by_field(value):
    with pytest.raises(ValidationError) as caught:
        Auto.Params(proof_nodes=value)
    assert [error["loc"] for error in caught.value.errors()] == [("proof_nodes",)]
