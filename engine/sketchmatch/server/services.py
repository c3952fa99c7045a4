"""The services of the contract, over the application."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from contextlib import aclosing
from typing import Any, TypeVar

import grpc
from google.protobuf.message import Message

from sketchmatch.app import responses
from sketchmatch.app.application import Application
from sketchmatch.app.following import followed
from sketchmatch.app.orders import varint
from sketchmatch.app.tasks import Record, Task, is_progress
from sketchmatch.app.waiting import Caller
from sketchmatch.server.callers import caller_of
from sketchmatch.server.calls import note
from sketchmatch.server.pacing import Pacing
from sketchmatch.server.traces import trace
from sketchmatch_proto.v1 import (
    catalog_service_pb2,
    match_pb2,
    match_service_pb2,
    scene_service_pb2,
    transfer_service_pb2,
)
from sketchmatch_proto.v1.catalog_service_pb2 import (
    GetServerInfoRequest,
    GetServerInfoResponse,
    ListAlgorithmsRequest,
    ListAlgorithmsResponse,
)
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse
from sketchmatch_proto.v1.scene_service_pb2 import (
    DeleteSceneRequest,
    GetSceneRequest,
    ListScenesRequest,
    PutSceneResponse,
    UpdateSceneRequest,
)

__all__ = [
    "CatalogService",
    "MatchService",
    "SceneService",
    "TransferService",
    "answering",
    "caller_from",
    "handler_of",
]

_MATCH = match_service_pb2.DESCRIPTOR.services_by_name["MatchService"].full_name
_CATALOG = catalog_service_pb2.DESCRIPTOR.services_by_name["CatalogService"].full_name
_TRANSFER = transfer_service_pb2.DESCRIPTOR.services_by_name["TransferService"].full_name
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
_Request = TypeVar("_Request", bound=Message)
_Response = TypeVar("_Response", bound=Message)


class MatchService:
    """Matches, streaming the search while it runs; requests and responses pass as they come."""

    def __init__(self, app: Application) -> None:
        self._app = app

    async def Match(self, request: bytes, context: _Context) -> None:  # noqa: N802
        """Run a match, or attach to the one that is the same, and pass its events on."""
        async with self._app.matching(request, caller_from(context)) as match:
            await _tell(match, 0, context.write)

    async def WatchMatch(  # noqa: N802
        self, request: match_service_pb2.WatchMatchRequest, context: _Context
    ) -> None:
        """Pass on what a match told after an event, and tells."""
        match = await self._app.matches.get(caller_from(context).name, request.match_id)
        with self._app.reading(match):
            await _tell(
                match,
                request.after,
                lambda event: context.write(_EVENT + varint(len(event)) + event),
            )

    def handler(self) -> grpc.GenericRpcHandler:
        """Return what answers the calls of the service."""
        return handler_of(
            _MATCH,
            Match=grpc.unary_stream_rpc_method_handler(self.Match),
            WatchMatch=grpc.unary_stream_rpc_method_handler(
                self.WatchMatch, match_service_pb2.WatchMatchRequest.FromString
            ),
            GetMatch=answering(match_service_pb2.GetMatchRequest, self._get),
            CancelMatch=answering(match_service_pb2.CancelMatchRequest, self._cancel),
            ListMatches=answering(match_service_pb2.ListMatchesRequest, self._list),
        )

    async def _get(
        self, request: match_service_pb2.GetMatchRequest, caller: Caller
    ) -> match_service_pb2.GetMatchResponse:
        match = await self._app.matches.get(caller.name, request.match_id)
        return responses.details(match.record())

    async def _cancel(
        self, request: match_service_pb2.CancelMatchRequest, caller: Caller
    ) -> match_service_pb2.CancelMatchResponse:
        match = await self._app.matches.get(caller.name, request.match_id)
        return match_service_pb2.CancelMatchResponse(
            match=responses.summary(self._app.cancel(match))
        )

    async def _list(
        self, request: match_service_pb2.ListMatchesRequest, caller: Caller
    ) -> match_service_pb2.ListMatchesResponse:
        found, token = await self._app.matches.page(
            caller.name, request.page_size, request.page_token
        )
        return match_service_pb2.ListMatchesResponse(
            matches=map(responses.summary, found), next_page_token=token
        )


class SceneService:
    """Finds the objects in one source, and keeps scenes; what is large passes as it comes."""

    def __init__(self, app: Application) -> None:
        self._app = app

    async def Segment(self, request: bytes, context: _Context) -> bytes:  # noqa: N802
        """Segment, and return what was found."""
        with self._app.running("SegmentRequest", request, caller_from(context)) as task:
            async with aclosing(followed(task.log)) as told:
                found = [response async for _, response in told]
            trace(task)
        # Nobody waits for an answer to a request that was stopped.
        return found[0] if found else b""

    async def PutScene(self, request: bytes, context: _Context) -> PutSceneResponse:  # noqa: N802
        """Keep a scene."""
        return await self._app.scenes.put(request, caller_from(context))

    def handler(self) -> grpc.GenericRpcHandler:
        """Return what answers the calls of the service."""
        return handler_of(
            _SCENE,
            Segment=grpc.unary_unary_rpc_method_handler(self.Segment),
            PutScene=grpc.unary_unary_rpc_method_handler(
                self.PutScene, response_serializer=PutSceneResponse.SerializeToString
            ),
            GetScene=answering(GetSceneRequest, self._app.scenes.get),
            ListScenes=answering(ListScenesRequest, self._app.scenes.listed),
            UpdateScene=answering(UpdateSceneRequest, self._app.scenes.update),
            DeleteScene=answering(DeleteSceneRequest, self._app.scenes.delete),
        )


class TransferService:
    """Carries features from one scene to another; requests and responses pass as they come."""

    def __init__(self, app: Application) -> None:
        self._app = app

    async def Transfer(self, request: bytes, context: _Context) -> bytes:  # noqa: N802
        """Carry, and return what became of it: the last that is told."""
        answer = b""
        with self._app.running("TransferRequest", request, caller_from(context)) as task:
            note(match=task.id)
            async with aclosing(followed(task.log)) as told:
                async for _, response in told:
                    answer = response
            trace(task)
        return answer

    def handler(self) -> grpc.GenericRpcHandler:
        """Return what answers the calls of the service."""
        return handler_of(_TRANSFER, Transfer=grpc.unary_unary_rpc_method_handler(self.Transfer))


class CatalogService:
    """Says what this server can do."""

    def __init__(self, app: Application) -> None:
        self._app = app

    def handler(self) -> grpc.GenericRpcHandler:
        """Return what answers the calls of the service."""
        return handler_of(
            _CATALOG,
            ListAlgorithms=answering(ListAlgorithmsRequest, self._algorithms),
            GetServerInfo=answering(GetServerInfoRequest, self._info),
        )

    async def _algorithms(self, _: ListAlgorithmsRequest, __: Caller) -> ListAlgorithmsResponse:
        return self._app.algorithms()

    async def _info(self, _: GetServerInfoRequest, __: Caller) -> GetServerInfoResponse:
        return self._app.info()


def caller_from(context: _Context) -> Caller:
    """Return who calls, by name or else by host, and the connection."""
    peer, name = context.peer() or "", caller_of(context)
    if name:
        note(caller=name)
    return Caller(name or peer.rpartition(":")[0] or peer, peer, name)


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
    trace(match)


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


def answering(
    kind: type[_Request], method: Callable[[_Request, Caller], Awaitable[_Response]]
) -> grpc.RpcMethodHandler[_Request, _Response]:
    """Return what answers a short request as a method of the application does."""

    async def answer(request: _Request, context: _Context) -> _Response:
        return await method(request, caller_from(context))

    return grpc.unary_unary_rpc_method_handler(
        answer,
        request_deserializer=kind.FromString,
        response_serializer=lambda response: response.SerializeToString(),
    )


def handler_of(service: str, **methods: Any) -> grpc.GenericRpcHandler:
    """Return what answers the calls of a service by the handlers of its methods."""
    return grpc.method_handlers_generic_handler(service, methods)
