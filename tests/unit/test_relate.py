"""The relation table against a comparison of histograms one by one."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from sketchmatch.model import SceneDescriptor, pair_count
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.slices import finish
from sketchmatch_builtin.histograms.constant import ConstantForce
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation
from tests.oracle import relations as oracle
from tests.oracle.maps import look_up
from tests.strategies import scenes


def related(template, argument):
    return finish(relate(template, argument, CrossCorrelation()))


def assert_entry(found, expected):
    """Compare (σ, R, L) of the engine with those of the oracle."""
    sigma, rotation, dilation = expected
    assert found[0] == pytest.approx(sigma, rel=1e-9)
    assert math.remainder(found[1] - rotation, math.tau) == pytest.approx(0.0, abs=1e-9)
    assert found[2] == pytest.approx(dilation, rel=1e-9)


@given(scenes(most=3), scenes(most=3))
@settings(deadline=None, max_examples=15)
def test_two_scenes_compare_as_their_definition_says(first, second):
    template, argument = sorted((first, second), key=len)
    histograms = [oracle.descriptor(scene, 24) for scene in (template, argument)]
    assume(all(row.any() for each in histograms for row in each.values()))
    expected = oracle.relation_table(*histograms)
    constant = ConstantForce(ConstantForce.Params(directions=24))
    table = related(*(finish(describe(scene, constant)) for scene in (template, argument)))
    objects = len(argument)
    for c in range(objects):
        for d in range(objects):
            if c != d:
                column = oracle.correspondence(c + 1, d + 1, objects)
                for i in range(table.template_pairs):
                    assert_entry(look_up(table, i, (c, d)), expected[i, column])


@given(st.integers(0, 2**32), st.sampled_from([0.0, 1.0, 2.0]), st.sampled_from([4, 8, 12, 180]))
@settings(deadline=None, max_examples=60)
def test_histograms_of_any_force_compare_as_the_definition_says(seed, exponent, directions):
    rng = np.random.default_rng(seed)
    objects = sorted(rng.integers(2, 5, 2))
    template, argument = (
        SceneDescriptor(rng.random((pair_count(n), directions)) ** 4, n, exponent) for n in objects
    )
    table = related(template, argument)
    for i, row in enumerate(template.histograms):
        for j, other in enumerate(argument.histograms):
            entry = (table.similarity[i, j], table.rotation[i, j], table.dilation[i, j])
            assert_entry(entry, oracle.relation(row, other, exponent))
    assert ((table.rotation >= 0.0) & (table.rotation < math.tau)).all()
    assert ((table.similarity >= 0.0) & (table.similarity <= 1.0)).all()


@pytest.mark.parametrize("exponent", [0.0, 2.0])
@pytest.mark.parametrize("steps", [0, 1, 47, 179])
def test_a_turned_and_scaled_histogram_is_found_equal(exponent, steps):
    row = np.random.default_rng(1).random(180)
    grown = 2.5 ** (3.0 - exponent) * np.roll(row, steps)
    table = related(SceneDescriptor([row], 2, exponent), SceneDescriptor([grown], 2, exponent))
    assert table.similarity[0, 0] == pytest.approx(1.0, abs=1e-12)
    assert table.dilation[0, 0] == pytest.approx(2.5, rel=1e-12)
    apart = math.remainder(table.rotation[0, 0] - math.radians(2.0 * steps), math.tau)
    assert apart == pytest.approx(0.0, abs=1e-9)


def test_an_empty_histogram_compares_with_none():
    template = SceneDescriptor([[0.0] * 4, [1.0, 2, 0, 0], [3.0, 1, 0, 0]], 3, 0.0)
    argument = SceneDescriptor([[1.0, 2, 0, 0], [0.0] * 4, [0.0, 1, 2, 0]], 3, 0.0)
    table = related(template, argument)
    for array, nothing in ((table.similarity, 0), (table.rotation, 0), (table.dilation, 1)):
        assert array[0].tolist() == [nothing] * 3
        assert array[:, 1].tolist() == [nothing] * 3
    assert table.similarity[1, 0] == pytest.approx(1.0)
    assert table.similarity[1, 2] == pytest.approx(1.0)
    assert table.rotation[1, 2] == pytest.approx(math.pi / 2)


def test_descriptors_are_left_as_they_were():
    rows = np.random.default_rng(0).random((3, 12))
    template, argument = SceneDescriptor(rows, 3, 0.0), SceneDescriptor(rows, 3, 0.0)
    related(template, argument)
    assert (template.histograms == rows).all()
    assert (argument.histograms == rows).all()
