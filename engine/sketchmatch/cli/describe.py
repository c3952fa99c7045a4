"""``sketchmatch describe``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sketchmatch.cli import options, output
from sketchmatch.cli.output import answering
from sketchmatch.errors import counted

if TYPE_CHECKING:
    from sketchmatch.cli.inspection import Description
    from sketchmatch.cli.tables import Rows

__all__ = ["describe"]


@answering
def describe(
    scene: Annotated[
        Path,
        typer.Argument(
            metavar="SCENE",
            help="Sketch or map, in any format that `match` reads.",
            parser=options.to_path,
        ),
    ],
    config: options.Config = None,
    profile: options.Profile = "",
    segmenter: Annotated[
        str, typer.Option(help="Segmenter; depends on the kind of file by default.")
    ] = "",
    histogram: options.Histogram = "",
    settings: options.Settings = None,
    pair: Annotated[
        list[str] | None,
        typer.Option(
            "--pair",
            metavar="A,B",
            help="Describe A as seen from B, numbered from 1 as in tables and pictures; all pairs "
            "by default. May be repeated.",
        ),
    ] = None,
    json: options.JsonDocument = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="Save the histograms (.npz or .csv).",
            parser=options.to_path,
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot",
            metavar="FILE",
            help="Draw the histograms beside the scene.",
            parser=options.to_path,
        ),
    ] = None,
    verbose: options.Verbose = False,
) -> None:
    """Describe how the objects of a scene lie relative to each other.

    Each line states that one object "is … the other", and the degree to which that describes the
    histogram of forces between them. Tables, pictures and --pair number objects from 1; pipes,
    --json and --out number them from 0. Set parameters as in --set histogram.directions=360.
    """
    from sketchmatch.cli import places

    pairs = options.parse_pairs(pair, "--pair")
    params = options.parse_settings(settings, ("segmenter", "histogram"))
    if out is not None:
        from sketchmatch.io import histogram_files

        histogram_files.check_histogram_path(out, "--out")
    if plot is not None:
        from sketchmatch.cli import pictures

        pictures.check_path(plot, scene, field="--plot")
    from sketchmatch.cli import inspection

    names = {"segmenter": segmenter, "histogram": histogram}
    with places.places_in(scene=scene):
        found = inspection.described(scene, names, params, pairs, profile, config, verbose=verbose)
    if out is not None:
        histogram_files.save_histograms(
            out,
            histogram_files.HistogramTable(
                found.histograms,
                found.pairs,
                found.scene.labels,
                found.histogram.name,
                found.histogram.exponent,
            ),
            "--out",
        )
    if plot is not None:
        pictures.draw_description(found, scene, plot)
    if json:
        output.write_json(_document(found))
    elif output.for_people():
        output.show(_table(found))
    else:
        _write_lines(found)


def _document(found: Description) -> dict[str, Any]:
    """Return all that was found, in the names of the contract where it has them."""
    from sketchmatch.cli.display import chosen

    lines = zip(found.pairs, found.relations, found.directions.tolist(), strict=True)
    return {
        "segmenter": chosen(found.segmenter),
        "histogram": chosen(found.histogram),
        "labels": list(found.scene.labels),
        "relations": [
            {
                "pair": {"first": a, "second": b},
                "phrase": relation.phrase,
                "degree": relation.degree,
                "directionRadians": relation.direction,
                "mainDirectionRadians": main,
            }
            for (a, b), relation, main in lines
        ],
    }


def _write_lines(found: Description) -> None:
    output.write_line("a", "b", "phrase", "degree", "a_label", "b_label")
    for (a, b), relation in zip(found.pairs, found.relations, strict=True):
        names = (found.scene.labels[a], found.scene.labels[b])
        output.write_line(a, b, relation.phrase, f"{relation.degree:.4f}", *names)


def _table(found: Description) -> Rows:
    from sketchmatch.cli.display import numbered
    from sketchmatch.cli.tables import Column, Rows, plain

    relations, labels = counted(len(found.pairs), "relation"), found.scene.labels
    columns = [
        Column("object", least=12),
        Column("is", least=12),
        Column("object", least=12),
        Column("degree", right=True),
    ]
    rows = [
        [
            numbered(a, labels),
            plain(relation.phrase, "" if relation.direction is not None else "dim"),
            numbered(b, labels),
            plain(f"{relation.degree:.3f}"),
        ]
        for (a, b), relation in zip(found.pairs, found.relations, strict=True)
    ]
    title = f"{relations} of {len(labels)} objects, by {found.histogram.name}"
    return Rows(title, columns, rows)
