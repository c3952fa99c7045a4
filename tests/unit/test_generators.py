"""The generators that the study measures with: what they draw, and that nothing is learned."""

import ast
import itertools

import numpy as np
import pytest
import shapely

from tests.experiments.generators import KINDS, memory, plain, sample
from tests.experiments.people import Shapes
from tests.tools import ROOT

each_kind = pytest.mark.parametrize("kind", KINDS)


def rings(scene):
    return [item.rings[0].tolist() for item in scene.objects]


def centres(scene):
    return np.array([item.centroid for item in scene.objects])


def fitted(drawn):
    """Return what is drawn of the map, in its frame: moved, turned and scaled on to it."""
    known = drawn.truth >= 0
    z, w = (
        each[:, 0] + 1j * each[:, 1]
        for each in (centres(drawn.scene)[known], centres(drawn.map)[drawn.truth[known]])
    )
    z, w = z - z.mean(), w - w.mean()
    return z * (np.vdot(z, w) / np.vdot(z, z)), w


@each_kind
def test_the_same_numbers_give_the_same_drawing(kind):
    one, again = (sample(kind, 3, missing=1, extra=1) for _ in range(2))
    assert rings(one.scene) == rings(again.scene)
    assert rings(one.map) == rings(again.map)
    assert one.truth.tolist() == again.truth.tolist()
    other = sample(kind, 4, missing=1, extra=1)
    assert rings(one.map) != rings(other.map)


@each_kind
def test_a_map_has_as_many_objects_as_are_asked_for_however_it_is_drawn(kind):
    for objects in (8, 20, 60):
        maps = [sample(kind, 0, objects=objects, **how).map for how in ({}, {"missing": 2})]
        assert [len(each) for each in maps] == [objects, objects]
        assert rings(maps[0]) == rings(maps[1])


@each_kind
@pytest.mark.parametrize(("missing", "extra"), [(0, 0), (1, 0), (1, 1), (2, 2)])
def test_a_sketch_shows_neighbours_but_the_missing_ones_and_what_is_not_there(kind, missing, extra):
    for number in range(4):
        drawn = sample(kind, number, objects=20, missing=missing, extra=extra)
        known = drawn.truth[drawn.truth >= 0]
        assert len(drawn.scene) == len(drawn.truth) == 8 - missing + extra
        assert len(set(known.tolist())) == len(known) == 8 - missing
        places = centres(drawn.map)
        nearest = np.argsort(np.hypot(*(places[:, None] - places).transpose(2, 0, 1)))[:, :8]
        assert any(set(known.tolist()) <= set(each) for each in nearest.tolist())


@each_kind
def test_which_are_missing_is_chance(kind):
    shown = [set(sample(kind, n, objects=8, missing=1).truth.tolist()) for n in range(12)]
    assert len({frozenset(each) for each in shown}) > 3


@each_kind
def test_what_is_not_there_lies_among_what_is_drawn_clear_of_all_that_is(kind, monkeypatch):
    generator = {"plain": plain, "memory": memory}[kind]
    monkeypatch.setattr(generator, "drawn", lambda things, *_: list(things))
    for number in range(6):
        drawn = sample(kind, number, objects=20, missing=2, extra=2)
        there = [item.polygon for item in drawn.map.objects]
        seen = shapely.convex_hull(shapely.union_all(there))
        for item, partner in zip(drawn.scene.objects, drawn.truth.tolist(), strict=True):
            if partner < 0:
                assert seen.contains(item.polygon.centroid)
                assert min(item.polygon.distance(other) for other in there) > 0.03
            else:
                assert item.polygon.equals(drawn.map.objects[partner].polygon)


@each_kind
def test_of_another_place_nothing_is_on_the_map(kind):
    drawn = sample(kind, 0, objects=20, wrong_place=True, missing=1, extra=1)
    assert drawn.truth.tolist() == [-1] * 8
    assert rings(drawn.map) == rings(sample(kind, 0, objects=20).map)


@each_kind
@pytest.mark.parametrize("shapes", Shapes)
def test_things_stand_apart_on_the_map_and_in_the_sketch(kind, shapes):
    for number in range(4):
        drawn = sample(kind, number, objects=36, extra=1, shapes=shapes)
        for scene in (drawn.map, drawn.scene):
            pairs = itertools.combinations([item.polygon for item in scene.objects], 2)
            assert not any(a.intersects(b) for a, b in pairs)


@each_kind
def test_boxes_have_four_corners_and_ellipses_are_round(kind):
    for shapes, corners in ((Shapes.BOXES, 4), (Shapes.ELLIPSES, 20)):
        drawn = sample(kind, 0, extra=1, shapes=shapes)
        assert {len(item.rings[0]) for item in drawn.scene.objects} == {corners}
    outlines = [len(each) for n in range(6) for each in rings(sample(kind, n).scene)]
    assert len(set(outlines)) > 1


def test_plain_displaces_by_a_share_of_the_width_of_a_place():
    squares = [abs(np.subtract(*fitted(sample("plain", n, objects=9)))) ** 2 for n in range(40)]
    # Moving, turning and scaling take up 4 of 16 numbers.
    assert np.sqrt(np.mean(squares) / 2.0 * 16 / 12) == pytest.approx(0.22, abs=0.025)


def test_plain_stretches_by_a_quarter_at_most(monkeypatch):
    monkeypatch.setattr(plain, "_DISPLACEMENT", 0.0)
    monkeypatch.setattr(plain.outlines, "turned", lambda ring, _: ring)
    drawn = sample("plain", 0, objects=8)
    widths, mapped = (
        np.array([np.ptp(item.rings[0], axis=0) for item in each.objects])
        for each in (drawn.scene, drawn.map)
    )
    ratio = widths / mapped[drawn.truth]
    assert ratio.max() / ratio.min() < 1.25 / 0.75
    assert ratio.max() / ratio.min() > 1.2


def test_memory_straightens_everything_along_the_walls():
    for number in range(6):
        drawn = sample("memory", number, extra=1, shapes=Shapes.BOXES)
        edges = np.concatenate([np.diff(item.rings[0], axis=0) for item in drawn.scene.objects])
        quarters = np.arctan2(edges[:, 1], edges[:, 0]) * 4.0
        assert np.abs(np.exp(1j * quarters) - np.exp(1j * quarters[0])).max() < 1e-6


def test_memory_keeps_order_better_than_distance():
    kept, changes = [], []
    for number in range(30):
        z, w = fitted(sample("memory", number))
        first, second = (each[:, None] - each for each in (z, w))
        apart = np.abs(second.real) > 1.0
        kept.append((np.sign(first.real) == np.sign(second.real))[apart].mean())
        far = np.abs(second) > 0
        changes.append(np.std(np.log(np.abs(first)[far] / np.abs(second)[far])))
    assert np.mean(kept) > 0.97
    assert np.mean(changes) > 0.15


def test_memory_knows_small_medium_and_large(monkeypatch):
    monkeypatch.setattr(memory, "_HAND", 0.0)
    room = sample("memory", 1, objects=36).map
    sizes = np.sqrt([item.area for item in room.objects])
    remembered = memory._remembered_sizes(sizes, room, np.random.default_rng(0))
    known = np.unique(remembered.round(9))
    assert len(known) == 3
    order = np.argsort(sizes)
    assert (np.diff(remembered[order]) > -1e-9).all()


def test_nothing_is_learned_from_what_is_measured_with():
    experiments = ROOT / "tests" / "experiments"
    names, seen = ["learn", "calibrate"], set()
    while names:
        name = names.pop()
        path = experiments / f"{name}.py"
        if name in seen:
            continue
        seen.add(name)
        if not path.exists():
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module == "tests.experiments":
                names += [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module:
                names += node.module.removeprefix("tests.experiments.").split(".")[:1]
    assert {"odds", "drawings", "people"} <= seen
    assert "generators" not in seen
