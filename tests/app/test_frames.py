"""What a worker tells of errors is read without any class of a plugin's."""

import pytest

from sketchmatch.app.frames import Frames, Says, failure, failure_of, frame
from sketchmatch.errors import (
    AnswerUnavailableError,
    InvalidInputError,
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


class Words(str):
    """A string of a plugin's own."""


class PickyError(InvalidInputError):
    """An error of a plugin's own."""


class LateError(AnswerUnavailableError):
    """Another."""


class OddError(SketchmatchError):
    """And one of no kind that the engine has."""


@pytest.mark.parametrize(
    ("raised", "told"),
    [
        (PickyError(Reason.INVALID_GRID, Words("cells"), Words("is empty")), InvalidInputError),
        (LateError("no time"), AnswerUnavailableError),
        (ServerStoppingError("it stops"), ServerStoppingError),
        (ServerStoppingError("it stops", 5), ServerStoppingError),
        (TooBusyError("it is full", 17), TooBusyError),
        (WorkerLostError("it died", 2), WorkerLostError),
        (MatchInterruptedError("it ended", 3), MatchInterruptedError),
        (NotFoundError("there is none"), NotFoundError),
        (StoreError("it is full"), StoreError),
        (PluginError("it failed"), PluginError),
        (OddError("odd"), PluginError),
    ],
)
def test_errors_are_the_engines_own_when_they_leave_the_process(raised, told):
    plain, log = failure_of(failure(raised, "where it was"))
    assert type(plain) is told
    assert str(plain) == str(raised)
    assert log == "where it was"
    if told is InvalidInputError:
        assert (plain.reason, plain.field) == (Reason.INVALID_GRID, "cells")
    if isinstance(raised, RetryableError):
        assert plain.retry_seconds == raised.retry_seconds


def test_what_a_former_version_kept_of_an_error_is_read():
    error, _ = failure_of(b'{"log": "", "kind": "interrupted", "problem": "it ended"}')
    assert (type(error), error.retry_seconds) == (MatchInterruptedError, 1)


def test_what_nobody_foresaw_stays_where_it_is():
    assert failure_of(failure(ZeroDivisionError("secret"), "log")) == (None, "log")


@pytest.mark.parametrize("size", [1, 2, 7, 1000])
def test_frames_are_whole_however_they_arrive(size):
    sent = [(Says.READY, b""), (Says.ANSWER | 3, b"abc"), (Says.FAILED, bytes(300))]
    stream = b"".join(frame(kind, content) for kind, content in sent)
    frames, got = Frames(), []
    for first in range(0, len(stream), size):
        got += frames.cut(stream[first : first + size])
    assert got == sent
