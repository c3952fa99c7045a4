"""The numbering of pairs, descriptors and relation tables."""

import math

import numpy as np
import pytest

from sketchmatch.model import (
    DILATION_SCALE,
    RelationTable,
    SceneDescriptor,
    object_pairs,
    pair_count,
    pair_index,
)
from tests.oracle.relations import correspondence


@pytest.mark.parametrize("objects", [2, 3, 4, 7, 20])
def test_pairs_are_numbered_as_in_the_thesis(objects):
    numbered = {
        (a, b): pair_index(a, b, objects) for a in range(objects) for b in range(a + 1, objects)
    }
    assert sorted(numbered.values()) == list(range(pair_count(objects)))
    for (a, b), index in numbered.items():
        assert index == correspondence(a + 1, b + 1, objects)
        assert object_pairs(objects)[index].tolist() == [a, b]


def test_the_dilation_scale_is_that_of_the_thesis():
    assert pytest.approx(2.164, abs=5e-4) == DILATION_SCALE


def test_a_descriptor_turns_a_histogram_by_half_for_its_dual():
    rows = np.arange(12.0).reshape(3, 4)
    descriptor = SceneDescriptor(rows, 3, 0.0)
    assert descriptor.directions == 4
    assert descriptor.histogram(0, 2).tolist() == [4, 5, 6, 7]
    assert descriptor.histogram(2, 0).tolist() == [6, 7, 4, 5]


def test_a_descriptor_needs_a_histogram_for_each_pair():
    with pytest.raises(ValueError, match="each pair"):
        SceneDescriptor(np.ones((2, 4)), 3, 0.0)


def test_a_table_gives_what_the_confidence_needs():
    table = RelationTable([[0.5]], [[math.pi / 2]], [[2.0]], 2, 2)
    assert (table.template_pairs, table.argument_pairs) == (1, 1)
    assert table.normalized_dilation[0, 0] == pytest.approx(1.5)
    assert table.cosine[0, 0] == pytest.approx(0.0)
    assert table.sine[0, 0] == pytest.approx(1.0)


@pytest.mark.parametrize(
    "values",
    [
        ([[0.5]], [[0.0]], [[1.0]], 3, 2),
        ([[0.5]], [[0.0]], [[1.0]], 1, 2),
        ([[0.5, 0.5]], [[0.0]], [[1.0]], 2, 2),
        ([[0.5]], [[0.0]], [[1.0]], 2, 3),
    ],
)
def test_a_table_of_another_shape_is_refused(values):
    with pytest.raises(ValueError, match=r"shape|objects"):
        RelationTable(*values)


def test_values_cannot_be_written_to():
    table = RelationTable([[0.5]], [[0.0]], [[1.0]], 2, 2)
    for array in (
        table.similarity,
        table.rotation,
        table.dilation,
        table.normalized_dilation,
        table.cosine,
        table.sine,
        SceneDescriptor([[1.0, 0.0]], 2, 0.0).histograms,
    ):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 9.0
