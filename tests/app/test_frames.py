"""What a worker tells of errors is read without any class of a plugin's."""

import pytest

from sketchmatch.app.frames import Frames, Says, failure, failure_of, frame
from sketchmatch.errors import (
    AnswerUnavailableError,
    InvalidInputError,
    NotFoundError,
    PluginError,
    Reason,
    ServerStoppingError,
    SketchmatchError,
    StoreError,
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
