"""How likely answers are right, against a sum over all maps that are considered."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch import Scene, match
from sketchmatch.api import Candidate, JudgeProblem, MatchProblem
from sketchmatch.model import ConfidenceWeights, Fmap
from sketchmatch.pipeline.alternatives import exchange_confidences
from sketchmatch.pipeline.correspond import fmap_confidence, object_map, occm
from sketchmatch.pipeline.slices import finish
from sketchmatch.pipeline.unmatched import Part, omission_confidences, part_of
from sketchmatch.testing import random_scene, simulate_sketch
from sketchmatch_builtin.judges._odds import likelihood, met
from sketchmatch_builtin.judges.calibration import Calibration, calibrated, default_price
from sketchmatch_builtin.searchers.exact import Exact
from tests.interpreted import examples
from tests.strategies import random_table

WEIGHTS = (1.0, 1.0, 1.0)
SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
SCENE = Scene.from_polygons([SQUARE, SQUARE + 2])


def zeta(kept, partners, table):
    part = finish(part_of(Part.whole(table), kept))
    fmap = Fmap.from_object_map(np.array(partners), table.argument_objects)
    return fmap_confidence(fmap, part.table, WEIGHTS)


def worth(mapping, table, calibration):
    """Return ζ less the price of what a map, template → argument, leaves out."""
    objects = table.template_objects
    kept = sorted(mapping)
    confidence = zeta(kept, [mapping[g] for g in kept], table).total
    return confidence - calibration.price * (objects - len(kept)) / objects


def considered(best, argument_objects, others):
    """Return the best map, every one that an exchange or an omission makes of it, and others."""
    found = {frozenset(best.items())}
    for g, h in itertools.product(best, range(argument_objects)):
        changed = {k: best[g] if p == h else p for k, p in best.items()} | {g: h}
        found.add(frozenset(changed.items()))
        if len(best) > 3:
            found.add(frozenset((k, p) for k, p in best.items() if k != g))
    found |= {frozenset(other.items()) for other in others}
    return [dict(each) for each in found]


@examples(40)
@given(
    seed=st.integers(0, 2**32 - 1),
    few=st.integers(3, 6),
    more=st.integers(0, 2),
    left_out=st.integers(0, 1),
    doubt=st.floats(0.0, 1.0),
    reserve=st.floats(-5.0, 5.0),
    luck=st.floats(0.0, 1.0),
)
def test_a_probability_is_a_share_of_all_odds(seed, few, more, left_out, doubt, reserve, luck):
    rng = np.random.default_rng(seed)
    table = random_table(rng, few, few + more)
    calibration = Calibration(0.2, 2.0, 1.3, doubt, reserve, luck)
    left_out = min(left_out, few - 3)
    kept = sorted(rng.permutation(few)[left_out:].tolist())
    part = finish(part_of(Part.whole(table), kept))
    *_, last = Exact().search(MatchProblem(part.table, WEIGHTS), rng)
    found = object_map(occm(last.fmap, part.table))
    best = dict(zip(kept, found.partners.tolist(), strict=True))
    others = [random_map(rng, few, few + more) for _ in range(4)]
    others = [other for k, other in enumerate(others) if other not in (best, *others[:k])]
    first, *rivals = (candidate(each, table) for each in (best, *others))
    problem = JudgeProblem(
        SCENE,
        SCENE,
        table,
        ConfidenceWeights(),
        (first, *rivals),
        exchanges=exchange_confidences(found, part.table, WEIGHTS),
        omissions=omission_confidences(last.fmap, part.table, WEIGHTS),
    )
    computed = likelihood(problem, rivals, calibration)
    maps = considered(best, few + more, others)
    steep = calibration.sharpness * few**calibration.growth
    top = worth(best, table, calibration)
    odds = [math.exp(steep * (worth(each, table, calibration) - top)) for each in maps]
    nothing = math.exp(steep * (doubt - top) + reserve)
    total = sum(odds) + nothing
    for judged, mapping in zip(computed.maps, (best, *others), strict=True):
        share = math.exp(steep * (worth(mapping, table, calibration) - top)) / total
        assert judged.probability == pytest.approx(share, abs=1e-9)
    for g in range(few):
        agreeing = sum(o for o, each in zip(odds, maps, strict=True) if each.get(g) == best.get(g))
        expected = (agreeing + luck * nothing) / total
        assert computed.lines[g, best.get(g, -1)] == pytest.approx(expected, abs=1e-9)
        for h in {None, *range(few + more)} - {best.get(g)}:
            agreeing = sum(o for o, each in zip(odds, maps, strict=True) if each.get(g) == h)
            line = computed.lines[g, -1 if h is None else h]
            assert line == pytest.approx(agreeing / total, abs=1e-9)


@pytest.mark.parametrize(
    ("rival", "known"),
    [
        ([-1, 1, 2, 3], True),
        ([1, 0, 2, 3], True),
        ([0, 1, 2, 4], True),
        ([-1, 1, 2, 4], False),
        ([-1, 2, 1, 3], False),
        ([1, 2, 0, 3], False),
        ([1, 0, 3, 2], False),
        ([4, 0, 2, 3], False),
    ],
)
def test_a_rival_counts_once_where_it_is_an_exchange_or_an_omission_too(rival, known):
    table = random_table(np.random.default_rng(1), 4, 5)
    first = candidate(dict(enumerate(range(4))), table)
    found = object_map(occm(Fmap.from_object_map(first.partners, 5), table))
    problem = JudgeProblem(
        SCENE,
        SCENE,
        table,
        ConfidenceWeights(),
        (first,),
        exchanges=exchange_confidences(found, table, WEIGHTS),
        omissions=omission_confidences(Fmap.from_object_map(first.partners, 5), table, WEIGHTS),
    )
    calibration = Calibration(0.2, 2.0, 1.3, 0.5, 0.0, 0.5)
    other = candidate({g: h for g, h in enumerate(rival) if h >= 0}, table)
    alone, beside = (likelihood(problem, others, calibration) for others in ((), (other,)))
    same = beside.maps[0].probability == alone.maps[0].probability
    assert same is known
    assert (beside.lines == alone.lines).all() is np.bool_(known)


@pytest.mark.parametrize("alternatives", [0, 2, 9])
def test_as_many_maps_of_the_same_objects_count_as_are_wanted_and_all_of_others(alternatives):
    table = random_table(np.random.default_rng(0), 3, 4)
    rows = [(0, 1, 2), (1, 0, 2), (0, 1, -1), (2, 1, 0), (-1, 1, 2), (0, 2, 1)]
    first, *others = (Candidate(np.array(row), zeta((0, 1, 2), (0, 1, 2), table)) for row in rows)
    problem = JudgeProblem(
        SCENE, SCENE, table, ConfidenceWeights(), (first, *others), alternatives=alternatives
    )
    whole = [(1, 0, 2), (2, 1, 0), (0, 2, 1)]
    counted = {*whole[:alternatives], (0, 1, -1), (-1, 1, 2)}
    found = [tuple(each.partners.tolist()) for each in met(problem)]
    assert found == [row for row in rows if row in counted]


def random_map(rng, few, many):
    kept = sorted(rng.permutation(few)[rng.integers(0, few - 2) :].tolist())
    return dict(zip(kept, rng.permutation(many).tolist(), strict=False))


def candidate(mapping, table):
    kept = sorted(mapping)
    partners = np.full(table.template_objects, -1)
    partners[kept] = [mapping[g] for g in kept]
    return Candidate(partners, zeta(kept, partners[kept], table))


def test_good_sketches_are_likelier_right_than_bad_ones():
    scene = random_scene(np.random.default_rng(1), 8)
    means = []
    for displacement in (0.02, 0.8):
        results = []
        for seed in range(8):
            rng = np.random.default_rng(seed)
            drawn = simulate_sketch(scene, rng, objects=range(6), displacement=displacement)
            results.append(match(drawn.scene, scene, profile="thesis"))
        for result in results:
            for line in result.matches:
                assert result.probability - 1e-9 <= line.probability <= 1.0
        means.append(np.mean([result.probability for result in results]))
    assert means[0] > 0.75
    assert means[1] < means[0] - 0.2


def test_a_symmetric_scene_may_be_any_of_its_turns():
    grid = Scene.from_polygons([np.add(SQUARE, (4 * k, 4 * m)) for k in range(3) for m in range(3)])
    result = match(grid, grid, profile="thesis")
    assert result.probability == pytest.approx(0.25, abs=0.03)
    by_object = {line.sketch_object: line.probability for line in result.matches}
    assert by_object.pop(4) > 0.9, "the object in the middle"
    assert all(value < 0.55 for value in by_object.values())


@pytest.mark.parametrize(
    "settings",
    [
        {"weights": (1, 2, 3)},
        {"histogram": "gravitational"},
        {"similarity": "pappis"},
        {"searcher": "nn"},
        {"searcher": "easm", "params": {"searcher": {"consistency": "pairwise"}}},
    ],
)
def test_nothing_is_said_where_nothing_was_learned(settings):
    scene = random_scene(np.random.default_rng(3), 5)
    result = match(scene, scene, judge="confidence", **settings)
    assert result.probability is None
    assert all(line.probability is None for line in result.matches)


def test_weights_are_those_that_were_learned_whatever_their_unit():
    assert calibrated(ConfidenceWeights(3, 3, 3)) == calibrated(ConfidenceWeights()) is not None
    assert calibrated(ConfidenceWeights(distance=0.5)) is None
    assert calibrated(ConfidenceWeights(shape=1.0)) is None
    assert calibrated(ConfidenceWeights(1, 1, 2)) is None
    assert default_price(ConfidenceWeights(1, 1, 2)) == default_price(ConfidenceWeights())


def test_the_profile_weighs_unless_the_request_does(tmp_path):
    config = tmp_path / "mine.toml"
    config.write_text("[profiles.mine]\nweights = [1, 3.8, 0.05, 2.9, 0.58, 1]\n")
    scene = random_scene(np.random.default_rng(4), 5)
    options = {"profile": "mine", "config": config}
    assert match(scene, scene, **options).confidence.shape is not None
    assert match(scene, scene, **options, weights=(1, 1, 1)).confidence.shape is None
    assert match(scene, scene).confidence.shape is None
