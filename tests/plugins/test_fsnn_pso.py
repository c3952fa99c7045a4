"""The ``fsnn-pso`` searcher: FMAPs that grow by fuzzy closeness."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.api import MatchProblem
from sketchmatch.model import RelationTable
from sketchmatch.pipeline.correspond import object_map, occm
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.slices import finish
from sketchmatch.testing import random_scene, simulate_sketch
from sketchmatch_builtin.histograms.constant import ConstantForce
from sketchmatch_builtin.searchers._growers import (
    Found,
    FsnnGrower,
    fit_membership,
    random_seed_point,
    read_features,
)
from sketchmatch_builtin.searchers.fsnn_pso import FsnnPso
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation
from tests.interpreted import examples
from tests.oracle import maps, neighbours
from tests.strategies import random_table, tables


@pytest.fixture(scope="module", autouse=True)
def _warm():
    # On a new machine the kernels compile here, and not while a test measures time.
    FsnnPso.warm_up()


def table_of_a_sketch(seed, drawn, there):
    rng = np.random.default_rng(seed)
    scene = random_scene(rng, there)
    sketch = simulate_sketch(scene, rng, objects=rng.permutation(there)[:drawn].tolist())
    first, second = (finish(describe(each, ConstantForce())) for each in (sketch.scene, scene))
    return finish(relate(first, second, CrossCorrelation()))


def membership(table, alpha=10.0, k=1.0, seed=0, folded=True, **options):
    features = finish(read_features(table, folded))
    return finish(fit_membership(features, alpha, k, np.random.default_rng(seed), **options))


def mean_and_variance(table, **options):
    fitted = membership(table, **options)
    variance = 10.0 / fitted.steepness
    return fitted.centre + variance, variance


def grower(table, alpha=10.0, k=1.0, folded=True, **options):
    found = Found(MatchProblem(table))
    features = finish(read_features(table, folded))
    fitted = membership(table, alpha, k, folded=folded)
    return FsnnGrower(features, fitted, found, **options), found


def grown(table, seed, **options):
    grows, found = grower(table, **options)
    finish(grows.grow(seed))
    return found.progress().fmap.entries.tolist()


@given(
    tables(most=4, more=1),
    st.integers(0, 2**32),
    st.sampled_from([(10, 1), (3, 0.5), (20, 2)]),
    st.booleans(),
)
@examples(30)
def test_it_grows_as_the_thesis_says(table, seed, shape, folded):
    point = random_seed_point(np.random.default_rng(seed), folded)
    alpha, k = shape
    options = {"alpha": alpha, "k": k, "folded": folded}
    expected = neighbours.grow_fuzzy(table, point, **options)
    assert grown(table, point, **options) == expected
    assert grown(table, point, store_bytes=0, **options) == expected


@pytest.mark.parametrize("folded", [True, False], ids=["folded", "circular"])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sizes", [(3, 3), (4, 4), (3, 5), (2, 4)])
def test_it_grows_as_the_thesis_says_on_scenes(seed, sizes, folded):
    table = table_of_a_sketch(seed, *sizes)
    point = random_seed_point(np.random.default_rng(seed), folded)
    expected = neighbours.grow_fuzzy(table, point, folded)
    assert grown(table, point, folded=folded) == expected


@pytest.mark.parametrize("seed", range(6))
def test_closeness_that_a_float_takes_for_1_is_told_apart(seed):
    wide = random_table(np.random.default_rng(seed), 4, 4)
    # Small distances have a far smaller variance, so μ_close is steep.
    table = RelationTable(
        0.8 + 0.1 * wide.similarity,
        np.pi / 2 + 0.05 * (wide.rotation - np.pi),
        wide.dilation**0.08,
        4,
        4,
    )
    fitted = membership(table)
    assert fitted.steepness * fitted.centre > 60, "1 − μ(0) is far below the last digit of 1"
    point = random_seed_point(np.random.default_rng(seed), True)
    assert grown(table, point) == neighbours.grow_fuzzy(table, point, True)


@given(tables(least=3, most=4, more=1), st.booleans())
@examples(20)
def test_mean_and_variance_are_those_of_all_compatible_vectors(table, folded):
    expected = neighbours.mean_and_variance(table, folded)
    assert mean_and_variance(table, folded=folded) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("sizes", [(3, 40), (12, 12)])
def test_a_sample_estimates_mean_and_variance(sizes):
    table = random_table(np.random.default_rng(1), *sizes)
    exact = mean_and_variance(table)
    sampled = mean_and_variance(table, exact_pairs=0)
    assert sampled == pytest.approx(exact, rel=0.01)
    assert sampled != exact
    assert sampled == mean_and_variance(table, exact_pairs=0), "the same seed, the same sample"


def test_slices_and_stored_closeness_do_not_change_what_grows():
    table = random_table(np.random.default_rng(5), 6, 7)
    usual, found = grower(table)
    options = [{"budget": 1}, {"budget": 3000}, {"store_bytes": 0}, {"store_bytes": 200_000}]
    variants = [grower(table, **each) for each in options]
    for seed in range(20):
        point = random_seed_point(np.random.default_rng(seed), True)
        confidence = finish(usual.grow(point))
        for other, _ in variants:
            assert finish(other.grow(point)) == confidence
    for _, other in variants:
        assert other.evaluations == found.evaluations


@pytest.mark.parametrize(
    ("options", "most"),
    [({}, 150), ({"store_bytes": 16 * 150 * 9}, 9), ({"budget": 299}, 0), ({"store_bytes": 0}, 0)],
)
def test_closeness_is_stored_where_there_is_room_and_a_vector_fits_a_slice(options, most):
    table = random_table(np.random.default_rng(5), 5, 6)  # 10 × 15 vectors
    grows, _ = grower(table, **options)
    for row in range(10):
        finish(grows.grow_from(row, 0))
    assert len(grows._store.values) == most
    assert 0 < grows._store.used[0] <= most if most else grows._store.used[0] == 0


def test_an_fmap_grows_from_a_first_vector_once():
    table = random_table(np.random.default_rng(5), 4, 5)
    grows, found = grower(table)
    rng = np.random.default_rng(0)
    for _ in range(500):
        finish(grows.grow(random_seed_point(rng, True)))
    assert found.evaluations <= 6 * 20


@pytest.mark.parametrize("shape", [(4, 5), (3, 3), (2, 2), (2, 5)])
def test_where_all_distances_are_equal_the_lowest_index_comes_first(shape):
    rows, columns = (n * (n - 1) // 2 for n in shape)
    same = np.ones((rows, columns))
    table = RelationTable(same, np.pi / 2 * same, same, *shape)
    assert grown(table, np.array([0.3, 0.2, 0.1])) == list(range(rows))


def test_on_small_scenes_it_finds_the_best_fmap_from_a_good_seed_point():
    hits = 0
    for seed in range(20):
        table = table_of_a_sketch(seed, 3, 3)
        best, partners = maps.best_object_map(table)
        entries = neighbours.vectors(table, True)
        pairs = {tuple(pair): j for j, pair in enumerate(_pairs(table))}
        chosen = [pairs[pair] for pair in maps.induced(partners)]
        grows, _ = grower(table)
        values = [finish(grows.grow(np.array(entries[i, j]))) for i, j in enumerate(chosen)]
        hits += max(values) >= best - 1e-9
    assert hits >= 16


def _pairs(table):
    return maps.read(range(2 * table.argument_pairs), table.argument_objects)


def test_eight_objects_come_to_a_map_worth_having():
    table = table_of_a_sketch(0, 8, 8)
    *_, last = FsnnPso().search(MatchProblem(table), np.random.default_rng(0))
    assert last.confidence > 0.7


def best_of(table, **params):
    searcher = FsnnPso(FsnnPso.Params(**params))
    *_, last = searcher.search(MatchProblem(table), np.random.default_rng(0))
    return last


@pytest.mark.parametrize("rotation", ["circular", "folded"])
def test_every_first_entry_is_tried_and_no_swarm_finds_more(rotation):
    table = random_table(np.random.default_rng(5), 4, 5)
    every = best_of(table, rotation=rotation, first="every")
    # Besides the 6 × 20 entries a random FMAP and one that grew by distance.
    assert (every.iteration, every.evaluations) == (120, 122)
    swarm = best_of(table, rotation=rotation, particles=400, patience=20)
    assert swarm.confidence <= every.confidence


def turned(table, angle):
    rotation = (table.rotation + angle) % (2 * np.pi)
    return RelationTable(table.similarity, rotation, table.dilation, 5, 5)


@pytest.mark.parametrize("angle", [0.5, np.pi / 2, np.pi, 4.0])
def test_circular_any_turn_of_a_sketch_gives_the_same_map(angle):
    table = table_of_a_sketch(4, 5, 5)
    upright = best_of(table, first="every")
    other = best_of(turned(table, angle), first="every")
    assert other.confidence == pytest.approx(upright.confidence, rel=1e-9)
    assert other.fmap.entries.tolist() == upright.fmap.entries.tolist()


@pytest.mark.parametrize(("rotation", "turned_by_90"), [("folded", 0), ("circular", 5)])
def test_folded_a_sketch_turned_by_90_degrees_is_lost(rotation, turned_by_90):
    right = {0.0: 0, np.pi / 2: 0}
    for angle in right:
        for seed in range(5):
            rng = np.random.default_rng(seed)
            scene = random_scene(rng, 6)
            sketch = simulate_sketch(scene, rng, rotation=angle)
            drawn, there = (finish(describe(s, ConstantForce())) for s in (sketch.scene, scene))
            table = finish(relate(drawn, there, CrossCorrelation()))
            fmap = best_of(table, rotation=rotation, first="every").fmap
            partners = object_map(occm(fmap, table)).partners
            right[angle] += partners.tolist() == sketch.partners.tolist()
    assert right[0.0] >= 4
    assert right[np.pi / 2] == turned_by_90
