"""The relation table against a comparison of histograms one by one, however it is computed."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sketchmatch.api import Alignment, Similarity
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import SceneDescriptor, pair_count
from sketchmatch.pipeline import relate as relate_module
from sketchmatch.pipeline import slices
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.slices import finish
from sketchmatch_builtin.histograms.constant import ConstantForce
from sketchmatch_builtin.similarities.circular_peak import CircularPeak
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation
from sketchmatch_builtin.similarities.pappis import Pappis
from tests.interpreted import compiled_only, examples
from tests.oracle import relations as oracle
from tests.oracle.maps import look_up
from tests.strategies import scenes


class RowByRow(Similarity):
    """The cross-correlation of rows that the host aligns and hands over."""

    def compare(self, aligned, argument):
        return CrossCorrelation().compare(aligned, argument)


class RowByRowAtPeak(RowByRow):
    alignment = Alignment.PEAK


class PappisAtPeak(Pappis):
    alignment = Alignment.PEAK


def related(template, argument, similarity=CrossCorrelation):
    return finish(relate(template, argument, similarity()))


def descriptor(rows, exponent=0.0):
    """Return the descriptor of a made-up scene that has all of some histograms."""
    objects = next(n for n in range(2, 100) if pair_count(n) >= len(rows))
    missing = pair_count(objects) - len(rows)
    return SceneDescriptor(np.concatenate([rows, rows[:1].repeat(missing, 0)]), objects, exponent)


def awkward_histograms(directions):
    """Return spikes of one and two bins, also over the wrap, nearly flat ones, and nothing."""
    rows = [np.zeros(directions), np.ones(directions)]
    for k in (0, 1, directions // 2, directions - 1):
        rows += [np.roll(np.eye(1, directions)[0], k)]
        rows += [rows[-1] + share * np.roll(rows[-1], 1) for share in (1e-9, 0.3, 1.0)]
    rows += [np.ones(directions) + 1e-9 * row for row in rows[2:5]]
    rows += [1e-200 * rows[4], 1e200 * rows[5], 1.0 + np.cos(np.arange(directions))]
    return np.array(rows)


def assert_entry(found, expected):
    """Compare (σ, R, L) of the engine with those of the oracle."""
    sigma, rotation, dilation = expected
    assert found[0] == pytest.approx(sigma, rel=1e-9)
    assert math.remainder(found[1] - rotation, math.tau) == pytest.approx(0.0, abs=1e-9)
    assert found[2] == pytest.approx(dilation, rel=1e-9)


@pytest.mark.slow
@given(scenes(most=3), scenes(most=3))
@examples(15)
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
@examples(60)
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


@pytest.mark.parametrize("similarity", [CrossCorrelation, RowByRow, Pappis])
def test_a_turn_backwards_by_less_than_a_rounding_is_none(similarity):
    template, argument = np.array([[1.0, 1e-20, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0, 0.0]])
    table = related(descriptor(template), descriptor(argument), similarity)
    assert table.rotation.tolist() == [[0.0]]
    assert table.similarity[0, 0] == pytest.approx(1.0)


TWINS = {"main": (CrossCorrelation, RowByRow), "peak": (CircularPeak, RowByRowAtPeak)}


@pytest.mark.parametrize(("quick", "slow"), TWINS.values(), ids=TWINS)
@pytest.mark.parametrize(
    "directions",
    [4, 6, 36, pytest.param(180, marks=compiled_only), pytest.param(3600, marks=compiled_only)],
)
def test_products_of_matrices_give_what_comparing_row_by_row_gives(quick, slow, directions):
    rng = np.random.default_rng(directions)
    scenes_ = [
        descriptor(awkward_histograms(directions)),
        descriptor(rng.random((21, directions)) ** 8),
        SceneDescriptor(rng.random((pair_count(9), directions)) ** 2, 9, 0.0),
    ]
    for template, argument in [(0, 0), (0, 1), (1, 1), (1, 2), (0, 2)]:
        pair = sorted((scenes_[template], scenes_[argument]), key=lambda each: each.objects)
        one, other = related(*pair, quick), related(*pair, slow)
        np.testing.assert_allclose(one.similarity, other.similarity, rtol=0, atol=1e-12)
        assert (one.rotation == other.rotation).all()
        assert (one.dilation == other.dilation).all()
        assert one.similarity.min() >= 0.0
        assert one.similarity.max() <= 1.0


@pytest.mark.slow
@pytest.mark.parametrize("directions", [4, 12, 24])
def test_the_peak_is_the_best_of_all_rotations(directions):
    rng = np.random.default_rng(directions)
    template, argument = (
        SceneDescriptor(rng.random((3, directions)) ** power, 3, 0.0) for power in (2, 6)
    )
    table = related(template, argument, CircularPeak)
    shapes = related(template, argument, PappisAtPeak)
    for i, row in enumerate(template.histograms):
        for j, other in enumerate(argument.histograms):
            best, rotation, _ = oracle.relation(row, other, rotation_of=oracle.peak_rotation)
            lags = [oracle.cross_correlation(np.roll(row, k), other) for k in range(directions)]
            assert table.similarity[i, j] == pytest.approx(best, abs=1e-12)
            assert table.similarity[i, j] >= max(lags) - 1e-12
            # The peak is flat: its place is known to half as many digits as its height.
            apart = math.remainder(table.rotation[i, j] - rotation, math.tau)
            assert apart == pytest.approx(0.0, abs=1e-6)
            assert shapes.rotation[i, j] == table.rotation[i, j]
            turned = oracle.turned(row / row.mean(), table.rotation[i, j])
            expected = oracle.pappis(turned, other / other.mean())
            assert shapes.similarity[i, j] == pytest.approx(expected, rel=1e-9)


def test_the_peak_lies_between_bins_where_that_is_better():
    row = np.array([0.0, 4, 2, 1, 0, 0, 0, 0])
    between = 0.3 * np.roll(row, 3) + 0.7 * np.roll(row, 4)
    table = related(descriptor(row[None]), descriptor(between[None]), CircularPeak)
    assert table.similarity[0, 0] == pytest.approx(1.0, abs=1e-12)
    assert table.rotation[0, 0] == pytest.approx(math.tau * 3.7 / 8, abs=1e-7)


@pytest.mark.parametrize("similarity", [CrossCorrelation, CircularPeak, Pappis])
@given(st.integers(0, 2**32), st.integers(0, 35))
@examples(15)
def test_turning_the_template_by_bins_shifts_the_rotation_alone(similarity, seed, steps):
    first, second = np.random.default_rng(seed).random((2, 6, 36)) ** 3
    before = related(descriptor(first), descriptor(second), similarity)
    rolled = descriptor(np.roll(first, steps, axis=1))
    after = related(rolled, descriptor(second), similarity)
    np.testing.assert_allclose(after.similarity, before.similarity, atol=1e-9)
    shift = np.exp(1j * (before.rotation - after.rotation - math.tau * steps / 36))
    np.testing.assert_allclose(shift, 1.0, atol=1e-6)


@pytest.mark.parametrize("similarity", [CrossCorrelation, CircularPeak, Pappis])
@pytest.mark.parametrize("factor", [1e-300, 1e-200, 1e200, 1e300])
def test_the_unit_of_force_plays_no_part(similarity, factor):
    first, second = np.random.default_rng(4).random((2, 6, 36))
    before = related(descriptor(first), descriptor(second), similarity)
    after = related(descriptor(factor * first), descriptor(factor * second), similarity)
    for name in ("similarity", "rotation", "dilation"):
        np.testing.assert_allclose(getattr(after, name), getattr(before, name), rtol=1e-9)


@pytest.mark.parametrize("exponent", [2.5, -40.0, 3.5])
def test_dilations_are_finite_and_positive_whatever_the_sizes(exponent):
    rows = np.array([[5e-324, 0.0, 0.0, 0.0], [1e308, 1e308, 1e308, 0.0], [1.0, 2.0, 3.0, 4.0]])
    table = related(descriptor(rows, exponent), descriptor(rows, exponent))
    assert np.isfinite(table.dilation).all()
    assert (table.dilation > 0.0).all()
    assert np.isfinite(table.normalized_dilation).all()
    assert np.diag(table.dilation).tolist() == [1.0] * 3


@pytest.mark.parametrize("exponent", [2.51, 3.0, 3.49, math.nan])
def test_forces_that_do_not_change_with_size_are_refused(exponent):
    rows = np.ones((1, 4))
    with pytest.raises(InvalidInputError, match=r"choose r at most 2\.5 or at") as raised:
        related(descriptor(rows, exponent), descriptor(rows, exponent))
    assert raised.value.reason is Reason.INVALID_PARAMETER
    assert raised.value.field == "pipeline.histogram"


@pytest.mark.parametrize("similarity", [CrossCorrelation, CircularPeak, Pappis])
def test_the_table_does_not_depend_on_the_threads_or_the_slices(similarity, monkeypatch):
    rng = np.random.default_rng(3)
    scenes_ = [SceneDescriptor(rng.random((pair_count(n), 180)), n, 0.0) for n in (9, 12)]
    expected = related(*scenes_, similarity)
    monkeypatch.setattr(slices, "_SLICE_SECONDS", 1e-3)
    for cpus in (1, 4):
        monkeypatch.setattr(slices, "usable_cpus", lambda cpus=cpus: cpus)
        found = related(*scenes_, similarity)
        for name in ("similarity", "rotation", "dilation"):
            assert (getattr(found, name) == getattr(expected, name)).all()


@pytest.mark.parametrize("similarity", [CrossCorrelation, CircularPeak, Pappis])
def test_a_table_in_panels_is_the_same_but_for_rounding(similarity, monkeypatch):
    rng = np.random.default_rng(3)
    template, argument = (descriptor(rng.random((count, 36)) ** 3) for count in (6, 45))
    expected = related(template, argument, similarity)
    monkeypatch.setattr(relate_module, "_PANEL_VALUES", 36 * 20)
    shares = list(relate(template, argument, similarity()))
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    found = related(template, argument, similarity)
    for name in ("similarity", "rotation", "dilation"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-12)


@compiled_only
@pytest.mark.parametrize("similarity", [CrossCorrelation, CircularPeak, Pappis])
@pytest.mark.parametrize("directions", [36, 180, 240, 720])
def test_a_row_is_the_same_to_the_last_digit_whichever_rows_come_with_it(directions, similarity):
    rng = np.random.default_rng(directions)
    argument = descriptor(rng.random((66, directions)) ** 3)
    rows = rng.random((28, directions)) ** 3
    whole = related(descriptor(rows), argument, similarity)
    for count in (1, 3, 6, 10, 15, 21):
        some = rng.permutation(28)[:count]
        part = related(descriptor(rows[some]), argument, similarity)
        for name in ("similarity", "rotation", "dilation"):
            assert (getattr(part, name) == getattr(whole, name)[some]).all()


@pytest.mark.parametrize("similarity", [CrossCorrelation, CircularPeak, Pappis])
def test_known_rows_are_taken_as_they_are_and_the_others_computed(similarity):
    rng = np.random.default_rng(5)
    template, argument = (descriptor(rng.random((count, 36)) ** 3) for count in (10, 15))
    expected = related(template, argument, similarity)
    known = rng.random(10) < 0.5
    entries = tuple(np.where(known[:, None], 0.5, np.nan) * np.ones((10, 15)) for _ in range(3))
    found = finish(relate(template, argument, similarity(), (known, entries)))
    for name in ("similarity", "rotation", "dilation"):
        assert (getattr(found, name)[known] == 0.5).all()
        assert (getattr(found, name)[~known] == getattr(expected, name)[~known]).all()


@compiled_only
@pytest.mark.parametrize("similarity", [CrossCorrelation, CircularPeak, Pappis])
def test_large_tables_come_in_slices(similarity):
    rng = np.random.default_rng(3)
    wide = SceneDescriptor(rng.random((pair_count(200), 180)), 200, 0.0)
    narrow = SceneDescriptor(rng.random((1, 180)), 2, 0.0)
    shares = list(relate(narrow, wide, similarity()))
    assert len(shares) >= 3
    assert shares[-1] == 1.0


def test_descriptors_are_left_as_they_were():
    rows = np.random.default_rng(0).random((3, 12))
    template, argument = SceneDescriptor(rows, 3, 0.0), SceneDescriptor(rows, 3, 0.0)
    related(template, argument)
    assert (template.histograms == rows).all()
    assert (argument.histograms == rows).all()
