"""The ``cross-correlation`` similarity."""

import numpy as np
import pytest

from sketchmatch.pipeline.selection import resolve
from sketchmatch.registry import Kind, default_registry
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation
from tests.oracle.relations import cross_correlation


def compare(first, second):
    return CrossCorrelation().compare(np.array(first, float), np.array(second, float))


def test_it_is_registered_and_the_default():
    found = default_registry().find(Kind.SIMILARITY, "cross-correlation").algorithm
    assert found is CrossCorrelation
    assert isinstance(resolve(default_registry(), {}).similarity, CrossCorrelation)


def test_values_by_hand():
    first = [[1, 0, 0, 0], [1, 1, 0, 0], [3, 4, 0, 0], [1, 2, 3, 4]]
    second = [[0, 2, 0, 0], [5, 0, 0, 0], [4, 3, 0, 0], [2, 4, 6, 8]]
    assert compare(first, second) == pytest.approx([0.0, 0.5**0.5, 24 / 25, 1.0])


def test_it_agrees_with_the_definition_row_by_row():
    first, second = np.random.default_rng(0).random((2, 20, 180))
    expected = [cross_correlation(x, y) for x, y in zip(first, second, strict=True)]
    assert compare(first, second) == pytest.approx(expected, rel=1e-9)


def test_equal_rows_never_exceed_one():
    rows = np.random.default_rng(1).random((500, 7)) * np.logspace(-8, 8, 500)[:, None]
    found = compare(rows, rows)
    assert found == pytest.approx(1.0, abs=1e-12)
    assert found.max() <= 1.0


def test_inputs_are_left_alone():
    rows = np.random.default_rng(2).random((3, 8))
    rows.flags.writeable = False
    before = rows.copy()
    CrossCorrelation().compare(rows, rows)
    assert (rows == before).all()
