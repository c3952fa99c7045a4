"""What was learned: by a fit that finds what there is, and as the engine has it."""

import dataclasses
import json

import numpy as np
import pytest

from sketchmatch.model import ConfidenceWeights
from sketchmatch_builtin.judges.calibration import calibrated
from tests.experiments import calibrate, drawings, learn, odds, thesis
from tests.experiments.protocol import STRONGER
from tests.experiments.study import STRENGTH

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def found():
    return json.loads(learn.LEARNED.read_text(encoding="utf-8"))


def test_the_engine_has_the_numbers_that_were_learned(found):
    calibration = dataclasses.asdict(calibrated(ConfidenceWeights(*learn.THESIS)))
    assert {key: found["odds"][key] for key in calibration} == calibration


def test_the_study_learns_from_no_sketch_that_a_table_is_made_of():
    seeds = [*drawings.SEEDS.values(), calibrate.SEED]
    assert len({0, *seeds}) == 1 + len(seeds)


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
