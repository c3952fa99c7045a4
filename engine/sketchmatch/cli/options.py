"""Options that several commands share, and how they are read."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from sketchmatch.cli.output import clean, tell
from sketchmatch.errors import InvalidInputError, Reason

__all__ = [
    "Config",
    "FormerMapSegmenter",
    "FormerSketchSegmenter",
    "Histogram",
    "Json",
    "JsonDocument",
    "MapSegmenter",
    "Overlay",
    "Profile",
    "Server",
    "Settings",
    "SketchSegmenter",
    "Verbose",
    "parse_pairs",
    "parse_settings",
    "refuse_config",
    "say",
    "say_renamed",
]

Server = Annotated[
    str | None,
    typer.Option(
        "--server",
        metavar="ADDRESS",
        help="Ask the server at this HOST:PORT or unix:PATH instead of computing here.",
    ),
]
Config = Annotated[
    Path | None,
    typer.Option(
        "--config",
        metavar="FILE",
        help="Configuration; sketchmatch.toml here or in your configuration folder by default.",
    ),
]
Profile = Annotated[
    str,
    typer.Option(
        "--profile",
        metavar="NAME",
        help="Start from this pipeline: proof, thesis, thesis-easm, thesis-fsnn or one of your "
        "own.",
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="STAGE.PARAMETER=VALUE",
        help="Set a parameter, e.g. searcher.population=400; may be repeated. "
        "`sketchmatch plugins list` shows what there is.",
    ),
]
Json = Annotated[
    bool, typer.Option("--json", help="Print the answer as the contract's message in JSON.")
]
JsonDocument = Annotated[
    bool, typer.Option("--json", help="Print one JSON document, which counts objects from 0.")
]
SketchSegmenter = Annotated[
    str, typer.Option("--sketch-segmenter", help="Segmenter of the sketch; its form decides.")
]
MapSegmenter = Annotated[
    str, typer.Option("--map-segmenter", help="Segmenter of the map; its form decides.")
]
FormerSketchSegmenter = Annotated[str, typer.Option("--segmenter-sketch", hidden=True)]
FormerMapSegmenter = Annotated[str, typer.Option("--segmenter-map", hidden=True)]
Histogram = Annotated[
    str, typer.Option(help="Histogram; `constant` unless the configuration names another.")
]
Overlay = Annotated[
    Path | None, typer.Option("--overlay", metavar="FILE", help="Draw the answer into a picture.")
]

Verbose = Annotated[
    bool,
    typer.Option(
        "--verbose", "-v", help="Tell all that was noted in the files, not one note of each kind."
    ),
]


def parse_settings(
    settings: Iterable[str] | None, allowed: Sequence[str] = ()
) -> dict[str, dict[str, Any]]:
    """Read ``stage.parameter=value`` settings; a value is JSON, or else a string.

    Parameters
    ----------
    settings
        As typed.
    allowed
        The stages that the command has; all if left out.

    Raises
    ------
    InvalidInputError
        If one has another form, or is for another stage.

    Examples
    --------
    >>> parse_settings(["searcher.population=400", "searcher.consistency=pairwise"])
    {'searcher': {'population': 400, 'consistency': 'pairwise'}}
    """
    from sketchmatch.config import value_of

    stages: dict[str, dict[str, Any]] = {}
    for setting in settings or ():
        name, equals, text = setting.partition("=")
        stage, dot, parameter = name.partition(".")
        if not (equals and dot and stage and parameter):
            raise InvalidInputError(
                Reason.INVALID_PARAMETER,
                "--set",
                f"{setting!r} has another form than STAGE.PARAMETER=VALUE, "
                "as in searcher.population=400",
            )
        if allowed and stage not in allowed:
            known = " or ".join(f"{name}.…" for name in allowed)
            raise InvalidInputError(
                Reason.INVALID_PARAMETER, "--set", f"{stage!r} is no stage here; use {known}"
            )
        stages.setdefault(stage, {})[parameter] = value_of(text)
    return stages


def refuse_config(config: Path | None, server: str | None) -> None:
    """Refuse a configuration for an answer that is another's.

    Raises
    ------
    InvalidInputError
        If there is one, and a server.
    """
    if config is not None and server is not None:
        problem = "is for computing here, and the server has one of its own; drop one of the two"
        raise InvalidInputError(Reason.INVALID_FIELD, "--config", problem)


def parse_pairs(texts: Iterable[str] | None, option: str) -> list[tuple[int, int]]:
    """Read pairs of objects, numbered from 1 as tables and pictures do, and count them from 0.

    Raises
    ------
    InvalidInputError
        If one has another form or names one object twice.

    Examples
    --------
    >>> parse_pairs(["3,1"], "--pair")
    [(2, 0)]
    """
    pairs = []
    for text in texts or ():
        try:
            a, b = (int(part) for part in text.split(","))
        except ValueError:
            raise InvalidInputError(
                Reason.INVALID_FIELD, option, f"{text!r} is not two numbers of objects, as in 3,1"
            ) from None
        if a == b:
            raise InvalidInputError(
                Reason.INVALID_FIELD, option, f"{text!r} names one object twice; give two objects"
            )
        pairs.append((a - 1, b - 1))
    return pairs


def say_renamed(sketch_segmenter: str, map_segmenter: str) -> None:
    """Tell that a segmenter was chosen by an option's former name, after what was asked for."""
    for side, given in (("sketch", sketch_segmenter), ("map", map_segmenter)):
        if given:
            say(f"--segmenter-{side} is deprecated; write --{side}-segmenter")


def say(sentence: str) -> None:
    """Tell the person at the terminal something that is not part of the answer."""
    tell(f"sketchmatch: {clean(sentence)}")
