"""Reading values out of JSON, with the path of each in its error."""

from __future__ import annotations

import json
import math
from typing import Any

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model.limits import check_vertices

__all__ = ["load_json", "mapping", "number", "sequence", "shown"]


# Values that a vertex takes at most, with its share of everything around it.
_VALUES = 8


def load_json(text: str) -> Any:
    """Parse JSON of vertices, unless it has more values than the allowed vertices take.

    Raises
    ------
    InvalidInputError
        If it is not JSON, with the line and column, or too large.
    """
    values = text.count(",") + text.count("[") + text.count("{")
    check_vertices(values // _VALUES, "", f"has {values} values")
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        problem = f"is not JSON ({error.msg} in {where}); correct it there"
    except (ValueError, RecursionError):
        problem = "is JSON nested too deeply or with too long a number; save it from the tool again"
    raise InvalidInputError(Reason.INVALID_FILE, "", problem)


def mapping(value: Any, field: str, reason: Reason, expected: str) -> dict[str, Any]:
    """Return a JSON object, or raise with the path ``field`` and what was expected."""
    if not isinstance(value, dict):
        raise InvalidInputError(reason, field, f"is {shown(value)}; give {expected}")
    return value


def sequence(value: Any, field: str, reason: Reason, expected: str) -> list[Any]:
    """Return a JSON array, or raise with the path ``field`` and what was expected."""
    if not isinstance(value, list):
        raise InvalidInputError(reason, field, f"is {shown(value)}; give {expected}")
    return value


def number(value: Any, field: str, reason: Reason) -> float:
    """Return a finite JSON number, or raise with the path ``field``."""
    try:
        result = math.nan if isinstance(value, bool | str) else float(value)
    except (TypeError, OverflowError):
        result = math.nan
    if not math.isfinite(result):
        raise InvalidInputError(reason, field, f"is {shown(value)}; give a finite number")
    return result


def shown(value: Any) -> str:
    """Return a value as an error may quote it: short, and its kind where it is long."""
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    text = "missing" if value is None else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 40 else f"{text[:40]}…"
