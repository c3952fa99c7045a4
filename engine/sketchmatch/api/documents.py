"""Reading values out of JSON and XML, with the path of each in its error."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NoReturn
from xml.etree import ElementTree
from xml.parsers import expat

from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.model.limits import check_vertices

__all__ = [
    "check_values",
    "decode_text",
    "listed",
    "load_json",
    "load_xml",
    "mapping",
    "no_parts",
    "number",
    "plain_name",
    "sequence",
    "shown",
]

# Values that a vertex takes at most, with its share of everything around it.
_VALUES = 8
# An element of XML takes the memory of so many.
_VALUES_OF_ELEMENT = 4
_DEEPEST = 200
_LONGEST_CAUSE = 100
_LISTED = 6
# Characters of an entity, and of all that stands in the place of entities.
_LONGEST_WORD, _MOST_REPLACED = 1000, 8 << 20


def decode_text(data: bytes) -> str:
    """Return the text of a file in UTF-8, with or without a byte order mark.

    Raises
    ------
    InvalidInputError
        If it is not.
    """
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InvalidInputError(
            Reason.INVALID_FILE, "", "is not UTF-8 text; save it as UTF-8"
        ) from None


def load_json(text: str) -> Any:
    """Parse JSON of vertices, unless it has more values than the allowed vertices take.

    Raises
    ------
    InvalidInputError
        If it is not JSON, with the line and column, or too large.
    """
    check_values(text)
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        problem = f"is not JSON ({error.msg} in {where}); correct it there"
    except (ValueError, RecursionError):
        problem = "is JSON that is nested too deeply or has too long a number; save it again"
    raise InvalidInputError(Reason.INVALID_FILE, "", problem)


def check_values(text: str) -> None:
    """Refuse JSON that has more values than the allowed vertices take, before it is parsed.

    Raises
    ------
    InvalidInputError
        If it has.
    """
    values = text.count(",") + text.count("[") + text.count("{")
    check_vertices(values // _VALUES, "", f"has {values} values")


def load_xml(
    data: bytes, kind: str = "XML", watch: Callable[[Mapping[str, str], int], None] | None = None
) -> ElementTree.Element:
    """Parse XML of no more elements and numbers than are allowed, and no entities but short words.

    Illustrator names its namespaces by entities. Those that stand for other elements or entities,
    or for files, are none that a drawing needs, and how documents are made to explode.

    Parameters
    ----------
    data
        The document, in any encoding that it declares.
    kind
        What errors call it.
    watch
        Called with the attributes and the line of each element before any tree is built, in the
        order in which the elements begin; it raises what refuses the document. Left out, elements
        and numbers are counted.

    Raises
    ------
    InvalidInputError
        If it is not XML, defines anything but short words, is nested too deeply or too large.
    """
    depth, see = 0, watch or _counting()
    references = data.count(b"&")

    def entity(_name: str, parameter: bool, value: str | None, *_where: str | None) -> None:
        if parameter or value is None or len(value) > _LONGEST_WORD or set("&<%") & set(value):
            defined()
        if references * len(value) > _MOST_REPLACED:
            raise _refused(
                f"uses its entities too often, {references} times; save it as plain {kind}"
            )

    def defined(*_declaration: object) -> NoReturn:
        raise _refused(
            "defines entities other than short words, or a DTD of its own; "
            f"save it as plain {kind} without them"
        )

    def start(_name: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        see(attributes, parser.CurrentLineNumber)
        if depth > _DEEPEST:
            raise _refused(f"is nested deeper than the limit of {_DEEPEST}; flatten it")

    def end(_name: str) -> None:
        nonlocal depth
        depth -= 1

    parser = expat.ParserCreate()
    parser.EntityDeclHandler = entity
    parser.AttlistDeclHandler = parser.ElementDeclHandler = parser.NotationDeclHandler = defined
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    try:
        parser.Parse(data, True)
        return ElementTree.fromstring(data)
    except InvalidInputError:
        raise
    except (expat.ExpatError, ElementTree.ParseError, LookupError, ValueError) as error:
        cause = str(error)[:_LONGEST_CAUSE]
        raise _refused(f"is not {kind} ({cause}); save it as {kind} again") from None


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


def plain_name(value: Any) -> str:
    """Return a JSON value as a name for people: text, numbers and truths; nothing of the rest.

    Examples
    --------
    >>> [plain_name(value) for value in ("desk", 0, True, None, [])]
    ['desk', '0', 'true', '', '']
    """
    if isinstance(value, str):
        return value
    return json.dumps(value) if isinstance(value, bool | int | float) else ""


def shown(value: Any) -> str:
    """Return a value as an error may quote it: short, and its kind where it is long."""
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if value is None:
        return "missing"
    text = json.dumps(value, ensure_ascii=False).encode("utf-8", "backslashreplace").decode()
    return text if len(text) <= 40 else f"{text[:40]}…"


def listed(names: Iterable[str]) -> str:
    """Return names as an error may list them: short, and not all of many.

    Examples
    --------
    >>> listed(["b", "a"])
    "'b', 'a'"
    """
    shortened = [quoted(name) for name in names]
    more = f" and {len(shortened) - _LISTED} more" if len(shortened) > _LISTED else ""
    return ", ".join(shortened[:_LISTED]) + more


def no_parts(part: str) -> None:
    """Refuse to choose a part of a kind of file that has none.

    Raises
    ------
    InvalidInputError
        If one is named.
    """
    if part:
        raise _refused(
            f"has no parts of which {quoted(part)} could be one; leave out '#' and what follows"
        )


def _counting() -> Callable[[Mapping[str, str], int], None]:
    """Return what refuses XML that has more values than the allowed vertices take."""
    values = 0

    def count(attributes: Mapping[str, str], _line: int) -> None:
        nonlocal values
        values += _VALUES_OF_ELEMENT + sum(1 + text.count(",") for text in attributes.values())
        check_vertices(values // _VALUES, "", f"has {values} values")

    return count


def _refused(problem: str) -> InvalidInputError:
    return InvalidInputError(Reason.INVALID_FILE, "", problem)
