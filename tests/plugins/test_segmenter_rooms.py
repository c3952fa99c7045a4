"""The segmenter of rooms, on floors drawn here and on real robots' maps."""

import contextlib

import cv2
import numpy as np
import pytest
import shapely.affinity
from hypothesis import example, given
from hypothesis import strategies as st

from sketchmatch import match
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io import read_source
from sketchmatch.model import OccupancyGrid
from sketchmatch_builtin.segmenters.rooms import RoomSegmenter, _coarser
from tests.interpreted import examples
from tests.plugins.test_segmenter_lidar import doubled, lost, turned
from tests.tools import ROOT, require

CELL = 0.05


def segmented(cells, cell=CELL, **params):
    grid = cells if isinstance(cells, OccupancyGrid) else OccupancyGrid(cells, cell)
    return RoomSegmenter(RoomSegmenter.Params(**params)).segment(grid)


def free(cells, *boxes):
    """Make boxes (x, y, width, height), in metres, free."""
    for box in boxes:
        x, y, width, height = (round(value / CELL) for value in box)
        cells[y : y + height, x : x + width] = 0
    return cells


def walls(width, height):
    return np.full((round(height / CELL), round(width / CELL)), 100, np.int8)


def floor():
    """Three rooms above a corridor and two below, one of them an L: all with doors of 0.9 m."""
    return free(
        walls(12.2, 9.2),
        (0.2, 5.2, 3.0, 3.8),
        (3.4, 5.2, 4.0, 3.8),
        (7.6, 5.2, 4.4, 3.8),
        (0.2, 3.4, 11.8, 1.6),  # the corridor
        (0.2, 0.2, 4.0, 3.0),
        (4.4, 0.2, 7.6, 1.4),
        (9.4, 1.6, 2.6, 1.6),  # with the box above it an L
        (1.0, 5.0, 0.9, 0.2),
        (5.0, 5.0, 0.9, 0.2),
        (9.0, 5.0, 0.9, 0.2),
        (2.0, 3.2, 0.9, 0.2),
        (10.0, 3.2, 0.9, 0.2),
    )


AREAS = [3.0 * 3.8, 4.0 * 3.8, 4.4 * 3.8, 11.8 * 1.6, 4.0 * 3.0, 7.6 * 1.4 + 2.6 * 1.6]


def areas(found):
    return [item.area for item in found.scene.objects]


def test_a_floors_rooms_are_found_in_reading_order():
    found = segmented(floor(), door_width=1.2)
    assert areas(found) == pytest.approx(AREAS, rel=0.03)
    assert found.warnings == ()


def test_rooms_that_a_door_joins_open_into_each_other_and_no_others():
    found = segmented(floor(), door_width=1.2)
    corridor = max(range(6), key=lambda k: np.ptp(found.scene.objects[k].polygon.bounds[::2]))
    assert found.passages == tuple(
        (min(k, corridor), max(k, corridor)) for k in range(6) if k != corridor
    )


@pytest.mark.slow
def test_rooms_do_not_overlap_and_keep_off_walls():
    polygons = [item.polygon for item in segmented(floor()).scene.objects]
    tree = shapely.STRtree(polygons)
    assert (np.diff(tree.query(polygons, predicate="intersects"), axis=0) == 0).all()
    space = shapely.union_all(
        [shapely.box(x, y, x + CELL, y + CELL) for y, x in np.argwhere(floor() == 0) * CELL]
    )
    assert shapely.union_all(polygons).difference(space.buffer(CELL)).area == 0.0


def test_furniture_and_speckle_belong_to_the_room_around_them():
    cells = floor()
    rng = np.random.default_rng(0)
    cells[110:125, 80:100] = 100
    cells[150:160, 165:195] = -1
    inside = np.argwhere(cells == 0)
    cells[tuple(inside[rng.permutation(len(inside))[:300]].T)] = 100
    found = segmented(cells, door_width=1.2)
    assert areas(found) == pytest.approx(AREAS, rel=0.06)
    assert all(len(item.rings) == 1 for item in found.scene.objects)


def test_what_is_longer_than_furniture_is_a_hole():
    cells = floor()
    cells[131:153, 97:119] = -1
    assert [len(item.rings) for item in segmented(cells, door_width=1.2).scene.objects] == [1] * 6
    longer = segmented(cells, door_width=1.2, furniture=1.0).scene.objects[1]
    assert len(longer.rings) == 2
    assert longer.area == pytest.approx(AREAS[1] - 1.1 * 1.1, rel=0.03)


@pytest.mark.parametrize("gap", [0.8, 1.0, 1.2])
def test_passages_as_wide_as_door_width_are_cut_and_no_wider(gap):
    cells = free(walls(8.6, 4.4), (0.2, 0.2, 4.0, 4.0), (4.4, 0.2, 4.0, 4.0), (4.2, 1.0, 0.2, gap))
    assert areas(segmented(cells, door_width=gap)) == pytest.approx([16.0, 16.0], rel=0.03)
    with pytest.raises(InvalidInputError, match="has only one room"):
        segmented(cells, door_width=gap - 0.1)


def test_a_corridor_as_narrow_as_a_door_is_a_room():
    cells = free(
        walls(9.4, 8.0),
        (0.2, 0.2, 4.0, 3.0),
        (4.6, 0.2, 4.4, 3.0),
        (0.2, 3.4, 9.0, 1.0),
        (0.2, 4.6, 9.0, 3.0),
        (1.0, 3.2, 0.8, 0.2),
        (6.0, 3.2, 0.8, 0.2),
        (3.0, 4.4, 0.8, 0.2),
    )
    assert areas(segmented(cells)) == pytest.approx([27.0, 9.0, 12.0, 13.2], rel=0.06)


@pytest.mark.parametrize("degrees", [0.0, 37.0])
def test_narrow_rooms_that_a_door_joins_are_two(degrees):
    # Beside rooms of 6 m a passage of 2.1 m is a doorway, and the hall and the bath are narrower.
    cells = free(
        walls(12.6, 10.0),
        (0.2, 0.2, 6.0, 6.0),
        (6.4, 0.2, 6.0, 6.0),
        (6.2, 3.0, 0.2, 0.8),
        (0.2, 6.4, 4.0, 1.4),  # the hall
        (3.0, 6.2, 0.8, 0.2),
        (0.2, 8.0, 4.0, 1.8),  # the bath
        (1.0, 7.8, 0.8, 0.2),
    )
    grid = OccupancyGrid(cells, CELL)
    found = sorted(areas(segmented(turned(grid, degrees)[0] if degrees else grid)))
    assert found == pytest.approx([5.6, 7.2, 36.0, 36.0], rel=0.06)


def test_a_corridor_that_narrows_a_little_stays_whole():
    cells = floor()
    for x in range(20, 230, 50):
        cells[68:80, x : x + 4] = 100  # juts 0.6 m out: 1.0 m of 1.6 are left
        cells[68:76, x : x + 4] = 0
    found = segmented(cells, door_width=1.2)
    assert areas(found)[3] == pytest.approx(AREAS[3], rel=0.06)
    assert len(found.scene) == 6


def between_rooms(*corridors, degrees):
    """Areas of what is found of corridors between four closed rooms, in m²."""
    cells = free(walls(12.2, 12.2), *corridors)
    rooms = [(x, y, 4.4, 4.4) for x in (0.2, 7.6) for y in (0.2, 7.6)]
    grid = OccupancyGrid(free(cells, *rooms), CELL)
    grid = turned(grid, degrees)[0] if degrees else grid
    found = sorted(areas(segmented(grid, door_width=1.7)))
    closed = [area for area in found if area == pytest.approx(19.4, rel=0.01)]
    assert len(closed) == 4
    return [area for area in found if area not in closed]


UP, ACROSS = (5.4, 0.2, 1.6, 11.8), (0.2, 5.4, 11.8, 1.6)


@pytest.mark.parametrize("degrees", [0.0, 37.0])
@pytest.mark.parametrize(
    ("corridors", "area"),
    [
        ([UP, ACROSS], 35.2),
        ([(5.4, 0.2, 1.6, 5.4), ACROSS], 27.2),
        ([(5.4, 1.2, 1.6, 5.8), (0.2, 5.4, 6.8, 1.6)], 17.6),
    ],
    ids=["crossing", "meeting", "bending"],
)
def test_corridors_a_little_narrower_than_a_doorway_are_one_where_they_meet(
    corridors, area, degrees
):
    assert between_rooms(*corridors, degrees=degrees) == pytest.approx([area], rel=0.06)


@pytest.mark.parametrize("degrees", [0.0, 37.0])
def test_a_lobby_at_the_end_of_a_corridor_is_a_room(degrees):
    found = between_rooms(
        (5.4, 2.0, 1.6, 8.4), (5.0, 0.2, 2.4, 2.4), (5.0, 9.8, 2.4, 2.4), degrees=degrees
    )
    assert found == pytest.approx([6.2, 6.2, 10.2], rel=0.06)


@pytest.mark.parametrize("size", [0.5, 1.0])
def test_the_width_of_doorways_is_found_from_the_map(size):
    """Whole and at half its size, where a door of 0.45 m is as wide beside its rooms."""
    assert len(segmented(floor(), cell=CELL * size, min_area=2.0 * size**2).scene) == 7
    with pytest.raises(InvalidInputError, match=r"passages of up to 0\.3 m"):
        segmented(floor(), cell=CELL * size, door_width=0.3)


def opened(*more):
    """A corridor of 3 × 20 m with an end that is closed, and a room open to it by 3.4 m."""
    cells = walls(27.0, 12.0)
    free(cells, (0.2, 3.0, 20.0, 3.0), (8.0, 6.2, 5.0, 4.6), (8.8, 6.0, 3.4, 0.2))
    # Behind a door, so that there are two rooms in any case.
    free(cells, (20.4, 2.0, 5.0, 5.0), (20.2, 4.0, 0.2, 0.9))
    return free(cells, *more)


def test_a_room_that_opens_into_a_corridor_wider_than_a_door_is_a_room():
    assert areas(segmented(opened())) == pytest.approx([23.0, 25.0, 60.0], rel=0.05)
    # Not where a width was asked for.
    assert areas(segmented(opened(), door_width=2.1)) == pytest.approx([84.0, 25.0], rel=0.05)


@pytest.mark.parametrize(("x", "width"), [(8.0, 5.0), (8.4, 4.2)])
def test_what_opens_nearly_as_wide_as_it_is_belongs_to_what_it_opens_into(x, width):
    found = areas(segmented(opened((x, 6.0, width, 0.2))))
    assert found == pytest.approx([84.0, 25.0], rel=0.05)


def test_what_lies_between_two_parts_of_a_corridor_belongs_to_both():
    cells = walls(31.0, 9.0)
    free(cells, (0.2, 3.0, 9.0, 3.0), (9.2, 3.2, 0.2, 2.6), (9.4, 2.0, 5.0, 5.0))
    free(cells, (14.4, 3.2, 0.2, 2.6), (14.6, 3.0, 9.0, 3.0), (23.8, 2.0, 5.0, 4.8))
    free(cells, (23.6, 4.0, 0.2, 0.9))
    assert areas(segmented(cells)) == pytest.approx([80.0, 24.0], rel=0.05)


def test_a_hall_that_narrows_stays_whole():
    cells = walls(31.0, 9.0)
    for step in range(20):
        free(cells, (0.2 + step, 0.2, 1.0, 7.8 - 0.2 * step))
    free(cells, (20.4, 0.2, 5.0, 5.0), (20.2, 1.0, 0.2, 0.9))
    assert areas(segmented(cells)) == pytest.approx([118.0, 25.0], rel=0.05)


def test_corridors_around_each_other_are_rooms_with_what_they_go_around_left_out():
    # Corridors of 2 m around each other, each with a door to the next.
    cells, count = walls(52.2, 52.2), 11
    for k in range(count):
        side = 51.8 - 4.4 * k
        low = 0.2 + 2.2 * k
        free(cells, (low, low, side, side))
        low, side = low + 2.0, side - 4.0
        cells[round(low / CELL) : round((low + side) / CELL), round(low / CELL) :][
            :, : round(side / CELL)
        ] = 100
        if k < count - 1:
            free(cells, (low + side / 3.0, low, 0.8, 0.2))
    found = segmented(cells)
    sides = 51.8 - 4.4 * np.arange(count)
    assert areas(found) == pytest.approx(sides**2 - (sides - 4.0) ** 2, rel=0.03)
    assert found.passages == tuple((k, k + 1) for k in range(count - 1))


def test_rays_of_a_laser_through_glass_are_no_room():
    cells = np.pad(floor(), ((0, 160), (0, 0)), constant_values=-1)
    rows, columns = np.mgrid[: len(cells), : cells.shape[1]]
    turn = np.arctan2(columns - 100, rows - 100)
    beam = (rows >= 180) & (abs(turn) < 0.5) & (np.floor(turn * 40) % 2 == 0)
    cells[beam] = 0
    plain = segmented(floor(), door_width=1.2)
    found = segmented(cells, door_width=1.2)
    assert sorted(areas(found)) == pytest.approx(sorted(areas(plain)), rel=0.06)


@pytest.mark.parametrize("length", [1.8, 3.0])
def test_the_inside_of_a_cupboards_outline_is_no_room(length):
    cells = floor()
    x = round(length / CELL)
    cells[168:180, 80 : 80 + x] = 100
    cells[170:178, 82 : 78 + x] = 0
    assert len(segmented(cells, door_width=1.2, min_area=0.5).scene) == 6


def test_min_area_leaves_small_rooms_out_and_the_others_as_they_are():
    found = segmented(floor(), door_width=1.2, min_area=12.5)
    assert areas(found) == pytest.approx([AREAS[k] for k in (1, 2, 3, 5)], rel=0.03)


def test_rooms_behind_closed_doors_count():
    cells = free(walls(9.0, 4.4), (0.2, 0.2, 4.0, 4.0), (4.4, 0.2, 4.0, 3.0))
    assert areas(segmented(cells)) == pytest.approx([16.0, 12.0])


def test_a_map_of_millions_of_cells_has_the_rooms_of_the_same_on_fewer():
    # 4.5 million, at places that are odd.
    large = np.pad(np.kron(floor(), np.ones((10, 10), np.int8)), ((3, 0), (5, 4)))
    large[:3] = large[:, :5] = large[:, -4:] = 100
    found = segmented(OccupancyGrid(large, CELL / 10, (-5 * CELL / 10, -3 * CELL / 10, 0.0)))
    plain = segmented(floor())
    assert areas(found) == pytest.approx(areas(plain), rel=0.05)
    for a, b in zip(found.scene.objects, plain.scene.objects, strict=True):
        assert a.polygon.hausdorff_distance(b.polygon) < 4 * CELL


def test_a_wall_one_cell_thick_parts_rooms_among_millions_of_cells():
    cells = np.zeros((2101, 2101), np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = cells[:, 801] = 100
    found = segmented(OccupancyGrid(cells, 0.01))
    assert areas(found) == pytest.approx([8.0 * 20.99, 12.98 * 20.99], rel=0.003)


@pytest.mark.parametrize(
    ("cells", "door", "step"),
    [
        (4_000_000, 500.0, 1),
        (4_000_001, 500.0, 2),
        (16_000_001, 500.0, 3),
        (16_000_001, 59.9, 2),
        (16_000_001, 39.9, 1),
        (16_000_001, 1.0, 1),
    ],
)
def test_cells_are_looked_at_as_one_as_long_as_doorways_are_wide_enough(cells, door, step):
    assert _coarser(cells, door) == step


TOO_FEW = {
    "no free cell": (np.full((5, 5), -1, np.int8), "has no free cell"),
    "a closet": (free(walls(3, 3), (1, 1, 1, 1)), "has no room of at least 2 m² .*lower min_area"),
    "one room": (free(walls(5, 5), (1, 1, 3, 3)), "has only one room .*raise door_width"),
}


@pytest.mark.parametrize("case", TOO_FEW)
def test_too_few_rooms_say_what_was_found_and_the_remedy(case):
    cells, words = TOO_FEW[case]
    with pytest.raises(InvalidInputError, match=words) as caught:
        segmented(cells)
    assert (caught.value.field, caught.value.reason) == ("cells", Reason.TOO_FEW_OBJECTS)


def offices(rng):
    """Offices on both sides of a corridor, their walls, doors and furniture at random."""
    count = int(rng.integers(2, 5))
    cells = walls(0.2 + 4.2 * count, 9.8)
    free(cells, (0.2, 4.2, 4.2 * count - 0.2, 1.4))
    for k in range(count):
        for y, door in ((0.2, 4.0), (5.8, 5.6)):
            depth = rng.uniform(2.6, 3.8)
            bottom = y if y > 1 else 4.0 - depth
            free(cells, (0.2 + 4.2 * k, bottom, 4.0, depth))
            free(cells, (0.4 + 4.2 * k + rng.uniform(0, 2.6), door, 0.9, 0.2))
    rows, columns = cells.shape
    speckle = rng.random((rows, columns)) < 0.002
    cells[speckle & (cells == 0)] = 100
    return cells, 2 * count + 1


@given(st.integers(0, 2**32 - 1))
@examples(30)
def test_offices_at_a_corridor_are_counted(seed):
    cells, count = offices(np.random.default_rng(seed))
    assert len(segmented(cells).scene) == count


def apart_when_turned(cells, turns, **params):
    """How many m² the rooms of a turned map and the turned rooms of the map are apart at most."""
    height, width = CELL * np.array(cells.shape)
    polygons = [item.polygon for item in segmented(cells, **params).scene.objects]
    for _ in range(turns):
        # A point (x, y) comes to (y, width − x).
        polygons = [
            shapely.affinity.affine_transform(polygon, (0, 1, -1, 0, 0, width))
            for polygon in polygons
        ]
        height, width = width, height
    turned = [item.polygon for item in segmented(np.rot90(cells, turns), **params).scene.objects]
    assert len(turned) == len(polygons)
    return max(
        min(shapely.symmetric_difference(polygon, other).area for other in turned)
        for polygon in polygons
    )


@given(st.integers(0, 2**32 - 1), st.integers(1, 3))
@example(145904628, 2)
@examples(20)
def test_a_turned_map_has_the_rooms_turned(seed, turns):
    assert apart_when_turned(offices(np.random.default_rng(seed))[0], turns) < 1e-9


def test_rooms_that_meet_at_the_corners_of_a_cell_in_their_wall_are_two():
    cells = free(walls(8.55, 4.4), (0.2, 0.2, 4.0, 4.0), (4.35, 0.2, 4.0, 4.0))
    # A cell of each room's in the wall, and one between that touches them by its corners alone.
    cells[50, 84] = cells[51, 85] = cells[50, 86] = 0
    assert areas(segmented(cells)) == pytest.approx([16.0, 16.0], rel=0.01)


@pytest.mark.parametrize("turns", [1, 2, 3])
@pytest.mark.parametrize("second", [4.0, 3.0])
def test_the_middle_of_a_doorway_goes_to_one_room_however_the_map_lies(second, turns):
    # A door 5 cells deep: the third is as near to both rooms, which may be as large as each other.
    cells = free(
        walls(13.1, 4.4),
        (0.2, 0.2, 4.0, 4.0),
        (4.2, 1.7, 0.25, 0.8),
        (4.45, 0.2, 4.0, second),
        (8.7, 0.2, 4.2, 4.0),
    )
    assert len(segmented(cells).scene) == 3
    assert apart_when_turned(cells, turns, tolerance=0.0) < 1e-9


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_room_with_two_farthest_corners_is_simplified_alike_however_the_map_lies(turns):
    rows, columns = np.mgrid[:70, :70]
    gable = np.where((abs(columns - 35) < 31) & (rows + 0.37 * abs(columns - 35) < 60), 0, 100)
    cells = np.hstack([gable, gable[:, ::-1]]).astype(np.int8)
    assert apart_when_turned(cells, turns) < 1e-9


@given(st.integers(0, 2**32 - 1))
@examples(20)
def test_padding_and_scaling_the_map_does_that_to_the_rooms(seed):
    cells, _ = offices(np.random.default_rng(seed))
    plain = [item.polygon for item in segmented(cells, door_width=1.2).scene.objects]
    padded = OccupancyGrid(np.pad(cells, 7, constant_values=-1), CELL, (-7 * CELL, -7 * CELL, 0.0))
    again = [item.polygon for item in segmented(padded, door_width=1.2).scene.objects]
    assert shapely.equals_exact(plain, again, tolerance=1e-9).all()
    scaled = segmented(cells, cell=0.1, door_width=2.4, min_area=8.0, furniture=4.0).scene.objects
    for small, large in zip(plain, scaled, strict=True):
        assert large.area == pytest.approx(4.0 * small.area)


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1))
def test_any_grid_gives_valid_rooms_apart_or_one_sentence(seed):
    rng = np.random.default_rng(seed)
    cells = np.kron(rng.choice([0, 0, 0, 100, -1], (14, 14)), np.ones((3, 3))).astype(np.int8)
    with contextlib.suppress(InvalidInputError):
        found = segmented(
            OccupancyGrid(cells, 0.1),
            min_area=0.05,
            door_width=0.3,
            furniture=0.4,
            tolerance=float(rng.choice([0.0, 0.1, 0.5])),
        )
        polygons = [item.polygon for item in found.scene.objects]
        assert all(polygon.is_valid and polygon.area > 0.0 for polygon in polygons)
        pairs = shapely.STRtree(polygons).query(polygons, predicate="intersects")
        assert (pairs[0] == pairs[1]).all()


def test_a_floor_turned_by_90_degrees_is_matched_with_itself():
    scene = segmented(floor()).scene
    turned = segmented(np.rot90(floor())).scene
    found = match(scene, turned, seed=0)
    # A point (x, y) comes to (y, width − x).
    targets = np.array([item.centroid for item in turned.objects])
    for k, item in enumerate(scene.objects):
        x, y = item.centroid
        nearest = np.hypot(*(targets - (y, floor().shape[1] * CELL - x)).T).argmin()
        assert found.object_map[k] == nearest


def real_map(name):
    path = ROOT.parent / "shared" / "data" / "ogm" / name
    require(path.exists(), f"the real map {name}")
    return read_source(path)


def test_the_small_office_is_two_rooms_joined_by_two_metres():
    found = segmented(real_map("pmb2-small-office/map.yaml"))
    assert areas(found) == pytest.approx([46.7, 95.3], rel=0.02)


@pytest.mark.parametrize(
    "name",
    [
        "turtlebot3/map.yaml",
        "nav2-depot/depot.yaml",
        "husky-playpen/playpen_map.yaml",
    ],
)
def test_maps_of_one_room_say_so(name):
    with pytest.raises(InvalidInputError, match="has only one room"):
        segmented(real_map(name))


FLOORS = {
    "Freiburg101_scan": 20,
    "Freiburg52_scan": 17,
    "lab_a_scan": 90,
    "lab_c_scan": 30,
    "lab_intel": 46,
    "office_a": 49,
    "office_c": 68,
    "office_e": 63,
    "office_g": 72,
    "office_i": 54,
}
"""How many of the rooms marked by hand are found, of the floor empty and with furniture."""


TURNED = {
    "Freiburg101_scan": (10, 10),
    "Freiburg52_scan": (9, 9),
    "lab_a_scan": (60, 60),
    "lab_c_scan": (20, 20),
    "lab_intel": (28, 27),
    "office_a": (30, 27),
    "office_c": (34, 34),
    "office_e": (37, 37),
    "office_g": (36, 36),
    "office_i": (27, 27),
}
"""How many rooms are found, and how many of these on the floor turned by 37°."""

MORE_TURNED = {"office_a": 5}
"""How many rooms more there are then: parts of its corridors, which are as wide as a doorway."""


@pytest.mark.slow
@pytest.mark.parametrize("name", TURNED)
def test_turning_a_floor_by_37_degrees_loses_few_rooms(name):
    grid = OccupancyGrid(floor_of(name), CELL)
    moved, back = turned(grid)
    before = [item.polygon for item in segmented(grid).scene.objects]
    after = [back(item.polygon) for item in segmented(moved).scene.objects]
    count, kept = TURNED[name]
    assert len(before) == count
    assert lost(before, after) <= count - kept
    assert lost(after, before) <= MORE_TURNED.get(name, 0)


MORE = {"lab_intel": 1, "office_a": 1}
"""How many rooms more are found on cells of half the size: of places as wide as a doorway."""


@pytest.mark.slow
@pytest.mark.parametrize("name", TURNED)
def test_cells_of_half_the_size_lose_no_room(name):
    grid = OccupancyGrid(floor_of(name), CELL)
    before = [item.polygon for item in segmented(grid).scene.objects]
    after = [item.polygon for item in segmented(doubled(grid)[0]).scene.objects]
    assert lost(before, after) == 0
    assert lost(after, before) <= MORE.get(name, 0)


def floor_of(name):
    path = ROOT.parent / "shared" / "data" / "floors-ipa" / f"{name}.png"
    require(path.exists(), f"the floor {name}")
    shades = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    return np.where(shades > 250, 0, 100).astype(np.int8)[::-1].copy()


def marked(name):
    """The rooms of a floor that people marked, numbered from 1."""
    path = ROOT.parent / "shared" / "data" / "floors-ipa" / f"{name}_gt_segmentation.png"
    require(path.exists(), f"the floor {name}")
    shades = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(
        (shades > 250).astype(np.uint8), connectivity=4
    )
    large = np.flatnonzero(statistics[:, cv2.CC_STAT_AREA] >= 20)[1:]
    numbers = np.zeros(len(statistics), np.int64)
    numbers[large] = np.arange(1, len(large) + 1)
    return numbers[labels], len(large)


def found_of(name, truth, count):
    """How many of the marked rooms have a room that shares half of what both cover."""
    cells = floor_of(name)
    found = np.zeros(cells.shape, np.int32)
    for number, item in enumerate(segmented(cells).scene.objects, 1):
        corners = [np.round(ring / CELL - 0.5).astype(np.int32) for ring in item.rings]
        cv2.fillPoly(found, corners, number)
    both = np.zeros((count + 1, int(found.max()) + 1))
    np.add.at(both, (truth.reshape(-1), found[::-1].reshape(-1)), 1.0)
    either = both.sum(axis=1)[:, None] + both.sum(axis=0) - both
    return int(((both / either)[1:, 1:].max(axis=1) > 0.5).sum())


@pytest.mark.slow
@pytest.mark.parametrize("name", FLOORS)
def test_rooms_that_people_marked_are_found(name):
    truth, count = marked(name)
    found = found_of(name, truth, count) + found_of(f"{name}_furnitures", truth, count)
    assert found >= FLOORS[name]
