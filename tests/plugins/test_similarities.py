"""The similarities ``pappis``, ``overlap``, ``santini-jain`` and ``circular-peak``."""

import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch import Scene, match
from sketchmatch.errors import InvalidInputError
from sketchmatch.registry import Kind, default_registry
from sketchmatch.testing import random_scene
from sketchmatch_builtin.similarities.circular_peak import CircularPeak
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation
from sketchmatch_builtin.similarities.overlap import Overlap
from sketchmatch_builtin.similarities.pappis import Pappis
from sketchmatch_builtin.similarities.santini_jain import SantiniJain
from tests.interpreted import compiled_only, examples
from tests.oracle import relations as oracle

LOPSIDED = SantiniJain(SantiniJain.Params(alpha=2.0, beta=0.25))
MEASURES = {
    "cross-correlation": (CrossCorrelation(), oracle.cross_correlation),
    "circular-peak": (CircularPeak(), oracle.cross_correlation),
    "pappis": (Pappis(), oracle.pappis),
    "overlap": (Overlap(), oracle.overlap),
    "santini-jain": (SantiniJain(), oracle.santini_jain),
    "santini-jain, lopsided": (LOPSIDED, partial(oracle.santini_jain, alpha=2.0, beta=0.25)),
}
each_measure = pytest.mark.parametrize(
    ("measure", "definition"), MEASURES.values(), ids=MEASURES.keys()
)


@st.composite
def rows(draw):
    """Return two histograms, some of whose bins are zero or tiny, but not all."""
    bins = draw(st.sampled_from([4, 6, 12, 180]))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    pair = rng.random((2, bins)) * (rng.random((2, bins)) < draw(st.sampled_from([0.2, 0.7, 1.0])))
    pair *= rng.choice([1.0, 1e-5], (2, bins))
    pair[:, rng.integers(bins, size=2)] += 1.0
    return pair


@pytest.mark.parametrize("name", ["pappis", "overlap", "santini-jain", "circular-peak"])
def test_they_are_registered(name):
    found = default_registry().find(Kind.SIMILARITY, name).algorithm
    assert type(MEASURES[name][0]) is found
    found.warm_up()


def test_values_by_hand():
    first, second = np.array([[1.0, 3, 0, 0]]), np.array([[2.0, 1, 1, 0]])
    assert Pappis().compare(first, second) == pytest.approx([2 / 6])
    assert Overlap().compare(first, second) == pytest.approx([(1 / 2 + 1 / 3 + 0) / 3])
    assert SantiniJain().compare(first, second) == pytest.approx([2 / (2 + 0.5 * 2 + 0.5 * 2)])
    assert LOPSIDED.compare(first, second) == pytest.approx([2 / (2 + 2.0 * 2 + 0.25 * 2)])


@each_measure
@given(rows())
@examples(60)
def test_values_are_those_of_the_definition(measure, definition, rows):
    first, second = rows
    (found,) = measure.compare(first[None], second[None])
    assert found == pytest.approx(definition(first, second), rel=1e-9, abs=1e-12)
    assert 0.0 <= found <= 1.0
    if measure is not LOPSIDED:
        assert measure.compare(second[None], first[None]) == pytest.approx([found], rel=1e-12)
    assert measure.compare(first[None], first[None]) == pytest.approx([1.0], abs=1e-12)
    for factor in (1e-200, 1e200):
        again = measure.compare(factor * first[None], factor * second[None])
        assert again == pytest.approx([found], abs=1e-9)


@each_measure
def test_histograms_with_nothing_in_common_are_not_alike(measure, definition):
    first, second = np.eye(2, 8)
    assert measure.compare(first[None], second[None]) == [0.0]
    assert measure.compare(1e-300 * first[None], 1e-300 * second[None]) == [0.0]
    assert definition(first, second) == 0.0


def test_contrast_with_weights_one_is_pappis():
    first, second = np.random.default_rng(0).random((2, 50, 36))
    even = SantiniJain(SantiniJain.Params(alpha=1.0, beta=1.0))
    assert (even.compare(first, second) == Pappis().compare(first, second)).all()


def test_directions_that_are_empty_in_both_say_nothing():
    first, second = np.array([[1.0, 2, 0, 0]]), np.array([[2.0, 1, 0, 0]])
    padded = [np.pad(each, ((0, 0), (0, 20))) for each in (first, second)]
    assert Overlap().compare(first, second) == pytest.approx([0.5])
    assert Overlap().compare(*padded) == pytest.approx([0.5])
    padded[0][0, 10] = 1e-12
    assert Overlap().compare(*padded) == pytest.approx([0.5]), "nor does a rounding error"


def test_weights_that_make_everything_equal_are_refused():
    scene = random_scene(np.random.default_rng(0), 3)
    with pytest.raises(InvalidInputError, match="give alpha or beta a value above zero") as raised:
        match(
            scene, scene, similarity="santini-jain", params={"similarity": {"alpha": 0, "beta": 0}}
        )
    assert raised.value.field == "pipeline.similarity.parameters"


@compiled_only
@pytest.mark.parametrize(
    ("name", "least_sigma", "least_zeta"),
    [
        ("cross-correlation", 0.995, 0.995),
        ("circular-peak", 0.995, 0.995),
        ("pappis", 0.9, 0.98),
        ("overlap", 0.6, 0.92),
        ("santini-jain", 0.95, 0.99),
    ],
)
@pytest.mark.parametrize("degrees", [0.0, 1.0, 33.7, 179.0, -77.77])
def test_a_scene_is_found_in_its_turned_copy(name, least_sigma, least_zeta, degrees):
    scene = random_scene(np.random.default_rng(42), 6)
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    turn = np.array([[c, s], [-s, c]])
    copy = Scene.from_polygons([[ring @ turn for ring in item.rings] for item in scene.objects])
    result = match(scene, copy, similarity=name)
    assert result.object_map == {k: k for k in range(6)}
    assert min(entry.similarity for entry in result.fmap) > least_sigma
    assert result.fmap_confidence > least_zeta
    assert math.degrees(result.rotation) == pytest.approx(degrees, abs=1.0)
