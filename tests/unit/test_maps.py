"""FMAPs and what they mean for objects."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.model import Fmap, ObjectMap, Occm
from tests.interpreted import examples
from tests.oracle import maps as oracle


@given(st.data())
@examples(60)
def test_an_object_map_induces_the_fmap_of_its_ordered_pairs(data):
    argument = data.draw(st.integers(2, 12))
    template = data.draw(st.integers(2, argument))
    partners = data.draw(st.permutations(range(argument)))[:template]
    fmap = Fmap.from_object_map(np.array(partners), argument)
    assert oracle.read(fmap.entries, argument) == oracle.induced(partners)
    assert oracle.is_pairwise_legal(oracle.induced(partners))
    assert oracle.is_object_legal(oracle.induced(partners), template)


@given(st.data())
@examples(60)
def test_an_entry_reads_as_an_ordered_pair(data):
    argument = data.draw(st.integers(2, 12))
    count = argument * (argument - 1)
    entries = data.draw(st.lists(st.integers(0, count - 1), min_size=1, max_size=6))
    fmap = Fmap(np.array(entries))
    read = [fmap.object_pair(i, argument) for i in range(len(entries))]
    assert read == oracle.read(entries, argument)


def test_the_oracle_tells_legal_from_illegal():
    assert not oracle.is_pairwise_legal([(0, 1), (1, 0), (1, 2)]), "a pair and its dual"
    assert not oracle.is_pairwise_legal([(0, 1), (0, 1), (1, 2)]), "one pair twice"
    assert oracle.is_pairwise_legal([(0, 1), (1, 2), (0, 2)])
    assert not oracle.is_object_legal([(0, 1), (1, 2), (0, 2)], 3), "b is both 1 and 2"
    assert oracle.is_object_legal([(2, 0), (2, 1), (0, 1)], 3)


def test_maps_cannot_be_written_to():
    fmap = Fmap(np.array([0]))
    matrix = Occm(np.eye(2), np.eye(2))
    mapped = ObjectMap(np.array([1, 0]), np.array([0.5, 0.5]), 0.5)
    for array in (
        fmap.entries,
        matrix.evidence,
        matrix.implied,
        mapped.partners,
        mapped.confidences,
    ):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
