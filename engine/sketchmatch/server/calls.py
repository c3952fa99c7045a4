"""One line in the log for each call: which, whose, how it ended and what it was about."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable
from contextvars import ContextVar
from typing import Any
from urllib.parse import unquote

import grpc

from sketchmatch.server.wrapping import WrappingInterceptor, kind_of, status_of

__all__ = ["CallLogInterceptor", "facts", "note", "noted"]

_OURS = "/sketchmatch."
_log = logging.getLogger(__name__)
_facts: ContextVar[dict[str, object]] = ContextVar("facts")
_Context = grpc.aio.ServicerContext[Any, Any]


def note(**facts: object) -> None:
    """Have something told in the line of the call under way."""
    _facts.get({}).update(facts)


def facts() -> dict[str, object]:
    """Return what is known of the call under way so far."""
    return dict(_facts.get({}))


def noted() -> str:
    """Return the same as a log tells it."""
    return " ".join(f"{name}={value}" for name, value in facts().items())


class CallLogInterceptor(WrappingInterceptor):
    """Writes the lines; health and reflection, which others poll, have none."""

    def wrapped(self, handler: Any, path: str) -> Any:
        """Return the method's handler, with its calls told of."""
        if not path.startswith(_OURS):
            return handler
        kind = kind_of(handler)
        return handler._replace(**{kind: _told(getattr(handler, kind), path.rpartition("/")[2])})


def _told(method: Callable[[Any, _Context], Awaitable[Any]], name: str) -> Any:
    async def call(request: Any, context: _Context) -> Any:
        began, cancelled = time.monotonic(), False
        _facts.set({"caller": unquote(context.peer())})
        try:
            return await method(request, context)
        except asyncio.CancelledError:
            cancelled = True
            raise
        finally:
            given = status_of(context) or grpc.StatusCode.OK
            code = "CANCELLED" if cancelled else given.name
            seconds = time.monotonic() - began
            _log.info("%s code=%s seconds=%.3f %s", name, code, seconds, noted())

    return call
