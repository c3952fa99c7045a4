"""Functions that make the points, routes and zones for :meth:`Client.transfer`."""

from __future__ import annotations

import reprlib
from collections.abc import Iterable, Sequence
from typing import Any

from sketchmatch_client.errors import InvalidRequestError, refused_as
from sketchmatch_proto.v1 import source_pb2
from sketchmatch_proto.v1.transfer_service_pb2 import Feature, Route, Zone

__all__ = ["point", "route", "zone"]


def point(x: float, y: float, name: str = "") -> Feature:
    """Return a place.

    Parameters
    ----------
    x, y
        Coordinates in the scene of the feature.
    name
        For people.

    Raises
    ------
    InvalidRequestError
        If they are no numbers.
    """
    return _named(Feature(point=_points([(x, y)], "point")[0]), name)


def route(
    points: Iterable[Sequence[float]], name: str = "", speeds: Iterable[float] | None = None
) -> Feature:
    """Return a route, driven in the order of its points.

    Parameters
    ----------
    points
        (x, y) of each of its points, two or more.
    name
        For people.
    speeds
        Speed from each of its points on, in metres per second; as many as points.

    Raises
    ------
    InvalidRequestError
        If the points or speeds are not of this form.

    Examples
    --------
    >>> route([(0, 0), (2, 0)], "patrol", [0.5, 0.2]).route.speeds_meters_per_second
    [0.5, 0.2]
    """
    way = Route(points=_points(points, "route.points"))
    problem = f"is {reprlib.repr(speeds)}; give a number for each point, or none at all"
    with refused_as("INVALID_FIELD", "route.speeds", problem):
        way.speeds_meters_per_second.extend([] if speeds is None else speeds)
    return _named(Feature(route=way), name)


def zone(rings: Sequence[Any], name: str = "") -> Feature:
    """Return an area.

    Parameters
    ----------
    rings
        The (x, y) corners of its outline, or a list of such rings: the outline, then its holes.
    name
        For people.

    Raises
    ------
    InvalidRequestError
        If the corners are not of this form.

    Examples
    --------
    >>> len(zone([(0, 0), (2, 0), (2, 1)], "no-go").zone.rings[0].points)
    3
    """
    with refused_as(
        "INVALID_FIELD", "zone.rings", f"is {reprlib.repr(rings)}; give (x, y) corners"
    ):
        given = [rings] if _is_point(rings[0]) else rings
        found = [source_pb2.Ring(points=_points(ring, "zone.rings")) for ring in given]
    return _named(Feature(zone=Zone(rings=found)), name)


def _is_point(given: Any) -> bool:
    return not hasattr(given[0], "__len__")


def _named(feature: Feature, name: str) -> Feature:
    problem = f"is {reprlib.repr(name)}; give text"
    with refused_as("INVALID_FIELD", "name", problem):
        feature.name = name
    return feature


def _points(given: Iterable[Sequence[float]], field: str) -> list[source_pb2.Point]:
    points = []
    with refused_as("INVALID_FIELD", field, f"is {reprlib.repr(given)}; give points as (x, y)"):
        given = list(given)
    for each in given:
        with refused_as("INVALID_FIELD", field, f"has {reprlib.repr(each)}; give points as (x, y)"):
            x, y = each
            points.append(source_pb2.Point(x=x, y=y))
    if not points:
        raise InvalidRequestError(f"{field} is empty; give points", "INVALID_FIELD", field)
    return points
