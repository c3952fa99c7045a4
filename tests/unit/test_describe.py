"""Describing a whole scene, and the pairs that none of the directions meets."""

import math

import numpy as np
import pytest
from hypothesis import given

from sketchmatch import Scene, force_histogram
from sketchmatch.kernels.alignment import main_directions
from sketchmatch.model import object_pairs
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.slices import finish
from sketchmatch_builtin.histograms.constant import ConstantForce
from tests.interpreted import examples
from tests.oracle.relations import descriptor as by_definition
from tests.strategies import scenes


def constant(directions=180):
    return ConstantForce(ConstantForce.Params(directions=directions))


def square(x, y, side=1.0):
    return side * np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) + [x - side / 2, y - side / 2]


@pytest.mark.slow
@given(scenes(most=4))
@examples(15)
def test_every_pair_is_described_in_its_place(scene):
    found = finish(describe(scene, constant(24)))
    assert (found.objects, found.exponent, found.directions) == (len(scene), 0.0, 24)
    for (a, b), expected in by_definition(scene, 24).items():
        if expected.any():
            tolerance = 1e-9 * expected.max()
            np.testing.assert_allclose(found.histogram(a, b), expected, rtol=0, atol=tolerance)


def test_the_share_done_rises_to_one():
    scene = Scene.from_polygons([square(3 * k, k % 5) for k in range(20)])
    shares = list(describe(scene, constant()))
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def far_apart(angle, distance=1000.0):
    """Two small boxes, the first of them in a direction of the second."""
    x, y = distance * math.cos(angle), distance * math.sin(angle)
    return Scene.from_polygons([square(x, y, 2.0), square(0.0, 0.0, 0.5)])


@pytest.mark.parametrize("degrees", [3.0, 45.7, 91.0, 181.3, 269.5, 359.9])
def test_a_pair_that_no_direction_meets_gets_the_limit_of_small_objects(degrees):
    scene, angle = far_apart(math.radians(degrees)), math.radians(degrees)
    assert not constant().describe(scene, np.array([[0, 1]])).any(), "nothing to describe"
    found = finish(describe(scene, constant()))
    assert found.histograms.sum() * math.tau / 180 == pytest.approx(4.0 * 0.25 / 1000.0)
    apart = math.remainder(main_directions(found.histograms)[0] - angle, math.tau)
    assert apart == pytest.approx(0.0, abs=1e-5)
    assert np.count_nonzero(found.histograms) <= 2


def test_the_limit_is_what_fine_directions_give():
    scene = far_apart(math.radians(45.7), 60.0)
    fine = force_histogram(*scene.objects, directions=3600)
    assert fine.sum() * math.tau / 3600 == pytest.approx(4.0 * 0.25 / 60.0, rel=0.01)


def test_a_small_scene_far_from_the_origin_is_described_as_at_the_origin():
    here = [square(0, 0), square(3, 1), square(1, 4, 0.5)]
    there = [polygon + 1e5 for polygon in here]
    near, far = (
        constant().describe(Scene.from_polygons(scene), object_pairs(3)) for scene in (here, there)
    )
    np.testing.assert_allclose(far, near, rtol=0, atol=1e-9 * near.max())
