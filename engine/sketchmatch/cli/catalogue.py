"""What the catalogue says of an algorithm, taken apart for people to read."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from google.protobuf.json_format import MessageToDict

from sketchmatch_proto.v1.catalog_service_pb2 import (
    Algorithm,
    AlgorithmKind,
    FileReader,
    Plugin,
    PluginState,
    SourceKind,
)

__all__ = [
    "KINDS",
    "Parameter",
    "files",
    "kind",
    "origin",
    "parameters",
    "prose",
    "reads",
    "references",
    "state",
]

_KIND, _SOURCE, _STATE = "ALGORITHM_KIND_", "SOURCE_KIND_", "PLUGIN_STATE_"
KINDS = tuple(name.removeprefix(_KIND).lower() for name in AlgorithmKind.keys()[1:])
"""The kinds of algorithm, in the order in which a match uses them."""

_Schema = Mapping[str, Any]


@dataclass(frozen=True)
class Parameter:
    """One parameter of an algorithm, in words.

    Attributes
    ----------
    name
        What ``--set`` calls it, after the stage.
    type
        As JSON Schema calls it, or the strings to choose from, with ``null`` where it may be left
        to the algorithm: ``integer | null``, ``merge | separate``.
    default
        As ``--set`` takes it; empty where the class makes it anew each time.
    bounds
        ``2 … 100``, ``> 0``; empty where there are none.
    unit
        Of its value, e.g. ``m``; empty where it has none.
    text
        What it does.
    """

    name: str
    type: str
    default: str
    bounds: str
    unit: str
    text: str

    @property
    def value(self) -> str:
        """The default with its unit."""
        return self.default if self.default == "null" else f"{self.default} {self.unit}".rstrip()


def kind(item: Algorithm) -> str:
    """Return the kind of an algorithm in one word."""
    return AlgorithmKind.Name(item.kind).removeprefix(_KIND).lower()


def origin(item: Algorithm | FileReader | Plugin) -> str:
    """Return the distribution that something comes from, with its version."""
    version = item.version if isinstance(item, Plugin) else item.distribution_version
    return f"{item.distribution} {version}".rstrip()


def files(reader: FileReader) -> str:
    """Return by what a reader knows its files: what their names end in, and keys of JSON.

    Examples
    --------
    >>> files(FileReader(suffixes=[".plan", ".plan.json"], json_keys=["walls", "doors"]))
    '.plan .plan.json {walls, doors}'
    """
    keys = f"{{{', '.join(reader.json_keys)}}}" if reader.json_keys else ""
    return " ".join(filter(None, (*reader.suffixes, keys)))


def state(plugin: Plugin) -> str:
    """Return in one word what became of a plugin."""
    return PluginState.Name(plugin.state).removeprefix(_STATE).lower()


def reads(item: Algorithm) -> list[str]:
    """Return the forms of source that a segmenter reads, as requests name them."""
    return [SourceKind.Name(form).removeprefix(_SOURCE).lower() for form in item.source_kinds]


def prose(item: Algorithm) -> list[str]:
    """Return the paragraphs of an algorithm's text, up to its first section."""
    text = re.split(r"\n\S[^\n]*\n-{3,}\n", item.description)[0]
    return [" ".join(paragraph.split()) for paragraph in text.strip().split("\n\n")]


def references(item: Algorithm) -> list[str]:
    """Return the publications that an algorithm is from, each on its own."""
    return re.split(r" (?=\[\d+\] )", item.source) if item.source else []


def parameters(item: Algorithm) -> list[Parameter]:
    """Return the parameters of an algorithm, by name."""
    schema = MessageToDict(item.parameters_schema)
    properties = schema.get("properties", {})
    return [_parameter(name, properties[name], schema) for name in sorted(properties)]


def _parameter(name: str, said: _Schema, schema: _Schema) -> Parameter:
    forms = list(_forms(said, schema))
    return Parameter(
        name,
        " | ".join(_type(form) for form in forms),
        _plain(said["default"]) if "default" in said else "",
        ", ".join(filter(None, map(_bounds, forms))),
        said.get("unit", ""),
        " ".join(said.get("description", "").split()),
    )


def _forms(said: _Schema, schema: _Schema) -> Iterator[_Schema]:
    """Yield the forms that a value may have: one, or several where it may be left out."""
    for several in ("anyOf", "oneOf", "allOf"):
        if several in said:
            for form in said[several]:
                yield from _forms(form, schema)
            return
    if "$ref" in said:
        yield from _forms(schema["$defs"][said["$ref"].rpartition("/")[2]], schema)
    else:
        yield said


def _type(form: _Schema) -> str:
    choices = form.get("enum", [form["const"]] if "const" in form else ())
    return " | ".join(map(_plain, choices)) or str(form.get("type", "any"))


def _bounds(form: _Schema) -> str:
    """Return bounds in words.

    Examples
    --------
    >>> _bounds({"minimum": 2.0, "maximum": 100.0, "multipleOf": 2.0})
    '2 … 100, a multiple of 2'
    >>> _bounds({"exclusiveMinimum": 0.0, "maximum": 0.5})
    '> 0, ≤ 0.5'
    """
    said = {name: _plain(form[name]) for name in (*_LIMITS, "multipleOf") if name in form}
    limits = [f"{sign} {said[name]}" for name, sign in _LIMITS.items() if name in said]
    if "minimum" in said and "maximum" in said:
        limits = [f"{said['minimum']} … {said['maximum']}"]
    if "multipleOf" in said:
        limits.append(f"a multiple of {said['multipleOf']}")
    return ", ".join(limits)


_LIMITS = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}


def _plain(value: object) -> str:
    """Return a value as ``--set`` takes it; numbers of a protobuf Struct are all floating.

    Examples
    --------
    >>> [_plain(value) for value in (180.0, 0.3, None, True, "auto")]
    ['180', '0.3', 'null', 'true', 'auto']
    """
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
