"""Connect, gRPC-Web and plain JSON over HTTP, for what cannot speak gRPC, such as browsers."""

from __future__ import annotations

import asyncio
import zlib
from collections.abc import AsyncGenerator, Awaitable, Callable, Iterable, Mapping
from contextlib import aclosing
from dataclasses import dataclass
from typing import Any, NoReturn

import grpc
from connectrpc.code import Code
from connectrpc.codec import Codec
from connectrpc.compression import Compression
from connectrpc.compression.gzip import GzipCompression
from connectrpc.errors import ConnectError, ErrorDetail
from connectrpc.interceptor import MetadataInterceptor
from connectrpc.method import IdempotencyLevel, MethodInfo, StreamType
from connectrpc.request import RequestContext
from connectrpc.server import ConnectASGIApplication, Endpoint
from google.protobuf import descriptor_pool, json_format, message_factory
from google.protobuf.message import Message
from google.rpc import status_pb2
from protobuf.wkt import Any as PackedDetail

from sketchmatch.app.packed import inflated
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.server.called import Call, CallRefused, Handlers
from sketchmatch.server.status import refusal

__all__ = ["connect_application"]

_JSON = "json"
_Context = RequestContext[Any, Any]
_Application = Callable[[Any, Any, Any], Awaitable[None]]
_CODES: dict[grpc.StatusCode, Code] = {
    code: Code(code.value[1].replace(" ", "_").replace("cancelled", "canceled"))
    for code in grpc.StatusCode
    if code is not grpc.StatusCode.OK
}


@dataclass(frozen=True)
class _Encoded:
    """A message as it came or goes: nobody has looked into it."""

    data: bytes
    form: str = "proto"
    kind: type[Message] | None = None


class _Unopened(Codec[_Encoded, _Encoded]):
    """Leaves requests as they are for those who open them: they know how large one may be."""

    def __init__(self, form: str) -> None:
        self._form = form

    def name(self) -> str:
        return self._form

    def encode(self, message: _Encoded) -> bytes:
        if self._form != _JSON or message.kind is None:
            return message.data
        opened = message.kind.FromString(message.data)
        return json_format.MessageToJson(opened, indent=None).encode()

    def decode(self, data: bytes | bytearray, message_class: Any) -> _Encoded:
        del message_class
        return _Encoded(bytes(data), self._form)


class _Uninflated(GzipCompression):
    """Leaves what was compressed so until there is a place for the request."""

    def decompress(
        self, data: bytes | bytearray | memoryview, read_max_bytes: int | None = None
    ) -> bytes:
        del read_max_bytes
        return bytes(data)


class _AskingFirst(MetadataInterceptor[None]):
    """Refuses strangers before their requests are received."""

    def __init__(self, handlers: Handlers) -> None:
        self._handlers = handlers

    async def on_start(self, ctx: _Context) -> None:
        method = ctx.method
        call = _call(f"/{method.service_name}/{method.name}", ctx)
        try:
            await self._handlers.refuse_stranger(call)
        except CallRefused as refused:
            _raise(refused.code, refused.message, refused.trailer)


class _Connect(ConnectASGIApplication[None]):
    @property
    def path(self) -> str:
        return ""


def connect_application(
    services: Iterable[str], handlers: Handlers, transport_bytes: int, limit: Callable[[], int]
) -> _Application:
    """Return an ASGI application that answers the calls of services.

    Parameters
    ----------
    services
        Their full names.
    handlers
        What answers.
    transport_bytes
        Size above which the transport itself refuses a message.
    limit
        Returns how large a request may be now, inflated.
    """
    pool = descriptor_pool.Default()
    endpoints: dict[str, Any] = {}
    for service in services:
        for method in pool.FindServiceByName(service).methods:
            path = f"/{service}/{method.name}"
            answers = _Answers(path, method, handlers, limit)
            if not method.client_streaming:
                endpoints[path] = answers.endpoint(method.name, service)
    compressions: list[Compression] = [_Uninflated()]

    def found(_: None) -> Mapping[str, Any]:
        return endpoints

    return _Connect(
        service=None,
        endpoints=found,
        interceptors=[_AskingFirst(handlers)],
        read_max_bytes=transport_bytes,
        compressions=compressions,
        codecs=[_Unopened("proto"), _Unopened(_JSON)],
    )


class _Answers:
    """Answers the calls of one method."""

    def __init__(
        self, path: str, method: Any, handlers: Handlers, limit: Callable[[], int]
    ) -> None:
        self._path, self._handlers, self._limit = path, handlers, limit
        self._asked: type[Message] = message_factory.GetMessageClass(method.input_type)
        self._told: type[Message] = message_factory.GetMessageClass(method.output_type)
        self._streams = method.server_streaming

    def endpoint(self, name: str, service: str) -> Endpoint[Any, Any]:
        info = MethodInfo(
            name=name,
            service_name=service,
            input=_Encoded,
            output=_Encoded,
            idempotency_level=IdempotencyLevel.UNKNOWN,
            stream_type=StreamType.SERVER_STREAM if self._streams else StreamType.UNARY,
        )
        if self._streams:
            return Endpoint.server_stream(info, self._stream)
        return Endpoint.unary(info, self._one)

    async def _one(self, request: _Encoded, context: _Context) -> _Encoded:
        async with aclosing(self._stream(request, context)) as responses:
            async for response in responses:
                return response
        # Nobody waits for an answer to a request that was stopped.
        return _Encoded(b"", kind=self._told)

    async def _stream(self, request: _Encoded, context: _Context) -> AsyncGenerator[_Encoded, None]:
        call = _call(self._path, context)
        try:
            data = await self._opened(request)
            async with aclosing(self._handlers.responses(call, data)) as responses:
                async for response in responses:
                    yield _Encoded(response, kind=self._told)
        except CallRefused as refused:
            _raise(refused.code, refused.message, refused.trailer)
        except InvalidInputError as error:
            status = refusal(error)
            _raise(status.code, status.message, status.trailing_metadata)

    async def _opened(self, request: _Encoded) -> bytes:
        """Return the encoded message; JSON is read in a thread, for it may be long."""
        if request.form != _JSON:
            return request.data
        return await asyncio.to_thread(_from_json, request.data, self._asked, self._limit())


def _from_json(data: bytes, kind: type[Message], limit: int) -> bytes:
    try:
        text = inflated(data, limit)
        return json_format.Parse(text, kind()).SerializeToString()
    except (json_format.ParseError, UnicodeDecodeError, RecursionError, zlib.error) as error:
        problem = f"the request is not a {kind.DESCRIPTOR.name} in JSON: {_line(error)}"
        raise InvalidInputError(Reason.INVALID_FIELD, "", problem) from None


def _line(error: Exception) -> str:
    return " ".join(str(error).split())


def _raise(code: grpc.StatusCode, message: str, trailer: Iterable[tuple[str, bytes]]) -> NoReturn:
    packed = dict(trailer).get("grpc-status-details-bin", b"")
    details = [
        ErrorDetail(PackedDetail(type_url=detail.type_url, value=detail.value))
        for detail in status_pb2.Status.FromString(packed).details
    ]
    raise ConnectError(_CODES[code], message, details)


def _call(path: str, context: _Context) -> Call:
    return Call(path, _peer(context), _metadata(context), _seconds(context))


def _peer(context: _Context) -> str:
    """Return where a call comes from, as gRPC writes it."""
    host, _, port = (context.client_address or "unknown:0").rpartition(":")
    return f"ipv6:[{host}]:{port}" if ":" in host else f"ipv4:{host}:{port}"


def _metadata(context: _Context) -> list[tuple[str, str]]:
    return [(key.lower(), value) for key, value in context.request_headers.allitems()]


def _seconds(context: _Context) -> float | None:
    left = context.timeout_ms
    return None if left is None else left / 1000.0
