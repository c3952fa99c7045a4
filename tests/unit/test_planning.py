"""Planning on grids of many cells: over blocks of them, in pieces, step by step."""

import numpy as np
import pytest
import shapely

from sketchmatch.errors import AnswerUnavailableError
from sketchmatch.model import OccupancyGrid, Scene
from sketchmatch.pipeline.clock import Clock
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch.pipeline.slices import finish
from sketchmatch.registry import default_registry
from sketchmatch.transfers import planning
from sketchmatch.transfers.features import ChangeReason, Feature, FeatureKind
from sketchmatch.transfers.obstacles import Obstacles, sampled
from sketchmatch.transfers.planning import Landmarks, Way, kept_clear
from sketchmatch.transfers.transfer import TransferRequest, run_transfer

SIDE, CELL = 240, 0.1
FAR = Landmarks(np.zeros((1, 2)) - 99.0, np.zeros((1, 2)) - 99.0, np.ones(1), ("far",))


def hall(door=12):
    """Return a hall in three parts: in each wall there is a door, first below and then above."""
    cells = np.zeros((SIDE, SIDE), dtype=np.int8)
    cells[:, 80:82] = cells[:, 160:162] = 100
    cells[20 : 20 + door, 80:82] = cells[-20 - door : -20, 160:162] = 0
    return OccupancyGrid(cells, CELL)


def straight(*ends):
    line = sampled(np.array(ends), CELL)
    return Way(line, np.linspace(0.0, 1.0, len(line)), line)


def led(grid, way, radius=0.2):
    return kept_clear(way, Obstacles.of_grid(grid, False), radius, FAR)


def length(way):
    return float(np.hypot(*np.diff(way.points, axis=0).T).sum())


def distance(way, grid):
    taken = [shapely.box(x, y, x + 1, y + 1) for y, x in np.argwhere(grid.cells)]
    return CELL * shapely.LineString(way.points / CELL).distance(shapely.union_all(taken))


ACROSS = straight((2.0, 12.0), (22.0, 12.0))


@pytest.mark.parametrize("many", [400, 4_000])
def test_a_way_over_blocks_is_about_as_short_as_the_cheapest_and_as_clear(monkeypatch, many):
    whole, _ = finish(led(hall(), ACROSS))
    # 20 m across, and 9 m to each door and back to where it was drawn, less a little at corners.
    assert length(whole) == pytest.approx(54.0, abs=1.0)
    monkeypatch.setattr(planning, "_MANY_CELLS", many)
    monkeypatch.setattr(planning, "_PIECE", 7)
    found, changes = finish(led(hall(), ACROSS))
    assert {each.reason for each in changes} == {ChangeReason.OBSTACLE}
    assert length(found) < 1.02 * length(whole)
    assert distance(found, hall()) >= 0.2 - 1e-9
    assert np.hypot(*np.diff(found.points, axis=0).T).max() < 3.0 * CELL
    np.testing.assert_array_equal(found.points[[0, -1]], ACROSS.points[[0, -1]])


def turns(way):
    """Return by how many degrees a way turns at each of its points."""
    steps = np.diff(way.points, axis=0) @ (1.0, 1.0j)
    return np.degrees(np.abs(np.angle(steps[1:] / steps[:-1])))


@pytest.mark.parametrize("radius", [0.0, 0.2, 0.5])
def test_where_a_way_leaves_the_carried_one_it_does_not_turn_back(radius):
    found, _ = finish(led(hall(), ACROSS, radius))
    assert turns(found).max() < 60.0


def islands(gap):
    """Return a floor with two islands side by side, so many cells apart."""
    cells = np.zeros((SIDE, SIDE), dtype=np.int8)
    cells[100:140, 60:118] = cells[100:140, 118 + gap : 180] = 100
    return OccupancyGrid(cells, CELL)


@pytest.mark.parametrize(("gap", "between"), [(12, True), (2, False)])
def test_a_side_that_costs_far_too_long_a_way_is_given_up(gap, between):
    centres = np.array([[8.9, 12.0], [15.0, 12.0]])
    things = Landmarks(centres, centres, np.full(2, 5.0), ("the west", "the east"))
    way = straight((11.2, 20.0), (11.2, 4.0))  # between both, a little too far to the left
    obstacles = Obstacles.of_grid(islands(gap), False)
    found, changes = finish(kept_clear(way, obstacles, 0.3, things))
    sides = [each.sentence for each in changes if each.reason is ChangeReason.OTHER_SIDE]
    assert length(found) < (18.0 if between else 26.0)
    assert len(sides) == (0 if between else 1)
    assert between or "the drawn side has no way, or a far longer one" in sides[0]


@pytest.mark.parametrize("door", [3, 5])
def test_a_door_that_is_narrower_than_a_block_is_found(monkeypatch, door):
    monkeypatch.setattr(planning, "_MANY_CELLS", 400)
    found, changes = finish(led(hall(door), ACROSS, radius=0.0))
    np.testing.assert_array_equal(found.points[[0, -1]], ACROSS.points[[0, -1]])
    assert distance(found, hall(door)) > 0.0
    assert ChangeReason.UNREACHABLE not in {each.reason for each in changes}


def test_no_way_is_found_where_there_is_none(monkeypatch):
    monkeypatch.setattr(planning, "_MANY_CELLS", 400)
    found, changes = finish(led(hall(door=0), ACROSS))
    assert changes[-1].reason is ChangeReason.UNREACHABLE
    assert found.points[:, 0].max() < 8.0


def test_blocks_are_searched_in_pieces_between_which_it_can_be_stopped(monkeypatch):
    seen = []
    searched = planning._searched

    def counted(costs, ends):
        seen.append(costs.size)
        return searched(costs, ends)

    monkeypatch.setattr(planning, "_searched", counted)
    monkeypatch.setattr(planning, "_MANY_CELLS", 400)
    monkeypatch.setattr(planning, "_PIECE", 7)
    work = led(hall(door=40), ACROSS)
    assert sum(1 for _ in work) >= len(seen) > 8
    assert max(seen) < SIDE * SIDE / 4
    done = len(seen)
    work = led(hall(), ACROSS)
    next(work)
    work.close()
    assert len(seen) == done


def test_a_server_that_stops_ends_a_transfer_that_plans():
    boxes = [[[x, y], [x + 1, y], [x + 1, y + 2], [x, y + 1]] for x, y in ((0, 0), (3, 1), (1, 5))]
    scene, clock = Scene.from_polygons(boxes), Clock()
    request = TransferRequest(
        MatchRequest(scene, scene),
        tuple(
            Feature(FeatureKind.ROUTE, (np.array([[-2.0, 0.5], [9.0, 1.0 + k]]),)) for k in range(3)
        ),
        object_map=((0, 0), (1, 1), (2, 2)),
        radius=0.3,
    )
    work = run_transfer(request, Engine(default_registry()), clock=clock)
    assert next(work).fraction < 1.0
    clock.curtail(0.0)
    with pytest.raises(AnswerUnavailableError):
        finish(work)


def test_a_time_budget_is_for_the_match_alone():
    boxes = [[[x, y], [x + 1, y], [x + 1, y + 2], [x, y + 1]] for x, y in ((0, 0), (3, 1), (1, 5))]
    scene = Scene.from_polygons(boxes)
    way = Feature(FeatureKind.ROUTE, (np.array([[-2.0, 0.5], [9.0, 1.0]]),))
    request = TransferRequest(
        MatchRequest(scene, scene, time_budget=1e-6),
        (way,),
        object_map=((0, 0), (1, 1), (2, 2)),
        radius=0.3,
    )
    assert len(finish(run_transfer(request, Engine(default_registry()))).features) == 1
