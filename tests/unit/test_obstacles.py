"""Cells that areas reach into, against the squares that shapely says they share a part with."""

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from sketchmatch.model import Scene
from sketchmatch.transfers.obstacles import Obstacles, reached
from tests.interpreted import examples

ROWS, COLUMNS = 9, 12
NEARLY = 1e-5
"""Of a cell's area: what a touch may cover of it."""

# On the grid's lines, on the middles of cells, hardly beside both, and anywhere.
NUMBERS = st.integers(-4, 16).map(float) | st.floats(-4.0, 16.0)
NUMBERS |= st.builds(lambda k, off: k / 2 + off, st.integers(-8, 32), st.sampled_from([-1e-9, 0.1]))
RINGS = st.lists(st.tuples(NUMBERS, NUMBERS), min_size=3, max_size=8)


def squares(rows, columns):
    y, x = np.mgrid[:rows, :columns].astype(float)
    return shapely.box(x, y, x + 1.0, y + 1.0)


def check(found, area):
    """Check cells: none is missing of which the area covers anything, and none is too many."""
    cells = squares(*found.shape)
    shapely.prepare(area)
    inner = shapely.contains_properly(area, cells)
    assert found[inner].all()
    cells, there = cells[~inner], found[~inner]
    missed = cells[~there]
    missed = missed[shapely.intersects(area, missed)]
    assert (shapely.area(shapely.intersection(missed, area)) < NEARLY).all()
    assert shapely.relate_pattern(cells[there], area, "T********").all()


def pieces(area):
    """Return the outlines of shapely's polygons with their holes, as rows and columns."""
    return [
        [shapely.get_coordinates(ring)[:-1, ::-1] for ring in (part.exterior, *part.interiors)]
        for part in shapely.get_parts(area)
        if part.geom_type == "Polygon" and not part.is_empty
    ]


@given(st.lists(RINGS, min_size=1, max_size=3), st.lists(RINGS, max_size=2))
@examples(300)
def test_a_cell_is_reached_if_an_area_covers_any_of_it(outlines, holes):
    given_ = [shapely.make_valid(shapely.Polygon(ring)) for ring in outlines]
    cut = shapely.union_all([shapely.make_valid(shapely.Polygon(ring)) for ring in holes])
    area = shapely.difference(shapely.union_all(given_), cut)
    rings = pieces(area)
    assume(rings)
    check(reached(rings, (ROWS, COLUMNS)), area)


def test_no_area_reaches_no_cell():
    assert not reached([], (2, 3)).any()


def test_cells_that_an_area_only_touches_are_not_reached():
    # In cells of 0.1 the corners are not on the grid's lines but by rounding.
    ring = np.array([[1.0, 1.1], [1.0, 1.4], [1.3, 1.4], [1.3, 1.1]]) / 0.1
    expected = np.zeros((20, 20), dtype=bool)
    expected[10:13, 11:14] = True
    assert reached([[ring]], (20, 20)).tolist() == expected.tolist()
    around = [np.array([[0.0, 0.0], [0.0, 20.0], [20.0, 20.0], [20.0, 0.0]]), ring]
    assert reached([around], (20, 20)).tolist() == (~expected).tolist()


@pytest.mark.parametrize("far", [1e3, 1e6, 1e12])
def test_areas_far_beyond_the_grid_reach_what_they_cover_of_it(far):
    ring = np.array([[-far, -far], [-far, far], [3.5, far], [3.5, -far]])
    assert reached([[ring]], (6, 4)).sum(axis=1).tolist() == [4, 4, 4, 4, 0, 0]
    assert not reached([[ring - (5.0, 0.0)]], (6, 4)).any()


@pytest.mark.parametrize("seed", range(8))
def test_objects_of_a_scene_block_every_cell_that_they_reach_into(seed):
    rng = np.random.default_rng(seed)
    rings = []
    for x in (0.0, 9.0):
        angles = np.sort(rng.uniform(0.0, 2 * np.pi, rng.integers(4, 7)))
        rings.append(np.stack([x + 2 * np.cos(angles), 2 * np.sin(angles)], axis=1))
    scene = Scene.from_polygons(rings)
    obstacles = Obstacles.of_scene(scene, np.array([[0.0, 0.0]]), 0.3)
    local = shapely.transform(
        shapely.union_all([item.polygon for item in scene.objects]),
        lambda points: obstacles.local(points)[:, ::-1],
    )
    check(obstacles.blocked, local)
