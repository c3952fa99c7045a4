"""Maps out of ROS bags: the last ``nav_msgs/OccupancyGrid`` message of a topic.

Bags of ROS 1 (``.bag``) and of ROS 2 (``.mcap``, ``.db3``, or the folder with ``metadata.yaml``)
are read through the package ``rosbags``, which ``pip install 'sketchmatch[rosbag]'`` brings. The
topic is ``/map``, or else the first by name that carries maps, with a note if others do, too;
``office.mcap#/robot1/map`` names another. By its path a bag may be of any size: only the messages
of that topic are read, and the limit on bytes does not count for it. From bytes, as requests bring
them, it and what it unpacks to keep to that limit.

Strangers send bags. So the definitions of messages within one are not used, of which ``rosbags``
would make code; a message is what ROS says it is.
"""

from __future__ import annotations

import bz2
import io
import math
import os
import sqlite3
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from contextvars import ContextVar
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.model import OccupancyGrid
from sketchmatch.model.limits import check_bytes, check_pixels, source_limits

__all__ = ["SUFFIXES", "bag_and_topic", "decode_bag", "is_bag", "read_bag"]

SUFFIXES = (".bag", ".db3", ".mcap")

_TYPE = "nav_msgs/msg/OccupancyGrid"


def bag_and_topic(path: Path) -> tuple[Path, str]:
    """Split ``office.mcap#/map`` into the bag's path and the topic, which is empty if not named.

    Examples
    --------
    >>> bag_and_topic(Path("office.mcap#/map"))
    (PosixPath('office.mcap'), '/map')
    """
    bag, mark, topic = str(path).partition("#/")
    return (Path(bag), f"/{topic}") if mark and is_bag(Path(bag)) else (path, "")


def is_bag(path: Path) -> bool:
    """Whether a path, without a topic, is that of a bag."""
    return path.suffix.lower() in SUFFIXES or os.path.isfile(path / "metadata.yaml")  # noqa: PTH113 (no error)


def read_bag(path: Path, topic: str = "") -> OccupancyGrid:
    """Read the last map in a bag.

    Parameters
    ----------
    path
        The bag.
    topic
        Where the maps are; empty for ``/map``, or else the first topic with maps.

    Raises
    ------
    InvalidInputError
        If ``rosbags`` is not installed, the bag cannot be read or has no map, or the map cannot
        be used.
    """
    return _last_map(path, topic)


def decode_bag(suffix: str, data: bytes, topic: str = "") -> OccupancyGrid:
    """Read the last map in a bag that is one file, from its bytes.

    Parameters
    ----------
    suffix
        Which of :data:`SUFFIXES` it is.
    data
        The file.
    topic
        As in :func:`read_bag`.

    Raises
    ------
    InvalidInputError
        As :func:`read_bag` does, and if more is packed in it than a file may hold.
    """
    token = _bounds.set(_Bounds(source_limits().max_bytes, len(data)))
    try:
        return _last_map(_InMemory(suffix, data), topic)
    finally:
        _bounds.reset(token)


class _InMemory(NamedTuple):
    """What ``rosbags`` asks of a path, of a file that has none."""

    suffix: str
    data: bytes

    def __str__(self) -> str:
        return self.suffix

    def exists(self) -> bool:
        return True

    def is_dir(self) -> bool:
        return False

    def open(self, _mode: str) -> io.BytesIO:
        return _Metered(self.data)


class _Metered(io.BytesIO):
    """Ends whoever is led through the same bytes again and again."""

    def __init__(self, data: bytes) -> None:
        super().__init__(data)
        self._left = 4 * len(data)

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size)
        self._left -= len(data)
        if self._left < 0:
            raise ValueError("its index leads to the same place over and over")
        return data


class _Bounds:
    """How much a stranger's bag may still unpack: bytes, and records, each of which takes time.

    Parameters
    ----------
    limit
        Bytes that may be unpacked.
    size
        Bytes of the file: as each record has its time, hardly more than one fits into 4 of them.
    """

    def __init__(self, limit: int, size: int) -> None:
        self._limit = self._left = limit
        self._size, self._records = size, _FEW_RECORDS + size // 4

    def unpack(self, packing: str, data: bytes) -> bytes:
        """Unpack what is read by an index."""
        return self._unpacked(packing, data, self._left)

    def unpack_records(self, packing: str, data: bytes, said: int) -> bytes:
        """Unpack what is read record by record, and says how many bytes it is."""
        return self._unpacked(packing, data, said, of_records=True)

    def _unpacked(self, packing: str, data: bytes, said: int, of_records: bool = False) -> bytes:
        plain, place = bytearray(), 0
        self._check(said)
        for piece in _pieces(packing, data):
            plain += piece
            self._check(len(plain))
            if len(plain) > said:
                raise ValueError(f"a chunk unpacks to more than the {said} bytes that it states")
            while of_records and place + _HEAD <= len(plain):
                place += _HEAD + int.from_bytes(plain[place + 1 : place + _HEAD], "little")
                self._records -= 1
                if self._records < 0:
                    problem = f"has more records in its {self._size} bytes than any recorder writes"
                    raise _invalid(f"{problem}; record it again")
        self._left -= len(plain)
        return bytes(plain)

    def _check(self, unpacked: int) -> None:
        if unpacked > self._left:
            check_bytes(self._limit + 1, "", f"unpacks to more than {self._limit} bytes")


_bounds: ContextVar[_Bounds | None] = ContextVar("bounds", default=None)

_FEW_RECORDS = 10_000
_HEAD = 9
"""Bytes before the content of a record: its kind, and how long it is."""
_PIECE = 1 << 20


def _pieces(packing: str, data: bytes) -> Iterator[bytes]:
    """Yield what is packed, a little at a time."""
    if packing in ("", "none"):
        yield data
        return
    unpacker = _unpacker(packing)
    while not unpacker.eof:
        yield (piece := unpacker.decompress(data, _PIECE))
        if not piece and unpacker.needs_input:
            raise ValueError("its compressed data is cut short")
        data = b""


def _unpacker(packing: str) -> Any:
    if packing == "bz2":
        return bz2.BZ2Decompressor()
    if packing == "lz4":
        from lz4.frame import LZ4FrameDecompressor

        return LZ4FrameDecompressor()
    from rosbags.rosbag2 import storage_mcap

    return vars(storage_mcap)["zstd"].ZstdDecompressor()


@cache
def _bound_rosbags() -> None:
    """Have the package, which knows no bounds, keep to those of this bag if it has some."""
    from rosbags.rosbag1 import reader
    from rosbags.rosbag2 import storage_mcap

    for table in (reader.decompressors, storage_mcap.DECOMPRESSORS):
        for packing, unpack in table.items():
            table[packing] = partial(_unpacked, packing, unpack)
    # How a topic promised delivery is YAML, for which Python takes minutes if a stranger wants.
    storage_mcap.get_qos = partial(_qos, storage_mcap.get_qos)


def _unpacked(packing: str, unpack: Callable[..., bytes], data: bytes, *size: int) -> bytes:
    bounds = _bounds.get()
    if bounds is None:
        return unpack(data, *size)
    return bounds.unpack_records(packing, data, *size) if size else bounds.unpack(packing, data)


def _qos(read: Callable[[bytes], list[Any]], metadata: bytes) -> list[Any]:
    return read(metadata) if _bounds.get() is None else []


class _Recorded(NamedTuple):
    """The last message of a topic as it was recorded."""

    data: bytes
    notes: tuple[str, ...]


def _last_map(bag: Path | _InMemory, topic: str) -> OccupancyGrid:
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise _invalid(
            "is a ROS bag, which needs the package rosbags; run pip install 'sketchmatch[rosbag]'"
        ) from None
    # A damaged bag makes packages raise whatever they stumble over.
    try:
        message: Any
        match bag.suffix.lower():
            case ".bag":
                data, notes = _ros_1(bag, topic)
                message = get_typestore(Stores.ROS1_NOETIC).deserialize_ros1(data, _TYPE)
            case suffix:
                data, notes = _sqlite(bag, topic) if suffix == ".db3" else _ros_2(bag, topic)
                message = get_typestore(Stores.LATEST).deserialize_cdr(data, _TYPE)
        return _grid(message, notes)
    except InvalidInputError:
        raise
    except FileNotFoundError:
        raise _invalid("does not exist; check the path") from None
    except Exception as error:
        said = "".join(c for c in " ".join(str(error).split()) if c.isprintable())
        cause = said[:200].rstrip(".") or type(error).__name__
        raise _invalid(f"is not a ROS bag, or is damaged ({cause}); record it again") from None


def _ros_1(bag: Any, topic: str) -> _Recorded:
    from rosbags.rosbag1 import Reader

    _bound_rosbags()
    with Reader(bag) as reader:
        topic, notes = _chosen({item.topic for item in _of_maps(reader)}, topic)
        connections = [item for item in _of_maps(reader) if item.topic == topic]
        indexes = [reader.indexes[item.id] for item in connections]
        # Each is sorted by time. What comes before the last message need not be unpacked.
        latest = max((index[-1] for index in indexes if index), default=None)
        if latest is None:
            raise _empty(topic)
        reader.indexes[connections[0].id] = [latest]
        ((_, _, data),) = reader.messages(connections[:1])
        return _Recorded(data, notes)


def _ros_2(bag: Any, topic: str) -> _Recorded:
    from rosbags.rosbag2 import Reader

    _bound_rosbags()
    with Reader(bag) as reader:
        topic, notes = _chosen({item.topic for item in _of_maps(reader)}, topic)
        connections = [item for item in _of_maps(reader) if item.topic == topic]
        storage: Any = reader.storage
        chunks = getattr(storage, "chunks", [])
        last = deque(() if chunks else reader.messages(connections), maxlen=1)
        # Of chunks, whose times are known, only those are unpacked that may hold the last message.
        for chunk in sorted(chunks, key=_end, reverse=True):
            if last and _end(chunk) < last[0][1]:
                break
            storage.chunks = [chunk]
            found = deque(reader.messages(connections), maxlen=1)
            if found and (not last or found[0][1] > last[0][1]):
                last = found
        if not last:
            raise _empty(topic)
        return _Recorded(last[0][2], notes)


def _end(chunk: Any) -> int:
    return int(chunk.message_end_time)


def _of_maps(reader: Any) -> list[Any]:
    return [item for item in reader.connections if item.msgtype == _TYPE]


def _sqlite(bag: Path | _InMemory, topic: str) -> _Recorded:
    """Read a .db3 with Python's own SQLite: ``rosbags`` opens one with nothing forbidden."""
    with closing(_database(bag)) as database:
        # Views and virtual tables have no pages, and columns that are computed are hidden.
        plain = "SELECT name FROM sqlite_master WHERE type = 'table' AND rootpage > 0"
        names = {name for (name,) in database.execute(plain)}
        for table in ("topics", "messages"):
            columns = database.execute(f"PRAGMA table_xinfo({table})")
            if table not in names or any(hidden for *_, hidden in columns):
                raise ValueError(f"it has no plain table {table}")
        maps = "SELECT name FROM topics WHERE type = ?"
        found = {name for (name,) in database.execute(maps, (_TYPE,)) if isinstance(name, str)}
        topic, notes = _chosen(found, topic)
        last = (
            "SELECT id FROM messages WHERE topic_id IN "
            "(SELECT id FROM topics WHERE type = ? AND name = ?) "
            "ORDER BY timestamp DESC, id DESC LIMIT 1"
        )
        message = database.execute(last, (_TYPE, topic)).fetchone()
        if message is None:
            raise _empty(topic)
        data = database.execute("SELECT data FROM messages WHERE id = ?", message).fetchone()[0]
        if not isinstance(data, bytes):
            raise ValueError(f"the data of a message in {topic} are not bytes")
        return _Recorded(data, notes)


def _database(bag: Path | _InMemory) -> sqlite3.Connection:
    if isinstance(bag, Path):
        if not bag.exists():
            raise FileNotFoundError
        return sqlite3.connect(f"{bag.absolute().as_uri()}?immutable=1", uri=True)
    database = sqlite3.connect(":memory:")
    try:
        # Where a log is written ahead, SQLite looks for a file beside it; these bytes say so.
        database.deserialize(bag.data[:18] + b"\1\1" + bag.data[20:])
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, len(bag.data))
        database.set_authorizer(_permit)
        steps = iter(range(100 + len(bag.data) // 1000))
        database.set_progress_handler(lambda: next(steps, -1) < 0, 10_000)
    except BaseException:
        database.close()
        raise
    return database


def _permit(action: int, *_: Any) -> int:
    """Permit a stranger's database to be read, and no function or recursion in it."""
    permitted = (sqlite3.SQLITE_SELECT, sqlite3.SQLITE_READ, sqlite3.SQLITE_PRAGMA)
    return sqlite3.SQLITE_OK if action in permitted else sqlite3.SQLITE_DENY


def _chosen(found: set[str], topic: str) -> tuple[str, tuple[str, ...]]:
    """Return the topic to read, and what is to be said of others."""
    topics = sorted(found, key=lambda name: (name != "/map", name))
    if not topics:
        raise _invalid("has no topic of type nav_msgs/OccupancyGrid; record one, such as /map")
    if topic and topic not in topics:
        raise _invalid(f"has no topic {_shown(topic)} with maps; choose one of: {_named(topics)}")
    first, *others = topics
    if topic or first == "/map" or not others:
        return topic or first, ()
    said = f"the map was read from the topic {_shown(first)}; other topics: {_named(others)}"
    return first, (said,)


def _named(topics: Sequence[str]) -> str:
    more = f" and {len(topics) - _MOST_NAMED} more" if len(topics) > _MOST_NAMED else ""
    return ", ".join(map(_shown, topics[:_MOST_NAMED])) + more


def _shown(topic: str) -> str:
    return topic if topic.isprintable() and len(topic) <= 100 else quoted(topic)


_MOST_NAMED = 10


def _empty(topic: str) -> InvalidInputError:
    return _invalid(f"has no message in {_shown(topic)}; record one, or choose another topic")


def _grid(message: Any, notes: tuple[str, ...]) -> OccupancyGrid:
    columns, rows = int(message.info.width), int(message.info.height)
    check_pixels(columns, rows, "")
    cells = np.asarray(message.data, dtype=np.int8)
    if cells.size != rows * columns:
        raise InvalidInputError(
            Reason.INVALID_GRID,
            "",
            f"has a map of {rows} × {columns} cells with data for {cells.size}; record it again",
        )
    origin = message.info.origin
    yaw = _yaw(origin.orientation)
    if yaw is None:
        # As in a YAML: whoever made the map had no orientation to give.
        yaw = 0.0
        notes = (*notes, "the orientation of the map's origin is not finite and was read as 0")
    pose = (float(origin.position.x), float(origin.position.y), yaw)
    # The message holds 0.05 as 0.0500000007; its shortest digits are what was meant.
    resolution = float(str(np.float32(message.info.resolution)))
    return OccupancyGrid(cells.reshape(rows, columns), resolution, pose, notes)


def _yaw(q: Any) -> float | None:
    if not all(math.isfinite(part) for part in (q.x, q.y, q.z, q.w)):
        return None
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def _invalid(problem: str) -> InvalidInputError:
    return InvalidInputError(Reason.INVALID_FILE, "", problem)
