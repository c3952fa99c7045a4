"""Every histogram as a plugin, and what is particular to some."""

import math
import re

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

import sketchmatch
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import Scene, SceneObject, object_pairs
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.selection import Choice, resolve
from sketchmatch.pipeline.slices import finish
from sketchmatch.registry import Kind, default_registry
from sketchmatch.testing import random_scene
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation
from tests.interpreted import compiled_only, examples
from tests.oracle.laws import facing_force, force, hybrid, law_histogram
from tests.oracle.pixels import mask_histogram
from tests.strategies import FRAME, pairs_apart, pairs_in_overlap, pairs_in_touch, scenes, slivers

# By name: the exponent, the law between two lists of rings, and how alike a scene turned by any
# angle must find itself in 180 directions. Pixels turn less well than polygons: at 256 of them an
# object of the scenes below is about 20 wide, and a border shifts by up to half a pixel.
EXACT = {
    "constant": (0.0, lambda *_: force(0.0)),
    "gravitational": (2.0, lambda *_: force(2.0)),
    "force": (1.0, lambda *_: force(1.0)),
    "hybrid": (2.0, hybrid),
    "angles": (-1.0, lambda *_: force(-1.0)),
}
EXPONENTS = {name: exponent for name, (exponent, _) in EXACT.items()} | {"raster": 0.0}
LIKENESS = dict.fromkeys(EXACT, 0.995) | {"raster": 0.97}
NAMES = list(EXPONENTS)
FINITE_IN_OVERLAP = ["constant", "hybrid", "angles", "raster"]
INFINITE_IN_TOUCH = ["gravitational"]
INFINITE_IN_OVERLAP = ["gravitational", "force"]

SCENE = random_scene(np.random.default_rng(5), 4)
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])

ALIKE = {"searcher": "auto", "judge": "confidence"}
"""The map whose relations are most alike is the answer, and leaves no object out."""

each = pytest.mark.parametrize("name", NAMES)


def histogram(name, **params):
    return resolve(default_registry(), {"histogram": Choice(name, params)}).histogram


def described(name, scene, pairs=None, **params):
    pairs = object_pairs(len(scene)) if pairs is None else np.array(pairs)
    return histogram(name, **params).describe(scene, pairs)


def square(x=0.0, y=0.0, side=1.0):
    return side * SQUARE + np.array([x, y])


def turned(scene, angle, factor=1.0):
    c, s = factor * math.cos(angle), factor * math.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    return Scene(
        tuple(
            SceneObject.from_rings([ring @ turn for ring in item.rings]) for item in scene.objects
        )
    )


# All ---------------------------------------------------------------------------------------------


@each
def test_it_is_registered_with_its_exponent_and_directions(name):
    algorithm = default_registry().find(Kind.HISTOGRAM, name).algorithm
    assert algorithm.name == name
    assert algorithm.summary
    assert histogram(name).exponent == EXPONENTS[name]
    assert histogram(name).params.directions is None
    assert histogram(name).directions == 180
    algorithm.warm_up()


@each
@given(scene=scenes(most=4), half=st.integers(2, 45))
@examples(8)
def test_rows_are_finite_and_not_negative(name, scene, half):
    rows = described(name, scene, directions=2 * half)
    assert rows.shape == (len(object_pairs(len(scene))), 2 * half)
    assert rows.dtype == np.float64
    assert np.isfinite(rows).all()
    assert rows.min() >= 0.0


@each
@pytest.mark.parametrize("directions", [4, 6, 360, pytest.param(3600, marks=compiled_only)])
def test_the_number_of_directions_is_a_parameter(name, directions):
    rows = described(name, SCENE, directions=directions)
    assert rows.shape == (6, directions)
    assert np.isfinite(rows).all()


@each
def test_more_directions_read_the_same_values_between(name):
    fine = described(name, SCENE, directions=180)
    coarse = described(name, SCENE, directions=36)
    np.testing.assert_allclose(fine[:, ::5], coarse, rtol=0, atol=1e-12 * fine.max())


@each
@given(scene=scenes(least=2, most=3))
@examples(8)
def test_the_dual_of_a_pair_is_its_histogram_turned_by_half(name, scene):
    forward, backward = described(name, scene, [(0, 1), (1, 0)], directions=60)
    tolerance = 1e-9 * forward.max()
    np.testing.assert_allclose(np.roll(backward, 30), forward, rtol=0, atol=tolerance)


@each
def test_rows_are_those_of_the_pairs_asked_for(name):
    whole = described(name, SCENE, directions=12)
    pairs = object_pairs(len(SCENE))
    order = [4, 0, 5, 0]
    found = described(name, SCENE, pairs[order], directions=12)
    np.testing.assert_array_equal(found, whole[order])
    for k in range(len(pairs)):
        np.testing.assert_array_equal(
            described(name, SCENE, pairs[[k]], directions=12)[0], whole[k]
        )
    assert described(name, SCENE, np.empty((0, 2), dtype=np.int64), directions=12).shape == (0, 12)


@each
def test_it_leaves_the_scene_alone_and_gives_the_same_again(name):
    before = [ring.copy() for item in SCENE.objects for ring in item.rings]
    first, again = (described(name, SCENE, directions=12) for _ in range(2))
    after = [ring for item in SCENE.objects for ring in item.rings]
    np.testing.assert_array_equal(first, again)
    assert all((old == new).all() for old, new in zip(before, after, strict=True))


@each
def test_whole_scenes_are_described_with_its_exponent(name):
    found = finish(describe(SCENE, histogram(name, directions=24)))
    assert (found.objects, found.exponent, found.directions) == (4, EXPONENTS[name], 24)
    np.testing.assert_array_equal(found.histograms, described(name, SCENE, directions=24))


@each
@given(factor=st.floats(1e-3, 1e3))
@examples(8)
def test_scaling_the_scene_multiplies_it_by_its_power(name, factor):
    # The raster's lattice lies on the scene's bounding box, and so grows with it; a power of two
    # keeps the centres of pixels on their side of every border.
    factor = 2.0 ** round(math.log2(factor)) if name == "raster" else factor
    expected = factor ** (3 - EXPONENTS[name]) * described(name, SCENE, directions=24)
    found = described(name, turned(SCENE, 0.0, factor), directions=24)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * expected.max())


@each
@pytest.mark.parametrize("seed", range(6))
def test_a_scene_turned_by_any_angle_matches_itself(name, seed):
    rng = np.random.default_rng(seed)
    scene = random_scene(rng, 3 + seed % 3)
    other = turned(scene, rng.uniform(0.0, math.tau), rng.uniform(0.3, 3.0))
    result = sketchmatch.match(scene, other, histogram=name, **ALIKE)
    assert result.confidence.total > LIKENESS[name]
    assert min(entry.similarity for entry in result.fmap) > LIKENESS[name]


@pytest.mark.parametrize("name", EXACT)
@pytest.mark.parametrize("seed", range(3))
def test_relations_that_eight_directions_meet_survive_any_turn(name, seed):
    rng = np.random.default_rng(seed)
    scene = random_scene(rng, 12)
    other = turned(scene, rng.uniform(0.0, math.tau), rng.uniform(0.3, 3.0))
    first, second = (finish(describe(each, histogram(name))) for each in (scene, other))
    alike = np.diag(finish(relate(first, second, CrossCorrelation())).similarity)
    met = (first.histograms > 0.0).sum(axis=1)
    assert alike[met >= 8].min() > 0.995
    assert (met < 8).any(), "there are narrower ones, of which nothing is said"


@pytest.mark.parametrize("name", EXACT)
@given(scene=scenes(least=3, most=4), angle=st.floats(0.0, math.tau), factor=st.floats(0.3, 3.0))
@examples(6)
def test_small_objects_need_more_directions_to_match_themselves(name, scene, angle, factor):
    # Seen from the other end of the scene they are hardly 2° wide.
    result = sketchmatch.match(
        scene,
        turned(scene, angle, factor),
        histogram=name,
        params={"histogram": {"directions": 1440}},
        **ALIKE,
    )
    assert result.confidence.total > 0.995
    assert min(entry.similarity for entry in result.fmap) > 0.995


@each
@pytest.mark.parametrize(
    ("directions", "words"),
    [
        (2, "greater than or equal to 4"),
        (3602, "less than or equal to 3600"),
        (7, "multiple of 2"),
        (180.5, "valid integer"),
    ],
)
def test_directions_that_cannot_be_are_refused(name, directions, words):
    with pytest.raises(InvalidInputError, match=words) as caught:
        histogram(name, directions=directions)
    assert caught.value.reason is Reason.INVALID_PARAMETER
    assert caught.value.field == "histogram.parameters.directions"


@pytest.mark.parametrize(
    ("name", "parameter", "values"),
    [
        ("force", "r", [math.nan, math.inf, -10.5, 10.5, "much", None]),
        ("raster", "r", [math.nan, math.inf, "much"]),
        ("raster", "pixels", [0, -4, 2.5, 10**7, None]),
        ("hybrid", "near", [math.nan, math.inf, -0.01, "far"]),
        ("hybrid", "overlap", [math.nan, math.inf, -1.0, "far"]),
        ("constant", "r", [1.0]),
        ("gravitational", "r", [1.0]),
        ("angles", "r", [1.0]),
    ],
)
def test_parameters_that_cannot_be_are_refused(name, parameter, values):
    for value in values:
        with pytest.raises(InvalidInputError) as caught:
            histogram(name, **{parameter: value})
        assert caught.value.reason is Reason.INVALID_PARAMETER
        assert caught.value.field == f"histogram.parameters.{parameter}"


# Exact ones --------------------------------------------------------------------------------------


def assert_same(computed, expected, first, second, r, tolerance=1e-9):
    """Compare within a share of the histogram's highest value, or of what facing objects have."""
    highest = max(expected.max(), 0.1 * facing_force(first, second, r))
    assert np.abs(computed - expected).max() <= tolerance * highest


def assert_as_defined(name, first, second, tolerance=1e-9):
    exponent, law = EXACT[name]
    (found,) = described(name, Scene.from_polygons([first, second]), directions=8)
    expected = law_histogram(first, second, law(first, second), 8)
    assert_same(found, expected, first, second, exponent, tolerance)


@pytest.mark.slow
@pytest.mark.parametrize("name", EXACT)
@given(shapes=pairs_apart())
@examples(20)
def test_it_agrees_with_its_definition_between_objects_apart(name, shapes):
    assert_as_defined(name, *shapes)


@pytest.mark.slow
@pytest.mark.parametrize("name", EXACT)
@given(shapes=slivers())
@examples(20)
def test_it_agrees_with_its_definition_between_slivers(name, shapes):
    assert_as_defined(name, *shapes, tolerance=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in EXACT if name not in INFINITE_IN_TOUCH])
@given(shapes=pairs_in_touch())
@examples(20)
def test_it_agrees_with_its_definition_between_objects_in_touch(name, shapes):
    assert_as_defined(name, *shapes)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in EXACT if name in FINITE_IN_OVERLAP])
@given(shapes=pairs_in_overlap())
@examples(20)
def test_it_agrees_with_its_definition_between_objects_in_overlap(name, shapes):
    assert_as_defined(name, *shapes)


@pytest.mark.parametrize("r", [-10.0, -0.5, 1.0, 1.5, 2.0, 3.5, 10.0])
def test_the_force_of_an_exponent_is_the_function_of_it(r):
    expected = [
        sketchmatch.force_histogram(SCENE.objects[a], SCENE.objects[b], r=r, directions=36)
        for a, b in object_pairs(len(SCENE))
    ]
    assert histogram("force", r=r).exponent == r
    rows = described("force", SCENE, r=r, directions=36)
    np.testing.assert_allclose(rows, expected, rtol=0, atol=1e-12 * np.max(expected))


@pytest.mark.parametrize(
    ("name", "r"), [("constant", 0.0), ("gravitational", 2.0), ("angles", -1.0)]
)
def test_those_with_an_exponent_of_their_own_are_the_force_of_it(name, r):
    expected = described("force", SCENE, r=r)
    np.testing.assert_allclose(
        described(name, SCENE), expected, rtol=0, atol=1e-10 * expected.max()
    )


# Infinite forces ---------------------------------------------------------------------------------

LABELS = ["desk", "plant", "chair"]


def assert_refused(name, polygons, **params):
    scene = Scene.from_polygons(polygons, LABELS)
    with pytest.raises(InvalidInputError) as caught:
        described(name, scene, **params)
    message = str(caught.value)
    assert re.search(r"objects\[1\].*objects\[2\]", message), "names both objects"
    assert "plant" in message
    assert "chair" in message
    assert "objects[0]" not in message
    assert "hybrid" in message, "offers a remedy"
    assert "\n" not in message


@pytest.mark.parametrize("name", INFINITE_IN_OVERLAP)
def test_overlap_is_refused_where_the_force_would_be_infinite(name):
    assert_refused(name, [square(5, 5), square(), square(0.5, 0.5)])
    assert_refused(name, [square(5, 5), square(), square(0.25, 0.25, 0.5)])
    assert_refused(name, [square(5, 5), square(), square()])


@pytest.mark.parametrize("name", INFINITE_IN_TOUCH)
def test_contact_is_refused_where_the_force_would_be_infinite(name):
    assert_refused(name, [square(5, 5), square(), square(1, 0.5)])
    assert_refused(name, [square(5, 5), square(), square(1, 1)])


def test_contact_and_overlap_are_fine_below():
    scene = Scene.from_polygons([square(), square(1, 0.5), square(0.5, 3)])
    assert np.isfinite(described("force", scene, r=1.9)).all()
    scene = Scene.from_polygons([square(), square(0.5, 0.5), square(0.5, 3)])
    assert np.isfinite(described("force", scene, r=0.9)).all()


@pytest.mark.parametrize("name", FINITE_IN_OVERLAP)
def test_contact_and_overlap_are_fine_where_forces_are_bounded(name):
    scene = Scene.from_polygons([square(), square(1, 0.5), square(0.5, 0.5), square(), FRAME])
    rows = described(name, scene, directions=36)
    assert np.isfinite(rows).all()
    assert rows.any(axis=1).all()


def test_pairs_that_are_not_asked_for_may_overlap():
    scene = Scene.from_polygons([square(), square(0.5, 0.5), square(5, 1)])
    assert described("gravitational", scene, [(0, 2), (1, 2)]).any(axis=1).all()


def test_a_match_says_which_side_has_the_overlap():
    fine = Scene.from_polygons([square(), square(2, 1), square(0, 3)])
    wrong = Scene.from_polygons([square(), square(2, 1), square(0, 0.5)])
    with pytest.raises(InvalidInputError, match=r"map.*objects\[0\].*objects\[2\]"):
        sketchmatch.match(fine, wrong, histogram="gravitational")


# Hybrid ------------------------------------------------------------------------------------------


def diameter(area):
    return 2 * math.sqrt(area / math.pi)


def test_hybrid_is_gravitational_beyond_its_reach():
    expected = described("gravitational", SCENE)
    np.testing.assert_allclose(described("hybrid", SCENE), expected, rtol=1e-9)


def test_hybrid_is_constant_within_its_reach():
    scene = Scene.from_polygons([square(), square(1.5, 0.25, 2.0)])
    reach = 10 * diameter(1.0)
    expected = described("constant", scene) / reach**2
    np.testing.assert_allclose(
        described("hybrid", scene, near=10.0), expected, rtol=0, atol=1e-9 * expected.max()
    )


def test_hybrid_reaches_as_far_as_the_common_part_is_wide():
    # Half of each is common: three of its diameters are more than any distance.
    scene = Scene.from_polygons([square(), square(0.5, 0.0)])
    reach = 3 * diameter(0.5)
    expected = described("constant", scene) / reach**2
    np.testing.assert_allclose(
        described("hybrid", scene), expected, rtol=0, atol=1e-9 * expected.max()
    )


@pytest.mark.parametrize("near", [0.01, 0.3])
def test_hybrid_of_unit_squares_in_touch(near):
    # C(d) = d up to 1 and 2 − d up to 2: ∫ d/Y² below Y, then ∫ 1/d, then ∫ (2 − d)/d².
    reach = near * diameter(1.0)
    expected = 0.5 - math.log(reach) + 1 - math.log(2)
    law = hybrid([square(1)], [square()], near)
    by_definition = law_histogram([square(1)], [square()], law, 4)
    assert by_definition == pytest.approx([expected, 0, 0, 0], rel=1e-13)
    (found,) = described(
        "hybrid", Scene.from_polygons([square(1), square()]), near=near, directions=4
    )
    assert found == pytest.approx([expected, 0, 0, 0], rel=1e-9)


@pytest.mark.slow
@given(st.one_of(pairs_apart(), pairs_in_touch(), pairs_in_overlap()), st.floats(0.05, 2.0))
@examples(40)
def test_hybrid_agrees_with_its_definition_at_any_reach(shapes, near):
    scene = Scene.from_polygons(shapes)
    expected = law_histogram(*shapes, hybrid(*shapes, near, 0.5), 8)
    (found,) = described("hybrid", scene, near=near, overlap=0.5, directions=8)
    assert_same(found, expected, *shapes, 2.0)


# Raster ------------------------------------------------------------------------------------------


def round_object(x, y, size, seed):
    rng = np.random.default_rng(seed)
    angles = math.tau * (np.arange(9) + rng.uniform(0.0, 0.45, 9)) / 9
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1) * rng.uniform(0.5, 1, (9, 1))
    return size * ring + np.array([x, y])


# In a box of 8 by 8.
BOXED = Scene.from_polygons(
    [square(), square(7, 7), round_object(5.1, 2.3, 1.9, 1), round_object(2.2, 5.3, 1.7, 2)]
)


@pytest.mark.slow
@pytest.mark.parametrize("r", [-1.0, 0.0, 0.5, 1.5, 2.5])
@pytest.mark.parametrize("pixels", [8, 16])
def test_raster_is_the_force_between_pixels_with_their_centre_inside(pixels, r):
    side = 8 / pixels
    places = (np.arange(pixels) + 0.5) * side
    x, y = np.meshgrid(places, places[::-1])
    masks = [shapely.contains_xy(item.polygon, x, y) for item in BOXED.objects]
    expected = side ** (3 - r) * np.array(
        [mask_histogram(masks[a], masks[b], r, 12) for a, b in object_pairs(4)]
    )
    assert histogram("raster", r=r).exponent == r
    found = described("raster", BOXED, pixels=pixels, r=r, directions=12)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * expected.max())


@pytest.mark.parametrize("r", [0.0, 1.5])
def test_raster_is_exact_where_borders_lie_on_the_lattice(r):
    scene = Scene.from_polygons([square(), square(3, 1, 2.0), square(6, 2, 2.0)])
    expected = described("force", scene, r=r)
    found = described("raster", scene, pixels=16, r=r)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * expected.max())


def test_raster_converges_to_what_polygons_give():
    errors = []
    for pixels in (64, 1024):
        error = 0.0
        for seed in range(3):
            scene = random_scene(np.random.default_rng(seed), 4)
            exact = described("constant", scene, directions=36)
            found = described("raster", scene, pixels=pixels, directions=36)
            error += float(np.linalg.norm(found - exact) / np.linalg.norm(exact))
        errors.append(error / 3)
    assert errors[0] < 0.2
    assert errors[1] < errors[0] / 6


def test_raster_does_not_mind_where_the_scene_lies():
    moved = Scene.from_polygons([item.rings[0] + [64.0, -16.0] for item in BOXED.objects])
    expected = described("raster", BOXED, pixels=64, directions=36)
    found = described("raster", moved, pixels=64, directions=36)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * expected.max())


def test_raster_is_the_histogram_of_the_masks():
    corners = Scene.from_polygons([square(), square(3, 2)])  # 8 by 6 pixels of 0.5
    a, b = np.zeros((2, 6, 8), dtype=bool)
    a[4:, :2], b[:2, 6:] = True, True
    expected = 0.5**3 * sketchmatch.force_histogram(a, b, directions=60)
    (found,) = described("raster", corners, pixels=8, directions=60)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * expected.max())
