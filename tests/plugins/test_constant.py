"""The ``constant`` histogram as a plugin: the kernel behind it is tested on its own."""

import numpy as np
import pytest

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import object_pairs
from sketchmatch.pipeline.selection import Choice, resolve
from sketchmatch.registry import Kind, default_registry
from sketchmatch.testing import random_scene
from sketchmatch_builtin.histograms.constant import ConstantForce
from tests.oracle.forces import force_histogram as by_definition

SCENE = random_scene(np.random.default_rng(5), 4)


def constant(**params):
    return ConstantForce(ConstantForce.Params(**params))


def test_it_is_registered_and_the_default():
    assert default_registry().find(Kind.HISTOGRAM, "constant").algorithm is ConstantForce
    assert isinstance(resolve(default_registry(), {}).histogram, ConstantForce)
    assert constant().params.directions is None
    assert constant().directions == 180
    assert constant().exponent == 0.0


@pytest.mark.parametrize("pairs", [[(0, 1)], [(3, 1), (0, 2)], [(2, 2)], [(1, 0), (0, 1), (1, 0)]])
def test_rows_are_those_of_the_pairs_asked_for(pairs):
    rows = constant(directions=12).describe(SCENE, np.array(pairs))
    for row, (a, b) in zip(rows, pairs, strict=True):
        expected = by_definition(SCENE.objects[a].rings, SCENE.objects[b].rings, 12)
        np.testing.assert_allclose(row, expected, rtol=0, atol=1e-9 * expected.max())


def test_slices_give_what_the_whole_gives():
    pairs = object_pairs(len(SCENE))
    whole = constant().describe(SCENE, pairs)
    parts = [constant().describe(SCENE, pairs[k : k + 1])[0] for k in range(len(pairs))]
    assert (whole == parts).all()


@pytest.mark.parametrize(
    ("directions", "words"),
    [
        (2, "greater than or equal to 4"),
        (3602, "less than or equal to 3600"),
        (7, "multiple of 2"),
        (180.5, "valid integer"),
        ("many", "valid integer"),
    ],
)
def test_directions_that_cannot_be_are_refused(directions, words):
    with pytest.raises(InvalidInputError, match=words) as caught:
        resolve(default_registry(), {"histogram": Choice("constant", {"directions": directions})})
    assert caught.value.reason is Reason.INVALID_PARAMETER
    assert caught.value.field == "histogram.parameters.directions"
