"""Bags in requests, over gRPC, with what is expected of them written out."""

import importlib.util

import numpy as np
import pytest

from sketchmatch.app.setup import Setup
from sketchmatch.pipeline.engine import Engine
from sketchmatch.registry import discover
from sketchmatch_client import Client, InvalidRequestError, sources
from sketchmatch_proto.v1 import source_pb2
from tests.bags import KINDS, MCAP, ROS1, file_of, write
from tests.server.harness import hosting
from tests.tools import require

# Metres of the map's origin, cells of 0.05 m: columns and rows of the lower left and upper right.
BOXES = [(20, 20, 40, 60), (120, 30, 160, 50)]
CORNERS = [(2.0, -1.0, 3.0, 1.0), (7.0, -0.5, 9.0, 0.5)]


@pytest.fixture(scope="module")
def client():
    installed = importlib.util.find_spec("rosbags") is not None
    require(installed, "rosbags (`pip install 'sketchmatch[rosbag]'`)")
    with hosting(Setup(Engine(discover())), warm=False) as host, Client(host.address) as connected:
        yield connected


def room():
    cells = np.zeros((100, 200), np.int8)
    for x0, y0, x1, y1 in BOXES:
        cells[y0:y1, x0:x1] = 100
    return cells


def corners(scene):
    found = []
    for item in scene.objects:
        points = [(point.x, point.y) for ring in item.rings[:1] for point in ring.points]
        (xs, ys) = zip(*points, strict=True)
        found.append((min(xs), min(ys), max(xs), max(ys)))
    return sorted(found)


@pytest.mark.parametrize("kind", KINDS)
def test_things_are_found_in_the_frame_of_the_bags_map(client, tmp_path, kind):
    bag = file_of(write(tmp_path, kind, ("/map", room(), 0.0), ("/talk", "hi", 0)))
    found = client.segment(sources.file(bag))
    assert found.segmenter.name == "occupancy-grid"
    assert np.array(corners(found.scene)) == pytest.approx(np.array(CORNERS), abs=0.051)
    assert not found.warnings
    # Field 6 of Source; in it the name as field 1 and the bytes as field 2.
    data = bag.read_bytes()
    name = bag.name.encode()
    inner = b"\x0a" + bytes([len(name)]) + name + b"\x12" + varint(len(data)) + data
    written = source_pb2.Source.FromString(b"\x32" + varint(len(inner)) + inner)
    assert client.segment(written).scene == found.scene


@pytest.mark.parametrize("yaw", [0.0, 0.5])
def test_its_map_is_returned_to_whoever_asks_and_has_the_same_things(client, tmp_path, yaw):
    cells = room()
    cells[:, 180:] = -1
    cells[60:80, 70:95] = 40
    bag = file_of(write(tmp_path, MCAP, ("/map", cells, yaw)))
    plain, found = (client.segment(sources.file(bag), include_map=k) for k in (False, True))
    assert not plain.HasField("map")
    assert plain.scene == found.scene
    again = source_pb2.Source(map_server_map=found.map)
    told = client.segment(again, include_map=True)
    assert told == found
    chosen = {"segmenter": "occupancy-grid", "params": {"free_threshold": 50}}
    freer = client.segment(again, **chosen).scene
    assert freer == client.segment(sources.file(bag), **chosen).scene != found.scene


def test_a_grid_of_cells_has_a_map_and_polygons_have_none(client):
    found = client.segment(sources.occupancy_grid(room(), 0.05), include_map=True)
    assert client.segment(source_pb2.Source(map_server_map=found.map)).scene == found.scene
    drawn = [[(0, 0), (2, 0), (2, 1)], [(5, 5), (6, 5), (6, 7)]]
    assert not client.segment(sources.polygons(drawn), include_map=True).HasField("map")


def varint(number):
    low, rest = number & 0x7F, number >> 7
    return bytes([low | 0x80]) + varint(rest) if rest else bytes([low])


def test_a_topic_is_named_by_the_part_and_of_several_a_warning_tells(client, tmp_path):
    turned = room()[::-1].copy()
    bag = file_of(write(tmp_path, MCAP, ("/b/map", room(), 0.0), ("/a/map", turned, 0.0)))
    chosen = client.segment(sources.file(bag, part="/b/map"))
    first = client.segment(sources.file(bag))
    assert np.array(corners(chosen.scene)) == pytest.approx(np.array(CORNERS), abs=0.051)
    assert corners(first.scene) != corners(chosen.scene)
    said = "the map was read from the topic /a/map; other topics: /b/map"
    assert [said in warning for warning in first.warnings] == [True]
    with pytest.raises(
        InvalidRequestError, match=r"^source\.file has no topic /c with maps; choose one of"
    ):
        client.segment(sources.file(bag, part="/c"))


@pytest.mark.parametrize(
    ("name", "data", "sentence"),
    [
        ("a.bag", b"", r"source\.file is not a ROS bag, or is damaged \(File '.bag' seems to be"),
        ("a.mcap", b"\x89MCAP0\r\n", r"source\.file is not a ROS bag, or is damaged \("),
        (
            "a.db3",
            b"SQLite format 3",
            r"source\.file is not a ROS bag, or is damaged \(file is not",
        ),
        ("metadata.yaml", b"rosbag2:", r"source\.file is the YAML of a map or a bag"),
    ],
)
def test_what_is_no_bag_is_refused_in_one_sentence(client, name, data, sentence):
    with pytest.raises(InvalidRequestError, match=f"^{sentence}") as caught:
        client.segment(sources.file(data, name=name))
    assert caught.value.reason == "INVALID_FILE"
    assert "/tmp" not in str(caught.value)


def test_what_is_packed_in_a_bag_keeps_to_the_servers_limit(client, tmp_path):
    huge = np.zeros((9_000, 9_000), np.int8)  # 81 million cells, packed into less than a hundredth
    bag = file_of(write(tmp_path, ROS1, ("/map", huge, 0.0), packing="bz2"))
    assert bag.stat().st_size < 100_000
    with pytest.raises(InvalidRequestError, match="has 9000 × 9000 pixels, more than the limit"):
        client.segment(sources.file(bag))
