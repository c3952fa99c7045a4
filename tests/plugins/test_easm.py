"""The ``easm`` searcher: legal, honest, repeatable, bounded, and good enough on small scenes."""

import itertools
import threading
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.api import MatchProblem, Outcome
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.selection import Choice, resolve
from sketchmatch.pipeline.slices import finish
from sketchmatch.registry import default_registry
from sketchmatch.testing import random_scene, simulate_sketch
from sketchmatch_builtin.histograms.constant import ConstantForce
from sketchmatch_builtin.searchers import easm as module
from sketchmatch_builtin.searchers.easm import Easm
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation
from tests.interpreted import examples
from tests.oracle import maps as oracle
from tests.pace import slowness, within
from tests.strategies import random_table, tables

BOTH = pytest.mark.parametrize("consistency", ["object", "pairwise"])


@pytest.fixture(scope="module", autouse=True)
def _warm():
    # On a new machine the kernels compile here, and not while a test measures time.
    Easm.warm_up()


def start(table, seed=0, weights=(1.0, 1.0, 1.0), **params):
    problem = MatchProblem(table, weights)
    return Easm(Easm.Params(**params)).search(problem, np.random.default_rng(seed))


def run(table, seed=0, **params):
    """Return everything that a search yields, and its outcome."""
    work, seen = start(table, seed, **params), []
    while True:
        try:
            seen.append(next(work))
        except StopIteration as stop:
            return seen, stop.value


def trace(seen):
    return [(p.iteration, p.evaluations, p.confidence, p.fmap.entries.tolist()) for p in seen]


def assert_legal(progress, table, consistency):
    mapped = oracle.read(progress.fmap.entries, table.argument_objects)
    assert len(mapped) == table.template_pairs
    assert oracle.is_pairwise_legal(mapped)
    if consistency == "object":
        assert oracle.is_object_legal(mapped, table.template_objects)


@BOTH
@given(tables(most=6), st.integers(0, 2**32), st.integers(2, 12), st.integers(1, 25))
@examples(60)
def test_any_short_run_ends_with_a_legal_fmap_and_its_true_confidence(
    consistency, table, seed, population, generations
):
    weights = (0.5, 1.0, 2.0)
    seen, outcome = run(
        table,
        seed,
        weights=weights,
        consistency=consistency,
        population=population,
        generations=generations,
    )
    assert outcome is Outcome.ITERATION_LIMIT
    assert seen[-1].iteration == generations
    for progress in seen:
        assert_legal(progress, table, consistency)
        mapped = oracle.read(progress.fmap.entries, table.argument_objects)
        expected, *_ = oracle.confidence(table, mapped, weights)
        assert progress.confidence == pytest.approx(expected, rel=1e-9)
        assert progress.upper_bound is None


@BOTH
@pytest.mark.parametrize(
    "rates",
    [
        {"crossover_rate": 0.0, "mutation_rate": 0.0},
        {"crossover_rate": 1.0, "exchange_rate": 0.0},
        {"crossover_rate": 1.0, "exchange_rate": 1.0, "mutation_rate": 0.0},
        {"mutation_rate": 1.0, "crossover_rate": 0.0},
    ],
)
def test_the_extremes_of_the_rates_are_legal_too(consistency, rates):
    table = random_table(np.random.default_rng(4), 5, 6)
    seen, _ = run(table, consistency=consistency, generations=50, population=10, **rates)
    assert_legal(seen[-1], table, consistency)


@BOTH
def test_confidence_never_falls_and_counts_rise(consistency):
    table = random_table(np.random.default_rng(1), 12, 16)
    seen, outcome = run(table, consistency=consistency, population=40, generations=3000)
    assert len(seen) > 2
    for before, after in itertools.pairwise(seen):
        assert after.confidence >= before.confidence
        assert after.iteration > before.iteration
        assert after.evaluations >= before.evaluations
    assert seen[-1].confidence > seen[0].confidence
    assert outcome in (Outcome.CONVERGED, Outcome.ITERATION_LIMIT)


@BOTH
@pytest.mark.parametrize(("template", "argument"), [(2, 2), (2, 3), (2, 50), (3, 3), (9, 9)])
def test_it_ends_by_itself_on_scenes_of_any_size(consistency, template, argument):
    table = random_table(np.random.default_rng(2), template, argument)
    seen, outcome = run(table, consistency=consistency, population=30)
    assert outcome is Outcome.CONVERGED
    assert_legal(seen[-1], table, consistency)


@pytest.mark.parametrize("argument", [2, 50])
def test_of_two_objects_it_finds_the_best_pair(argument):
    table = random_table(np.random.default_rng(3), 2, argument)
    seen, _ = run(table)
    # With one entry ζR and ζL are 1.
    assert seen[-1].confidence == pytest.approx((table.similarity.max() + 2) / 3)


def test_patience_counts_generations_without_a_better_best():
    table = random_table(np.random.default_rng(0), 2, 2)
    seen, outcome = run(table, patience=7)
    assert (seen[-1].iteration, outcome) == (7, Outcome.CONVERGED)


@BOTH
def test_no_parent_crosses_with_itself(consistency):
    table = random_table(np.random.default_rng(0), 20, 20)
    params = {"population": 2, "generations": 1, "consistency": consistency}
    rates = {"crossover_rate": 1.0, "exchange_rate": 0.5, "mutation_rate": 0.0}
    evaluations = [run(table, seed, **params, **rates)[0][-1].evaluations for seed in range(40)]
    # Only a child that is like neither is judged. Of one member both children would be like it,
    # and it would be both parents half of the time; of two they seldom are.
    assert evaluations.count(2) <= 4


@BOTH
def test_patience_begins_anew_with_every_better_best(consistency, monkeypatch):
    monkeypatch.setattr(module, "_REPORT_EVERY", -1.0)
    monkeypatch.setattr(module, "_SLICE_ENTRIES", 1)
    table, patience, late = random_table(np.random.default_rng(3), 6, 7), 9, 0
    for seed in range(5):
        seen, outcome = run(table, seed, consistency=consistency, population=4, patience=patience)
        better = [b.iteration for a, b in itertools.pairwise(seen) if b.confidence > a.confidence]
        assert outcome is Outcome.CONVERGED
        # Generations without a better best begin when the one that found it is over.
        begin = better[-1] + 1 if better else 0
        assert seen[-1].iteration == begin + patience
        late += begin > patience
    assert late > 0, "it got better when patience would have been at an end"


@BOTH
def test_the_same_seed_gives_the_same_run_also_side_by_side(consistency):
    table = random_table(np.random.default_rng(6), 8, 10)
    params = {"consistency": consistency, "population": 60}
    alone = [run(table, seed, **params)[0][-1] for seed in (1, 2)]
    together = {}

    def work(place, seed):
        together[place] = run(table, seed, **params)[0][-1]

    threads = [threading.Thread(target=work, args=(k, 1 + k % 2)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for place, last in together.items():
        assert trace([last]) == trace([alone[place % 2]])
    assert trace([alone[0]])[0][:2] != trace([alone[1]])[0][:2], "seeds differ"


@BOTH
def test_relations_are_left_as_they_were(consistency):
    table = random_table(np.random.default_rng(7), 5, 7)
    arrays = [table.similarity, table.rotation, table.dilation, table.normalized_dilation]
    before = [array.copy() for array in arrays]
    run(table, consistency=consistency, generations=20)
    for array, copy in zip(arrays, before, strict=True):
        assert not array.flags.writeable
        assert (array == copy).all()


@BOTH
def test_what_was_yielded_does_not_change_later(consistency):
    work = start(
        random_table(np.random.default_rng(1), 12, 16), consistency=consistency, population=40
    )
    first = next(work)
    entries, confidence = first.fmap.entries.copy(), first.confidence
    for _ in work:
        pass
    assert (first.fmap.entries == entries).all()
    assert first.confidence == confidence


@BOTH
def test_it_yields_often_and_stops_when_it_is_closed(consistency):
    table = random_table(np.random.default_rng(8), 15, 20)
    work = start(table, consistency=consistency, patience=10_000_000, generations=10_000_000)
    next(work)
    with within(5.0):  # 20 to 50 ms each
        for _ in range(10):
            next(work)
    with within(0.5):
        work.close()


@pytest.fixture(scope="module")
def a_hundred_objects():
    return random_table(np.random.default_rng(9), 100, 100)


@pytest.mark.slow
@BOTH
def test_every_step_at_a_hundred_objects_is_cut_into_slices(consistency, a_hundred_objects):
    work = start(a_hundred_objects, consistency=consistency)
    last, gaps, seen = time.thread_time(), [], []
    # Relations are read, the population is founded, and then one generation at least is bred.
    for progress in work:
        gaps.append(time.thread_time() - last)
        seen.append(progress)
        if progress.iteration >= 1:
            break
        last = time.thread_time()
    work.close()
    assert seen[0].evaluations == 1, "there is an answer before the relations are read"
    assert_legal(seen[0], a_hundred_objects, consistency)
    assert len(gaps) > 10
    assert max(gaps) < 0.25 * slowness()  # meant to be 20 to 50 ms


@pytest.mark.parametrize("consistency", ["object", "pairwise"])
def test_the_first_answer_has_its_true_confidence(consistency):
    table = random_table(np.random.default_rng(5), 6, 8)
    first = next(start(table, consistency=consistency))
    mapped = oracle.read(first.fmap.entries, table.argument_objects)
    assert first.confidence == pytest.approx(oracle.confidence(table, mapped)[0], rel=1e-9)


def table_of_a_sketch(seed):
    """Return the relations of a simulated sketch and a map of up to 6 objects."""
    rng = np.random.default_rng(seed)
    drawn = int(rng.integers(2, 7))
    scene = random_scene(rng, min(6, drawn + int(rng.integers(0, 3))))
    sketch = simulate_sketch(scene, rng, objects=rng.permutation(len(scene))[:drawn].tolist())
    first, second = (finish(describe(each, ConstantForce())) for each in (sketch.scene, scene))
    return finish(relate(first, second, CrossCorrelation()))


@pytest.fixture(scope="module")
def sketches():
    return [table_of_a_sketch(seed) for seed in range(40)]


@pytest.mark.slow
def test_it_finds_the_best_object_map_of_small_scenes(sketches):
    found = 0
    for seed, table in enumerate(sketches):
        best, _ = oracle.best_object_map(table)
        confidence = run(table, seed, population=60)[0][-1].confidence
        assert confidence <= best + 1e-9, "nothing is better than the best"
        found += confidence >= best - 1e-9
    assert found >= 38


@pytest.mark.slow
def test_free_pairs_seldom_do_worse_than_object_maps(sketches):
    better = [
        run(table, seed, consistency="pairwise")[0][-1].confidence
        >= run(table, seed, consistency="object")[0][-1].confidence - 1e-9
        for seed, table in enumerate(sketches)
    ]
    assert sum(better) >= 34


@pytest.mark.parametrize(
    ("parameters", "field", "words"),
    [
        ({"population": 1}, "population", "greater than or equal to 2"),
        ({"population": 1_000_000}, "population", "less than or equal to 100000"),
        ({"population": 10.5}, "population", "valid integer"),
        ({"crossover_rate": -0.1}, "crossover_rate", "greater than or equal to 0"),
        ({"crossover_rate": 1.1}, "crossover_rate", "less than or equal to 1"),
        ({"exchange_rate": 2}, "exchange_rate", "less than or equal to 1"),
        ({"mutation_rate": -1}, "mutation_rate", "greater than or equal to 0"),
        ({"mutation_rate": float("nan")}, "mutation_rate", "finite"),
        ({"generations": 0}, "generations", "greater than or equal to 1"),
        ({"patience": 0}, "patience", "greater than or equal to 1"),
        ({"consistency": "sloppy"}, "consistency", "'object' or 'pairwise'"),
        ({"speed": 9}, "speed", "is not a parameter of easm; it has: consistency, population"),
    ],
)
def test_a_parameter_out_of_bounds_is_refused_by_its_name(parameters, field, words):
    with pytest.raises(InvalidInputError, match=words) as caught:
        resolve(default_registry(), {"searcher": Choice("easm", parameters)})
    assert caught.value.reason is Reason.INVALID_PARAMETER
    assert caught.value.field == f"searcher.parameters.{field}"


def test_the_rates_of_the_thesis_are_the_defaults():
    params = Easm.Params()
    rates = (params.crossover_rate, params.exchange_rate, params.mutation_rate)
    assert rates == (0.7, 0.5, 0.3)
    assert params.patience == 400
    assert params.consistency == "object"
