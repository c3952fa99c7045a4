"""The errors of calls, each with one sentence for people and a reason for programs."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from typing import Any, TypeVar

import grpc
import grpc.aio
from google.protobuf.message import DecodeError, Message
from google.rpc import error_details_pb2, status_pb2

__all__ = [
    "CallCancelledError",
    "DeadlineExceededError",
    "InvalidRequestError",
    "NotAuthenticatedError",
    "NotFoundError",
    "NotSupportedError",
    "ServerBusyError",
    "ServerFailedError",
    "ServerUnavailableError",
    "SketchmatchError",
    "StoreError",
    "async_translated_errors",
    "refused_as",
    "translated_errors",
]

_Detail = TypeVar("_Detail", bound=Message)


class SketchmatchError(Exception):
    """Base of every error of this package.

    Parameters
    ----------
    message
        One sentence for people.
    reason
        A name of ``sketchmatch.v1.ErrorReason`` without its prefix; empty where none was given.
    """

    def __init__(self, message: str, reason: str = "") -> None:
        super().__init__(message)
        self.reason = reason


class InvalidRequestError(SketchmatchError, ValueError):
    """The request cannot be used as it is; correct it, the same one fails again.

    Parameters
    ----------
    message
        One sentence with the remedy.
    reason
        What kind of fault it is, e.g. ``"INVALID_STROKE"``.
    field
        Path of the field at fault, e.g. ``"sketch.stroke_set.strokes[3]"``; empty for the whole.
    """

    def __init__(self, message: str, reason: str = "", field: str = "") -> None:
        super().__init__(message, reason)
        self.field = field


class _RetryableError(SketchmatchError):
    """The same request may succeed later.

    Parameters
    ----------
    message
        One sentence.
    reason
        Why it does not now.
    retry_after
        Seconds after which to send the same request again, or None if the server gave none.
    """

    def __init__(self, message: str, reason: str = "", retry_after: float | None = None) -> None:
        super().__init__(message, reason)
        self.retry_after = retry_after


class ServerUnavailableError(_RetryableError):
    """No server answers, it is starting or stopping, or it lost the process that answered.

    Wait until it serves, and for ``retry_after`` seconds if given, then send again.
    """


class ServerBusyError(_RetryableError):
    """The server has no room for the request now; send again after ``retry_after`` seconds."""


class DeadlineExceededError(SketchmatchError):
    """The time limit passed before there was an answer; allow more time."""


class NotAuthenticatedError(SketchmatchError):
    """The server does not know the token, or the client does not trust the server's certificate.

    A server that requires a client certificate, or another one, ends the connection without a
    reason: that is a :class:`ServerUnavailableError`.
    """


class NotFoundError(SketchmatchError):
    """The server keeps nothing of this name, or it is another caller's."""


class StoreError(SketchmatchError):
    """The server cannot read or write what it keeps on disk; its operator has to act."""


class NotSupportedError(SketchmatchError):
    """The server does not know the method: it is older than this client, or a different server."""


class CallCancelledError(SketchmatchError):
    """The call was cancelled from elsewhere, or the client is closed."""


class ServerFailedError(SketchmatchError):
    """The server failed; the message states which part of it."""


@contextmanager
def translated_errors(address: str) -> Iterator[None]:
    """Turn gRPC's errors of a server at ``address`` into this package's."""
    try:
        yield
    except grpc.RpcError as error:
        raise _translated(error, address) from error
    except (ValueError, grpc.aio.UsageError) as error:
        if isinstance(error, SketchmatchError) or not _CLOSED.search(str(error)):
            raise
        raise CallCancelledError(_closed(address)) from error


@asynccontextmanager
async def async_translated_errors(address: str) -> AsyncIterator[None]:
    """As :func:`translated_errors`, for calls of ``grpc.aio``."""
    try:
        with translated_errors(address):
            yield
    except asyncio.CancelledError:
        # gRPC may put a cancellation of its own in place of the one that came, and then anyio's
        # scope, which knows its own by their text, lets it out. A scope that is left cancels again
        # at the next step of the loop; here that step is.
        await asyncio.sleep(0)
        raise


@contextmanager
def refused_as(reason: str, field: str, problem: str) -> Iterator[None]:
    """Turn what Python or protobuf say to a value of the wrong form into one clear sentence."""
    try:
        yield
    except (TypeError, ValueError, OverflowError, IndexError) as error:
        raise InvalidRequestError(f"{field} {problem}", reason, field) from error


_OTHERS: dict[grpc.StatusCode, type[SketchmatchError]] = {
    grpc.StatusCode.CANCELLED: CallCancelledError,
    grpc.StatusCode.UNIMPLEMENTED: NotSupportedError,
    grpc.StatusCode.NOT_FOUND: NotFoundError,
    grpc.StatusCode.FAILED_PRECONDITION: StoreError,
    grpc.StatusCode.UNAUTHENTICATED: NotAuthenticatedError,
    grpc.StatusCode.PERMISSION_DENIED: NotAuthenticatedError,
}


# What gRPC says of a channel that was closed: before a call by Python's errors, in one by a status.
_CLOSED = re.compile(r"channel (is )?closed|closed channel", re.IGNORECASE)


def _closed(address: str) -> str:
    return f"the client of the server at {address} is closed; open a new one"


def _translated(error: grpc.RpcError, address: str) -> SketchmatchError:
    code = error.code()
    details = _details(error)
    message = error.details() or f"the server at {address} reports {code.name}"
    if code is grpc.StatusCode.CANCELLED and _CLOSED.search(message):
        message = _closed(address)
    reason = _reason(details)
    match code:
        case grpc.StatusCode.INVALID_ARGUMENT:
            return InvalidRequestError(message, reason, _field(details))
        case grpc.StatusCode.RESOURCE_EXHAUSTED if not reason and "larger than max" in message:
            problem = f"the request is larger than the server at {address} accepts; make it smaller"
            return InvalidRequestError(problem, "MESSAGE_TOO_LARGE")
        case grpc.StatusCode.RESOURCE_EXHAUSTED:
            return ServerBusyError(message, reason, _retry_after(details))
        case grpc.StatusCode.UNAVAILABLE:
            told = ServerUnavailableError(message, reason, _retry_after(details))
            return told if reason else _unavailable(message, address)
        case grpc.StatusCode.DEADLINE_EXCEEDED:
            late = f"the server at {address} did not answer within the timeout; allow more time"
            return DeadlineExceededError(message if reason else late, reason)
    return _OTHERS.get(code, ServerFailedError)(message, reason)


# What gRPC says of a link that did not come about; it has no status for that.
_UNTRUSTED = re.compile(
    r"CERTIFICATE_VERIFY_FAILED:? ?(?P<why>[^:]*)"
    r"|Hostname Verification Check|Peer name .* is not in peer"
)
_REMEDIES = {
    "WRONG_VERSION_NUMBER": "it does not use encryption: leave out certificates and tls",
    "Socket closed": "it closed the connection: it is stopping, or requires encryption or a "
    "certificate of the client that it trusts; start it, or give root_certificates, certificate "
    "and key",
    "http1.x server": "it speaks HTTP/1.1, as the port for browsers does; "
    "give the address for gRPC",
}
# What it says, in words of older and newer versions, where it cannot use a key or a certificate.
_UNUSABLE = ("empty address list", "create security handshaker")


def _unavailable(message: str, address: str) -> SketchmatchError:
    if untrusted := _UNTRUSTED.search(message):
        why = "it is for another name"
        if untrusted["why"] is not None:  # of older versions of gRPC, empty
            unknown = "it is of no authority that the client trusts, or it has expired"
            why = untrusted["why"].strip() or unknown
        return NotAuthenticatedError(
            f"the certificate of the server at {address} cannot be trusted ({why}); give the "
            "root_certificates of its authority and a server_name that it is for, or renew it"
        )
    if any(sign in message for sign in _UNUSABLE):
        return InvalidRequestError(
            f"the certificates for the server at {address} cannot be used; give certificate and "
            "the key that belongs to it, without a passphrase, and root_certificates, all in PEM",
            "INVALID_FIELD",
        )
    signs = (remedy for sign, remedy in _REMEDIES.items() if sign in message)
    remedy = next(signs, "start it, or check the address")
    problem = f"the sketchmatch server at {address} is not available"
    return ServerUnavailableError(f"{problem}; {remedy} ({message})")


def _details(error: grpc.RpcError) -> status_pb2.Status:
    """Return the status in the trailer, empty if there is none or it cannot be read."""
    trailer: Any = error.trailing_metadata() or ()
    # Pairs; dict alone would ask for keys, which grpc.aio of grpcio 1.62 gets wrong.
    packed = dict(iter(trailer)).get("grpc-status-details-bin", b"")
    try:
        return status_pb2.Status.FromString(packed)
    except DecodeError:
        return status_pb2.Status()


def _detail(details: status_pb2.Status, kind: type[_Detail]) -> _Detail:
    """Return the detail of a kind, or an empty one."""
    detail = kind()
    for packed in details.details:
        if packed.Unpack(detail):
            break
    return detail


def _reason(details: status_pb2.Status) -> str:
    return str(_detail(details, error_details_pb2.ErrorInfo).reason)


def _field(details: status_pb2.Status) -> str:
    violations = _detail(details, error_details_pb2.BadRequest).field_violations
    return str(violations[0].field) if violations else ""


def _retry_after(details: status_pb2.Status) -> float | None:
    retry = _detail(details, error_details_pb2.RetryInfo)
    if not retry.HasField("retry_delay"):
        return None
    return float(retry.retry_delay.ToTimedelta().total_seconds())
