"""``sketchmatch scenes``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from sketchmatch.cli import options
from sketchmatch.cli.output import answering
from sketchmatch.errors import InvalidInputError, Reason, quoted

__all__ = ["app"]

app = typer.Typer(help="Store scenes on a server for later matches.", rich_markup_mode="markdown")

_Name = Annotated[
    str, typer.Argument(metavar="NAME", help="Name of a scene, or its first characters.")
]


@app.callback()
def scenes() -> None:
    """Store scenes on a server for later matches.

    A scene is named by the hash of its content; `match`, `transfer` and `carry` take scene:NAME in
    place of a file. You see only the scenes that you have put.
    """


@app.command("put")
@answering
@options.asking
def put(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="Sketch or map, in any format that `match` reads.",
            parser=options.to_path,
        ),
    ],
    server: options.OwnServer = options.HERE,
    access: options.Access = options.Access(),  # noqa: B008
    profile: options.Profile = "",
    segmenter: Annotated[
        str, typer.Option(help="Segmenter; depends on the kind of file by default.")
    ] = "",
    settings: options.Settings = None,
    json: options.Json = False,
    verbose: options.Verbose = False,
) -> None:
    """Store the objects of a file, and print the scene's name.

    Set parameters as in --set segmenter.min_size=0.3. A scene that is already stored stays as it
    is.
    """
    from sketchmatch.cli import display, output, places
    from sketchmatch.cli.answering import client_of
    from sketchmatch.cli.sources import source_of

    parameters = options.parse_settings(settings, ("segmenter",)).get("segmenter", {})
    with places.places_in(source=file), client_of(server, "--server", access) as client:
        source = source_of(file)
        kept = client.put_scene(source, segmenter=segmenter, params=parameters, profile=profile)
    if json:
        output.write_message(kept)
    else:
        display.say_notes("", kept.stored_scene.warnings, verbose=verbose)
        output.write_line(kept.stored_scene.name)


@app.command("list")
@answering
@options.asking
def list_(
    server: options.OwnServer = options.HERE,
    access: options.Access = options.Access(),  # noqa: B008
) -> None:
    """List your scenes, the latest first: name, number of objects, time, labels."""
    from sketchmatch.cli import output
    from sketchmatch.cli.answering import client_of

    with client_of(server, "--server", access) as client:
        for each in client.list_scenes():
            put_at = each.put_time.ToDatetime().strftime("%Y-%m-%dT%H:%M:%SZ")
            output.write_line(each.name, each.object_count, put_at, ", ".join(each.labels))


@app.command("show")
@answering
@options.asking
def show(
    name: _Name,
    server: options.OwnServer = options.HERE,
    access: options.Access = options.Access(),  # noqa: B008
    json: options.Json = False,
    verbose: options.Verbose = False,
) -> None:
    """Show the objects of a scene, as `segment` shows those of a file."""
    from sketchmatch.cli import display, output
    from sketchmatch.cli.answering import client_of
    from sketchmatch.cli.sources import whole_name
    from sketchmatch_proto.v1.scene_service_pb2 import SegmentResponse

    with client_of(server, "--server", access) as client:
        found = client.get_scene(whole_name(name, client))
    if json:
        output.write_message(found)
        return
    kept = found.stored_scene
    display.show_scene(
        SegmentResponse(
            scene=kept.scene, warnings=kept.warnings, segmenter=kept.segmenter, route=kept.route
        ),
        verbose,
    )


@app.command("label")
@answering
@options.asking
def label(
    name: _Name,
    labels: Annotated[
        list[str],
        typer.Argument(
            metavar="OBJECT=LABEL…",
            help="Object number, from 1 as in tables, and its label; 3= removes the label.",
        ),
    ],
    server: options.OwnServer = options.HERE,
    access: options.Access = options.Access(),  # noqa: B008
) -> None:
    """Label objects, and print the name of the resulting scene, which is another one."""
    from sketchmatch.cli import output
    from sketchmatch.cli.answering import client_of
    from sketchmatch.cli.sources import whole_name

    given = _labels(labels)
    with client_of(server, "--server", access) as client:
        whole = whole_name(name, client)
        count = len(client.get_scene(whole).stored_scene.scene.objects)
        if (most := max(given)) >= count:
            problem = f"names object {most + 1}, but the scene has objects 1 to {count}"
            raise InvalidInputError(Reason.INVALID_FIELD, quoted(f"{most + 1}="), problem)
        output.write_line(client.update_scene(whole, given).name)


@app.command("delete")
@answering
@options.asking
def delete(
    name: _Name,
    server: options.OwnServer = options.HERE,
    access: options.Access = options.Access(),  # noqa: B008
) -> None:
    """Delete a scene, and print its whole name; it stays for other callers who have put it."""
    from sketchmatch.cli import output
    from sketchmatch.cli.answering import client_of
    from sketchmatch.cli.sources import whole_name

    with client_of(server, "--server", access) as client:
        whole = whole_name(name, client)
        client.delete_scene(whole)
    output.write_line(whole)


def _labels(typed: list[str]) -> Mapping[int, str]:
    """Return labels by index, from 0."""
    found: dict[int, str] = {}
    for text in typed:
        number, equals, called = text.partition("=")
        if not (equals and number.isascii() and number.isdigit() and int(number) > 0):
            problem = "is not of the form NUMBER=LABEL; number objects from 1, as in 3=sofa"
            raise InvalidInputError(Reason.INVALID_FIELD, quoted(text), problem)
        found[int(number) - 1] = called
    return found
