"""The service of sketches in progress, over the application."""

from __future__ import annotations

from contextlib import aclosing
from typing import Any

import grpc

from sketchmatch.app.application import Application
from sketchmatch.server.services import answering, caller_from, handler_of
from sketchmatch_proto.v1 import sketch_service_pb2
from sketchmatch_proto.v1.sketch_service_pb2 import (
    CreateSketchResponse,
    DeleteSketchRequest,
    UpdateSketchRequest,
    WatchSketchRequest,
)

__all__ = ["SketchService"]

_SKETCH = sketch_service_pb2.DESCRIPTOR.services_by_name["SketchService"].full_name
_Context = grpc.aio.ServicerContext[Any, Any]


class SketchService:
    """Matches sketches while they are drawn; a map passes as it comes."""

    def __init__(self, app: Application) -> None:
        self._sketches = app.sketches

    async def CreateSketch(  # noqa: N802
        self, request: bytes, context: _Context
    ) -> CreateSketchResponse:
        """Begin a sketch."""
        return await self._sketches.create(request, caller_from(context))

    async def WatchSketch(  # noqa: N802
        self, request: WatchSketchRequest, context: _Context
    ) -> None:
        """Pass on what comes of a sketch."""
        async with aclosing(self._sketches.watch(request, caller_from(context))) as events:
            async for event in events:
                await context.write(event)

    def handler(self) -> grpc.GenericRpcHandler:
        """Return what answers the calls of the service."""
        return handler_of(
            _SKETCH,
            CreateSketch=grpc.unary_unary_rpc_method_handler(
                self.CreateSketch, response_serializer=CreateSketchResponse.SerializeToString
            ),
            UpdateSketch=answering(UpdateSketchRequest, self._sketches.update),
            WatchSketch=grpc.unary_stream_rpc_method_handler(
                self.WatchSketch, request_deserializer=WatchSketchRequest.FromString
            ),
            DeleteSketch=answering(DeleteSketchRequest, self._sketches.delete),
        )
