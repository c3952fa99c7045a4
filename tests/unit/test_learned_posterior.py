"""What the judge ``posterior`` learns from, and that learning finds what is there."""

import ast

import numpy as np
import pytest
import shapely

from sketchmatch_builtin.alignment import Part
from sketchmatch_builtin.judges._evidence import FIRST, NUMBERS, Described
from tests.experiments import posterior, training
from tests.experiments.posterior import Known, known_of, learned_posterior
from tests.experiments.training import training_drawing
from tests.tools import ROOT

NUMBERS_OF_DRAWINGS = range(60)


@pytest.fixture(scope="module")
def drawings():
    return [training_drawing(number) for number in NUMBERS_OF_DRAWINGS]


def test_a_number_gives_the_same_drawing_each_time_and_another_one_another(drawings):
    again = training_drawing(7)
    for one, two in zip(again.scene.objects, drawings[7].scene.objects, strict=True):
        np.testing.assert_array_equal(one.rings[0], two.rings[0])
    np.testing.assert_array_equal(again.truth, drawings[7].truth)
    corners = {each.scene.objects[0].rings[0].tobytes() for each in drawings}
    assert len(corners) == len(drawings)


def test_truths_are_partial_maps_and_those_of_other_places_none(drawings):
    elsewhere = 0
    for each in drawings:
        assert each.truth.shape == (len(each.scene),)
        known = each.truth[each.truth >= 0]
        assert len(set(known.tolist())) == len(known)
        assert each.truth.max() < len(each.map)
        elsewhere += not len(known)
        if len(known):
            assert len(known) >= len(each.truth) - 2  # at most two are invented
        assert {item.label for item in each.scene.objects} <= {""}
    assert 0.2 < elsewhere / len(drawings) < 0.5


def test_of_a_careful_drawing_the_truth_is_what_was_drawn(monkeypatch):
    # Drawn without any care less, an object is the one that it was made from.
    for number in range(40):
        rng = np.random.default_rng(number)
        place = training._strewn(rng, 8)
        kept = training._seen(place, 5, rng)
        monkeypatch.setattr(training, "_drawn", lambda things, *_: list(things))
        sketch, truth = training._by_anybody(place, kept, number % 3, rng)
        assert len(truth) == len(sketch) >= 5
        for item, partner in zip(sketch.objects, truth, strict=True):
            if partner >= 0:
                assert item.polygon.equals(place.objects[partner].polygon)
            else:
                apart = shapely.distance(item.polygon, [one.polygon for one in place.objects])
                assert apart.min() > 0.05


def test_of_drawings_by_people_the_truth_is_by_place(monkeypatch):
    monkeypatch.setattr(
        training,
        "remembered",
        lambda room, person, rng: room,  # noqa: ARG005
    )
    rng = np.random.default_rng(0)
    place = training.random_scene(rng, 8)
    kept = np.array([6, 1, 3])
    sketch, truth = training._by_people(place, kept, 1, rng)
    np.testing.assert_array_equal(truth, [6, 1, 3, -1])
    for item, partner in zip(sketch.objects, truth, strict=True):
        assert item.label == ""
        if partner >= 0:
            assert item.polygon.equals(place.objects[partner].polygon)


def test_what_is_seen_lies_around_one_object():
    scene = training._strewn(np.random.default_rng(0), 20)
    centres = np.array([item.centroid for item in scene.objects])
    near = 0
    for seed in range(40):
        kept = training._seen(scene, 5, np.random.default_rng(seed))
        assert len(set(kept.tolist())) == 5
        around = [
            set(kept.tolist()) <= set(np.argsort(np.hypot(*(centres - each).T))[:7].tolist())
            for each in centres
        ]
        near += any(around)
    assert 24 <= near < 40


def test_things_of_a_floor_lie_apart():
    for seed in range(10):
        scene = training._strewn(np.random.default_rng(seed), 12)
        outlines = [item.polygon for item in scene.objects]
        for k, each in enumerate(outlines[:-1]):
            assert shapely.distance(each, outlines[k + 1 :]).min() > 0.05
        assert len(outlines) == 12


@pytest.mark.parametrize("simple", [0, 1, 2])
def test_a_simplified_outline_is_as_large(simple):
    ring = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]])
    found = training._simplified(ring - ring.mean(axis=0), simple)
    assert shapely.Polygon(found).area == pytest.approx(shapely.Polygon(ring).area)
    assert len(found) == {0: 6, 1: 4, 2: 16}[simple]


def test_no_code_of_the_generators_that_measure_is_learned_from():
    for module in (training, posterior):
        text = (ROOT / "tests" / "experiments" / f"{module.__name__.split('.')[-1]}.py").read_text()
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ImportFrom):
                assert "generators" not in (node.module or "")
                assert not any("generators" in each.name for each in node.names)


def made_up(rng, count, weights, elsewhere=0.3):
    """Return cases of which the right map, and the place, follow from known weights."""
    cases = []
    for _ in range(count):
        maps, drawn = 8, 6
        rows = np.zeros((maps, len(NUMBERS)))
        rows[:, [NUMBERS.index(name) for name in weights]] = rng.normal(size=(maps, len(weights)))
        # The same lines and scatter for all, so that a skill is 0 and only the weights count.
        rows[:, Part.MATCHED] = 6.0
        rows[:, [Part.SCATTER, Part.SCATTER_SIZE, Part.SCATTER_SHAPE]] = -9.6, -7.2, -10.8
        scores = rows[:, [NUMBERS.index(name) for name in weights]] @ list(weights.values())
        shares = np.exp(scores - scores.max())
        right = int(rng.choice(maps, p=shares / shares.sum()))
        other = bool(rng.random() < elsewhere)
        lost = bool(rng.random() < 0.2)
        found = np.array([rng.permutation(9)[:drawn] for _ in range(maps)])
        decoys = tuple(rng.normal(size=(3, len(NUMBERS))) * 0.1 for _ in range(4))
        truth = np.full(drawn, -1) if other else found[right]
        if lost or other:
            known = -1
            truth = truth if other else np.roll(found[right], 1)
        else:
            known = right
        cases.append(Known(Described(found, rows, decoys, drawn, 9), known, other, truth))
    return cases


def test_a_fit_finds_the_weights_that_made_the_cases():
    weights = {"place": -2.0, "size": 1.0, "similarity": -1.5}
    found = learned_posterior(made_up(np.random.default_rng(0), 3000, weights))
    assert len(found.first) == len(FIRST)
    for name, weight in weights.items():
        assert found.weights[NUMBERS.index(name)] == pytest.approx(weight, abs=0.25), name
    first = dict(zip([NUMBERS[k] for k in FIRST], found.first, strict=True))
    assert first["place"] < -0.5
    assert first["size"] > 0.3
    assert first["crowd"] == pytest.approx(0.0, abs=1e-6)
    assert found.weights[Part.ALIKE] > 0.3
    assert found.weights[Part.UNLIKE] < -0.3
    assert 0.0 <= found.luck <= 1.0


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


def test_labels_that_were_put_on_a_sketch_are_mostly_right():
    rng = np.random.default_rng(0)
    truth = np.array([0, 2, 4, -1, 6, 8])
    case = Known(Described(truth[None], np.zeros((1, len(NUMBERS))), (), 6, 12), 0, False, truth)
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


def test_a_sketch_is_known_by_its_maps_and_which_of_them_is_right():
    rights = others = 0
    for number in range(12):
        for known in known_of(number):
            drawing = training_drawing(number)
            np.testing.assert_array_equal(known.truth, drawing.truth)
            assert known.elsewhere == bool((drawing.truth < 0).all())
            assert known.described.drawn == len(drawing.scene)
            assert known.described.mapped == len(drawing.map)
            others += known.elsewhere
            if known.right >= 0:
                rights += 1
                np.testing.assert_array_equal(known.described.maps[known.right], drawing.truth)
                assert not known.elsewhere
    assert rights >= 4
    assert others >= 2


def test_other_places_count_more_where_a_sketch_shows_enough():
    def case(drawn, elsewhere):
        maps = np.zeros((1, drawn), dtype=np.int64)
        described = Described(maps, np.zeros((1, len(NUMBERS))), (), drawn, 9)
        return Known(described, -1, elsewhere, np.full(drawn, -1))

    assert posterior._counts(case(12, True))
    assert not posterior._counts(case(2, True))
    assert not posterior._counts(case(12, False))
