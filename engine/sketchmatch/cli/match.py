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
            help="Sketch: .svg, .json, .excalidraw, .geojson, image; FILE#PART names a part of it, "
            "such as a frame.",
            parser=options.to_path,
        ),
    ],
    map_: Annotated[
        Path,
        typer.Argument(
            metavar="MAP",
            help="Map: ROS map .yaml, its picture or folder, bag, .geojson, .dxf, .svg, image, "
            "annotations, scene graph; `sketchmatch plugins list` shows all readers. FILE#PART "
            "names a part of it, such as layers. scene:NAME is a scene that the server keeps.",
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
        int | None, typer.Option(metavar="K", help="How many of the next best maps; 3 by default.")
    ] = None,
    pin: options.Pins = None,
    no_pin: options.Exclusions = None,
    synonyms: options.Synonyms = None,
    keep_running: Annotated[
        bool,
        typer.Option(
            "--keep-running",
            help="With --server: let the match go on there if this command is ended; "
            "`sketchmatch matches` finds it again.",
        ),
    ] = False,
    json: options.Json = False,
    overlay: options.Overlay = None,
    verbose: options.Verbose = False,
) -> None:
    """Find which sketched object is which mapped object.

    On a terminal it shows the search while it runs and then a table that counts the objects of
    each side from 1, as `segment` and all pictures do, and says how each sketched object lies to
    the nearest other. In a pipe it prints tab-separated lines; these and --json, which says that
    too, count the same objects from 0, as the API does.
    """
    from sketchmatch.cli import display, output, pictures, places
    from sketchmatch.cli.answering import answerer
    from sketchmatch.cli.sources import in_metres, source_or_stored

    options.refuse_config(config, server)
    if keep_running and server is None:
        problem = "is for a server, and none is asked; give --server, or drop it"
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
