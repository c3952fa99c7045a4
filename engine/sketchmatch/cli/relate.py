"""``sketchmatch relate``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sketchmatch.cli import options, output
from sketchmatch.cli.output import answering
from sketchmatch.errors import counted

if TYPE_CHECKING:
    from rich.text import Text

    from sketchmatch.cli.inspection import Listing
    from sketchmatch.cli.tables import Rows
    from sketchmatch.pipeline.result import Correspondence

__all__ = ["relate"]


@answering
def relate(
    sketch: options.SketchFile,
    map_: options.MapFile,
    sketch_pair: Annotated[
        list[str] | None,
        typer.Option(
            "--sketch-pair",
            metavar="A,B",
            help="Compare A as seen from B, numbered from 1 as in tables and pictures; all pairs "
            "by default. May be repeated.",
        ),
    ] = None,
    map_pair: Annotated[
        list[str] | None,
        typer.Option("--map-pair", metavar="C,D", help="The same for the map."),
    ] = None,
    config: options.Config = None,
    profile: options.Profile = "",
    histogram: options.Histogram = "",
    similarity: Annotated[
        str,
        typer.Option(
            help="Similarity measure; by default `cross-correlation` or the configured one."
        ),
    ] = "",
    sketch_segmenter: options.SketchSegmenter = "",
    map_segmenter: options.MapSegmenter = "",
    segmenter_sketch: options.FormerSketchSegmenter = "",
    segmenter_map: options.FormerMapSegmenter = "",
    settings: options.Settings = None,
    limit: Annotated[
        int, typer.Option(min=1, metavar="K", help="Show the K most similar comparisons.")
    ] = 20,
    json: options.JsonDocument = False,
    verbose: options.Verbose = False,
) -> None:
    """Compare relations of a sketch with relations of a map.

    Each line compares the relation of two sketched objects with that of two mapped ones: their
    similarity (σ), the counter-clockwise rotation in degrees from the sketched to the mapped one
    (R), and how much larger the mapped one is (L). Exchanging the objects of one pair keeps σ and
    L and changes R by 180°. The most similar come first. Tables and options number objects from 1;
    pipes and --json number them from 0.
    """
    from sketchmatch.cli import places

    pairs = (
        options.parse_pairs(sketch_pair, "--sketch-pair"),
        options.parse_pairs(map_pair, "--map-pair"),
    )
    names = {
        "sketch_segmenter": sketch_segmenter or segmenter_sketch,
        "map_segmenter": map_segmenter or segmenter_map,
        "histogram": histogram,
        "similarity": similarity,
    }
    params = options.parse_settings(settings, tuple(names))
    from sketchmatch.cli import inspection

    with places.places_in(sketch=sketch, map=map_):
        found = inspection.compared(
            sketch, map_, names, params, *pairs, limit, profile, config, verbose=verbose
        )
    if json:
        output.write_json(_document(found))
    elif output.for_people():
        output.show(_table(found))
    else:
        _write_lines(found)
    options.say_renamed(segmenter_sketch, segmenter_map)


def _document(found: Listing) -> dict[str, Any]:
    """Return all that was found; each comparison as the contract's ``FmapEntry``."""
    from sketchmatch.app import responses
    from sketchmatch.cli.display import chosen

    return {
        "histogram": chosen(found.histogram),
        "similarity": chosen(found.similarity),
        "sketchLabels": list(found.sketch.labels),
        "mapLabels": list(found.map.labels),
        "comparisonCount": found.total,
        "comparisons": [output.document_of(responses.fmap_entry(entry)) for entry in found.best],
    }


def _write_lines(found: Listing) -> None:
    names = ("a", "b", "c", "d")
    labels = [f"{name}_label" for name in names]
    output.write_line(*names, "similarity", "rotation_degrees", "dilation", *labels)
    for entry in found.best:
        output.write_line(
            *entry.sketch_pair,
            *entry.map_pair,
            f"{entry.similarity:.4f}",
            f"{_degrees(entry):.2f}",
            f"{entry.dilation:.4g}",
            *(found.sketch.labels[k] for k in entry.sketch_pair),
            *(found.map.labels[k] for k in entry.map_pair),
        )


def _table(found: Listing) -> Rows:
    from sketchmatch.cli.tables import Column, Rows, plain

    columns = [
        Column("in the sketch", least=13),
        Column("on the map", least=12),
        Column("σ", right=True),
        Column("R", right=True),
        Column("L", right=True),
    ]
    rows = [
        [
            _pair(entry.sketch_pair, found.sketch.labels),
            _pair(entry.map_pair, found.map.labels),
            plain(f"{entry.similarity:.3f}"),
            plain(f"{_degrees(entry):.1f}°"),
            plain(f"{entry.dilation:.3g}"),
        ]
        for entry in found.best
    ]
    shown = f"{len(found.best)} of " if len(found.best) < found.total else ""
    comparisons = f"{shown}{counted(found.total, 'comparison')}"
    title = f"{comparisons}, by {found.similarity.name} of {found.histogram.name}"
    return Rows(title, columns, rows)


def _pair(pair: tuple[int, int], labels: Sequence[str]) -> Text:
    """Return two objects for a table, the first as seen from the second."""
    from rich.text import Text

    from sketchmatch.cli.display import numbered

    return Text(", ").join(numbered(k, labels) for k in pair)


def _degrees(entry: Correspondence) -> float:
    """Return R in degrees, without a minus before what rounds to 0."""
    return round(math.degrees(entry.rotation), 2) + 0.0
