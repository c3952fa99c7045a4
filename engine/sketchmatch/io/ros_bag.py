"""Maps out of ROS bags: the last ``nav_msgs/OccupancyGrid`` message of a topic.

Bags of ROS 1 (``.bag``) and of ROS 2 (``.mcap``, ``.db3``, or the folder with ``metadata.yaml``)
are read through the package ``rosbags``, which ``pip install 'sketchmatch[rosbag]'`` brings. The
topic is ``/map``, or else the first by name that carries maps; ``office.mcap#/robot1/map`` names
another. A bag may be of any size: only the messages of that topic are read, and the limit on bytes
does not count for it.
"""

from __future__ import annotations

import math
import os
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import OccupancyGrid
from sketchmatch.model.limits import check_pixels

__all__ = ["SUFFIXES", "bag_and_topic", "is_bag", "read_bag"]

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
    with _opened(path) as reader:
        connections = _connections(reader, topic)
        last = deque(reader.messages(connections=connections), maxlen=1)
        if not last:
            raise _invalid(f"has no message in {connections[0].topic}; record one, or name a topic")
        connection, _, data = last[0]
        message = reader.deserialize(data, connection.msgtype)
    return _grid(message)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise _invalid(
            "is a ROS bag, which the package rosbags reads; pip install 'sketchmatch[rosbag]'"
        ) from None
    # A damaged bag makes the package raise whatever it stumbles over.
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
            yield reader
    except InvalidInputError:
        raise
    except FileNotFoundError:
        raise _invalid("does not exist; check the path") from None
    except Exception as error:
        cause = " ".join(str(error).split())[:200].rstrip(".") or type(error).__name__
        raise _invalid(f"is no ROS bag, or a damaged one ({cause}); record it again") from None


def _connections(reader: Any, topic: str) -> list[Any]:
    found = [item for item in reader.connections if item.msgtype == _TYPE]
    topics = sorted({item.topic for item in found}, key=lambda name: (name != "/map", name))
    if not topics:
        raise _invalid("has no topic of type nav_msgs/OccupancyGrid; record one, such as /map")
    chosen = topic or topics[0]
    if chosen not in topics:
        raise _invalid(f"has no maps in {topic}; choose one of: {', '.join(topics)}")
    return [item for item in found if item.topic == chosen]


def _grid(message: Any) -> OccupancyGrid:
    columns, rows = int(message.info.width), int(message.info.height)
    check_pixels(columns, rows, "")
    cells = np.asarray(message.data, dtype=np.int8)
    if cells.size != rows * columns:
        raise InvalidInputError(
            Reason.INVALID_GRID,
            "",
            f"has a map of {cells.size} cells for {rows} × {columns}; record it again",
        )
    origin = message.info.origin
    yaw = _yaw(origin.orientation)
    notes: tuple[str, ...] = ()
    if yaw is None:
        # As in a YAML: whoever made the map had no orientation to give.
        yaw, notes = 0.0, ("the orientation of the map's origin is not finite, read as none",)
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
