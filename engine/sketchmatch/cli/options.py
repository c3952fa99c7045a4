"""Options that several commands share, and how they are read."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import typer

from sketchmatch.errors import InvalidInputError, Reason

__all__ = ["Json", "MatchSettings", "Overlay", "Server", "Settings", "parse_settings", "say"]

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


def parse_settings(settings: Iterable[str] | None) -> dict[str, dict[str, Any]]:
    """Read ``stage.parameter=value`` settings; a value is JSON, or else a string.

    Raises
    ------
    InvalidInputError
        If one has another form.

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
        stages.setdefault(stage, {})[parameter] = value
    return stages


def say(sentence: str) -> None:
    """Tell the person at the terminal something that is not part of the answer."""
    typer.echo(f"sketchmatch: {sentence}", err=True)
    sys.stderr.flush()
