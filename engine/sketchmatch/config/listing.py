"""All settings with their values, as a file to begin with and as a list of what is in force."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from sketchmatch.config.configuration import Configuration, builtin
from sketchmatch.config.layers import Origin
from sketchmatch.config.settings import Settings
from sketchmatch.pipeline.selection import STAGES, kind_of
from sketchmatch.registry import Kind, Registry

__all__ = ["Entry", "entries", "shown_file", "template"]

_Schema = Mapping[str, Any]
_BOUNDS = (
    ("minimum", "at least"),
    ("exclusiveMinimum", "more than"),
    ("maximum", "at most"),
    ("exclusiveMaximum", "less than"),
)
_HEAD = """\
## Configuration of sketchmatch. Every setting is listed with its default, commented out: to change
## one, remove the "# " before it. `sketchmatch config check` finds errors, and `sketchmatch config
## show` prints the settings in force. Environment variables override this file, such as
## SKETCHMATCH_SERVER__ADDRESS for address in [server]; options override both.
"""


@dataclass(frozen=True)
class Entry:
    """One setting.

    Attributes
    ----------
    path
        Where it is, e.g. ``("server", "address")``.
    value
        What is in force; None where it is left out.
    text
        What it means, with unit and bounds.
    origin, place
        Where the value comes from, and what it is called there; empty for a default.
    """

    path: tuple[str, ...]
    value: Any
    text: str
    origin: Origin
    place: str


def entries(configuration: Configuration, registry: Registry) -> list[Entry]:
    """Return all settings in force, as they stand in a file.

    Parameters
    ----------
    configuration
        What is set.
    registry
        The algorithms, whose parameters are settings too.
    """
    found = (
        *_sections(configuration, registry),
        *_algorithms(configuration, registry),
        *_profiles(configuration),
    )
    return [Entry(path, value, text, *configuration.origin(path)) for path, value, text in found]


def template(registry: Registry) -> str:
    """Return a file with every setting and its default, commented out."""
    parts = [_HEAD]
    for section, group in _by_section(entries(builtin(), registry)):
        parts.append(f"\n[{section}]\n" if section else "\n")
        for entry in group:
            parts += [f"## {line}\n" for line in _wrapped(entry.text)]
            key = _key(entry.path[-1])
            parts.append(
                f"## {key} is not set by default.\n"
                if entry.value is None
                else f"# {key} = {_toml(entry.value)}\n"
            )
    return "".join(parts)


def shown_file(configuration: Configuration, registry: Registry) -> str:
    """Return what is in force as a file that would set it, with where each value comes from."""
    parts = []
    for section, group in _by_section(entries(configuration, registry)):
        parts.append(f"\n[{section}]\n" if section else "")
        for entry in group:
            key = _key(entry.path[-1])
            line = f"# {key} is not set" if entry.value is None else f"{key} = {_toml(entry.value)}"
            parts.append(f"{line}  # {entry.place or entry.origin}\n")
    return "".join(parts)


_Found = Iterator[tuple[tuple[str, ...], Any, str]]


def _sections(configuration: Configuration, registry: Registry) -> _Found:
    """Yield the settings that every configuration has."""
    settings = configuration.settings
    profile = Settings.model_fields["profile"].description or ""
    yield ("profile",), settings.profile, profile
    for stage in STAGES:
        choice = getattr(settings.pipeline, stage)
        kind = kind_of(stage)
        default = None if kind is Kind.SEGMENTER else registry.default(kind)
        text = f"Name of the {kind}"
        text += "; by default the one for the kind of source." if default is None else "."
        yield ("pipeline", stage, "name"), choice.name or default, text
        for name, value in choice.parameters.items():
            yield ("pipeline", stage, "parameters", name), value, ""
    for name in ("plugins", "server", "limits"):
        section = getattr(settings, name)
        for key, schema in section.model_json_schema()["properties"].items():
            value = getattr(section, key)
            value = list(value) if isinstance(value, tuple) else value
            yield (name, key), value, _explained(schema)


def _algorithms(configuration: Configuration, registry: Registry) -> _Found:
    """Yield the parameters of all algorithms."""
    for kind in Kind:
        configured = configuration.defaults.parameters.get(kind, {})
        for item in registry.of_kind(kind):
            chosen = configured.get(item.name, {})
            for name, schema in item.schema.get("properties", {}).items():
                value = chosen.get(name, schema.get("default"))
                yield ("algorithms", str(kind), item.name, name), value, _explained(schema)


def _profiles(configuration: Configuration) -> _Found:
    for profile in configuration.defaults.profiles:
        path = ("profiles", profile.name)
        yield (*path, "summary"), profile.summary, ""
        if profile.weights is not None:
            yield (*path, "weights"), list(profile.weights), ""
        if profile.allow_unmatched is not None:
            yield (*path, "allow_unmatched"), profile.allow_unmatched, ""
        for stage, choice in profile.stages.items():
            if choice.name:
                yield (*path, stage, "name"), choice.name, ""
            for name, value in choice.parameters.items():
                yield (*path, stage, "parameters", name), value, ""


def _by_section(items: Iterable[Entry]) -> Iterator[tuple[str, list[Entry]]]:
    for section, group in groupby(items, key=lambda entry: entry.path[:-1]):
        yield ".".join(map(_key, section)), list(group)


def _explained(schema: _Schema) -> str:
    """Return a description with unit and bounds."""
    parts = [*([f"in {schema['unit']}"] if schema.get("unit") else []), *_bounds(schema)]
    for variant in schema.get("anyOf", ()):
        parts += _bounds(variant)
    parts += [f"for example {_toml(example)}" for example in schema.get("examples", ())]
    text = str(schema.get("description", "")).rstrip(".")
    return f"{text} ({', '.join(parts)})." if parts else f"{text}."


def _bounds(schema: _Schema) -> Iterator[str]:
    if choices := schema.get("enum"):
        yield f"one of {', '.join(map(str, choices))}"
    for key, words in _BOUNDS:
        if key in schema:
            yield f"{words} {_toml(schema[key])}"


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, 96, break_on_hyphens=False)


def _key(name: str) -> str:
    return name if name.replace("-", "").replace("_", "").isalnum() else json.dumps(name)


def _toml(value: Any) -> str:
    match value:
        case str():
            return json.dumps(value, ensure_ascii=False)
        case dict():
            return f"{{{', '.join(f'{_key(k)} = {_toml(v)}' for k, v in value.items())}}}"
        case list() | tuple():
            return f"[{', '.join(map(_toml, value))}]"
        case bool():
            return str(value).lower()
    return str(value)
