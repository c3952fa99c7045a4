"""What every call shares: how its request is opened, and what becomes of an error."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterable, AsyncIterator, Awaitable, Callable
from functools import partial
from typing import Any, NoReturn

import grpc

from sketchmatch.app.faults import told
from sketchmatch.app.packed import Packed
from sketchmatch.errors import InvalidInputError
from sketchmatch.server.calls import note, noted
from sketchmatch.server.status import is_fault, refusal
from sketchmatch.server.wrapping import WrappingInterceptor, kind_of

__all__ = ["ErrorInterceptor", "OpeningInterceptor"]

_OURS = "/sketchmatch."
_SHORT_BYTES = 65_536
_DRAWN_BYTES = 1 << 20
"""What is drawn at once may be a whole drawing, which somebody pasted."""
_LONGER = {"/sketchmatch.v1.SketchService/UpdateSketch": _DRAWN_BYTES}
_log = logging.getLogger(__name__)
_Context = grpc.aio.ServicerContext[Any, Any]


class ErrorInterceptor(WrappingInterceptor):
    """Ends a call whose method raises with the status of the error."""

    def wrapped(self, handler: Any, path: str) -> Any:
        """Return the method's handler, with its errors caught."""
        # Health and reflection see to themselves.
        if not path.startswith(_OURS):
            return handler
        kind = kind_of(handler)
        return handler._replace(**{kind: _caught(getattr(handler, kind))})


class OpeningInterceptor(WrappingInterceptor):
    """Inflates and decodes requests, but those that methods want as they come.

    gRPC itself would inflate them before anybody knows of the call, and say of what it cannot
    decode that nobody knows what happened. What is opened here is short, and opened for anybody.
    """

    def wrapped(self, handler: Any, path: str) -> Any:
        """Return the method's handler, with its requests opened by us."""
        kind = kind_of(handler)
        if handler.request_deserializer is None:
            if handler.request_streaming:
                return handler
            return handler._replace(
                request_deserializer=_Parcel, **{kind: _handing_over(getattr(handler, kind))}
            )
        read = partial(Packed, read=handler.request_deserializer)
        opening = _opening_each if handler.request_streaming else _opening
        method = opening(getattr(handler, kind), _LONGER.get(path, _SHORT_BYTES))
        return handler._replace(request_deserializer=read, **{kind: method})


class _Parcel:
    """A request that goes on as it came; who has handed it on does not have it any more.

    gRPC keeps what a call was aborted with in a cycle, and by its traceback all who handed the
    request on: the memory of large ones would be free only when the garbage collector comes round.
    """

    def __init__(self, data: bytes) -> None:
        self._data = data

    def taken(self) -> bytes:
        """Return the request, once."""
        data, self._data = self._data, b""
        return data


def _handing_over(method: Callable[[Any, _Context], Awaitable[Any]]) -> Any:
    async def call(parcel: _Parcel, context: _Context) -> Any:
        return await method(parcel.taken(), context)

    return call


def _opening(method: Callable[[Any, _Context], Awaitable[Any]], most: int) -> Any:
    async def call(packed: Packed, context: _Context) -> Any:
        return await method(await _opened(packed, context, most), context)

    return call


def _opening_each(method: Callable[[Any, _Context], AsyncIterable[Any]], most: int) -> Any:
    """Return the same for a stream of requests that is answered by a stream."""

    async def call(requests: AsyncIterable[Packed], context: _Context) -> AsyncIterator[Any]:
        opened = (await _opened(packed, context, most) async for packed in requests)
        async for response in method(opened, context):
            yield response

    return call


async def _opened(packed: Packed, context: _Context, most: int) -> Any:
    try:
        return packed.opened(most)
    except InvalidInputError as error:
        await _abort(context, error)


def _caught(method: Callable[[Any, _Context], Awaitable[Any]]) -> Any:
    async def call(request: Any, context: _Context) -> Any:
        try:
            return await method(request, context)
        except grpc.aio.InternalError:
            # Nobody is left to write to. To end as if all were well would be to write.
            raise asyncio.CancelledError from None
        except Exception as error:
            del request  # as a parcel is emptied
            await _abort(context, error)

    return call


async def _abort(context: _Context, error: Exception) -> NoReturn:
    if is_fault(error):
        _log.error("%s: %s", noted(), told(error))
    status = refusal(error)
    note(reason=getattr(error, "reason", type(error).__name__))
    error.__traceback__ = None
    await context.abort(status.code, status.message, status.trailing_metadata)
