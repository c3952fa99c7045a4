"""What a server and its workers say to each other, as bytes on a socket."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping
from enum import IntEnum, unique

from sketchmatch.errors import (
    AnswerUnavailableError,
    InvalidInputError,
    MatchCancelledError,
    MatchInterruptedError,
    NotFoundError,
    PluginError,
    Reason,
    RetryableError,
    ServerStoppingError,
    SketchmatchError,
    StoreError,
    TooBusyError,
    WorkerLostError,
)

__all__ = ["Flag", "Frames", "Says", "failure", "failure_of", "frame"]

_HEAD = struct.Struct("!IB")


@unique
class Says(IntEnum):
    """What a frame is; the low bits of an answer are flags."""

    SETUP = 1
    """To a worker: what requests are answered with from now on."""
    ORDER = 2
    """To a worker: a request."""
    WARM = 3
    """To a worker: compile what requests may ask for."""
    STOP = 4
    """To a worker: nobody wants what it does."""
    CURTAIL = 5
    """To a worker: come to an end with the best so far."""
    READY = 6
    """The plugins are loaded, and so are the kernels of the default pipeline."""
    COMPILING = 7
    """A kernel is not in the cache: a sign of life."""
    ENDED = 8
    """The work is done, or was stopped."""
    FAILED = 9
    """The work ended with an error."""
    DESCRIBED = 10
    """Histograms of a scene that is kept, to be kept beside it."""
    LEFT = 11
    """Threads that the work has left behind, by name: before the end of it."""
    ANSWER = 16
    """A response."""


class Flag(IntEnum):
    """What is to be known of a response without decoding it."""

    NEWS = 1
    """The next one makes it worthless."""
    EARLY = 2
    """It comes before the time budget begins."""


class Frames:
    """Cuts what arrives into frames."""

    def __init__(self) -> None:
        self._held = bytearray()

    def cut(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        """Yield kind and content of each frame that is complete with this data."""
        self._held += data
        place = 0
        while len(self._held) - place >= _HEAD.size:
            length, kind = _HEAD.unpack_from(self._held, place)
            end = place + _HEAD.size + length
            if len(self._held) < end:
                break
            yield kind, bytes(self._held[place + _HEAD.size : end])
            place = end
        del self._held[:place]


def frame(kind: int, content: bytes = b"") -> bytes:
    """Return a frame."""
    return _HEAD.pack(len(content), kind) + content


_SENTENCES: dict[str, type[SketchmatchError]] = {
    "unavailable": AnswerUnavailableError,
    "not found": NotFoundError,
    "store": StoreError,
    "cancelled": MatchCancelledError,
}
"""Errors that are a sentence and nothing else."""
_RETRYABLE: dict[str, type[RetryableError]] = {
    "stopping": ServerStoppingError,
    "busy": TooBusyError,
    "lost": WorkerLostError,
    "interrupted": MatchInterruptedError,
}
"""Errors that are a sentence and a time after which to ask again."""


def failure(error: Exception, log: str) -> bytes:
    """Return what is told of an error: nothing that needs a plugin's own classes to be read."""
    told: dict[str, object] = {"log": log}

    def kind_of(known: Mapping[str, type[SketchmatchError]], otherwise: str) -> str:
        return next((kind for kind, each in known.items() if isinstance(error, each)), otherwise)

    match error:
        case InvalidInputError():
            told |= {"kind": "input", "reason": str(Reason(error.reason))}
            told |= {"field": f"{error.field}", "problem": f"{error.problem}"}
        case RetryableError():
            told |= {"kind": kind_of(_RETRYABLE, "interrupted"), "problem": f"{error.problem}"}
            told["retry"] = int(error.retry_seconds)
        case SketchmatchError():
            told |= {"kind": kind_of(_SENTENCES, "plugin"), "problem": f"{error}"}
    return json.dumps(told).encode()


def failure_of(content: bytes) -> tuple[SketchmatchError | None, str]:
    """Return an error that was told, or None for one that nobody foresaw, and where it happened."""
    told = json.loads(content)
    match told:
        case {"kind": "input", "reason": reason, "field": field, "problem": problem}:
            return InvalidInputError(Reason(reason), field, problem), told["log"]
        case {"kind": str(kind), "problem": problem} if kind in _RETRYABLE:
            # What a former version kept has no time.
            return _RETRYABLE[kind](problem, told.get("retry", 1)), told["log"]
        case {"kind": str(kind), "problem": problem}:
            return _SENTENCES.get(kind, PluginError)(problem), told["log"]
    return None, told["log"]
