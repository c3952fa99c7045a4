"""What both segmenters of grids take from a map's two files: what was unknown, and names."""

import numpy as np
import pytest
import shapely

from sketchmatch.io.ros_map import decode_map_server
from sketchmatch.model import Landmark, OccupancyGrid
from sketchmatch_builtin.segmenters._landmarks import labels_of
from sketchmatch_builtin.segmenters.occupancy_grid import OccupancyGridSegmenter
from sketchmatch_builtin.segmenters.rooms import RoomSegmenter
from tests.tools import ROOT, require

WHITE, PALE, UNKNOWN, BLACK = 254, 180, 205, 0
# On cells of 0.05 m: two black boxes, a thing whose inside nobody saw, and a pale spot.
BLACKS = [0.25, 0.35]
UNSEEN, SPOT = 0.36, 0.49


def saved(free_thresh=0.25):
    """A map as map_saver writes it, of a walled room with unknown around it."""
    greys = np.full((70, 90), UNKNOWN, np.uint8)
    greys[10:60, 10:80] = BLACK
    greys[11:59, 11:79] = WHITE
    greys[20:30, 20:30] = greys[20:30, 50:64] = BLACK
    greys[40:52, 20:32] = UNKNOWN
    greys[40:54, 50:64] = PALE
    return decoded(greys, free_thresh)


def decoded(greys, free_thresh):
    text = (
        "image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n"
        f"occupied_thresh: 0.65\nfree_thresh: {free_thresh}\n"
    )
    return decode_map_server(text, b"P5\n%d %d\n255\n" % greys.shape[::-1] + greys.tobytes())


def found(grid, **params):
    return OccupancyGridSegmenter(OccupancyGridSegmenter.Params(**params)).segment(grid)


def areas(grid, **params):
    return sorted(round(item.area, 4) for item in found(grid, **params).scene.objects)


def test_what_was_saved_as_unknown_is_no_floor_whatever_the_files_threshold_says():
    assert areas(saved(0.25)) == areas(saved(0.196)) == [*BLACKS, UNSEEN, SPOT]
    assert saved(0.196).notes == ()
    (note,) = saved(0.25).notes
    assert "has the grey 205" in note


@pytest.mark.parametrize(
    ("free_thresh", "params", "others"),
    [
        # 205 is occupied with 19.6 %, the pale spot with 29.4 %.
        (0.25, {"keep_unknown": False}, [SPOT]),
        (0.196, {"keep_unknown": False}, [UNSEEN, SPOT]),
        (0.25, {"keep_unknown": False, "free_threshold": 19}, [UNSEEN, SPOT]),
        (0.196, {"keep_unknown": False, "free_threshold": 20}, [SPOT]),
        (0.25, {"free_threshold": 20}, [UNSEEN, SPOT]),
        (0.196, {"free_threshold": 29}, [UNSEEN, SPOT]),
        (0.196, {"free_threshold": 30}, [UNSEEN]),
        (0.25, {"free_threshold": 30}, [UNSEEN]),
        (0.196, {"free_threshold": 30, "keep_unknown": False}, []),
    ],
)
def test_parameters_say_what_is_free_in_place_of_the_file(free_thresh, params, others):
    assert areas(saved(free_thresh), **params) == [*BLACKS, *others]


def test_a_map_whose_only_floor_has_that_grey_keeps_it():
    greys = np.full((50, 70), UNKNOWN, np.uint8)
    greys[[0, -1]] = greys[:, [0, -1]] = greys[20:30, 20:30] = greys[20:30, 50:64] = BLACK
    grid = decoded(greys, 0.25)
    assert areas(grid) == areas(grid, free_threshold=30) == BLACKS


def test_rooms_have_the_same_parameters():
    segmenter = RoomSegmenter(RoomSegmenter.Params(door_width=0.1, min_area=0.5))
    grid = saved(0.25)
    with pytest.raises(ValueError, match="only one room"):
        segmenter.segment(grid)
    decided = RoomSegmenter(
        RoomSegmenter.Params(door_width=0.1, min_area=0.5, keep_unknown=False)
    ).segment(grid)
    # What is around the house is a room to them.
    assert len(decided.scene) == 2


def test_a_grid_without_a_picture_is_free_below_25_percent():
    cells = np.zeros((30, 30), np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    cells[5:10, 5:10], cells[15:20, 5:10], cells[15:20, 15:20] = 25, 24, 100
    grid = OccupancyGrid(cells, 0.1)
    assert areas(grid) == [0.25, 0.25]
    assert areas(grid, free_threshold=24, keep_unknown=False) == [0.25] * 3


def named(*landmarks, boxes=((10, 10), (10, 40), (30, 25))):
    """A walled room of 6 × 5 m with boxes of 0.6 m at (row, column), in cells of 0.1 m."""
    cells = np.zeros((50, 60), np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    for row, column in boxes:
        cells[row : row + 6, column : column + 6] = 100
    return OccupancyGrid(cells, 0.1, (1.0, -1.0, 0.0), landmarks=landmarks)


def labels(found):
    return [item.label for item in found.scene.objects]


def test_the_object_in_which_a_place_lies_or_the_nearest_in_reach_has_its_name():
    # From the top: x 3.5…4.1, y 2…2.6; x 2…2.6 and x 5…5.6, both y 0…0.6.
    grid = named(
        Landmark("bed", (4.0, 2.1), "furniture"),
        Landmark("lamp", (2.3, 1.0)),
        Landmark("door", (6.2, 0.3), "door"),
        Landmark("kitchen", (5.3, 0.3), "room"),
    )
    assert labels(found(grid)) == ["bed", "lamp", ""]
    assert found(grid).warnings == (
        "No object was named door: none is left within 0.5 m of where the map's file has this "
        "name.",
    )
    assert labels(found(grid, label_reach=0.6)) == ["bed", "lamp", "door"]
    assert found(grid, label_reach=0.6).warnings == ()
    assert labels(found(grid, label_reach=0.39)) == ["bed", "", ""]


def test_of_several_names_the_nearest_counts_and_each_names_one_object():
    here, near = Landmark("here", (2.1, 0.1)), Landmark("near", (2.3, 0.7))
    middle = Landmark("middle", (2.3, 0.3))
    assert labels(found(named(near, here)))[1] == "here"
    assert labels(found(named(near, here, middle)))[1] == "middle"
    # Between two boxes that are 0.4 m apart, nearer to the right one.
    between = Landmark("between", (2.83, 0.3))
    assert labels(found(named(between, boxes=((10, 10), (10, 20))))) == ["", "between"]


def test_many_names_that_are_left_are_cut_short():
    landmarks = [Landmark(f"n{k}\n", (30.0, 30.0)) for k in range(11)]
    (warning,) = found(named(*landmarks)).warnings
    assert warning.startswith(r"No object was named 'n0\n', 'n1\n',")
    assert "'n7\\n' and 3 more: none is left within 0.5 m of where" in warning


def test_rooms_take_the_names_of_rooms_in_them():
    cells = np.full((22, 40), 100, np.int8)
    cells[2:20, 2:18] = cells[10:14, 18:20] = cells[2:20, 20:38] = 0
    landmarks = (
        Landmark("kitchen", (6.0, 2.0), "room"),
        Landmark("sofa", (2.0, 2.0), "furniture"),
        Landmark("garden", (20.0, 2.0), "room"),
    )
    grid = OccupancyGrid(cells, 0.2, landmarks=landmarks)
    rooms = RoomSegmenter(RoomSegmenter.Params(door_width=0.8)).segment(grid)
    assert labels(rooms) == ["", "kitchen"]
    assert rooms.warnings == (
        "No object was named garden: none is left around where the map's file has this name.",
    )


def test_montreal_names_things_of_which_its_map_shows_a_door():
    from sketchmatch.io import read_source

    path = ROOT.parent / "shared" / "data" / "ogm" / "marrtino-montreal" / "montreal.yaml"
    require(path.exists(), "the real map marrtino-montreal")
    grid = read_source(path)
    names = ["mary", "box1", "door1", "door2", "door3", "door4"]
    assert [item.name for item in grid.landmarks] == names
    # The stool (no. 2) stands at (3.97, −1.97), 2.2 m from mary; doors are gaps in the walls, but
    # for one, which stands out of its wall.
    assert labels(found(grid)) == ["door2", *[""] * 8]
    assert labels(found(grid, label_reach=2.2))[2] == "mary"


def test_a_name_goes_first_to_what_is_certain_and_else_to_what_is_in_doubt():
    name = [Landmark("piano", (1.05, 0.5), "furniture")]
    near, far = shapely.box(0, 0, 1, 1), shapely.box(1.2, 0, 2, 1)
    assert labels_of([near, far], name, 0.5, [True, False])[0] == ["", "piano"]
    assert labels_of([near, far], name, 0.5, [True, True])[0] == ["piano", ""]
    assert labels_of([near, far], name, 0.1, [True, False])[0] == ["piano", ""]
