"""That learning what the judge ``posterior`` goes by finds what is there."""

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from sketchmatch_builtin.alignment import Line, Measured, Whole
from sketchmatch_builtin.judges._evidence import Described, weighed, worths
from sketchmatch_builtin.judges.calibration import posterior_of
from tests.experiments import (
    learn,
    networks,
    posterior,
)
from tests.experiments.networks import Case, fitted_place
from tests.experiments.posterior import (
    Known,
    knowing,
    known_of,
    learned_posterior,
    posterior_text,
)
from tests.experiments.runs import each_of
from tests.experiments.training import training_drawing


def made_up(rng, count, elsewhere=0.3, maps=8, n=5):
    """Return cases in which the right map follows from deviations of places and of sizes.

    A map is worth −Σ (1.5 |size| + ln(.003 + place)) of its lines, and a place is told by the
    decoys: elsewhere they score as the maps do.
    """
    cases = []
    for _ in range(count):
        lines = np.zeros((maps, n, len(Line)))
        lines[:, :, Line.PLACE] = np.exp(rng.normal(-2.0, 0.7, (maps, n)))
        lines[:, :, Line.SIZE] = rng.normal(0.0, 0.6, (maps, n))
        wholes = np.zeros((maps, len(Whole)))
        wholes[:, Whole.MATCHED] = n
        wholes[:, Whole.SCORE] = rng.normal(-10.0, 1.0, maps)  # says nothing
        found = np.array([rng.permutation(9)[:n] for _ in range(maps)])
        deviations = 1.5 * abs(lines[:, :, Line.SIZE]) + np.log(0.003 + lines[:, :, Line.PLACE])
        worths = -deviations.sum(axis=1)
        shares = np.exp(worths - worths.max())
        right = int(rng.choice(maps, p=shares / shares.sum()))
        other, lost = rng.random(2) < (elsewhere, 0.2)
        decoy = Measured(lines[:3], wholes[:3].copy(), np.ones((3, n), dtype=bool))
        decoy.wholes[:, Whole.SCORE] = -10.0 if other else -30.0
        described = Described(
            found, Measured(lines, wholes, found >= 0), (decoy, decoy), n, 9, True
        )
        truth = np.full(n, -1) if other else np.roll(found[right], 1) if lost else found[right]
        cases.append(Known(described, -1 if lost or other else right, bool(other), truth))
    return cases


@pytest.mark.slow
def test_a_fit_finds_what_made_the_cases():
    learned = learned_posterior(
        made_up(np.random.default_rng(0), 3000), made_up(np.random.default_rng(2), 300)
    )
    best, ideal, told = [], [], []
    for case in made_up(np.random.default_rng(1), 1000):
        found, known = weighed(case.described, learned), case.described.measured
        told.append((found.elsewhere > 0.5) == case.elsewhere)
        if case.right >= 0:
            deviations = 1.5 * abs(known.lines[:, :, Line.SIZE])
            worths = -(deviations + np.log(0.003 + known.lines[:, :, Line.PLACE])).sum(axis=1)
            ideal.append(worths[case.right] - np.logaddexp.reduce(worths))
            best.append(np.log(found.shares[case.right]))
    assert np.mean(told) > 0.98
    nothing = np.log(1.0 / 8.0)  # of eight maps; so many numbers learn most from so few cases
    assert np.mean(best) - nothing > 0.6 * (np.mean(ideal) - nothing) > 0.4
    assert learned.labels[0] > 0.3
    assert learned.labels[1] < -0.3
    assert 0.0 <= learned.luck <= 1.0


def test_what_was_learned_is_written_and_read_again():
    cases = [networks_case(np.random.default_rng(k)) for k in range(8)]
    layers = posterior._rounded_layers(networks.fitted_maps(cases))
    place = posterior._rounded_place(
        fitted_place(np.random.default_rng(0).normal(size=(9, 64)), np.arange(9) < 5, np.ones(9))
    )
    learned = posterior.Posterior(
        layers, layers, place, np.array([1.0, -2.0]), np.arange(6.0), 0.25
    )
    text = posterior_text(learned)
    again = posterior_of(text)
    for one, other in ((again.maps, layers), (again.place, place), (again[3:], learned[3:])):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a, b)
    assert max(map(len, text.splitlines())) < 700
    assert len(text.splitlines()) < 450


def networks_case(rng):
    maps, n = int(rng.integers(2, 6)), int(rng.integers(2, 5))
    matched = rng.random((maps, n)) < 0.7
    matched[0] = True
    return Case(
        rng.normal(size=(maps, n, 11)) * matched[:, :, None],
        matched,
        rng.normal(size=(maps, 8)),
        rng.normal(size=3),
        rng.normal(size=maps),
        int(rng.integers(maps)),
    )


def test_who_goes_on_begins_with_what_is_known(monkeypatch):
    monkeypatch.setattr(networks, "_EPOCHS", 2)
    first, cases = ([networks_case(np.random.default_rng(k + n)) for k in range(9)] for n in (0, 9))
    known = networks.fitted_maps(first)
    monkeypatch.setattr(networks, "_EPOCHS", 0)
    for one, other in zip(networks.fitted_maps(cases, start=known), known, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.slow
def test_who_knows_what_is_judged_leaves_nothing_of_what_was_known():
    rng = np.random.default_rng(0)
    first = learned_posterior(made_up(rng, 60), made_up(rng, 50))
    seen, checked = made_up(rng, 1200), made_up(rng, 300)
    judge = knowing(first, seen)
    for part in ("maps", "place", "lost"):
        assert repr(getattr(judge, part)) != repr(getattr(first, part))
    assert judge.bare is first.bare

    def told(learned):
        return np.mean(
            [(weighed(c.described, learned).elsewhere > 0.5) == c.elsewhere for c in checked]
        )

    def right(learned):
        here = [c for c in checked if c.right >= 0]
        return np.mean([weighed(c.described, learned).shares[c.right] for c in here])

    assert told(judge) > 0.97
    assert right(judge) > right(first) + 0.02


@pytest.mark.slow
def test_how_often_the_right_map_is_unknown_follows_from_what_the_best_is_worth():
    rng = np.random.default_rng(0)
    first = learned_posterior(made_up(rng, 60), made_up(rng, 50))

    def lost_where_nothing_fits(count, missing):
        """Return cases of this place whose right map is unknown where all lines deviate a lot."""
        found = []
        for each in made_up(rng, count, elsewhere=0.0):
            lost = rng.random() < missing
            each.described.measured.lines[:, :, Line.PLACE] *= 30.0 if lost else 1.0
            found.append(replace(each, right=-1 if lost else max(each.right, 0)))
        return found

    def doubts(learned, cases, lost):
        return np.mean(
            [weighed(each.described, learned).lost for each in cases if (each.right < 0) == lost]
        )

    def doubting(missing):
        cases, others = (
            posterior._valued(lost_where_nothing_fits(300, share), first.maps, first.bare)
            for share in (0.5, missing)
        )
        return first._replace(lost=posterior._lost(cases, others))

    checked = lost_where_nothing_fits(150, 0.5)
    often = doubting(0.5)
    assert doubts(often, checked, True) > 0.8
    assert doubts(often, checked, False) < 0.3
    # Where fewer are lost, all are doubted less; where that is likely remains the same.
    seldom = doubting(0.02)
    assert seldom.lost[0] < often.lost[0] - 1.0
    assert doubts(seldom, checked, True) > 2.0 * doubts(seldom, checked, False)


@pytest.mark.slow
@pytest.mark.parametrize("sharper", [0.7, 1.0, 1.6])
def test_maps_are_told_as_surely_as_those_of_others(sharper):
    rng = np.random.default_rng(0)
    layers = learned_posterior(made_up(rng, 60), made_up(rng, 50)).maps
    others = []
    for each in made_up(rng, 1500, elsewhere=0.0):
        of = each.described
        values = sharper * worths(of, of.measured, layers, True)
        shares = np.exp(values - values.max())
        others.append(replace(each, right=int(rng.choice(8, p=shares / shares.sum()))))
    found = posterior._as_sharp_as_for(others, layers, related=True)
    assert found.score / layers.score == pytest.approx(sharper, abs=0.15)
    of = others[0].described
    np.testing.assert_allclose(
        worths(of, of.measured, found, True),
        found.score / layers.score * worths(of, of.measured, layers, True),
    )


@pytest.mark.slow
def test_learning_runs_from_start_to_end_and_goes_on_where_it_was(tmp_path, monkeypatch):
    monkeypatch.setattr(networks, "_EPOCHS", 2)
    monkeypatch.setattr(learn, "each_of", partial(each_of, processes=1))
    found = []
    for into in ("one", "two"):
        (tmp_path / into).mkdir()
        (tmp_path / "kept").mkdir(exist_ok=True)
        learn.main(
            ["--sketches", "8", "--into", str(tmp_path / into), "--kept", str(tmp_path / "kept")]
        )
        found.append(
            [(tmp_path / into / name).read_text() for name in ("learned.json", "posterior.json")]
        )
    assert found[0] == found[1]
    learned = posterior_of(found[0][1])
    assert learned.maps.of_lines.shape == (2, 24)
    assert learned.lost.shape == (6,)
    assert json.loads(found[0][0])["sketches"]["training"] == 8


def test_slopes_of_maps_are_those_of_small_steps():
    rng = np.random.default_rng(0)
    cases = [networks_case(rng) for _ in range(5)]
    at = {
        "first": rng.normal(size=(14, 3)),
        "first_bias": rng.normal(size=3),
        "second": rng.normal(size=(14, 4)),
        "second_bias": rng.normal(size=4),
        "last": rng.normal(size=4),
        "direct": rng.normal(size=8),
        "score": rng.normal(size=1),
    }

    def loss():
        total = 0.0
        for case in cases:
            worths = []
            for x in range(len(case.whole)):
                lines = [np.append(line, case.scene) for line in case.lines[x]]
                hidden = [np.maximum(line @ at["first"] + at["first_bias"], 0.0) for line in lines]
                among = np.concatenate([case.whole[x], case.scene, networks.LINES * sum(hidden)])
                second = np.maximum(among @ at["second"] + at["second_bias"], 0.0)
                worth = second @ at["last"] + case.whole[x] @ at["direct"]
                worths.append(worth + at["score"][0] * case.score[x])
            total += np.logaddexp.reduce(worths) - worths[case.right]
        return total / len(cases)

    slopes = networks._map_slopes(at, cases)
    assert set(slopes) == set(at)
    for name, values in at.items():
        for k in rng.permutation(values.size)[:6]:
            spot = np.unravel_index(k, values.shape)
            before, around = values[spot], []
            for step in (1e-6, -1e-6):
                values[spot] = before + step
                around.append(loss())
            values[spot] = before
            expected = (around[0] - around[1]) / 2e-6
            assert slopes[name][spot] == pytest.approx(expected, abs=1e-6), (name, spot)


def test_a_place_fit_finds_known_odds_and_counts_cases_as_told():
    rng = np.random.default_rng(3)
    rows = rng.normal(size=(4000, 2)) * [1.0, 3.0] + [5.0, 0.0]
    odds = abs(rows[:, 0] - 5.0) * 3.0 - rows[:, 1] - 2.0
    here = rng.random(4000) < 1.0 / (1.0 + np.exp(-odds))
    plain = odds_of(fitted_place(rows, here, np.ones(4000)), rows)
    assert np.sqrt(np.mean((plain - odds)[abs(odds) < 4.0] ** 2)) < 0.5
    counted = odds_of(fitted_place(rows, here, np.where(here, 1.0, 3.0)), rows)
    assert np.mean((counted - plain)[abs(odds) < 2.0]) == pytest.approx(-np.log(3.0), abs=0.25)


def odds_of(layers, rows):
    z = (rows - layers.of_places[0]) / layers.of_places[1]
    hidden = np.maximum(z @ layers.first + layers.first_bias, 0.0)
    return hidden @ layers.last + z @ layers.direct + layers.constant


def test_a_conditional_logit_finds_known_weights_beside_offsets():
    rng = np.random.default_rng(1)
    weights = np.array([1.5, -0.7])
    rows, rights, offsets = [], [], []
    for _ in range(4000):
        count = int(rng.integers(2, 7))
        x, beside = rng.normal(size=(count, 2)) * [1.0, 4.0], rng.normal(size=count)
        scores = x @ weights + beside
        shares = np.exp(scores - scores.max())
        rows.append(x)
        offsets.append(beside)
        rights.append(int(rng.choice(count, p=shares / shares.sum())))
    found = posterior._conditional(rows, np.array(rights), offsets)
    np.testing.assert_allclose(found, weights, atol=0.12)


def test_a_logit_finds_known_weights_and_counts_cases_as_told():
    rng = np.random.default_rng(2)
    x = np.column_stack([np.ones(6000), 3.0 * rng.normal(size=6000)])
    truth = (rng.random(6000) < 1.0 / (1.0 + np.exp(-(x @ [0.5, -1.0])))).astype(float)
    np.testing.assert_allclose(posterior._logit(x, truth, np.ones(6000)), [0.5, -1.0], atol=0.12)
    # Those that are not so count more: the odds of all fall by the logarithm of it.
    counted = posterior._logit(x, truth, np.where(truth > 0.0, 1.0, 3.0))
    assert counted[0] == pytest.approx(0.5 - np.log(3.0), abs=0.2)


def bare(maps, mapped):
    """Return maps of which nothing is measured."""
    lines, wholes = np.zeros((*maps.shape, len(Line))), np.zeros((len(maps), len(Whole)))
    measured = Measured(lines, wholes, maps >= 0)
    return Described(maps, measured, (), maps.shape[1], mapped, True)


def test_labels_that_were_put_on_a_sketch_are_mostly_right():
    rng = np.random.default_rng(0)
    truth = np.array([0, 2, 4, -1, 6, 8])
    case = Known(bare(truth[None], 12), 0, False, truth)
    tallies = np.zeros(3)
    for _ in range(400):
        names = posterior._named(case, rng)
        assert names.shape == (6, 12)
        for g, h in enumerate(truth):
            if h >= 0:
                tallies[names[g, h]] += 1
    nothing, alike, unlike = tallies / tallies.sum()
    assert nothing == pytest.approx(1.0 - 0.7**2, abs=0.05)
    assert alike / (alike + unlike) == pytest.approx(0.9 + 0.1 / 6.0, abs=0.03)


@pytest.mark.slow
def test_a_sketch_is_known_by_its_maps_and_which_of_them_is_right():
    rights = others = 0
    for number in range(12):
        for known in known_of(number):
            drawing = training_drawing(number)
            np.testing.assert_array_equal(known.truth, drawing.truth)
            assert known.elsewhere == bool((drawing.truth < 0).all())
            assert known.described.drawn == len(drawing.scene)
            assert known.described.mapped == len(drawing.map)
            assert len(known.described.maps) == len(known.described.measured.lines)
            others += known.elsewhere
            if known.right >= 0:
                rights += 1
                np.testing.assert_array_equal(known.described.maps[known.right], drawing.truth)
                assert not known.elsewhere
    assert rights >= 4
    assert others >= 2


def case_with_right(right, maps=400):
    rng = np.random.default_rng(0)
    found = np.array([rng.permutation(9)[:4] for _ in range(maps)])
    known = Measured(
        rng.random((maps, 4, len(Line))),
        rng.random((maps, len(Whole))),
        np.ones((maps, 4), dtype=bool),
    )
    return Known(Described(found, known, (), 4, 9, True), right, False, found[right])


@pytest.mark.parametrize(("right", "compared"), [(0, 40), (39, 40), (40, 300), (299, 300)])
def test_the_right_map_is_compared_with_those_that_fit_best_or_with_more_where_it_does_not(
    right, compared
):
    known = case_with_right(right)
    assert posterior._met([known]) == [known]
    case = posterior._case(known, related=True)
    assert case.right == right
    assert case.lines.shape == (compared, 4, 24)
    assert case.whole.shape == (compared, 8)
    np.testing.assert_array_equal(
        case.score, known.described.measured.wholes[:compared, Whole.SCORE]
    )


def test_of_maps_nothing_is_learned_from_a_right_one_that_is_not_met_or_far_beyond_the_best():
    unmet = replace(case_with_right(0), right=-1)
    assert posterior._met([case_with_right(300), unmet, case_with_right(399)]) == []
    # Where there are fewer, all are compared.
    assert posterior._case(case_with_right(45, maps=60), related=True).lines.shape == (60, 4, 24)


def test_other_places_count_more_where_a_sketch_shows_enough():
    def case(drawn, elsewhere):
        return Known(
            bare(np.zeros((1, drawn), dtype=np.int64), 9), -1, elsewhere, np.full(drawn, -1)
        )

    assert posterior._counts(case(12, True))
    assert not posterior._counts(case(2, True))
    assert not posterior._counts(case(12, False))
