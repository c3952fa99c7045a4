"""``sketchmatch config``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sketchmatch.cli import output
from sketchmatch.cli.options import Config, say, to_path
from sketchmatch.cli.output import answering
from sketchmatch.errors import InvalidInputError, Reason

__all__ = ["app"]

app = typer.Typer(help="Show, check and write the configuration.", rich_markup_mode="markdown")


@app.callback()
def config() -> None:
    """Show, check and write the configuration."""


@app.command("show")
@answering
def show(
    config: Config = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """Show the settings in force, and where each value comes from.

    The output is a configuration file with the same settings.
    """
    from sketchmatch.config import entries, load, shown_file
    from sketchmatch.registry import default_registry

    configuration = load(config)
    registry = default_registry(configuration.rules)
    if not json:
        output.write(shown_file(configuration, registry))
        return
    settings = {
        ".".join(entry.path): {
            "value": entry.value,
            "origin": str(entry.origin),
            "place": entry.place,
        }
        for entry in entries(configuration, registry)
    }
    output.write_json({"file": configuration.file, "settings": settings})


@app.command("check")
@answering
def check(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="[FILE]",
            help="Configuration file; by default the one that would be read.",
            parser=to_path,
        ),
    ] = None,
) -> None:
    """Check a configuration, its profiles and the environment against what is installed."""
    from sketchmatch.config import check as find_faults

    path, faults = find_faults(file)
    for fault in faults:
        say(str(fault))
    if faults:
        raise typer.Exit(2)
    output.write_line(f"{path or 'the configuration (without a file)'} is sound")


@app.command("init")
@answering
def init(
    file: Annotated[
        Path, typer.Argument(metavar="[FILE]", help="File to write.", parser=to_path)
    ] = Path("sketchmatch.toml"),
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Write a file with every setting and its default, commented out."""
    from sketchmatch.config import builtin, template
    from sketchmatch.registry import default_registry

    text = template(default_registry(builtin().rules))
    try:
        with file.open("w" if force else "x", encoding="utf-8") as opened:
            opened.write(text)
    except FileExistsError:
        problem = "exists already; choose another name, or replace it with --force"
        raise InvalidInputError(Reason.INVALID_FILE, str(file), problem) from None
    except OSError as error:
        problem = f"cannot be written ({(error.strerror or str(error)).lower()}); check the path"
        raise InvalidInputError(Reason.INVALID_FILE, str(file), problem) from None
    say(f"wrote {file}")
