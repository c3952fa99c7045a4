"""Carries routes and zones of a sketch by the server's TransferService."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from sketchmatch_client import Client, features
from sketchmatch_proto.v1.source_pb2 import Point, Source
from sketchmatch_ros.matching import XY, Features

__all__ = ["carry"]


def carry(
    client: Client,
    sketch: Source,
    map_: Source,
    partners: Mapping[int, int],
    drawn: Features,
    radius: float,
) -> Features:
    """Return routes and zones on the map, as :class:`~sketchmatch_ros.matching.Carrier` says."""
    given = [features.route(route) for route in drawn.routes]
    given += [features.zone(zone) for zone in drawn.zones]
    answer = client.transfer(sketch, map_, given, object_map=partners, radius=radius)
    # The route that the segmenter finds comes first and unasked; it is among those given, too.
    carried = [each for each in answer.features if not each.drawn]
    count = len(drawn.routes)
    routes, zones = carried[:count], carried[count:]
    outlines = [each.feature.zone.rings for each in zones]
    return Features(
        [_places(each.feature.route.points) for each in routes],
        [_places(rings[0].points if rings else ()) for rings in outlines],
        [
            f"{kind} {k}: {change.sentence}"
            for kind, some in (("route", routes), ("zone", zones))
            for k, each in enumerate(some)
            for change in each.changes
        ],
    )


def _places(points: Iterable[Point]) -> list[XY]:
    return [(point.x, point.y) for point in points]
