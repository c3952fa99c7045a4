"""What a change of a sketch in progress may say, before it is sent."""

import pytest

from sketchmatch_client import InvalidRequestError
from sketchmatch_client._sketch import update_request

TABLE = [(10, 10), (60, 12), (58, 40), (11, 41), (10, 11)]


def update(strokes, labels=None):
    return update_request("sketch", strokes, (), None, labels or {}, None)


def test_strokes_are_sent_with_their_labels():
    (sent,) = update({"s1": TABLE}, {"s1": "table"}).set_strokes
    assert (sent.stroke_id, sent.stroke.label, len(sent.stroke.points)) == ("s1", "table", 5)


@pytest.mark.parametrize(
    ("strokes", "labels", "field", "remedy"),
    [
        ([TABLE], None, "strokes", "give a dict"),
        ({"s1": TABLE}, ["table"], "labels", "give a dict"),
        ({"s1": TABLE}, {"s2": "table"}, "labels", "send its points"),
        ({}, {"s1": "table"}, "labels", "send its points"),
    ],
)
def test_what_would_change_nothing_is_refused(strokes, labels, field, remedy):
    with pytest.raises(InvalidRequestError, match=remedy) as refused:
        update(strokes, labels)
    assert refused.value.field == field
