"""``sketchmatch relate``."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sketchmatch.cli.options import (
    Config,
    FormerMapSegmenter,
    FormerSketchSegmenter,
    Histogram,
    JsonDocument,
    MapSegmenter,
    Profile,
    Settings,
    SketchSegmenter,
    parse_pairs,
    parse_settings,
    say_renamed,
)

if TYPE_CHECKING:
    from sketchmatch.cli.inspection import Listing
    from sketchmatch.pipeline.result import Correspondence

__all__ = ["relate"]


def relate(
    sketch: Annotated[Path, typer.Argument(metavar="SKETCH", help="Sketch, as `match` takes it.")],
    map_: Annotated[Path, typer.Argument(metavar="MAP", help="Map, as `match` takes it.")],
    sketch_pair: Annotated[
        list[str] | None,
        typer.Option(
            "--sketch-pair",
            metavar="A,B",
            help="Compare A as seen from B, numbers counted from 1 as in tables and pictures; "
            "may be repeated. All pairs if left out.",
        ),
    ] = None,
    map_pair: Annotated[
        list[str] | None,
        typer.Option("--map-pair", metavar="C,D", help="The same on the map."),
    ] = None,
    config: Config = None,
    profile: Profile = "",
    histogram: Histogram = "",
    similarity: Annotated[
        str,
        typer.Option(
            help="Similarity measure; `cross-correlation` unless the configuration names another."
        ),
    ] = "",
    sketch_segmenter: SketchSegmenter = "",
    map_segmenter: MapSegmenter = "",
    segmenter_sketch: FormerSketchSegmenter = "",
    segmenter_map: FormerMapSegmenter = "",
    settings: Settings = None,
    limit: Annotated[
        int, typer.Option(min=1, metavar="K", help="Show the K most similar ones.")
    ] = 20,
    json: JsonDocument = False,
) -> None:
    """Compare relations of a sketch with relations of a map.

    Each line compares two sketched objects with two mapped ones: how similar the relations are
    (σ), by how many degrees the sketched one is turned counter-clockwise to lie like the mapped
    one (R), and how much larger the mapped one is (L). With the objects of one pair exchanged, σ
    and L stay and R turns by 180°. The most similar come first. On a terminal the table counts
    objects from 1, as pictures and the options do; in a pipe the lines count from 0, as --json
    does.
    """
    from sketchmatch.cli import places

    pairs = (parse_pairs(sketch_pair, "--sketch-pair"), parse_pairs(map_pair, "--map-pair"))
    names = {
        "sketch_segmenter": sketch_segmenter or segmenter_sketch,
        "map_segmenter": map_segmenter or segmenter_map,
        "histogram": histogram,
        "similarity": similarity,
    }
    params = parse_settings(settings, tuple(names))
    from sketchmatch.cli import display, inspection

    with places.places_in(sketch=sketch, map=map_):
        found = inspection.compared(sketch, map_, names, params, *pairs, limit, profile, config)
    if json:
        display.print_document(_document(found))
    elif sys.stdout.isatty():
        _show_table(found)
    else:
        _print_lines(found)
    say_renamed(segmenter_sketch, segmenter_map)


def _document(found: Listing) -> dict[str, Any]:
    """Return all that was found; each comparison as the contract's ``FmapEntry``."""
    from google.protobuf.json_format import MessageToDict

    from sketchmatch.app import responses
    from sketchmatch.cli.display import chosen

    return {
        "histogram": chosen(found.histogram),
        "similarity": chosen(found.similarity),
        "sketchLabels": list(found.sketch.labels),
        "mapLabels": list(found.map.labels),
        "comparisonCount": found.total,
        "comparisons": [
            MessageToDict(responses.fmap_entry(entry), always_print_fields_with_no_presence=True)
            for entry in found.best
        ],
    }


def _print_lines(found: Listing) -> None:
    names = ("a", "b", "c", "d")
    labels = [f"{name}_label" for name in names]
    print(*names, "similarity", "rotation_degrees", "dilation", *labels, sep="\t")
    for entry in found.best:
        print(
            *entry.sketch_pair,
            *entry.map_pair,
            f"{entry.similarity:.4f}",
            f"{_degrees(entry):.2f}",
            f"{entry.dilation:.4g}",
            *(found.sketch.labels[k] for k in entry.sketch_pair),
            *(found.map.labels[k] for k in entry.map_pair),
            sep="\t",
        )


def _show_table(found: Listing) -> None:
    from rich.console import Console
    from rich.progress_bar import ProgressBar
    from rich.table import Table
    from rich.text import Text

    shown = f"{len(found.best)} of {found.total}" if len(found.best) < found.total else found.total
    title = f"{shown} comparisons, by {found.similarity.name} of {found.histogram.name}"
    table = Table(title=title, title_justify="left")
    for side, scene in (("sketch", found.sketch), ("map", found.map)):
        table.add_column(f"No. {'in' if side == 'sketch' else 'on'} {side}", justify="right")
        if any(scene.labels):
            table.add_column("labels")
    table.add_column("σ", justify="right")
    table.add_column("", width=12)
    table.add_column("R", justify="right")
    table.add_column("L", justify="right")
    for entry in found.best:
        cells = []
        for scene, (a, b) in ((found.sketch, entry.sketch_pair), (found.map, entry.map_pair)):
            cells.append(Text(f"{a + 1}, {b + 1}"))
            if any(scene.labels):
                cells.append(Text(", ".join(filter(None, (scene.labels[a], scene.labels[b])))))
        table.add_row(
            *cells,
            f"{entry.similarity:.3f}",
            ProgressBar(total=1.0, completed=entry.similarity, width=12),
            f"{_degrees(entry):.1f}°",
            f"{entry.dilation:.3g}",
        )
    Console().print(table)


def _degrees(entry: Correspondence) -> float:
    """Return R in degrees, without a minus before what rounds to 0."""
    return round(math.degrees(entry.rotation), 2) + 0.0
