"""Errors as gRPC statuses: a code, one sentence, and details for programs."""

from __future__ import annotations

from dataclasses import dataclass

import grpc
from google.protobuf import any_pb2, duration_pb2
from google.rpc import code_pb2, error_details_pb2, status_pb2

from sketchmatch.errors import (
    AnswerUnavailableError,
    InvalidInputError,
    MatchCancelledError,
    MatchInterruptedError,
    NotAuthenticatedError,
    NotFoundError,
    PluginError,
    QuotaError,
    Reason,
    RetryableError,
    ServerStoppingError,
    SketchmatchError,
    StoreError,
    TooBusyError,
    WorkerLostError,
)

__all__ = ["Refusal", "is_fault", "refusal"]

_DOMAIN = "sketchmatch"
# All of a refusal travels in trailers, for which gRPC has 8 KiB.
_LONGEST = 500


_CODES: dict[type[SketchmatchError], grpc.StatusCode] = {
    TooBusyError: grpc.StatusCode.RESOURCE_EXHAUSTED,
    ServerStoppingError: grpc.StatusCode.UNAVAILABLE,
    WorkerLostError: grpc.StatusCode.UNAVAILABLE,
    MatchInterruptedError: grpc.StatusCode.UNAVAILABLE,
    MatchCancelledError: grpc.StatusCode.CANCELLED,
    AnswerUnavailableError: grpc.StatusCode.DEADLINE_EXCEEDED,
    NotAuthenticatedError: grpc.StatusCode.UNAUTHENTICATED,
    NotFoundError: grpc.StatusCode.NOT_FOUND,
    StoreError: grpc.StatusCode.FAILED_PRECONDITION,
    QuotaError: grpc.StatusCode.RESOURCE_EXHAUSTED,
    PluginError: grpc.StatusCode.INTERNAL,
}


@dataclass(frozen=True)
class Refusal:
    """What a call is aborted with."""

    code: grpc.StatusCode
    message: str
    trailing_metadata: tuple[tuple[str, bytes], ...] = ()


def refusal(error: BaseException) -> Refusal:
    """Return the status for an error; one that nobody foresaw says no more than that."""
    match error:
        case InvalidInputError():
            violation = error_details_pb2.BadRequest.FieldViolation(
                field=_cut(error.field), description=_cut(error.problem)
            )
            detail = error_details_pb2.BadRequest(field_violations=[violation])
            return _refusal(grpc.StatusCode.INVALID_ARGUMENT, error, error.reason, detail)
        case RetryableError():
            delay = duration_pb2.Duration(seconds=error.retry_seconds)
            retry = error_details_pb2.RetryInfo(retry_delay=delay)
            return _refusal(_CODES[type(error)], error, error.reason, retry)
        case (
            AnswerUnavailableError()
            | NotAuthenticatedError()
            | NotFoundError()
            | StoreError()
            | QuotaError()
            | PluginError()
            | MatchCancelledError()
        ):
            return _refusal(_CODES[type(error)], error, error.reason)
    return Refusal(
        grpc.StatusCode.INTERNAL,
        "the server failed with an unexpected error; its log has the details, please report them",
    )


def is_fault(error: BaseException) -> bool:
    """Whether an error is the server's or a plugin's, so that its operator should hear of it."""
    return isinstance(error, PluginError) or not isinstance(error, SketchmatchError)


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"


def _refusal(
    code: grpc.StatusCode, error: BaseException, reason: Reason, *details: object
) -> Refusal:
    message = _cut(str(error))
    info = error_details_pb2.ErrorInfo(reason=reason.value, domain=_DOMAIN)
    status = status_pb2.Status(code=code_pb2.Code.Value(code.name), message=message)
    for detail in (info, *details):
        packed = any_pb2.Any()
        packed.Pack(detail)
        status.details.append(packed)
    return Refusal(code, message, (("grpc-status-details-bin", status.SerializeToString()),))
