"""Simulated sketches: their truth is true and their noise is what was asked for."""

import itertools
import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch import Scene
from sketchmatch.testing import random_scene, simulate_sketch, spacing
from tests.interpreted import examples
from tests.strategies import CORNERED, scenes

EXACT = {"displacement": 0.0, "turn": 0.0, "stretch": 0.0, "wobble": 0.0}


def shapes():
    return Scene.from_polygons(
        [3.0 * np.array([k % 3, k // 3]) + np.array(ring) / 3 for k, ring in enumerate(CORNERED)],
        [f"thing {k}" for k in range(len(CORNERED))],
    )


def centres(scene):
    return np.array([item.centroid for item in scene.objects])


def test_without_noise_it_is_the_scene_turned_and_scaled():
    scene = shapes()
    sketch = simulate_sketch(
        scene, np.random.default_rng(0), rotation=math.pi / 2, scale=2.0, **EXACT
    )
    x, y = centres(scene)[sketch.partners].T
    np.testing.assert_allclose(centres(sketch.scene), 2.0 * np.stack([-y, x], axis=1), atol=1e-9)
    areas = [scene.objects[k].area for k in sketch.partners]
    assert [item.area for item in sketch.scene.objects] == pytest.approx([4.0 * a for a in areas])


def test_partners_name_what_was_drawn_in_random_order():
    scene = shapes()
    sketch = simulate_sketch(scene, np.random.default_rng(3), objects=[5, 1, 6, 0])
    assert sorted(sketch.partners) == [0, 1, 5, 6]
    assert sketch.scene.labels == tuple(scene.labels[k] for k in sketch.partners)
    orders = {
        tuple(simulate_sketch(scene, np.random.default_rng(seed)).partners) for seed in range(5)
    }
    assert len(orders) > 1


def test_the_same_seed_draws_the_same():
    one, other = (simulate_sketch(shapes(), np.random.default_rng(7)) for _ in range(2))
    for first, second in zip(one.scene.objects, other.scene.objects, strict=True):
        assert all((a == b).all() for a, b in zip(first.rings, second.rings, strict=True))


def test_displacement_is_a_share_of_the_spacing():
    scene = shapes()
    unit = spacing(scene)
    rng = np.random.default_rng(1)
    exact = {**EXACT, "displacement": 0.1}
    off = [
        centres(sketch.scene) - centres(scene)[sketch.partners]
        for sketch in (
            simulate_sketch(scene, rng, rotation=0.0, scale=1.0, **exact) for _ in range(60)
        )
    ]
    assert np.std(off) == pytest.approx(0.1 * unit, rel=0.1)


def test_the_spacing_is_the_median_distance_to_the_nearest():
    squares = [[(x, 0), (x + 1, 0), (x + 1, 1), (x, 1)] for x in (0, 2, 5, 9)]
    assert spacing(Scene.from_polygons(squares)) == pytest.approx(2.5)


@given(scenes(), st.integers(0, 2**32))
@examples(30)
def test_however_much_outlines_wobble_every_object_stays_a_polygon(scene, seed):
    sketch = simulate_sketch(scene, np.random.default_rng(seed), wobble=0.4)
    for item, partner in zip(sketch.scene.objects, sketch.partners, strict=True):
        assert len(item.rings) == len(scene.objects[partner].rings)
        assert item.polygon.is_valid
        assert item.area > 0


@pytest.mark.parametrize("objects", [2, 16, 17, 40])
def test_random_scenes_have_objects_that_lie_apart(objects):
    scene = random_scene(np.random.default_rng(objects), objects)
    assert len(scene) == objects
    shapes = [shapely.Polygon(item.rings[0]) for item in scene.objects]
    for first, second in itertools.combinations(shapes, 2):
        assert first.distance(second) > 0.0
