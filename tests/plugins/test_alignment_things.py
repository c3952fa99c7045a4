"""Things, sides and self similarities: what alignment knows before it lays anything."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.model import Scene, SceneObject
from sketchmatch.pipeline.evidence import compare_objects
from sketchmatch.pipeline.slices import finish
from sketchmatch_builtin.alignment import sides_of
from sketchmatch_builtin.alignment._selves import self_similarities
from sketchmatch_builtin.alignment._sides import inverse
from sketchmatch_builtin.alignment._things import things_of
from tests.interpreted import examples
from tests.oracle import aligning
from tests.strategies import FRAME, cornered_rings, scenes, star_rings

BOX = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def box(x, y, width=1.0, height=1.0):
    return BOX * (width, height) + (x, y)


def holed(rings, offset=(0.0, 0.0), scale=1.0):
    return SceneObject.from_rings([scale * np.array(ring, float) + offset for ring in rings])


@given(st.lists(st.one_of(star_rings(), cornered_rings()), min_size=2, max_size=4))
@examples(60)
def test_moments_are_those_of_the_triangles_of_a_polygon_with_its_holes(shapes):
    scene = Scene(tuple(holed(rings, (9.0 * k, 5.0 * k)) for k, rings in enumerate(shapes)))
    things = things_of(scene)
    known = [aligning.moments(item) for item in scene.objects]
    centres = np.array([complex(*centre) for _, centre, _ in known])
    np.testing.assert_allclose(things.places, centres - centres.mean(), atol=1e-9)
    np.testing.assert_allclose(things.sizes, np.log([area for area, _, _ in known]), atol=1e-9)
    for found, (_, _, covariance) in zip(things.shapes, known, strict=True):
        if np.ptp(np.linalg.eigvalsh(covariance)) < 1e-9 * np.trace(covariance):
            assert abs(found) < 1e-7
        else:
            assert found == pytest.approx(aligning.shape(covariance), abs=1e-6)
    assert things.spacing == pytest.approx(aligning.spacing(centres))


def test_a_box_has_the_shape_of_its_aspect_and_direction():
    turned = box(0, 0, 1, 3) @ np.array([[1.0, 1.0], [-1.0, 1.0]]) + (20.0, 0.0)
    scene = Scene.from_polygons([box(0, 0, 4, 1), box(0, 9, 1, 4), box(9, 9), turned])
    things = things_of(scene)
    wide, tall, even, diagonal = things.shapes
    # λ₁/λ₂ is the square of the aspect, so half its logarithm is ln 4; upright is half a turn off.
    assert wide == pytest.approx(math.log(4.0))
    assert tall == pytest.approx(-math.log(4.0))
    assert even == 0.0
    assert abs(diagonal) == pytest.approx(math.log(3.0))
    assert np.angle(diagonal) == pytest.approx(-np.pi / 2.0)  # upright, turned by 45°: 135°
    np.testing.assert_allclose(np.exp(things.sizes), [4.0, 4.0, 1.0, 6.0])


def test_a_line_that_is_almost_without_width_has_a_finite_shape():
    things = things_of(Scene.from_polygons([box(0, 0, 1e4, 1e-3), box(0, 5)]))
    assert things.shapes[0].real == pytest.approx(np.arctanh(1.0 - 1e-9))
    assert things.shapes[0].imag == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("offset", [(0.0, 0.0), (1e5, -3e5)])
def test_scale_and_position_leave_shapes_alone(scale, offset):
    rings = [box(0, 0, 4, 1), box(7, 3, 2, 5), box(-5, 8)]
    here, there = (
        things_of(Scene.from_polygons(list(each)))
        for each in (rings, [scale * (ring + offset) for ring in rings])
    )
    np.testing.assert_allclose(there.shapes, here.shapes, atol=1e-7)
    np.testing.assert_allclose(there.places, scale * here.places, atol=1e-7 * scale)
    np.testing.assert_allclose(there.sizes, here.sizes + 2.0 * math.log(scale), atol=1e-7)
    assert there.spacing == pytest.approx(scale * here.spacing)


def test_objects_in_one_place_keep_a_spacing_above_zero():
    inside = SceneObject.from_rings([box(1.25, 1.25, 0.5, 0.5)])
    things = things_of(Scene((holed(FRAME), inside)))
    assert np.abs(things.places).max() < 1e-12
    assert 0.0 < things.spacing < 1e-6
    # A third object elsewhere is the extent; the two still are apart by a little at least.
    far = SceneObject.from_rings([box(1000, 0)])
    spread = things_of(Scene((holed(FRAME), inside, far)))
    assert 300.0 < spread.spacing < 400.0


@given(scenes(most=4), scenes(most=4))
@examples(20)
def test_own_histograms_compare_as_the_evidence_of_zeta_does(drawn, mapped):
    found = self_similarities(drawn, mapped)
    known = finish(compare_objects(drawn, mapped, 180)).products
    assert found.shape == (len(drawn), len(mapped), 90)
    np.testing.assert_allclose(found, known, atol=1e-9)
    assert (found <= 1.0 + 1e-9).all()


def test_a_turned_object_is_like_itself_at_its_turn():
    c, s = math.cos(math.radians(40.0)), math.sin(math.radians(40.0))
    ring = box(0, 0, 4, 1)
    scene = Scene.from_polygons([ring, box(0, 9)])
    turned = Scene.from_polygons([ring @ np.array([[c, s], [-s, c]]), box(0, 9)])
    found = self_similarities(scene, turned)[0, 0]
    assert found.argmax() == 20
    assert found.max() == pytest.approx(1.0, abs=1e-6)


SCENE = Scene.from_polygons([box(0, 0), box(5, 0, 2, 1), box(0, 5, 1, 3)])
LARGER = Scene.from_polygons([box(0, 0), box(5, 0, 2, 1), box(0, 5, 1, 3), box(9, 9)])


def test_sides_know_what_speaks_for_pairings():
    names = np.array([[1, -1, 0, -1], [0, 0, 0, 0], [-1, 1, 0, 1]])
    allowed = np.ones((3, 4), dtype=bool)
    allowed[2] = [False, True, False, False]
    pinned = np.array([-1, -1, 1])
    sides = sides_of((SCENE, LARGER), False, allowed, pinned, names)
    np.testing.assert_array_equal(
        sides.bonus,
        [[2.0, -2.0, 0.0, -2.0], [0.0] * 4, [-np.inf, 52.0, -np.inf, -np.inf]],
    )
    assert not sides.swapped
    assert len(sides.drawn.places) == 3
    assert len(sides.mapped.places) == 4
    partners = np.array([2, -1, 0])
    assert sides.drawn_partners(partners) is partners
    assert sides.template_partners(partners) is partners


def test_swapped_sides_are_the_same_the_other_way_round():
    names = np.array([[1, -1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1]])
    pinned = np.array([-1, 2, -1])
    straight = sides_of((SCENE, LARGER), False, None, pinned, names)
    swapped = sides_of((SCENE, LARGER), True, None, pinned, names)
    np.testing.assert_array_equal(swapped.bonus, straight.bonus.T)
    assert swapped.bonus.flags.c_contiguous
    assert swapped.swapped
    np.testing.assert_array_equal(swapped.drawn.places, straight.mapped.places)
    np.testing.assert_array_equal(swapped.mapped.places, straight.drawn.places)
    # The template is the map: 0 → 3, 2 → 1. So of the sketch's four, 1 is 2 and 3 is 0.
    np.testing.assert_array_equal(swapped.drawn_partners(np.array([3, -1, 1])), [-1, 2, -1, 0])
    np.testing.assert_array_equal(swapped.template_partners(np.array([-1, 2, -1, 0])), [3, -1, 1])


def test_nothing_known_speaks_for_nothing():
    np.testing.assert_array_equal(
        sides_of((SCENE, LARGER), False, None, None, None).bonus, np.zeros((3, 4))
    )


@given(st.permutations(range(6)), st.lists(st.booleans(), min_size=6, max_size=6))
def test_the_inverse_of_the_inverse_is_the_map(order, kept):
    partners = np.where(kept, order, -1)
    np.testing.assert_array_equal(inverse(inverse(partners, 8), 6), partners)
