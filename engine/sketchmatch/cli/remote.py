"""Asking a server; what is sent are the files as they are, where the contract has room for them."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path
from typing import Any

from sketchmatch.cli.options import MatchSettings
from sketchmatch.config import load
from sketchmatch.io import read_source
from sketchmatch.model import Image, OccupancyGrid, PolygonSet, StrokeSet
from sketchmatch.model.limits import limited_to
from sketchmatch_client import Client, sources
from sketchmatch_proto.v1.catalog_service_pb2 import ListAlgorithmsResponse
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse
from sketchmatch_proto.v1.scene_service_pb2 import SegmentResponse
from sketchmatch_proto.v1.source_pb2 import Source

__all__ = ["algorithms", "match_events", "segmented"]


def match_events(
    server: str, sketch: Path, map_: Path, settings: MatchSettings
) -> Generator[MatchResponse, None, None]:
    """Let a server match two files and yield the events of the match."""
    sketch_message, map_message = _message(sketch), _message(map_)
    with Client(server) as client:
        yield from client.events(
            sketch_message,
            map_message,
            sketch_segmenter=settings.names.get("sketch_segmenter"),
            map_segmenter=settings.names.get("map_segmenter"),
            histogram=settings.names.get("histogram"),
            similarity=settings.names.get("similarity"),
            searcher=settings.names.get("searcher"),
            params=settings.params,
            seed=settings.seed,
            time_budget=settings.time_budget,
            weights=settings.weights,
            allow_unmatched=settings.allow_unmatched,
            unmatched_price=settings.unmatched_price,
            alternatives=settings.alternatives,
            profile=settings.profile or None,
        )


def segmented(
    server: str, path: Path, name: str, parameters: dict[str, Any], profile: str
) -> SegmentResponse:
    """Let a server find the objects in a file."""
    message = _message(path)
    with Client(server) as client:
        return client.segment(
            message, segmenter=name or None, params=parameters, profile=profile or None
        )


def algorithms(server: str) -> ListAlgorithmsResponse:
    """List what a server offers."""
    with Client(server) as client:
        return client.algorithms()


def _message(path: Path) -> Source:
    """Return a file as a message: pictures and maps as they are, drawings as what they hold.

    It is read in any case, so that a file of no use is refused here, in the same words as without
    a server.
    """
    with limited_to(load().limits):
        source = read_source(path)
    match source:
        case OccupancyGrid() if path.suffix.lower() in (".yaml", ".yml"):
            return sources.map_server_map(path)
        case OccupancyGrid(cells, resolution, origin):
            return sources.occupancy_grid(cells, resolution, origin)
        case Image():
            return sources.image(path)
        case StrokeSet(strokes):
            return sources.strokes(
                [_timed(stroke.points, stroke.times) for stroke in strokes],
                [stroke.label for stroke in strokes],
            )
        case PolygonSet(polygons):
            return sources.polygons(
                [[ring.tolist() for ring in polygon.rings] for polygon in polygons],
                [polygon.label for polygon in polygons],
            )


def _timed(points: Any, times: Any) -> list[Any]:
    if times is None:
        return list(points.tolist())
    return [(*point, time) for point, time in zip(points.tolist(), times.tolist(), strict=True)]
