"""The segmenter of occupancy grids, on grids drawn here and on real robots' maps."""

import contextlib

import cv2
import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io import read_source
from sketchmatch.model import OccupancyGrid
from sketchmatch.model.limits import SourceLimits, limited_to
from sketchmatch_builtin.segmenters import occupancy_grid
from sketchmatch_builtin.segmenters._border import outer_border, outer_borders
from sketchmatch_builtin.segmenters._cells import holes
from sketchmatch_builtin.segmenters.occupancy_grid import OccupancyGridSegmenter
from tests.tools import ROOT, require


def segmented(grid, **params):
    return OccupancyGridSegmenter(OccupancyGridSegmenter.Params(**params)).segment(grid)


def room(*boxes, shape=(40, 60), inside=100, **grid):
    """A walled room of free cells with boxes (row, column, rows, columns) in it."""
    cells = np.zeros(shape, np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    for row, column, rows, columns in boxes:
        cells[row : row + rows, column : column + columns] = inside
    return OccupancyGrid(cells, **{"resolution": 0.1, **grid})


TWO = ((10, 10, 6, 9), (20, 30, 5, 5))


def corners(item):
    return sorted(tuple(point) for point in np.round(item.rings[0], 9).tolist())


def test_boxes_are_traced_exactly_in_metres():
    found = segmented(room(*TWO, origin=(-3.0, 1.0, 0.0)))
    high, low = found.scene.objects
    assert corners(high) == [(0.0, 3.0), (0.0, 3.5), (0.5, 3.0), (0.5, 3.5)]
    assert corners(low) == [(-2.0, 2.0), (-2.0, 2.6), (-1.1, 2.0), (-1.1, 2.6)]
    assert low.area == pytest.approx(0.54)
    assert found.warnings == ()


def test_objects_come_from_the_top_down_and_then_from_the_left():
    found = segmented(room((5, 40, 4, 4), (5, 10, 4, 4), (25, 50, 4, 4), (25, 20, 4, 4)))
    centres = [tuple(np.round(item.centroid, 6)) for item in found.scene.objects]
    assert centres == [(2.2, 2.7), (5.2, 2.7), (1.2, 0.7), (4.2, 0.7)]


@pytest.mark.parametrize("yaw", [0.3, np.pi / 2, -2.0])
def test_the_origins_yaw_turns_objects_about_the_origin(yaw):
    still = segmented(room(*TWO)).scene
    turned = segmented(room(*TWO, origin=(7.0, -2.0, yaw))).scene
    c, s = np.cos(yaw), np.sin(yaw)
    for before, after in zip(still.objects, turned.objects, strict=True):
        assert np.allclose(after.rings[0], before.rings[0] @ [[c, s], [-s, c]] + (7.0, -2.0))


def test_an_object_of_one_cell_keeps_its_area():
    found = segmented(room((10, 10, 1, 1), (20, 20, 1, 2)), min_size=0.0)
    assert [item.area for item in found.scene.objects] == pytest.approx([0.02, 0.01])


def test_the_unseen_inside_of_an_outline_belongs_to_it():
    grid = room((10, 10, 8, 8), (20, 30, 5, 5))
    cells = grid.cells.copy()
    cells[11:17, 11:17] = -1
    cells[13:15, 13:15] = 0  # seen through a hole, but no part of the free region
    found = segmented(OccupancyGrid(cells, 0.1))
    assert found.scene.objects[1].area == pytest.approx(0.64)


def test_a_thing_never_seen_is_an_object_whatever_its_grey():
    assert len(segmented(room(*TWO, inside=-1)).scene) == 2
    assert len(segmented(room(*TWO, inside=60)).scene) == 2


def test_walls_and_what_lies_behind_them_are_left_out():
    cells = np.full((40, 80), -1, np.int8)
    cells[:, :60] = room(*TWO).cells
    cells[10:14, 62:70] = 0
    cells[11:12, 64:66] = 100
    assert len(segmented(OccupancyGrid(cells, 0.1)).scene) == 2


def test_a_free_region_up_to_the_maps_edge_has_the_same_objects():
    grid = room(*TWO)
    assert len(segmented(OccupancyGrid(grid.cells[1:-1, 1:-1], 0.1)).scene) == 2


def test_free_cells_that_meet_in_a_corner_alone_are_apart():
    cells = room((5, 5, 20, 20), (20, 40, 5, 5)).cells.copy()
    for k in range(20):
        cells[5 + k, 5 + k] = 0  # a slit through the block that only corners join
    found = segmented(OccupancyGrid(cells, 0.1), close_gaps=0.0, tolerance=0.0)
    # Its two ends are open to the room, so that of the block two cells are missing.
    assert [item.area for item in found.scene.objects] == pytest.approx([3.98, 0.25])


def test_min_size_is_the_side_of_a_square_of_the_same_area():
    grid = room((5, 5, 2, 8), (20, 20, 4, 4), (30, 40, 3, 5))
    assert len(segmented(grid, min_size=0.38).scene) == 3
    assert len(segmented(grid, min_size=0.39).scene) == 2


def test_free_threshold_says_which_occupancy_is_free():
    grid = room(*TWO, inside=40)
    assert len(segmented(grid).scene) == 2
    with pytest.raises(InvalidInputError):
        segmented(grid, free_threshold=41)


def gapped(width):
    """Two boxes in outline, one with a gap of some cells."""
    cells = room((10, 10, 12, 12), (10, 40, 12, 12)).cells.copy()
    cells[11:21, 11:21] = cells[11:21, 41:51] = 0
    cells[14 : 14 + width, 10] = 0
    return OccupancyGrid(cells, 0.1)


@pytest.mark.parametrize("cells", [1, 2, 3, 4])
def test_a_gap_as_wide_as_close_gaps_is_closed_and_no_wider(cells):
    full = pytest.approx(1.44)
    assert segmented(gapped(cells), close_gaps=0.1 * cells).scene.objects[0].area == full
    leaking = segmented(gapped(cells), close_gaps=0.1 * (cells - 1)).scene.objects[0]
    assert leaking.area == pytest.approx(0.44 - 0.1 * 0.1 * cells, rel=0.2)


@pytest.mark.parametrize(("close_gaps", "closed"), [(0.3, True), (0.24, False)])
def test_close_gaps_is_the_nearest_number_of_cells(close_gaps, closed):
    # 0.3 / 0.1 is a little less than 3.
    found = segmented(gapped(3), close_gaps=close_gaps).scene.objects[0]
    assert (found.area == pytest.approx(1.44)) == closed


def test_what_a_closed_gap_encloses_counts_for_min_size():
    # Its outline alone has 43 cells of 0.1 m.
    assert len(segmented(gapped(1), min_size=1.0).scene) == 2


def test_close_gaps_may_be_wider_than_a_room_is_high():
    grid = room((4, 10, 4, 6), (4, 61, 4, 6), shape=(12, 80), resolution=0.02)
    assert len(segmented(grid, close_gaps=0.88, min_size=0.0).scene) == 2
    with pytest.raises(InvalidInputError, match="has only one object"):
        segmented(grid, close_gaps=0.9, min_size=0.0)


@pytest.mark.parametrize("cells", [1, 2, 3])
def test_objects_as_near_as_close_gaps_are_one(cells):
    grid = room((10, 10, 6, 6), (10, 16 + cells, 6, 6), (25, 40, 6, 6))
    assert len(segmented(grid, close_gaps=0.1 * cells).scene) == 2
    assert len(segmented(grid, close_gaps=0.1 * (cells - 1)).scene) == 3


def test_closing_does_not_move_outlines():
    plain = segmented(room(*TWO), close_gaps=0.0).scene
    closed = segmented(room(*TWO), close_gaps=0.5).scene
    assert [corners(item) for item in plain.objects] == [corners(item) for item in closed.objects]


def test_a_slanted_border_becomes_straight():
    rows, columns = np.mgrid[:80, :80]
    cells = np.where(abs(rows - 40) + abs(columns - 25) <= 12, 100, 0).astype(np.int8)
    cells[abs(rows - 20) + abs(columns - 60) <= 12] = 100
    found = segmented(OccupancyGrid(cells, 0.05))
    for item in found.scene.objects:
        assert len(item.rings[0]) <= 8
        assert item.area == pytest.approx(313 * 0.05**2, rel=0.05)
    exact = segmented(OccupancyGrid(cells, 0.05), tolerance=0.0)
    assert exact.scene.objects[0].area == pytest.approx(313 * 0.05**2)


def test_tolerance_is_in_metres():
    rng = np.random.default_rng(0)
    cells = room(*TWO, shape=(80, 80)).cells.copy()
    cells[40:70, 20:50] = 100
    cells[39, 20:50] = 100 * rng.integers(0, 2, 30)
    grid = OccupancyGrid(cells, 0.02)
    count = [
        len(segmented(grid, tolerance=t, close_gaps=0.0, min_size=0.05).scene.objects[0].rings[0])
        for t in (0.0, 0.015, 0.03)
    ]
    assert count[0] > count[1] > count[2]
    assert count[2] == 4


TOO_FEW = {
    "no free cell": (np.full((5, 5), -1, np.int8), "has no free cell; .* free_threshold"),
    "nothing in it": (room().cells, r"has no object of at least 0.2 m .* \(22 m²\)"),
    "one object": (room(TWO[0]).cells, "has only one object of at least 0.2 m within its largest"),
}


@pytest.mark.parametrize("case", TOO_FEW)
def test_too_few_objects_say_what_was_found_and_the_remedy(case):
    cells, words = TOO_FEW[case]
    with pytest.raises(InvalidInputError, match=words) as caught:
        segmented(OccupancyGrid(cells, 0.1))
    assert (caught.value.field, caught.value.reason) == ("cells", Reason.TOO_FEW_OBJECTS)


def flat():
    """Two empty rooms of 3 × 4 m with a doorway of 0.8 m between them."""
    grid = room(shape=(42, 63))
    cells = grid.cells.copy()
    cells[:, 31] = 100
    cells[20:28, 31] = 0
    return OccupancyGrid(cells, 0.1)


CUPBOARDS = ((1, 5, 6, 12), (33, 30, 6, 9), (1, 40, 6, 8))


@pytest.mark.parametrize(
    ("grid", "params", "cures", "others"),
    [
        (
            room(*CUPBOARDS),
            {"attached": 0.0},
            ["set attached to 2, which finds 3 objects at the"],
            ["rooms"],
        ),
        (flat(), {}, ["choose the segmenter rooms, which finds 2 rooms"], ["attached"]),
        (flat(), {"attached": 0.0}, ["segmenter rooms, which finds 2 rooms"], ["attached"]),
        (room(), {}, ["give a map with objects standing free"], ["attached", "rooms"]),
    ],
    ids=["cupboards", "flat", "flat without attached", "nothing"],
)
def test_too_few_objects_name_the_options_that_find_enough_and_no_others(
    grid, params, cures, others
):
    with pytest.raises(InvalidInputError) as caught:
        segmented(grid, **params)
    assert all(cure in caught.value.problem for cure in cures), caught.value
    assert not any(other in caught.value.problem for other in others), caught.value


def test_of_a_large_map_other_options_are_named_untried(monkeypatch):
    monkeypatch.setattr(occupancy_grid, "_MANY", 1000)
    with pytest.raises(InvalidInputError, match="; try the segmenter rooms, give a map"):
        segmented(flat())
    with pytest.raises(InvalidInputError, match="set attached to 2 for objects at the walls, try"):
        segmented(flat(), attached=0.0)


def test_a_map_of_noise_is_refused_before_it_takes_long():
    noise = np.where(np.random.default_rng(0).random((1000, 1000)) < 0.1, 100, 0).astype(np.int8)
    with pytest.raises(InvalidInputError, match="more than the limit of 1000; raise min_size"):
        segmented(OccupancyGrid(noise, 0.05), min_size=0.0, close_gaps=0.0)


def test_the_limit_of_objects_in_force_holds():
    cells = np.zeros((20, 20), np.int8)
    cells[2:18:5, 2:18:5] = 100
    with (
        limited_to(SourceLimits(max_objects=15)),
        pytest.raises(InvalidInputError, match="has 16 objects, more than the limit of 15; raise"),
    ):
        segmented(OccupancyGrid(cells, 0.3))


@pytest.mark.parametrize("resolution", [2.55, 655.35, 1000.0])
@pytest.mark.parametrize("options", [{}, {"attached": 2.0}, {"merge_distance": 1.0}])
def test_a_coarse_map_that_encloses_nothing_is_refused(resolution, options):
    cells = np.zeros((5, 6), np.int8)
    cells[1, 1:3] = cells[3, 1] = 100
    cells[0, :] = cells[:, 0] = -1
    cells[:, 1] = 100
    with pytest.raises(InvalidInputError, match="has no object") as caught:
        segmented(OccupancyGrid(cells, resolution), **options)
    assert caught.value.reason is Reason.TOO_FEW_OBJECTS


def largest_filled(cells):
    """The largest component of a mask, joined by sides or corners, without its holes."""
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(cells, connectivity=8)
    mask = (labels == 1 + np.argmax(statistics[1:, cv2.CC_STAT_AREA])).astype(np.uint8)
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return cv2.drawContours(np.zeros_like(mask), contours, -1, 1, cv2.FILLED)


def pinches(mask):
    """Corners in which two cells meet alone."""
    framed = np.pad(mask, 1)
    a, b, c, d = framed[:-1, :-1], framed[:-1, 1:], framed[1:, :-1], framed[1:, 1:]
    return int(((a == d) & (b == c) & (a != b)).sum())


@given(arrays(np.uint8, st.tuples(*[st.integers(1, 12)] * 2), elements=st.integers(0, 1)))
def test_a_border_is_valid_and_encloses_its_cells_exactly(cells):
    if not cells.any():
        cells[0, 0] = 1
    mask = largest_filled(cells)
    outline = shapely.Polygon(outer_border(mask))
    assert outline.is_valid
    assert outline.area == mask.sum() + 0.25 * pinches(mask)
    rows, columns = np.nonzero(mask)
    assert outline.bounds == (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)


@given(arrays(np.uint8, st.tuples(*[st.integers(1, 16)] * 2), elements=st.integers(0, 1)))
def test_borders_of_all_components_are_those_of_each_alone_with_what_it_encloses(cells):
    _, labels = cv2.connectedComponents(cells, connectivity=8)
    borders = outer_borders(cells)
    assert len(borders) == labels.max()
    for border in borders:
        x, y = border[0].astype(int)
        alone = (labels == labels[y, x]).astype(np.uint8)
        assert cells[y, x]
        np.testing.assert_array_equal(border, outer_border(alone | holes(alone)))


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1))
def test_any_grid_gives_valid_objects_or_one_sentence(seed):
    rng = np.random.default_rng(seed)
    blurred = cv2.GaussianBlur(rng.random((40, 40)), (0, 0), 1.0)
    cells = np.select([blurred > 0.56, blurred < 0.54], [100, 0], -1).astype(np.int8)
    with contextlib.suppress(InvalidInputError):
        scene = segmented(OccupancyGrid(cells, 0.05), min_size=0.05, close_gaps=0.05).scene
        assert all(item.polygon.is_valid and item.area > 0.0 for item in scene.objects)


def real_map(name):
    path = ROOT.parent / "shared" / "data" / "ogm" / name
    require(path.exists(), f"the real map {name}")
    return read_source(path)


def test_turtlebot3_has_nine_pillars_on_a_grid():
    scene = segmented(real_map("turtlebot3/map.yaml")).scene
    centres = np.array([item.centroid for item in scene.objects])
    expected = [(x, y) for y in (1.1, 0.0, -1.1) for x in (-1.1, 0.0, 1.1)]
    assert centres.shape == (9, 2)
    assert np.abs(centres - expected).max() < 0.08
    areas = [item.area for item in scene.objects]
    # A pillar of 0.15 m radius, on cells of 0.05 m: 0.07 m², and up to a cell around it.
    assert 0.07 < min(areas) <= max(areas) < 0.11


def test_husky_playpen_has_its_objects_and_not_the_edge_of_a_shadow():
    scene = segmented(real_map("husky-playpen/playpen_map.yaml")).scene
    assert len(scene) == 19
    barrels = [item for item in scene.objects if 0.23 < item.area < 0.35]
    assert len(barrels) == 9  # seven in an L, two apart
    plank = max(scene.objects, key=lambda item: item.polygon.length)
    assert plank.area == pytest.approx(1.55, rel=0.1)


def test_pmb2_office_has_its_boxes_and_its_tables_of_legs():
    office = real_map("pmb2-small-office/map.yaml")
    scene = segmented(office).scene
    tables = [item for item in scene.objects if item.certainty < 1.0]
    assert (len(scene), len(tables)) == (17, 3)
    assert all(1.0 < item.area < 1.4 for item in tables)
    boxes = segmented(office, merge_distance=0.0).scene
    assert len(boxes) == 14
    assert all(0.23 < item.area < 0.56 for item in boxes.objects)
    with_legs = segmented(office, merge_distance=0.0, min_size=0.09).scene
    assert len(with_legs) == 26


def test_depot_has_eleven_crates_among_its_objects():
    scene = segmented(real_map("nav2-depot/depot.yaml")).scene
    assert len(scene) == 18
    crates = [item for item in scene.objects if item.area > 1.5]
    assert len(crates) == 11
