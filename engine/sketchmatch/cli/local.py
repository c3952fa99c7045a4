"""Computing in this process, with the answers as messages of the contract.

Imported by the commands only when there is no server to ask: numba and OpenCV come with it.
"""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path
from typing import Any

from sketchmatch.cli.options import MatchSettings, say
from sketchmatch.io import read_source
from sketchmatch.model import Source
from sketchmatch.pipeline import plugins
from sketchmatch.pipeline.match import MatchRequest, run_match
from sketchmatch.pipeline.selection import Choice, resolve_segmenter
from sketchmatch.pipeline.warmup import announcing_compilation
from sketchmatch.registry import default_registry
from sketchmatch.server import responses
from sketchmatch_proto.v1.catalog_service_pb2 import ListAlgorithmsResponse
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse
from sketchmatch_proto.v1.scene_service_pb2 import SegmentResponse

__all__ = ["algorithms", "match_events", "segmented"]


def match_events(
    sketch: Path, map_: Path, settings: MatchSettings
) -> Generator[MatchResponse, None, None]:
    """Match two files and yield the events of the match."""
    names, params = settings.names, settings.params
    request = MatchRequest(
        sketch=read_source(sketch),
        map=read_source(map_),
        selection={
            stage: Choice(names.get(stage, ""), params.get(stage, {}))
            for stage in {*names, *params}
        },
        seed=settings.seed,
        time_budget=settings.time_budget,
        weights=settings.weights,
        alternatives=settings.alternatives,
    )
    writer = responses.ResponseWriter(request)
    with announcing_compilation(say):
        for event in run_match(request, default_registry()):
            yield writer.response(event)


def segmented(path: Path, name: str, parameters: dict[str, Any]) -> SegmentResponse:
    """Find the objects in a file."""
    source: Source = read_source(path)
    registry = default_registry()
    segmenter = resolve_segmenter(registry, Choice(name, parameters), source)
    found = plugins.segmented(source, segmenter, registry, f"source.{source.field}")
    return responses.segmented(found, segmenter)


def algorithms() -> ListAlgorithmsResponse:
    """List what the installed plugins offer."""
    return responses.catalogue(default_registry())
