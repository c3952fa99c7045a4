"""Pen strokes as JSON."""

import json

import pytest

from sketchmatch.errors import InvalidInputError
from sketchmatch.io import read_source
from sketchmatch.io.stroke_json import decode_strokes
from sketchmatch.model import StrokeSet


def decode(strokes, **others):
    return decode_strokes(json.dumps({"strokes": strokes, **others}))


def test_y_grows_upwards_unless_the_file_says_otherwise():
    points = [[1, 2], [3, 5]]
    assert decode([{"points": points}]).strokes[0].points.tolist() == points
    up = decode([{"points": points}], y_axis="up")
    assert up.strokes[0].points.tolist() == points
    down = decode([{"points": points}], y_axis="down")
    assert down.strokes[0].points.tolist() == [[1, -2], [3, -5]]


def test_labels_and_times_are_kept():
    sketch = decode(
        [{"points": [[0, 0, 1.5], [1, 0, 1.75]], "label": "desk", "pressure": 3}, {"points": []}]
    )
    assert sketch.strokes[0].label == "desk"
    assert sketch.strokes[0].times.tolist() == [1.5, 1.75]
    assert sketch.strokes[1].times is None
    assert sketch.strokes[1].points.shape == (0, 2)


def test_numbers_and_truths_are_labels_too():
    found = decode([{"points": [], "label": label} for label in (0, True, None, "", "desk")])
    assert [stroke.label for stroke in found.strokes] == ["0", "true", "", "", "desk"]


def test_times_that_are_null_throughout_are_none():
    (stroke,) = decode([{"points": [[0, 0, None], [1, 2, None]]}]).strokes
    assert stroke.times is None
    assert stroke.points.tolist() == [[0, 0], [1, 2]]


WRONG = {
    '{"strokes": [{"points": [[0, 0], [1, NaN]]}]}': (
        "strokes[0].points[1][1]",
        "is NaN; give a finite number",
    ),
    '{"strokes": [{"points": [[0, 0], [1, 1e999]]}]}': (
        "strokes[0].points[1][1]",
        "is Infinity; give a finite number",
    ),
    '{"strokes": [{"points": [[0, 0], ["1", 2]]}]}': (
        "strokes[0].points[1][0]",
        'is "1"; give a finite number',
    ),
    '{"strokes": [{"points": [[0, 0], [1, true]]}]}': (
        "strokes[0].points[1][1]",
        "is true; give a finite number",
    ),
    '{"strokes": [{"points": [[0, 0], [1]]}]}': (
        "strokes[0].points[1]",
        "is a list of 1; give [x, y] or [x, y, seconds]",
    ),
    '{"strokes": [{"points": [[0, 0], [1, 2, 3]]}]}': (
        "strokes[0].points[1]",
        "give a time for every point of a stroke or for none",
    ),
    '{"strokes": [{"points": [0, 1]}]}': ("strokes[0].points[0]", "is 0; give [x, y]"),
    '{"strokes": [[[0, 0], [1, 1]]]}': ("strokes[0]", 'give an object with "points"'),
    '{"strokes": [{}]}': ("strokes[0].points", "is missing; give a list of [x, y] pairs"),
    '{"strokes": [{"points": [], "label": []}]}': ("strokes[0].label", "a list of 0; give a name"),
    '{"strokes": [], "yAxis": "down"}': ("'yAxis'", 'is not a key that is read; write "y_axis"'),
    '{"strokes": [], "Y-axis": "up"}': ("'Y-axis'", 'is not a key that is read; write "y_axis"'),
    '{"strokes": [{"points": [[0, 0, 1], [1, 1, null]]}]}': (
        "strokes[0].points[1][2]",
        "is missing; give a finite number",
    ),
    '{"strokes": {}}': ("strokes", "is an object; give a list of strokes"),
    '{"lines": []}': ("strokes", "is missing; give a list of strokes"),
    '{"strokes": [], "y_axis": "left"}': ("y_axis", 'is "left"; give "up" or "down"'),
    "[]": ("", 'is a list of 0; give an object with "strokes"'),
    '{"strokes": [': ("", "is not JSON (Expecting value in line 1, column 14)"),
    "[" * 100_000: ("", "is JSON that is nested too deeply"),
    '{"strokes": ' + "9" * 5000 + "}": ("", "too long a number"),
}


@pytest.mark.parametrize("text", WRONG, ids=lambda text: text[:48])
def test_a_fault_is_named_with_its_path_and_the_remedy(text):
    field, words = WRONG[text]
    with pytest.raises(InvalidInputError) as caught:
        decode_strokes(text)
    assert caught.value.field == field
    assert words in caught.value.problem
    assert "; " in caught.value.problem


def test_a_file_may_begin_with_a_byte_order_mark(tmp_path):
    path = tmp_path / "sketch.json"
    path.write_bytes(
        b"\xef\xbb\xbf" + b'{"strokes": [{"points": [[0, 0], [1, 1]], "label": "T\xc3\xbcr"}]}'
    )
    source = read_source(path)
    assert isinstance(source, StrokeSet)
    assert source.strokes[0].label == "Tür"


def test_a_file_in_another_encoding_is_refused(tmp_path):
    path = tmp_path / "sketch.json"
    path.write_bytes('{"strokes": []}'.encode("utf-16"))
    with pytest.raises(InvalidInputError, match="is not UTF-8 text; save it as UTF-8") as caught:
        read_source(path)
    assert caught.value.field == str(path)
