"""Describing a whole scene, and the pairs that none of the directions meets."""

import math

import numpy as np
import pytest
from hypothesis import given

from sketchmatch import Scene, compare, force_histogram
from sketchmatch.api import Histogram
from sketchmatch.errors import PluginError
from sketchmatch.kernels.alignment import main_directions
from sketchmatch.model import object_pairs
from sketchmatch.pipeline.describe import describe, with_directions
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.slices import finish
from sketchmatch.registry import default_registry
from sketchmatch.testing import random_scene
from sketchmatch_builtin.histograms.constant import ConstantForce
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation
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


# How many directions ------------------------------------------------------------------------------


def chosen(*scenes, histogram=None):
    """Return how many directions are chosen for one or two scenes."""
    settled = with_directions(histogram or constant(None), default_registry(), *scenes)
    assert settled.directions == settled.params.directions
    return settled.directions


def row(sides, step=10.0):
    """Return boxes of these sides on a line, a step from centre to centre."""
    return Scene.from_polygons([square(step * k, 0.0, side) for k, side in enumerate(sides)])


@pytest.mark.parametrize(
    ("side", "directions"),
    # Five directions within 2 · side / 10 radians are 50π / side over the full turn: 157 for 1.
    [(5.0, 180), (1.0, 180), (0.86, 240), (0.66, 240), (0.65, 300), (0.3, 540), (0.01, 720)],
)
def test_the_smaller_for_its_distance_the_more_directions(side, directions):
    scene = row([side, side])
    assert chosen(scene) == directions
    for factor in (1e-3, 40.0):
        rings = [factor * item.rings[0] for item in scene.objects]
        assert chosen(Scene.from_polygons(rings)) == directions, "whatever the unit"


def test_one_relation_in_ten_may_be_narrower():
    close = [square(0.4 * k, 0.0, 0.39) for k in range(5)]
    assert chosen(Scene.from_polygons(close)) == 180
    lone = Scene.from_polygons([*close[:4], square(40.0, 0.0, 0.4)])
    assert chosen(lone) == 720, "four in ten are"
    near = [square(1.5 * (k % 5), 1.5 * (k // 5)) for k in range(40)]
    assert chosen(Scene.from_polygons([*near, square(200.0, 0.0)])) == 180, "40 in 820 are"


def test_the_scene_with_fewer_objects_decides_for_both():
    few, many = row([1.0] * 3, 12.0), row([0.1] * 5)
    assert chosen(few, many) == chosen(many, few) == chosen(few) < chosen(many)
    found = compare(few, many)
    assert found.sketch_descriptor.directions == found.map_descriptor.directions == chosen(few)


def test_a_large_map_gets_no_more_directions_than_are_quick():
    tiny = row([0.01] * 4)
    assert chosen(tiny, row([0.01] * 90)) == 720
    assert chosen(tiny, row([0.01] * 127)) == 360
    assert chosen(tiny, row([0.01] * 300)) == 180


def test_objects_about_one_centre_are_not_narrow():
    rings = [[square(0, 0, k + 1.0), square(0, 0, k + 0.5)[::-1]] for k in range(0, 6, 2)]
    assert chosen(Scene.from_polygons(rings)) == 180


def test_who_sets_a_number_gets_it():
    histogram = constant(36)
    assert with_directions(histogram, default_registry(), row([0.01] * 3)) is histogram


@pytest.mark.parametrize("seed", range(4))
def test_chosen_directions_keep_a_turned_scene_alike(seed):
    rng = np.random.default_rng(seed)
    small = [
        0.3 * (item.rings[0] - item.centroid) + item.centroid
        for item in random_scene(rng, 6).objects
    ]
    c, s = np.cos(0.3), np.sin(0.3)
    scenes = [Scene.from_polygons(rings) for rings in (small, np.array(small) @ [[c, s], [-s, c]])]
    alike = {}
    for directions in (180, chosen(*scenes)):
        first, second = (finish(describe(scene, constant(directions))) for scene in scenes)
        alike[directions] = np.diag(finish(relate(first, second, CrossCorrelation())).similarity)
    coarse, fine = alike.values()
    assert np.quantile(fine, 0.1) > 0.99
    assert np.quantile(coarse, 0.1) < np.quantile(fine, 0.1) - 0.003


class Reading(Histogram):
    """A histogram that reads its parameters, as plugins do."""

    name = "reading"
    summary = "Reads its parameters."
    exponent = 0.0

    def describe(self, scene, pairs):
        assert len(scene)
        return np.ones((len(pairs), self.params.directions))


class Stubborn(Reading):
    """One that cannot be set up with a number."""

    def __init__(self, params=None):
        if params is not None and params.directions:
            raise RuntimeError("no")
        super().__init__(params)


def test_a_plugin_that_reads_its_parameters_finds_a_number_there():
    scene = row([0.3] * 3)
    assert finish(describe(scene, Reading())).directions == 180
    settled = with_directions(Reading(), default_registry(), scene)
    assert finish(describe(scene, settled)).directions == chosen(scene) > 180
    with pytest.raises(PluginError, match="no"):
        with_directions(Stubborn(), default_registry(), scene)
