"""The simulated robot: what it measures, where it drives, and the map it makes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sketchmatch.model import SceneObject
from sketchmatch.testing.driving import Odometry, estimate_poses, plan_tour
from sketchmatch.testing.lidar import Lidar, World, cast_rays, scan
from sketchmatch.testing.mapping import LogOddsGrid, SensorModel, map_scans
from sketchmatch.testing.robot import survey

PERFECT = Lidar(noise=0.0, dropout=0.0, mixing=0.0, step=0.0)
CERTAIN = Odometry(position=0.0, heading=0.0)


def rectangle(x0, y0, x1, y1):
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], dtype=float)


def room(*furniture, width=5.0, height=4.0):
    ring = rectangle(0.0, 0.0, width, height)
    return World((np.vstack([ring, ring[:1]]),), tuple(furniture))


BOX = SceneObject.from_rings([rectangle(2.0, 1.5, 3.0, 2.2)], "box")
FURNISHED = room(BOX)


def cell(grid, x, y):
    column = math.floor((x - grid.origin[0]) / grid.resolution)
    row = math.floor((y - grid.origin[1]) / grid.resolution)
    return int(grid.cells[row, column])


def occupied_extent(grid, x0, y0, x1, y1):
    """Return the box around the occupied cells whose centres lie in a rectangle."""
    rows, columns = np.nonzero(grid.cells == 100)
    x = grid.origin[0] + (columns + 0.5) * grid.resolution
    y = grid.origin[1] + (rows + 0.5) * grid.resolution
    inside = (x > x0) & (x < x1) & (y > y0) & (y < y1)
    half = grid.resolution / 2.0
    return [
        x[inside].min() - half,
        y[inside].min() - half,
        x[inside].max() + half,
        y[inside].max() + half,
    ]


def test_rays_measure_the_distance_to_walls():
    angles = np.linspace(0.0, 2.0 * np.pi, 73)[:-1] + 0.01
    position = np.array([1.2, 2.9])
    cosine, sine = np.cos(angles), np.sin(angles)
    to_x = np.where(cosine > 0.0, 5.0 - position[0], position[0]) / np.abs(cosine)
    to_y = np.where(sine > 0.0, 4.0 - position[1], position[1]) / np.abs(sine)
    np.testing.assert_allclose(
        cast_rays(room(), position, angles), np.minimum(to_x, to_y), rtol=1e-12
    )


def test_rays_stop_at_the_nearest_thing():
    ranges = cast_rays(FURNISHED, (1.0, 1.8), np.array([0.0, np.pi / 4.0, np.pi]))
    np.testing.assert_allclose(ranges, [1.0, 2.2 * math.sqrt(2.0), 1.0], rtol=1e-12)


def test_rays_measure_the_distance_to_a_round_thing():
    corners = np.arange(2000) * (2.0 * np.pi / 2000)
    ring = np.stack([2.0 + 0.5 * np.cos(corners), 1.0 + 0.5 * np.sin(corners)], axis=1)
    world = World((), (SceneObject.from_rings([ring]),))
    angles = np.linspace(-0.2, 0.2, 9)
    expected = 2.0 * np.cos(angles) - np.sqrt(0.25 - (2.0 * np.sin(angles)) ** 2)
    np.testing.assert_allclose(cast_rays(world, (0.0, 1.0), angles), expected, atol=1e-5)


def test_a_perfect_scan_is_the_rays_turned_with_the_robot():
    pose = np.array([1.0, 1.0, 0.7])
    ranges = scan(FURNISHED, pose, np.random.default_rng(0), PERFECT)
    np.testing.assert_array_equal(ranges, cast_rays(FURNISHED, pose[:2], 0.7 + PERFECT.bearings))


def test_a_scan_hears_nothing_beyond_its_range():
    lidar = Lidar(max_range=2.0, noise=0.0, dropout=0.0, mixing=0.0)
    ranges = scan(room(), np.array([1.0, 2.0, 0.0]), np.random.default_rng(0), lidar)
    truth = cast_rays(room(), (1.0, 2.0), lidar.bearings)
    np.testing.assert_array_equal(np.isinf(ranges), truth > 2.0)
    assert np.isinf(ranges).any()


def test_noise_dropouts_and_rounding_are_as_asked():
    lidar = Lidar(beams=20_000, noise=0.02, dropout=0.1, mixing=0.0, step=0.005)
    ranges = scan(room(), np.array([2.5, 2.0, 0.0]), np.random.default_rng(1), lidar)
    lost = np.isnan(ranges)
    assert lost.mean() == pytest.approx(0.1, abs=0.01)
    error = (ranges - cast_rays(room(), (2.5, 2.0), lidar.bearings))[~lost]
    assert error.mean() == pytest.approx(0.0, abs=0.001)
    assert error.std() == pytest.approx(0.02, rel=0.05)
    np.testing.assert_allclose(ranges[~lost] / 0.005, np.rint(ranges[~lost] / 0.005), atol=1e-9)


def test_mixed_readings_lie_between_an_edge_and_what_is_behind():
    sharp = Lidar(beams=360, noise=0.0, dropout=0.0, mixing=0.0, step=0.0)
    mixed = Lidar(beams=360, noise=0.0, dropout=0.0, mixing=1.0, step=0.0)
    pose = np.array([0.6, 1.0, 0.0])
    before = scan(FURNISHED, pose, np.random.default_rng(2), sharp)
    after = scan(FURNISHED, pose, np.random.default_rng(2), mixed)
    changed = np.flatnonzero(before != after)
    truth = cast_rays(FURNISHED, pose[:2], mixed.bearings)
    assert 2 <= len(changed) <= 3, "the box shows two or three corners"
    np.testing.assert_array_equal(before, truth)
    next_one = np.roll(before, -1)[changed]
    assert (after[changed] > np.minimum(before[changed], next_one)).all()
    assert (after[changed] < np.maximum(before[changed], next_one)).all()


def test_a_tour_keeps_clear_and_comes_back():
    poses = plan_tour(FURNISHED, np.random.default_rng(3), stops=8, clearance=0.3, spacing=0.1)
    x, y, heading = poses.T
    steps = np.hypot(np.diff(x), np.diff(y))
    assert steps.max() < 0.1 + 1e-9
    assert np.hypot(x[0] - x[-1], y[0] - y[-1]) < 0.5
    np.testing.assert_allclose(np.hypot(x[2:] - x[:-2], y[2:] - y[:-2]).mean(), 0.2, rtol=0.05)
    assert x.min() > 0.2
    assert x.max() < 4.8
    in_the_box = (x > 1.9) & (x < 3.1) & (y > 1.4) & (y < 2.3)
    assert not in_the_box.any()
    ahead = np.arctan2(np.diff(y), np.diff(x))
    off = np.angle(np.exp(1j * (heading[:-1] - ahead)))
    assert np.median(np.abs(off)) < 0.1


def test_a_tour_passes_the_stops_given():
    stops = [(0.6, 0.6), (4.4, 0.6), (4.4, 3.4)]
    poses = plan_tour(FURNISHED, np.random.default_rng(0), stops=stops)
    for x, y in stops:
        assert np.hypot(poses[:, 0] - x, poses[:, 1] - y).min() < 0.3


def test_a_tour_says_where_it_cannot_go():
    wall = np.array([[2.5, 0.0], [2.5, 4.0]])
    divided = World((*room().walls, wall))
    with pytest.raises(ValueError, match=r"no way to the stop near \(4\.\d+, 2\.0"):
        plan_tour(divided, np.random.default_rng(0), stops=[(1.0, 2.0), (4.0, 2.0)])


def test_pure_odometry_drifts_and_correction_holds_it():
    way = np.linspace(0.0, 40.0, 401)
    poses = np.stack([way, np.zeros(401), np.zeros(401)], axis=1)

    def last_errors(correction):
        odometry = Odometry(position=0.02, heading=0.01, correction=correction)
        ends = [
            estimate_poses(poses, np.random.default_rng(seed), odometry)[-1] - poses[-1]
            for seed in range(60)
        ]
        return np.std(ends, axis=0)

    free, held = last_errors(0.0), last_errors(0.4)
    assert free[2] == pytest.approx(0.01 * math.sqrt(40.0), rel=0.3)
    assert free[1] > 0.5, "a wrong heading bends the way aside"
    assert (held < 0.1).all()
    assert held[2] == pytest.approx(0.01 / math.sqrt(-2.0 * math.log(0.6)), rel=0.3)


def test_errors_drift_slowly():
    way = np.linspace(0.0, 60.0, 601)
    poses = np.stack([way, np.zeros(601), np.zeros(601)], axis=1)
    error = estimate_poses(poses, np.random.default_rng(5)) - poses
    for axis in error.T:
        assert np.corrcoef(axis[1:], axis[:-1])[0, 1] > 0.85
        assert abs(np.corrcoef(axis[100:], axis[:-100])[0, 1]) < 0.5


def test_without_error_the_robot_knows_where_it_is():
    poses = plan_tour(FURNISHED, np.random.default_rng(0))
    believed = estimate_poses(poses, np.random.default_rng(0), CERTAIN)
    np.testing.assert_allclose(believed[:, :2], poses[:, :2], atol=1e-12)


def test_each_scan_votes_once_on_a_cell():
    bearings = np.linspace(-0.01, 0.01, 50)
    ranges = np.full((1, 50), 0.52)
    grid = map_scans(np.array([[0.025, 0.025, 0.0]]), ranges, bearings, max_range=1.0, margin=0.0)
    np.testing.assert_allclose(grid.values, [[-0.4] * 10 + [0.85]])


def test_no_beam_frees_a_cell_in_which_another_of_its_scan_ends():
    ranges = np.array([[0.22, 0.52]])
    poses = np.array([[0.025, 0.025, 0.0]])
    grid = map_scans(poses, ranges, np.zeros(2), max_range=1.0, margin=0.0)
    np.testing.assert_allclose(grid.values, [[-0.4] * 4 + [0.85] + [-0.4] * 5 + [0.85]])


def test_lost_readings_say_nothing_and_silent_ones_clear():
    poses, bearings = np.array([[0.025, 0.025, 0.0]]), np.array([0.0, np.pi / 2.0])
    ranges = np.array([[np.inf, np.nan]])
    grid = map_scans(poses, ranges, bearings, max_range=0.5, margin=0.0)
    np.testing.assert_allclose(grid.values, [[-0.4] * 10])


def test_cells_are_bounded_and_thresholds_decide():
    poses, bearings = np.tile([[0.025, 0.025, 0.0]], (50, 1)), np.zeros(1)
    model = SensorModel(limit=2.0)
    ranges = np.full((50, 1), 0.32)
    grid = map_scans(poses, ranges, bearings, max_range=1.0, model=model, margin=0.1)
    assert grid.values.min() == pytest.approx(-2.0)
    assert grid.values.max() == pytest.approx(2.0)
    cells = grid.occupancy_grid(model).cells
    np.testing.assert_array_equal(cells[2], [-1, -1, 0, 0, 0, 0, 0, 0, 100, -1, -1])
    np.testing.assert_array_equal(cells[[0, 1, 3, 4]], -1)
    assert grid.origin == pytest.approx((-0.1, -0.1))


def test_probabilities_follow_from_log_odds():
    grid = LogOddsGrid(np.array([[0.0, math.log(3.0)]]), 0.05, (0.0, 0.0))
    np.testing.assert_allclose(grid.probability, [[0.5, 0.75]])


def test_a_perfect_robot_maps_the_box_where_it_is():
    grid = survey(FURNISHED, np.random.default_rng(0), lidar=PERFECT, odometry=CERTAIN).grid
    extent = occupied_extent(grid, 1.0, 0.8, 4.0, 3.0)
    np.testing.assert_allclose(extent, [2.0, 1.5, 3.0, 2.2], atol=grid.resolution + 1e-9)
    assert cell(grid, 1.0, 1.0) == 0
    assert cell(grid, 2.5, 1.85) == -1, "the inside of the box is never seen"
    assert cell(grid, -0.3, 2.0) == -1, "nor is what lies behind the walls"
    assert cell(grid, 5.3, 2.0) == -1
    known = grid.cells >= 0
    assert known.sum() * grid.resolution**2 == pytest.approx(5.0 * 4.0 - 1.0 * 0.7, rel=0.1)


def test_a_real_robot_maps_the_box_within_two_cells_and_leaves_artefacts():
    result = survey(FURNISHED, np.random.default_rng(1))
    extent = occupied_extent(result.grid, 1.0, 0.8, 4.0, 3.0)
    np.testing.assert_allclose(extent, [2.0, 1.5, 3.0, 2.2], atol=0.15)
    assert cell(result.grid, 2.5, 1.85) == -1
    perfect = survey(FURNISHED, np.random.default_rng(1), lidar=PERFECT, odometry=CERTAIN)
    walls, sharp = ((grid.cells == 100).sum() for grid in (result.grid, perfect.grid))
    assert walls > 1.1 * sharp, "walls come out a little double"


def test_what_furniture_hides_stays_unknown():
    wall_unit = SceneObject.from_rings([rectangle(2.0, 0.5, 2.2, 3.5)], "screen")
    poses = np.tile([[0.5, 2.0, 0.0]], (20, 1))
    grid = survey(room(wall_unit), np.random.default_rng(0), poses=poses).grid
    assert cell(grid, 1.0, 2.0) == 0
    assert cell(grid, 2.6, 2.0) == -1


def test_the_grid_lies_on_multiples_of_its_resolution():
    grid = survey(FURNISHED, np.random.default_rng(2), resolution=0.1, margin=0.4).grid
    corner = np.array(grid.origin[:2]) / 0.1
    np.testing.assert_allclose(corner, np.rint(corner), atol=1e-9)
    border = np.concatenate([grid.cells[:4].ravel(), grid.cells[:, :4].ravel()])
    assert (border == -1).all()


@pytest.mark.slow
def test_one_seed_one_map():
    first, again = (survey(FURNISHED, np.random.default_rng(7)) for _ in range(2))
    np.testing.assert_array_equal(first.grid.cells, again.grid.cells)
    np.testing.assert_array_equal(first.log_odds.values, again.log_odds.values)
    other = survey(FURNISHED, np.random.default_rng(8))
    assert (
        first.grid.cells.shape != other.grid.cells.shape
        or (first.grid.cells != other.grid.cells).any()
    )
