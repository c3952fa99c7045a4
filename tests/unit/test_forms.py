"""What outlines are, however they are turned, scaled or stretched."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.model import Scene, SceneObject
from sketchmatch_builtin.alignment._forms import form_distances, forms_of

BOX = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
ARM = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 4.0], [0.0, 4.0]])
ANGLES = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
ROUND = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])


def form(*rings):
    far = SceneObject.from_rings([BOX + 1e4])
    return forms_of(Scene((SceneObject.from_rings(rings), far)))[0]


@pytest.mark.parametrize(
    ("ring", "expected"),
    [
        # Of a square from −√3 to √3: E x⁴ = 9/5, E x² = 1.
        (BOX, (0.0, 0.0, 12.0 / 5.0, 28.0 / 5.0)),
        # Of a disc of radius 2: E r⁴ = 16/3.
        (ROUND, (0.0, 0.0, 0.0, 16.0 / 3.0)),
        # Of an equilateral triangle of unit variances: E z³ = 8/√(12.5), E |z|⁴ = 32/5.
        (BOX[:3], (math.sqrt(5.12), 0.0, 0.0, 32.0 / 5.0)),
    ],
)
def test_forms_of_boxes_ellipses_and_triangles_are_known(ring, expected):
    np.testing.assert_allclose(form(ring), expected, atol=2e-3)
    stretched = ring @ np.array([[3.0, 1.0], [-0.4, 0.5]])
    np.testing.assert_allclose(form(stretched), form(ring), atol=1e-9)


def slow_form(polygon, side=300):
    """Return a form by counting points of a grid."""
    x0, y0, x1, y1 = polygon.bounds
    x, y = np.meshgrid(
        x0 + (x1 - x0) * (np.arange(side) + 0.5) / side,
        y0 + (y1 - y0) * (np.arange(side) + 0.5) / side,
    )
    inside = shapely.contains_xy(polygon, x, y)
    points = np.column_stack([x[inside], y[inside]])
    points = points - points.mean(axis=0)
    white = points @ np.linalg.inv(np.linalg.cholesky(np.cov(points.T, bias=True))).T
    z = white @ [1.0, 1.0j]
    means = [abs((z**a * np.conj(z) ** b).mean()) for a, b in ((3, 0), (2, 1), (4, 0), (2, 2))]
    return np.array(means)


def test_forms_are_those_of_the_points_within_holes_too():
    hole = 0.5 + 0.3 * ROUND
    for rings in ((ARM,), (4.0 * BOX, hole + np.array([1.0, 1.5])), (BOX[:3] * [2.0, 5.0],)):
        item = SceneObject.from_rings(rings)
        np.testing.assert_allclose(form(*rings), slow_form(item.polygon), atol=0.06)


affine = st.tuples(*[st.floats(-3.0, 3.0)] * 4).filter(
    lambda m: abs(m[0] * m[3] - m[1] * m[2]) > 0.2
)


@given(affine, st.floats(-50.0, 50.0), st.integers(0, 2**32 - 1))
def test_forms_are_the_same_for_all_affine_images(matrix, moved, seed):
    rng = np.random.default_rng(seed)
    angles = (np.arange(7) + rng.uniform(0.0, 0.8, 7)) * 2.0 * np.pi / 7.0
    ring = rng.uniform(0.5, 1.5, (7, 1)) * np.column_stack([np.cos(angles), np.sin(angles)])
    image = ring @ np.reshape(matrix, (2, 2)) + moved
    np.testing.assert_allclose(form(image), form(ring), rtol=1e-6, atol=1e-6)


def test_each_object_of_a_scene_has_the_form_that_it_has_alone():
    rings = [
        BOX,
        ARM + np.array([5.0, 0.0]),
        ROUND + np.array([-9.0, 2.0]),
        BOX[:3] + np.array([0.0, 9.0]),
    ]
    scene = Scene.from_polygons(rings)
    np.testing.assert_allclose(forms_of(scene), [form(each) for each in rings], atol=1e-9)
    other = Scene.from_polygons(
        [ring @ np.array([[0.0, 2.0], [-1.0, 0.3]]) for ring in rings[::-1]]
    )
    apart = form_distances(scene, other)
    assert apart.shape == (4, 4)
    np.testing.assert_allclose(np.diag(apart[:, ::-1]), 0.0, atol=1e-12)
    wrong = apart[:, ::-1][~np.eye(4, dtype=bool)]
    assert wrong.min() > 0.3
    np.testing.assert_allclose(apart, form_distances(other, scene).T)
    assert not forms_of(scene).flags.writeable
