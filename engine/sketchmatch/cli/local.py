"""Computing in this process, with the answers as messages of the contract.

Imported by the commands only when there is no server to ask: numba and OpenCV come with it.
"""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path
from typing import Any

from sketchmatch.cli.options import MatchSettings, say
from sketchmatch.config import load, open_registry
from sketchmatch.io import read_source
from sketchmatch.model import Source
from sketchmatch.model.limits import limited_to
from sketchmatch.pipeline import plugins
from sketchmatch.pipeline.match import run_match
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch.pipeline.selection import Choice, resolve_segmenter
from sketchmatch.pipeline.warmup import announcing_compilation
from sketchmatch.server import responses
from sketchmatch_proto.v1.catalog_service_pb2 import ListAlgorithmsResponse
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse
from sketchmatch_proto.v1.scene_service_pb2 import SegmentResponse

__all__ = ["algorithms", "match_events", "segmented"]


def match_events(
    sketch: Path, map_: Path, settings: MatchSettings, config: Path | None = None
) -> Generator[MatchResponse, None, None]:
    """Match two files and yield the events of the match."""
    names, params = settings.names, settings.params
    configuration = load(config)
    registry = open_registry(configuration)
    with limited_to(configuration.limits), announcing_compilation(say):
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
            allow_unmatched=settings.allow_unmatched,
            unmatched_price=settings.unmatched_price,
            alternatives=settings.alternatives,
            profile=settings.profile,
        )
        writer = responses.ResponseWriter(request)
        for event in run_match(request, registry, configuration.defaults):
            yield writer.response(event)


def segmented(
    path: Path, name: str, parameters: dict[str, Any], profile: str, config: Path | None
) -> SegmentResponse:
    """Find the objects in a file."""
    configuration = load(config)
    registry, chosen = open_registry(configuration), Choice(name, parameters)
    with limited_to(configuration.limits):
        source: Source = read_source(path)
        segmenter = resolve_segmenter(registry, chosen, source, configuration.defaults, profile)
        found = plugins.segmented(source, segmenter, registry, f"source.{source.field}")
    return responses.segmented(found, segmenter)


def algorithms(config: Path | None) -> ListAlgorithmsResponse:
    """List what the installed plugins offer, with the defaults in force."""
    configuration = load(config)
    return responses.catalogue(open_registry(configuration), configuration.defaults)
