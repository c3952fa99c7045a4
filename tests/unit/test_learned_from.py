"""The sketches that the judge ``posterior`` learns from."""

import ast
from functools import partial

import numpy as np
import pytest
import shapely

from sketchmatch.model import Scene
from tests.experiments import (
    anyones,
    crowd,
    floors,
    halls,
    posterior,
    strangers,
    training,
)
from tests.experiments.anyones import anyones_drawing
from tests.experiments.floors import floor_drawing
from tests.experiments.people import Person, Shapes, remembered
from tests.experiments.strangers import stranger_drawing
from tests.experiments.training import hall_drawing, inventive_drawing, training_drawing
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


@pytest.mark.slow
def test_who_draws_boxes_draws_outlines_of_what_reaches_around_something_else():
    rng = np.random.default_rng(0)
    around = np.array([[0, 0], [4, 0], [4, 4], [3, 4], [3, 1], [1, 1], [1, 4], [0, 4]], float)
    within = np.array([[1.7, 2.0], [2.3, 2.0], [2.3, 2.6], [1.7, 2.6]])
    room = Scene.from_polygons([around, within])
    with pytest.raises(ValueError, match="boxes"):
        remembered(room, Person(0.5, shapes=Shapes.BOXES), rng)
    for _ in range(6):
        drawn = anyones._remembered([around, within], rng)
        assert not drawn.objects[0].polygon.intersects(drawn.objects[1].polygon)


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
        place = training.strewn(rng, 8)
        kept = training.seen_around(place, 5, rng)
        monkeypatch.setattr(training, "drawn_by_anybody", lambda things, *_: list(things))
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
    scene = training.strewn(np.random.default_rng(0), 20)
    centres = np.array([item.centroid for item in scene.objects])
    near = 0
    for seed in range(40):
        kept = training.seen_around(scene, 5, np.random.default_rng(seed))
        assert len(set(kept.tolist())) == 5
        around = [
            set(kept.tolist()) <= set(np.argsort(np.hypot(*(centres - each).T))[:7].tolist())
            for each in centres
        ]
        near += any(around)
    assert 24 <= near < 40


def test_things_of_a_floor_lie_apart():
    for seed in range(10):
        scene = training.strewn(np.random.default_rng(seed), 12)
        outlines = [item.polygon for item in scene.objects]
        for k, each in enumerate(outlines[:-1]):
            assert shapely.distance(each, outlines[k + 1 :]).min() > 0.05
        assert len(outlines) == 12


def test_things_of_a_hall_lie_apart_and_are_as_many_as_wanted():
    alike = []
    for seed in range(12):
        objects = (4, 8, 20)[seed % 3]
        scene = halls.hall(np.random.default_rng(seed), objects)
        outlines = [item.polygon for item in scene.objects]
        assert len(outlines) == objects
        for k, each in enumerate(outlines[:-1]):
            assert shapely.distance(each, outlines[k + 1 :]).min() > 0.05
        areas = np.sort([item.area for item in scene.objects])
        alike.append(np.isclose(areas[1:], areas[:-1], rtol=1e-9).any())
    assert np.mean(alike) > 0.5  # much in them is alike


def test_halls_are_recalled_about_as_they_are_and_in_their_order():
    agreeing = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        place = halls.hall(rng, 12)
        things = [item.rings[0] for item in place.objects]
        drawn = halls.recalled(things, place, rng)
        outlines = [shapely.Polygon(ring) for ring in drawn]
        assert not any(a.intersects(b) for k, a in enumerate(outlines) for b in outlines[:k])
        z, w = (
            np.array([complex(*shapely.Polygon(ring).centroid.coords[0]) for ring in rings])
            for rings in (things, drawn)
        )
        z, w = z - z.mean(), w - w.mean()
        agreeing.append(abs(np.vdot(z, w)) / np.linalg.norm(z) / np.linalg.norm(w))
    assert min(agreeing) > 0.8
    assert 0.93 < np.mean(agreeing) < 0.998  # and not as they are


@pytest.mark.slow
def test_of_halls_and_of_the_inventive_the_truth_is_a_partial_map():
    for draw, most in ((hall_drawing, 0.45), (inventive_drawing, 0.0)):
        drawings = [draw(number) for number in range(30)]
        again = draw(7)
        for one, two in zip(again.scene.objects, drawings[7].scene.objects, strict=True):
            np.testing.assert_array_equal(one.rings[0], two.rings[0])
        extras = []
        for each in drawings:
            assert each.truth.shape == (len(each.scene),)
            assert each.truth.max() < len(each.map)
            known = each.truth[each.truth >= 0]
            assert len(set(known.tolist())) == len(known)
            if len(known):
                extras.append(len(each.truth) - len(known))
        assert 1.0 - len(extras) / len(drawings) <= most
        assert set(extras) == {0, 1, 2}


@pytest.mark.slow
@pytest.mark.parametrize(
    "draw",
    [
        anyones_drawing,
        partial(anyones_drawing, exchanged=True),
        stranger_drawing,
        floor_drawing,
    ],
)
def test_of_anyones_of_strangers_and_of_floors_the_truth_is_a_partial_map(draw):
    drawings = [draw(number) for number in range(40)]
    again = draw(7)
    for one, two in zip(again.scene.objects, drawings[7].scene.objects, strict=True):
        np.testing.assert_array_equal(one.rings[0], two.rings[0])
    extras, elsewhere = set(), 0
    for each in drawings:
        assert each.truth.shape == (len(each.scene),)
        assert each.truth.max() < len(each.map)
        known = each.truth[each.truth >= 0]
        assert len(set(known.tolist())) == len(known)
        elsewhere += not len(known)
        if len(known):
            extras.add(len(each.truth) - len(known))
        for scene in (each.scene, each.map):
            outlines = [item.polygon for item in scene.objects]
            for k, one in enumerate(outlines):
                common = shapely.area(shapely.intersection(one, outlines[:k]))
                # A scene lets things touch.
                assert (common <= 0.02 * one.area).all()
    assert extras >= {1, 2}
    assert 4 <= elsewhere <= 24


def test_rooms_of_a_floor_fill_it_and_keep_their_order_where_people_draw_them():
    agreeing = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        rooms, outside = floors._floor(9, rng.uniform(0.0, 1.0, 4), rng)
        assert len(rooms) + len(outside) >= 9
        every = [*rooms, *outside]
        assert sum(each.area for each in every) == pytest.approx(shapely.union_all(every).area)
        drawn = floors._drawn(rooms, rng)
        turns = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
        orders = []
        there, centres = (
            shapely.get_coordinates(shapely.centroid(each)) for each in (rooms, drawn)
        )
        for turn in turns:
            back = centres @ training.turning(turn)
            orders.append(min(spearman(back[:, k], there[:, k]) for k in (0, 1)))
        agreeing.append(max(orders))
    assert min(agreeing) > 0.7
    assert np.mean(agreeing) > 0.9


def spearman(a, b):
    ranks = [np.argsort(np.argsort(each)) for each in (a, b)]
    return np.corrcoef(*ranks)[0, 1]


def test_a_stretch_of_a_floor_is_drawn_too_long_or_too_short_and_none_vanishes():
    longer = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        lines, drawn = floors._stretched(rng.uniform(0.0, 9.0, 12), 0.6, rng)
        assert drawn[0] == 0.0
        assert (np.diff(drawn) > 0.0).all()
        longer += np.log(np.diff(drawn) / np.diff(lines)).tolist()
    assert 0.2 < np.std(longer) < 1.0


@pytest.mark.parametrize("roughness", [0.0, 0.1, 0.3])
def test_rough_outlines_stand_where_they_stood_and_meet_no_other(roughness):
    for seed in range(10):
        rng = np.random.default_rng(seed)
        scene = training.strewn(rng, 10)
        rough = anyones._rough(scene, roughness, rng)
        outlines = [item.polygon for item in rough.objects]
        assert not any(a.intersects(b) for k, a in enumerate(outlines) for b in outlines[:k])
        for before, after in zip(scene.objects, rough.objects, strict=True):
            common = before.polygon.intersection(after.polygon).area
            assert common > (1.0 - 3.0 * roughness) * before.area - 1e-9
        assert (rough == scene) == (roughness == 0.0)


def test_of_what_is_seen_from_one_side_a_part_is_on_the_map():
    shares = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        scene = training.strewn(rng, 10)
        seen = anyones._as_seen(scene, rng)
        for whole, part in zip(scene.objects, seen.objects, strict=True):
            assert whole.polygon.buffer(1e-9).covers(part.polygon)
            shares.append(part.area / whole.area)
    thinner = np.array(shares) < 0.99
    assert 0.01 < thinner.mean() < 0.15
    assert min(shares) > 0.02


def test_what_was_exchanged_is_drawn_where_something_else_was():
    for seed in range(20):
        rng = np.random.default_rng(seed)
        place = training.strewn(rng, 12)
        kept = training.seen_around(place, 5, rng)
        found = anyones._exchanged(place, kept, rng)
        assert len(found) <= 2
        others = [item.centroid for k, item in enumerate(place.objects) if k not in kept]
        for ring in found:
            outline = shapely.Polygon(ring)
            apart = np.hypot(*(np.array(others) - outline.centroid.coords[0]).T)
            assert apart.min() < 1.5 * np.sqrt(max(item.area for item in place.objects))
            drawn = [place.objects[k].polygon for k in kept]
            assert not shapely.intersects(drawn, outline).any()


def test_the_crowd_is_wrong_about_places_by_what_no_pose_makes_good():
    for seed in range(40):
        rng = np.random.default_rng(seed)
        centres = rng.normal(0.0, 3.0, (9, 2))
        wrong = crowd._wrong(centres, rng) @ [1.0, 1.0j]
        z = centres @ [1.0, 1.0j]
        z = z - z.mean()
        assert abs(wrong.mean()) < 1e-9
        assert abs(np.vdot(z, wrong)) < 1e-9 * np.linalg.norm(z)
        assert 0.3 < np.sqrt(np.mean(abs(wrong) ** 2)) < 2.0  # ways to be wrong add up


def test_of_what_is_like_anything_few_are_like_what_is_there():
    def corners(anything):
        rng = np.random.default_rng(0)
        box = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]
        place = training.Scene.from_polygons(
            [9.0 * np.array([k % 3, k // 3]) + box for k in range(6)]
        )
        things = [item.rings[0] for item in place.objects]
        found = training.extras(place, things, 40, rng, anything)
        return np.array([len(ring) for ring in found])

    assert (corners(False) == 4).all()
    assert 0.2 < (corners(True) == 4).mean() < 0.8


@pytest.mark.parametrize("simple", [0, 1, 2])
def test_a_simplified_outline_is_as_large(simple):
    ring = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]])
    found = training._simplified(ring - ring.mean(axis=0), simple)
    assert shapely.Polygon(found).area == pytest.approx(shapely.Polygon(ring).area)
    assert len(found) == {0: 6, 1: 4, 2: 16}[simple]


def test_no_code_of_the_generators_that_measure_is_learned_from():
    for module in (training, halls, floors, crowd, anyones, strangers, posterior):
        text = (ROOT / "tests" / "experiments" / f"{module.__name__.split('.')[-1]}.py").read_text()
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ImportFrom):
                assert "generators" not in (node.module or "")
                assert not any("generators" in each.name for each in node.names)
