"""``sketchmatch health``."""

from __future__ import annotations

from typing import Annotated

import typer

from sketchmatch.cli import options, output
from sketchmatch.cli.output import answering
from sketchmatch.errors import InvalidInputError, Reason

__all__ = ["health"]


@answering
@options.asking
def health(
    address: Annotated[
        str,
        typer.Argument(
            metavar="ADDRESS",
            help="Address of the server: HOST:PORT or unix:PATH; or http://HOST:PORT of its "
            "metrics, which needs no certificate.",
        ),
    ],
    access: options.Access = options.Access(),  # noqa: B008
    of: Annotated[
        str,
        typer.Option(
            "--of",
            metavar="NAME",
            help="Check one service, e.g. sketchmatch.v1.MatchService, or one algorithm, e.g. "
            "searcher/easm.",
        ),
    ] = "",
    timeout: options.Timeout = 5.0,
) -> None:
    """Check whether a server serves: the exit code is 0 if it does, otherwise 3.

    For containers and scripts; needs no token. `sketchmatch status` shows more.
    """
    from sketchmatch.cli.app import ExitCode

    if address.startswith("http://"):
        serving = _is_ready(address, of, timeout)
    else:
        from sketchmatch.cli.answering import client_of, naming

        with client_of(address, "ADDRESS", access) as client, naming({"name": "--of"}):
            serving = client.is_serving(of, timeout=timeout)
    output.write_line("SERVING" if serving else "NOT_SERVING")
    if not serving:
        raise typer.Exit(ExitCode.SERVER_UNAVAILABLE)


def _is_ready(address: str, of: str, timeout: float) -> bool:
    """Return whether the probe over HTTP says so."""
    from http import HTTPStatus
    from http.client import HTTPException
    from urllib.error import HTTPError
    from urllib.request import ProxyHandler, build_opener

    from sketchmatch_client import ServerUnavailableError

    if of:
        problem = "cannot be asked over HTTP; give HOST:PORT of the server itself"
        raise InvalidInputError(Reason.INVALID_FIELD, "--of", problem)
    try:
        # No proxy leads to where a probe is.
        with build_opener(ProxyHandler({})).open(f"{address.rstrip('/')}/readyz", timeout=timeout):
            return True
    except (OSError, HTTPException, ValueError) as error:
        if isinstance(error, HTTPError):
            error.close()
            if error.code == HTTPStatus.SERVICE_UNAVAILABLE:
                return False
        problem = f"{address} does not answer whether the server serves ({error})"
        remedy = "check the address, or start the server with --metrics-address"
        raise ServerUnavailableError(f"{problem}; {remedy}") from None
