"""What is found of outlines of many corners by bounds and in pieces, against the plain way."""

import math

import cv2
import numpy as np
import pytest
import shapely
from hypothesis import example, given
from hypothesis import strategies as st
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from sketchmatch.errors import InvalidInputError
from sketchmatch.model import OccupancyGrid
from sketchmatch_builtin.segmenters import _at_walls, _cells, _standing
from sketchmatch_builtin.segmenters._at_walls import Bounds
from sketchmatch_builtin.segmenters._border import outer_border
from sketchmatch_builtin.segmenters._cells import holes, simplified
from sketchmatch_builtin.segmenters._standing import Parts, Room
from sketchmatch_builtin.segmenters.occupancy_grid import OccupancyGridSegmenter
from tests.benchmarks.grids import MAPS
from tests.interpreted import examples

SEEDS = st.integers(0, 2**32 - 1)
BOUNDS = Bounds(widest=30.0, thinnest=3.5, smallest=2.0)


def furnished_room(seed, side=140):
    """A room with boxes, bars and open rings at its walls and away from them, some turned."""
    rng = np.random.default_rng(seed)
    cells = np.full((side, side), 100, np.uint8)
    cells[8:-8, 8:-8] = 0
    for _ in range(int(rng.integers(2, 10))):
        middle = tuple(rng.integers(5, side - 5, 2).tolist())
        size = tuple(rng.integers(2, 26, 2).tolist())
        angle = float(rng.choice([0.0, 0.0, 37.0, 71.0]))
        kind = rng.integers(3)
        if kind == 0:
            box = cv2.boxPoints((middle, size, angle))
            cv2.fillPoly(cells, [np.round(box).astype(np.int32)], (100,))
        else:
            arc = int(rng.integers(40, 350)) if kind == 1 else 360
            thick = int(rng.integers(1, 8))
            cv2.ellipse(cells, middle, size, angle, 0, arc, (100,), thick)
    return cells.view(np.int8)


def room_of(seed):
    cells = furnished_room(seed)
    _, regions, statistics, _ = cv2.connectedComponentsWithStats(
        (cells == 0).astype(np.uint8), connectivity=4
    )
    largest = 1 + int(statistics[1:, cv2.CC_STAT_AREA].argmax())
    free = np.asarray(regions == largest, np.uint8)
    return Room(free, holes(free), (cells > 50).view(np.uint8), 0.1, 2.0)


def objects(cells):
    try:
        scene = OccupancyGridSegmenter().segment(OccupancyGrid(cells, 0.05)).scene
    except InvalidInputError as error:
        return str(error)
    return [(item.polygon.wkb, item.certainty) for item in scene.objects]


def all_may(_ring, a, _b):
    return np.ones(len(a), bool)


def hangs(ring, a, b):
    """Whether a disc of the neck's radius lies in each pocket that is so large, one by one."""
    points = shapely.get_coordinates(ring.exterior)[:-1]
    for first, last in zip(a.tolist(), b.tolist(), strict=True):
        chain = _at_walls._chain(points, first, last)
        pocket, neck = shapely.Polygon(chain), math.dist(chain[0], chain[-1])
        yield pocket.is_valid and not pocket.buffer(-neck).is_empty


@pytest.mark.slow
@given(SEEDS)
@examples(60)
def test_bounds_and_pieces_change_no_object(seed):
    cells = furnished_room(seed)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_standing, "_CORNERS", 12)
        found = objects(cells)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_standing, "_CORNERS", math.inf)
        patch.setattr(_at_walls, "_may_hang", all_may)
        assert found == objects(cells)


def outline_of(seed):
    ring = _at_walls._simplified(_standing._walled(room_of(seed)), 0.9)[0]
    return orient(ring)


def pairs_of(ring):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_at_walls, "_may_hang", all_may)
        candidates = _at_walls._candidates(ring, BOUNDS)
    return np.array([each[:2] for each in candidates], dtype=np.int64).reshape(-1, 2).T


@given(SEEDS)
@examples(100)
def test_a_pocket_that_cannot_hang_on_its_neck_does_not(seed):
    ring = outline_of(seed)
    a, b = pairs_of(ring)
    may = _at_walls._may_hang(ring, a, b)
    assert not (np.fromiter(hangs(ring, a, b), bool, len(a)) & ~may).any()


@given(SEEDS)
@examples(60)
def test_a_pocket_that_cannot_lean_on_the_wall_is_none(seed):
    ring = outline_of(seed)
    pockets = []
    for bound in (_at_walls._may_lean, all_may_lean):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(_at_walls, "_may_lean", bound)
            candidates = _at_walls._candidates(ring, BOUNDS)
        found = (_at_walls._pocket(ring, each, BOUNDS) for each in candidates)
        pockets.append([each for each in found if each])
    assert pockets[0] == pockets[1]


def all_may_lean(_points, a, *_):
    return np.ones(len(a), bool)


def test_of_pockets_that_do_not_hang_most_are_known_not_to():
    said = [0, 0]
    for seed in range(30):
        ring = outline_of(seed)
        a, b = pairs_of(ring)
        may = _at_walls._may_hang(ring, a, b)
        not_hanging = ~np.fromiter(hangs(ring, a, b), bool, len(a))
        said[0] += np.count_nonzero(not_hanging & ~may)
        said[1] += np.count_nonzero(not_hanging)
    assert said[0] > 0.6 * said[1] > 100


@given(SEEDS, st.floats(0.5, 12.0))
@examples(100)
@example(3, 2.0)
def test_a_disc_is_found_in_pieces_where_it_is_in_the_whole(seed, radius):
    for polygon in outlines_of(seed):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(_standing, "_CORNERS", 12)
            held = _standing._holds_disc(polygon, radius)
        # Buffers round discs.
        assert held or polygon.buffer(-1.01 * radius).is_empty
        assert not held or not polygon.buffer(-0.99 * radius).is_empty


def outlines_of(seed):
    return [each.simplify(0.5) for each in raw_outlines_of(seed)]


def raw_outlines_of(seed):
    parts = Parts.of(room_of(seed))
    return parts.outlines(range(1, len(parts.boxes)))


@pytest.mark.slow
@given(SEEDS)
@examples(100)
def test_no_larger_disc_fits_into_an_outline_than_is_said(seed):
    parts = Parts.of(room_of(seed))
    which = range(1, len(parts.boxes))
    outlines = parts.outlines(which)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_standing, "_CORNERS", 0)
        cores = parts.cores(outlines, which)
    for polygon, core in zip(outlines, cores, strict=True):
        assert polygon.simplify(0.5).buffer(-core.widest).is_empty
        # It is worth something, and so is where it lies.
        least = core.widest / 1.02 - 2.2
        assert not polygon.buffer(-least).is_empty
        assert least <= 0.0 or _standing._holds_disc_near(polygon, least, core)


@given(SEEDS, st.sampled_from([0.3, 0.5, 0.75, 2.0]))
@examples(100)
def test_what_is_simplified_line_by_line_is_valid_and_as_near(seed, tolerance):
    for polygon in raw_outlines_of(seed):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(_cells, "_CORNERS", 0)
            plain = simplified(polygon, tolerance)
        careful = polygon.simplify(tolerance)
        assert plain.is_valid
        near = plain.hausdorff_distance(polygon) <= tolerance + 1e-9
        assert plain.equals_exact(careful) or near


def test_outlines_of_many_corners_are_simplified_as_with_care():
    many = [each for seed in range(150) for each in raw_outlines_of(seed) if has_many(each)]
    assert len(many) > 100
    for polygon in many:
        assert simplified(polygon, 0.5).equals_exact(polygon.simplify(0.5))


def has_many(polygon):
    return shapely.get_num_coordinates(polygon) > _cells._CORNERS


def test_a_polygon_that_would_cross_itself_or_vanish_is_simplified_with_care():
    # A zigzag corridor whose turns reach between the walls of the next.
    comb = shapely.LineString([(0, 0), (40, 0), (40, 3), (1, 3), (1, 6), (40, 6)]).buffer(0.7)
    for polygon in (comb, shapely.box(0.0, 0.0, 1.0, 1.0)):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(_cells, "_CORNERS", 0)
            plain = simplified(polygon, 5.0)
        assert plain.is_valid
        assert plain.equals_exact(polygon.simplify(5.0))


@given(SEEDS)
@examples(60)
def test_parts_around_each_other_lie_as_each_does_alone(seed):
    parts = Parts.of(room_of(seed))
    which = np.arange(1, len(parts.boxes))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Parts, "_are_apart", lambda *_: False)
        spreads, outlines = parts.spreads(which), parts.outlines(which)
    assert spreads.ravel() == pytest.approx(parts.spreads(which).ravel(), abs=1e-6)
    alone = [outer_border(parts.mask(k)) + parts.boxes[k, :2] for k in which.tolist()]
    assert all(a.equals(shapely.Polygon(b)) for a, b in zip(outlines, alone, strict=True))


@given(SEEDS)
@examples(60)
def test_what_is_left_out_of_the_sides_moves_no_outline(seed):
    room, bounds = room_of(seed), BOUNDS
    parts = Parts.of(room)
    thin = list(parts.outlines(range(1, len(parts.boxes))))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_standing, "_CORNERS", 12)
        chosen = _standing._sides(thin, room, bounds)
    walled = _standing._walled(room)
    plain = _at_walls.at_walls(walled, shapely.union_all(thin), bounds)
    assert _at_walls.at_walls(walled, shapely.union_all(chosen), bounds) == plain


def test_a_ring_that_closes_but_for_a_slit_is_kept_and_one_with_a_door_is_not():
    cells = np.full((120, 120), 0, np.uint8)
    cv2.circle(cells, (60, 60), 30, (1,), 2)
    kept = []
    for gap in (2, 20):
        inside = cells.copy()
        inside[60 : 60 + gap, 60:] = 0
        free = 1 - inside
        free[[0, -1]] = free[:, [0, -1]] = 0
        room = Room(free, inside, inside, 0.1, 2.0)
        thin = list(Parts.of(room).outlines([1]))
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(_standing, "_CORNERS", 12)
            kept.append(len(_standing._sides(thin, room, BOUNDS)))
    assert kept == [1, 0]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["labyrinth of 900 rooms", "rings turned", "rings, round"])
def test_no_outline_of_many_corners_is_grown_or_shrunk_often(name, monkeypatch):
    corners, plain = [], BaseGeometry.buffer

    def counted(self, *args, **options):
        corners.append(shapely.get_num_coordinates(self))
        return plain(self, *args, **options)

    monkeypatch.setattr(BaseGeometry, "buffer", counted)
    objects(MAPS[name]())
    # All at once it was 1.0, 1.5 and 1.0 million corners.
    assert sum(corners) < 250_000
