"""``sketchmatch segment``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sketchmatch.cli import options
from sketchmatch.cli.output import answering

__all__ = ["segment"]


@answering
@options.asking
def segment(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="Sketch or map, in any format that `match` reads.",
            parser=options.to_path,
        ),
    ],
    server: options.Server = None,
    access: options.Access = options.Access(),  # noqa: B008
    config: options.Config = None,
    profile: options.Profile = "",
    segmenter: Annotated[
        str, typer.Option(help="Segmenter; depends on the kind of file by default.")
    ] = "",
    settings: options.Settings = None,
    json: options.Json = False,
    overlay: options.Overlay = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="Save the objects as polygons (.geojson). Beside a robot's map NAME.yaml, "
            "NAME.objects.geojson replaces the objects found in it: edit it at will.",
            parser=options.to_path,
        ),
    ] = None,
    verbose: options.Verbose = False,
) -> None:
    """Show which objects are found in a file.

    Set parameters as in --set segmenter.min_size=0.3. Tables and pictures number objects from 1;
    pipes and --json number them from 0.
    """
    from sketchmatch.cli import display, output, pictures, places, sources
    from sketchmatch.cli.answering import answerer
    from sketchmatch.io import scene_files

    options.refuse_config(config, server)
    if overlay is not None:
        pictures.check_path(overlay, file)
    if out is not None:
        scene_files.check_scene_path(out, "--out")
        if not segmenter:
            sources.check_objects_spared(out, file)
    parameters = options.parse_settings(settings, ("segmenter",)).get("segmenter", {})
    with places.places_in(source=file), answerer(server, config, access) as asked:
        source = sources.source_of(file)
        found = asked.segment(source, segmenter=segmenter, params=parameters, profile=profile)
    if overlay is not None:
        pictures.draw_segmentation(found, file, overlay, pen=sources.is_drawn(source))
    if out is not None:
        content = sources.content_of(file) if scene_files.is_of_a_map(out) else ""
        scene_files.save_scene(out, pictures.scene_of(found.scene), "--out", content)
    if json:
        output.write_message(found)
    else:
        display.show_scene(found, verbose)
