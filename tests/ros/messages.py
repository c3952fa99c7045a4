"""Stand-ins for ROS's message classes, made of its real definitions by the package ``rosbags``.

Like ROS's own they are made of keyword arguments, fill in what is left out, know no other fields,
and carry their constants. :func:`wire` sends one through CDR, which takes nothing but the defined
types.
"""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from tests.tools import ROOT

OURS = ROOT / "clients" / "ros" / "sketchmatch_msgs"
# As nav2 of Jazzy has it: https://docs.ros.org/en/jazzy/p/nav2_msgs/msg/CostmapFilterInfo.html
FILTER_INFO = """\
std_msgs/Header header
uint8 type
string filter_mask_topic
float32 base
float32 multiplier
"""
# https://docs.ros.org/en/jazzy/p/nav2_msgs/action/FollowPath.html
FOLLOW_PATH = """\
nav_msgs/Path path
string controller_id
string goal_checker_id
string progress_checker_id
"""
FOLLOW_PATH_RESULT = """\
std_msgs/Empty result
uint16 error_code
string error_msg
"""
FOLLOW_PATH_FEEDBACK = """\
float32 distance_to_goal
float32 speed
"""


@cache
def store():
    """Return the types of ROS 2 Jazzy, of nav2 and of our own definitions."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    known = get_typestore(Stores.ROS2_JAZZY)
    texts = {
        f"sketchmatch_msgs/msg/{file.stem}": file.read_text("utf-8")
        for file in OURS.glob("msg/*.msg")
    }
    for file, names in _parts().items():
        parts = file.read_text("utf-8").split("\n---\n")
        for part, text in zip(names, parts, strict=True):
            texts[f"sketchmatch_msgs/msg/{file.stem}{part}"] = text
    texts["nav2_msgs/msg/CostmapFilterInfo"] = FILTER_INFO
    texts["nav2_msgs/msg/FollowPathGoal"] = FOLLOW_PATH
    types = {}
    for name, text in texts.items():
        types.update(get_types_from_msg(text, name))
    known.register(types)
    return known


@cache
def message(name: str) -> Any:
    """Return the class of a message such as ``nav_msgs/msg/Path``."""
    constants, fields = store().fielddefs[name]

    def make(self: Any, **given: Any) -> None:
        unknown = given.keys() - dict(fields)
        assert not unknown, f"{name} has no {unknown}"
        for field, description in fields:
            object.__setattr__(self, field, given.get(field, _MISSING))
            if field not in given:
                setattr(self, field, _default(description))

    def assign(self: Any, field: str, value: Any) -> None:
        assert field in dict(fields), f"{name} has no {field}"
        object.__setattr__(self, field, value)

    def same(self: Any, other: Any) -> bool:
        return type(self) is type(other) and bytes(wire(self)) == bytes(wire(other))

    body = {"__init__": make, "__setattr__": assign, "__eq__": same, "__hash__": None}
    return type(
        name.rpartition("/")[2],
        (),
        {**body, **{key: value for key, _, value in constants}, "NAME": name},
    )


def wire(value: Any) -> bytes:
    """Return a message as it goes over the wire."""
    return bytes(store().serialize_cdr(_plain(value), value.NAME))


def read(data: bytes, name: str) -> Any:
    """Return a message from the wire, as ``rosbags`` has it."""
    return store().deserialize_cdr(data, name)


def modules() -> dict[str, ModuleType]:
    """Return the modules that hold the classes, by their names."""
    found: dict[str, ModuleType] = {}
    for full_name in store().fielddefs:
        package, _, name = full_name.split("/")
        module = found.setdefault(f"{package}.msg", ModuleType(f"{package}.msg"))
        module.__dict__[name] = message(full_name)
        found.setdefault(package, ModuleType(package))
    for file, names in _parts().items():
        kind = f"sketchmatch_msgs.{file.parent.name}"
        parts = {part: message(f"sketchmatch_msgs/msg/{file.stem}{part}") for part in names}
        module = found.setdefault(kind, ModuleType(kind))
        module.__dict__[file.stem] = SimpleNamespace(**parts)
    follow = found["nav2_msgs.action"] = ModuleType("nav2_msgs.action")
    follow.FollowPath = SimpleNamespace(Goal=message("nav2_msgs/msg/FollowPathGoal"))
    return found


def _parts() -> dict[Path, tuple[str, ...]]:
    """Return our actions and services, and what their parts are called."""
    return {
        **dict.fromkeys(OURS.glob("action/*.action"), ("Goal", "Result", "Feedback")),
        **dict.fromkeys(OURS.glob("srv/*.srv"), ("Request", "Response")),
    }


_MISSING = object()


def _default(description: Any) -> Any:
    from rosbags.interfaces import Nodetype

    kind, detail = description
    if kind == Nodetype.NAME:
        return message(detail)()
    if kind == Nodetype.BASE:
        return {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}.get(detail[0], 0)
    element, count = detail
    return [] if kind == Nodetype.SEQUENCE else [_default(element) for _ in range(count)]


def _plain(value: Any) -> Any:
    """Return a message as ``rosbags`` wants it."""
    from rosbags.interfaces import Nodetype

    _, fields = store().fielddefs[value.NAME]
    given = {}
    for field, (kind, detail) in fields:
        found = getattr(value, field)
        if kind == Nodetype.NAME:
            found = _plain(found)
        elif kind in (Nodetype.SEQUENCE, Nodetype.ARRAY):
            element, inner = detail[0]
            if element == Nodetype.NAME:
                found = [_plain(item) for item in found]
            elif inner[0] != "string":
                found = np.array(found, dtype=inner[0])
        elif detail[0] != "string":
            _check(value.NAME, field, found, detail[0])
        given[field] = found
    return store().types[value.NAME](**given)


def _check(name: str, field: str, value: Any, kind: str) -> None:
    """Take what ROS's own classes take: no whole number for a float, and none that is too large."""
    wanted = {"bool": bool, "float32": float, "float64": float}.get(kind, int)
    assert isinstance(value, wanted), f"{name}.{field} is {value!r}, no {kind}"
    if wanted is int:
        assert np.iinfo(kind).min <= value <= np.iinfo(kind).max, f"{name}.{field} is {value}"


def install() -> list[str]:
    """Make the modules importable, and return their names."""
    made = modules()
    sys.modules.update(made)
    return [*made]
