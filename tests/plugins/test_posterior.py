"""The judge ``posterior``: what it makes of candidates, whatever was learned."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch import match
from sketchmatch.api import Candidate, JudgeProblem
from sketchmatch.model import Confidence, RelationTable, Scene, SceneObject
from sketchmatch.testing import judging_problem
from sketchmatch_builtin.alignment import (
    Line,
    Measured,
    Things,
    Whole,
    known_maps,
    near_maps,
    sides_of,
)
from sketchmatch_builtin.alignment._poses import TOLERANCES
from sketchmatch_builtin.judges import _described, _evidence
from sketchmatch_builtin.judges import posterior as module
from sketchmatch_builtin.judges._described import described
from sketchmatch_builtin.judges._evidence import (
    AT_FIRST,
    FARTHEST,
    LINES,
    Described,
    best_first,
    line_numbers,
    lost_numbers,
    map_numbers,
    place_numbers,
    weighed,
    worths,
)
from sketchmatch_builtin.judges.calibration import POSTERIOR, Layers, PlaceLayers
from sketchmatch_builtin.judges.calibration import Posterior as Learned
from sketchmatch_builtin.judges.posterior import Posterior
from tests.experiments.generators import sample
from tests.interpreted import examples
from tests.oracle import aligning
from tests.plugins.test_align import seen_as, sloppy, strewn
from tests.searching import relations_of
from tests.strategies import random_table

OF_LINE, OF_BARE, OF_MAP, OF_SCENE, PLACE, LOST = 24, 9, 8, 3, 64, 6


def learned(rng=None, scale=0.3, width=3, score=1.0, constant=2.0, lost=-2.0, luck=0.4):
    """Return numbers that might have been learned; without randomness what aligns best wins."""

    def numbers(*shape):
        return np.zeros(shape) if rng is None else rng.normal(0.0, scale, shape)

    def scaling(count):
        return np.stack([numbers(count), 1.0 + abs(numbers(count))])

    def layers(of_line):
        return Layers(
            scaling(of_line),
            scaling(OF_MAP),
            scaling(OF_SCENE),
            numbers(of_line + OF_SCENE, width),
            numbers(width),
            numbers(OF_MAP + OF_SCENE + width, width + 1),
            numbers(width + 1),
            numbers(width + 1),
            numbers(OF_MAP),
            score,
        )

    place = PlaceLayers(
        scaling(PLACE), numbers(PLACE, 2), numbers(2), numbers(2), numbers(PLACE), constant
    )
    lost = np.append(lost, numbers(LOST - 1))
    return Learned(layers(OF_LINE), layers(OF_BARE), place, numbers(2), lost, luck)


PLAIN = learned()


def problem(template, argument, candidates, **options):
    table = options.pop("table", None) or random_table(
        np.random.default_rng(0), len(template), len(argument)
    )
    met = tuple(Candidate(np.array(each), _ZETA) for each in candidates)
    options = {"price": 0.4, "weights": (1.0, 1.0, 1.0), **options}
    return JudgeProblem(template, argument, table, candidates=met, **options)


_ZETA = Confidence(0.5, 0.5, 0.5, 0.5)


def judge(posed, numbers_=PLAIN):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "POSTERIOR", numbers_)
        return Posterior().judge(posed)


def assert_sound(judgement, posed):
    """Check what a judgement promises, and that probabilities bound each other."""
    n, m = posed.table.template_objects, posed.table.argument_objects
    maps = [tuple(each.partners.tolist()) for each in judgement.maps]
    assert len(set(maps)) == len(maps) >= 1
    for partners in maps:
        used = [j for j in partners if j >= 0]
        assert len(used) == len(set(used))
        assert len(partners) == n
        assert all(-1 <= j < m for j in partners)
    likely = [each.probability for each in judgement.maps]
    assert likely == sorted(likely, reverse=True)
    assert 0.0 <= judgement.elsewhere <= 1.0
    assert sum(likely) <= 1.0 - judgement.elsewhere + 1e-9
    assert judgement.lines.shape == (n, m + 1)
    assert (judgement.lines >= 0.0).all()
    assert (judgement.lines <= 1.0).all()
    assert (judgement.lines.sum(axis=1) <= 1.0 + 1e-9).all()
    assert (judgement.lines[:, -1] >= judgement.elsewhere - 1e-9).all()
    for partners, probability in zip(maps, likely, strict=True):
        lines = judgement.lines[np.arange(n), list(partners)]
        assert probability <= lines.min() + 1e-9


@given(
    st.integers(0, 2**32),
    st.integers(2, 5),
    st.integers(0, 3),
    st.booleans(),
    st.sampled_from([0.01, 0.3, 5.0]),
)
@examples(60)
def test_probabilities_bound_each_other_whatever_was_learned(seed, n, more, complete, scale):
    sketch, map_, order = sloppy(seed, n, n + more)
    rng = np.random.default_rng(seed)
    other = order.copy()
    other[rng.integers(n)] = -1
    candidates = [rng.permutation(n + more)[:n], order] + ([] if complete else [other])
    candidates = list({tuple(each.tolist()): each for each in candidates}.values())
    posed = problem(
        sketch,
        map_,
        candidates,
        price=math.inf if complete else 0.4,
        alternatives=int(rng.integers(0, 40)),
    )
    judgement = judge(posed, learned(rng, scale, luck=float(rng.random())))
    assert_sound(judgement, posed)
    if complete:
        assert all((each.partners >= 0).all() for each in judgement.maps)


def nothing_is_laid(*_, **__):
    """Find no maps by laying the sketch upon the map."""
    return []


def test_shares_losses_and_lines_are_what_the_numbers_come_to(monkeypatch):
    monkeypatch.setattr(_described, "known_maps", nothing_is_laid)
    sketch, map_, order = sloppy(3, 4, 6)
    other = np.array([order[1], order[0], order[2], order[3]])
    fewer = np.array([order[0], order[1], order[2], -1])
    posed = problem(sketch, map_, [other, fewer, order])
    judgement = judge(posed)
    sides = sides_of((sketch, map_), False, None, None, None)
    known = described((sketch, map_), sides, posed.table, None, [other, fewer, order])
    found = weighed(known, PLAIN)
    by_map = dict(zip([tuple(each) for each in known.maps.tolist()], found.shares, strict=True))
    here = 1.0 - found.elsewhere
    assert judgement.elsewhere == pytest.approx(1.0 / (1.0 + math.exp(2.0)))
    assert found.lost == pytest.approx(1.0 / (1.0 + math.exp(2.0)))
    expected = np.zeros((4, 7))
    for partners, share in by_map.items():
        expected[np.arange(4), list(partners)] += here * (1.0 - found.lost) * share
    best = judgement.maps[0].partners
    np.testing.assert_array_equal(best, order)
    expected[np.arange(4), best] += here * found.lost * 0.4
    expected[:, -1] += found.elsewhere
    np.testing.assert_allclose(judgement.lines, expected, atol=1e-12)
    for each in judgement.maps:
        share = by_map[tuple(each.partners.tolist())]
        assert each.probability == pytest.approx(here * (1.0 - found.lost) * share)
    scores = np.exp(AT_FIRST * known.measured.wholes[:, Whole.SCORE])
    shares = scores / scores.sum()
    np.testing.assert_allclose(found.shares, shares, atol=1e-12)


def test_unusual_relations_do_not_count():
    sketch, map_, order = sloppy(3, 4, 6)
    numbers_ = learned(np.random.default_rng(0), 0.3)
    one, other, usual = (
        judge(problem(sketch, map_, [order], table=random_table(rng, 4, 6), usual=plain), numbers_)
        for rng, plain in zip(map(np.random.default_rng, (1, 2, 2)), (0, 0, 1), strict=True)
    )
    np.testing.assert_array_equal(one.lines, other.lines)
    assert one.elsewhere == other.elsewhere
    assert abs(usual.lines - other.lines).max() > 1e-6
    assert usual.elsewhere != other.elsewhere


def test_it_looks_for_maps_itself():
    sketch, map_, order = sloppy(5, 5, 8)
    wrong = np.roll(order, 1)
    looked = judge(problem(sketch, map_, [wrong], alternatives=9))
    np.testing.assert_array_equal(looked.maps[0].partners, order)
    assert len(looked.maps) >= 10


@pytest.mark.parametrize("alternatives", [0, 3, 500])
def test_as_many_maps_are_told_as_are_wanted_and_some_that_are_likely(alternatives):
    sketch, map_, order = sloppy(6, 6, 9)
    flat = learned(score=0.0)  # all maps that are weighed are alike
    told = judge(problem(sketch, map_, [order], alternatives=alternatives), flat)
    known = judge(problem(sketch, map_, [order], alternatives=10_000), flat)
    assert len(told.maps) == min(len(known.maps), alternatives + 1 + 20)
    steep = learned(score=1000.0)
    sure = judge(problem(sketch, map_, [order], alternatives=alternatives), steep)
    assert len(sure.maps) == min(len(known.maps), alternatives + 1)


def test_maps_of_a_symmetric_scene_are_equally_likely():
    box = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    square = Scene.from_polygons(
        [box, box + np.array((4, 0)), box + np.array((4, 4)), box + np.array((0, 4))]
    )
    other = seen_as(square, range(4), 0.3)
    rng = np.random.default_rng(0)
    posed = problem(
        square, other, [np.arange(4)], table=relations_of(square, other), alternatives=500
    )
    for numbers_ in (PLAIN, learned(rng, 0.1)):
        likely = {
            tuple(each.partners.tolist()): each.probability for each in judge(posed, numbers_).maps
        }
        turned = [likely[tuple(((k + np.arange(4)) % 4).tolist())] for k in range(4)]
        assert turned == pytest.approx([turned[0]] * 4, rel=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_every_map_obeys_pins(seed):
    sketch, map_, order = sloppy(seed, 5, 8)
    wrong = int(np.setdiff1d(np.arange(8), order)[0])
    allowed, pinned = np.ones((5, 8), dtype=bool), np.array([-1, wrong, -1, order[3], -1])
    for g in (1, 3):
        allowed[g], allowed[:, pinned[g]] = False, False
        allowed[g, pinned[g]] = True
    allowed[4] = False  # it is known to have no partner
    first = np.array([order[0], wrong, order[2], order[3], -1])
    posed = problem(sketch, map_, [first], allowed=allowed, pinned=pinned, alternatives=500)
    judgement = judge(posed)
    assert len(judgement.maps) > 1
    for each in judgement.maps:
        assert each.partners[1] == wrong
        assert each.partners[3] == order[3]
        assert each.partners[4] == -1
    assert_sound(judgement, posed)


def test_roles_of_template_and_argument_change_nothing():
    rng = np.random.default_rng(2)
    sketch, map_, order = sloppy(2, 5, 5)
    of_pairs = [rng.uniform(0.2, 0.9, (10, 10)) for _ in range(3)]
    inverse = np.argsort(order)
    names = rng.integers(-1, 2, (5, 5))
    numbers_ = learned(rng, 0.1)
    straight = judge(
        problem(
            sketch, map_, [order], table=RelationTable(*of_pairs, 5, 5), names=names, alternatives=9
        ),
        numbers_,
    )
    similarity, rotation, dilation = (each.T for each in of_pairs)
    turned = RelationTable(similarity, -rotation % (2.0 * np.pi), 1.0 / dilation, 5, 5)
    swapped = judge(
        problem(
            map_,
            sketch,
            [inverse],
            table=turned,
            names=names.T.copy(),
            alternatives=9,
            swapped=True,
        ),
        numbers_,
    )
    assert swapped.elsewhere == pytest.approx(straight.elsewhere, abs=1e-9)
    np.testing.assert_allclose(swapped.lines[:, :-1], straight.lines[:, :-1].T, atol=1e-9)
    assert [each.probability for each in swapped.maps] == pytest.approx(
        [each.probability for each in straight.maps], abs=1e-9
    )


def test_the_same_is_judged_the_same():
    posed, truth = judging_problem(np.random.default_rng(4), 6, missing=1, price=0.4)
    one, two = judge(posed), judge(posed)
    np.testing.assert_array_equal(one.lines, two.lines)
    np.testing.assert_array_equal(one.maps[0].partners, truth)
    assert one.elsewhere == two.elsewhere


def test_lines_are_described_by_what_is_measured_of_them():
    row = np.zeros((1, 2, len(Line)))
    row[0, 0] = 0.04, -0.5, 0.09, 0.7, 0.01, 0.2, 0.3, 0.4, 0.05, 0.02, 1.5, 0.6
    one = np.array([[True, False]])
    found = line_numbers(Measured(row, np.zeros((1, 8)), one), related=True)
    ln = math.log
    shape = ln(0.093), 0.7, ln(0.31), ln(0.41), ln(0.013), 0.2
    # Beside none the others deviate by nothing.
    beside = [ln(1.0 + 100.0 * each) for each in (0.05, 0.02, 0.25, 0.09, 0.3, 0.4, 0.01, 0.2)]
    alone = ln(0.053), ln(0.023), ln(1.51)
    form = ln(0.61), ln(61.0)
    np.testing.assert_allclose(
        found[0, 0], [1.0, ln(0.043), 0.2, ln(0.253), -0.5, *shape, *beside, *alone, *form]
    )
    np.testing.assert_array_equal(found[0, 1], np.zeros(OF_LINE))
    bare = line_numbers(Measured(row, np.zeros((1, 8)), np.array([[True, True]])), related=False)
    np.testing.assert_array_equal(bare[0, 0], found[0, 0, :OF_BARE])
    far = row.copy()
    far[0, 0, [Line.PLACE, Line.SIZE]] = 100.0, 7.0
    bounded = line_numbers(Measured(far, np.zeros((1, 8)), one), True)
    np.testing.assert_allclose(bounded[0, 0, [2, 4]], [3.0, 3.0])


def test_a_deviation_is_set_beside_those_of_the_other_lines():
    rows = np.zeros((2, 4, len(Line)))
    rows[:, :, Line.ALONE] = 0.99, 0.05, 0.13, 500.0
    rows[:, :, Line.SIZE] = -1.0, 0.3, -0.5, 0.0
    matched = np.array([[True, True, True, False], [True, True, True, True]])
    found = line_numbers(Measured(rows, np.zeros((2, 8)), matched), related=True)
    ln = math.log
    np.testing.assert_allclose(
        found[0, :, 11], [ln(1.0 / 0.1), ln(0.06 / 0.57), ln(0.14 / 0.53), 0.0]
    )
    np.testing.assert_allclose(
        found[0, :, 13], [ln(1.01 / 0.18), ln(0.1 / 0.635), ln(0.26 / 0.555), 0.0]
    )
    # One that is far out counts no more than nine among the others.
    assert found[1, 1, 11] == pytest.approx(ln(0.06 / (0.01 + (0.99 + 0.13 + 9.0) / 3.0)))
    assert found[1, 3, 11] == pytest.approx(ln(500.01 / (0.01 + (0.99 + 0.05 + 0.13) / 3.0)))


def test_maps_are_described_by_what_is_measured_of_them_and_by_shares():
    wholes = np.array([[-9.0, 4.0, 1.5, 2.0, 0.3, 0.7, 1.0, 2.0]])
    found = map_numbers(Measured(np.zeros((1, 5, 8)), wholes, np.ones((1, 5), bool)), 5)
    np.testing.assert_allclose(found, [[0.3, 0.7, 4.0, 1.5, 2.0, 0.8, 0.3, 0.4]])


def test_what_fits_best_at_first_sight_comes_first_labels_counting_two_each():
    wholes = np.zeros((4, len(Whole)))
    wholes[:, Whole.SCORE] = -5.0, -4.0, -6.5, -5.0
    wholes[2, Whole.ALIKE] = 1.0
    wholes[1, Whole.UNLIKE] = 1.0
    order = best_first(Measured(np.zeros((4, 2, 8)), wholes, np.ones((4, 2), bool)))
    np.testing.assert_array_equal(order, [2, 0, 3, 1])


def some_described(rng, maps=4, n=5, m=9, decoys=3, related=True):
    """Return maps and decoys with measures of any kind."""

    def measures(count):
        matched = rng.random((count, n)) < 0.8
        matched[:, :2] = True
        lines = abs(rng.normal(size=(count, n, len(Line)))) * matched[:, :, None]
        wholes = rng.normal(size=(count, len(Whole)))
        wholes[:, Whole.MATCHED] = matched.sum(axis=1)
        return Measured(lines, wholes, matched)

    known = measures(maps)
    found = np.array([rng.permutation(m)[:n] for _ in range(maps)])
    found[~known.matched] = -1
    return Described(found, known, tuple(measures(2) for _ in range(decoys)), n, m, related)


def bounded(number, middle, scale):
    return min(max((number - middle) / scale, -FARTHEST), FARTHEST)


@pytest.mark.parametrize("related", [True, False])
def test_a_map_is_worth_what_two_layers_make_of_its_lines(related):
    rng = np.random.default_rng(0)
    known, layers = some_described(rng), learned(rng, 0.5, score=0.7).layers(related)
    rows, wholes = line_numbers(known.measured, related), map_numbers(known.measured, 5)
    scene = [math.log(5), math.log(9), 0.2]
    scene = [bounded(*each) for each in zip(scene, *layers.of_scenes, strict=True)]
    expected = []
    for x, map_ in enumerate(wholes):
        summed = np.zeros(3)
        for i in range(5):
            row = np.zeros(OF_LINE if related else OF_BARE)
            if known.measured.matched[x, i]:
                row[:] = [bounded(*each) for each in zip(rows[x, i], *layers.of_lines, strict=True)]
                row[0] = 1.0
            summed += np.maximum(np.array([*row, *scene]) @ layers.first + layers.first_bias, 0.0)
        whole = [bounded(*each) for each in zip(map_, *layers.of_maps, strict=True)]
        among = np.array([*whole, *scene, *(LINES * summed)])
        second = np.maximum(among @ layers.second + layers.second_bias, 0.0)
        score = AT_FIRST * known.measured.wholes[x, Whole.SCORE]
        expected.append(second @ layers.last + whole @ layers.direct + 0.7 * score)
    np.testing.assert_allclose(worths(known, known.measured, layers, related), expected)


def test_the_order_of_objects_changes_no_worth():
    rng = np.random.default_rng(1)
    known, layers = some_described(rng), learned(rng, 0.5).maps
    order = rng.permutation(5)
    lines, wholes, matched = known.measured
    turned = Measured(lines[:, order], wholes, matched[:, order])
    np.testing.assert_allclose(
        worths(known, turned, layers, True), worths(known, known.measured, layers, True)
    )


def scored(*scores, n=4):
    """Return measures of maps that their scores alone tell apart."""
    wholes = np.zeros((len(scores), len(Whole)))
    wholes[:, Whole.SCORE] = scores
    wholes[:, Whole.MATCHED] = n
    matched = np.ones((len(scores), n), dtype=bool)
    return Measured(np.zeros((len(scores), n, len(Line))), wholes, matched)


def numbers_of_place(known, numbers_=PLAIN):
    values = worths(known, known.measured, numbers_.layers(known.related), known.related)
    return place_numbers(known, numbers_.bare, values)


def test_a_place_is_described_by_how_far_its_best_map_exceeds_chance_and_rivals():
    maps = np.array([[0, 1, 2, 3], [0, 1, 2, -1], [3, 2, 1, 0], [0, 3, 1, 2]])
    measured_ = scored(-1.0, -2.0, -8.0, -4.0)
    measured_.lines[0, :, Line.PLACE] = 0.01, 0.04, 0.0, 0.09
    measured_.wholes[0, [Whole.MISSING, Whole.CROWD]] = 1.0, 2.0
    measured_.wholes[0, [Whole.OFFSET, Whole.BEND]] = 0.3, 0.7
    decoys = scored(-7.0, -5.0), scored(-9.0), scored()
    known = Described(maps, measured_, decoys, 4, 10, True)
    found = numbers_of_place(known)
    assert found.shape == (PLACE,)
    np.testing.assert_allclose(found[:4], [math.log(4), math.log(10), 0.25, 1.0])
    # The second shares three lines with the best and is no rival; the fourth, with one, is.
    most, mean, lead, ahead = AT_FIRST * 4.0, AT_FIRST * 6.0, AT_FIRST * 3.0, 4.0
    by_object = np.array([most, mean, lead, ahead]) / 4.0
    np.testing.assert_allclose(found[4:12], np.column_stack([by_object, 4.0 * by_object]).ravel())
    np.testing.assert_allclose(found[12:18], [-0.25, 1.0, 0.25, 0.5, 0.3, 0.7])
    lines = line_numbers(measured_, True)[0, :, 1:]
    np.testing.assert_allclose(found[18:], [*lines.mean(axis=0), *lines.max(axis=0)])


def test_a_map_without_rivals_or_decoys_leads_by_far():
    known = Described(np.array([[0, 1, 2, 3], [0, 1, 2, -1]]), scored(-1.0, -2.0), (), 4, 10, True)
    found = numbers_of_place(known)
    assert found[5] == found[7] == found[11] == 30.0
    assert found[9] == pytest.approx(AT_FIRST * 1.0 + 4.0)


def test_differences_of_many_objects_count_as_those_of_sixteen():
    maps = np.arange(32)[None]
    known = Described(maps, scored(-1.0, n=32), (scored(-9.0, n=32),), 32, 40, True)
    found = numbers_of_place(known)
    assert found[5] == pytest.approx(16.0 * found[4])
    assert found[4] == pytest.approx(AT_FIRST * 8.0 / 32.0)


def test_a_place_is_told_by_a_layer_and_what_is_direct():
    rng = np.random.default_rng(2)
    known, numbers_ = some_described(rng), learned(rng, 0.4, constant=0.3)
    place = numbers_.place
    row = numbers_of_place(known, numbers_)
    row = np.array([bounded(*each) for each in zip(row, *place.of_places, strict=True)])
    hidden = np.maximum(row @ place.first + place.first_bias, 0.0)
    odds = hidden @ place.last + row @ place.direct + 0.3
    assert weighed(known, numbers_).elsewhere == pytest.approx(1.0 / (1.0 + math.exp(odds)))


def test_a_place_is_described_by_the_map_that_is_best_by_all_that_is_known():
    maps = np.array([[0, 1, 2, 3], [3, 2, 1, 0]])
    measured_ = scored(-5.0, -4.0)
    measured_.lines[1, :, Line.RELATION] = 1.0
    known = Described(maps, measured_, (scored(-9.0),), 4, 10, True)
    by_score = numbers_of_place(known)
    without = place_numbers(known, PLAIN.bare, np.array([2.0, 1.0]))
    lines = line_numbers(measured_, True)[:, :, 1:].mean(axis=1)
    np.testing.assert_allclose(by_score[18 : 18 + OF_LINE - 1], lines[1])
    np.testing.assert_allclose(without[18 : 18 + OF_LINE - 1], lines[0])
    # How far ahead of chance it is says the best without relations, whichever that is.
    np.testing.assert_allclose(without[4:8], by_score[4:8])
    assert without[9] == pytest.approx(1.0)


def test_the_last_of_very_many_maps_is_the_likeliest_where_it_is_worth_most():
    rng = np.random.default_rng(0)
    maps = np.array([rng.permutation(9)[:4] for _ in range(120)])
    found = weighed(Described(maps, scored(*[-9.0] * 119, -1.0), (), 4, 9, True), PLAIN)
    assert found.shares.argmax() == 119
    assert (found.shares > 0.0).all()
    assert found.shares.sum() == pytest.approx(1.0)


def test_labels_count_for_what_was_learned():
    known = Described(np.array([[0, 1], [1, 0]]), scored(-1.0, -1.0, n=2), (), 2, 2, True)
    known.measured.wholes[0, Whole.ALIKE] = 2.0
    known.measured.wholes[1, Whole.UNLIKE] = 1.0
    found = weighed(known, PLAIN._replace(labels=np.array([0.4, -0.5])))
    assert found.shares[0] / found.shares[1] == pytest.approx(math.exp(2 * 0.4 + 0.5))


def test_without_relations_lines_of_a_place_say_nothing_of_them():
    known = some_described(np.random.default_rng(4))
    unrelated = dataclasses.replace(known, related=False)
    with_, without = (numbers_of_place(each) for each in (known, unrelated))
    first, count = 18 + OF_BARE - 1, OF_LINE - OF_BARE
    apart = [3, *range(first, first + count), *range(PLACE - count, PLACE)]
    np.testing.assert_array_equal(np.delete(with_, apart), np.delete(without, apart))
    np.testing.assert_array_equal(without[apart], 0.0)
    assert (with_[apart] != 0.0).all()


@pytest.mark.parametrize("related", [True, False])
def test_what_was_learned_has_the_shapes_that_are_read(related):
    known = dataclasses.replace(some_described(np.random.default_rng(0)), related=related)
    found = weighed(known, POSTERIOR)
    assert found.shares.sum() == pytest.approx(1.0)
    assert 0.0 < found.lost < 1.0
    assert 0.0 < found.elsewhere < 1.0


def test_whether_the_right_map_is_known_follows_from_the_best_share_and_worth():
    known = Described(np.array([[0, 1, 2, 3]]), scored(-1.0), (), 4, 10, True)
    np.testing.assert_allclose(
        lost_numbers(known, np.array([0.2, 0.5, 0.3]), -6.0),
        [1.0, 4.0, math.log(10), math.log(0.5), 0.4, -1.5],
    )


def test_it_is_less_likely_to_be_known_the_less_the_best_is_worth():
    known = Described(np.array([[0, 1], [1, 0]]), scored(-3.0, -1.0, n=2), (), 2, 3, True)
    lost = np.array([0.1, 0.2, -0.3, 0.4, 0.5, 0.6])
    found = weighed(known, PLAIN._replace(lost=lost))
    numbers = [1.0, 2.0, math.log(3), math.log(found.shares.max()), 2 / 3, -AT_FIRST / 2]
    assert found.lost == pytest.approx(1.0 / (1.0 + math.exp(-lost @ numbers)))


def test_what_is_known_of_the_place_is_taken_as_it_is():
    known = Described(np.array([[0, 1]]), scored(-1.0, n=2), (), 2, 3, True)
    assert weighed(known, PLAIN, elsewhere=0.125).elsewhere == 0.125


def test_odds_are_bounded():
    assert _evidence._logistic(0.0) == 0.5
    assert _evidence._logistic(1e6) == _evidence._logistic(50.0) < 1.0 + 1e-12
    assert 0.0 < _evidence._logistic(-1e6) == _evidence._logistic(-50.0)
    assert _evidence._logistic(2.0) == pytest.approx(1.0 / (1.0 + math.exp(-2.0)))


def test_decoys_are_the_sketch_in_the_mirror_squeezed_and_with_its_things_elsewhere():
    rng = np.random.default_rng(0)
    places = rng.normal(size=8) + 1j * rng.normal(size=8)
    drawn = Things(
        places - places.mean(),
        np.arange(8.0),
        np.arange(8.0) * np.exp(0.3j),
        0.5,
    )
    mirrored, along, across, *shuffled = _described._decoys(drawn)
    np.testing.assert_array_equal(mirrored.places, drawn.places.conj())
    np.testing.assert_array_equal(mirrored.shapes, drawn.shapes.conj())
    np.testing.assert_array_equal(mirrored.sizes, drawn.sizes)
    axes = np.linalg.eigh(np.cov(mirrored.places.real, mirrored.places.imag))[1]
    for each, by in ((along, 1.35), (across, 1.0 / 1.35)):
        np.testing.assert_array_equal(each.shapes, mirrored.shapes)
        before, after = (
            np.column_stack([places.real, places.imag]) @ axes[:, ::-1]
            for places in (mirrored.places, each.places)
        )
        np.testing.assert_allclose(after, before * [math.sqrt(by), 1.0 / math.sqrt(by)])
    assert len(shuffled) == 3
    for each, of in zip(shuffled, (drawn, mirrored, drawn), strict=True):
        np.testing.assert_array_equal(each.places, of.places)
        order = each.sizes.astype(int)
        assert (order != np.arange(8)).all()
        np.testing.assert_array_equal(each.shapes, of.shapes[order])
        assert each.spacing == drawn.spacing
    assert not np.array_equal(shuffled[0].sizes, shuffled[2].sizes)


def test_what_is_the_sketch_again_is_no_decoy():
    x, y = np.meshgrid(np.arange(4.0), np.arange(3.0))
    places = (x + 1j * y).ravel()
    pillars = Things(places - places.mean(), np.zeros(12), np.zeros(12, complex), 1.0)
    assert not [*_described._decoys(pillars)]
    sizes = np.random.default_rng(0).normal(0.0, 1.5, 12)
    assert len([*_described._decoys(pillars._replace(sizes=sizes))]) == 6
    # One odd thing among many is left out, and the rest is the sketch again.
    assert not [*_described._decoys(pillars._replace(sizes=np.append(np.zeros(11), 3.0)))]


@pytest.mark.parametrize("count", [2, 3, 8])
def test_a_derangement_leaves_nothing_in_its_place(count):
    for seed in range(20):
        order = _described._derangement(np.random.default_rng(seed), count)
        assert sorted(order) == list(range(count))
        assert (order != np.arange(count)).all()


def test_maps_are_described_once_each_with_those_that_were_met(monkeypatch):
    sketch, map_, order = sloppy(1, 4, 6)
    table = random_table(np.random.default_rng(0), 4, 6)
    sides = sides_of((sketch, map_), False, None, None, None)
    met = [order, np.roll(order, 1), order.copy()]
    with monkeypatch.context() as patch:
        patch.setattr(_described, "known_maps", nothing_is_laid)
        known = described((sketch, map_), sides, table, None, met)
    np.testing.assert_array_equal(known.maps, [order, np.roll(order, 1)])
    assert (known.drawn, known.mapped) == (4, 6)
    expected = aligning.whole(order, sides.drawn, sides.mapped, TOLERANCES)
    assert known.measured.wholes[0, Whole.SCORE] == pytest.approx(expected["score"], abs=1e-6)
    lines = aligning.lines(order, sides.drawn, sides.mapped, TOLERANCES)
    assert known.measured.lines[0, 2, Line.PLACE] == pytest.approx(lines[2]["place"], abs=1e-6)
    assert known.measured.lines[0, 2, Line.RELATION] == pytest.approx(
        aligning.related(order, table)[2]
    )
    assert len(known.decoys) == 6
    explored = described((sketch, map_), sides, table, None, met)
    assert len(explored.maps) > 2
    assert len({each.tobytes() for each in explored.maps}) == len(explored.maps)
    complete = described((sketch, map_), sides, table, None, met, partial=False)
    assert (complete.maps >= 0).all()


@pytest.fixture
def weighing(monkeypatch):
    """Return a list of what is weighed; each takes a second of a clock that stands still else."""
    done = []
    monkeypatch.setattr(module.time, "monotonic", lambda: float(len(done)))

    def counted(name):
        work = getattr(_described, name)

        def timed(*arguments, **options):
            found = work(*arguments, **options)
            done.append(name)
            return found

        monkeypatch.setattr(_described, name, timed)

    counted("known_maps")
    counted("_measured_decoy")
    return done


@pytest.mark.parametrize(("seconds", "decoys"), [(0.0, 1), (1.5, 1), (2.5, 2), (4.0, 3), (99.0, 6)])
def test_once_time_is_over_no_more_decoys_are_weighed(weighing, seconds, decoys):
    posed, truth = judging_problem(np.random.default_rng(1), objects=7)
    judged = Posterior().judge(dataclasses.replace(posed, time_budget=seconds))
    assert weighing == ["known_maps"] + decoys * ["_measured_decoy"]
    assert judged.maps[0].partners.tolist() == truth.tolist()
    assert_sound(judged, posed)


def test_a_judgement_in_time_is_that_of_who_has_all_the_time(weighing):
    posed, _ = judging_problem(np.random.default_rng(1), objects=7, missing=1)
    free = Posterior().judge(posed)
    timed = Posterior().judge(dataclasses.replace(posed, time_budget=len(weighing) + 1.0))
    assert weighing[:7] == weighing[7:]
    assert len(weighing) == 14
    assert (timed.elsewhere, timed.lines.tobytes()) == (free.elsewhere, free.lines.tobytes())
    for a, b in zip(timed.maps, free.maps, strict=True):
        assert (a.partners.tolist(), a.probability) == (b.partners.tolist(), b.probability)


def test_of_decoys_nothing_but_places_sizes_and_shapes_is_measured():
    sketch, map_, _ = sloppy(1, 5, 7)
    sides = sides_of((sketch, map_), False, None, None, None)
    found = _described._measured_decoy(sides.drawn, sides.mapped)
    assert (found.lines[:, :, [Line.SELF, Line.RELATION]] == 0.0).all()
    assert found.wholes[0, Whole.MATCHED] >= 2.0
    assert (np.diff(found.wholes[:, Whole.SCORE]) < 1.0).all()  # about as they were laid


def test_a_sketch_of_this_place_exceeds_what_its_decoys_achieve():
    leads = []
    for elsewhere in (False, True):
        sketch, map_, _ = sloppy(11, 6, 9)
        if elsewhere:
            map_ = strewn(np.random.default_rng(77), 9)
        sides = sides_of((sketch, map_), False, None, None, None)
        table = random_table(np.random.default_rng(0), 6, 9)
        known = described((sketch, map_), sides, table, None, [np.arange(6)])
        leads.append(numbers_of_place(known)[5])
    assert leads[0] > leads[1] + 3.0 * AT_FIRST


def test_a_quick_judgement_follows_from_the_candidates_alone():
    sketch, map_, order = sloppy(1, 5, 7)
    other = np.array([order[1], order[0], *order[2:]])
    posed = problem(sketch, map_, [order, other], elsewhere=0.2)
    before = judge(posed)
    near_maps(sides_of((sketch, map_), False, None, None, None), [order])
    for judgement in (before, judge(posed)):
        assert_sound(judgement, posed)
        assert [each.partners.tolist() for each in judgement.maps] == [
            order.tolist(),
            other.tolist(),
        ]
        assert judgement.elsewhere == 0.2


def test_objects_in_one_place_are_judged_all_the_same():
    frame = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.0, 3.0]])
    hole = np.array([[1.0, 1.0], [1.0, 2.0], [2.0, 2.0], [2.0, 1.0]])
    scene = Scene(
        (
            SceneObject.from_rings([frame, hole]),
            SceneObject.from_rings([0.5 * hole + 0.75]),
        )
    )
    posed = problem(scene, scene, [[0, 1], [1, 0]])
    judgement = judge(posed, learned(np.random.default_rng(0), 0.1))
    assert_sound(judgement, posed)


def test_a_right_map_is_found_that_hundreds_seem_to_fit_better_than():
    """Two of eight things are invented, and others of sixty lie about where they are drawn."""
    drawn = sample("plain", 7037, objects=60, missing=2, extra=2)
    sides = sides_of((drawn.scene, drawn.map), False, None, None, None)
    at_first = [each.partners.tolist() for each in known_maps(sides)]
    assert at_first.index(drawn.truth.tolist()) > 300
    found = match(drawn.scene, drawn.map)
    assert found.object_map == {k: int(j) for k, j in enumerate(drawn.truth) if j >= 0}
    assert found.probability > 0.5


def test_it_is_the_default_and_finds_partial_maps():
    assert Posterior.default
    assert Posterior().partial
