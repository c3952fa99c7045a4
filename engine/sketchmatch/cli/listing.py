"""What people and pipes see of the catalogue: tables on a terminal, tab-separated lines elsewhere.

Texts of plugins are shown as they are, whatever markup they look like.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable

from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from sketchmatch.cli.catalogue import (
    Parameter,
    kind,
    origin,
    parameters,
    prose,
    reads,
    references,
    state,
)
from sketchmatch_proto.v1.catalog_service_pb2 import (
    Algorithm,
    ListAlgorithmsResponse,
    Plugin,
    Profile,
)

__all__ = ["show_algorithm", "show_catalogue"]

_STYLES = {"failed": "bold red", "disabled": "dim"}


def show_catalogue(found: ListAlgorithmsResponse) -> None:
    """Print what algorithms and profiles there are, and what became of each plugin."""
    if sys.stdout.isatty():
        console = Console()
        console.print(_algorithm_table(found.algorithms))
        if found.profiles:
            console.print(_profile_table(found.profiles))
        console.print(_plugin_table(found.plugins))
        return
    _print("kind", "name", "default", "distribution", "version", "summary", "source")
    for item in found.algorithms:
        default = str(item.is_default).lower()
        owner = (item.distribution, item.distribution_version)
        _print(kind(item), item.name, default, *owner, item.summary, item.source)
    print()
    _print("profile", "default", "summary")
    for profile in found.profiles:
        _print(profile.name, str(profile.is_default).lower(), profile.summary)
    print()
    _print("plugin", "version", "state", "reason")
    for plugin in found.plugins:
        _print(plugin.distribution, plugin.version, state(plugin), plugin.reason)


def show_algorithm(item: Algorithm) -> None:
    """Print all there is to know of one algorithm."""
    if sys.stdout.isatty():
        Console().print(_description(item))
        return
    _print("kind", kind(item))
    _print("name", item.name)
    _print("default", str(item.is_default).lower())
    _print("distribution", item.distribution)
    _print("version", item.distribution_version)
    _print("reads", *reads(item))
    _print("summary", item.summary)
    for paragraph in prose(item):
        _print("description", paragraph)
    _print("source", item.source)
    for each in parameters(item):
        _print("parameter", *_cells(each))


def _print(*cells: str) -> None:
    """Print one line, however many a plugin's text has."""
    print(*(" ".join(cell.split()) for cell in cells), sep="\t")


def _algorithm_table(items: Iterable[Algorithm]) -> Table:
    table = Table()
    for column in ("kind", "name", "from", "summary and parameters"):
        table.add_column(column, no_wrap=column in ("kind", "name"))
    for item in items:
        text = Text(item.summary)
        if named := parameters(item):
            text.append("\n" + ", ".join(f"{each.name} = {each.value}" for each in named), "dim")
        table.add_row(kind(item), _default(item), Text(origin(item)), text)
    return table


def _profile_table(profiles: Iterable[Profile]) -> Table:
    table = Table()
    for column in ("profile", "summary"):
        table.add_column(column, no_wrap=column == "profile")
    for profile in profiles:
        table.add_row(_default(profile), Text(profile.summary))
    return table


def _default(item: Algorithm | Profile) -> Text:
    return Text(item.name).append(" (default)" if item.is_default else "", "dim")


def _plugin_table(plugins: Iterable[Plugin]) -> Table:
    table = Table()
    for column in ("plugin", "state", "reason"):
        table.add_column(column, no_wrap=column == "state")
    for plugin in plugins:
        word = state(plugin)
        table.add_row(Text(origin(plugin)), Text(word, _STYLES.get(word, "")), Text(plugin.reason))
    return table


def _description(item: Algorithm) -> Group:
    title = Text(item.name, "bold")
    default = ", the default" if item.is_default else ""
    title.append(f", a {kind(item)} of {origin(item)}{default}", "not bold")
    parts: list[RenderableType] = [title, Text(item.summary)]
    for paragraph in prose(item):
        parts += ["", Text(paragraph.replace("``", "").replace("]_", "]"))]
    if item.source_kinds:
        parts += ["", Text(f"Reads: {', '.join(reads(item))}")]
    if item.source:
        parts += ["", Text("\n".join(references(item)), "dim")]
    if named := parameters(item):
        parts += ["", _parameter_table(named)]
    return Group(*parts)


def _parameter_table(named: Iterable[Parameter]) -> Table:
    table = Table()
    for column in ("parameter", "type", "default", "bounds", "unit", "what it does"):
        table.add_column(column, no_wrap=column == "parameter")
    for each in named:
        table.add_row(*map(Text, _cells(each)))
    return table


def _cells(each: Parameter) -> tuple[str, ...]:
    return (each.name, each.type, each.default, each.bounds, each.unit, each.text)
