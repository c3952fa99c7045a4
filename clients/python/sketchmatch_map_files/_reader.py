"""How a map's YAML is read: by the parser's events, and what is refused on the way."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import yaml

from sketchmatch_map_files import MOST_BYTES, Document, MapFileError

__all__ = ["read_document"]

# libyaml's where PyYAML has it: twenty times as fast.
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
# A map has one list in it; PyYAML alone takes minutes for ten thousand brackets.
_DEEPEST = 20
# A few are harmless; with thirty a line grows to a gigabyte.
_MOST_ALIASES = 10
_NULLS = ("", "~", "null", "Null", "NULL")
_PLAIN_TAGS = [
    f"tag:yaml.org,2002:{name}" for name in ("str", "int", "float", "bool", "null", "seq", "map")
]
_REMEDY = "give the file that map_server saved"

Value = Any
"""A str, None, or a list or dict of them."""


def read_document(text: str) -> Document:
    """Read a YAML text without a byte order mark.

    Raises
    ------
    MapFileError
        As :func:`sketchmatch_map_files.parse` does.
    """
    size = len(text.encode("utf-8", "replace"))
    if size > MOST_BYTES:
        raise MapFileError(
            f"has {size} bytes, more than the limit of {MOST_BYTES // 1024} KiB for a map's YAML; "
            f"{_REMEDY}",
            "LIMIT_EXCEEDED",
        )
    reader = _Reader()
    try:
        values = reader.document(yaml.parse(text, _LOADER))
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f" (line {min(mark.line, text.count(chr(10))) + 1})" if mark else ""
        raise _refused(f"is not YAML{where}; {_REMEDY}") from None
    except MapFileError:
        raise
    except Exception:  # the parser stumbles over some characters
        raise _refused(f"is not YAML; {_REMEDY}") from None
    if not isinstance(values, dict):
        raise _refused(f"is not a list of keys and values; {_REMEDY}")
    return Document(values, reader.repeated)


class _Reader:
    """Makes values of the parser's events, so that the text is gone through once."""

    def __init__(self) -> None:
        self.repeated: dict[str, tuple[Value, ...]] = {}
        self._anchored: dict[str, Value] = {}
        self._aliases = 0

    def document(self, events: Iterator[yaml.Event]) -> Value:
        """Return the first document; None if there is none."""
        for event in events:
            if isinstance(event, yaml.DocumentStartEvent):
                return self._value(next(events), events, 0)
        return None

    def _value(self, event: yaml.Event, events: Iterator[yaml.Event], depth: int) -> Value:
        if isinstance(event, yaml.AliasEvent):
            return self._alias(str(event.anchor))
        assert isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent)
        if depth > _DEEPEST:
            raise _refused(f"has lists nested more than {_DEEPEST} deep; {_REMEDY}")
        if event.tag not in (None, "!", *_PLAIN_TAGS):
            raise _refused("has types written with '!'; give plain values")
        value = self._content(event, events, depth)
        if event.anchor:
            self._anchored[event.anchor] = value
        return value

    def _content(
        self,
        event: yaml.ScalarEvent | yaml.CollectionStartEvent,
        events: Iterator[yaml.Event],
        depth: int,
    ) -> Value:
        if isinstance(event, yaml.ScalarEvent):
            plain = event.implicit[0]
            return None if plain and event.value in _NULLS else event.value
        if isinstance(event, yaml.SequenceStartEvent):
            return self._list(events, depth)
        return self._mapping(events, depth)

    def _alias(self, anchor: str) -> Value:
        self._aliases += 1
        if self._aliases > _MOST_ALIASES:
            raise _refused(f"has more than {_MOST_ALIASES} aliases; write out what they repeat")
        if anchor not in self._anchored:
            raise _refused(f"repeats '*{anchor[:40]}' before that is complete; write it out")
        return self._anchored[anchor]

    def _list(self, events: Iterator[yaml.Event], depth: int) -> list[Value]:
        items = []
        while not isinstance(event := next(events), yaml.SequenceEndEvent):
            items.append(self._value(event, events, depth + 1))
        return items

    def _mapping(self, events: Iterator[yaml.Event], depth: int) -> dict[str, Value]:
        items: dict[str, Value] = {}
        merged: list[Value] = []
        while not isinstance(event := next(events), yaml.MappingEndEvent):
            key = self._value(event, events, depth + 1)
            value = self._value(next(events), events, depth + 1)
            if not isinstance(key, str):
                continue
            if key == "<<":
                merged += value if isinstance(value, list) else [value]
                continue
            if depth == 0 and key in items and items[key] != value:
                self.repeated[key] = (*self.repeated.get(key, ()), value)
            items.setdefault(key, value)
        for other in merged:
            items = {**other, **items} if isinstance(other, dict) else items
        return items


def _refused(problem: str) -> MapFileError:
    return MapFileError(problem, "INVALID_GRID")
