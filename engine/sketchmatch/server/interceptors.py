"""What every call shares: an error becomes a status, and a fault is told to the operator."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from typing import Any, NoReturn, cast

import grpc

from sketchmatch.server.status import is_fault, refusal

__all__ = ["ErrorInterceptor"]

_OURS = "/sketchmatch."
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
            kind = "unary_stream" if handler.response_streaming else "unary_unary"
            handler = handler._replace(**{kind: _caught(getattr(handler, kind))})
        return cast("grpc.RpcMethodHandler[Any, Any] | None", handler)


def _caught(method: Callable[[Any, _Context], Awaitable[Any]]) -> Any:
    async def call(request: Any, context: _Context) -> Any:
        try:
            return await method(request, context)
        except grpc.aio.InternalError:
            # Nobody is left to write to: the caller has gone.
            raise asyncio.CancelledError from None
        except Exception as error:
            await _abort(context, error)

    return call


async def _abort(context: _Context, error: Exception) -> NoReturn:
    if is_fault(error):
        _log.error("%s", error, exc_info=error)
    status = refusal(error)
    await context.abort(status.code, status.message, status.trailing_metadata)
