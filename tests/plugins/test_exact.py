"""The ``exact`` searcher: it finds the best of all object maps, and its bound is always true."""

import itertools
import threading

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sketchmatch.api import MatchProblem, Outcome
from sketchmatch.model import RelationTable, pair_count
from sketchmatch_builtin.searchers import _residual
from sketchmatch_builtin.searchers import exact as module
from sketchmatch_builtin.searchers._ranking import Ranking
from sketchmatch_builtin.searchers.direct import Evolved
from sketchmatch_builtin.searchers.exact import Exact, branch_and_bound
from tests.interpreted import examples
from tests.oracle import maps as oracle
from tests.oracle.enumeration import best_of_all, every_confidence, worst_of_all
from tests.pace import within
from tests.searching import WEIGHTS, drain, geometric_table, sketched_table
from tests.strategies import random_table, tables, with_evidence, with_rotation_weights

TRUE = 1e-9


@pytest.fixture(scope="module", autouse=True)
def _warm():
    # On a new machine the kernels compile here, and not while a test measures time.
    Exact.warm_up()


def start(table, seed=0, weights=(1.0, 1.0, 1.0), alternatives=0, **params):
    problem = MatchProblem(table, weights, alternatives)
    return Exact(Exact.Params(**params)).search(problem, np.random.default_rng(seed))


def run(table, seed=0, **options):
    return drain(start(table, seed, **options))


def trace(seen):
    return [
        (p.iteration, p.evaluations, p.confidence, p.upper_bound, p.fmap.entries.tolist())
        for p in seen
    ]


def assert_sound(seen, table, best, weights=(1.0, 1.0, 1.0)):
    """Check every progress: a legal FMAP, its true ζ, a true bound, and no step back."""
    known = {}
    for progress in seen:
        entries = progress.fmap.entries
        if entries.tobytes() not in known:
            mapped = oracle.read(entries, table.argument_objects)
            assert oracle.is_object_legal(mapped, table.template_objects)
            known[entries.tobytes()] = oracle.confidence(table, mapped, weights)[0]
        assert progress.confidence == pytest.approx(known[entries.tobytes()], abs=1e-12)
        assert progress.upper_bound >= max(best - TRUE, progress.confidence)
    for before, after in itertools.pairwise(seen):
        assert after.confidence >= before.confidence
        assert after.upper_bound <= before.upper_bound
        assert after.iteration >= before.iteration
        assert after.evaluations >= before.evaluations


def prove(table, weights, partners, value, **params):
    """Return what a proof yields that begins with one map, and not with what climbing finds."""
    found = Ranking(np.array([partners]), np.array([value]))
    begin = Evolved(Outcome.CONVERGED, found, iterations=0, evaluations=1)
    problem = MatchProblem(table, weights)
    return drain(branch_and_bound(problem, begin, Exact.Params(**params)))


def assert_proved(table, weights=(1.0, 1.0, 1.0), seed=1, **params):
    """Check a proof: for even seeds from the worst map, without what climbing finds."""
    best, _, _ = best_of_all(table, weights)
    if seed % 2:
        seen, outcome = run(table, seed, weights=weights, **params)
    else:
        value, partners, _ = worst_of_all(table, weights)
        seen, outcome = prove(table, weights, partners, value, **params)
    assert_sound(seen, table, best, weights)
    assert outcome is Outcome.OPTIMAL
    assert seen[-1].confidence == pytest.approx(best, abs=TRUE)
    assert seen[-1].upper_bound == seen[-1].confidence


def small_slices(monkeypatch, budget=2000):
    """Make a search yield often, so that much of it can be seen."""
    monkeypatch.setattr(module, "_BUDGET", budget)
    monkeypatch.setattr(module, "_STEPS", budget // 100)


@pytest.fixture(params=["depth first", "in cells"])
def both_ways(request, monkeypatch):
    """Prove in one way and the other, whatever the number of maps."""
    monkeypatch.setattr(module, "FEW", np.inf if request.param == "depth first" else 0.0)


@pytest.mark.slow
@pytest.mark.usefixtures("both_ways")
@pytest.mark.parametrize("seed", range(60))
def test_random_relations(seed):
    rng = np.random.default_rng(seed)
    template = int(rng.integers(2, 7))
    table = random_table(rng, template, template + int(rng.integers(0, 3)))
    assert_proved(table, WEIGHTS[seed % len(WEIGHTS)], seed)


@pytest.mark.usefixtures("both_ways")
@pytest.mark.parametrize("seed", range(30))
def test_relations_with_evidence_and_rotation_weights(seed):
    rng = np.random.default_rng(seed)
    shapes = [(4, 5), (5, 5), (5, 6), (6, 6), (2, 4)]
    template, argument = shapes[seed % len(shapes)]
    table = random_table(rng, template, argument)
    if seed % 2:
        table = sketched_table(seed, template, argument, displacement=0.3, turn=0.3)
    weights = tuple(rng.uniform(0.0, 2.0, 3))
    if seed % 3 != 1:
        table = with_evidence(rng, table)
    if seed % 3 != 0:
        table = with_rotation_weights(rng, table)
    assert_proved(table, weights, seed)


@pytest.mark.slow
@given(tables(most=5, more=3), st.tuples(*3 * [st.floats(0.0, 10.0)]).filter(any))
@example(random_table(np.random.default_rng(0), 2, 2), (5e-324, 0.0, 0.0))
@example(random_table(np.random.default_rng(0), 4, 5), (0.0, 0.0, 5e-324))
@example(random_table(np.random.default_rng(0), 4, 5), (0.0, 5e-324, 1e-323))
@examples(80)
def test_any_weights_agree_with_the_slow_oracle(table, weights):
    best = max(every_confidence(table, weights).values())
    for few in (np.inf, 0.0):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(module, "FEW", few)
            seen, outcome = run(table, weights=weights)
        assert_sound(seen, table, best, weights)
        assert outcome is Outcome.OPTIMAL
        assert seen[-1].confidence == pytest.approx(best, abs=TRUE)


@pytest.mark.slow
@pytest.mark.usefixtures("both_ways")
@pytest.mark.parametrize("seed", range(60))
def test_sketches(seed):
    objects = 3 + seed % 6
    drawn = min(7, max(2, objects - seed % 3))
    noise = (0.1, 0.3, 0.6)[seed % 3]
    table = sketched_table(seed, drawn, objects, displacement=noise, turn=noise)
    assert_proved(table, WEIGHTS[0] if seed % 4 else WEIGHTS[seed % len(WEIGHTS)], seed)


@pytest.mark.slow
@pytest.mark.usefixtures("both_ways")
@pytest.mark.parametrize("seed", range(6))
def test_seven_objects_in_eight(seed):
    rng = np.random.default_rng(seed)
    assert_proved(random_table(rng, 7, 8), WEIGHTS[seed % len(WEIGHTS)], seed)
    assert_proved(sketched_table(seed, 7, 8, displacement=0.5), seed=seed)


@pytest.mark.usefixtures("both_ways")
@pytest.mark.parametrize("weights", WEIGHTS)
@pytest.mark.parametrize("noise", [0.0, 1e-10, 1e-3])
def test_symmetric_scenes(noise, weights):
    rng = np.random.default_rng(1)
    corners = np.array([[1, 0], [0, 1], [-1, 0], [0, -1], [0, 0]], dtype=float)
    grid = np.array([[x, y] for x in range(3) for y in range(2)], dtype=float)
    for places in (corners, grid):
        table = geometric_table(places, places @ [[0, 2], [-2, 0]], noise, rng)
        assert_proved(table, weights, seed=len(places))


@pytest.mark.usefixtures("both_ways")
@pytest.mark.parametrize("weights", WEIGHTS)
@pytest.mark.parametrize(("template", "argument"), [(3, 3), (5, 6), (6, 7)])
def test_objects_that_are_all_alike(template, argument, weights):
    shape = (pair_count(template), pair_count(argument))
    table = RelationTable(
        np.full(shape, 0.7), np.full(shape, 2.0), np.full(shape, 3.0), template, argument
    )
    assert_proved(table, weights)


@pytest.mark.slow
@pytest.mark.usefixtures("both_ways")
@pytest.mark.parametrize("seed", range(9))
def test_near_duplicates(seed):
    rng = np.random.default_rng(seed)
    places = rng.uniform(0.0, 5.0, (6, 2))
    places[3:] = places[:3] + rng.normal(0.0, (1e-9, 1e-3, 0.3)[seed % 3], (3, 2))
    table = geometric_table(places, places + rng.normal(0.0, 0.2, places.shape), 0.1, rng)
    assert_proved(table, seed=seed)


@pytest.mark.slow
@pytest.mark.usefixtures("both_ways")
def test_dilations_of_any_range():
    rng = np.random.default_rng(5)
    table = random_table(rng, 5, 6)
    for factor in (1e-3, 200.0):
        wide = np.exp(factor * np.log(table.dilation))
        args = (table.similarity, table.rotation, wide, 5, 6)
        for seed in (0, 1):
            assert_proved(RelationTable(*args), seed=seed)


@pytest.mark.usefixtures("both_ways")
@pytest.mark.parametrize("argument", [2, 3, 50])
@pytest.mark.parametrize("weights", WEIGHTS)
def test_two_objects(argument, weights):
    # With one entry ζR and ζL are 1.
    for rows in (random_table(np.random.default_rng(3), 2, argument), None):
        ones = np.ones((1, pair_count(argument)))
        table = rows or RelationTable(0.5 * ones, ones, ones, 2, argument)
        seen, outcome = run(table, weights=weights)
        w1, w2, w3 = weights
        expected = (w1 * table.similarity.max() + w2 + w3) / (w1 + w2 + w3)
        assert outcome is Outcome.OPTIMAL
        assert seen[-1].confidence == pytest.approx(expected, abs=TRUE)


@pytest.mark.slow
@pytest.mark.usefixtures("both_ways")
@pytest.mark.parametrize("seed", range(8))
def test_the_bound_is_true_whenever_one_looks(seed, monkeypatch):
    small_slices(monkeypatch, 5000)
    rng = np.random.default_rng(seed)
    table = random_table(rng, 5, 7) if seed % 2 else sketched_table(seed, 6, 8, displacement=0.6)
    best, _, _ = best_of_all(table)
    seen, outcome = run(table, starts=1)
    assert outcome is Outcome.OPTIMAL
    assert len(seen) > 10
    assert_sound(seen, table, best)


@pytest.mark.slow
@pytest.mark.parametrize(
    "params",
    [
        {"starts": 1},
        {"starts": 50},
        {"cell_angle": 360.0, "cell_dilation": 100.0},
        {"cell_angle": 360.0, "cell_dilation": 0.1},
        {"cell_angle": 6.0, "cell_dilation": 0.2},
    ],
)
def test_parameters_do_not_change_the_optimum(params, monkeypatch):
    monkeypatch.setattr(module, "FEW", 0.0)
    for seed in range(4):
        starts = {} if "starts" in params else {"seed": seed}
        assert_proved(random_table(np.random.default_rng(seed), 5, 6), **starts, **params)
        assert_proved(sketched_table(seed, 6, 7, displacement=0.3), **starts, **params)


@pytest.fixture(scope="module")
def larger():
    """A scene of 14 objects and its optimum."""
    table = sketched_table(14, 14, 14, displacement=0.6, turn=0.5, stretch=0.4)
    seen, outcome = run(table)
    assert outcome is Outcome.OPTIMAL
    return table, seen[-1].confidence


@pytest.mark.slow
@pytest.mark.parametrize("steps", [1, 2, 5, 20, 80])
def test_stopped_early_it_has_a_map_and_a_true_bound(larger, steps, monkeypatch):
    small_slices(monkeypatch, 20_000)
    table, best = larger
    work = start(table, starts=1)
    seen = list(itertools.islice(work, steps))
    work.close()
    assert len(seen) == steps
    assert_sound(seen, table, best)


@pytest.mark.slow
def test_a_node_limit_ends_the_search_with_a_gap(larger):
    table, best = larger
    seen, outcome = run(table, starts=1, node_limit=3)
    assert outcome is Outcome.ITERATION_LIMIT
    assert_sound(seen, table, best)
    assert seen[-1].upper_bound > seen[-1].confidence


@pytest.mark.slow
def test_without_memory_for_a_cell_it_does_not_claim_a_proof(larger, monkeypatch):
    table, best = larger
    whole = _residual.empty_tree

    def cramped(*objects):
        tree = whole(*objects)
        return tree._replace(blocks=tree.blocks[: cramped.room])

    monkeypatch.setattr(module, "empty_tree", cramped)
    for cramped.room in (1, 10_000, 20_000):
        seen, outcome = run(table)
        assert_sound(seen, table, best)
        if seen[-1].upper_bound > seen[-1].confidence:
            assert outcome is Outcome.ITERATION_LIMIT
    cramped.room = 1
    assert run(table)[1] is Outcome.ITERATION_LIMIT


@pytest.mark.slow
@pytest.mark.usefixtures("both_ways")
@pytest.mark.parametrize("quality", ["best", "worst"])
def test_given_maps_are_where_it_begins(quality):
    table = sketched_table(3, 6, 7, displacement=0.3)
    every = every_confidence(table)
    partners = (max if quality == "best" else min)(every, key=every.get)
    given_maps = Ranking(np.array([partners]), np.array([every[partners]]))
    begin = Evolved(Outcome.CONVERGED, given_maps, iterations=5, evaluations=9)
    seen, outcome = drain(branch_and_bound(MatchProblem(table), begin, Exact.Params()))
    assert seen[0].iteration >= 5
    assert seen[0].evaluations >= 9
    assert outcome is Outcome.OPTIMAL
    assert seen[-1].confidence == pytest.approx(max(every.values()), abs=TRUE)


@pytest.mark.slow
@pytest.mark.usefixtures("both_ways")
@pytest.mark.parametrize("k", [1, 3, 10])
def test_alternatives_are_good_and_different(k):
    for seed in range(10):
        table = sketched_table(seed, 5, 6, displacement=0.2)
        every = sorted(every_confidence(table).values(), reverse=True)
        last = run(table, seed, alternatives=k)[0][-1]
        found = [last.fmap, *last.alternatives]
        assert len({tuple(fmap.entries) for fmap in found}) == len(found) == k + 1
        values = [oracle.confidence(table, oracle.read(fmap.entries, 6))[0] for fmap in found]
        assert values == sorted(values, reverse=True)
        assert values[0] == pytest.approx(every[0], abs=TRUE)
        # Every exchange in the best map was tried, so the next best are seldom missed.
        assert values[1] >= every[2] - TRUE
        if module.FEW > 0.0:
            assert values == pytest.approx(every[: k + 1], abs=TRUE), "proved where maps are few"


def test_it_offers_no_more_alternatives_than_there_are_maps():
    table = random_table(np.random.default_rng(0), 2, 2)
    last = run(table, alternatives=5)[0][-1]
    assert len(last.alternatives) == 1


def test_the_same_seed_gives_the_same_run_also_side_by_side():
    table = sketched_table(2, 9, 11, displacement=0.4)
    alone = [run(table, seed)[0] for seed in (1, 2)]
    together = {}

    def work(place, seed):
        together[place] = run(table, seed)[0]

    threads = [threading.Thread(target=work, args=(k, 1 + k % 2)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for place, seen in together.items():
        assert trace(seen) == trace(alone[place % 2])


def test_relations_are_left_as_they_were():
    table = random_table(np.random.default_rng(7), 5, 7)
    arrays = [table.similarity, table.rotation, table.dilation]
    before = [array.copy() for array in arrays]
    run(table)
    for array, copy in zip(arrays, before, strict=True):
        assert (array == copy).all()


def test_what_was_yielded_does_not_change_later(monkeypatch):
    small_slices(monkeypatch)
    work = start(random_table(np.random.default_rng(1), 7, 8), starts=1, alternatives=2)
    seen, copies = [], []
    for progress in work:
        seen.append(progress)
        copies.append((progress.confidence, progress.fmap.entries.copy()))
    for progress, (confidence, entries) in zip(seen, copies, strict=True):
        assert progress.confidence == confidence
        assert (progress.fmap.entries == entries).all()


@pytest.mark.slow
@pytest.mark.parametrize("objects", [15, 40])
def test_it_yields_often_and_stops_when_it_is_closed(objects):
    # Random relations are far beyond a proof at these sizes.
    table = random_table(np.random.default_rng(8), objects, objects + 5)
    work = start(table)
    with within(6.0):  # about 20 ms each
        for _ in range(30):
            next(work)
    with within(0.5):
        work.close()


def test_twelve_objects_are_proved():
    table = sketched_table(0, 12, 12, displacement=0.3)
    assert run(table)[1] is Outcome.OPTIMAL


@pytest.mark.slow
@pytest.mark.usefixtures("both_ways")
@pytest.mark.parametrize("weights", WEIGHTS)
@pytest.mark.parametrize("seed", range(3))
def test_what_is_better_by_a_hair_is_found(seed, weights):
    # Nothing else is left to find, and all that may be left out is left out.
    rng = np.random.default_rng(seed)
    table = random_table(rng, 5, 6) if seed % 2 else sketched_table(seed, 5, 7, displacement=0.6)
    if seed % 3 == 0:
        table = with_rotation_weights(rng, table)
    best, _, _ = best_of_all(table, weights)
    _, worst, _ = worst_of_all(table, weights)
    seen, outcome = prove(table, weights, worst, best - 1e-6, cell_angle=12.0, cell_dilation=0.1)
    assert outcome is Outcome.OPTIMAL
    assert seen[-1].confidence == pytest.approx(best, abs=TRUE)
