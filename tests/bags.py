"""ROS bags with maps, written with the package ``rosbags``."""

import math

ROS1, MCAP, SQLITE = KINDS = "ros1", "mcap", "sqlite"


def write(folder, kind, *messages, packing=""):
    """Write (topic, cells, yaw) messages, or strings for other topics, and return the bag.

    ``packing`` is ``"bz2"`` or ``"lz4"`` for ROS 1, anything for MCAP, which has zstd.
    """
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    path = folder / ("office.bag" if kind == ROS1 else "office")
    store = get_typestore(Stores.ROS1_NOETIC if kind == ROS1 else Stores.ROS2_HUMBLE)
    serialize = store.serialize_ros1 if kind == ROS1 else store.serialize_cdr
    if kind == ROS1:
        writer = Writer1(path)
    else:
        plugin = StoragePlugin.MCAP if kind == MCAP else StoragePlugin.SQLITE3
        writer = Writer2(path, version=9, storage_plugin=plugin)
    if packing and kind == ROS1:
        writer.set_compression(Writer1.CompressionFormat[packing.upper()])
    elif packing:
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for k, (topic, cells, yaw) in enumerate(messages):
            message = grid(store.types, kind, cells, yaw)
            if topic not in connections:
                connections[topic] = writer.add_connection(
                    topic, message.__msgtype__, typestore=store
                )
            data = serialize(message, message.__msgtype__)
            writer.write(connections[topic], 10**9 * (k + 1), data)
    return path


def file_of(bag):
    """Return the file of a bag that holds its messages; of ROS 2 the bag is a folder."""
    return next(bag.glob("*.[md][cb]*")) if bag.is_dir() else bag


def grid(types, kind, cells, yaw):
    if isinstance(cells, str):
        return types["std_msgs/msg/String"](data=cells)
    sequence = {"seq": 0} if kind == ROS1 else {}
    time = types["builtin_interfaces/msg/Time"](sec=1, nanosec=0)
    pose = types["geometry_msgs/msg/Pose"](
        position=types["geometry_msgs/msg/Point"](x=1.0, y=-2.0, z=0.0),
        orientation=types["geometry_msgs/msg/Quaternion"](
            x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2)
        ),
    )
    return types["nav_msgs/msg/OccupancyGrid"](
        header=types["std_msgs/msg/Header"](stamp=time, frame_id="map", **sequence),
        info=types["nav_msgs/msg/MapMetaData"](
            map_load_time=time,
            resolution=0.05,
            width=cells.shape[1],
            height=cells.shape[0],
            origin=pose,
        ),
        data=cells.ravel(),
    )
