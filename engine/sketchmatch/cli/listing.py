"""What people and pipes see of the catalogue: tables on a terminal, tab-separated lines elsewhere.

Texts of plugins are shown as they are, whatever markup they look like.
"""

from __future__ import annotations

from collections.abc import Iterable

from rich.console import Group, RenderableType
from rich.text import Text

from sketchmatch.cli import output
from sketchmatch.cli.catalogue import (
    Parameter,
    files,
    kind,
    origin,
    parameters,
    prose,
    reads,
    references,
    state,
)
from sketchmatch.cli.output import clean, write, write_line
from sketchmatch.cli.tables import Column, Rows, plain
from sketchmatch_proto.v1.catalog_service_pb2 import (
    Algorithm,
    FileReader,
    ListAlgorithmsResponse,
    Plugin,
    Profile,
)

__all__ = ["show_algorithm", "show_catalogue"]

_STYLES = {"failed": "bold red", "disabled": "dim"}


def show_catalogue(found: ListAlgorithmsResponse) -> None:
    """Write what algorithms and profiles there are, and what became of each plugin."""
    if output.for_people():
        tables = [_algorithm_table(found.algorithms)]
        if found.profiles:
            tables.append(_profile_table(found.profiles))
        tables.append(_plugin_table(found.plugins))
        if found.readers:
            tables.append(_reader_table(found.readers))
        output.show(Group(*tables[:1], *(part for table in tables[1:] for part in ("", table))))
        return
    write_line("kind", "name", "default", "distribution", "version", "summary", "source")
    for item in found.algorithms:
        default = str(item.is_default).lower()
        owner = (item.distribution, item.distribution_version)
        write_line(kind(item), item.name, default, *owner, item.summary, item.source)
    write("\n")
    write_line("profile", "default", "summary")
    for profile in found.profiles:
        write_line(profile.name, str(profile.is_default).lower(), profile.summary)
    write("\n")
    write_line("plugin", "version", "state", "reason")
    for plugin in found.plugins:
        write_line(plugin.distribution, plugin.version, state(plugin), plugin.reason)
    if found.readers:
        write("\n")
        write_line("reader", "files", "distribution", "version", "summary")
    for reader in found.readers:
        owner = (reader.distribution, reader.distribution_version)
        write_line(reader.name, files(reader), *owner, reader.summary)


def show_algorithm(item: Algorithm) -> None:
    """Write all there is to know of one algorithm."""
    if output.for_people():
        output.show(_description(item))
        return
    write_line("kind", kind(item))
    write_line("name", item.name)
    write_line("default", str(item.is_default).lower())
    write_line("distribution", item.distribution)
    write_line("version", item.distribution_version)
    write_line("reads", *reads(item))
    write_line("summary", item.summary)
    for paragraph in prose(item):
        write_line("description", paragraph)
    write_line("source", item.source)
    for each in parameters(item):
        write_line("parameter", *_cells(each))


def _algorithm_table(items: Iterable[Algorithm]) -> Rows:
    columns = [
        Column("name"),
        Column("kind"),
        Column("from", least=11, dispensable=1),
        Column("summary and parameters", least=32, wraps=True),
    ]
    rows = []
    for item in items:
        text = plain(item.summary)
        if named := parameters(item):
            text.append("\n").append_text(
                plain(", ".join(f"{each.name} = {each.value}" for each in named), "dim")
            )
        rows.append([_default(item), plain(kind(item)), plain(origin(item)), text])
    return Rows("", columns, rows)


def _profile_table(profiles: Iterable[Profile]) -> Rows:
    columns = [Column("profile"), Column("summary", least=32, wraps=True)]
    return Rows("", columns, [[_default(each), plain(each.summary)] for each in profiles])


def _default(item: Algorithm | Profile) -> Text:
    return plain(item.name).append(" (default)" if item.is_default else "", "dim")


def _reader_table(readers: Iterable[FileReader]) -> Rows:
    columns = [
        Column("reader"),
        Column("files", least=12, wraps=True),
        Column("from", least=12, wraps=True),
        Column("summary", least=24, wraps=True),
    ]
    rows = [
        [plain(reader.name), plain(files(reader)), plain(origin(reader)), plain(reader.summary)]
        for reader in readers
    ]
    return Rows("", columns, rows)


def _plugin_table(plugins: Iterable[Plugin]) -> Rows:
    columns = [Column("plugin"), Column("state"), Column("reason", least=32, wraps=True)]
    rows = [
        [
            plain(origin(plugin)),
            Text(state(plugin), _STYLES.get(state(plugin), "")),
            plain(plugin.reason),
        ]
        for plugin in plugins
    ]
    return Rows("", columns, rows)


def _description(item: Algorithm) -> Group:
    title = plain(item.name, "bold")
    default = ", the default" if item.is_default else ""
    title.append(clean(f", a {kind(item)} of {origin(item)}{default}"), "not bold")
    parts: list[RenderableType] = [title, plain(item.summary)]
    for paragraph in prose(item):
        parts += ["", plain(paragraph.replace("``", "").replace("]_", "]"))]
    if item.source_kinds:
        parts += ["", Text(f"Reads: {', '.join(reads(item))}")]
    if item.source:
        parts += ["", *(plain(each, "dim") for each in references(item))]
    if named := parameters(item):
        parts += ["", _parameter_table(named)]
    return Group(*parts)


def _parameter_table(named: Iterable[Parameter]) -> Rows:
    columns = [
        Column("parameter"),
        Column("type", least=9, wraps=True),
        Column("default", least=7, wraps=True),
        Column("bounds", least=9, wraps=True),
        Column("unit"),
        Column("what it does", least=24, wraps=True),
    ]
    return Rows("", columns, [list(map(plain, _cells(each))) for each in named])


def _cells(each: Parameter) -> tuple[str, ...]:
    return (each.name, each.type, each.default, each.bounds, each.unit, each.text)
