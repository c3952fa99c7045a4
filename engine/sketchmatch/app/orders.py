"""Requests as the bytes that they come as, and what can be told of them before they are decoded."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

from google.protobuf.message import DecodeError, Message

from sketchmatch.app.jobs import Job
from sketchmatch.app.packed import Packed, inflated, is_compressed
from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch_proto.v1 import match_service_pb2, source_pb2
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest
from sketchmatch_proto.v1.scene_service_pb2 import PutSceneRequest, SegmentRequest
from sketchmatch_proto.v1.sketch_service_pb2 import CreateSketchRequest
from sketchmatch_proto.v1.transfer_service_pb2 import TransferRequest

__all__ = ["Order", "Wish", "varint"]

_Request: TypeAlias = (
    type[MatchRequest]
    | type[SegmentRequest]
    | type[PutSceneRequest]
    | type[CreateSketchRequest]
    | type[TransferRequest]
)
_KINDS: tuple[_Request, ...] = (
    MatchRequest,
    SegmentRequest,
    PutSceneRequest,
    CreateSketchRequest,
    TransferRequest,
)
_TYPES = {kind.DESCRIPTOR.name: kind for kind in _KINDS}
_MATCH = MatchRequest.DESCRIPTOR
_SOURCE = source_pb2.Source.DESCRIPTOR
_FILE = _SOURCE.fields_by_name["file"].number
_VARINT, _FIXED64, _MESSAGE, _FIXED32 = 0, 1, 2, 5
_FIXED = {_FIXED64: 8, _FIXED32: 4}
_LONGEST_NAME = 128


@dataclass(frozen=True)
class Wish:
    """What a request to match says of the match's own life.

    Attributes
    ----------
    request_id
        The caller's own name for it; empty for none.
    digest
        What tells the request from another of the same name; empty where it has none.
    keep_running
        Whether it goes on when nobody reads it.
    priority
        Which of the caller's requests come first: above 0 before, below after the others.
    """

    request_id: str = ""
    digest: bytes = b""
    keep_running: bool = False
    priority: int = 0


@dataclass(frozen=True)
class Order:
    """A request that was admitted, or is to be.

    Attributes
    ----------
    id
        A name that no other order of the application has.
    kind
        Name of the message: MatchRequest, SegmentRequest, PutSceneRequest, CreateSketchRequest or
        TransferRequest.
    data
        The message, perhaps compressed.
    caller
        Who asks, by name of token or certificate, or empty: whose stored scenes it may name.
    brought
        Stored scenes that come with the request, as messages ``StoredScene``: these are not looked
        for.
    former
        What was found in the sketch before it was changed, as messages ``SketchObjects`` and
        ``MatchResult``, for a quick answer.
    inner
        Whether it is done for something else, so that nobody knows it as a match.
    """

    id: str
    kind: str
    data: bytes
    caller: str = ""
    brought: tuple[bytes, ...] = ()
    former: tuple[bytes, bytes] | None = None
    inner: bool = False

    @property
    def is_match(self) -> bool:
        """Whether it is a match that somebody asked for."""
        return self.kind == MatchRequest.DESCRIPTOR.name and not self.inner

    @property
    def size(self) -> int:
        """Bytes that it takes while it waits, with what comes with it."""
        return len(self.data) + sum(map(len, (*self.brought, *(self.former or ()))))

    @property
    def is_large(self) -> bool:
        """Whether it takes longer than a moment to look through it."""
        return is_compressed(self.data) or len(self.data) > _LARGE_BYTES

    def job(self, limit: int) -> Job:
        """Inflate and decode the request.

        Parameters
        ----------
        limit
            Bytes that it may have.

        Raises
        ------
        InvalidInputError
            If it is not what it should be.
        """
        request = Packed(self.data, _TYPES[self.kind].FromString).opened(limit)
        return Job(self.id, request, self.caller, self.brought, self.former)

    def outline(self, limit: int) -> Job:
        """Decode the request but for sketch and map, of which only files are kept.

        It takes no longer for large requests, unless they are compressed. What cannot be decoded is
        as good as empty; that is told where the job is done.

        Raises
        ------
        InvalidInputError
            If it has more bytes than the limit.
        """
        request = _TYPES[self.kind]()
        try:
            request.ParseFromString(_outline(inflated(self.data, limit), request))
        except (DecodeError, IndexError, KeyError):
            request.Clear()
        return Job(self.id, request)

    def wish(self, limit: int) -> Wish:
        """Return what the request says of the life of its match.

        Raises
        ------
        InvalidInputError
            If it has more bytes than the limit, or a name that is of no use.
        """
        request = self.outline(limit).request
        if not isinstance(request, MatchRequest):
            return Wish()
        name = request.request_id
        if len(name.encode()) > _LONGEST_NAME:
            problem = f"is {quoted(name)}; give a name of at most {_LONGEST_NAME} bytes"
            raise InvalidInputError(Reason.INVALID_FIELD, "request_id", problem)
        digest = _digest(inflated(self.data, limit), request) if name else b""
        return Wish(name, digest, request.keep_running, _PRIORITIES.get(request.priority, 0))


_LARGE_BYTES = 1 << 18
_PRIORITIES: dict[int, int] = {
    match_service_pb2.PRIORITY_LOW: -1,
    match_service_pb2.PRIORITY_HIGH: 1,
}


def _digest(data: bytes, outline: Message) -> bytes:
    """Return a digest that is the same however the maps of a message are ordered."""
    digest = hashlib.blake2b(outline.SerializeToString(deterministic=True), digest_size=16)
    sources = _SOURCES[outline.DESCRIPTOR.full_name]
    for number, _, first, _, end in _fields(data, 0, len(data)):
        if number in sources:
            digest.update(memoryview(data)[first:end])
    return digest.digest()


_SOURCES = {
    kind.DESCRIPTOR.full_name: frozenset(
        field.number for field in kind.DESCRIPTOR.fields if field.message_type is _SOURCE
    )
    for kind in _TYPES.values()
}
"""The numbers of the fields that are sources."""


def _outline(data: bytes, request: Message) -> bytes:
    fields = request.DESCRIPTOR.fields_by_number
    kept = bytearray()
    for number, wire_type, first, payload, end in _fields(data, 0, len(data)):
        kind = fields[number].message_type if number in fields else None
        if kind in (_SOURCE, _MATCH) and wire_type == _MESSAGE:
            if kind is _SOURCE:
                inner = _source_outline(data, payload, end)
            else:
                inner = _outline(data[payload:end], MatchRequest())
            kept += bytes([number << 3 | _MESSAGE]) + varint(len(inner)) + inner
        else:
            kept += data[first:end]
    return bytes(kept)


def _source_outline(data: bytes, first: int, end: int) -> bytes:
    """Return a source with nothing in it, unless it is a file: that is known by its content."""
    kept = bytearray()
    for number, wire_type, begin, _, last in _fields(data, first, end):
        if wire_type == _MESSAGE and number != _FILE:
            kept += varint(number << 3 | _MESSAGE) + b"\0"
        else:
            kept += data[begin:last]
    return bytes(kept)


def _fields(data: bytes, place: int, end: int) -> Iterator[tuple[int, int, int, int, int]]:
    """Yield number, wire type, and where each field of a message, its payload and its end are."""
    while place < end:
        first = place
        tag, place = _varint(data, place)
        wire_type, payload = tag & 7, place
        if wire_type == _VARINT:
            _, place = _varint(data, place)
        elif wire_type == _MESSAGE:
            length, payload = _varint(data, place)
            place = payload + length
        else:
            place += _FIXED[wire_type]
        if place > end:
            raise IndexError
        yield tag >> 3, wire_type, first, payload, place


def _varint(data: bytes, place: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[place]
        place += 1
        value |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            return value, place


def varint(value: int) -> bytes:
    """Return a number as messages have it."""
    packed = bytearray()
    while value >= 0x80:
        packed.append(value & 0x7F | 0x80)
        value >>= 7
    packed.append(value)
    return bytes(packed)
