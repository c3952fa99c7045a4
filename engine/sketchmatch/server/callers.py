"""Who calls: a token or a certificate says it, and strangers are refused unheard."""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable
from contextvars import ContextVar
from typing import Any

import grpc

from sketchmatch.errors import NotAuthenticatedError
from sketchmatch.server.status import refusal
from sketchmatch.server.tokens import Tokens
from sketchmatch.server.watched import Watched

__all__ = ["CallerInterceptor", "caller_of"]

_Context = grpc.aio.ServicerContext[Any, Any]
_HEALTH = "/grpc.health.v1.Health/"
_SCHEME = "bearer "
_LONGEST = 64

# A call is a task of its own, and so is what is set in it.
_named: ContextVar[str] = ContextVar("caller", default="")


class CallerInterceptor(grpc.aio.ServerInterceptor):
    """Lets those in who show a token; health is anybody's, as probes have no token.

    Parameters
    ----------
    tokens
        Those that are known.
    """

    def __init__(self, tokens: Watched[Tokens]) -> None:
        self._tokens = tokens

    async def intercept_service(
        self,
        continuation: Callable[
            [grpc.HandlerCallDetails], Awaitable[grpc.RpcMethodHandler[Any, Any] | None]
        ],
        handler_call_details: grpc.HandlerCallDetails,
    ) -> grpc.RpcMethodHandler[Any, Any] | None:
        """Return the method's handler, or one that refuses before it takes a request."""
        if not handler_call_details.method.startswith(_HEALTH):
            try:
                _named.set(self._caller(handler_call_details))
            except NotAuthenticatedError as error:
                return _refusing(error)
        return await continuation(handler_call_details)

    def knows(self, details: grpc.HandlerCallDetails) -> bool:
        """Whether a call shows a token that is known."""
        try:
            return bool(self._caller(details))
        except NotAuthenticatedError:
            return False

    def _caller(self, details: grpc.HandlerCallDetails) -> str:
        shown = [
            value if isinstance(value, str) else value.decode("latin-1")
            for key, value in details.invocation_metadata or ()
            if key == "authorization"
        ]
        if not shown:
            raise NotAuthenticatedError(
                "this server requires a token, but the call has none; "
                "give the client its token, which it sends as metadata, authorization: Bearer TOKEN"
            )
        if len(shown) > 1 or not shown[0].lower().startswith(_SCHEME):
            raise NotAuthenticatedError(
                "the metadata authorization is not one Bearer TOKEN; send one token in this form"
            )
        name = self._tokens.value.caller_of(shown[0][len(_SCHEME) :].strip())
        if not name:
            raise NotAuthenticatedError(
                "this server does not know the token; ask its operator for another"
            )
        return name


def caller_of(context: _Context) -> str:
    """Return the name of who calls, by token or else by certificate; empty if nobody asked."""
    return _named.get() or _certified(context)


def _certified(context: _Context) -> str:
    shown = context.auth_context()
    for key in ("x509_common_name", "x509_subject_alternative_name"):
        for value in shown.get(key, ()):
            name = bytes(value).decode("utf-8", "replace")
            if name.strip() and name.isprintable():
                return name[:_LONGEST]
    return ""


def _refusing(error: NotAuthenticatedError) -> grpc.RpcMethodHandler[Any, Any]:
    """Return a handler of any method: it is given requests one by one, and takes none."""
    status = refusal(error)

    async def refuse(requests: AsyncIterator[bytes], context: _Context) -> None:
        del requests
        await context.abort(status.code, status.message, status.trailing_metadata)

    return grpc.stream_stream_rpc_method_handler(refuse)
