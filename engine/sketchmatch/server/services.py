"""The three services of the contract, over the application."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncGenerator, Awaitable, Callable
from contextlib import aclosing
from typing import Any, TypeVar

import grpc
from google.protobuf.message import Message

from sketchmatch.app import responses
from sketchmatch.app.application import Application
from sketchmatch.app.orders import varint
from sketchmatch.app.tasks import Log, Record, Task, is_progress
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
)
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse

__all__ = ["CatalogService", "MatchService", "SceneService", "followed"]

_MATCH = match_service_pb2.DESCRIPTOR.services_by_name["MatchService"].full_name
_SCENE = scene_service_pb2.DESCRIPTOR.services_by_name["SceneService"].full_name

_VARINT, _LENGTH_DELIMITED = 0, 2
_NUMBER = bytes([MatchResponse.DESCRIPTOR.fields_by_name["number"].number << 3 | _VARINT])
_EVENT = bytes(
    [
        match_service_pb2.WatchMatchResponse.DESCRIPTOR.fields_by_name["event"].number << 3
        | _LENGTH_DELIMITED
    ]
)
_Context = grpc.aio.ServicerContext[Any, Any]
_Item = TypeVar("_Item")


class MatchService:
    """Matches, streaming the search while it runs; requests and responses pass as they come."""

    def __init__(self, app: Application) -> None:
        self._app = app

    async def Match(self, request: bytes, context: _Context) -> None:  # noqa: N802
        """Run a match, or attach to the one that is the same, and pass its events on."""
        async with self._app.matching(request, _caller(context)) as match:
            await _tell(match, 0, context.write)

    async def GetMatch(  # noqa: N802
        self, request: match_service_pb2.GetMatchRequest, context: _Context
    ) -> match_service_pb2.GetMatchResponse:
        """Tell how a match is."""
        match = await self._app.matches.get(_caller(context).name, request.match_id)
        return responses.details(match.record())

    async def WatchMatch(  # noqa: N802
        self, request: match_service_pb2.WatchMatchRequest, context: _Context
    ) -> None:
        """Pass on what a match told after an event, and tells."""
        match = await self._app.matches.get(_caller(context).name, request.match_id)
        with self._app.reading(match):
            await _tell(
                match,
                request.after,
                lambda event: context.write(_EVENT + varint(len(event)) + event),
            )

    async def CancelMatch(  # noqa: N802
        self, request: match_service_pb2.CancelMatchRequest, context: _Context
    ) -> match_service_pb2.CancelMatchResponse:
        """Stop a match."""
        match = await self._app.matches.get(_caller(context).name, request.match_id)
        if isinstance(match, Task):
            self._app.cancel(match)
        return match_service_pb2.CancelMatchResponse(match=responses.summary(match.record()))

    async def ListMatches(  # noqa: N802
        self, request: match_service_pb2.ListMatchesRequest, context: _Context
    ) -> match_service_pb2.ListMatchesResponse:
        """List the caller's matches."""
        found, token = await self._app.matches.page(
            _caller(context).name, request.page_size, request.page_token
        )
        return match_service_pb2.ListMatchesResponse(
            matches=map(responses.summary, found), next_page_token=token
        )

    def handler(self) -> grpc.GenericRpcHandler:
        """Return what answers the calls of the service."""
        return _handler(
            _MATCH,
            Match=grpc.unary_stream_rpc_method_handler(self.Match),
            WatchMatch=grpc.unary_stream_rpc_method_handler(
                self.WatchMatch, match_service_pb2.WatchMatchRequest.FromString
            ),
            GetMatch=_unary(self.GetMatch, match_service_pb2.GetMatchRequest),
            CancelMatch=_unary(self.CancelMatch, match_service_pb2.CancelMatchRequest),
            ListMatches=_unary(self.ListMatches, match_service_pb2.ListMatchesRequest),
        )


class SceneService:
    """Finds the objects in one source; requests and responses pass as they come."""

    def __init__(self, app: Application) -> None:
        self._app = app

    async def Segment(self, request: bytes, context: _Context) -> bytes:  # noqa: N802
        """Segment, and return what was found."""
        with self._app.running("SegmentRequest", request, _caller(context)) as task:
            async with aclosing(followed(task.log)) as told:
                found = [response async for _, response in told]
        # Nobody waits for an answer to a request that was stopped.
        return found[0] if found else b""

    def handler(self) -> grpc.GenericRpcHandler:
        """Return what answers the calls of the service."""
        return _handler(_SCENE, Segment=grpc.unary_unary_rpc_method_handler(self.Segment))


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


async def _tell(
    match: Task | Record, after: int, write: Callable[[bytes], Awaitable[None]]
) -> None:
    """Pass on what a match told after an event, and tells, until its end."""
    note(match=match.id)
    pacing = Pacing()
    async with aclosing(followed(match.log, after)) as told:
        async for number, response in told:
            if is_progress(response):
                if pacing.is_due():
                    await write(_numbered(number, response))
                continue
            await write(_numbered(number, response))
            _note_event(match.event(number, response))


def _numbered(number: int, response: bytes) -> bytes:
    """Return an encoded event with its number."""
    return response + _NUMBER + varint(number)


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


def _unary(method: Callable[[Any, _Context], Awaitable[Any]], kind: type[Message]) -> Any:
    return grpc.unary_unary_rpc_method_handler(
        method, kind.FromString, lambda response: response.SerializeToString()
    )


async def followed(log: Log[_Item], seen: int = 0) -> AsyncGenerator[tuple[int, _Item], None]:
    """Yield what a log holds and gets after a number, until it ends; raise what it ends with."""
    loop, changed = asyncio.get_running_loop(), asyncio.Event()

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
                seen, _ = found
                yield found
            elif ended:
                break
            else:
                await changed.wait()
    log.check()
