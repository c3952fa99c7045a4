"""Values that a parameter must refuse, and the outermost it must take, by its JSON Schema."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

__all__ = ["bad_values", "bound_values", "fields_of"]

_Schema = Mapping[str, Any]
_WRONG: tuple[tuple[str, Any], ...] = (
    ("string", "no such value"),
    ("array", [1, 2]),
    ("object", {"a": 1}),
    ("null", None),
)


def fields_of(schema: _Schema) -> dict[str, list[_Schema]]:
    """Return for each parameter the schemas of the values that it takes."""
    return {
        name: list(_options(field, schema)) for name, field in schema.get("properties", {}).items()
    }


def bad_values(options: list[_Schema]) -> Iterator[Any]:
    """Yield values that none of the options takes.

    Examples
    --------
    >>> list(bad_values([{"type": "integer", "minimum": 2}, {"type": "null"}]))
    ['no such value', [1, 2], {'a': 1}, 1.5, nan, inf, -inf, 1]
    """
    free = [option for option in options if not _choices(option)]
    taken = {option.get("type") for option in free}
    if None in taken:
        return  # an option that says nothing of its type takes anything
    yield from (value for kind, value in _WRONG if kind not in taken)
    if "number" not in taken:
        yield 1.5
    if taken & {"number", "integer"}:
        yield from (math.nan, math.inf, -math.inf)
    numbers = [option for option in free if option["type"] in ("number", "integer")]
    if len(numbers) == 1:
        yield from _beyond(numbers[0])


def bound_values(options: list[_Schema]) -> Iterator[Any]:
    """Yield the outermost values that the options take.

    Examples
    --------
    >>> list(bound_values([{"type": "integer", "minimum": 2, "maximum": 9}]))
    [2, 9]
    >>> list(bound_values([{"enum": ["auto", "keep"], "type": "string"}]))
    ['auto', 'keep']
    """
    for option in options:
        yield from _choices(option)
        step = option.get("multipleOf")
        for bound in ("minimum", "maximum"):
            if bound in option and not (step and option[bound] % step):
                yield option[bound]
        if option.get("type") == "boolean":
            yield from (False, True)
        if option.get("type") == "null":
            yield None


def _options(field: _Schema, schema: _Schema) -> Iterator[_Schema]:
    if "$ref" in field:
        field = schema["$defs"][field["$ref"].rsplit("/", 1)[-1]]
    if "anyOf" in field:
        for option in field["anyOf"]:
            yield from _options(option, schema)
    else:
        yield field


def _choices(option: _Schema) -> list[Any]:
    return [option["const"]] if "const" in option else list(option.get("enum", ()))


def _beyond(option: _Schema) -> Iterator[float]:
    """Yield numbers just outside the bounds of an option."""
    whole = option.get("type") == "integer"
    step = option.get("multipleOf")
    if "minimum" in option:
        least = option["minimum"]
        yield least - (step or 1) if whole else math.nextafter(least, -math.inf)
    if "maximum" in option:
        most = option["maximum"]
        yield most + (step or 1) if whole else math.nextafter(most, math.inf)
    for bound in ("exclusiveMinimum", "exclusiveMaximum"):
        if bound in option:
            yield option[bound]
    if step:
        inside = option.get("minimum", option.get("exclusiveMinimum", 0))
        yield (inside // step + 1) * step + (1 if whole else step / 2)
