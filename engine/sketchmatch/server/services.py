"""The three services of the contract, over the application."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator
from contextlib import aclosing
from typing import Any, TypeVar

import grpc
from google.protobuf.message import Message

from sketchmatch.app.application import Application, is_progress
from sketchmatch.app.packed import Packed
from sketchmatch.app.tasks import Log
from sketchmatch.server.calls import note
from sketchmatch.server.pacing import Pacing
from sketchmatch_proto.v1 import (
    catalog_service_pb2,
    catalog_service_pb2_grpc,
    match_pb2,
    match_service_pb2,
    match_service_pb2_grpc,
    scene_service_pb2,
    scene_service_pb2_grpc,
)
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse

__all__ = ["ADMITTED", "CatalogService", "MatchService", "SceneService", "followed"]

ADMITTED = frozenset(
    f"/{service.full_name}/{method}"
    for service, method in (
        (match_service_pb2.DESCRIPTOR.services_by_name["MatchService"], "Match"),
        (scene_service_pb2.DESCRIPTOR.services_by_name["SceneService"], "Segment"),
    )
)
"""Methods whose requests are opened by the application, once there is a place for them."""

_Context = grpc.aio.ServicerContext[Any, Any]
_Item = TypeVar("_Item")


class MatchService(match_service_pb2_grpc.MatchServiceServicer):
    """Matches, streaming the search while it runs."""

    def __init__(self, app: Application) -> None:
        self._app = app

    async def Match(  # type: ignore[override]  # noqa: N802
        self, request: Packed, context: _Context
    ) -> None:
        """Run a match and pass its events on."""
        with self._app.running(request) as task:
            note(match=task.id)
            pacing = Pacing()
            async with aclosing(followed(task.log)) as responses:
                async for response in responses:
                    _note_event(response)
                    if not is_progress(response) or pacing.is_due():
                        await context.write(response)


class SceneService(scene_service_pb2_grpc.SceneServiceServicer):
    """Finds the objects in one source."""

    def __init__(self, app: Application) -> None:
        self._app = app

    async def Segment(  # type: ignore[override]  # noqa: N802
        self, request: Packed, context: _Context
    ) -> Message:
        """Segment, and return what was found."""
        del context
        with self._app.running(request) as task:
            async with aclosing(followed(task.log)) as told:
                responses = [response async for response in told]
        # Nobody waits for an answer to a request that was stopped.
        return responses[0] if responses else scene_service_pb2.SegmentResponse()


class CatalogService(catalog_service_pb2_grpc.CatalogServiceServicer):
    """Says what this server can do."""

    def __init__(self, app: Application) -> None:
        self._app = app

    async def ListAlgorithms(  # noqa: N802
        self, request: catalog_service_pb2.ListAlgorithmsRequest, context: _Context
    ) -> catalog_service_pb2.ListAlgorithmsResponse:
        """List what the registry holds."""
        del request, context
        return self._app.algorithms()

    async def GetServerInfo(  # noqa: N802
        self, request: catalog_service_pb2.GetServerInfoRequest, context: _Context
    ) -> catalog_service_pb2.GetServerInfoResponse:
        """Tell versions and limits."""
        del request, context
        return self._app.info()


def _note_event(response: Message) -> None:
    """Note what the log tells of a match."""
    if not isinstance(response, MatchResponse):
        return
    match response.WhichOneof("event"):
        case "accepted":
            note(searcher=response.accepted.pipeline.searcher.name)
        case "scenes":
            sketch, map_ = response.scenes.sketch.objects, response.scenes.map.objects
            note(objects=f"{len(sketch)}x{len(map_)}")
        case "result":
            name = match_pb2.Outcome.Name(response.result.outcome)
            note(outcome=name.removeprefix("OUTCOME_"))


async def followed(log: Log[_Item]) -> AsyncGenerator[_Item, None]:
    """Yield what a log holds and gets, until it ends; raise the error that it ends with."""
    loop, changed, seen = asyncio.get_running_loop(), asyncio.Event(), 0

    def wake() -> None:
        loop.call_soon_threadsafe(changed.set)

    with log.waking(wake):
        while True:
            changed.clear()
            ended, found = log.ended, log.next(seen)
            if found is not None:
                seen, item = found
                yield item
            elif ended:
                break
            else:
                await changed.wait()
    log.check()
