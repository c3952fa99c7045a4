"""Maps out of ROS bags, which the tests write themselves."""

import importlib.util
import math
import sqlite3
import struct
import sys
import tracemalloc
from contextlib import closing
from types import SimpleNamespace

import numpy as np
import pytest

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io import read_source
from sketchmatch.io.files import decode_file
from sketchmatch.io.ros_bag import _yaw
from sketchmatch.model import OccupancyGrid
from sketchmatch.model.limits import SourceLimits, limited_to
from tests.bags import KINDS, MCAP, ROS1, SQLITE, file_of, write
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


@pytest.mark.parametrize("kind", KINDS)
def test_the_last_map_is_taken_with_its_pose_and_the_resolution_that_was_meant(tmp_path, kind):
    bag = write(tmp_path, kind, ("/map", CELLS * 0, 0.0), ("/talk", "hi", 0), ("/map", CELLS, 0.3))
    found = read_source(bag)
    assert isinstance(found, OccupancyGrid)
    assert (found.cells == CELLS).all()
    assert found.resolution == 0.05
    assert found.origin == pytest.approx((1.0, -2.0, 0.3))


@pytest.mark.parametrize("kind", KINDS)
def test_an_orientation_of_nan_is_none_and_noted(tmp_path, kind):
    found = read_source(write(tmp_path, kind, ("/map", CELLS, math.nan)))
    assert found.origin == (1.0, -2.0, 0.0)
    assert found.notes == ("the orientation of the map's origin is not finite and was read as 0",)


@pytest.mark.parametrize("part", "xyzw")
def test_one_part_of_an_orientation_that_is_not_finite_is_enough(part):
    for value in (math.nan, math.inf):
        whole = SimpleNamespace(**{"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0, part: value})
        assert _yaw(whole) is None
    assert _yaw(SimpleNamespace(x=0.0, y=0.0, z=0.0, w=0.0)) == 0.0


@pytest.mark.parametrize("kind", [MCAP, SQLITE])
def test_a_bags_file_alone_is_read_too(tmp_path, kind):
    path = file_of(write(tmp_path, kind, ("/map", CELLS, 0.0)))
    assert (read_source(path).cells == CELLS).all()


def test_map_comes_before_other_topics_and_a_topic_can_be_named(tmp_path):
    bag = write(tmp_path, MCAP, ("/costmap", CELLS * 0, 0.0), ("/map", CELLS, 0.0))
    assert (read_source(bag).cells == CELLS).all()
    assert (read_source(f"{bag}#/costmap").cells == 0).all()
    assert "choose one of: /map, /costmap" in refused(f"{bag}#/none").problem


def test_a_bag_without_a_map_is_refused(tmp_path):
    error = refused(write(tmp_path, ROS1, ("/talk", "hi", 0)))
    assert "no topic of type nav_msgs/OccupancyGrid" in error.problem


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("keep", [0, 10, 400, -40])
def test_a_damaged_bag_is_refused_or_read(tmp_path, kind, keep):
    path = file_of(write(tmp_path, kind, ("/map", CELLS, 0.0)))
    path.write_bytes(path.read_bytes()[:keep])
    assert "or is damaged" in refused(path).problem


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
    assert "has a map of 4 × 3 cells with data for 6" in error.problem


def test_without_the_package_a_sentence_says_what_to_install(tmp_path, monkeypatch):
    bag = write(tmp_path, MCAP, ("/map", CELLS, 0.0))
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    assert refused(bag).problem.endswith("pip install 'sketchmatch[rosbag]'")


def test_of_several_topics_the_first_by_name_is_taken_and_the_others_are_named(tmp_path):
    topics = ("/robot2/map", "/costmap", "/robot1/map")
    found = read_source(write(tmp_path, MCAP, *((topic, CELLS, 0.0) for topic in topics)))
    said = "the map was read from the topic /costmap; other topics: /robot1/map, /robot2/map"
    assert found.notes == (said,)


# What requests bring: bytes, of strangers.


def decoded(path, topic="", data=None):
    return decode_file(path.name, path.read_bytes() if data is None else data, topic)


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_of_bytes_is_read_as_its_file_is(tmp_path, kind):
    messages = ("/map", CELLS * 0, 0.0), ("/map", CELLS, 0.3), ("/other", CELLS * 0, 0.0)
    path = file_of(write(tmp_path, kind, *messages))
    from_path, from_bytes = read_source(path), decoded(path)
    assert (from_bytes.cells == from_path.cells).all()
    assert (from_bytes.resolution, from_bytes.origin) == (from_path.resolution, from_path.origin)
    assert (decoded(path, "/other").cells == 0).all()
    with pytest.raises(
        InvalidInputError, match=r"no topic /none with maps; choose one of: /map, /other$"
    ):
        decoded(path, "/none")


@pytest.mark.parametrize(
    ("kind", "packing"), [(ROS1, "bz2"), (ROS1, "lz4"), (MCAP, "zstd")], ids=str
)
def test_what_is_packed_in_a_bag_of_bytes_keeps_to_the_limit(tmp_path, kind, packing):
    cells = np.zeros((400, 500), np.int8)
    path = file_of(write(tmp_path, kind, ("/map", cells, 0.0), packing=packing))
    assert path.stat().st_size < 20_000
    assert decoded(path).cells.shape == (400, 500)
    with (
        limited_to(SourceLimits(max_bytes=150_000)),
        pytest.raises(InvalidInputError, match=r"^unpacks to more than 150000 bytes, ") as caught,
    ):
        decoded(path)
    assert caught.value.reason == Reason.LIMIT_EXCEEDED
    with limited_to(SourceLimits(max_bytes=150_000)):
        assert read_source(path).cells.shape == (400, 500)


@pytest.mark.parametrize("kind", [ROS1, MCAP])
def test_of_many_maps_only_the_last_is_unpacked(tmp_path, kind):
    """A chunk of each, as both kinds close one that has a megabyte."""
    maps = [np.full((1200, 1000), k, np.int8) for k in range(6)]
    packing = "bz2" if kind == ROS1 else "zstd"
    bag = write(tmp_path, kind, *(("/map", cells, 0.0) for cells in maps), packing=packing)
    with limited_to(SourceLimits(max_bytes=2_500_000)):
        assert (decoded(file_of(bag)).cells == maps[-1]).all()
    assert (read_source(bag).cells == maps[-1]).all()


@pytest.mark.parametrize("packing", ["bz2", "lz4", "zstd"])
def test_what_is_packed_and_cut_is_refused(tmp_path, packing):
    kind = MCAP if packing == "zstd" else ROS1
    path = file_of(write(tmp_path, kind, ("/map", CELLS, 0.0), packing=packing))
    data = bytearray(path.read_bytes())
    begin = data.index(
        {"bz2": b"BZh", "lz4": b"\x04\x22\x4d\x18", "zstd": b"\x28\xb5\x2f\xfd"}[packing]
    )
    data[begin + 20 : begin + 40] = bytes(20)
    with pytest.raises(InvalidInputError, match="or is damaged"):
        decoded(path, data=bytes(data))


def database(path, *statements):
    """Return a .db3 after some statements, as bytes."""
    with closing(sqlite3.connect(path)) as connection:
        for statement in statements:
            connection.execute(statement)
        connection.commit()
    return path.read_bytes()


HUGE = "CAST(zeroblob(900000000) AS TEXT)"
FOREVER = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i FROM n"


@pytest.mark.parametrize(
    "statements",
    [
        ("ALTER TABLE messages RENAME TO m", f"CREATE VIEW messages AS {FOREVER}"),
        ("ALTER TABLE topics RENAME TO t", f"CREATE VIEW topics AS {FOREVER}"),
        (f"ALTER TABLE messages ADD COLUMN more AS ({HUGE})",),
        (f"ALTER TABLE topics ADD COLUMN more AS ({HUGE})",),
        ("DROP TABLE messages", "CREATE VIRTUAL TABLE messages USING rtree(id, timestamp, data)"),
        ("UPDATE messages SET data = 1000000000",),
        ("UPDATE topics SET name = x'00'",),
        ("DELETE FROM messages",),
        ("DROP TABLE topics",),
    ],
)
def test_a_database_of_a_stranger_computes_nothing(tmp_path, statements):
    path = file_of(write(tmp_path, SQLITE, ("/map", CELLS, 0.0)))
    data = database(path, *statements)
    with pytest.raises(InvalidInputError, match=r"or is damaged|no topic|no message"):
        decoded(path, data=data)


def test_a_database_whose_pages_lead_to_each_other_without_end_is_stopped(tmp_path):
    path = file_of(write(tmp_path, SQLITE, ("/map", CELLS, 0.0)))
    rows = {}
    with closing(sqlite3.connect(path)) as connection:
        for table in ("topics", "messages"):
            rows[table] = connection.execute(f"SELECT * FROM {table}").fetchall()
    path.unlink()
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("PRAGMA page_size = 512")
        connection.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, a, b, c)")
        connection.execute(
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data)"
        )
        for table, (row, *_) in rows.items():
            connection.execute(f"INSERT INTO {table} VALUES ({', '.join('?' * len(row))})", row)
        connection.commit()
        (root,) = connection.execute(
            "SELECT rootpage FROM sqlite_master WHERE name = 'messages'"
        ).fetchone()
    data = path.read_bytes()
    assert (decoded(path).cells == CELLS).all()
    count = len(data) // 512
    leaf = data[512 * (root - 1) : 512 * root]

    def leading_to(page, ways=70):
        starts = b"".join(struct.pack(">H", 512 - 5 * (k + 1)) for k in range(ways))
        head = struct.pack(">BHHHBI", 5, 0, ways, 512 - 5 * ways, 0, page)
        cells = struct.pack(">IB", page, 1) * ways
        return head + starts + bytes(512 - len(head) - len(starts) - len(cells)) + cells

    whole = bytearray(data + leaf + b"".join(leading_to(count + k) for k in (1, 2, 3)))
    whole[512 * (root - 1) : 512 * root] = leading_to(count + 4)
    whole[28:32] = struct.pack(">I", count + 4)
    with pytest.raises(InvalidInputError, match=r"is damaged \(interrupted\)"):
        decoded(path, data=bytes(whole))


def test_a_database_that_writes_its_log_ahead_is_read(tmp_path):
    path = file_of(write(tmp_path, SQLITE, ("/map", CELLS, 0.0)))
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("UPDATE topics SET name = '/other'")
        connection.commit()
    assert path.read_bytes()[18:20] == b"\2\2"
    assert (decoded(path, "/other").cells == CELLS).all()
    assert (read_source(path).cells == CELLS).all()


def record(op, body, **fields):
    """Return a record of a ROS 1 bag."""
    fields = {b"op": bytes([op])} | {name.encode(): value for name, value in fields.items()}
    header = b"".join(
        struct.pack("<I", len(name) + 1 + len(value)) + name + b"=" + value
        for name, value in fields.items()
    )
    return struct.pack("<I", len(header)) + header + struct.pack("<I", len(body)) + body


def test_a_bag_whose_index_leads_to_one_place_again_and_again_ends_soon():
    """Every chunk that it lists is the same one, whose index is long."""
    long, chunks, number = 20_000, 1_000, struct.Struct("<I").pack
    start = 13 + 77  # after the magic and the first record
    body = record(5, b"", compression=b"none", size=number(0)) + record(
        4, bytes(12 * long), ver=number(1), conn=number(0), count=number(long)
    )
    connection = record(7, b"", conn=number(0), topic=b"/map")[:-4]
    of_maps = {"topic": b"/map", "type": b"nav_msgs/OccupancyGrid", "md5sum": b"", "callerid": b""}
    described = b"".join(
        number(len(item)) + item
        for item in (*(f"{k}=".encode() + v for k, v in of_maps.items()), b"message_definition=")
    )
    info = record(
        6,
        number(0) + number(long),
        ver=number(1),
        chunk_pos=struct.pack("<Q", start),
        start_time=bytes(8),
        end_time=bytes(8),
        count=number(1),
    )
    head = record(
        3,
        b"",
        index_pos=struct.pack("<Q", start + len(body)),
        conn_count=number(1),
        chunk_count=number(chunks),
    )
    data = b"#ROSBAG V2.0\n" + head + body + connection + number(len(described)) + described
    assert 13 + len(head) == start
    with pytest.raises(InvalidInputError, match="leads to the same place over and over"):
        decode_file("a.bag", data + info * chunks)


MESSAGE = b"\5" + struct.pack("<QHIQQ", 22, 1, 0, 10**9, 10**9)


def stuffed(folder, monkeypatch, content):
    """Return an MCAP bag of one map, whose chunk has more content after it."""
    from rosbags.rosbag2.storage_mcap import McapWriter

    close = McapWriter.close_chunk

    def close_chunk(writer):
        writer.chunk.bio.write(content)
        close(writer)

    monkeypatch.setattr(McapWriter, "close_chunk", close_chunk)
    return file_of(write(folder, MCAP, ("/map", CELLS, 0.0), packing="zstd"))


@pytest.mark.parametrize("filler", [MESSAGE, bytes(9)], ids=["messages of the topic", "nothing"])
def test_a_small_chunk_of_millions_of_records_is_refused_before_it_is_unpacked(
    tmp_path, monkeypatch, filler
):
    """Read one by one they took 20 s and 1 GiB where 25 KB unpack to as much as a file may hold."""
    data = stuffed(tmp_path, monkeypatch, filler * 1_000_000).read_bytes()
    assert len(data) < 10_000
    tracemalloc.start()
    try:
        with pytest.raises(InvalidInputError, match="has more records in its"):
            decode_file("a.mcap", data)
        assert tracemalloc.get_traced_memory()[1] < 8_000_000
    finally:
        tracemalloc.stop()


def test_a_chunk_that_says_that_it_is_too_large_is_not_unpacked(tmp_path, monkeypatch):
    one_record = b"\x7f" + struct.pack("<Q", 20_000_000) + bytes(20_000_000)
    data = stuffed(tmp_path, monkeypatch, one_record).read_bytes()
    assert decode_file("a.mcap", data).cells.shape == CELLS.shape
    monkeypatch.setattr("sketchmatch.io.ros_bag._unpacker", pytest.fail)
    with (
        limited_to(SourceLimits(max_bytes=1_000_000)),
        pytest.raises(InvalidInputError, match="unpacks to more than 1000000 bytes"),
    ):
        decode_file("a.mcap", data)


def test_a_chunk_that_is_larger_than_it_says_is_refused_as_soon_as_it_is(tmp_path, monkeypatch):
    one_record = b"\x7f" + struct.pack("<Q", 20_000_000) + bytes(20_000_000)
    data = bytearray(stuffed(tmp_path, monkeypatch, one_record).read_bytes())
    size = data.index(b"zstd") - 16
    (said,) = struct.unpack_from("<Q", data, size)
    assert said > 20_000_000
    lying = bytes(data).replace(data[size : size + 8], struct.pack("<Q", 1000))
    tracemalloc.start()
    try:
        with pytest.raises(InvalidInputError, match="more than the 1000 bytes that it states"):
            decode_file("a.mcap", lying)
        assert tracemalloc.get_traced_memory()[1] < 8_000_000
    finally:
        tracemalloc.stop()


def test_many_small_messages_beside_the_map_are_no_attack(tmp_path):
    ticks = [("/tick", "t", 0.0)] * 20_000
    bag = write(tmp_path, MCAP, *ticks, ("/map", CELLS, 0.0), packing="zstd")
    assert (decoded(file_of(bag)).cells == CELLS).all()


def test_the_text_of_how_a_topic_is_delivered_is_not_read(tmp_path, monkeypatch):
    """A stranger's may be megabytes of YAML."""
    monkeypatch.setattr("rosbags.rosbag2.storage_mcap.parse_qos", pytest.fail)
    path = file_of(write(tmp_path, MCAP, ("/map", CELLS, 0.0)))
    assert (decoded(path).cells == CELLS).all()


def test_definitions_of_messages_in_a_bag_are_not_used(tmp_path):
    """The package would make code of them."""
    path = file_of(write(tmp_path, MCAP, ("/map", CELLS, 0.0), ("/talk", "hi", 0)))
    data = path.read_bytes()
    assert data.count(b"string data") >= 1
    other = data.replace(b"string data", b"}{?!~ data!")
    with limited_to(SourceLimits(max_pixels=6)):
        assert (decoded(path, data=other).cells == CELLS).all()


@pytest.mark.parametrize("count", [2, 30])
def test_names_of_topics_are_shown_as_far_as_they_can_be(tmp_path, count):
    topics = [f"/robot{k:02}/map" for k in range(count - 1)] + ["/z\x1b[31m" + "x" * 500]
    path = file_of(write(tmp_path, MCAP, *((topic, CELLS, 0.0) for topic in topics)))
    with pytest.raises(InvalidInputError, match="no topic /none with maps") as caught:
        decoded(path, "/none")
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 300
    assert ("20 more" in str(caught.value)) == (count == 30)
