"""Which maps a sketch leaves open, and which question decides best between them."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sketchmatch import Scene, match
from sketchmatch.api import Judge, JudgedMap, Judgement, Params
from sketchmatch.pipeline.ambiguity import ambiguity, information_gains
from sketchmatch.pipeline.match import run_match
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch.pipeline.result import Ambiguity
from sketchmatch.pipeline.said import said
from sketchmatch.pipeline.selection import Choice
from sketchmatch.registry import Kind, Registered, Registry, default_registry
from sketchmatch.testing import random_scene
from tests.oracle.ambiguity import contradict, expected_reduction, sharing


def found(maps, probabilities, map_objects=None, shown=100):
    rows = np.array(maps)
    return ambiguity(rows, probabilities, map_objects or int(rows.max()) + 1, shown)


def as_dicts(maps):
    return [{i: j for i, j in enumerate(row) if j >= 0} for row in np.asarray(maps).tolist()]


# Which maps share the probability ---------------------------------------------------------------

STRAIGHT, EXCHANGED = [0, 1, 2], [2, 1, 0]


def test_a_map_half_as_likely_as_the_best_is_about_as_likely_and_one_below_is_not():
    assert found([STRAIGHT, EXCHANGED], [0.6, 0.3]) == Ambiguity(2, (0,), (0, 2))
    assert found([STRAIGHT, EXCHANGED], [0.6, 0.2999]) is None


def test_one_map_alone_is_not_ambiguous():
    assert found([STRAIGHT], [0.3]) is None


def test_maps_that_cannot_be_right_are_not_ambiguous():
    assert found([STRAIGHT, EXCHANGED], [0.0, 0.0]) is None
    impossible = [1, 2, 0]
    assert found([STRAIGHT, EXCHANGED, impossible], [0.5, 0.4, 0.0]).maps == 2


@pytest.mark.parametrize(
    "other", [[0, 1, -1], [-1, -1, -1], [-1, 1, -1]], ids=["one", "all", "two"]
)
def test_a_map_that_only_leaves_lines_out_says_the_same(other):
    assert found([STRAIGHT, other], [0.4, 0.4], 3) is None
    assert found([other, STRAIGHT], [0.4, 0.4], 3) is None


def test_maps_of_different_objects_that_fit_together_say_the_same():
    assert found([[0, -1], [-1, 1]], [0.4, 0.4], 2) is None


def test_two_objects_that_may_both_be_one_mapped_object_are_ambiguous():
    for maps in ([[0, 1, -1], [0, -1, 1]], [[1, 0, -1], [1, -1, 0]]):
        assert found(maps, [0.4, 0.4], 2) == Ambiguity(2, (0,), (1, 2))


def test_what_says_the_same_as_a_likelier_one_is_not_counted():
    maps = [STRAIGHT, [0, 1, -1], EXCHANGED, [2, -1, 0]]
    assert found(maps, [0.25, 0.22, 0.2, 0.19]) == Ambiguity(2, (1,), (0, 2))


def test_maps_beyond_the_alternatives_count_but_are_not_pointed_to():
    maps = [[0, 1, 2], [1, 2, 0], [2, 0, 1]]
    assert found(maps, [0.3, 0.3, 0.3], shown=1) == Ambiguity(3, (0,), (0, 1, 2))
    assert found(maps, [0.3, 0.3, 0.3], shown=0) == Ambiguity(3, (), (0, 1, 2))


# What to ask ------------------------------------------------------------------------------------


def test_the_object_whose_partner_decides_most_comes_first():
    # Object 0 tells the first map from the others, 1 all three apart, 2 nothing.
    maps = [[0, 1, 9], [3, 4, 9], [3, 5, 9]]
    assert information_gains(np.array(maps), np.array([0.5, 0.25, 0.25])) == pytest.approx(
        [math.log(2), 1.5 * math.log(2), 0.0], abs=1e-12
    )
    assert found(maps, [0.4, 0.3, 0.2]).deciding_sketch_objects == (1, 0)


def test_that_an_object_has_no_partner_is_an_answer_too():
    maps = [[0, 1, 2], [1, 0, 2], [1, 0, -1], [-1, 1, 0]]
    gains = information_gains(np.array(maps), np.ones(4))
    assert gains == pytest.approx([1.5 * math.log(2), math.log(2), 1.5 * math.log(2)])


def squares(turns):
    """Return what becomes of nine pillars, three by three, where the page is turned or flipped."""
    grid = np.arange(9).reshape(3, 3)
    return [turn(grid).ravel().tolist() for turn in turns]


ROTATIONS = [lambda grid, k=k: np.rot90(grid, k) for k in range(4)]
REFLECTIONS = [lambda grid, k=k: np.rot90(grid.T, k) for k in range(4)]
CENTRE, CORNER, EDGE = 4, 0, 1


@pytest.mark.parametrize("turns", [ROTATIONS, ROTATIONS + REFLECTIONS], ids=["turned", "flipped"])
def test_of_nine_pillars_the_one_in_the_middle_decides_nothing(turns):
    maps = squares(turns)
    probabilities = [1.0 / len(maps)] * len(maps)
    result = found(maps, probabilities, 9)
    assert result.maps == len(maps)
    assert result.alternatives == tuple(range(len(maps) - 1))
    assert result.deciding_sketch_objects == (0, 1, 2, 3, 5, 6, 7, 8)
    gains = information_gains(np.array(maps), np.array(probabilities))
    assert gains[CENTRE] == 0.0
    assert gains[CORNER] == pytest.approx(math.log(4))
    assert gains[EDGE] == pytest.approx(math.log(4))


def test_in_a_room_that_is_its_own_half_turn_any_object_but_the_middle_one_decides():
    assert found([[0, 1, 2, 3, 4], [4, 3, 2, 1, 0]], [0.5, 0.49]) == Ambiguity(
        2, (0,), (0, 1, 3, 4)
    )


def test_objects_that_decide_alike_but_for_rounding_stand_in_the_order_of_the_sketch():
    maps = [[0, 3, 6], [1, 4, 6], [2, 5, 8]]
    shares = [0.1 + 0.2, 0.3, 0.3 - 2e-12]
    maps[1][0], maps[2][0] = 0, 1
    maps[1][1], maps[2][1] = 4, 4
    gains = information_gains(np.array(maps), np.array(shares))
    assert gains[0] != gains[1]
    assert gains[0] == pytest.approx(gains[1], abs=1e-9)
    assert found(maps, shares).deciding_sketch_objects == (0, 1, 2)


# Against an obvious oracle ----------------------------------------------------------------------


@st.composite
def judged(draw, most=6):
    """Return different maps of some sketched to some mapped objects, and their probabilities."""
    sketched, mapped = draw(st.integers(1, 4)), draw(st.integers(1, 4))
    whole = st.permutations([*range(mapped), *[-1] * sketched]).map(lambda row: row[:sketched])
    maps = draw(st.lists(whole, min_size=1, max_size=most, unique_by=tuple))
    odds = draw(st.lists(st.integers(1, 9), min_size=len(maps) + 1, max_size=len(maps) + 1))
    probabilities = sorted((each / sum(odds) for each in odds[:-1]), reverse=True)
    return maps, probabilities, mapped


@given(judged(), st.integers(0, 6))
def test_ambiguity_is_that_of_loops(case, shown):
    maps, probabilities, mapped = case
    result = found(maps, probabilities, mapped, shown)
    chosen = sharing(as_dicts(maps), probabilities)
    if len(chosen) < 2:
        assert result is None
        return
    assert result.maps == len(chosen)
    assert result.alternatives == tuple(k - 1 for k in chosen if 1 <= k <= shown)
    dicts = [as_dicts(maps)[k] for k in chosen]
    shares = [probabilities[k] for k in chosen]
    gains = [expected_reduction(dicts, shares, i) for i in range(len(maps[0]))]
    deciding = result.deciding_sketch_objects
    assert set(deciding) == {i for i, gain in enumerate(gains) if gain > 1e-12}
    assert [gains[i] for i in deciding] == pytest.approx(
        sorted((gain for gain in gains if gain > 1e-12), reverse=True), abs=1e-8
    )
    assert information_gains(np.array(maps)[chosen], np.array(shares)) == pytest.approx(
        gains, abs=1e-12
    )


@given(judged())
def test_maps_that_share_contradict_each_other_and_none_is_likelier_than_two_thirds(case):
    maps, probabilities, mapped = case
    result = found(maps, probabilities, mapped)
    if result is None:
        return
    assert probabilities[0] <= 2 / 3
    dicts = as_dicts(maps)
    among = [dicts[0], *(dicts[k + 1] for k in result.alternatives)]
    assert len(among) == result.maps
    assert all(contradict(a, b) for a, b in itertools.combinations(among, 2))


# What a judgement says, from sketch to map ------------------------------------------------------


def judgement_of(maps, probabilities, mapped, swapped):
    """Return what an ideal judge says of maps, and of another place with what is left."""
    sketched = len(maps[0])
    lines = np.zeros((sketched, mapped + 1))
    for row, probability in zip(maps, probabilities, strict=True):
        lines[range(sketched), row] += probability
    elsewhere = 1.0 - sum(probabilities)
    lines[:, -1] += elsewhere
    if swapped:
        turned = lines[:, :-1].T
        lines = np.column_stack([turned, 1.0 - turned.sum(axis=1)])
        maps = [[row.index(j) if j in row else -1 for j in range(mapped)] for row in maps]
    read = tuple(JudgedMap(row, each) for row, each in zip(maps, probabilities, strict=True))
    return Judgement(read, lines, elsewhere)


@given(judged(), st.booleans(), st.integers(0, 6))
def test_a_judgement_says_the_same_whichever_scene_was_the_template(case, swapped, shown):
    maps, probabilities, mapped = case
    sketched, best = len(maps[0]), maps[0]
    read = said(judgement_of(*case, swapped), sketched, mapped, swapped, shown)
    place = sum(probabilities)
    assert read.of_map == probabilities[0]
    assert read.of_place == pytest.approx(place, abs=1e-12)
    assert read.of_alternatives == tuple(probabilities[1 : shown + 1])
    if abs(place - 0.5) > 1e-9:
        here = found(maps, probabilities, mapped, shown) if place > 0.5 else None
        assert read.ambiguity == here
    expected = [
        sum(p for row, p in zip(maps, probabilities, strict=True) if row[i] == best[i])
        + (1.0 - place if best[i] < 0 else 0.0)
        for i in range(sketched)
    ]
    assert read.of_objects.tolist() == pytest.approx(expected, abs=1e-12)
    unmatched = [expected[i] for i in range(sketched) if best[i] < 0]
    assert read.of_unmatched == pytest.approx(unmatched, abs=1e-12)


@given(judged(), st.booleans())
def test_the_probabilities_of_one_judgement_fit_each_other(case, swapped):
    maps, _, mapped = case
    read = said(judgement_of(*case, swapped), len(maps[0]), mapped, swapped, shown=3)
    assume(max(maps[0]) >= 0)  # a map without lines is right on other places, too
    assert 1.0 - (1.0 - read.of_objects).sum() - 1e-12 <= read.of_map <= read.of_place + 1e-12
    assert (read.of_map <= read.of_objects + 1e-12).all()
    assert 0.0 <= read.of_objects.min() <= read.of_objects.max() <= 1.0 + 1e-12


def test_what_a_judge_does_not_know_is_not_said():
    read = said(Judgement((JudgedMap([0, 1]), JudgedMap([1, 0]))), 2, 2, False, 1)
    assert (read.of_map, read.of_place, read.of_objects, read.ambiguity) == (None,) * 4
    assert read.of_alternatives == (None,)
    assert read.of_unmatched == ()


def test_no_probability_is_below_0_for_a_sum_that_is_above_1():
    maps = (JudgedMap([0, 1], 0.5),)
    read = said(Judgement(maps, [[0.6, 0.0, 0.4, 0.0], [0.1, 0.9, 0.7, 0.0]]), 3, 2, True, 0)
    assert read.of_unmatched == (0.0,)


def test_where_it_is_probably_another_place_there_is_nothing_to_ask():
    maps = (JudgedMap([0, 1], 0.2), JudgedMap([1, 0], 0.2))
    assert said(Judgement(maps, elsewhere=0.6), 2, 2, False, 1).ambiguity is None
    assert said(Judgement(maps, elsewhere=0.4), 2, 2, False, 1).ambiguity.maps == 2
    assert said(Judgement(maps), 2, 2, False, 1).ambiguity.maps == 2


# Through the engine -----------------------------------------------------------------------------


def pillars(columns, rows):
    return Scene.from_polygons(
        [
            [[4 * x, 4 * y], [4 * x + 1, 4 * y], [4 * x + 1, 4 * y + 1], [4 * x, 4 * y + 1]]
            for y in range(rows)
            for x in range(columns)
        ]
    )


def test_nine_pillars_fit_in_four_ways_and_the_result_says_so():
    result = match(pillars(3, 3), pillars(3, 3), profile="thesis")
    assert result.ambiguity == Ambiguity(4, (0, 1, 2), (0, 1, 2, 3, 5, 6, 7, 8))
    likely = [result.probability, *(each.probability for each in result.alternatives)]
    assert likely == pytest.approx([0.25] * 4, abs=0.02)
    assert result.unmatched_sketch_probabilities == ()
    assert [line.probability > 0.9 for line in result.matches] == [k == CENTRE for k in range(9)]


@pytest.mark.parametrize("shown", [0, 1])
def test_how_many_alternatives_are_asked_for_does_not_make_the_answer_likelier(shown):
    result = match(pillars(3, 3), pillars(3, 3), alternatives=shown, profile="thesis")
    assert len(result.alternatives) == shown
    assert result.probability == pytest.approx(0.25, abs=0.02)
    assert result.ambiguity == Ambiguity(4, tuple(range(shown)), (0, 1, 2, 3, 5, 6, 7, 8))


def test_by_default_a_row_of_pillars_fits_forwards_and_backwards():
    result = match(pillars(5, 1), pillars(5, 1))
    assert result.ambiguity == Ambiguity(2, (0,), (0, 1, 3, 4))
    assert result.alternatives[0].probability == pytest.approx(result.probability, rel=1e-3)
    centre = result.matches[2].probability
    assert centre > 1.8 * result.probability
    assert result.place_probability >= centre - 1e-9


def test_a_room_in_which_every_thing_differs_is_not_ambiguous():
    scene = random_scene(np.random.default_rng(3), 6)
    result = match(scene, scene)
    assert result.ambiguity is None
    assert result.probability > 0.9


def test_what_a_sketch_shows_beyond_the_map_has_no_partner_with_a_probability():
    scene = random_scene(np.random.default_rng(5), 7)
    fewer = Scene(scene.objects[:3] + scene.objects[4:])
    result = match(scene, fewer)
    assert result.unmatched_sketch_objects == (3,)
    (alone,) = result.unmatched_sketch_probabilities
    assert 0.5 < result.probability <= alone <= 1.0


class Wary(Judge):
    """Says the same of any four objects: how likely each map is, and that it is another place."""

    name = "wary"
    summary = "Is never sure."

    class Params(Params):
        elsewhere: float = 0.1

    def judge(self, problem):
        maps = ([0, 1, -1, 3], [1, 0, -1, 3], [0, 2, 1, 3], [1, 2, 0, 3])
        here = 1.0 - self.params.elsewhere
        shares = [here * share for share in (0.4, 0.3, 0.21, 0.09)]
        return judgement_of(maps, shares, 4, problem.swapped)


def wary(sketch, map_, elsewhere, shown=2):
    given = Registered(Kind.JUDGE, Wary, "acme", "1.0")
    registry = Registry([*default_registry().algorithms, given])
    selection = {"judge": Choice("wary", {"elsewhere": elsewhere})}
    request = MatchRequest(
        sketch, map_, selection, seed=1, allow_unmatched=True, alternatives=shown
    )
    *_, last = run_match(request, registry)
    return last.result


@pytest.mark.parametrize("shown", [1, 3])
def test_a_result_has_all_that_the_judge_says(shown):
    scene = random_scene(np.random.default_rng(8), 4)
    result = wary(scene, scene, 0.1, shown)
    assert result.object_map == {0: 0, 1: 1, 3: 3}
    assert result.probability == pytest.approx(0.36)
    assert result.place_probability == pytest.approx(0.9)
    assert [line.probability for line in result.matches] == pytest.approx([0.549, 0.36, 0.9])
    assert result.unmatched_sketch_objects == (2,)
    assert result.unmatched_sketch_probabilities == pytest.approx([0.73])
    assert [each.object_map for each in result.alternatives] == [
        *({0: 1, 1: 0, 3: 3}, {0: 0, 1: 2, 2: 1, 3: 3}, {0: 1, 1: 2, 2: 0, 3: 3}),
    ][:shown]
    assert [each.probability for each in result.alternatives] == pytest.approx(
        [0.27, 0.189, 0.081][:shown]
    )
    # The last is not half as likely as the first.
    assert result.ambiguity.maps == 3
    assert result.ambiguity.alternatives == (0, 1)[:shown]
    # Three answers for the second object; for the first .61 against .3, for the third .7 and .21.
    assert result.ambiguity.deciding_sketch_objects == (1, 0, 2)


def test_on_another_place_the_answer_stands_but_nothing_is_asked():
    scene = random_scene(np.random.default_rng(8), 4)
    result = wary(scene, scene, 0.75)
    assert result.object_map == {0: 0, 1: 1, 3: 3}
    assert result.place_probability == pytest.approx(0.25)
    assert result.probability == pytest.approx(0.1)
    assert result.ambiguity is None
    assert repr(result).startswith(
        "<MatchResult: probably not this place (this place: 0.250): 3 of"
    )


@pytest.mark.parametrize(("columns", "rows", "turns"), [(3, 3, 4), (4, 3, 2)])
def test_a_regular_grid_of_equal_pillars_is_its_place_whichever_way_it_is_turned(
    columns, rows, turns
):
    # In the mirror, or with its things exchanged, it is itself: that says nothing of chance.
    box = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    places = itertools.product(range(columns), range(rows))
    pillars = Scene.from_polygons([box + 3.0 * np.array(place) for place in places])
    result = match(pillars, pillars)
    assert result.place_probability > 0.9
    assert result.ambiguity.maps == turns
    assert result.probability == pytest.approx(1.0 / turns, abs=0.05)
