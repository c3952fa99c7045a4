"""``sketchmatch health``."""

from __future__ import annotations

from typing import Annotated

import typer

from sketchmatch.cli import options, output
from sketchmatch.cli.output import answering

__all__ = ["health"]


@answering
@options.asking
def health(
    address: options.Address,
    access: options.Access = options.Access(),  # noqa: B008
    of: Annotated[
        str,
        typer.Option(
            "--of",
            metavar="NAME",
            help="Ask of a service, as in sketchmatch.v1.MatchService, or an algorithm, as in "
            "searcher/easm.",
        ),
    ] = "",
    timeout: options.Timeout = 5.0,
) -> None:
    """Say whether a server serves: the exit code is 0 if it does, and 3 otherwise.

    It needs no token, and is made for containers and scripts; `sketchmatch status` tells more.
    """
    from sketchmatch.cli.answering import client_of, naming
    from sketchmatch.cli.app import ExitCode

    with client_of(address, "ADDRESS", access) as client, naming({"name": "--of"}):
        serving = client.is_serving(of, timeout=timeout)
    output.write_line("SERVING" if serving else "NOT_SERVING")
    if not serving:
        raise typer.Exit(ExitCode.SERVER_UNAVAILABLE)
