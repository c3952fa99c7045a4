"""What interceptors share: they put something around the method that answers a call."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Awaitable, Callable
from typing import Any, cast

import grpc

__all__ = ["WrappingInterceptor", "kind_of", "status_of"]


class WrappingInterceptor(grpc.aio.ServerInterceptor, ABC):
    """Puts something around the methods of a server."""

    async def intercept_service(
        self,
        continuation: Callable[
            [grpc.HandlerCallDetails], Awaitable[grpc.RpcMethodHandler[Any, Any] | None]
        ],
        handler_call_details: grpc.HandlerCallDetails,
    ) -> grpc.RpcMethodHandler[Any, Any] | None:
        """Return the method's handler, wrapped; None if nobody answers such calls."""
        # A named tuple, which its type does not tell.
        handler = cast(Any, await continuation(handler_call_details))
        if handler is not None:
            handler = self.wrapped(handler, handler_call_details.method)
        return cast("grpc.RpcMethodHandler[Any, Any] | None", handler)

    @abstractmethod
    def wrapped(self, handler: Any, path: str) -> Any:
        """Return the handler of the method at a path with something around it, or as it is."""


def kind_of(handler: Any) -> str:
    """Return under which name a handler has its method, as in ``unary_stream``."""
    asked = "stream" if handler.request_streaming else "unary"
    answered = "stream" if handler.response_streaming else "unary"
    return f"{asked}_{answered}"


def status_of(context: Any) -> grpc.StatusCode | None:
    """Return the status that a call was given, which gRPC keeps as a number; None if none was."""
    number = context.code()
    return next((code for code in grpc.StatusCode if number in (code, code.value[0])), None)
