"""The services of the contract, over the application."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from contextlib import aclosing
from typing import Any, TypeVar

import grpc
from google.protobuf.message import Message

from sketchmatch.app.application import Application
from sketchmatch.app.following import followed
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
_TRANSFER = transfer_service_pb2.DESCRIPTOR.services_by_name["TransferService"].full_name
_SCENE = scene_service_pb2.DESCRIPTOR.services_by_name["SceneService"].full_name

_LENGTH_DELIMITED = 2
_PROGRESS = bytes(
    [MatchResponse.DESCRIPTOR.fields_by_name["progress"].number << 3 | _LENGTH_DELIMITED]
)
_Context = grpc.aio.ServicerContext[Any, Any]
_Request = TypeVar("_Request", bound=Message)
_Response = TypeVar("_Response", bound=Message)


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
        with self._app.running("MatchRequest", request, caller_from(context)) as task:
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
        return handler_of(_MATCH, Match=grpc.unary_stream_rpc_method_handler(self.Match))


class SceneService:
    """Finds the objects in one source, and keeps scenes; what is large passes as it comes."""

    def __init__(self, app: Application) -> None:
        self._app = app

    async def Segment(self, request: bytes, context: _Context) -> bytes:  # noqa: N802
        """Segment, and return what was found."""
        with self._app.running("SegmentRequest", request, caller_from(context)) as task:
            async with aclosing(followed(task.log)) as told:
                responses = [response async for response in told]
        # Nobody waits for an answer to a request that was stopped.
        return responses[0] if responses else b""

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
                async for response in told:
                    answer = response
        return answer

    def handler(self) -> grpc.GenericRpcHandler:
        """Return what answers the calls of the service."""
        return handler_of(_TRANSFER, Transfer=grpc.unary_unary_rpc_method_handler(self.Transfer))


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


def caller_from(context: _Context) -> Caller:
    """Return who calls, by name or else by host, and the connection."""
    peer, name = context.peer() or "", caller_of(context)
    if name:
        note(caller=name)
    return Caller(name or peer.rpartition(":")[0] or peer, peer, name)


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
