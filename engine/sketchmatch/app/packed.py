"""Requests as they come over a wire: perhaps compressed, and not decoded yet."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass

from google.protobuf.message import DecodeError, Message

from sketchmatch.app.unknown import read_whole
from sketchmatch.errors import InvalidInputError, Reason

__all__ = ["Packed", "check_size", "inflated", "is_compressed"]

# How gzip and zlib begin. No message of ours does: their first byte would be a field's number and
# kind, 3 with a kind that there is not, or 15 as a number, which no request has.
_COMPRESSED = (b"\x1f\x8b", b"\x78\x01", b"\x78\x5e", b"\x78\x9c", b"\x78\xda")
_ANY_HEADER = zlib.MAX_WBITS | 32


@dataclass(frozen=True)
class Packed:
    """A request of which nothing is known but how long it is.

    Attributes
    ----------
    data
        What came.
    read
        Decodes it.
    """

    data: bytes
    read: Callable[[bytes], Message]

    def opened(self, limit: int) -> Message:
        """Return the message.

        Parameters
        ----------
        limit
            Bytes that it may have, before and after it is inflated; no more are spent on it.

        Raises
        ------
        InvalidInputError
            If it is larger, no such message, or one with fields that the contract does not know.
        """
        try:
            return read_whole(self.read, inflated(self.data, limit))
        except DecodeError:
            raise InvalidInputError(
                Reason.INVALID_FIELD,
                "",
                "the request cannot be decoded; send the message that the contract has for this "
                "call, encoded by code that was generated from the .proto files",
            ) from None


def check_size(size: int, limit: int) -> None:
    """Refuse a request of more bytes than the limit."""
    if size > limit:
        raise InvalidInputError(
            Reason.MESSAGE_TOO_LARGE,
            "",
            f"the request has {size} bytes, more than the limit of {limit}; "
            "send fewer points or a smaller picture",
        )


def is_compressed(data: bytes) -> bool:
    """Whether a request begins as what was compressed does."""
    return data.startswith(_COMPRESSED)


def inflated(data: bytes, limit: int) -> bytes:
    """Return what came as it was before it was compressed, if it was.

    Raises
    ------
    InvalidInputError
        If it has more bytes than the limit, before or after; no more are spent on it.
    """
    check_size(len(data), limit)
    if not is_compressed(data):
        return data
    stream = zlib.decompressobj(_ANY_HEADER)
    try:
        whole = stream.decompress(data, limit + 1)
    except zlib.error:
        return data  # which is no message, as the caller will be told
    if len(whole) > limit:
        raise InvalidInputError(
            Reason.MESSAGE_TOO_LARGE,
            "",
            f"the request has more than the limit of {limit} bytes when decompressed; "
            "send fewer points or a smaller picture",
        )
    return whole if stream.eof and not stream.unused_data else data
