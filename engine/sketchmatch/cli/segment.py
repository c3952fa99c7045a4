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
from sketchmatch_proto.v1.scene_service_pb2 import SegmentResponse

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
    from sketchmatch.io import scene_files

    refuse_config(config, server)
    if overlay is not None:
        pictures.check_path(overlay)
    if out is not None:
        scene_files.check_scene_path(out, "--out")
    with places.places_in(source=file):
        found = _segmented(server, config, file, segmenter, settings, profile)
    if json:
        typer.echo(MessageToJson(found, **display.JSON_STYLE))
    else:
        display.show_scene(found)
    if overlay is not None:
        pictures.draw_segmentation(found, file, overlay)
    if out is not None:
        scene_files.save_scene(out, pictures.scene_of(found.scene), "--out")


def _segmented(
    server: str | None,
    config: Path | None,
    file: Path,
    segmenter: str,
    settings: list[str] | None,
    profile: str,
) -> SegmentResponse:
    parameters = parse_settings(settings, ("segmenter",)).get("segmenter", {})
    if server:
        from sketchmatch.cli import remote

        return remote.segmented(server, file, segmenter, parameters, profile)
    from sketchmatch.cli import local

    return local.segmented(file, segmenter, parameters, profile, config)
