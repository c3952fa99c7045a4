"""How far lines stay from occupied cells, against shapely's distances from their squares."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.model import OccupancyGrid
from sketchmatch.pipeline.slices import finish
from sketchmatch.transfers.carrying import carried, course_between
from sketchmatch.transfers.features import ChangeReason, Feature, FeatureKind
from sketchmatch.transfers.obstacles import Obstacles
from tests.interpreted import compiled_only, examples
from tests.unit.test_carried import SAME, SCENE

POSES = st.sampled_from([(0.0, 0.0, 0.0), (-3.0, 2.0, 0.4), (0.5, -1.5, 2.0)])
RADII = st.sampled_from([0.0, 0.05, 0.1, 0.13, 0.2, 0.37, 0.8])


def squares(obstacles):
    """Return what is occupied, and all beyond the grid, as one shape."""
    size, (rows, columns) = obstacles.resolution, obstacles.blocked.shape
    x, y, yaw = obstacles.origin
    whole = shapely.box(0.0, 0.0, columns * size, rows * size)
    taken = shapely.union_all(
        [
            shapely.box(column * size, row * size, (column + 1) * size, (row + 1) * size)
            for row, column in np.argwhere(obstacles.blocked)
        ]
    )
    found = shapely.union(taken, whole.buffer(99.0, join_style="mitre").difference(whole))
    c, s = math.cos(yaw), math.sin(yaw)
    return shapely.transform(found, lambda p: p @ np.array([[c, s], [-s, c]]) + (x, y))


def cluttered(seed, origin, share, side=30):
    """Return a grid with specks and bars on it."""
    rng = np.random.default_rng(seed)
    blocked = rng.random((side, side + 7)) < share
    for _ in range(3):
        row, column = rng.integers(2, side - 2, 2)
        height, width = rng.integers(1, 9, 2)
        blocked[row : row + height, column : column + width] = True
    return Obstacles(blocked, 0.1, origin)


@given(st.integers(0, 2**32), POSES, RADII, st.sampled_from([0.0, 0.02, 0.2]))
@examples(60)
def test_a_leg_is_clear_where_its_distance_from_all_squares_is_the_radius(
    seed, origin, radius, share
):
    obstacles = cluttered(seed, origin, share)
    rng = np.random.default_rng(seed + 1)
    lengths = rng.choice([0.3, 2.0, 15.0], (40, 1))
    local = rng.uniform(-1.0, 38.0, (40, 2)) + lengths * rng.normal(size=(2, 40, 2))
    legs = obstacles.placed(np.swapaxes(local, 0, 1).reshape(-1, 2)).reshape(40, 2, 2)
    taken, kept = squares(obstacles), max(radius, 0.05)
    found = [obstacles.line_is_clear(leg, radius) for leg in legs]
    for leg, clear in zip(legs, found, strict=True):
        away = shapely.LineString(leg).distance(taken)
        assert clear == (away >= kept) or away == pytest.approx(kept, abs=1e-9)
    points = [obstacles.clear(leg, radius) for leg in legs]
    for leg, clear in zip(legs, points, strict=True):
        for place, one in zip(leg, clear, strict=True):
            away = shapely.Point(place).distance(taken)
            assert one == (away >= kept) or away == pytest.approx(kept, abs=1e-9)


@given(st.integers(0, 2**32), POSES, st.sampled_from([0.0, 0.03, 0.3]))
@examples(40)
def test_middles_and_cells_have_at_least_the_room_that_is_said(seed, origin, share):
    obstacles = cluttered(seed, origin, share, side=14)
    taken = squares(obstacles)
    for row, column in np.ndindex(obstacles.blocked.shape):
        middle = obstacles.places(np.array([[row, column]]))[0]
        away = shapely.Point(middle).distance(taken)
        assert away - 0.25 * 0.1 <= obstacles.clearance[row, column] <= away
        cell = shapely.Polygon(
            obstacles.placed(np.add([row, column], [[0, 0], [0, 1], [1, 1], [1, 0]]))
        )
        apart = cell.distance(taken)
        assert obstacles.room[row, column] * 0.1 == pytest.approx(apart, abs=1e-6)
        assert obstacles.room[row, column] * 0.1 <= apart + 1e-12


@compiled_only
@pytest.mark.slow
@given(st.integers(0, 2**32), POSES, RADII, st.sampled_from([0.0, 0.003, 0.01]))
@examples(150)
def test_a_carried_route_keeps_its_radius_from_every_square(seed, origin, radius, share):
    obstacles = cluttered(seed, origin, share, side=60)
    rng = np.random.default_rng(seed + 1)
    points = obstacles.placed(rng.uniform(1.0, 59.0, (rng.integers(2, 6), 2)))
    way = Feature(FeatureKind.ROUTE, (points,), "way")
    course = course_between(SCENE, SCENE, SAME, features=[way])
    (found,) = finish(carried([way], course, obstacles, radius, "m"))
    if found.feature is None:
        assert found.changes
        return
    line = shapely.LineString(found.feature.points)
    assert line.distance(squares(obstacles)) >= max(radius, 0.05) - 1e-9
    if not found.changes:
        np.testing.assert_allclose(found.feature.points[[0, -1]], points[[0, -1]], atol=1e-6)


@pytest.mark.parametrize(
    ("wide", "radius", "is_taken"),
    [(7, 0.2, True), (7, 0.345, True), (7, 0.351, False), (6, 0.28, True), (6, 0.301, False)],
)
def test_a_door_as_wide_as_the_robot_and_a_little_is_taken(wide, radius, is_taken):
    """Doors of 0.6 and 0.7 m; along the middles of their cells there is less room, but for 0.2."""
    cells = np.zeros((80, 80), dtype=np.int8)
    cells[:, 40:42] = 100
    cells[50 : 50 + wide, 40:42] = 0
    obstacles = Obstacles.of_grid(OccupancyGrid(cells, 0.1), False)
    way = Feature(FeatureKind.ROUTE, (np.array([[2.0, 4.0], [6.0, 4.0]]),), "way")
    course = course_between(SCENE, SCENE, SAME, features=[way])
    (found,) = finish(carried([way], course, obstacles, radius, "m"))
    expected = ChangeReason.OBSTACLE if is_taken else ChangeReason.UNREACHABLE
    assert found.changes[0].reason is expected
    line = shapely.LineString(found.feature.points)
    assert line.distance(squares(obstacles)) >= radius - 1e-9
