"""``sketchmatch match``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from sketchmatch.cli import options
from sketchmatch.cli.output import answering
from sketchmatch.errors import InvalidInputError, Reason

if TYPE_CHECKING:
    from sketchmatch.model import RequestWeights
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
        ),
    ],
    map_: Annotated[
        Path,
        typer.Argument(
            metavar="MAP",
            help="Map: ROS map .yaml, its picture or folder, bag, .geojson, .dxf, .svg, image, "
            "annotations, scene graph; `sketchmatch plugins list` shows all readers. FILE#PART "
            "names a part of it, such as layers. scene:NAME is a scene that the server keeps.",
        ),
    ],
    server: options.Server = None,
    access: options.Access = options.Access(),  # noqa: B008
    config: options.Config = None,
    profile: options.Profile = "",
    searcher: Annotated[str | None, typer.Option(help="Searcher.")] = None,
    judge: Annotated[str | None, typer.Option(help="Judge of the maps found.")] = None,
    histogram: Annotated[str | None, typer.Option(help="Histogram.")] = None,
    similarity: Annotated[str | None, typer.Option(help="Similarity measure.")] = None,
    sketch_segmenter: options.SketchSegmenter = "",
    map_segmenter: options.MapSegmenter = "",
    segmenter_sketch: options.FormerSketchSegmenter = "",
    segmenter_map: options.FormerMapSegmenter = "",
    settings: options.Settings = None,
    seed: Annotated[int, typer.Option(help="Same seed, same answer.")] = 0,
    time_budget: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Give the best answer so far after this time."),
    ] = None,
    weights: Annotated[
        str | None,
        typer.Option(
            metavar="W1,W2,W3[,W4,W5[,β]]",
            help="Weights of ζσ, ζR and ζL in ζ, and of the objects' shapes and sizes; rotations "
            "of pairs d apart count for d^β; 1,1,1 by default.",
        ),
    ] = None,
    allow_unmatched: Annotated[
        bool | None,
        typer.Option(
            "--allow-unmatched/--no-allow-unmatched",
            help="Leave objects without partner on both sides where that is likelier.",
            show_default=False,
        ),
    ] = None,
    unmatched_price: Annotated[
        float | None,
        typer.Option(metavar="PRICE", help="What leaving out all objects costs, in units of ζ."),
    ] = None,
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
    from sketchmatch.cli.sources import in_metres, source_of, stored_of

    options.refuse_config(config, server)
    if keep_running and server is None:
        problem = "is for a server, and none is asked; give --server, or drop it"
        raise InvalidInputError(Reason.INVALID_FIELD, "--keep-running", problem)
    if overlay is not None:
        pictures.check_path(overlay)
    known = options.parse_pins(pin, no_pin)
    chosen: MatchOptions = {
        "sketch_segmenter": sketch_segmenter or segmenter_sketch,
        "map_segmenter": map_segmenter or segmenter_map,
        "histogram": histogram,
        "similarity": similarity,
        "searcher": searcher,
        "judge": judge,
        "params": options.parse_settings(settings),
        "seed": seed,
        "time_budget": time_budget,
        "weights": None if weights is None else _weights(weights),
        "allow_unmatched": allow_unmatched,
        "unmatched_price": unmatched_price,
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
            stored_of(sketch, asked) or source_of(sketch, "sketch"),
            stored_of(map_, asked) or source_of(map_, "map"),
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


def _weights(text: str) -> RequestWeights:
    from sketchmatch.model.maps import WEIGHT_COUNTS

    try:
        weights = tuple(float(part) for part in text.split(","))
    except ValueError:
        weights = ()
    if len(weights) not in WEIGHT_COUNTS:
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            "--weights",
            f"{text!r} is not three, five or six numbers, as in 1,1,1 or 1,1,1,0.5,0.5 or "
            "1,2,0.1,2,0.3,1",
        )
    return cast("RequestWeights", weights)
