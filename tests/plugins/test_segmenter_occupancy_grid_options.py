"""Occupancy grids: tables of legs, things at walls, closed doors, big maps, and invariants."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.errors import InvalidInputError
from sketchmatch.io import read_source
from sketchmatch.model import OccupancyGrid
from sketchmatch_builtin.segmenters._merging import merged
from sketchmatch_builtin.segmenters.occupancy_grid import OccupancyGridSegmenter
from tests.interpreted import examples
from tests.pace import within
from tests.tools import ROOT, require


def segmented(cells, cell=0.1, **params):
    grid = cells if isinstance(cells, OccupancyGrid) else OccupancyGrid(cells, cell)
    return OccupancyGridSegmenter(OccupancyGridSegmenter.Params(**params)).segment(grid)


def room(*boxes, shape=(60, 80)):
    """A walled room of free cells with boxes (row, column, rows, columns) in it."""
    cells = np.zeros(shape, np.int8)
    cells[:2] = cells[-2:] = 100
    cells[:, :2] = cells[:, -2:] = 100
    for row, column, rows, columns in boxes:
        cells[row : row + rows, column : column + columns] = 100
    return cells


def areas(found):
    return [item.area for item in found.scene.objects]


BOXES = ((40, 10, 6, 9), (10, 60, 5, 5))
LEGS = tuple((row, column, 1, 1) for row in (10, 17) for column in (20, 32))


def test_four_legs_become_a_table():
    found = segmented(room(*BOXES, *LEGS), merge_distance=1.1)
    assert areas(found) == pytest.approx([0.54, 1.04, 0.25])
    assert len(segmented(room(*BOXES, *LEGS), merge_distance=0.0).scene) == 2
    # 0.6 m between the rows, 1.1 m between the columns: two legs each, 0.1 by 0.8 m.
    assert len(segmented(room(*BOXES, *LEGS), merge_distance=0.7).scene) == 4


def test_large_things_are_merged_only_where_leg_size_says_so():
    near = room((40, 10, 6, 9), (40, 22, 6, 9), (10, 60, 5, 5))
    assert len(segmented(near, merge_distance=0.5).scene) == 3
    joined = segmented(near, merge_distance=0.5, leg_size=1.0)
    assert areas(joined) == pytest.approx([0.6 * 2.1, 0.25])


def test_what_stands_between_the_legs_belongs_to_the_table():
    table = tuple((row, column, 1, 1) for row in (10, 30) for column in (20, 40))
    found = segmented(room(*BOXES, *table, (18, 26, 5, 5)), merge_distance=2.0)
    assert areas(found) == pytest.approx([0.54, 2.1 * 2.1, 0.25])


def test_merged_hulls_are_apart():
    rng = np.random.default_rng(0)
    parts = np.array([shapely.box(x, y, x + 1, y + 1) for x, y in rng.integers(0, 40, (60, 2)) * 2])
    parts = np.unique(shapely.to_wkb(parts))
    parts = shapely.from_wkb(parts)
    hulls = merged(parts, 3.0, 1.0)
    pairs = shapely.STRtree(hulls).query(hulls, predicate="intersects")
    assert (pairs[0] == pairs[1]).all()
    assert shapely.union_all(parts).difference(shapely.union_all(hulls)).area < 1e-9


CUPBOARD = (2, 30, 6, 10)


def test_a_cupboard_at_the_wall_is_kept_and_in_doubt():
    cells = room(*BOXES, CUPBOARD)
    found = segmented(cells)
    assert areas(found) == pytest.approx([0.54, 0.25, 0.6])
    assert [item.doubtful for item in found.scene.objects] == [False, False, True]
    assert len(segmented(cells, min_certainty=0.5).scene) == 2
    assert len(segmented(cells, attached=0.0).scene) == 2
    assert len(segmented(cells, attached=1.2).scene) == 3
    assert len(segmented(cells, attached=0.9).scene) == 2


def test_a_thing_whose_back_was_never_seen_is_kept():
    cells = room(*BOXES)
    cells[2:8, 30:40] = -1
    cells[7, 30:40] = 100
    cells[:2, 25:45] = -1
    assert len(segmented(cells, attached=1.2).scene) == 3


def test_partitions_and_bumps_of_a_wall_are_no_objects():
    cells = room(*BOXES, (2, 30, 20, 2), (56, 40, 2, 20))
    assert len(segmented(cells).scene) == 2
    assert len(segmented(cells, wall_thickness=0.1).scene) == 3


def two_rooms():
    return np.concatenate([room(*BOXES), room((20, 20, 8, 8), shape=(60, 50))], axis=1)


def test_rooms_behind_closed_doors_count():
    assert len(segmented(two_rooms()).scene) == 3
    assert len(segmented(two_rooms(), region_share=1.0).scene) == 2


def test_a_building_seen_from_all_around_is_no_object_but_its_rooms_have_some():
    cells = np.pad(two_rooms(), 40)
    cells[5:10, 5:15] = 100
    assert len(segmented(cells).scene) == 4
    # Where it alone counts, the yard holds a building and a box.
    assert len(segmented(cells, region_share=1.0).scene) == 2


def test_free_cells_inside_an_object_are_no_room():
    cells = room(*BOXES, (20, 30, 12, 12))
    cells[22:30, 32:40] = 0
    assert areas(segmented(cells)) == pytest.approx([0.54, 1.44, 0.25])


def test_speckle_is_left_out():
    cells = room(*BOXES)
    rng = np.random.default_rng(0)
    cells[(rng.random(cells.shape) < 0.01) & (cells == 0)] = 100
    assert len(segmented(cells, close_gaps=0.0).scene) == 2


def test_too_many_parts_to_merge_are_refused():
    cells = np.zeros((400, 400), np.int8)
    cells[1::3, 1::3] = 100
    with pytest.raises(InvalidInputError, match="more than the limit of 10000; take speckle"):
        segmented(cells, merge_distance=0.1, close_gaps=0.0)


OPTIONS = ({}, {"merge_distance": 0.6}, {"attached": 1.0}, {"region_share": 0.01})


def furnished(seed):
    """A room with boxes apart from each other, in it and at its walls."""
    rng = np.random.default_rng(seed)
    cells = room()
    for row in (2, 14, 28, 44):
        for column in (6, 24, 42, 60):
            height, width = rng.integers(3, 11, 2)
            cells[row : row + height, column : column + width] = 100
    return cells


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1), st.sampled_from(OPTIONS), st.integers(1, 30))
@examples(40)
def test_padding_with_unknown_cells_changes_nothing(seed, params, pad):
    cells = furnished(seed)
    plain = segmented(cells, **params).scene.objects
    padded = OccupancyGrid(np.pad(cells, pad, constant_values=-1), 0.1, (-pad / 10, -pad / 10, 0.0))
    again = segmented(padded, **params).scene.objects
    for before, after in zip(plain, again, strict=True):
        assert np.allclose(before.rings[0], after.rings[0])


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1), st.sampled_from(OPTIONS), st.integers(1, 3))
@examples(40)
def test_turning_the_map_turns_the_objects(seed, params, turns):
    cells = furnished(seed)
    plain = segmented(cells, tolerance=0.0, **params).scene.objects
    turned = segmented(np.rot90(cells, turns), tolerance=0.0, **params).scene.objects
    polygons = [item.polygon for item in plain]
    for _ in range(turns):
        # A cell (row, column) of n columns comes to (n − 1 − column, row): x, y to y, width − x.
        width = cells.shape[1] / 10
        polygons = [
            shapely.transform(p, lambda xy, w=width: np.stack([xy[:, 1], w - xy[:, 0]], 1))
            for p in polygons
        ]
        cells = np.rot90(cells)
    assert len(turned) == len(plain)
    for polygon in polygons:
        others = [item.polygon for item in turned]
        assert min(polygon.symmetric_difference(other).area for other in others) < 0.03


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.01, 0.3, 2.0]))
@examples(20)
def test_scaling_resolution_and_lengths_scales_the_objects(seed, factor):
    cells = furnished(seed)
    lengths = {"min_size": 0.2, "close_gaps": 0.1, "merge_distance": 0.3, "leg_size": 0.2}
    plain = segmented(cells, **lengths, attached=1.0, wall_thickness=0.3).scene.objects
    lengths = {key: value * factor for key, value in lengths.items()}
    scaled = segmented(
        cells, 0.1 * factor, **lengths, attached=factor, wall_thickness=0.3 * factor
    ).scene.objects
    for before, after in zip(plain, scaled, strict=True):
        assert np.allclose(after.rings[0], before.rings[0] * factor)


def real_map(name):
    path = ROOT.parent / "shared" / "data" / "ogm" / name
    require(path.exists(), f"the real map {name}")
    return read_source(path)


# What a person counts, and what it is. turtlebot3: 9 pillars. husky: 9 barrels, 5 posts, 2 boxes,
# a plank, a shadow and a ragged piece, and the edge of another shadow, which is left out. pmb2: 14
# boxes, and 3 tables of 4 legs.
# depot: 11 crates, 4 pillars with flanges, 3 flat things, and 18 legs of racks.
COUNTS = {
    "turtlebot3/map.yaml": 9,
    "husky-playpen/playpen_map.yaml": 19,
    "pmb2-small-office/map.yaml": 17,
    "nav2-depot/depot.yaml": 18,
}


@pytest.mark.parametrize("name", COUNTS)
def test_real_maps_have_the_objects_that_a_person_counts(name):
    assert len(segmented(real_map(name)).scene) == COUNTS[name]


def test_the_small_offices_legs_become_one_long_table():
    found = segmented(real_map("pmb2-small-office/map.yaml"), merge_distance=1.3)
    assert len(found.scene) == 15
    assert max(areas(found)) == pytest.approx(6.8, rel=0.1)


def test_what_map_saver_saved_as_unknown_is_no_room_whatever_the_threshold():
    (note,) = real_map("nav2-depot/depot.yaml").notes
    assert "5% of the map has the grey 205" in note
    others = [real_map(name).notes for name in COUNTS if "depot" not in name]
    assert others == [()] * 3


def test_a_home_has_its_furniture_and_not_its_walls():
    # Two tables with their chairs, two blocks of sofas, a sideboard, a kitchen and ragged pieces at
    # the door; nothing as long as the walls, which were objects while unknown cells were free.
    home = real_map("elsabot-downstairs/downstairs.yaml")
    found = segmented(home)
    assert len(found.scene) == 12
    assert sorted(areas(found))[-2:] == pytest.approx([6.4, 7.6], abs=0.1)
    as_the_thresholds_say = segmented(home, keep_unknown=False)
    assert len(as_the_thresholds_say.scene) == 27


@pytest.mark.parametrize("side", [1000, pytest.param(4000, marks=pytest.mark.slow)])
def test_millions_of_cells_are_no_trouble(side):
    cells = np.zeros((side, side), np.int8)
    cells[:3] = cells[-3:] = cells[:, :3] = cells[:, -3:] = 100
    rng = np.random.default_rng(0)
    cells[tuple(rng.integers(3, side - 3, (2, side**2 // 800)))] = 100
    things = range(100, side - 100, 200)
    for row in things:
        for column in things:
            cells[row : row + 40, column : column + 30] = 100
    # Sixteen take less than a second; what is slower than linear takes minutes.
    with within(5.0 * (side / 4000) ** 2 + 0.5):
        found = segmented(OccupancyGrid(cells, 0.05))
    assert sum(area > 1.0 for area in areas(found)) == len(things) ** 2
