"""Calls that come another way than over gRPC: the same handlers answer, interceptors and all."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncGenerator, Sequence
from contextlib import aclosing, suppress
from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace
from typing import Any

import grpc

from sketchmatch.server.callers import CallerInterceptor
from sketchmatch.server.wrapping import kind_of

__all__ = ["Call", "CallRefused", "Handlers"]


class CallRefused(BaseException):
    """A call ends with a status; no Exception, so that nobody takes it for a fault.

    Attributes
    ----------
    code, message, trailer
        What the call was aborted with.
    """

    def __init__(
        self, code: grpc.StatusCode, message: str, trailer: Sequence[tuple[str, bytes]]
    ) -> None:
        super().__init__(message)
        self.code, self.message, self.trailer = code, message, tuple(trailer)


@dataclass(frozen=True)
class Handlers:
    """Answers calls as a gRPC server does.

    Attributes
    ----------
    services
        What answers, as gRPC servers are given it.
    interceptors
        What stands before it, the outermost first.
    """

    services: Sequence[grpc.GenericRpcHandler]
    interceptors: Sequence[grpc.aio.ServerInterceptor]

    async def responses(self, call: Call, request: bytes) -> AsyncGenerator[bytes, None]:
        """Yield what a call is answered with, encoded; the call ends when nobody asks on.

        Raises
        ------
        CallRefused
            If the call is aborted.
        """
        # A task of its own, as in gRPC: what interceptors set in it holds for this call.
        answering = asyncio.create_task(self._answer(call, request))
        answering.add_done_callback(lambda _: call.written.put_nowait(None))
        try:
            while (response := await call.written.get()) is not None:
                yield response
                call.written.task_done()
            answering.result()
        finally:
            if not answering.done():
                answering.cancel()
                with suppress(asyncio.CancelledError, CallRefused):
                    await answering

    async def refuse_stranger(self, call: Call) -> None:
        """Refuse a call of nobody who is known, before its request is received.

        Raises
        ------
        CallRefused
            If it is one.
        """
        asking = [each for each in self.interceptors if isinstance(each, CallerInterceptor)]
        if not all(each.knows(call.details) for each in asking):
            # Refused as all are, so that it is counted and told of.
            async with aclosing(self.responses(call, b"")) as responses:
                async for _ in responses:
                    break

    async def _answer(self, call: Call, request: bytes) -> None:
        find = self._find
        for interceptor in reversed(self.interceptors):
            find = partial(interceptor.intercept_service, find)
        handler: Any = await find(call.details)
        if handler is None:
            raise CallRefused(grpc.StatusCode.UNIMPLEMENTED, f"there is no method {call.path}", ())
        read, encode = handler.request_deserializer, handler.response_serializer
        kind = kind_of(handler)
        response = await getattr(handler, kind)(read(request) if read else request, call)
        if kind == "unary_unary":
            call.written.put_nowait(encode(response) if encode else response)

    async def _find(self, details: Any) -> Any:
        found = (service.service(details) for service in self.services)
        return next((handler for handler in found if handler is not None), None)


class Call:
    """One call, as far as our handlers and interceptors look at what gRPC tells them of theirs.

    Parameters
    ----------
    path
        ``/SERVICE/METHOD``.
    peer
        Where it comes from, as gRPC writes it.
    metadata
        What came with it, names in lower case.
    seconds
        How long the caller waits; None for as long as it takes.
    """

    def __init__(
        self, path: str, peer: str, metadata: Sequence[tuple[str, str]], seconds: float | None
    ) -> None:
        self.path, self._peer = path, peer
        self.details: Any = SimpleNamespace(method=path, invocation_metadata=tuple(metadata))
        self.written: asyncio.Queue[bytes | None] = asyncio.Queue()
        self._ends = None if seconds is None else time.monotonic() + seconds
        self._code = grpc.StatusCode.OK
        self._trailer: tuple[tuple[str, bytes], ...] = ()

    async def write(self, response: bytes) -> None:
        """Hand over a response; it returns when the next one is asked for."""
        self.written.put_nowait(response)
        await self.written.join()

    async def abort(
        self,
        code: grpc.StatusCode,
        details: str = "",
        trailing_metadata: Sequence[tuple[str, bytes]] = (),
    ) -> None:
        """End the call with a status."""
        self._code, self._trailer = code, tuple(trailing_metadata)
        raise CallRefused(code, details, trailing_metadata)

    def peer(self) -> str:
        """Return where the call comes from."""
        return self._peer

    def invocation_metadata(self) -> tuple[tuple[str, str], ...]:
        """Return what came with the call."""
        return tuple(self.details.invocation_metadata)

    def auth_context(self) -> dict[str, list[bytes]]:
        """Return nothing: certificates of clients are checked, and name nobody here."""
        return {}

    def code(self) -> grpc.StatusCode:
        """Return the status of the call so far."""
        return self._code

    def trailing_metadata(self) -> tuple[tuple[str, bytes], ...]:
        """Return what goes with the status."""
        return self._trailer

    def time_remaining(self) -> float | None:
        """Return the seconds that the caller still waits; None for as long as it takes."""
        return None if self._ends is None else max(0.0, self._ends - time.monotonic())
