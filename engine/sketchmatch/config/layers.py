"""The layers of a configuration: what is built in, a file, the environment, flags."""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import Any

from sketchmatch.config.settings import annotation_of, static_paths
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.pipeline.selection import kind_of
from sketchmatch.registry import Kind, PluginRules, default_registry

__all__ = [
    "Layer",
    "Origin",
    "builtin_layer",
    "environment_layer",
    "file_layer",
    "flag_layer",
    "found_file",
    "leaves_of",
    "says",
    "value_of",
    "variable_of",
    "without",
    "without_overruled",
]

FILE_NAME = "sketchmatch.toml"
_PREFIX = "SKETCHMATCH_"
_NAMING_FILE = "SKETCHMATCH_CONFIG"
_OF_CLIENTS = (
    "TLS",
    "TOKEN",
    "TOKEN_FILE",
    "ROOT_CERTIFICATES",
    "CERTIFICATE",
    "KEY",
    "SERVER_NAME",
)
_NO_SETTINGS = (_NAMING_FILE, "SKETCHMATCH_DEBUG", *(f"{_PREFIX}{name}" for name in _OF_CLIENTS))
_SECTION = "__"
# Numbers that JSON does not know, and people write.
_SHORT_NUMBER = re.compile(r"[+-]?(\.\d+|\d+\.)|\+\d+(\.\d+)?")
_OWN_ALONE = PluginRules.of(allow=())
_BUILTIN = Path(__file__).with_name("builtin.toml")
# A file may be a pipe, as of a shell's <(…), but no endless device.
_MOST_BYTES = 1024 * 1024
_DEEPEST = 50
_TOO_DEEP = f"has tables or lists nested more than {_DEEPEST} deep; give a configuration file"


class Origin(StrEnum):
    """Where a value comes from, the weakest first."""

    DEFAULT = "default"
    FILE = "file"
    ENVIRONMENT = "environment"
    FLAG = "flag"


@dataclass(frozen=True)
class Layer:
    """What one place says.

    Attributes
    ----------
    origin
        What kind of place it is.
    values
        Nested as in the file.
    labels
        The variable or the option of each value, by its path.
    name
        Of the file.
    """

    origin: Origin
    values: Mapping[str, Any]
    labels: Mapping[tuple[str, ...], str] = field(default_factory=dict)
    name: str = ""


def value_of(text: str) -> Any:
    """Return what a text on the command line or in the environment stands for: JSON, or itself.

    Examples
    --------
    >>> value_of("400"), value_of("pairwise"), value_of(".5")
    (400, 'pairwise', 0.5)
    """
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return float(text) if _SHORT_NUMBER.fullmatch(text) else text


def found_file(named: str | Path | None) -> Path | None:
    """Return the file to read: the one named, or else the one that lies in its place, if any.

    Raises
    ------
    InvalidInputError
        If one is named, by the argument or by ``SKETCHMATCH_CONFIG``, and does not exist.
    """
    if variable := "" if named else os.environ.get(_NAMING_FILE, ""):
        named = variable
    if named:
        path = Path(named)
        if not path.exists():
            place = f"{_NAMING_FILE} names {path}, which" if variable else str(path)
            problem = f"does not exist; write one with `sketchmatch config init {path}`"
            raise InvalidInputError(Reason.INVALID_FILE, place, problem)
        return path
    # A file in a home that is closed to this user is not there.
    return next((path for path in _usual_places() if os.path.isfile(path)), None)  # noqa: PTH113


@cache
def builtin_layer() -> Layer:
    """Return the profiles that come with the engine."""
    return Layer(Origin.DEFAULT, _parsed(_BUILTIN))


def file_layer(path: Path) -> Layer:
    """Return what a file says.

    Raises
    ------
    InvalidInputError
        If it cannot be read or is no TOML, with line and column.
    """
    values = _parsed(path)
    return Layer(Origin.FILE, values, {leaf: "" for leaf, _ in leaves_of(values)}, str(path))


def variables_in(environment: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    """Return the variables that may say something, and their texts, in alphabetical order."""
    items = sorted(environment.items())
    return tuple((name, text) for name, text in items if name.startswith(_PREFIX))


def _raise(fault: InvalidInputError) -> None:
    raise fault


def environment_layer(
    environment: Mapping[str, str], refuse: Callable[[InvalidInputError], None] = _raise
) -> Layer:
    """Return what environment variables say.

    Parameters
    ----------
    environment
        The variables.
    refuse
        Called with each fault; raises it when left out. Where it returns, the variable counts for
        nothing.

    Raises
    ------
    InvalidInputError
        If a variable looks like a setting and is none.
    """
    values: dict[str, Any] = {}
    labels = {}
    for variable, text in variables_in(environment):
        if variable in _NO_SETTINGS or not text.strip():
            continue
        try:
            path = _path_of(variable)
            if path is not None:
                _put(values, path, text if annotation_of(path) is str else value_of(text), variable)
                labels[path] = variable
        except InvalidInputError as fault:
            refuse(fault)
    return Layer(Origin.ENVIRONMENT, values, labels)


def flag_layer(flags: Mapping[str, Any]) -> Layer:
    """Return what flags say, by dotted path; None is not given."""
    values: dict[str, Any] = {}
    labels = {}
    for dotted, value in flags.items():
        if value is not None:
            path = tuple(dotted.split("."))
            option = f"--{path[-1].removesuffix('_seconds').replace('_', '-')}"
            _put(values, path, value, option)
            labels[path] = option
    return Layer(Origin.FLAG, values, labels)


def without_overruled(layers: Sequence[Layer]) -> list[dict[str, Any]]:
    """Return the values of layers, the strongest first, fit to be merged.

    Where a stronger layer names another algorithm for a stage, what weaker ones say of the stage
    is dropped: their parameters are those of another algorithm.
    """
    fit = [_copied(layer.values) for layer in layers]
    for path in {path for values in fit for path in _stages_in(values)}:
        tables = [table for values in reversed(fit) if isinstance(table := _at(values, path), dict)]
        if len(tables) == 1:
            continue
        name, weaker = _unsaid(path), list[dict[str, Any]]()
        for table in tables:
            if table.get("name", "") not in ("", name):
                name = table["name"]
                for overruled in weaker:
                    overruled.clear()
            weaker.append(table)
    return fit


def without(layers: Sequence[Layer], paths: Iterable[tuple[str, ...]]) -> tuple[Layer, ...]:
    """Return layers of which the strongest that says something at a path says it no more."""
    fit = [_copied(layer.values) for layer in layers]
    for path in paths:
        any(_take_out(values, path) for values in fit)
    left = [replace(layer, values=values) for layer, values in zip(layers, fit, strict=True)]
    return tuple(
        replace(
            layer, labels={path: name for path, name in layer.labels.items() if says(layer, path)}
        )
        for layer in left
    )


def says(layer: Layer, path: Sequence[str]) -> bool:
    """Whether a layer has something at a path."""
    *above, last = path
    table = _at(layer.values, above)
    return isinstance(table, Mapping) and last in table


def leaves_of(values: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield every value that is no table, with its path."""
    if isinstance(values, dict) and (values or not path):
        for key, value in values.items():
            yield from leaves_of(value, (*path, key))
    else:
        yield path, values


def variable_of(path: Sequence[str]) -> str:
    """Return the environment variable that sets what is at a path.

    Examples
    --------
    >>> variable_of(("algorithms", "searcher", "fsnn-pso", "particles"))
    'SKETCHMATCH_ALGORITHMS__SEARCHER__FSNN_PSO__PARTICLES'
    """
    return _PREFIX + _SECTION.join(path).replace("-", "_").upper()


def _usual_places() -> tuple[Path, ...]:
    from platformdirs import user_config_path

    try:
        return (Path(FILE_NAME), user_config_path("sketchmatch") / FILE_NAME)
    except RuntimeError:  # there is no home
        return (Path(FILE_NAME),)


def _parsed(path: Path) -> dict[str, Any]:
    try:
        with path.open("rb") as file:
            data = file.read(_MOST_BYTES + 1)
        if len(data) > _MOST_BYTES:
            problem = f"has more than {_MOST_BYTES // 1024} KiB; give a configuration file"
        elif _is_deep(values := tomllib.loads(data.decode("utf-8-sig"))):
            problem = _TOO_DEEP
        else:
            return values
    except RecursionError:
        problem = _TOO_DEEP
    except tomllib.TOMLDecodeError as error:
        what, _, place = str(error).partition(" (at ")
        where = place.rstrip(")").replace("end of document", "its end")
        problem = f"is not TOML at {where} ({what[:1].lower()}{what[1:]}); correct it"
    except UnicodeDecodeError:
        problem = "is not UTF-8 text; save it as UTF-8"
    except IsADirectoryError:
        problem = "is a directory; give a file in it"
    except OSError as error:
        problem = f"cannot be read ({(error.strerror or str(error)).lower()}); check the path"
    raise InvalidInputError(Reason.INVALID_FILE, str(path), problem)


def _is_deep(values: Any) -> bool:
    """Whether tables and lists are in each other deeper than any setting is."""
    level = [values]
    for _ in range(_DEEPEST):
        inner = (each.values() if isinstance(each, dict) else each for each in level)
        level = [item for each in inner for item in each if isinstance(item, dict | list)]
    return bool(level)


def _path_of(variable: str) -> tuple[str, ...] | None:
    """Return the path that a variable sets, or None for one that is somebody else's."""
    path = variable.removeprefix(_PREFIX).lower().split(_SECTION)
    known = {variable_of(static): static for static in static_paths()}
    if variable in known:
        return known[variable]
    if len(path) == 1:
        # Others have variables of this prefix too, Kubernetes for a service of this name.
        near = [name for name in known if name.endswith(_SECTION + path[0].upper())]
        near += get_close_matches(variable, known, 1, 0.9)
        if not near:
            return None
        problem = f"is not a setting; did you mean {near[0]}?"
        raise InvalidInputError(Reason.INVALID_PARAMETER, variable, problem)
    named = {"algorithms": 2, "profiles": 1}.get(path[0], len(path))
    return tuple(part.replace("_", "-") if k == named else part for k, part in enumerate(path))


def _put(values: dict[str, Any], path: Sequence[str], value: Any, label: str) -> None:
    *above, last = path
    for part in above:
        values = values.setdefault(part, {})
        if not isinstance(values, dict):
            other = variable_of(path[: path.index(part) + 1])
            problem = f"cannot be set together with {other}; leave out one of them"
            raise InvalidInputError(Reason.INVALID_PARAMETER, label, problem)
    values[last] = value


def _unsaid(path: tuple[str, ...]) -> str:
    """Return which algorithm does a stage where no layer names one; empty where that depends."""
    if path[0] != "pipeline" or kind_of(path[-1]) is Kind.SEGMENTER:
        return ""
    return default_registry(_OWN_ALONE).default(kind_of(path[-1]))


def _stages_in(values: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    """Yield the paths of the tables that choose an algorithm for a stage."""
    tables: list[tuple[str, ...]] = [("pipeline",)]
    if isinstance(profiles := values.get("profiles"), dict):
        tables += [("profiles", name) for name in profiles]
    for path in tables:
        if isinstance(table := _at(values, path), dict):
            yield from ((*path, key) for key, value in table.items() if isinstance(value, dict))


def _at(values: Any, path: Sequence[str]) -> Any:
    for part in path:
        values = values.get(part) if isinstance(values, dict) else None
    return values


def _take_out(values: dict[str, Any], path: tuple[str, ...]) -> bool:
    """Take out what is at a path, or the value or bad name that it ends at, if it is there."""
    for k, part in enumerate(path):
        if part not in values:
            return False
        below = values[part]
        if not isinstance(below, dict) or path[k + 1 :] in ((), ("[key]",)):
            del values[part]
            return True
        values = below
    return False


def _copied(values: Any) -> Any:
    if isinstance(values, Mapping):
        return {key: _copied(value) for key, value in values.items()}
    return values
