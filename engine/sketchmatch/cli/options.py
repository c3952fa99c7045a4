"""Options that several commands share, and how they are read."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import typer

from sketchmatch.errors import InvalidInputError, Reason

__all__ = [
    "Histogram",
    "Json",
    "JsonDocument",
    "MatchSettings",
    "Overlay",
    "Server",
    "Settings",
    "parse_pairs",
    "parse_settings",
    "say",
]

Server = Annotated[
    str | None,
    typer.Option(
        "--server", metavar="HOST:PORT", help="Ask this server instead of computing here."
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
Histogram = Annotated[str, typer.Option(help="Histogram; `constant` by default.")]
Overlay = Annotated[
    Path | None, typer.Option("--overlay", metavar="FILE", help="Draw the answer into a picture.")
]


@dataclass(frozen=True)
class MatchSettings:
    """How to match, as the command line says it.

    Attributes
    ----------
    names
        Algorithm by stage; empty for the default.
    params
        Parameters by stage, where some were set.
    seed, time_budget, weights, alternatives
        As in :class:`sketchmatch.pipeline.match.MatchRequest`.
    """

    names: Mapping[str, str] = field(default_factory=dict)
    params: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    seed: int = 0
    time_budget: float | None = None
    weights: tuple[float, float, float] = (1.0, 1.0, 1.0)
    alternatives: int | None = None


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
        try:
            value = json.loads(text)
        except ValueError:
            value = text
        if allowed and stage not in allowed:
            known = " or ".join(f"{name}.…" for name in allowed)
            raise InvalidInputError(
                Reason.INVALID_PARAMETER, "--set", f"{stage!r} is no stage here; use {known}"
            )
        stages.setdefault(stage, {})[parameter] = value
    return stages


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


def say(sentence: str) -> None:
    """Tell the person at the terminal something that is not part of the answer."""
    typer.echo(f"sketchmatch: {sentence}", err=True)
    sys.stderr.flush()
