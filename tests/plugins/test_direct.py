"""The ``direct`` searcher: legal, honest, repeatable, bounded, and nearly always right."""

import itertools
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.api import MatchProblem, Outcome
from sketchmatch.api.kernels import empty_map_state, map_confidence, place_map
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import RelationTable, object_pairs, pair_count
from sketchmatch.pipeline.selection import Choice, resolve
from sketchmatch.registry import default_registry
from sketchmatch_builtin.searchers import direct as module
from sketchmatch_builtin.searchers._moves import (
    climb,
    empty_moves,
    read_relations,
    renew_moves,
    weigh_moves,
)
from sketchmatch_builtin.searchers.direct import Direct, evolve
from tests.interpreted import examples
from tests.oracle import maps as oracle
from tests.oracle.enumeration import best_of_all
from tests.pace import slowness, within
from tests.searching import WEIGHTS, drain, geometric_table, sketched_table
from tests.strategies import (
    random_table,
    tables,
    tables_and_object_maps,
    with_evidence,
    with_rotation_weights,
)

TRUE = 1e-9
EQUAL = (1.0, 1.0, 1.0)


@pytest.fixture(scope="module", autouse=True)
def _warm():
    # On a new machine the kernels compile here, and not while a test measures time.
    Direct.warm_up()


def start(table, seed=0, weights=EQUAL, alternatives=0, **params):
    problem = MatchProblem(table, weights, alternatives)
    return Direct(Direct.Params(**params)).search(problem, np.random.default_rng(seed))


def run(table, seed=0, **options):
    return drain(start(table, seed, **options))


def yield_everywhere(monkeypatch):
    """Make a search yield wherever it may pause, so that all of it can be seen."""
    monkeypatch.setattr(module, "_REPORT_EVERY", -1.0)
    monkeypatch.setattr(module, "_VALUES", 50)
    monkeypatch.setattr(module, "_ENTRIES", 500)


def trace(seen):
    return [
        (
            p.iteration,
            p.evaluations,
            p.confidence,
            p.fmap.entries.tolist(),
            [fmap.entries.tolist() for fmap in p.alternatives],
        )
        for p in seen
    ]


def partners_of(fmap, table):
    """Return the object map that induces an FMAP, once it is sure that there is one."""
    mapped = oracle.read(fmap.entries, table.argument_objects)
    assert oracle.is_object_legal(mapped, table.template_objects)
    return (mapped[0][0], *(second for _, second in mapped[: table.template_objects - 1]))


def true_confidence(table, partners, weights=EQUAL):
    return oracle.confidence(table, oracle.induced(partners), weights)[0]


def neighbours(partners, others):
    """Return all maps one move away: two partners exchanged, or one moved to an unused object."""
    for a, b in oracle.pairs(len(partners)):
        after = list(partners)
        after[a], after[b] = after[b], after[a]
        yield tuple(after)
    for a, c in itertools.product(range(len(partners)), range(others)):
        if c not in partners:
            yield (*partners[:a], c, *partners[a + 1 :])


def assert_sound(seen, table, weights=EQUAL):
    """Check every progress: a legal FMAP, its true ζ, and no step back."""
    known = {}
    for progress in seen:
        partners = partners_of(progress.fmap, table)
        if partners not in known:
            known[partners] = true_confidence(table, partners, weights)
        assert progress.confidence == pytest.approx(known[partners], abs=1e-11)
        assert progress.upper_bound is None
    for before, after in itertools.pairwise(seen):
        assert after.confidence >= before.confidence
        assert after.iteration >= before.iteration
        assert after.evaluations >= before.evaluations
        if after.iteration > before.iteration:
            assert after.evaluations > before.evaluations


def table_of_likes(template, argument):
    """Return relations of objects that cannot be told apart."""
    shape = (pair_count(template), pair_count(argument))
    return RelationTable(
        np.full(shape, 0.7), np.full(shape, 2.0), np.full(shape, 3.0), template, argument
    )


@given(tables(most=6), st.integers(0, 2**32), st.integers(2, 8), st.integers(1, 40))
@examples(80)
def test_any_short_run_is_sound(table, seed, population, offspring):
    weights = (0.5, 1.0, 2.0)
    params = {"population": population, "offspring": offspring, "patience": 1000}
    with pytest.MonkeyPatch.context() as patch:
        yield_everywhere(patch)
        seen, outcome = run(table, seed, weights=weights, **params)
    assert outcome is Outcome.ITERATION_LIMIT
    assert seen[-1].iteration == offspring
    assert len(seen) > offspring
    assert_sound(seen, table, weights)


@pytest.mark.parametrize(
    "rates",
    [
        {"renewal_rate": 0.0, "exchange_rate": 0.0},
        {"renewal_rate": 0.0, "exchange_rate": 1.0},
        {"renewal_rate": 1.0, "exchange_rate": 0.0, "variety": 0.0},
        {"renewal_rate": 1.0, "exchange_rate": 1.0, "variety": 10.0},
        {"tournament": 1},
        {"tournament": 1000},
    ],
)
@pytest.mark.parametrize("weights", WEIGHTS[:4])
def test_the_extremes_of_the_rates_are_sound_too(rates, weights):
    for table in (random_table(np.random.default_rng(4), 5, 6), table_of_likes(4, 5)):
        seen, outcome = run(table, weights=weights, population=5, patience=50, **rates)
        assert outcome is Outcome.CONVERGED
        assert_sound(seen, table, weights)


def test_a_longer_run_gets_better_and_is_sound_all_along(monkeypatch):
    monkeypatch.setattr(module, "_REPORT_EVERY", -1.0)
    table = random_table(np.random.default_rng(1), 9, 12)
    seen, outcome = run(table)
    assert outcome is Outcome.CONVERGED
    assert len({p.confidence for p in seen}) > 2, "it got better on the way"
    assert_sound(seen, table)


def climbed(table, partners, weights):
    """Return a map after it climbed, and ζ."""
    state = empty_map_state(table, weights)
    directed = table.evidence is not None
    moves = empty_moves(table.template_objects, table.argument_objects, directed)
    pairs, others = object_pairs(table.template_objects), object_pairs(table.argument_objects)
    leanings = np.zeros((table.template_objects, table.argument_objects, 3))
    read_relations(state, moves, pairs, others, 0, table.similarity.size, leanings)
    before = place_map(state, np.array(partners, dtype=np.int64))
    while not climb(state, moves, -1.0, 1000):
        now = map_confidence(state)
        assert now >= before
        before = now
    return tuple(state.partners.tolist()), map_confidence(state)


@given(tables_and_object_maps(), st.sampled_from(WEIGHTS), st.sampled_from([0.0, 1.0, 200.0]))
@examples(120)
def test_a_climbed_map_is_a_local_optimum_under_both_moves(case, weights, factor):
    table, partners = case
    dilation = np.exp(factor * np.log(table.dilation))
    table = replace(table, dilation=dilation)
    top, value = climbed(table, partners, weights)
    expected = true_confidence(table, top, weights)
    assert value == pytest.approx(expected, abs=1e-11)
    assert value >= true_confidence(table, tuple(partners.tolist()), weights) - 1e-11
    for near in neighbours(top, table.argument_objects):
        assert true_confidence(table, near, weights) <= value + 1e-11


@pytest.mark.parametrize(
    "seed", [0, 1, *(pytest.param(k, marks=pytest.mark.slow) for k in range(2, 6))]
)
def test_larger_maps_climb_to_local_optima_too(seed):
    rng = np.random.default_rng(seed)
    table = random_table(rng, 14, 18) if seed % 2 else sketched_table(seed, 14, 16, wobble=0.3)
    top, value = climbed(table, rng.permutation(table.argument_objects)[:14], WEIGHTS[seed])
    for near in neighbours(top, table.argument_objects):
        assert true_confidence(table, near, WEIGHTS[seed]) <= value + 1e-11


@given(tables_and_object_maps(most=6), st.sampled_from(WEIGHTS), st.floats(-0.05, 0.05))
@examples(80)
def test_no_move_above_a_threshold_is_left_out(case, weights, above):
    table, partners = case
    objects, others = table.template_objects, table.argument_objects
    state = empty_map_state(table, weights)
    moves = empty_moves(objects, others, table.evidence is not None)
    pairs = (object_pairs(objects), object_pairs(others))
    leanings = np.zeros((objects, others, 3))
    read_relations(state, moves, *pairs, 0, table.similarity.size, leanings)
    threshold = place_map(state, partners) + above
    renew_moves(state, moves)
    found = {}
    for a in range(objects):
        weigh_moves(state, moves, a, threshold)
        for c in np.flatnonzero(moves.values >= 0.0).tolist():
            after = partners.tolist()
            if c in after:
                after[after.index(c)] = after[a]
            after[a] = c
            assert tuple(after) not in found, "each move is weighed once"
            found[tuple(after)] = moves.values[c]
    for near in neighbours(partners.tolist(), others):
        value = true_confidence(table, near, weights)
        if value > threshold + 1e-11:
            assert found.pop(near) == pytest.approx(value, abs=1e-11)
        else:
            found.pop(near, None)
    assert not found


def share_of_optima(cases):
    """Return how many tables lead to the best of all their maps, none to a better one."""
    found = 0
    for seed, (table, weights) in enumerate(cases):
        best, *_ = best_of_all(table, weights)
        seen, outcome = run(table, seed, weights=weights)
        assert outcome is Outcome.CONVERGED
        assert_sound(seen, table, weights)
        assert seen[-1].confidence <= best + TRUE
        found += seen[-1].confidence >= best - TRUE
    return found


@pytest.mark.slow
def test_it_finds_the_best_of_random_relations():
    rng = np.random.default_rng(0)
    sizes = [(n, n + more) for n in range(2, 7) for more in range(3)]
    cases = [(random_table(rng, *sizes[k % 15]), WEIGHTS[k % 7]) for k in range(105)]
    assert share_of_optima(cases) == 105


@pytest.mark.parametrize("count", [18, pytest.param(60, marks=pytest.mark.slow)])
def test_it_finds_the_best_of_sketches(count):
    cases = []
    for seed in range(count):
        objects = 3 + seed % 6
        drawn = min(7, max(2, objects - seed % 3))
        noise = (0.1, 0.3, 0.6)[seed % 3]
        table = sketched_table(seed, drawn, objects, displacement=noise, turn=noise)
        cases.append((table, WEIGHTS[0] if seed % 4 else WEIGHTS[seed % 7]))
    assert share_of_optima(cases) == count


@pytest.mark.parametrize("count", [7, pytest.param(20, marks=pytest.mark.slow)])
def test_it_finds_the_best_where_there_are_evidence_and_rotation_weights(count):
    cases = []
    for seed in range(count):
        table = (
            sketched_table(seed, 6, 7)
            if seed % 2
            else random_table(np.random.default_rng(seed), 6, 7)
        )
        table = with_evidence(np.random.default_rng(seed), table)
        if seed % 3:
            table = with_rotation_weights(np.random.default_rng(seed), table)
        cases.append((table, WEIGHTS[seed % 7]))
    assert share_of_optima(cases) == count


@pytest.mark.parametrize("weights", WEIGHTS)
@pytest.mark.parametrize("noise", [0.0, 1e-10, 1e-3])
def test_it_finds_the_best_of_symmetric_scenes(noise, weights):
    rng = np.random.default_rng(1)
    corners = np.array([[1, 0], [0, 1], [-1, 0], [0, -1], [0, 0]], dtype=float)
    grid = np.array([[x, y] for x in range(3) for y in range(2)], dtype=float)
    cases = [
        (geometric_table(places, places @ [[0, 2], [-2, 0]], noise, rng), weights)
        for places in (corners, grid)
    ]
    assert share_of_optima(cases) == 2


@pytest.mark.parametrize("weights", WEIGHTS)
def test_objects_that_are_all_alike(weights):
    cases = [(table_of_likes(*size), weights) for size in [(2, 2), (3, 3), (5, 6), (6, 7)]]
    assert share_of_optima(cases) == 4


@pytest.mark.parametrize("count", [9, pytest.param(30, marks=pytest.mark.slow)])
def test_it_finds_the_best_of_near_duplicates(count):
    cases = []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        places = rng.uniform(0.0, 5.0, (6, 2))
        places[3:] = places[:3] + rng.normal(0.0, (1e-9, 1e-3, 0.3)[seed % 3], (3, 2))
        others = places + rng.normal(0.0, 0.2, places.shape)
        cases.append((geometric_table(places, others, 0.1, rng), EQUAL))
    assert share_of_optima(cases) == count


@pytest.mark.parametrize("argument", [2, 3, 50])
@pytest.mark.parametrize("weights", WEIGHTS)
def test_of_two_objects_it_finds_the_best_pair(argument, weights):
    table = random_table(np.random.default_rng(3), 2, argument)
    seen, outcome = run(table, weights=weights)
    assert_sound(seen, table, weights)
    # With one entry ζR and ζL are 1.
    w1, w2, w3 = weights
    expected = (w1 * table.similarity.max() + w2 + w3) / (w1 + w2 + w3)
    assert outcome is Outcome.CONVERGED
    assert seen[-1].confidence == pytest.approx(expected, abs=TRUE)


@pytest.mark.parametrize(
    "dilation",
    [
        lambda rng, shape: np.exp(rng.uniform(-300.0, 300.0, shape)),
        lambda rng, shape: 3.0 + rng.integers(0, 3, shape) * 4.5e-16,
        lambda rng, shape: np.where(rng.random(shape) < 0.7, 1.0 + 2.3e-16, 1e300),
    ],
)
def test_dilations_of_any_range(dilation):
    cases = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        table = random_table(rng, 6, 7)
        spread = dilation(rng, table.dilation.shape)
        cases.append((RelationTable(table.similarity, table.rotation, spread, 6, 7), EQUAL))
    # Random relations have no order that a climb could follow; proofs are what exact is for.
    assert share_of_optima(cases) >= 4


def test_a_map_that_is_hidden_among_many_is_found():
    # The first random map of 20 in 30 is right by no chance.
    rng = np.random.default_rng(2)
    places = rng.uniform(0.0, 10.0, (30, 2))
    chosen = rng.permutation(30)[:20]
    table = geometric_table(places[chosen], places, 0.0, rng)
    seen, _ = run(table)
    assert seen[0].confidence < 0.7
    assert seen[-1].confidence == pytest.approx(1.0, abs=TRUE)
    assert partners_of(seen[-1].fmap, table) == tuple(chosen.tolist())


@pytest.mark.parametrize("k", [1, 4, 12])
def test_alternatives_are_sorted_different_and_complete_under_single_moves(k):
    for seed in range(12):
        sketched = sketched_table(seed, 5, 6, displacement=0.2)
        table = sketched if seed % 3 else random_table(np.random.default_rng(seed), 4, 9)
        weights = WEIGHTS[seed % 7]
        seen, _ = run(table, seed, weights=weights, alternatives=k)
        last = seen[-1]
        maps = [partners_of(fmap, table) for fmap in (last.fmap, *last.alternatives)]
        assert len(set(maps)) == len(maps) == k + 1
        values = [true_confidence(table, partners, weights) for partners in maps]
        assert all(after <= before + 1e-11 for before, after in itertools.pairwise(values))
        assert values[0] == pytest.approx(last.confidence, abs=1e-11)
        for partners in maps:
            for near in neighbours(partners, table.argument_objects):
                value = true_confidence(table, near, weights)
                assert near in maps or value <= values[-1] + 1e-11


@pytest.mark.parametrize(("template", "argument", "count"), [(2, 2, 2), (3, 3, 6), (3, 5, 60)])
def test_wanting_more_alternatives_than_there_are_maps_brings_all(template, argument, count):
    for table in (
        random_table(np.random.default_rng(0), template, argument),
        table_of_likes(template, argument),
    ):
        seen, outcome = run(table, alternatives=count + 5)
        assert outcome is Outcome.CONVERGED
        last = seen[-1]
        maps = {partners_of(fmap, table) for fmap in (last.fmap, *last.alternatives)}
        assert maps == set(itertools.permutations(range(argument), template))
        assert len(last.alternatives) == count - 1


def test_a_map_of_no_confidence_at_all_is_an_alternative_too():
    shape = (3, 3)
    table = RelationTable(np.zeros(shape), np.ones(shape), np.ones(shape), 3, 3)
    last = run(table, weights=(1.0, 0.0, 0.0), alternatives=9)[0][-1]
    assert last.confidence == 0.0
    assert len(last.alternatives) == 5


def test_patience_counts_maps_without_a_better_best():
    # By σ alone all maps are equal, so the first is the best.
    seen, outcome = run(table_of_likes(3, 4), weights=(1.0, 0.0, 0.0), patience=7)
    assert (seen[-1].iteration, outcome) == (7, Outcome.CONVERGED)


def test_offspring_is_a_limit():
    table = random_table(np.random.default_rng(0), 6, 6)
    seen, outcome = run(table, offspring=9)
    assert (seen[-1].iteration, outcome) == (9, Outcome.ITERATION_LIMIT)


def test_what_others_build_on_it_get(monkeypatch):
    yield_everywhere(monkeypatch)
    table = sketched_table(4, 6, 7, displacement=0.3)
    problem = MatchProblem(table, alternatives=3)
    work = evolve(problem, Direct.Params(), np.random.default_rng(5), upper_bound=0.99)
    seen, evolved = drain(work)
    last = seen[-1]
    assert {progress.upper_bound for progress in seen} == {0.99}
    assert evolved.outcome is Outcome.CONVERGED
    assert evolved.found.maps.shape == (4, 6)
    assert (evolved.iterations, evolved.evaluations) == (last.iteration, last.evaluations)
    for fmap, partners in zip((last.fmap, *last.alternatives), evolved.found.maps, strict=True):
        assert partners_of(fmap, table) == tuple(partners.tolist())
    # The search itself is the same evolution.
    assert trace([last]) == trace([run(table, 5, alternatives=3)[0][-1]])


def test_the_same_seed_gives_the_same_run_also_side_by_side(monkeypatch):
    yield_everywhere(monkeypatch)
    table = sketched_table(2, 9, 11, displacement=0.4)
    alone = [run(table, seed, alternatives=2, patience=60)[0] for seed in (1, 2)]
    together = {}

    def work(place, seed):
        together[place] = run(table, seed, alternatives=2, patience=60)[0]

    threads = [threading.Thread(target=work, args=(k, 1 + k % 2)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for place, seen in together.items():
        assert trace(seen) == trace(alone[place % 2])
    assert trace(alone[0])[0] != trace(alone[1])[0], "seeds differ"


def test_relations_are_left_as_they_were():
    table = random_table(np.random.default_rng(7), 5, 7)
    arrays = [table.similarity, table.rotation, table.dilation]
    before = [array.copy() for array in arrays]
    run(table, alternatives=3)
    for array, copy in zip(arrays, before, strict=True):
        assert not array.flags.writeable
        assert (array == copy).all()


def test_what_was_yielded_does_not_change_later(monkeypatch):
    yield_everywhere(monkeypatch)
    seen, copies = [], []
    for progress in start(random_table(np.random.default_rng(1), 8, 10), alternatives=2):
        seen.append(progress)
        copies += trace([progress])
    assert len({confidence for _, _, confidence, *_ in copies}) > 1
    assert trace(seen) == copies


@pytest.fixture(scope="module")
def a_hundred_objects():
    return random_table(np.random.default_rng(9), 100, 100)


@pytest.mark.slow
def test_every_step_at_a_hundred_objects_is_cut_into_slices(a_hundred_objects):
    work = start(a_hundred_objects, alternatives=5, population=2, offspring=4)
    last, gaps, seen = time.thread_time(), [], []
    # Relations are read, maps are made, climb and cross, and the alternatives are explored.
    for progress in work:
        gaps.append(time.thread_time() - last)
        seen.append(progress)
        last = time.thread_time()
    assert max(gaps) < 0.3 * slowness()  # meant to be 20 to 50 ms
    assert seen[0].evaluations == 1, "there is an answer before the relations are read"
    assert seen[-1].iteration == 4
    assert seen[-1].confidence > seen[0].confidence
    assert_sound([seen[0]], a_hundred_objects)


@pytest.mark.slow
@pytest.mark.parametrize("yields", [1, 3, 30])
def test_it_ends_as_soon_as_it_is_closed(yields, a_hundred_objects):
    work = start(a_hundred_objects)
    for _ in range(yields):
        next(work)
    with within(0.1):
        work.close()


@pytest.mark.parametrize("objects", [15, 40])
def test_it_yields_often(objects):
    table = random_table(np.random.default_rng(8), objects, objects + 5)
    work = start(table, patience=10_000_000)
    next(work)
    with within(5.0):  # 20 to 30 ms each
        for _ in range(20):
            next(work)
    work.close()


@pytest.mark.parametrize(
    ("parameters", "field", "words"),
    [
        ({"population": 1}, "population", "greater than or equal to 2"),
        ({"population": 1_000_000}, "population", "less than or equal to 10000"),
        ({"population": 10.5}, "population", "valid integer"),
        ({"tournament": 0}, "tournament", "greater than or equal to 1"),
        ({"renewal_rate": -0.1}, "renewal_rate", "greater than or equal to 0"),
        ({"renewal_rate": 1.1}, "renewal_rate", "less than or equal to 1"),
        ({"exchange_rate": 2}, "exchange_rate", "less than or equal to 1"),
        ({"exchange_rate": float("nan")}, "exchange_rate", "finite"),
        ({"variety": -1}, "variety", "greater than or equal to 0"),
        ({"variety": float("inf")}, "variety", "finite"),
        ({"offspring": 0}, "offspring", "greater than or equal to 1"),
        ({"patience": 0}, "patience", "greater than or equal to 1"),
        ({"speed": 9}, "speed", "is not a parameter of direct; it has: population, tournament"),
    ],
)
def test_a_parameter_out_of_bounds_is_refused_by_its_name(parameters, field, words):
    with pytest.raises(InvalidInputError, match=words) as caught:
        resolve(default_registry(), {"searcher": Choice("direct", parameters)})
    assert caught.value.reason is Reason.INVALID_PARAMETER
    assert caught.value.field == f"searcher.parameters.{field}"
