"""From plain Python values to requests that carry something from one scene to another."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Literal, Unpack

from sketchmatch_client._requests import MatchOptions, match_request
from sketchmatch_client.errors import InvalidRequestError, refused_as
from sketchmatch_proto.v1 import source_pb2, transfer_service_pb2
from sketchmatch_proto.v1.source_pb2 import Source
from sketchmatch_proto.v1.transfer_service_pb2 import Feature, Partners, TransferRequest

__all__ = ["TransferOptions", "transfer_request"]

Direction = Literal["sketch-to-map", "map-to-sketch"]
"""From where to where features are carried."""

_DIRECTIONS = {
    "sketch-to-map": transfer_service_pb2.TRANSFER_DIRECTION_SKETCH_TO_MAP,
    "map-to-sketch": transfer_service_pb2.TRANSFER_DIRECTION_MAP_TO_SKETCH,
}
_FOR_MATCHES = ("alternatives", "request_id", "keep_running", "priority")
_Y_AXES = {"up": source_pb2.Y_AXIS_UP, "down": source_pb2.Y_AXIS_DOWN}


class TransferOptions(MatchOptions, total=False):
    """Options of a transfer; the contract has their defaults.

    Attributes
    ----------
    object_map
        Which sketched object is which mapped one, by index from 0, if known, e.g.
        ``match.object_map``: then nothing is matched.
    direction
        ``"sketch-to-map"``, also from an old map to a new one, or ``"map-to-sketch"``.
    y_axis
        Which way y grows in the features; in the answer it grows upwards.
    radius
        Distance of routes from obstacles: half the width of the robot. By default 0 on a grid;
        elsewhere routes then do not avoid objects.
    allow_unknown
        Whether routes may cross unknown cells.
    """

    object_map: Mapping[int, int] | None
    direction: Direction | None
    y_axis: Literal["up", "down"] | None
    radius: float | None
    allow_unknown: bool | None


def transfer_request(
    sketch: Source,
    map: Source,  # noqa: A002
    features: Iterable[Feature] = (),
    **options: Unpack[TransferOptions],
) -> TransferRequest:
    """Return the request for a transfer; see :class:`TransferOptions`.

    Examples
    --------
    >>> from sketchmatch_client.features import point
    >>> request = transfer_request(Source(), Source(), [point(1, 2)], object_map={0: 3, 1: 0})
    >>> [pair.map_object for pair in request.object_map]
    [3, 0]
    """
    given: dict[str, Any] = dict(options)
    own = {name: given.pop(name) for name in _FIELDS if name in given}
    for name in _FOR_MATCHES:
        if given.pop(name, None) is not None:
            raise InvalidRequestError(
                f"{name} is only for matches; leave it out of a transfer",
                "INVALID_FIELD",
                name,
            )
    matching = match_request(sketch, map, **given)
    # What both requests have has the same numbers in both.
    request = TransferRequest.FromString(matching.SerializeToString())
    with refused_as(
        "INVALID_FIELD", "features", "is not a list of what sketchmatch_client.features makes"
    ):
        request.features.extend(features)
    for name, value in own.items():
        if value is None:
            continue
        remedy, converted = _FIELDS[name]
        with refused_as("INVALID_FIELD", name, f"is {reprlib.repr(value)}; {remedy}"):
            request.MergeFrom(TransferRequest(**{name: converted(value)}))
    return request


def _pairs(given: Mapping[int, int]) -> list[Partners]:
    if not isinstance(given, Mapping) or not given:
        raise TypeError
    return [Partners(sketch_object=a, map_object=b) for a, b in given.items()]


def _one_of(names: Mapping[str, Any]) -> Callable[[Any], Any]:
    def chosen(given: Any) -> Any:
        if given not in names:
            raise ValueError
        return names[given]

    return chosen


def _same(value: Any) -> Any:
    return value


_FIELDS: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "object_map": (
        "give a dict from sketched to mapped objects, by index from 0, or None to match them",
        _pairs,
    ),
    "direction": ("give 'sketch-to-map' or 'map-to-sketch'", _one_of(_DIRECTIONS)),
    "y_axis": ("give 'up' or 'down'", _one_of(_Y_AXES)),
    "radius": ("give a number", _same),
    "allow_unknown": ("give True or False", _same),
}
