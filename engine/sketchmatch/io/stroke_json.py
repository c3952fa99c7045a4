"""Pen strokes as JSON, as sketch pads save them.

::

    {
      "y_axis": "down",
      "strokes": [
        {"label": "desk", "points": [[120, 80], [121.5, 84], [123, 90]]},
        {"points": [[10, 10, 0.0], [12, 15, 0.016]]}
      ]
    }

A point is ``[x, y]`` or ``[x, y, seconds]``, the same throughout a stroke. ``y_axis`` says which
way y grows, ``"up"`` where it is left out; a screen's is ``"down"``. A label is a name for people.
Other keys are ignored.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io._fields import load_json, mapping, number, sequence, shown
from sketchmatch.model import FloatArray, Stroke, StrokeSet

__all__ = ["decode_strokes"]

_STROKE = Reason.INVALID_STROKE
_UPWARDS = {"up": 1.0, "down": -1.0}


def decode_strokes(text: str) -> StrokeSet:
    """Decode strokes from JSON; y is turned up.

    Raises
    ------
    InvalidInputError
        With a path such as ``strokes[3].points[7][0]``, if the text is not as described above.

    Examples
    --------
    >>> sketch = decode_strokes('{"y_axis": "down", "strokes": [{"points": [[1, 2], [3, 5]]}]}')
    >>> sketch.strokes[0].points.tolist()
    [[1.0, -2.0], [3.0, -5.0]]
    """
    document = mapping(load_json(text), "", _STROKE, 'an object with "strokes"')
    upward = _upward(document.get("y_axis", "up"))
    strokes = sequence(document.get("strokes"), "strokes", _STROKE, "a list of strokes")
    return StrokeSet(
        tuple(_stroke(stroke, f"strokes[{k}]", upward) for k, stroke in enumerate(strokes))
    )


def _upward(value: Any) -> float:
    if not isinstance(value, str) or value not in _UPWARDS:
        raise InvalidInputError(_STROKE, "y_axis", f'is {shown(value)}; give "up" or "down"')
    return _UPWARDS[value]


def _stroke(value: Any, field: str, upward: float) -> Stroke:
    stroke = mapping(value, field, _STROKE, 'an object with "points"')
    label = stroke.get("label") or ""
    if not isinstance(label, str):
        raise InvalidInputError(_STROKE, f"{field}.label", f"is {shown(label)}; give a name")
    points = sequence(stroke.get("points"), f"{field}.points", _STROKE, "a list of [x, y] pairs")
    samples = _samples(points, f"{field}.points")
    times = samples[:, 2] if samples.shape[1] == 3 else None
    return Stroke(samples[:, :2] * (1.0, upward), times, label)


def _samples(points: list[Any], field: str) -> FloatArray:
    """Return points and, if they have them, times: shape (k, 2) or (k, 3)."""
    width = len(points[0]) if points and isinstance(points[0], list) else 2
    for k, point in enumerate(points):
        if not isinstance(point, list) or len(point) not in (2, 3):
            raise InvalidInputError(
                _STROKE, f"{field}[{k}]", f"is {shown(point)}; give [x, y] or [x, y, seconds]"
            )
        if len(point) != width:
            raise InvalidInputError(
                _STROKE,
                f"{field}[{k}]",
                "has a time where others have none, or none where others have one; give a time "
                "for every point of a stroke or for none",
            )
    rows = [
        [number(value, f"{field}[{k}][{i}]", _STROKE) for i, value in enumerate(point)]
        for k, point in enumerate(points)
    ]
    return np.array(rows, dtype=np.float64).reshape(-1, width)
