"""The three services of the contract, over the application."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator
from contextlib import aclosing
from typing import Any, TypeVar

import grpc
from google.protobuf.message import Message

from sketchmatch.app.application import Application
from sketchmatch.app.tasks import Log
from sketchmatch.server.callers import caller_of
from sketchmatch_proto.v1 import (
    catalog_service_pb2,
    catalog_service_pb2_grpc,
    match_service_pb2,
    match_service_pb2_grpc,
    scene_service_pb2,
    scene_service_pb2_grpc,
)

__all__ = ["CatalogService", "MatchService", "SceneService", "followed"]

_Context = grpc.aio.ServicerContext[Any, Any]
_Item = TypeVar("_Item")


class MatchService(match_service_pb2_grpc.MatchServiceServicer):
    """Matches, streaming the search while it runs."""

    def __init__(self, app: Application) -> None:
        self._app = app

    async def Match(  # type: ignore[override]  # noqa: N802
        self, request: match_service_pb2.MatchRequest, context: _Context
    ) -> None:
        """Run a match and pass its events on."""
        with self._app.running(request, caller_of(context)) as task:
            async with aclosing(followed(task.log)) as responses:
                async for response in responses:
                    await context.write(response)


class SceneService(scene_service_pb2_grpc.SceneServiceServicer):
    """Finds the objects in one source."""

    def __init__(self, app: Application) -> None:
        self._app = app

    async def Segment(  # type: ignore[override]  # noqa: N802
        self, request: scene_service_pb2.SegmentRequest, context: _Context
    ) -> Message:
        """Segment, and return what was found."""
        with self._app.running(request, caller_of(context)) as task:
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
