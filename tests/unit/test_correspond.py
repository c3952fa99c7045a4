"""From a histogram map to the object map: evidence, ties, Ω, and the turn and scale of all."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.kernels import confidence as kernels
from sketchmatch.model import Fmap, Occm, RelationTable
from sketchmatch.pipeline.correspond import (
    confidence_relations,
    fmap_confidence,
    global_dilation,
    global_rotation,
    map_confidence,
    object_map,
    occm,
)
from sketchmatch.pipeline.unmatched import omission_confidences
from tests.interpreted import examples
from tests.oracle import maps as oracle
from tests.strategies import tables, tables_and_object_maps

checked = examples(120)


def table_of(similarity, template_objects, argument_objects, rotation=0.0, dilation=1.0):
    similarity = np.array(similarity, dtype=float)
    ones = np.ones_like(similarity)
    return RelationTable(
        similarity, rotation * ones, dilation * ones, template_objects, argument_objects
    )


def test_the_example_of_the_thesis():
    # Figure 3.8, whose evidence is divided by N(N−1) to give Ω.
    table = table_of(np.diag([0.76, 0.81, 0.85]), 3, 3)
    matrix = occm(Fmap(np.array([0, 1, 2])), table)
    expected = [[1.57, 0.76, 0.81], [0.76, 1.61, 0.85], [0.81, 0.85, 1.66]]
    np.testing.assert_allclose(matrix.evidence, expected, rtol=1e-12)
    mapped = object_map(matrix)
    assert mapped.partners.tolist() == [0, 1, 2]
    assert mapped.confidence == pytest.approx(0.806, abs=7e-4)
    assert mapped.confidence == pytest.approx((1.57 + 1.61 + 1.66) / 6, rel=1e-12)
    assert mapped.confidences == pytest.approx([1.57 / 2, 1.61 / 2, 1.66 / 2])


@given(st.data(), tables())
@checked
def test_evidence_and_object_map_agree_with_loops_on_any_fmap(data, table):
    # Sixteenths add up without rounding, so that ties are true ties.
    similarity = np.round(16 * table.similarity) / 16
    table = RelationTable(
        similarity, table.rotation, table.dilation, table.template_objects, table.argument_objects
    )
    correspondences = st.integers(0, 2 * table.argument_pairs - 1)
    size = table.template_pairs
    entries = data.draw(st.lists(correspondences, min_size=size, max_size=size))
    evidence, implied = oracle.occm(table, oracle.read(entries, table.argument_objects))
    matrix = occm(Fmap(np.array(entries)), table)
    assert matrix.evidence.tolist() == [[float(x) for x in row] for row in evidence]
    assert matrix.implied.tolist() == [[float(x) for x in row] for row in implied]
    partners, omega = oracle.object_map(evidence, implied)
    mapped = object_map(matrix)
    assert mapped.partners.tolist() == partners
    assert mapped.confidence == pytest.approx(omega, rel=1e-9)


@given(tables_and_object_maps())
@checked
def test_an_object_consistent_fmap_gives_its_object_map_and_omega_is_its_mean_similarity(given_):
    table, partners = given_
    fmap = Fmap.from_object_map(partners, table.argument_objects)
    mapped = object_map(occm(fmap, table))
    assert mapped.partners.tolist() == partners.tolist()
    assert mapped.confidence == pytest.approx(fmap_confidence(fmap, table).similarity, rel=1e-12)
    assert mapped.confidences.max() <= 1.0


@pytest.mark.parametrize("partners", [(0, 1), (1, 0), (2, 0), (1, 2)])
def test_of_two_objects_the_order_of_the_one_entry_decides(partners):
    # All four cells hold the same evidence.
    table = table_of([[0.3, 0.3, 0.3]], 2, 3)
    mapped = object_map(occm(Fmap.from_object_map(np.array(partners), 3), table))
    assert mapped.partners.tolist() == list(partners)


def test_a_tie_that_no_order_decides_goes_to_the_lower_index():
    even = Occm(np.ones((2, 3)), np.ones((2, 3)))
    assert object_map(even).partners.tolist() == [0, 1]


def test_a_tie_holds_though_sums_round_differently():
    evidence = np.array([[0.1 + 0.2, 0.3], [0.0, 0.0]])
    assert evidence[0, 0] != evidence[0, 1]
    implied = np.array([[0.0, 0.3], [0.0, 0.0]])
    assert object_map(Occm(evidence, implied)).partners.tolist() == [1, 0]


@given(tables_and_object_maps())
@checked
def test_turn_and_scale_of_the_whole_are_those_of_the_entries(given_):
    table, partners = given_
    fmap = Fmap.from_object_map(partners, table.argument_objects)
    entries = [
        oracle.look_up(table, i, pair)
        for i, pair in enumerate(oracle.read(fmap.entries, table.argument_objects))
    ]
    total = sum(
        count * complex(math.cos(r), math.sin(r))
        for count, (_, r, _) in zip(table.rotation_weights.tolist(), entries, strict=True)
    )
    found = global_rotation(fmap, table)
    if abs(total) > 1e-3:
        apart = found - math.atan2(total.imag, total.real)
        assert math.remainder(apart, math.tau) == pytest.approx(0.0, abs=1e-9)
    levels = sorted(dilation for _, _, dilation in entries)
    middle = (levels[(len(levels) - 1) // 2] + levels[len(levels) // 2]) / 2
    assert global_dilation(fmap, table) == pytest.approx(middle)


def test_duals_count_with_their_half_turn():
    table = table_of([[1.0]], 2, 2, rotation=math.radians(30), dilation=2.5)
    assert global_rotation(Fmap(np.array([0])), table) == pytest.approx(math.radians(30))
    assert global_rotation(Fmap(np.array([1])), table) == pytest.approx(math.radians(-150))
    assert global_dilation(Fmap(np.array([1])), table) == pytest.approx(2.5)


def test_the_sines_of_a_whole_table_are_not_needed_for_one_map():
    random = np.random.default_rng(0)
    table = RelationTable(*random.uniform(0.1, 0.9, (3, 6, 10)), 4, 5)
    partners = np.array([2, 0, 4, 1])
    fmap = Fmap.from_object_map(partners, 5)
    global_rotation(fmap, table)
    omission_confidences(fmap, table, (1.0, 1.0, 1.0))
    whole = map_confidence(partners, table)
    map_confidence(np.array([2, -1, 4, 1]), table)
    assert not {"cosine", "sine", "normalized_dilation"} & vars(table).keys()
    relations = confidence_relations(table, (1.0, 1.0, 1.0))
    expected = kernels.fmap_confidence(fmap.entries, np.empty(6), *relations)
    assert (whole.total, whole.similarity, whole.rotation, whole.dilation) == pytest.approx(
        expected
    )
