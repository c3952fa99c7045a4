"""What every call shares: how its request is opened, and what becomes of an error."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterable, AsyncIterator, Awaitable, Callable
from functools import partial
from typing import Any, NoReturn, cast

import grpc

from sketchmatch.app.faults import told
from sketchmatch.app.packed import Packed
from sketchmatch.errors import InvalidInputError
from sketchmatch.server.calls import note, noted
from sketchmatch.server.status import is_fault, refusal

__all__ = ["ErrorInterceptor", "OpeningInterceptor"]

_OURS = "/sketchmatch."
_SHORT_BYTES = 65_536
_log = logging.getLogger(__name__)
_Context = grpc.aio.ServicerContext[Any, Any]


class ErrorInterceptor(grpc.aio.ServerInterceptor):
    """Ends a call whose method raises with the status of the error."""

    async def intercept_service(
        self,
        continuation: Callable[
            [grpc.HandlerCallDetails], Awaitable[grpc.RpcMethodHandler[Any, Any] | None]
        ],
        handler_call_details: grpc.HandlerCallDetails,
    ) -> grpc.RpcMethodHandler[Any, Any] | None:
        """Return the method's handler, with its errors caught."""
        handler = cast(Any, await continuation(handler_call_details))
        # Health and reflection see to themselves.
        if handler is not None and handler_call_details.method.startswith(_OURS):
            kind = _kind(handler)
            handler = handler._replace(**{kind: _caught(getattr(handler, kind))})
        return cast("grpc.RpcMethodHandler[Any, Any] | None", handler)


class OpeningInterceptor(grpc.aio.ServerInterceptor):
    """Inflates and decodes requests, but those that methods want as they come.

    gRPC itself would inflate them before anybody knows of the call, and say of what it cannot
    decode that nobody knows what happened. What is opened here is short, and opened for anybody.
    """

    async def intercept_service(
        self,
        continuation: Callable[
            [grpc.HandlerCallDetails], Awaitable[grpc.RpcMethodHandler[Any, Any] | None]
        ],
        handler_call_details: grpc.HandlerCallDetails,
    ) -> grpc.RpcMethodHandler[Any, Any] | None:
        """Return the method's handler, with its requests opened by us."""
        handler = cast(Any, await continuation(handler_call_details))
        if handler is not None and handler.request_deserializer is not None:
            kind, read = _kind(handler), partial(Packed, read=handler.request_deserializer)
            opening = _opening_each if handler.request_streaming else _opening
            method = opening(getattr(handler, kind))
            handler = handler._replace(request_deserializer=read, **{kind: method})
        return cast("grpc.RpcMethodHandler[Any, Any] | None", handler)


def _opening(method: Callable[[Any, _Context], Awaitable[Any]]) -> Any:
    async def call(packed: Packed, context: _Context) -> Any:
        return await method(await _opened(packed, context), context)

    return call


def _opening_each(method: Callable[[Any, _Context], AsyncIterable[Any]]) -> Any:
    """Return the same for a stream of requests that is answered by a stream."""

    async def call(requests: AsyncIterable[Packed], context: _Context) -> AsyncIterator[Any]:
        opened = (await _opened(packed, context) async for packed in requests)
        async for response in method(opened, context):
            yield response

    return call


async def _opened(packed: Packed, context: _Context) -> Any:
    try:
        return packed.opened(_SHORT_BYTES)
    except InvalidInputError as error:
        await _abort(context, error)


def _kind(handler: Any) -> str:
    asked = "stream" if handler.request_streaming else "unary"
    answered = "stream" if handler.response_streaming else "unary"
    return f"{asked}_{answered}"


def _caught(method: Callable[[Any, _Context], Awaitable[Any]]) -> Any:
    async def call(request: Any, context: _Context) -> Any:
        try:
            return await method(request, context)
        except grpc.aio.InternalError:
            # Nobody is left to write to. To end as if all were well would be to write.
            raise asyncio.CancelledError from None
        except Exception as error:
            await _abort(context, error)

    return call


async def _abort(context: _Context, error: Exception) -> NoReturn:
    if is_fault(error):
        _log.error("%s: %s", noted(), told(error))
    status = refusal(error)
    note(reason=getattr(error, "reason", type(error).__name__))
    await context.abort(status.code, status.message, status.trailing_metadata)
