"""``sketchmatch segment``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from google.protobuf.json_format import MessageToJson

from sketchmatch.cli.options import (
    Config,
    Json,
    Overlay,
    Profile,
    Server,
    Settings,
    parse_settings,
    refuse_config,
)

__all__ = ["segment"]


def segment(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="A sketch or a map, as `match` takes them.")
    ],
    server: Server = None,
    config: Config = None,
    profile: Profile = "",
    segmenter: Annotated[str, typer.Option(help="Segmenter; the file's kind decides.")] = "",
    settings: Settings = None,
    json: Json = False,
    overlay: Overlay = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Save the objects as polygons, in .geojson."),
    ] = None,
) -> None:
    """Show which objects are found in a file.

    Parameters are set as in --set segmenter.min_size=0.3. On a terminal the table counts objects
    from 1, as the overlay does; in a pipe the lines count from 0, as the API does.
    """
    from sketchmatch.cli import display, pictures, places
    from sketchmatch.cli.answering import answerer
    from sketchmatch.cli.sources import source_of
    from sketchmatch.io import scene_files

    refuse_config(config, server)
    if overlay is not None:
        pictures.check_path(overlay)
    if out is not None:
        scene_files.check_scene_path(out, "--out")
    parameters = parse_settings(settings, ("segmenter",)).get("segmenter", {})
    with places.places_in(source=file), answerer(server, config) as asked:
        source = source_of(file)
        found = asked.segment(source, segmenter=segmenter, params=parameters, profile=profile)
    if json:
        typer.echo(MessageToJson(found, **display.JSON_STYLE))
    else:
        display.show_scene(found)
    if overlay is not None:
        pictures.draw_segmentation(found, file, overlay, pen=source.HasField("stroke_set"))
    if out is not None:
        scene_files.save_scene(out, pictures.scene_of(found.scene), "--out")
