"""Objects of many polygons at once: each is what it would be alone, and so is each refusal."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sketchmatch.errors import InvalidInputError
from sketchmatch.model import LabelledPolygon, SceneObject
from sketchmatch.model.outlines import _at_once, objects_of

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
HOLE = 0.5 + 0.5 * SQUARE
FAULTS = {
    "crosses itself": (SQUARE[[0, 2, 1, 3]],),
    "is flat": (SQUARE * [1.0, 1e-12],),
    "has two points": (SQUARE[:2],),
    "has two distinct points": (SQUARE[[0, 1, 0, 0]],),
    "is not finite": (np.where(SQUARE == 0.0, np.nan, SQUARE),),
    "is too far": (SQUARE + 1e16,),
    "has heights": (np.ones((4, 3)),),
    "is no list of numbers": (["a", "b", "c"],),
    "has no ring": (),
    "has a hole outside": (SQUARE, HOLE + 5.0),
    "is all hole": (SQUARE, SQUARE),
    "has nothing left": (SQUARE, 1e-10 + (1.0 - 1e-10) * SQUARE),
}


@st.composite
def sound(draw):
    """Return the rings of a star with or without a hole, as people may give them."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))

    def star(corners):
        turns = np.sort(rng.uniform(0, 0.9, corners) + np.arange(corners)) * 2 * np.pi / corners
        return np.stack([np.cos(turns), np.sin(turns)], axis=1)

    outer = star(draw(st.integers(4, 12))) * rng.uniform(0.5, 1.0)
    holes = 0.02 * (np.arange(draw(st.sampled_from([0, 0, 1, 2, 9]))) - 4.0)
    rings = [outer, *(0.009 * star(4) + [x, 0.0] for x in holes)]
    scale, place = draw(st.sampled_from([1e-6, 1.0, 3.7e8])), rng.uniform(-9, 9, 2)
    given_ = []
    for ring in rings:
        points = scale * (ring + place)
        points = points[::-1] if draw(st.booleans()) else points
        points = np.repeat(points, 1 + rng.integers(0, 2, len(points)), axis=0)
        points = np.concatenate([points, points[:1]]) if draw(st.booleans()) else points
        given_.append(
            draw(st.sampled_from([np.array, np.asfortranarray, np.ndarray.tolist]))(points)
        )
    return tuple(given_)


def one_by_one(polygons):
    for k, polygon in enumerate(polygons):
        try:
            yield SceneObject.from_rings(polygon.rings, polygon.label, polygon.certainty)
        except InvalidInputError as error:
            raise error.within(f"polygons[{k}]") from None


def told(work, polygons):
    """Return all that is known of each object, to the last digit, or how it was refused."""
    try:
        return [
            (
                [(ring.shape, ring.tobytes()) for ring in item.rings],
                item.label,
                item.certainty,
                item.area,
                item.centroid,
                item.polygon.wkb,
            )
            for item in work(polygons)
        ]
    except InvalidInputError as error:
        return str(error), error.reason, error.field


@given(st.lists(sound(), min_size=1, max_size=6), st.lists(st.sampled_from(["", "a", "b c"])))
def test_sound_polygons_become_what_each_would_alone(many, labels):
    polygons = [
        LabelledPolygon(rings, label, certainty)
        for rings, label, certainty in zip(
            many, (labels + [""] * 6)[: len(many)], [1.0, 0.25, 0.5] * 2, strict=False
        )
    ]
    assert told(objects_of, polygons) == told(one_by_one, polygons)
    assert _at_once(polygons) is not None


@given(
    st.lists(st.one_of(sound(), st.sampled_from(list(FAULTS.values()))), max_size=5),
    st.sampled_from([1.0, 0.5, 0.0, 2.0, "sure"]),
)
@example([], 1.0)
def test_whatever_they_are_they_are_told_as_each_alone(many, certainty):
    polygons = [LabelledPolygon(rings, "x", certainty) for rings in many]
    assert told(objects_of, polygons) == told(one_by_one, polygons)


@pytest.mark.parametrize("fault", FAULTS)
def test_the_one_that_cannot_be_used_is_named(fault):
    polygons = [LabelledPolygon((SQUARE,)), LabelledPolygon(FAULTS[fault])]
    with pytest.raises(InvalidInputError) as caught:
        objects_of(polygons)
    assert caught.value.field.startswith("polygons[1]")
    assert told(objects_of, polygons) == told(one_by_one, polygons)


def test_rings_cannot_be_written_to_and_the_callers_arrays_stay_his():
    mine = [SQUARE.copy(), SQUARE[::-1] + 5.0]
    objects = objects_of([LabelledPolygon((ring,)) for ring in mine])
    mine[0][0] = 99.0
    assert objects[0].rings[0].max() == 2.0
    with pytest.raises(ValueError, match="read-only"):
        objects[1].rings[0][0] = 1.0
