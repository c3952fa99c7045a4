"""Errors that a caller can cause, each with one clear sentence.

Every error that a caller can cause carries a machine-readable reason, the path of the field at
fault and a sentence with the remedy. The command line prints the sentence and exits with 2; the
server sends the same as a gRPC status with ``ErrorInfo`` and ``BadRequest``.
"""

from __future__ import annotations

import re
import reprlib
from enum import StrEnum
from typing import Any, Self

__all__ = [
    "AnswerUnavailableError",
    "InvalidInputError",
    "MatchCancelledError",
    "MatchInterruptedError",
    "NotAuthenticatedError",
    "NotFoundError",
    "PluginError",
    "QuotaError",
    "Reason",
    "RetryableError",
    "ServerStoppingError",
    "SketchmatchError",
    "StoreError",
    "TooBusyError",
    "WorkerLostError",
    "counted",
    "quoted",
]

_LONGEST_QUOTE = 60

# Plain repr would take hours for lists that repeat each other, and refuses long numbers.
_QUOTING = reprlib.Repr()
_QUOTING.maxstring = _QUOTING.maxother = _QUOTING.maxlong = 100_000
_QUOTING.maxlevel = 3


def quoted(value: object) -> str:
    """Return a caller's value as a sentence may quote it: cut short where it is long.

    Examples
    --------
    >>> quoted("office"), quoted("x" * 1000) == "'" + 59 * "x" + "…"
    ("'office'", True)
    """
    try:
        text = _QUOTING.repr(value)
    except ValueError:
        text = "a number of thousands of digits"
    text = re.sub(r"\n\s*", " ", text)  # of an array
    return text if len(text) <= _LONGEST_QUOTE else f"{text[:_LONGEST_QUOTE]}…"


def counted(number: int, noun: str, several: str = "") -> str:
    """Return a number of things as a sentence has it.

    Examples
    --------
    >>> counted(1, "object"), counted(0, "object"), counted(2, "sketch", "sketches")
    ('1 object', '0 objects', '2 sketches')
    """
    return f"{number} {noun if number == 1 else several or f'{noun}s'}"


class Reason(StrEnum):
    """Machine-readable reasons; the same names as ``sketchmatch.v1.ErrorReason``."""

    MISSING_FIELD = "MISSING_FIELD"
    INVALID_FIELD = "INVALID_FIELD"
    INVALID_POLYGON = "INVALID_POLYGON"
    INVALID_STROKE = "INVALID_STROKE"
    INVALID_GRID = "INVALID_GRID"
    INVALID_IMAGE = "INVALID_IMAGE"
    INVALID_FILE = "INVALID_FILE"
    TOO_FEW_OBJECTS = "TOO_FEW_OBJECTS"
    UNKNOWN_ALGORITHM = "UNKNOWN_ALGORITHM"
    WRONG_ALGORITHM = "WRONG_ALGORITHM"
    INVALID_PARAMETER = "INVALID_PARAMETER"
    MESSAGE_TOO_LARGE = "MESSAGE_TOO_LARGE"
    LIMIT_EXCEEDED = "LIMIT_EXCEEDED"
    TIME_BUDGET_EXHAUSTED = "TIME_BUDGET_EXHAUSTED"
    PLUGIN_FAILED = "PLUGIN_FAILED"
    INFINITE_FORCE = "INFINITE_FORCE"
    UNKNOWN_PROFILE = "UNKNOWN_PROFILE"
    SERVER_STOPPING = "SERVER_STOPPING"
    WORKER_LOST = "WORKER_LOST"
    NOT_AUTHENTICATED = "NOT_AUTHENTICATED"
    NOT_FOUND = "NOT_FOUND"
    STORE_UNAVAILABLE = "STORE_UNAVAILABLE"
    MATCH_CANCELLED = "MATCH_CANCELLED"
    MATCH_INTERRUPTED = "MATCH_INTERRUPTED"


class SketchmatchError(Exception):
    """Base of every error that sketchmatch raises on purpose."""


class InvalidInputError(SketchmatchError, ValueError):
    """The caller's input cannot be used as it is.

    Parameters
    ----------
    reason
        What kind of fault it is.
    field
        Path of the field at fault, e.g. ``"sketch.stroke_set.strokes[3]"``; empty for the whole.
    problem
        What is wrong with it and the remedy, without a final full stop and without the field's
        name: it is read after the path.

    Examples
    --------
    >>> str(InvalidInputError(Reason.INVALID_STROKE, "strokes[3]", "is missing; give a stroke"))
    'strokes[3] is missing; give a stroke'
    """

    def __init__(self, reason: Reason, field: str, problem: str) -> None:
        super().__init__(f"{field} {problem}" if field else problem)
        self.reason = reason
        self.field = field
        self.problem = problem

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.reason, self.field, self.problem)

    def within(self, parent: str) -> Self:
        """Return the same error with its path seen from ``parent``.

        Examples
        --------
        >>> str(InvalidInputError(Reason.INVALID_GRID, "resolution", "is 0").within("map"))
        'map.resolution is 0'
        """
        joint = "." if parent and self.field and not self.field.startswith("[") else ""
        return type(self)(self.reason, f"{parent}{joint}{self.field}", self.problem)


class AnswerUnavailableError(SketchmatchError):
    """The time budget ended before there was any answer to give."""

    reason = Reason.TIME_BUDGET_EXHAUSTED


class NotAuthenticatedError(SketchmatchError):
    """The caller does not show who it is; the sentence never quotes what it shows instead."""

    reason = Reason.NOT_AUTHENTICATED


class NotFoundError(SketchmatchError):
    """The server keeps nothing of this name, or it is another caller's."""

    reason = Reason.NOT_FOUND


class StoreError(SketchmatchError):
    """What the server keeps on disk cannot be read or written."""

    reason = Reason.STORE_UNAVAILABLE


class QuotaError(SketchmatchError):
    """The caller would keep more than it may; it has to delete something first."""

    reason = Reason.LIMIT_EXCEEDED


class PluginError(SketchmatchError):
    """A plugin broke its contract or raised; the sentence names plugin and distribution."""

    reason = Reason.PLUGIN_FAILED


class RetryableError(SketchmatchError):
    """The same request may succeed later.

    Parameters
    ----------
    problem
        What is wrong now.
    retry_seconds
        When to ask again.
    """

    reason: Reason

    def __init__(self, problem: str, retry_seconds: int = 1) -> None:
        super().__init__(f"{problem}; send the request again in {retry_seconds} s")
        self.problem = problem
        self.retry_seconds = retry_seconds

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.problem, self.retry_seconds)


class MatchCancelledError(SketchmatchError):
    """The match was cancelled by its caller."""

    reason = Reason.MATCH_CANCELLED


class TooBusyError(RetryableError):
    """There is no room for one more request now."""

    reason = Reason.LIMIT_EXCEEDED


class ServerStoppingError(RetryableError):
    """The server is about to stop."""

    reason = Reason.SERVER_STOPPING


class WorkerLostError(RetryableError):
    """The process that answered the request has ended, through no fault of the request."""

    reason = Reason.WORKER_LOST


class MatchInterruptedError(RetryableError):
    """The match ended before its time, through no fault of the request."""

    reason = Reason.MATCH_INTERRUPTED
