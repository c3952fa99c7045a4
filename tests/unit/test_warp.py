"""The warp: what it does at the objects, between them, far from them, and where it refuses."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.transfers import warp as warps
from sketchmatch.transfers.warp import WarpKind, fit_warp
from tests.interpreted import examples
from tests.oracle.warp import krige

seeds = st.integers(0, 2**32 - 1)


def strewn(rng, count, side=10.0):
    """Return places that lie apart."""
    cells = rng.permutation(16)[:count] if count <= 16 else rng.permutation(count)
    across = 4 if count <= 16 else int(np.ceil(np.sqrt(count)))
    corners = np.stack([cells % across, cells // across], axis=1)
    return (corners + rng.uniform(0.1, 0.9, corners.shape)) * side / across


def turned(points, angle=0.7, scale=2.5, shift=(3.0, -8.0)):
    c, s = np.cos(angle), np.sin(angle)
    return scale * points @ np.array([[c, s], [-s, c]]) + shift


@given(
    seeds, st.integers(2, 16), st.floats(-3.1, 3.1), st.floats(0.01, 100.0), st.floats(-1e3, 1e3)
)
def test_what_only_turns_scales_and_shifts_is_carried_exactly(seed, count, angle, scale, shift):
    rng = np.random.default_rng(seed)
    places, points = strewn(rng, count), rng.uniform(-20.0, 30.0, (20, 2))
    warp = fit_warp(places, turned(places, angle, scale, shift))
    assert warp(points) == pytest.approx(turned(points, angle, scale, shift), rel=1e-6, abs=1e-6)
    assert (warp.scale, warp.rotation) == pytest.approx((scale, angle), rel=1e-6, abs=1e-6)
    assert warp.residual == pytest.approx(0.0, abs=1e-6 * scale)


@pytest.mark.parametrize(
    ("stretch", "bend", "shared"),
    [(0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (0.5, 0.2, 0.0), (2.0, 4.0, 0.9), (0.0, 0.0, 0.6)],
)
def test_places_and_deviations_are_those_of_the_gaussian_process(stretch, bend, shared):
    rng = np.random.default_rng(5)
    places, points = strewn(rng, 9), rng.uniform(-5.0, 15.0, (12, 2))
    goals = turned(places) + rng.normal(0.0, 0.8, places.shape)
    weights = rng.uniform(0.2, 1.0, 9)
    frame = warps._Frame.around(places[:, 0] + 1j * places[:, 1])
    unit, middle = 3.0, complex(*goals.mean(axis=0))
    shape = warps._Shape(weights, stretch, bend, shared)
    aims = (goals[:, 0] + 1j * goals[:, 1] - middle) / unit
    warp = warps.Warp(shape, frame, middle, unit, aims)
    scaled = [(each - places.mean(axis=0)) / frame.spread for each in (places, points)]
    expected, variances = krige(
        scaled[0],
        np.stack([aims.real, aims.imag], axis=1),
        scaled[1],
        weights,
        stretch=stretch,
        bend=bend,
        shared=shared,
        reach=frame.reach,
    )
    assert warp(points) == pytest.approx(unit * expected + goals.mean(axis=0), abs=1e-8)
    ratio = warp.deviations(points) ** 2 / variances
    assert ratio == pytest.approx(np.full(12, ratio[0]), rel=1e-7)


def test_with_free_affine_parts_it_is_the_smoothing_thin_plate_spline_of_scipy():
    scipy = pytest.importorskip("scipy.interpolate")
    rng = np.random.default_rng(11)
    places, points = strewn(rng, 12), rng.uniform(0.0, 10.0, (30, 2))
    goals = turned(places) + rng.normal(0.0, 0.8, places.shape)
    frame = warps._Frame.around(places[:, 0] + 1j * places[:, 1])
    aims = goals[:, 0] + 1j * goals[:, 1]
    shape = warps._Shape(np.ones(12), stretch=1e7, bend=5.0)
    warp = warps.Warp(shape, frame, 0j, 1.0, aims)
    middle = places.mean(axis=0)
    spline = scipy.RBFInterpolator(
        (places - middle) / frame.spread, goals, kernel="thin_plate_spline", smoothing=1 / 5.0
    )
    assert warp(points) == pytest.approx(spline((points - middle) / frame.spread), abs=1e-4)


@pytest.mark.parametrize(
    ("count", "kind"),
    [
        (2, WarpKind.SIMILARITY),
        (3, WarpKind.SIMILARITY),
        (5, WarpKind.SPLINE),
        (12, WarpKind.SPLINE),
    ],
)
def test_few_objects_lead_to_a_stiff_warp(count, kind):
    rng = np.random.default_rng(3)
    places = strewn(rng, count)
    goals = turned(places) + rng.normal(0.0, 0.1, places.shape)
    assert fit_warp(places, goals).kind is kind


def test_four_objects_of_a_stretched_page_lead_to_an_affine_warp():
    places = np.array([[0.0, 0.0], [10.0, 0.0], [9.0, 10.0], [1.0, 9.0]])
    warp = fit_warp(places, places * [2.0, 1.0])
    assert warp.kind is WarpKind.AFFINE
    assert warp(np.array([[5.0, 5.0]])) == pytest.approx(np.array([[10.0, 5.0]]), abs=0.1)


def test_what_all_objects_are_bent_by_is_bent():
    grid = np.stack(np.meshgrid(np.arange(6.0), np.arange(6.0)), axis=-1).reshape(-1, 2)
    bend = np.stack([grid[:, 0] + 0.06 * grid[:, 1] ** 2, grid[:, 1]], axis=1)
    warp = fit_warp(grid, bend)
    inside = grid[:-7] + 0.5
    expected = np.stack([inside[:, 0] + 0.06 * inside[:, 1] ** 2, inside[:, 1]], axis=1)
    assert warp(inside) == pytest.approx(expected, abs=0.05)


@pytest.mark.slow
@given(seeds, st.integers(5, 16))
def test_objects_that_agree_come_nearly_to_their_partners(seed, count):
    rng = np.random.default_rng(seed)
    places = strewn(rng, count)
    noise = rng.normal(0.0, 0.15, places.shape)
    warp = fit_warp(places, turned(places, scale=1.0) + noise)
    assert warp.residual < 0.15
    assert np.abs(warp(places) - turned(places, scale=1.0) - noise).max() < 0.6


def test_an_object_that_was_moved_takes_nothing_along():
    rng = np.random.default_rng(7)
    places = strewn(rng, 14)
    goals = turned(places)
    goals[4] += (9.0, -7.0)
    warp = fit_warp(places, goals)
    others = np.delete(np.arange(14), 4)
    assert warp.weights[4] < 0.1
    assert warp.weights[others].min() > 0.6
    assert warp(places[4:5]) == pytest.approx(turned(places[4:5]), abs=0.5)
    assert warp(places[others]) == pytest.approx(turned(places[others]), abs=0.3)


def test_between_maps_a_thing_that_was_moved_a_little_stands_out():
    rng = np.random.default_rng(7)
    places = strewn(rng, 7)
    goals = turned(places, scale=1.0) + rng.normal(0.0, 0.02, places.shape)
    goals[3] += (0.5, 0.4)
    mapped, drawn = (fit_warp(places, goals, doubt=each) for each in (warps.MAPPED, warps.DRAWN))
    others = np.delete(np.arange(7), 3)
    missed = np.abs(mapped(places[others]) - turned(places[others], scale=1.0))
    assert missed.max() < 0.08
    assert mapped.weights[3] < 0.3 < drawn.weights[3]
    assert mapped.deviations(places).mean() < drawn.deviations(places).mean()


def test_a_doubtful_partner_counts_for_less():
    places = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0], [2.0, 1.0]])
    goals = np.array([*places[:4], [2.0, 1.6]])
    miss = [
        abs(float(fit_warp(places, goals, np.array([1, 1, 1, 1, likely]))(places[4:])[0, 1]) - 1.0)
        for likely in (0.05, 1.0)
    ]
    assert miss[0] < 0.5 * miss[1]


@examples(40)
@given(seeds, st.integers(3, 16))
def test_no_warp_folds(seed, count):
    rng = np.random.default_rng(seed)
    places = strewn(rng, count)
    goals = places + rng.normal(0.0, rng.uniform(0.0, 3.0), places.shape)
    try:
        warp = fit_warp(places, goals)
    except InvalidInputError:
        return
    x, y = (np.linspace(-1.0, 11.0, 90),) * 2
    step = 1e-5
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    dx = (warp(points + np.array([step, 0.0])) - warp(points)) / step
    dy = (warp(points + np.array([0.0, step])) - warp(points)) / step
    assert (dx[:, 0] * dy[:, 1] - dx[:, 1] * dy[:, 0]).min() > 0.0


def test_what_lies_far_away_does_not_hide_a_fold_between_the_objects():
    rng = np.random.default_rng(17)
    places = rng.uniform(0.0, 10.0, (10, 2))
    goals = places + rng.normal(0.0, 0.8, places.shape)
    warp = fit_warp(places, goals)
    other = fit_warp(places, goals, around=np.array([[1000.0, 300.0]]))
    assert other(places) == pytest.approx(warp(places), abs=1e-6)


@given(seeds, st.integers(3, 16))
def test_a_mirror_image_is_refused(seed, count):
    rng = np.random.default_rng(seed)
    places = strewn(rng, count)
    singular = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
    assume(singular[1] > 0.5 * singular[0])
    with pytest.raises(InvalidInputError, match="mirror image"):
        fit_warp(places, turned(places * [1.0, -1.0]))


def test_it_is_straight_far_from_the_objects():
    rng = np.random.default_rng(1)
    places = strewn(rng, 10)
    warp = fit_warp(places, places + rng.normal(0.0, 0.5, places.shape))
    for way in ([1.0, 0.0], [-0.6, 0.8]):
        far = np.array([300.0, 310.0, 320.0])[:, None] * way
        first, middle, last = warp(far)
        assert np.abs(first - 2.0 * middle + last).max() < 0.01


def test_deviations_grow_with_the_distance_to_the_objects():
    rng = np.random.default_rng(2)
    places = strewn(rng, 10)
    warp = fit_warp(places, turned(places) + rng.normal(0.0, 0.3, places.shape))
    along = np.array([5.0, 10.0, 20.0, 40.0, 80.0])[:, None] * [1.0, 1.0]
    assert (np.diff(warp.deviations(along)) > 0.0).all()
    assert warp.deviations(places).max() < warp.deviations(along)[1]


def test_deviations_cover_what_is_missed_where_things_take_what_is_around_them_along():
    misses = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        places = strewn(rng, 10)
        moved = rng.normal(0.0, 0.5, places.shape)
        points = rng.uniform(1.0, 9.0, (20, 2))
        near = 1.0 / ((points[:, None] - places[None, :]) ** 2).sum(axis=2)
        own = near @ moved / near.sum(axis=1, keepdims=True)
        warp = fit_warp(places, turned(places) + moved)
        misses.append((warp(points) - turned(points) - own) / warp.deviations(points)[:, None])
    within = [float((np.abs(np.concatenate(misses)) < k).mean()) for k in (1.0, 2.0)]
    assert 0.68 < within[0] < 0.97
    assert 0.95 < within[1] < 1.0


@examples(30)
@given(seeds, st.integers(4, 14))
def test_there_and_back_ends_within_three_deviations(seed, count):
    rng = np.random.default_rng(seed)
    places = strewn(rng, count)
    goals = turned(places) + rng.normal(0.0, 0.4, places.shape)
    there, back = fit_warp(places, goals), fit_warp(goals, places)
    points = rng.uniform(0.0, 10.0, (20, 2))
    carried = there(points)
    sure = np.hypot(there.deviations(points) / there.scale, back.deviations(carried))
    assert (np.abs(back(carried) - points).max(axis=1) <= 3.0 * sure).all()


@examples(15)
@given(seeds)
def test_frames_do_not_matter(seed):
    rng = np.random.default_rng(seed)
    places, points = strewn(rng, 8), rng.uniform(0.0, 10.0, (10, 2))
    goals = turned(places) + rng.normal(0.0, 0.3, places.shape)
    plain = fit_warp(places, goals, around=points)
    frame = {"angle": -2.0, "scale": 40.0, "shift": (500.0, 70.0)}
    other = fit_warp(turned(places, **frame), goals, around=turned(points, **frame))
    assert other(turned(points, **frame)) == pytest.approx(plain(points), abs=1e-4)
    assert other.deviations(turned(points, **frame)) == pytest.approx(
        plain.deviations(points), rel=1e-4
    )


@pytest.mark.parametrize(
    ("places", "words"),
    [
        ([], "no object"),
        ([[1.0, 2.0]], "one object"),
        ([[1.0, 2.0], [1.0, 2.0]], "at one place"),
        ([[1.0, np.nan], [1.0, 2.0]], "no finite place"),
    ],
)
def test_places_that_lead_to_no_warp_are_refused(places, words):
    given_ = np.array(places).reshape(-1, 2)
    with pytest.raises(InvalidInputError, match=words) as refused:
        fit_warp(given_, np.arange(2.0 * len(given_)).reshape(-1, 2))
    assert refused.value.reason in (Reason.TOO_FEW_OBJECTS, Reason.INVALID_FIELD)


def test_objects_on_one_line_are_enough():
    places = np.stack([np.arange(6.0), np.zeros(6)], axis=1)
    warp = fit_warp(places, turned(places))
    points = np.array([[2.5, 1.0], [3.0, -2.0]])
    assert warp(points) == pytest.approx(turned(points), abs=1e-6)
