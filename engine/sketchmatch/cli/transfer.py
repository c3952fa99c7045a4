"""``sketchmatch transfer`` and ``sketchmatch carry``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from sketchmatch.cli import options
from sketchmatch.cli.output import answering
from sketchmatch.errors import InvalidInputError

if TYPE_CHECKING:
    from sketchmatch_client import TransferOptions

__all__ = ["carry", "transfer"]


class _Direction(StrEnum):
    SKETCH_TO_MAP = "sketch-to-map"
    MAP_TO_SKETCH = "map-to-sketch"


_Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="FILE",
        help="Save what was transferred (.geojson).",
        parser=options.to_path,
    ),
]
_Keepout = Annotated[
    Path | None,
    typer.Option(
        "--keepout",
        metavar="FILE",
        help="Save the zones as a mask for nav2's keep-out filter: .yaml, with a .pgm beside it.",
        parser=options.to_path,
    ),
]
_Waypoints = Annotated[
    Path | None,
    typer.Option(
        "--waypoints",
        metavar="FILE",
        help="Save points and routes as waypoints (.yaml), as nav2's RViz panel does.",
        parser=options.to_path,
    ),
]
_Radius = Annotated[
    float | None,
    typer.Option(
        metavar="METRES",
        min=0.0,
        help="Distance of routes from obstacles: half the robot's width; on a grid 0 by default.",
    ),
]
_AllowUnknown = Annotated[
    bool, typer.Option("--allow-unknown", help="Let routes cross unknown cells.")
]


@answering
@options.asking
def transfer(
    sketch: options.SketchFile,
    map_: options.MapFile,
    features: Annotated[
        Path | None,
        typer.Argument(
            metavar="[FEATURES]",
            help="Points, routes and zones: GeoJSON in the sketch's coordinates, y upwards; or a "
            "keep-out mask or waypoints of nav2. Not needed for a route drawn in the sketch.",
            parser=options.to_path,
        ),
    ] = None,
    server: options.Server = None,
    access: options.Access = options.Access(),  # noqa: B008
    config: options.Config = None,
    profile: options.Profile = "",
    search: options.Search = options.Search(),  # noqa: B008
    sketch_segmenter: options.SketchSegmenter = "",
    map_segmenter: options.MapSegmenter = "",
    settings: options.Settings = None,
    pin: options.Pins = None,
    no_pin: options.Exclusions = None,
    synonyms: options.Synonyms = None,
    direction: Annotated[
        _Direction, typer.Option(help="Direction of the transfer.")
    ] = _Direction.SKETCH_TO_MAP,
    radius: _Radius = None,
    allow_unknown: _AllowUnknown = False,
    out: _Out = None,
    keepout: _Keepout = None,
    waypoints: _Waypoints = None,
    json: options.Json = False,
    overlay: options.Overlay = None,
    verbose: options.Verbose = False,
) -> None:
    """Transfer points, routes and zones from a sketch to a map, or back.

    Routes are replanned where they would cross occupied or unknown cells of a robot's map. Every
    point has a standard deviation. On a terminal, prints a table; in a pipe, tab-separated lines:
    name, kind, standard deviation, points, changes.
    """
    from sketchmatch.cli import carried, pictures, places
    from sketchmatch.cli.answering import answerer
    from sketchmatch.cli.sources import source_or_stored
    from sketchmatch.transfers import files

    options.refuse_config(config, server)
    carried.check_targets(out, keepout, waypoints, sketch, map_, features)
    if overlay is not None:
        pictures.check_path(overlay, sketch, map_)
    known = options.parse_pins(pin, no_pin)
    forth = direction is _Direction.SKETCH_TO_MAP
    start, target = (sketch, map_) if forth else (map_, sketch)
    carried.check_keepout(keepout, target)
    chosen: TransferOptions = {
        **cast("TransferOptions", search.chosen()),
        "sketch_segmenter": sketch_segmenter,
        "map_segmenter": map_segmenter,
        "params": options.parse_settings(settings),
        "pins": list(known.values()),
        "synonyms": options.parse_synonyms(synonyms),
        "profile": profile,
        "direction": direction.value,
        "radius": radius,
        "allow_unknown": allow_unknown,
    }
    given = files.FeatureFile((), ())
    if features is not None:
        given = carried.read(features, start, verbose)
    with (
        places.places_in(sketch=sketch, map=map_),
        options.pins_as_typed(list(known)),
        answerer(server, config, access) as asked,
    ):
        sources = (
            source_or_stored(sketch, "sketch", asked),
            source_or_stored(map_, "map", asked),
        )
        with carried.places_of(features):
            answer = asked.transfer(*sources, carried.messages(given.features), **chosen)
    found = carried.Carriage.of(answer, given, forth)
    carried.save(found, target, out, keepout, waypoints)
    if overlay is not None:
        carried.draw(found, ("Sketch", "Map"), (sketch, map_), overlay)
    carried.show(found, json, verbose)


@answering
@options.asking
def carry(
    features: Annotated[
        Path,
        typer.Argument(
            metavar="FEATURES",
            help="Zones, routes and points on the old map: GeoJSON, a keep-out mask of nav2, or "
            "waypoints saved by its RViz panel.",
            parser=options.to_path,
        ),
    ],
    old: Annotated[
        Path,
        typer.Argument(
            metavar="OLD", help="Old map, in any format that `match` reads.", parser=options.to_path
        ),
    ],
    new: Annotated[
        Path,
        typer.Argument(metavar="NEW", help="New map of the same place.", parser=options.to_path),
    ],
    server: options.Server = None,
    access: options.Access = options.Access(),  # noqa: B008
    config: options.Config = None,
    profile: options.Profile = "",
    search: options.Search = options.Search(),  # noqa: B008
    segmenter: Annotated[
        str,
        typer.Option(
            help="Segmenter of both maps; by default objects or rooms, whichever gives more "
            "information."
        ),
    ] = "",
    settings: options.Settings = None,
    pin: options.Pins = None,
    no_pin: options.Exclusions = None,
    synonyms: options.Synonyms = None,
    radius: _Radius = None,
    allow_unknown: _AllowUnknown = False,
    out: _Out = None,
    keepout: _Keepout = None,
    waypoints: _Waypoints = None,
    json: options.Json = False,
    overlay: options.Overlay = None,
    verbose: options.Verbose = False,
) -> None:
    """Transfer names, zones, routes and points from an old map to a new one of the same place.

    The new map may have another origin, be rotated, and show some objects elsewhere. Names in the
    old map's own file are transferred too. What cannot be transferred is reported.
    """
    from sketchmatch.cli import carried, pictures, places
    from sketchmatch.cli.answering import answerer
    from sketchmatch.cli.sources import in_metres, source_or_stored
    from sketchmatch_client import InvalidRequestError

    options.refuse_config(config, server)
    carried.check_targets(out, keepout, waypoints, old, new, features)
    if overlay is not None:
        pictures.check_path(overlay, old, new)
    carried.check_keepout(keepout, new)
    known = options.parse_pins(pin, no_pin)
    given = carried.read(features, old, verbose) + carried.named_in(old)
    with (
        places.places_in(sketch=old, map=new),
        options.pins_as_typed(list(known)),
        answerer(server, config, access) as asked,
    ):
        sources = (
            source_or_stored(old, "old map", asked),
            source_or_stored(new, "new map", asked),
        )
        grids = all(map(in_metres, sources))
        answers, problems = [], []
        for name in carried.segmenters(segmenter, grids and not known):
            chosen: TransferOptions = {
                **cast("TransferOptions", search.chosen()),
                "sketch_segmenter": name,
                "map_segmenter": name,
                "params": options.parse_settings(settings),
                "pins": list(known.values()),
                "synonyms": options.parse_synonyms(synonyms),
                "profile": profile,
                "radius": radius,
                "allow_unknown": allow_unknown,
            }
            try:
                with carried.places_of(features):
                    answers.append(
                        asked.transfer(*sources, carried.messages(given.features), **chosen)
                    )
            except (InvalidInputError, InvalidRequestError) as error:
                problems.append(error)
        if not answers:
            raise problems[0]
    found = carried.Carriage.of(min(answers, key=carried.unsureness), given, forth=True)
    carried.save(found, new, out, keepout, waypoints)
    if overlay is not None:
        carried.draw(found, ("Old map", "New map"), (old, new), overlay)
    carried.show(found, json, verbose)
