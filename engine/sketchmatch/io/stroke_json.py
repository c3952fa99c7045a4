"""Pen strokes as JSON, as sketch pads save them.

::

    {
      "y_axis": "down",
      "strokes": [
        {"label": "desk", "points": [[120, 80], [121.5, 84], [123, 90]]},
        {"points": [[10, 10, 0.0], [12, 15, 0.016]]}
      ]
    }

A point is ``[x, y]`` or ``[x, y, seconds]``, the same throughout a stroke; seconds that are null
throughout are none. ``y_axis`` says which way y grows, ``"up"`` where it is left out; a screen's is
``"down"``. A label is a name for people. Other keys are ignored, but not another spelling of
``y_axis``: without it the sketch would be its own mirror image.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sketchmatch.api.documents import load_json, mapping, number, plain_name, sequence, shown
from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.model import FloatArray, Stroke, StrokeSet

__all__ = ["decode_strokes", "strokes_of"]

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
    return strokes_of(load_json(text))


def strokes_of(document: Any) -> StrokeSet:
    """Return the strokes of a parsed document, as :func:`decode_strokes` does."""
    document = mapping(document, "", _STROKE, 'an object with "strokes"')
    upward = _upward(document)
    strokes = sequence(document.get("strokes"), "strokes", _STROKE, "a list of strokes")
    return StrokeSet(
        tuple(_stroke(stroke, f"strokes[{k}]", upward) for k, stroke in enumerate(strokes))
    )


def _upward(document: dict[str, Any]) -> float:
    for key in document:
        if key != "y_axis" and _letters(key) == "yaxis":
            raise InvalidInputError(
                _STROKE, quoted(key), 'is not a key that is read; write "y_axis", or leave it out'
            )
    value = document.get("y_axis", "up")
    if not isinstance(value, str) or value not in _UPWARDS:
        raise InvalidInputError(_STROKE, "y_axis", f'is {shown(value)}; give "up" or "down"')
    return _UPWARDS[value]


def _letters(key: str) -> str:
    return "".join(c for c in key.casefold() if c.isalpha())


def _stroke(value: Any, field: str, upward: float) -> Stroke:
    stroke = mapping(value, field, _STROKE, 'an object with "points"')
    label = stroke.get("label")
    if isinstance(label, dict | list):
        raise InvalidInputError(_STROKE, f"{field}.label", f"is {shown(label)}; give a name")
    points = sequence(stroke.get("points"), f"{field}.points", _STROKE, "a list of [x, y] pairs")
    samples = _samples(points, f"{field}.points")
    times = samples[:, 2] if samples.shape[1] == 3 else None
    return Stroke(samples[:, :2] * (1.0, upward), times, plain_name(label))


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
                "has a time although others have none, or none although others have one; give a "
                "time for every point of a stroke or for none",
            )
    if width == 3 and all(point[2] is None for point in points):
        points, width = [point[:2] for point in points], 2
    rows = [
        [number(value, f"{field}[{k}][{i}]", _STROKE) for i, value in enumerate(point)]
        for k, point in enumerate(points)
    ]
    return np.array(rows, dtype=np.float64).reshape(-1, width)
