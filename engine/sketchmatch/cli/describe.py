"""``sketchmatch describe``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sketchmatch.cli.options import (
    Config,
    Histogram,
    JsonDocument,
    Profile,
    Settings,
    parse_pairs,
    parse_settings,
)

if TYPE_CHECKING:
    from sketchmatch.cli.inspection import Description

__all__ = ["describe"]


def describe(
    scene: Annotated[
        Path, typer.Argument(metavar="SCENE", help="A sketch or a map, as `match` takes them.")
    ],
    config: Config = None,
    profile: Profile = "",
    segmenter: Annotated[str, typer.Option(help="Segmenter; the file's kind decides.")] = "",
    histogram: Histogram = "",
    settings: Settings = None,
    pair: Annotated[
        list[str] | None,
        typer.Option(
            "--pair",
            metavar="A,B",
            help="Describe A as seen from B, numbers counted from 1 as in tables and pictures; "
            "may be repeated. All pairs if left out.",
        ),
    ] = None,
    json: JsonDocument = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Save the histograms: .npz or .csv."),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="FILE", help="Draw the histograms beside the scene."),
    ] = None,
) -> None:
    """Say how the objects of a scene lie to each other.

    Each line says of two objects that the first "is … the second", and the degree to which that
    describes the histogram of forces between them. On a terminal the table counts objects from 1,
    as pictures and --pair do; in a pipe the lines count from 0, as --json and --out do. Parameters
    are set as in --set histogram.directions=360.
    """
    from sketchmatch.cli import display, places

    pairs = parse_pairs(pair, "--pair")
    params = parse_settings(settings, ("segmenter", "histogram"))
    if out is not None:
        from sketchmatch.io import histogram_files

        histogram_files.check_histogram_path(out, "--out")
    if plot is not None:
        from sketchmatch.cli import pictures

        pictures.check_path(plot, "--plot")
    from sketchmatch.cli import inspection

    names = {"segmenter": segmenter, "histogram": histogram}
    with places.places_in(scene=scene):
        found = inspection.described(scene, names, params, pairs, profile, config)
    if json:
        display.print_document(_document(found))
    elif sys.stdout.isatty():
        _show_table(found)
    else:
        _print_lines(found)
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


def _print_lines(found: Description) -> None:
    print("a", "b", "phrase", "degree", "a_label", "b_label", sep="\t")
    for (a, b), relation in zip(found.pairs, found.relations, strict=True):
        names = (found.scene.labels[a], found.scene.labels[b])
        print(a, b, relation.phrase, f"{relation.degree:.4f}", *names, sep="\t")


def _show_table(found: Description) -> None:
    from rich.console import Console
    from rich.progress_bar import ProgressBar
    from rich.table import Table
    from rich.text import Text

    shown, labels = len(found.pairs), found.scene.labels
    title = f"{shown} relations of {len(labels)} objects, by {found.histogram.name}"
    table = Table(title=title, title_justify="left")
    for name in ("No.", "label", "is", "No.", "label", "degree"):
        table.add_column(name, justify="right" if name in ("No.", "degree") else "left")
    table.add_column("", width=12)
    for (a, b), relation in zip(found.pairs, found.relations, strict=True):
        table.add_row(
            str(a + 1),
            Text(labels[a]),
            Text(relation.phrase, style="" if relation.direction is not None else "dim"),
            str(b + 1),
            Text(labels[b]),
            f"{relation.degree:.3f}",
            ProgressBar(total=1.0, completed=relation.degree, width=12),
        )
    Console().print(table)
