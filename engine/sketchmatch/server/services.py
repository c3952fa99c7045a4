"""The services of the contract, over the application."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing
from typing import Any, TypeVar

import grpc

from sketchmatch.app.application import Application
from sketchmatch.app.tasks import Log
from sketchmatch.app.waiting import Caller
from sketchmatch.server.callers import caller_of
from sketchmatch.server.calls import note
from sketchmatch.server.pacing import Pacing
from sketchmatch_proto.v1 import (
    catalog_service_pb2,
    catalog_service_pb2_grpc,
    match_pb2,
    match_service_pb2,
    scene_service_pb2,
    transfer_service_pb2,
)
from sketchmatch_proto.v1.match_pb2 import MatchAccepted, MatchResult
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse

__all__ = ["CatalogService", "MatchService", "SceneService", "TransferService", "followed"]

_MATCH = match_service_pb2.DESCRIPTOR.services_by_name["MatchService"].full_name
_TRANSFER = transfer_service_pb2.DESCRIPTOR.services_by_name["TransferService"].full_name
_SCENE = scene_service_pb2.DESCRIPTOR.services_by_name["SceneService"].full_name

_LENGTH_DELIMITED = 2
_PROGRESS = bytes(
    [MatchResponse.DESCRIPTOR.fields_by_name["progress"].number << 3 | _LENGTH_DELIMITED]
)
_Context = grpc.aio.ServicerContext[Any, Any]
_Item = TypeVar("_Item")


class MatchService:
    """Matches, streaming the search while it runs; requests and responses pass as they come."""

    def __init__(
        self,
        app: Application,
        matched: Callable[[MatchAccepted, MatchResult], None] = lambda *_: None,
    ) -> None:
        self._app = app
        self._matched = matched

    async def Match(self, request: bytes, context: _Context) -> None:  # noqa: N802
        """Run a match and pass its events on."""
        with self._app.running("MatchRequest", request, _caller(context)) as task:
            note(match=task.id)
            pacing, accepted = Pacing(), MatchAccepted()
            async with aclosing(followed(task.log)) as responses:
                async for response in responses:
                    if _is_progress(response):
                        if pacing.is_due():
                            await context.write(response)
                        continue
                    await context.write(response)
                    event = MatchResponse.FromString(response)
                    _note_event(event)
                    if event.HasField("accepted"):
                        accepted = event.accepted
                    elif event.HasField("result"):
                        self._matched(accepted, event.result)

    def handler(self) -> grpc.GenericRpcHandler:
        """Return what answers the calls of the service."""
        return _handler(_MATCH, Match=grpc.unary_stream_rpc_method_handler(self.Match))


class SceneService:
    """Finds the objects in one source; requests and responses pass as they come."""

    def __init__(self, app: Application) -> None:
        self._app = app

    async def Segment(self, request: bytes, context: _Context) -> bytes:  # noqa: N802
        """Segment, and return what was found."""
        with self._app.running("SegmentRequest", request, _caller(context)) as task:
            async with aclosing(followed(task.log)) as told:
                responses = [response async for response in told]
        # Nobody waits for an answer to a request that was stopped.
        return responses[0] if responses else b""

    def handler(self) -> grpc.GenericRpcHandler:
        """Return what answers the calls of the service."""
        return _handler(_SCENE, Segment=grpc.unary_unary_rpc_method_handler(self.Segment))


class TransferService:
    """Carries features from one scene to another; requests and responses pass as they come."""

    def __init__(self, app: Application) -> None:
        self._app = app

    async def Transfer(self, request: bytes, context: _Context) -> bytes:  # noqa: N802
        """Carry, and return what became of it: the last that is told."""
        answer = b""
        with self._app.running("TransferRequest", request, _caller(context)) as task:
            note(match=task.id)
            async with aclosing(followed(task.log)) as told:
                async for response in told:
                    answer = response
        return answer

    def handler(self) -> grpc.GenericRpcHandler:
        """Return what answers the calls of the service."""
        return _handler(_TRANSFER, Transfer=grpc.unary_unary_rpc_method_handler(self.Transfer))


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


def _caller(context: _Context) -> Caller:
    """Return who calls, by name or else by host, and the connection."""
    peer, name = context.peer() or "", caller_of(context)
    if name:
        note(caller=name)
    return Caller(name or peer.rpartition(":")[0] or peer, peer)


def _is_progress(response: bytes) -> bool:
    """Whether an encoded event is progress; it has no other field."""
    return response[:1] == _PROGRESS


def _note_event(event: MatchResponse) -> None:
    """Note what the log tells of a match."""
    match event.WhichOneof("event"):
        case "accepted":
            note(searcher=event.accepted.pipeline.searcher.name)
        case "scenes":
            sketch, map_ = event.scenes.sketch.objects, event.scenes.map.objects
            note(objects=f"{len(sketch)}x{len(map_)}")
        case "result":
            name = match_pb2.Outcome.Name(event.result.outcome)
            note(outcome=name.removeprefix("OUTCOME_"))


def _handler(service: str, **methods: Any) -> grpc.GenericRpcHandler:
    return grpc.method_handlers_generic_handler(service, methods)


async def followed(log: Log[_Item]) -> AsyncGenerator[_Item, None]:
    """Yield what a log holds and gets, until it ends; raise the error that it ends with."""
    loop, changed, seen = asyncio.get_running_loop(), asyncio.Event(), 0

    here = threading.get_ident()

    def wake() -> None:
        if threading.get_ident() == here:
            changed.set()
        else:
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
