"""The judge ``posterior``: what it makes of candidates, whatever was learned."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.api import Candidate, JudgeProblem
from sketchmatch.model import Confidence, RelationTable, Scene, SceneObject
from sketchmatch.testing import judging_problem
from sketchmatch_builtin.alignment import PARTS, Part, Things, sides_of
from sketchmatch_builtin.alignment._poses import TOLERANCES
from sketchmatch_builtin.judges import _described, _evidence
from sketchmatch_builtin.judges import posterior as module
from sketchmatch_builtin.judges._described import described
from sketchmatch_builtin.judges._evidence import (
    FIRST,
    NUMBERS,
    Described,
    detailed,
    lost_numbers,
    numbers,
    place_numbers,
    skill,
    weighed,
)
from sketchmatch_builtin.judges.calibration import Posterior as Learned
from sketchmatch_builtin.judges.posterior import Posterior
from tests.interpreted import examples
from tests.oracle import aligning
from tests.plugins.test_align import seen_as, sloppy, strewn
from tests.searching import relations_of
from tests.strategies import random_table

BY_SKILL = len(NUMBERS) - 5
PLACE, LOST = 13 + 4 * 4, 5


def learned(rng=None, scale=0.3, **given):
    """Return numbers that might have been learned."""
    shapes = {
        "first": len(FIRST),
        "weights": len(NUMBERS) + 3 * BY_SKILL,
        "place": PLACE,
        "lost": LOST,
    }
    numbers_ = {
        name: np.zeros(count) if rng is None else rng.normal(0.0, scale, count)
        for name, count in shapes.items()
    }
    return Learned(
        **{name: tuple((given.get(name, each)).tolist()) for name, each in numbers_.items()},
        luck=given.get("luck", 0.4),
    )


def of_number(**values):
    """Return weights of numbers by name, 0 for all others."""
    weights = np.zeros(len(NUMBERS) + 3 * BY_SKILL)
    for name, value in values.items():
        weights[NUMBERS.index(name)] = value
    return weights


GOOD = {"place": -2.0, "size": -1.0, "shape": -1.0, "matched": 3.0}
PLAIN = learned(
    first=of_number(**GOOD)[: len(NUMBERS)][FIRST],
    weights=of_number(**GOOD),
    place=np.eye(PLACE)[0] * 2.0,
    lost=np.eye(LOST)[0] * -2.0,
)


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
    scores = known.numbers @ np.array(PLAIN.weights)[: len(NUMBERS)]
    shares = np.exp(scores) / np.exp(scores).sum()
    np.testing.assert_allclose(found.shares, shares, atol=1e-12)


def test_on_unusual_relations_it_ranks_and_names_no_probability():
    sketch, map_, order = sloppy(3, 4, 6)
    posed = problem(sketch, map_, [order[::-1], order], usual=False, alternatives=2)
    judgement = judge(posed)
    np.testing.assert_array_equal(judgement.maps[0].partners, order)
    assert len(judgement.maps) == 3
    assert {each.probability for each in judgement.maps} == {None}
    assert judgement.lines is None
    assert judgement.elsewhere is None


def test_it_looks_for_maps_itself():
    sketch, map_, order = sloppy(5, 5, 8)
    wrong = np.roll(order, 1)
    looked = judge(problem(sketch, map_, [wrong], alternatives=9))
    np.testing.assert_array_equal(looked.maps[0].partners, order)
    assert len(looked.maps) >= 10


@pytest.mark.parametrize("alternatives", [0, 3, 500])
def test_as_many_maps_are_told_as_are_wanted_and_some_that_are_likely(alternatives):
    sketch, map_, order = sloppy(6, 6, 9)
    flat = learned(place=np.eye(PLACE)[0], lost=-np.eye(LOST)[0])  # all maps alike
    told = judge(problem(sketch, map_, [order], alternatives=alternatives), flat)
    known = judge(problem(sketch, map_, [order], alternatives=10_000), flat)
    assert len(told.maps) == min(len(known.maps), alternatives + 1 + 20)
    steep = dataclasses.replace(PLAIN, weights=tuple(100.0 * np.array(PLAIN.weights)))
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


def test_numbers_of_a_map_are_its_parts_and_its_share():
    parts = np.arange(2.0 * len(PARTS)).reshape(2, -1)
    parts[:, Part.MATCHED] = 3.0, 4.0
    found = numbers(parts, 5, 20)
    np.testing.assert_array_equal(found[:, : len(PARTS)], parts)
    np.testing.assert_allclose(
        found[:, NUMBERS.index("matched_among_many")], [3.0 * math.log(20), 4.0 * math.log(20)]
    )
    np.testing.assert_allclose(found[:, NUMBERS.index("matched_share")], [9.0 / 5.0, 16.0 / 5.0])
    assert found.shape[1] == len(NUMBERS)


def test_what_relations_and_labels_tell_is_not_among_the_first():
    first = {NUMBERS[k] for k in FIRST}
    apart = {"similarity", "rotation", "dilation", "self", "alike", "unlike"}
    assert set(NUMBERS) - first == apart


def test_a_skill_is_by_how_much_the_lines_scatter():
    best = np.zeros(len(NUMBERS))
    best[[Part.MATCHED, Part.SCATTER, Part.SCATTER_SIZE, Part.SCATTER_SHAPE]] = 4, -8, -6, -4
    np.testing.assert_allclose(skill(best), [-0.4, -0.3, 0.8])
    np.testing.assert_allclose(skill(np.zeros(len(NUMBERS))), [1.6, 1.2, 1.8])


def test_details_are_most_numbers_times_each_number_of_a_skill():
    rng = np.random.default_rng(0)
    rows, drawing = rng.normal(size=(3, len(NUMBERS))), np.array([2.0, -1.0, 0.5])
    found = detailed(rows, drawing)
    apart = [NUMBERS.index(each) for each in ("offset", "bend", "alike", "unlike")]
    apart.append(NUMBERS.index("matched_among_many"))
    kept = np.delete(rows, apart, axis=1)
    np.testing.assert_allclose(found, np.hstack([rows, 2.0 * kept, -kept, 0.5 * kept]))


def known_of(maps, rows, decoys, drawn, mapped):
    return Described(np.array(maps), np.array(rows), tuple(decoys), drawn, mapped)


def rows_of(*values):
    """Return rows of numbers that places alone tell apart."""
    rows = np.zeros((len(values), len(NUMBERS)))
    rows[:, 0] = values
    rows[:, Part.MATCHED] = 4.0
    return rows


def test_a_place_is_described_by_how_far_its_best_map_exceeds_chance_and_rivals():
    first = np.zeros(len(FIRST))
    first[0] = 1.0
    maps = [[0, 1, 2, 3], [0, 1, 2, -1], [3, 2, 1, 0], [0, 3, 1, 2]]
    decoys = [rows_of(1.0, 2.0), rows_of(-1.0), rows_of(), rows_of(0.5, 0.0)]
    known = known_of(maps, rows_of(5.0, 4.5, 1.0, 3.0), decoys, 4, 10)
    found = place_numbers(known, first)
    many = math.log(10)
    # The second shares three lines with the best and is no rival; the fourth, with one, is.
    most, mean, lead = 5.0 - 2.0, 5.0 - (2.0 - 1.0 - 30.0 + 0.5) / 4.0, 5.0 - 3.0
    above = [math.log1p(math.exp(each)) for each in (most, lead)]
    assert mean == pytest.approx(12.125)
    np.testing.assert_allclose(
        found[:13],
        [1, 4, many, 4 * many, 0.25, 5.0, 1.25, most, mean, above[0], lead, above[1], lead],
    )
    drawing = np.array([1.6, 1.2, 1.8, 1.0])
    np.testing.assert_allclose(
        found[13:], np.concatenate([drawing, most * drawing, 4 * drawing, many * drawing])
    )
    assert len(found) == PLACE


def test_a_map_without_rivals_leads_by_more_than_the_worst_map_lacks():
    first = np.zeros(len(FIRST))
    first[0] = 1.0
    known = known_of([[0, 1, 2, 3], [0, 1, 2, -1]], rows_of(5.0, 4.0), [rows_of(-100.0)], 4, 10)
    found = place_numbers(known, first)
    assert found[10] == pytest.approx(5.0 - (4.0 - 4.0))
    assert found[7] == pytest.approx(35.0)  # chance achieves −30 at least
    assert found[9] == pytest.approx(20.0, abs=1e-6)


def test_whether_the_right_map_is_known_follows_from_the_best_share():
    np.testing.assert_allclose(
        lost_numbers(np.array([0.2, 0.5, 0.3]), 4, 10),
        [1.0, 4.0, math.log(10), math.log(0.5), 0.4],
    )


def test_odds_are_bounded():
    assert _evidence._logistic(0.0) == 0.5
    assert _evidence._logistic(1e6) == _evidence._logistic(50.0) < 1.0 + 1e-12
    assert 0.0 < _evidence._logistic(-1e6) == _evidence._logistic(-50.0)
    assert _evidence._logistic(2.0) == pytest.approx(1.0 / (1.0 + math.exp(-2.0)))


def test_decoys_are_the_sketch_in_the_mirror_and_with_its_things_elsewhere():
    rng = np.random.default_rng(0)
    drawn = Things(
        rng.normal(size=8) + 1j * rng.normal(size=8),
        np.arange(8.0),
        np.arange(8.0) * np.exp(0.3j),
        0.5,
    )
    decoys = list(_described._decoys(drawn))
    assert len(decoys) == 4
    mirrored, *shuffled = decoys
    np.testing.assert_array_equal(mirrored.places, drawn.places.conj())
    np.testing.assert_array_equal(mirrored.shapes, drawn.shapes.conj())
    np.testing.assert_array_equal(mirrored.sizes, drawn.sizes)
    for each, of in zip(shuffled, (drawn, mirrored, drawn), strict=True):
        np.testing.assert_array_equal(each.places, of.places)
        order = each.sizes.astype(int)
        assert (order != np.arange(8)).all()
        np.testing.assert_array_equal(each.shapes, of.shapes[order])
        assert each.spacing == drawn.spacing
    assert not np.array_equal(shuffled[0].sizes, shuffled[2].sizes)


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
    assert known.numbers.shape == (2, len(NUMBERS))
    expected = aligning.parts(order, sides.drawn, sides.mapped, TOLERANCES)
    assert known.numbers[0, Part.PLACE] == pytest.approx(expected["place"], abs=1e-6)
    assert known.numbers[0, Part.SIMILARITY] == pytest.approx(
        aligning.related(order, table)["similarity"]
    )
    assert len(known.decoys) == 4
    explored = described((sketch, map_), sides, table, None, met)
    assert len(explored.maps) > 2
    assert len({each.tobytes() for each in explored.maps}) == len(explored.maps)
    complete = described((sketch, map_), sides, table, None, met, partial=False)
    assert (complete.maps >= 0).all()


def test_decoys_are_judged_by_places_sizes_and_shapes_alone():
    sketch, map_, _ = sloppy(1, 5, 7)
    sides = sides_of((sketch, map_), False, None, None, None)
    rows = _described._decoy_numbers(sides.drawn, sides.mapped)
    right = rows[rows[:, Part.PLACE].argmin()]
    assert rows.shape[1] == len(NUMBERS)
    assert (rows[:, Part.SELF] == 0.0).all()
    assert (rows[:, Part.SIMILARITY] == 0.0).all()
    assert right[Part.MATCHED] >= 2.0


def test_a_sketch_of_this_place_exceeds_what_its_decoys_achieve():
    first = np.array(PLAIN.first)
    leads = []
    for elsewhere in (False, True):
        sketch, map_, _ = sloppy(11, 6, 9)
        if elsewhere:
            map_ = strewn(np.random.default_rng(77), 9)
        sides = sides_of((sketch, map_), False, None, None, None)
        table = random_table(np.random.default_rng(0), 6, 9)
        known = described((sketch, map_), sides, table, None, [np.arange(6)])
        leads.append(place_numbers(known, first)[7])
    assert leads[0] > leads[1] + 3.0


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


def test_it_is_the_default_and_finds_partial_maps():
    assert Posterior.default
    assert Posterior().partial
