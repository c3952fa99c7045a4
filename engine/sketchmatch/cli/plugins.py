"""``sketchmatch plugins``."""

from __future__ import annotations

import sys

import typer
from google.protobuf.json_format import MessageToDict, MessageToJson

from sketchmatch.cli.options import Json, Server, say
from sketchmatch_proto.v1.catalog_service_pb2 import (
    PLUGIN_STATE_FAILED,
    Algorithm,
    AlgorithmKind,
    ListAlgorithmsResponse,
)

__all__ = ["app"]

app = typer.Typer(help="List what there is to choose from.")


@app.callback()
def plugins() -> None:
    """List what there is to choose from."""


@app.command("list")
def list_(server: Server = None, json: Json = False) -> None:
    """List the algorithms, their parameters and where they come from."""
    from sketchmatch.cli import display

    catalogue = _catalogue(server)
    if json:
        typer.echo(MessageToJson(catalogue, **display.JSON_STYLE))
    elif sys.stdout.isatty():
        _show_table(catalogue)
    else:
        _print_lines(catalogue)
    for plugin in catalogue.plugins:
        if plugin.state == PLUGIN_STATE_FAILED:
            say(f"plugin of {plugin.distribution} {plugin.version} failed: {plugin.reason}")


def _catalogue(server: str | None) -> ListAlgorithmsResponse:
    if server:
        from sketchmatch.cli import remote

        return remote.algorithms(server)
    from sketchmatch.cli import local

    return local.algorithms()


def _show_table(catalogue: ListAlgorithmsResponse) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table()
    for column in ("kind", "name", "from", "summary and parameters"):
        table.add_column(column, no_wrap=column in ("kind", "name"))
    for item in catalogue.algorithms:
        name = f"{item.name} [dim](default)[/dim]" if item.is_default else item.name
        origin = f"{item.distribution} {item.distribution_version}"
        parameters = "\n".join(f"  [dim]{line}[/dim]" for line in _parameters(item))
        text = f"{item.summary}\n{parameters}" if parameters else item.summary
        table.add_row(_kind(item), name, origin, text)
    Console().print(table)


def _print_lines(catalogue: ListAlgorithmsResponse) -> None:
    print("kind", "name", "default", "distribution", "version", "summary", sep="\t")
    for item in catalogue.algorithms:
        origin = (item.distribution, item.distribution_version)
        print(_kind(item), item.name, str(item.is_default).lower(), *origin, item.summary, sep="\t")


def _parameters(item: Algorithm) -> list[str]:
    properties = MessageToDict(item.parameters_schema).get("properties", {})
    return [
        f"{name} = {_plain(schema['default'])}: {schema['description']}"
        for name, schema in sorted(properties.items())
        if "default" in schema
    ]


def _plain(value: object) -> str:
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return "automatic" if value is None else str(value)


def _kind(item: Algorithm) -> str:
    return AlgorithmKind.Name(item.kind).removeprefix("ALGORITHM_KIND_").lower()
