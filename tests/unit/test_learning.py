"""What was learned: by a fit that finds what there is, and as the engine has it."""

import dataclasses
import json
import math

import numpy as np
import pytest

from sketchmatch.config import builtin
from sketchmatch.model import ConfidenceWeights
from sketchmatch_builtin.judges.calibration import LEARNED, calibrated
from tests.experiments import calibrate, drawings, learn, odds, thesis, weights
from tests.experiments.protocol import STRONGER
from tests.experiments.study import STRENGTH
from tests.oracle import maps
from tests.searching import relations_of

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def found():
    return json.loads(learn.LEARNED.read_text(encoding="utf-8"))


def test_the_engine_has_the_numbers_that_were_learned(found):
    assert tuple(found["weights"]) == tuple(LEARNED)
    for name, known in (("thesis", ConfidenceWeights(*learn.THESIS)), ("learned", LEARNED)):
        calibration = dataclasses.asdict(calibrated(known))
        assert {key: found["odds"][name][key] for key in calibration} == calibration
    assert tuple(builtin().defaults.named("learned").weights) == tuple(LEARNED)


def test_the_weights_are_those_that_cross_validation_chose(found):
    *others, chosen = found["held"]
    free = [line for line in others if not line["penalty"]] or [chosen]
    best = min(free, key=lambda line: line["loss"])
    same = ("compared", "distance")
    assert [chosen[key] for key in same] == [best[key] for key in same]
    assert chosen["loss"] <= best["loss"] + best["error"]
    for line in others:
        if [line[key] for key in same] == [best[key] for key in same]:
            dearer = line["loss"] > best["loss"] + best["error"]
            assert dearer or line["penalty"] <= chosen["penalty"]
    assert chosen["distance"] == LEARNED.distance


def test_the_study_learns_from_no_sketch_that_a_table_is_made_of():
    seeds = [*drawings.SEEDS.values(), calibrate.SEED]
    assert len({0, *seeds}) == 1 + len(seeds)


def test_parts_are_those_of_the_definition():
    (parts,) = weights.parts_of(0)
    drawn = drawings.drawing("weights", 0, 8, missing=1, extra=0)
    table = relations_of(drawn.scene, drawn.map)
    right = maps.induced(drawn.truth.tolist())
    _, sigma, turned, level = maps.confidence(table, right)
    assert parts.alike[parts.right, :2] == pytest.approx([sigma, level], abs=1e-9)
    assert parts.at(0.0, 3)[parts.right] == pytest.approx([sigma, turned, level], abs=1e-9)
    centroids = [item.centroid for item in drawn.scene.objects]
    counts = [math.dist(centroids[a], centroids[b]) for a, b in maps.pairs(len(centroids))]
    turns = [maps.look_up(table, i, pair)[1] for i, pair in enumerate(right)]
    total = sum(c * complex(math.cos(r), math.sin(r)) for c, r in zip(counts, turns, strict=True))
    assert parts.at(1.0, 5)[parts.right, 1] == pytest.approx(abs(total) / sum(counts), abs=1e-9)


def made_up(coefficients, cases, rng):
    """Return the parts of maps of which the right one is drawn by a logit."""
    for _ in range(cases):
        alike, turned = rng.uniform(0.7, 1.0, (6, 4)), rng.uniform(0.7, 1.0, (6, 5))
        parts = weights.Parts(alike, turned, 0)
        chances = np.exp(parts.at(1.0, 5) @ np.array(coefficients))
        yield weights.Parts(alike, turned, int(rng.choice(6, p=chances / chances.sum())))


def test_a_fit_finds_the_weights_that_there_are():
    cases = list(made_up((20.0, 40.0, 10.0, 30.0, 0.0), 3000, np.random.default_rng(0)))
    held, found = weights.learned_weights(cases)
    assert held[-1].distance == found[-1] == 1.0
    assert held[-1].compared == "relations, shapes and sizes"
    assert found[0] == 1.0
    assert found[1:4] == pytest.approx((2.0, 0.5, 1.5), rel=0.15)
    assert found[4] <= 0.1


def considered(values, left_out, truth, objects, extra):
    agree = np.ones((len(values), objects))
    return odds.Considered(
        np.array(values), np.array(left_out), agree, truth, objects, np.ones(objects), extra
    )


def test_a_calibration_finds_the_odds_that_there_are():
    rng = np.random.default_rng(1)
    price, sharpness, growth, doubt = 0.2, 30.0, 0.5, 0.7
    cases = []
    for number in range(6000):
        objects = int(rng.integers(4, 12))
        values = rng.uniform(0.6, 1.0, 5)
        left_out = np.array([0, 0, 0, 1, 1]) / objects
        scores = sharpness * objects**growth * np.append(values - price * left_out, doubt)
        chances = np.exp(scores - scores.max())
        truth = int(rng.choice(6, p=chances / chances.sum()))
        cases.append(
            considered(values, left_out, truth if truth < 5 else -1, objects, number % 13 == 0)
        )
    found = odds.learned_odds(cases)
    assert found.price == pytest.approx(price, rel=0.15)
    assert found.sharpness * 7**found.growth == pytest.approx(sharpness * 7**growth, rel=0.1)
    assert found.doubt == pytest.approx(doubt, abs=0.02)


def test_objects_that_the_map_lacks_count_as_rarely_as_in_the_thesis():
    cases = [considered([1.0], [0.0], 0, 4, extra) for extra in (True, True, True, False, False)]
    counts = odds._counts(cases)
    assert counts.sum() == pytest.approx(1.0)
    assert counts[:3].sum() == pytest.approx(2 / 26)


def test_the_strengths_give_the_thesis_s_zeta():
    zeta = {}
    for line in calibrate.calibrated().strengths:
        zeta.setdefault(float(line.drawn), []).append(line.zeta)
    printed = [thesis.AVERAGES[table][0] for table in ("4.3", "4.4")]
    letters = [
        np.mean([row.zeta for letter, row in thesis.EQUAL[table].items() if letter != "a"])
        for table in ("4.3", "4.4")
    ]
    for strength, wanted in ((STRENGTH, printed), (STRONGER, letters)):
        off = {each: abs(np.mean(found) - np.mean(wanted)) for each, found in zeta.items()}
        assert min(off, key=off.get) == strength
        assert off[strength] < 0.002


def test_luck_is_that_of_all_cases_whose_truth_is_not_known(monkeypatch):
    monkeypatch.setattr(odds, "_SIMPLEXES", 1)
    known = [considered([0.9, 0.8], [0.0, 0.0], 0, 4, False) for _ in range(24)]
    lost = [considered([0.9, 0.8], [0.0, 0.0], -1, 4, True) for _ in range(2)]
    for each, right in zip(lost, (0.0, 0.5), strict=True):
        each.right[:] = right
    assert odds.learned_odds([*known, *lost]).luck == 0.25
