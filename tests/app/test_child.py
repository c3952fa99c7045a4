"""What a child process tells of errors is read without any class of a plugin's."""

import pickle

import pytest

from sketchmatch.app.child import Failed, _plain
from sketchmatch.errors import (
    AnswerUnavailableError,
    InvalidInputError,
    PluginError,
    Reason,
    SketchmatchError,
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
        (PluginError("it failed"), PluginError),
        (OddError("odd"), PluginError),
    ],
)
def test_errors_are_the_engines_own_when_they_leave_the_process(raised, told):
    plain = _plain(raised)
    assert type(plain) is told
    assert str(plain) == str(raised)
    assert b"tests.app" not in pickle.dumps(Failed(plain))
    assert b"test_child" not in pickle.dumps(Failed(plain))


def test_what_nobody_foresaw_stays_where_it_is():
    assert _plain(ZeroDivisionError("secret")) is None
