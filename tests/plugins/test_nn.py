"""The ``nn`` searcher, and what it has in common with ``nn-pso`` and ``fsnn-pso``."""

import itertools
import json
import math
import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch import match, read_scene
from sketchmatch.api import MatchProblem, Outcome
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH, LIVING_ROOM_TRUTH
from sketchmatch.model import RelationTable
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.selection import Choice, resolve
from sketchmatch.pipeline.slices import finish
from sketchmatch.registry import Kind, Registered, Registry
from sketchmatch.testing import random_scene, simulate_sketch
from sketchmatch_builtin.histograms.constant import ConstantForce
from sketchmatch_builtin.judges.posterior import Posterior
from sketchmatch_builtin.searchers._growers import Found, NnGrower, random_seed_point, read_features
from sketchmatch_builtin.searchers.fsnn_pso import FsnnPso
from sketchmatch_builtin.searchers.nn import Nn
from sketchmatch_builtin.searchers.nn_pso import NnPso
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation
from tests.interpreted import examples
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


def grown(table, seed, folded, **options):
    found = Found(MatchProblem(table))
    confidence = finish(NnGrower(finish(read_features(table, folded)), found, **options).grow(seed))
    best = found.progress()
    assert best.confidence == confidence
    return best.fmap.entries.tolist()


@given(tables(most=5, more=2), st.integers(0, 2**32), st.booleans())
@examples(60)
def test_it_grows_as_the_thesis_says(table, seed, folded):
    point = random_seed_point(np.random.default_rng(seed), folded)
    assert grown(table, point, folded) == neighbours.grow_nearest(table, point, folded)


@pytest.mark.parametrize("folded", [True, False], ids=["folded", "circular"])
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("sizes", [(3, 3), (4, 6), (5, 5), (2, 6)])
def test_it_grows_as_the_thesis_says_on_scenes(seed, sizes, folded):
    table = table_of_a_sketch(seed, *sizes)
    point = random_seed_point(np.random.default_rng(seed), folded)
    assert grown(table, point, folded) == neighbours.grow_nearest(table, point, folded)


@given(tables(most=5, more=2), st.integers(0, 2**32), st.integers(-4, 4))
@examples(30)
def test_a_circular_seed_point_may_go_round(table, seed, rounds):
    point = random_seed_point(np.random.default_rng(seed), False)
    away = point + np.array([0.0, 2.0 * rounds, 0.0])
    assert grown(table, away, False) == neighbours.grow_nearest(table, point, False)


@pytest.mark.parametrize("budget", [1, 100])
def test_slices_do_not_change_what_grows(budget):
    table = random_table(np.random.default_rng(5), 7, 8)
    for seed in range(10):
        point = random_seed_point(np.random.default_rng(seed), True)
        assert grown(table, point, True, budget=budget) == grown(table, point, True)


@pytest.mark.parametrize("folded", [True, False], ids=["folded", "circular"])
def test_of_equal_distances_the_lowest_index_comes_first(folded):
    same = np.ones((6, 10))
    table = RelationTable(same, np.pi / 2 * same, same, 4, 5)
    assert grown(table, np.array([0.3, 0.2, 0.1]), folded) == list(range(6))


@pytest.mark.parametrize(("folded", "turns"), [(True, 1.0), (False, 2.0)])
def test_seed_points_are_where_the_thesis_draws_them(folded, turns):
    rng = np.random.default_rng(0)
    points = np.array([random_seed_point(rng, folded) for _ in range(4000)])
    assert points.min(axis=0) == pytest.approx([0.0, 0.0, -0.5], abs=0.005)
    assert points.max(axis=0) == pytest.approx([1.0, turns, 0.5], abs=0.005)


@ALL
@pytest.mark.parametrize("rotation", ["folded", "circular"])
@pytest.mark.parametrize("scale", [0.02, 1.3, 50.0])
def test_the_scale_of_a_sketch_plays_no_part(searcher, rotation, scale):
    table = table_of_a_sketch(3, 6, 6)
    scaled = RelationTable(table.similarity, table.rotation, scale * table.dilation, 6, 6)
    runs = [
        run(searcher, each, rotation=rotation, **SHORT[searcher])[0][-1] for each in (table, scaled)
    ]
    assert runs[0].fmap.entries.tolist() == runs[1].fmap.entries.tolist()
    assert runs[0].evaluations == runs[1].evaluations
    assert runs[0].confidence == pytest.approx(runs[1].confidence, rel=1e-9)


@ALL
def test_it_is_right_on_the_living_room(searcher):
    truth = json.loads(LIVING_ROOM_TRUTH.read_text(encoding="utf-8"))
    sketch, map_ = read_scene(LIVING_ROOM_SKETCH), read_scene(LIVING_ROOM_MAP)
    result = match(sketch, map_, searcher=searcher.name)
    centroids = [item.centroid for item in map_.objects]
    places = {item["label"]: item["map_centroid"] for item in truth["objects"]}
    for drawn, partner in result.object_map.items():
        place = places[sketch.labels[drawn]]
        nearest = min(range(len(centroids)), key=lambda k: math.dist(centroids[k], place))
        assert partner == nearest
    assert len(result.object_map) == len(places) == 8


@ALL
def test_r_is_circular_unless_it_is_asked_for_as_printed(searcher):
    assert searcher.Params().rotation == "circular"
    with pytest.raises(ValueError, match="circular"):
        searcher.Params(rotation="straight")


def test_it_tries_each_seed_point():
    seen, outcome = run(Nn, random_table(np.random.default_rng(1), 4, 5), seed_points=37)
    last = seen[-1]
    # The random FMAP that it begins with is one more.
    assert (last.iteration, last.evaluations, outcome) == (37, 38, Outcome.ITERATION_LIMIT)


@ALL
@given(table=tables(most=6), seed=st.integers(0, 2**32))
@examples(40)
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


@pytest.mark.slow
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
    def stuck(_table, _folded):
        raise AssertionError("set-up began")

    monkeypatch.setitem(searcher.search.__globals__, "read_features", stuck)
    table = random_table(np.random.default_rng(8), 10, 12)
    work = start(searcher, table)
    assert_legal(next(work).fmap, table)
    with pytest.raises(AssertionError, match="set-up began"):
        next(work)


PLUGINS = (ConstantForce, CrossCorrelation, Nn, NnPso, FsnnPso, Posterior)
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
    ({"speed": 9}, "speed", "is not a parameter of .*nn-pso; it has: rotation, particles, c1"),
]


@pytest.mark.parametrize(
    ("name", "parameters", "field", "words"),
    [
        ("nn", {"seed_points": 0}, "seed_points", "greater than or equal to 1"),
        (
            "nn",
            {"particles": 3},
            "particles",
            "is not a parameter of nn; it has: rotation, seed_points",
        ),
        *(("nn-pso", *fault) for fault in SWARM_FAULTS),
        *(("fsnn-pso", *fault) for fault in SWARM_FAULTS),
        ("fsnn-pso", {"alpha": 0}, "alpha", "greater than 0"),
        ("fsnn-pso", {"alpha": -10}, "alpha", "greater than 0"),
        ("fsnn-pso", {"k": -1}, "k", "greater than or equal to 0"),
        ("nn-pso", {"alpha": 10}, "alpha", "is not a parameter of nn-pso"),
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
