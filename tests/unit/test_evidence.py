"""Shapes and sizes of objects as a part of ζ, against the definition and through a match."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch import InvalidInputError, match
from sketchmatch.model import ConfidenceWeights, Fmap, RelationTable, Scene
from sketchmatch.pipeline.correspond import fmap_confidence
from sketchmatch.pipeline.evidence import compare_objects, rotation_weights, weigh_objects
from sketchmatch.pipeline.slices import finish
from sketchmatch.testing import random_scene, simulate_sketch
from tests.interpreted import compiled_only, examples
from tests.oracle import evidence as oracle
from tests.oracle import maps
from tests.searching import relations_of
from tests.strategies import floats, scenes

WEIGHTS = st.tuples(floats(0.0, 5.0), floats(0.1, 5.0), *3 * [floats(0.0, 5.0)]).filter(
    lambda w: w[3] + w[4] > 1e-3
)


def weighed(template, argument, weights, directions=180):
    """Return the relations with evidence, and how the objects compare."""
    own = finish(compare_objects(template, argument, directions))
    table = relations_of(template, argument)
    return finish(weigh_objects(table, own, ConfidenceWeights(*weights))), own


def moved(scene, turn, factor):
    """Return a scene that is turned, scaled and shifted."""
    rotation = factor * np.array(
        [[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]]
    )
    return Scene.from_polygons([item.rings[0] @ rotation + (3.0, -8.0) for item in scene.objects])


def sketched(seed, objects=5, drawn=4, **drawing):
    rng = np.random.default_rng(seed)
    scene = random_scene(rng, objects)
    chosen = rng.permutation(objects)[:drawn].tolist()
    return simulate_sketch(scene, rng, objects=chosen, **drawing), scene


@given(scenes(most=3), scenes(least=3, most=4), WEIGHTS, st.sampled_from([4, 10, 36, 180]))
@examples(40)
def test_the_evidence_is_what_the_definition_says(template, argument, weights, directions):
    table, _ = weighed(template, argument, weights, directions)
    drawn, mapped = (oracle.own_histograms(scene, directions) for scene in (template, argument))
    w1, _, _, w4, w5 = weights
    others = [(c, d) for c in range(len(argument)) for d in range(len(argument)) if c != d]
    for i, pair in enumerate(maps.pairs(len(template))):
        for other in others:
            sigma, turn, dilation = maps.look_up(table, i, other)
            level = 1.5 / math.log(2) * math.log(dilation)
            s, m = oracle.parts(drawn, mapped, pair, other, turn, level)
            expected = (w1 * sigma + w4 * s + w5 * m) / (w1 + w4 + w5)
            found = maps.evidence(table, i, other)
            assert found == pytest.approx(expected, abs=1e-9)
            assert 0.0 <= found <= 1.0


@pytest.mark.parametrize("seed", range(4))
def test_zeta_is_the_weighted_mean_of_its_five_parts(seed):
    sketch, scene = sketched(seed)
    weights = np.random.default_rng(seed).uniform(0.0, 2.0, 5)
    table, own = weighed(sketch.scene, scene, weights)
    found = fmap_confidence(
        Fmap.from_object_map(sketch.partners, 5), table, ConfidenceWeights(*weights).searched, own
    )
    drawn, mapped = (oracle.own_histograms(each, 180) for each in (sketch.scene, scene))
    entries = maps.induced(sketch.partners.tolist())
    own_parts = []
    for i, (pair, other) in enumerate(zip(maps.pairs(4), entries, strict=True)):
        _, turn, dilation = maps.look_up(table, i, other)
        level = 1.5 / math.log(2) * math.log(dilation)
        own_parts.append(oracle.parts(drawn, mapped, pair, other, turn, level))
    assert (found.shape, found.size) == pytest.approx(np.mean(own_parts, axis=0), abs=1e-9)
    parts = (found.similarity, found.rotation, found.dilation, found.shape, found.size)
    assert found.total == pytest.approx(np.average(parts, weights=weights), abs=1e-9)
    bare = RelationTable(table.similarity, table.rotation, table.dilation, 4, 5)
    thesis = maps.confidence(bare, entries)
    assert parts[:3] == pytest.approx(thesis[1:], abs=1e-9)


@given(
    st.integers(0, 1000),
    st.integers(0, 179),
    st.sampled_from([1e-6, 0.3, 1.0, 7.0, 1e6]),
    WEIGHTS,
)
@examples(25)
def test_turning_and_scaling_the_sketch_changes_nothing(seed, bins, factor, weights):
    sketch, scene = sketched(seed)
    searched = ConfidenceWeights(*weights).searched
    fmap = Fmap.from_object_map(np.random.default_rng(seed).permutation(5)[:4], 5)
    totals = [
        fmap_confidence(fmap, weighed(drawn, scene, weights)[0], searched).total
        for drawn in (sketch.scene, moved(sketch.scene, 2 * math.pi * bins / 180, factor))
    ]
    assert totals[0] == pytest.approx(totals[1], abs=1e-7)


@compiled_only
@pytest.mark.parametrize("searcher", ["auto", "exact", "direct", "easm", "nn", "fsnn-pso"])
@pytest.mark.parametrize("exchanged", [False, True])
def test_rotations_of_distant_pairs_count_for_more(searcher, exchanged):
    sketch, scene = sketched(4, 6, 5, displacement=0.3, turn=0.3)
    first, second = (scene, sketch.scene) if exchanged else (sketch.scene, scene)
    options = {"judge": "confidence", "weights": (1, 2, 1, 0, 0, 1.5)}
    result = match(first, second, searcher=searcher, **options)
    few = [item.centroid for item in sketch.scene.objects]
    side = "map_pair" if exchanged else "sketch_pair"
    counts = [math.dist(*(few[k] for k in getattr(line, side))) ** 1.5 for line in result.fmap]
    turns = [complex(math.cos(line.rotation), math.sin(line.rotation)) for line in result.fmap]
    total = sum(count * turn for count, turn in zip(counts, turns, strict=True))
    found = result.confidence
    assert found.rotation == pytest.approx(abs(total) / sum(counts), abs=1e-9)
    parts = (found.similarity, found.rotation, found.dilation)
    assert found.total == pytest.approx(np.average(parts, weights=(1, 2, 1)), abs=1e-9)
    assert result.rotation == pytest.approx(math.atan2(total.imag, total.real), abs=1e-9)


@given(scenes(most=5), floats(0.0, 4.0))
@examples(60)
def test_rotation_weights_are_powers_of_distances(scene, distance):
    apart = [
        math.dist(scene.objects[a].centroid, scene.objects[b].centroid)
        for a, b in maps.pairs(len(scene))
    ]
    mean = sum(apart) / len(apart)
    expected = [max(d / mean, 0.01) ** distance if mean else 1.0 for d in apart]
    assert rotation_weights(scene, distance).tolist() == pytest.approx(expected, rel=1e-9)


def test_an_exponent_of_0_is_the_thesis_s_zeta():
    sketch, scene = sketched(5)
    three, six = (
        match(sketch.scene, scene, judge="confidence", weights=weights)
        for weights in ((1, 1, 1), (1, 1, 1, 0, 0, 0))
    )
    assert three.confidence == six.confidence
    assert three.probability == six.probability is not None
    other = match(sketch.scene, scene, judge="confidence", weights=(1, 1, 1, 0, 0, 1))
    assert other.probability is None


def test_objects_around_one_centre_weigh_alike():
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    rings = [[square * k, square[::-1] * (k - 0.5)] for k in (1.0, 2.0, 3.0)]
    scene = Scene.from_polygons(rings)
    assert rotation_weights(scene, 2.0).tolist() == [1.0, 1.0, 1.0]
    assert match(scene, scene, weights=(1, 1, 1, 0, 0, 2)).fmap_confidence == pytest.approx(1.0)


def test_objects_which_share_one_centre_count_as_if_a_hundredth_of_the_mean_apart():
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    frame = [3.0 * square, 2.0 * square[::-1]]
    scene = Scene.from_polygons([[square], frame, [square + np.array([9.0, 0.0])]])
    # The mean distance is 6.
    assert rotation_weights(scene, 1.0).tolist() == pytest.approx([0.01, 1.5, 1.5])
    assert rotation_weights(scene, 2.0).tolist() == pytest.approx([0.0001, 2.25, 2.25])


def test_a_copy_is_as_alike_as_can_be():
    scene = random_scene(np.random.default_rng(1), 5)
    result = match(moved(scene, math.pi / 2, 3.0), scene, weights=(1, 1, 1, 1, 1))
    assert result.object_map == {k: k for k in range(5)}
    assert (result.confidence.shape, result.confidence.size) == pytest.approx((1.0, 1.0))
    assert result.fmap_confidence == pytest.approx(1.0)


def test_objects_tell_apart_what_their_places_cannot():
    # Two pairs of objects on a square, alike but for their shapes and sizes: a half turn fits too.
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    bar, dot = square * (1.6, 0.5), square * 0.6
    places = np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0]])
    scene = Scene.from_polygons(
        [item + place for item, place in zip([square, bar, dot, square], places, strict=True)]
    )
    drawn = Scene.from_polygons([item.rings[0][:, ::-1] * (-1, 1) for item in scene.objects])
    truth = {k: k for k in range(4)}
    for profile in ("thesis", None):
        assert match(drawn, scene, profile=profile, weights=(1, 1, 1, 3, 3)).object_map == truth


@compiled_only
@pytest.mark.parametrize("searcher", ["auto", "exact", "direct", "easm"])
@pytest.mark.parametrize("exchanged", [False, True])
def test_every_searcher_of_object_maps_finds_the_best(searcher, exchanged):
    sketch, scene = sketched(3, 6, 5, displacement=0.3, turn=0.3, stretch=0.3, wobble=0.1)
    weights = (1, 2, 0.5, 0.7, 1.1)
    first, second = (scene, sketch.scene) if exchanged else (sketch.scene, scene)
    directions = {"histogram": {"directions": 180}}
    options = {"judge": "confidence", "weights": weights, "params": directions}
    result = match(first, second, searcher=searcher, **options)
    table, _ = weighed(sketch.scene, scene, weights)
    best, partners = maps.best_object_map(table, ConfidenceWeights(*weights).searched)
    found = result.confidence
    parts = (found.similarity, found.rotation, found.dilation, found.shape, found.size)
    assert found.total == pytest.approx(best, abs=1e-9)
    assert found.total == pytest.approx(np.average(parts, weights=weights), abs=1e-9)
    drawn = {c: a for a, c in enumerate(partners)} if exchanged else dict(enumerate(partners))
    assert result.object_map == drawn
    assert all(other.confidence.shape is not None for other in result.alternatives)
    assert result.omap_confidence == pytest.approx(found.similarity)


@compiled_only
@pytest.mark.parametrize("searcher", ["auto", "direct", "easm", "nn"])
def test_without_weights_for_objects_the_answer_is_the_thesis_s(searcher):
    sketch, scene = sketched(5)
    three, five = (
        match(sketch.scene, scene, searcher=searcher, judge="confidence", weights=weights)
        for weights in ((1, 1, 1), (1, 1, 1, 0, 0))
    )
    assert three.confidence == five.confidence
    assert (five.confidence.shape, five.confidence.size) == (None, None)
    timeless = replace(three.statistics, seconds={})
    assert (three.fmap, timeless) == (five.fmap, replace(five.statistics, seconds={}))


@pytest.mark.parametrize(
    ("searcher", "params"),
    [("nn", {}), ("nn-pso", {}), ("fsnn-pso", {}), ("easm", {"consistency": "pairwise"})],
)
@pytest.mark.parametrize(
    ("weights", "field"), [((1, 1, 1, 1, 0), "shape"), ((1, 1, 1, 0, 1), "size")]
)
def test_a_search_of_pairs_is_refused(searcher, params, weights, field):
    scene = random_scene(np.random.default_rng(0), 3)
    words = rf"^weights\.{field} needs a searcher .* which '{searcher}'.*choose another"
    with pytest.raises(InvalidInputError, match=words):
        match(scene, scene, searcher=searcher, params={"searcher": params}, weights=weights)


@pytest.mark.parametrize(
    ("weights", "words"),
    [
        ((1, 1, 1, 1), "weights are 4 numbers; give three"),
        ((1, 1, 1, 0, 0, 5), r"weights\.distance is 5; give a number from 0 to 4"),
        ((1, 1, 1, 0, 0, math.nan), r"weights\.distance is nan; give a number from 0 to 4"),
        ((0, 0, 0, 0, 0, 1), "weights are all zero"),
        ((1, 1, 1, -1, 0), r"weights\.shape is -1; give a number from 0"),
        ((1, 1, 1, 0, math.nan), r"weights\.size is nan; give a number from 0"),
        ((0, 0, 0, 0, 0), "weights are all zero"),
    ],
)
def test_weights_that_cannot_be_are_refused(weights, words):
    scene = random_scene(np.random.default_rng(0), 3)
    with pytest.raises(InvalidInputError, match=words):
        match(scene, scene, weights=weights)


def test_shape_alone_decides_where_nothing_else_has_weight():
    sketch, scene = sketched(2)
    result = match(sketch.scene, scene, weights=(0, 0, 0, 2, 0))
    assert result.fmap_confidence == pytest.approx(result.confidence.shape, abs=1e-12)


def test_evidence_of_another_shape_is_no_table():
    one = np.ones((1, 1))
    with pytest.raises(ValueError, match=r"evidence has shape \(1, 1\), not \(1, 2\)"):
        RelationTable(one, one, one, 2, 2, one)
