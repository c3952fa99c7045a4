"""Maps out of ROS bags, which the tests write themselves."""

import importlib.util
import math
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io import read_source
from sketchmatch.io.ros_bag import _yaw
from sketchmatch.model import OccupancyGrid
from sketchmatch.model.limits import SourceLimits, limited_to
from tests.bags import MCAP, ROS1, SQLITE, write
from tests.tools import require

CELLS = np.array([[0, 0, 100], [-1, 50, 0]], np.int8)


@pytest.fixture(autouse=True)
def rosbags():
    installed = importlib.util.find_spec("rosbags") is not None
    require(installed, "rosbags (`pip install 'sketchmatch[rosbag]'`)")


def refused(path):
    with pytest.raises(InvalidInputError) as caught:
        read_source(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
    return caught.value


@pytest.mark.parametrize("kind", [ROS1, MCAP, SQLITE])
def test_the_last_map_is_taken_with_its_pose_and_the_resolution_that_was_meant(tmp_path, kind):
    bag = write(tmp_path, kind, ("/map", CELLS * 0, 0.0), ("/talk", "hi", 0), ("/map", CELLS, 0.3))
    found = read_source(bag)
    assert isinstance(found, OccupancyGrid)
    assert (found.cells == CELLS).all()
    assert found.resolution == 0.05
    assert found.origin == pytest.approx((1.0, -2.0, 0.3))


@pytest.mark.parametrize("kind", [ROS1, MCAP])
def test_an_orientation_of_nan_is_none_and_noted(tmp_path, kind):
    found = read_source(write(tmp_path, kind, ("/map", CELLS, math.nan)))
    assert found.origin == (1.0, -2.0, 0.0)
    assert found.notes == ("the orientation of the map's origin is not finite, read as none",)


@pytest.mark.parametrize("part", "xyzw")
def test_one_part_of_an_orientation_that_is_not_finite_is_enough(part):
    for value in (math.nan, math.inf):
        whole = SimpleNamespace(**{"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0, part: value})
        assert _yaw(whole) is None
    assert _yaw(SimpleNamespace(x=0.0, y=0.0, z=0.0, w=0.0)) == 0.0


@pytest.mark.parametrize("kind", [MCAP, SQLITE])
def test_a_bags_file_alone_is_read_too(tmp_path, kind):
    (path,) = write(tmp_path, kind, ("/map", CELLS, 0.0)).glob("*.[md][cb]*")
    assert (read_source(path).cells == CELLS).all()


def test_map_comes_before_other_topics_and_a_topic_can_be_named(tmp_path):
    bag = write(tmp_path, MCAP, ("/costmap", CELLS * 0, 0.0), ("/map", CELLS, 0.0))
    assert (read_source(bag).cells == CELLS).all()
    assert (read_source(f"{bag}#/costmap").cells == 0).all()
    assert "choose one of: /map, /costmap" in refused(f"{bag}#/none").problem


def test_a_bag_without_a_map_is_refused(tmp_path):
    error = refused(write(tmp_path, ROS1, ("/talk", "hi", 0)))
    assert "no topic of type nav_msgs/OccupancyGrid" in error.problem


@pytest.mark.parametrize("kind", [ROS1, MCAP])
@pytest.mark.parametrize("keep", [0, 10, 400, -40])
def test_a_damaged_bag_is_refused_or_read(tmp_path, kind, keep):
    bag = write(tmp_path, kind, ("/map", CELLS, 0.0))
    path = bag if kind == ROS1 else next(bag.glob("*.mcap"))
    path.write_bytes(path.read_bytes()[:keep])
    assert "damaged one" in refused(path).problem


def test_a_missing_bag_is_named(tmp_path):
    assert "does not exist; check the path" in refused(tmp_path / "none.bag").problem


def test_a_map_above_the_limit_is_refused(tmp_path):
    bag = write(tmp_path, MCAP, ("/map", CELLS, 0.0))
    with limited_to(SourceLimits(max_pixels=5)):
        error = refused(bag)
    assert error.reason == Reason.LIMIT_EXCEEDED
    assert "has 3 × 2 pixels, more than the limit of 5 pixels" in error.problem


def test_a_grid_of_wrong_size_is_refused(tmp_path):
    class Flat(np.ndarray):
        shape = (4, 3)

    error = refused(write(tmp_path, MCAP, ("/map", CELLS.view(Flat), 0.0)))
    assert "has a map of 6 cells for 4 × 3" in error.problem


def test_without_the_package_a_sentence_says_what_to_install(tmp_path, monkeypatch):
    bag = write(tmp_path, MCAP, ("/map", CELLS, 0.0))
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    assert refused(bag).problem.endswith("pip install 'sketchmatch[rosbag]'")
