"""The ``nn`` searcher, and what it has in common with ``nn-pso`` and ``fsnn-pso``."""

import itertools
import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sketchmatch.api import MatchProblem, Outcome
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import RelationTable
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.selection import Choice, resolve
from sketchmatch.pipeline.slices import finish
from sketchmatch.registry import Kind, Registered, Registry
from sketchmatch.testing import random_scene, simulate_sketch
from sketchmatch_builtin.histograms.constant import ConstantForce
from sketchmatch_builtin.searchers._growers import Found, NnGrower, random_seed_point, read_features
from sketchmatch_builtin.searchers.fsnn_pso import FsnnPso
from sketchmatch_builtin.searchers.nn import Nn
from sketchmatch_builtin.searchers.nn_pso import NnPso
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation
from tests.oracle import maps, neighbours
from tests.pace import within
from tests.strategies import random_table, tables

ALL = pytest.mark.parametrize("searcher", [Nn, NnPso, FsnnPso], ids=lambda each: each.name)
SHORT = {
    Nn: {"seed_points": 20},
    NnPso: {"particles": 4, "iterations": 5},
    FsnnPso: {"particles": 4, "iterations": 5},
}
ENDLESS = {
    Nn: {"seed_points": 10_000_000},
    NnPso: {"iterations": 10_000_000, "patience": 10_000_000},
    FsnnPso: {"iterations": 10_000_000, "patience": 10_000_000},
}


@pytest.fixture(scope="module", autouse=True)
def _warm():
    # On a new machine the kernels compile here, and not while a test measures time.
    for searcher in SHORT:
        searcher.warm_up()


def start(searcher, table, seed=0, *, weights=(1.0, 1.0, 1.0), alternatives=0, **params):
    problem = MatchProblem(table, weights, alternatives)
    return searcher(searcher.Params(**params)).search(problem, np.random.default_rng(seed))


def run(searcher, table, seed=0, **options):
    """Return everything that a search yields, and its outcome."""
    work, seen = start(searcher, table, seed, **options), []
    while True:
        try:
            seen.append(next(work))
        except StopIteration as stop:
            return seen, stop.value


def assert_legal(fmap, table):
    mapped = maps.read(fmap.entries, table.argument_objects)
    assert len(mapped) == table.template_pairs
    assert maps.is_pairwise_legal(mapped)
    return mapped


def table_of_a_sketch(seed, drawn=4, there=5):
    """Return the relations of a simulated sketch and a map."""
    rng = np.random.default_rng(seed)
    scene = random_scene(rng, there)
    sketch = simulate_sketch(scene, rng, objects=rng.permutation(there)[:drawn].tolist())
    first, second = (finish(describe(each, ConstantForce())) for each in (sketch.scene, scene))
    return finish(relate(first, second, CrossCorrelation()))


def grown(table, seed, **options):
    found = Found(MatchProblem(table))
    confidence = finish(NnGrower(finish(read_features(table)), found, **options).grow(seed))
    best = found.progress()
    assert best.confidence == confidence
    return best.fmap.entries.tolist()


@given(tables(most=5, more=2), st.integers(0, 2**32))
@settings(max_examples=60)
def test_it_grows_as_the_thesis_says(table, seed):
    point = random_seed_point(np.random.default_rng(seed))
    assert grown(table, point) == neighbours.grow_nearest(table, point)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("sizes", [(3, 3), (4, 6), (5, 5), (2, 6)])
def test_it_grows_as_the_thesis_says_on_scenes(seed, sizes):
    table = table_of_a_sketch(seed, *sizes)
    point = random_seed_point(np.random.default_rng(seed))
    assert grown(table, point) == neighbours.grow_nearest(table, point)


@pytest.mark.parametrize("budget", [1, 100])
def test_slices_do_not_change_what_grows(budget):
    table = random_table(np.random.default_rng(5), 7, 8)
    for seed in range(10):
        point = random_seed_point(np.random.default_rng(seed))
        assert grown(table, point, budget=budget) == grown(table, point)


def test_of_equal_distances_the_lowest_index_comes_first():
    same = np.ones((6, 10))
    table = RelationTable(same, np.pi / 2 * same, same, 4, 5)
    assert grown(table, np.array([0.3, 0.2, 0.1])) == list(range(6))


def test_seed_points_are_where_the_thesis_draws_them():
    rng = np.random.default_rng(0)
    points = np.array([random_seed_point(rng) for _ in range(4000)])
    assert points.min(axis=0) == pytest.approx([0.0, 0.0, -0.5], abs=0.005)
    assert points.max(axis=0) == pytest.approx([1.0, 1.0, 0.5], abs=0.005)


def test_it_tries_each_seed_point():
    seen, outcome = run(Nn, random_table(np.random.default_rng(1), 4, 5), seed_points=37)
    last = seen[-1]
    # The random FMAP that it begins with is one more.
    assert (last.iteration, last.evaluations, outcome) == (37, 38, Outcome.ITERATION_LIMIT)


@ALL
@given(table=tables(most=6), seed=st.integers(0, 2**32))
@settings(max_examples=40)
def test_any_short_run_is_legal_and_its_confidence_true(searcher, table, seed):
    weights = (0.5, 1.0, 2.0)
    seen, outcome = run(searcher, table, seed, weights=weights, **SHORT[searcher])
    assert outcome is Outcome.ITERATION_LIMIT
    assert seen[0].iteration == 0
    for progress in seen:
        mapped = assert_legal(progress.fmap, table)
        expected, *_ = maps.confidence(table, mapped, weights)
        assert progress.confidence == pytest.approx(expected, rel=1e-9)
        assert progress.upper_bound is None
        assert progress.alternatives == ()


@ALL
@pytest.mark.parametrize(("template", "argument"), [(2, 2), (2, 3), (2, 40), (3, 3), (9, 9)])
def test_it_ends_by_itself_on_scenes_of_any_size(searcher, template, argument):
    table = random_table(np.random.default_rng(2), template, argument)
    seen, outcome = run(searcher, table)
    assert outcome is (Outcome.ITERATION_LIMIT if searcher is Nn else Outcome.CONVERGED)
    assert_legal(seen[-1].fmap, table)


@ALL
@pytest.mark.parametrize("value", [0.0, 0.5])
def test_objects_all_alike_are_no_trouble(searcher, value):
    same = np.ones((6, 10))
    table = RelationTable(value * same, 2 * np.pi * value * same, same, 4, 5)
    seen, _ = run(searcher, table, **SHORT[searcher])
    assert_legal(seen[-1].fmap, table)
    assert np.isfinite(seen[-1].confidence)


@ALL
def test_confidence_never_falls_and_counts_rise(searcher):
    table = random_table(np.random.default_rng(1), 12, 14)
    seen = list(itertools.islice(start(searcher, table, **ENDLESS[searcher]), 20))
    for before, after in itertools.pairwise(seen):
        assert after.confidence >= before.confidence
        assert after.iteration >= before.iteration
        assert after.evaluations >= before.evaluations
    assert seen[-1].confidence > seen[0].confidence


@ALL
def test_alternatives_are_other_good_fmaps(searcher):
    table = random_table(np.random.default_rng(4), 5, 6)
    few, _ = run(searcher, table, alternatives=2, **SHORT[searcher])
    alone, _ = run(searcher, table, **SHORT[searcher])
    best = few[-1]
    assert best.confidence == alone[-1].confidence
    assert 0 < len(best.alternatives) <= 8
    every = [best.fmap, *best.alternatives]
    assert len({tuple(fmap.entries) for fmap in every}) == len(every)
    ranks = [maps.confidence(table, assert_legal(fmap, table))[0] for fmap in every]
    assert (np.diff(ranks) < 1e-12).all(), "the best first"


@ALL
def test_the_same_seed_gives_the_same_run_also_side_by_side(searcher):
    table = random_table(np.random.default_rng(6), 8, 9)

    def last(seed):
        progress = run(searcher, table, seed, alternatives=3)[0][-1]
        fmaps = [fmap.entries.tolist() for fmap in (progress.fmap, *progress.alternatives)]
        return progress.iteration, progress.evaluations, progress.confidence, fmaps

    alone, together = [last(seed) for seed in (1, 2)], {}

    def work(place):
        together[place] = last(1 + place % 2)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [together[k] for k in range(4)] == alone * 2
    assert alone[0] != alone[1], "seeds differ"


@ALL
def test_relations_are_left_as_they_were(searcher):
    table = random_table(np.random.default_rng(7), 5, 7)
    arrays = [table.similarity, table.rotation, table.dilation]
    before = [array.copy() for array in arrays]
    run(searcher, table, **SHORT[searcher])
    for array, copy in zip(arrays, before, strict=True):
        assert not array.flags.writeable
        assert (array == copy).all()


@ALL
def test_what_was_yielded_does_not_change_later(searcher):
    work = start(searcher, random_table(np.random.default_rng(1), 6, 7), **SHORT[searcher])
    first = next(work)
    entries = first.fmap.entries.copy()
    for _ in work:
        pass
    assert (first.fmap.entries == entries).all()


@ALL
@pytest.mark.parametrize("objects", [8, 30])
def test_it_yields_often_and_stops_when_it_is_closed(searcher, objects):
    table = random_table(np.random.default_rng(8), objects, objects)
    work = start(searcher, table, **ENDLESS[searcher])
    with within(6.0):  # 20 to 50 ms each
        for _ in range(30):
            next(work)
    with within(0.5):
        work.close()


@ALL
def test_it_has_an_answer_before_it_is_set_up(searcher, monkeypatch):
    def stuck(_table):
        raise AssertionError("set-up began")

    monkeypatch.setitem(searcher.search.__globals__, "read_features", stuck)
    table = random_table(np.random.default_rng(8), 10, 12)
    work = start(searcher, table)
    assert_legal(next(work).fmap, table)
    with pytest.raises(AssertionError, match="set-up began"):
        next(work)


PLUGINS = (ConstantForce, CrossCorrelation, Nn, NnPso, FsnnPso)
REGISTRY = Registry(
    Registered(kind, plugin, "sketchmatch", "0")
    for kind in Kind
    for plugin in PLUGINS
    if issubclass(plugin, kind.interface)
)
SWARM_FAULTS = [
    ({"particles": 1}, "particles", "greater than or equal to 2"),
    ({"particles": 0}, "particles", "greater than or equal to 2"),
    ({"particles": 2.5}, "particles", "valid integer"),
    ({"c1": -1}, "c1", "greater than or equal to 0"),
    ({"c1": 3, "c2": 1.5}, "c2", r"is 1\.5; it makes c1 \+ c2 = 4\.5; the sum should be 4 or less"),
    ({"c1": 2.5}, "c2", r"is 2; it makes c1 \+ c2 = 4\.5"),
    ({"c2": 2.5}, "c2", r"is 2\.5; it makes c1 \+ c2 = 4\.5"),
    ({"c2": float("nan")}, "c2", "finite"),
    ({"velocity_limit": 0}, "velocity_limit", "greater than 0"),
    ({"velocity_limit": -0.2}, "velocity_limit", "greater than 0"),
    ({"iterations": 0}, "iterations", "greater than or equal to 1"),
    ({"patience": 0}, "patience", "greater than or equal to 1"),
    ({"speed": 9}, "speed", "is no parameter of .*nn-pso; it has: particles, c1, c2"),
]


@pytest.mark.parametrize(
    ("name", "parameters", "field", "words"),
    [
        ("nn", {"seed_points": 0}, "seed_points", "greater than or equal to 1"),
        ("nn", {"particles": 3}, "particles", "is no parameter of nn; it has: seed_points"),
        *(("nn-pso", *fault) for fault in SWARM_FAULTS),
        *(("fsnn-pso", *fault) for fault in SWARM_FAULTS),
        ("fsnn-pso", {"alpha": 0}, "alpha", "greater than 0"),
        ("fsnn-pso", {"alpha": -10}, "alpha", "greater than 0"),
        ("fsnn-pso", {"k": -1}, "k", "greater than or equal to 0"),
        ("nn-pso", {"alpha": 10}, "alpha", "is no parameter of nn-pso"),
    ],
)
def test_a_parameter_out_of_bounds_is_refused_by_its_name(name, parameters, field, words):
    with pytest.raises(InvalidInputError, match=words) as caught:
        resolve(REGISTRY, {"searcher": Choice(name, parameters)})
    assert caught.value.reason is Reason.INVALID_PARAMETER
    assert caught.value.field == f"searcher.parameters.{field}"


@ALL
def test_every_parameter_has_a_description(searcher):
    for field in searcher.Params.model_fields.values():
        assert field.description.endswith(".")
    resolve(REGISTRY, {"searcher": Choice(searcher.name)})
