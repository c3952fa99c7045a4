"""What the caller knows of objects: read for two scenes, and refused where it cannot be."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch import Scene
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.pipeline.knowledge import (
    Pin,
    check_pins,
    check_pins_obeyed,
    check_synonyms,
    knowledge,
    matching,
)
from sketchmatch_builtin.searchers.auto import Auto
from sketchmatch_builtin.searchers.fsnn_pso import FsnnPso


def scene(*labels):
    lefts = range(0, 3 * len(labels), 3)
    return Scene.from_polygons([[(x, 0), (x + 1, 0), (x, 1)] for x in lefts], labels)


SKETCH = scene("Desk", "chair", "chair 2", "")
MAP = scene("desk", "sofa", "Chair", "chair", "lamp")


def known(*pins, sketch=SKETCH, map_=MAP, swapped=False, partial=False, synonyms=()):
    return knowledge(pins, synonyms, (sketch, map_), swapped, partial)


def refused(*pins, **scenes):
    with pytest.raises(InvalidInputError) as error:
        known(*pins, **scenes)
    assert error.value.reason is Reason.INVALID_FIELD
    return str(error.value)


def test_nothing_known_rules_nothing_out():
    found = known()
    assert found.allowed is None
    assert found.pinned is None
    assert found.names[0].tolist() == [1, -1, -1, -1, -1]
    assert known(sketch=scene("", "", "")).names is None


def test_a_pin_rules_out_every_other_pairing_of_both_objects():
    found = known(Pin("desk", 1))
    assert found.pinned.tolist() == [1, -1, -1, -1]
    assert found.allowed.astype(int).tolist() == [
        [0, 1, 0, 0, 0],
        [1, 0, 1, 1, 1],
        [1, 0, 1, 1, 1],
        [1, 0, 1, 1, 1],
    ]
    assert not found.allowed.flags.writeable


def test_an_exclusion_rules_out_one_pairing_and_none_all_of_an_object():
    found = known(Pin(1, 4, excluded=True), Pin(3, None), partial=True)
    assert found.pinned.tolist() == [-1] * 4
    assert (~found.allowed).nonzero()[0].tolist() == [1, 3, 3, 3, 3, 3]
    assert not found.allowed[1, 4]


def test_labels_find_their_object_by_case_where_that_is_all_they_differ_in():
    assert known(Pin("CHAIR 2", "chair")).pinned.tolist() == [-1, -1, 3, -1]
    assert known(Pin("CHAIR 2", "Chair")).pinned.tolist() == [-1, -1, 2, -1]


def test_from_template_to_argument_where_the_map_is_the_template():
    found = known(Pin(0, "desk"), Pin("lamp", None), sketch=MAP, map_=SKETCH, swapped=True)
    assert found.pinned.tolist() == [0, -1, -1, -1]
    assert found.allowed.astype(int).tolist() == [[1, 0, 0, 0, 0], *[[0, 1, 1, 1, 0]] * 3]
    assert found.names.shape == (4, 5)


def test_what_is_said_twice_or_follows_is_no_contradiction():
    found = known(Pin(0, 0), Pin("desk", "desk"), Pin(0, 1, excluded=True))
    assert found.pinned.tolist() == [0, -1, -1, -1]


@pytest.mark.parametrize(
    ("pins", "sentence"),
    [
        (
            [Pin("bed", 0)],
            "pins[0].sketch_object names 'bed', but the labels of the sketch are 'Desk', 'chair', "
            "'chair 2'; give one of these, or a number",
        ),
        (
            [Pin(0, "CHAIR")],
            "pins[0].map_object names 'CHAIR', the label of 2 objects of the map; give the number "
            "of the one that is meant",
        ),
        ([Pin(4, 0)], "pins[0].sketch_object names an object beyond the 4 of the sketch; name"),
        ([Pin(0, 0), Pin(0, 5)], "pins[1].map_object names an object beyond the 5 of the map"),
        (
            [Pin(0, 0), Pin("desk", 1)],
            "pins[1].map_object contradicts pins[0], which gives the same sketched object another "
            "partner or none; drop one of the two",
        ),
        ([Pin(0, 0), Pin(0, None)], "pins[1].map_object contradicts pins[0], which gives the same"),
        ([Pin(0, None), Pin(0, 0)], "pins[1].map_object contradicts pins[0], which gives the same"),
        (
            [Pin(1, 2), Pin(0, "Chair")],
            "pins[1].map_object is the partner of another sketched object in pins[0]; drop one",
        ),
        (
            [Pin(0, 2, excluded=True), Pin(1, 1), Pin(0, "Chair")],
            "pins[0].excluded contradicts pins[2], which gives the sketched object this partner",
        ),
        (
            [Pin(1, 0), Pin(0, None), Pin(3, None)],
            "pins[1].map_object says that the object is not on the map, but every object of the "
            "sketch must find a partner; allow unmatched objects or drop the pin",
        ),
        (
            [Pin(0, k, excluded=True) for k in range(5)],
            "pins leave no object map in which every object of the sketch has a partner; "
            "drop some or allow unmatched objects",
        ),
    ],
)
def test_what_cannot_be_is_refused_by_field(pins, sentence):
    assert refused(*pins).startswith(sentence)


def test_labels_that_are_many_or_none_are_told_in_short():
    many = scene(*(f"thing {k}" for k in "abcdefghij"))
    assert "'thing g', 'thing h', …; give one of these" in refused(Pin(0, "x"), map_=many)
    unnamed = scene("", "", "", "")
    assert refused(Pin("x", 0), sketch=unnamed) == (
        "pins[0].sketch_object names 'x', but no object of the sketch has a label; give its number"
    )


def test_two_objects_that_only_one_may_take_leave_no_map_unless_one_may_stay_alone():
    pins = [Pin(a, c, excluded=True) for a in (0, 1) for c in range(1, 5)]
    assert refused(*pins).startswith("pins leave no object map in which every object of the sketch")
    assert known(*pins, partial=True).allowed.sum() == 12


def test_at_least_three_objects_find_a_partner():
    alone = [Pin(a, None) for a in range(4)]
    assert known(*alone[:1], partial=True).allowed.sum() == 15
    assert refused(*alone[:2], partial=True) == (
        "pins leave no object map in which 3 objects have a partner, which is the least "
        "that an answer needs; drop some"
    )


def test_a_larger_sketch_may_leave_out_as_many_as_it_has_more():
    scenes = {"sketch": MAP, "map_": SKETCH, "swapped": True}
    assert known(Pin(0, None), **scenes).allowed.sum() == 16
    assert refused(Pin(0, None), Pin(1, None), **scenes) == (
        "pins leave no object map in which every object of the map has a partner; "
        "drop some or allow unmatched objects"
    )


@pytest.mark.parametrize(
    ("pins", "sentence"),
    [
        (5, "pins is 5; give pins"),
        ("desk", "pins is 'desk'; give pins"),
        ([(0, 1)], "pins[0] is (0, 1); give a Pin"),
        ([Pin(0, 1), Pin(-1, 0)], "pins[1].sketch_object is -1; objects are counted from 0"),
        ([Pin(True, 1)], "pins[0].sketch_object is True; give a label or the number of an"),
        ([Pin(0.5, 1)], "pins[0].sketch_object is 0.5; give a label or the number of an"),
        ([Pin(None, 1)], "pins[0].sketch_object is None; give a label or the number of an"),
        ([Pin(0, " \t")], "pins[0].map_object is an empty label; give a label or the number"),
        ([Pin(0, 1, excluded=1)], "pins[0].excluded is 1; give True or False"),
        ([Pin(0, None, True)], "pins[0].map_object is not set, though the pin excludes one; name"),
    ],
)
def test_what_is_no_pin_is_refused(pins, sentence):
    with pytest.raises(InvalidInputError) as error:
        check_pins(pins)
    assert str(error.value).startswith(sentence)


@pytest.mark.parametrize(
    ("synonyms", "sentence"),
    [
        ("couch", "synonyms is 'couch'; give groups of labels"),
        (["couch"], "synonyms[0].labels is 'couch'; give labels"),
        ([("a", "b"), ("couch",)], "synonyms[1].labels are fewer than two; give at least two"),
        ([("couch", "")], "synonyms[0].labels hold ''; give labels that are not empty"),
        ([("couch", 5)], "synonyms[0].labels hold 5; give labels that are not empty"),
        (
            [("a", "b")] * 251,
            "synonyms hold more than 500 labels in all; give only labels of these",
        ),
    ],
)
def test_what_are_no_synonyms_is_refused(synonyms, sentence):
    with pytest.raises(InvalidInputError) as error:
        check_synonyms(synonyms)
    assert str(error.value).startswith(sentence)


def test_synonyms_reach_the_names():
    assert known(synonyms=[("lamp", "desk")]).names[0].tolist() == [1, -1, -1, -1, 1]


def test_searchers_of_pairs_refuse_pins():
    check_pins_obeyed([Pin(0, 0)], Auto())
    check_pins_obeyed([], FsnnPso())
    with pytest.raises(
        InvalidInputError, match=r"^pins need a searcher that finds one object map, which 'fsnn-p"
    ):
        check_pins_obeyed([Pin(0, 0)], FsnnPso())


@given(seed=st.integers(0, 2**32 - 1), few=st.integers(1, 4), more=st.integers(0, 2))
def test_a_matching_leaves_out_as_few_as_any_map(seed, few, more):
    rng = np.random.default_rng(seed)
    allowed = rng.random((few, few + more)) < rng.random()
    found = matching(allowed, rng.random(allowed.shape))
    kept = np.flatnonzero(found >= 0)
    assert len(set(found[kept])) == len(kept)
    assert allowed[kept, found[kept]].all()
    every = itertools.permutations(range(few + more), few)
    assert len(kept) == max(sum(allowed[a, c] for a, c in enumerate(p)) for p in every)


def test_a_chain_of_a_thousand_objects_moves_up_by_one():
    # Each may take its own or the next, the last one the first alone, which all before hold.
    count = 1100
    allowed = np.eye(count, count, dtype=bool) | np.eye(count, count, 1, dtype=bool)
    allowed[-1] = np.arange(count) == 0
    preferred = np.eye(count)[:, ::1] + np.arange(count, 0, -1)[:, None]
    assert matching(allowed, preferred).tolist() == [*range(1, count), 0]
