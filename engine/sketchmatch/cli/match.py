"""``sketchmatch match``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sketchmatch.cli import options
from sketchmatch.cli.output import answering
from sketchmatch.errors import InvalidInputError, Reason

if TYPE_CHECKING:
    from sketchmatch_client import MatchOptions

__all__ = ["match"]


@answering
@options.asking
def match(
    sketch: Annotated[
        Path,
        typer.Argument(
            metavar="SKETCH",
            help="Sketch: .svg, .json, .excalidraw, .geojson or picture; FILE#PART selects a part, "
            "such as a frame.",
            parser=options.to_path,
        ),
    ],
    map_: Annotated[
        Path,
        typer.Argument(
            metavar="MAP",
            help="Map: ROS map .yaml, its picture or folder, bag, .geojson, .dxf, .svg, picture, "
            "annotations or scene graph; `sketchmatch plugins list` shows all readers. FILE#PART "
            "selects a part, such as layers; scene:NAME is a scene stored on the server.",
            parser=options.to_path,
        ),
    ],
    server: options.Server = None,
    access: options.Access = options.Access(),  # noqa: B008
    config: options.Config = None,
    profile: options.Profile = "",
    search: options.Search = options.Search(),  # noqa: B008
    sketch_segmenter: options.SketchSegmenter = "",
    map_segmenter: options.MapSegmenter = "",
    segmenter_sketch: options.FormerSketchSegmenter = "",
    segmenter_map: options.FormerMapSegmenter = "",
    settings: options.Settings = None,
    alternatives: Annotated[
        int | None, typer.Option(metavar="K", help="Number of next best object maps; 3 by default.")
    ] = None,
    pin: options.Pins = None,
    no_pin: options.Exclusions = None,
    synonyms: options.Synonyms = None,
    keep_running: Annotated[
        bool,
        typer.Option(
            "--keep-running",
            help="With --server: let the match continue if this command ends; `sketchmatch "
            "matches` finds it again.",
        ),
    ] = False,
    json: options.Json = False,
    overlay: options.Overlay = None,
    verbose: options.Verbose = False,
) -> None:
    """Find which sketched object is which mapped object.

    On a terminal, shows the search while it runs, then a table, which also gives how each sketched
    object lies relative to the nearest other one; so does --json. In a pipe, prints tab-separated
    lines. Tables and pictures number the objects of each side from 1; pipes and --json number them
    from 0.
    """
    from sketchmatch.cli import display, output, pictures, places
    from sketchmatch.cli.answering import answerer
    from sketchmatch.cli.sources import in_metres, source_or_stored

    options.refuse_config(config, server)
    if keep_running and server is None:
        problem = "needs a server, but none is given; add --server, or leave it out"
        raise InvalidInputError(Reason.INVALID_FIELD, "--keep-running", problem)
    if overlay is not None:
        pictures.check_path(overlay, sketch, map_)
    known = options.parse_pins(pin, no_pin)
    chosen: MatchOptions = {
        **search.chosen(),
        "sketch_segmenter": sketch_segmenter or segmenter_sketch,
        "map_segmenter": map_segmenter or segmenter_map,
        "params": options.parse_settings(settings),
        "alternatives": alternatives,
        "pins": list(known.values()),
        "synonyms": options.parse_synonyms(synonyms),
        "profile": profile,
        "keep_running": keep_running or None,
    }
    named = options.pins_as_typed(list(known))
    with (
        places.places_in(sketch=sketch, map=map_),
        named,
        answerer(server, config, access) as asked,
    ):
        sources = (
            source_or_stored(sketch, "sketch", asked),
            source_or_stored(map_, "map", asked),
        )
        answer = display.watch(asked.events(*sources, **chosen))
    metres = in_metres(sources[1])
    # Files first: whoever reads the answer may have had enough of it after a line.
    if overlay is not None:
        pictures.draw_match(answer, map_, overlay, metres)
    if json:
        display.say_match_notes(answer, verbose)
        display.say_doubt(answer)
        output.write_message(answer.result)
    else:
        display.show_match(answer, metres, verbose)
    options.say_renamed(segmenter_sketch, segmenter_map)
