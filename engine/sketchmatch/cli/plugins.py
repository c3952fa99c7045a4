"""``sketchmatch plugins``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sketchmatch.cli import new, output
from sketchmatch.cli.options import Access, Config, Json, Server, asking, refuse_config
from sketchmatch.cli.output import answering
from sketchmatch.errors import InvalidInputError, Reason, quoted

if TYPE_CHECKING:
    from sketchmatch_proto.v1.catalog_service_pb2 import Algorithm, ListAlgorithmsResponse

__all__ = ["app"]

app = typer.Typer(
    help="List and describe algorithms, create and check plugins.", rich_markup_mode="markdown"
)
app.command("new")(new.new)

_Kind = Annotated[
    str,
    typer.Option(
        "--kind",
        metavar="KIND",
        help="Only this kind: segmenter, histogram, similarity, searcher or judge.",
    ),
]


@app.callback()
def plugins() -> None:
    """List and describe algorithms, create and check plugins."""


@app.command("list")
@answering
@asking
def list_(
    kind: _Kind = "",
    server: Server = None,
    access: Access = Access(),  # noqa: B008
    config: Config = None,
    json: Json = False,
) -> None:
    """List algorithms, profiles, the state of each plugin, and file readers.

    In a pipe, prints four tables of tab-separated lines, separated by empty lines.
    """
    from sketchmatch.cli import listing

    found = _catalogue(kind, server, access, config)
    if json:
        output.write_message(found)
    else:
        listing.show_catalogue(found)


@app.command("show")
@answering
@asking
def show(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of an algorithm.")],
    kind: _Kind = "",
    server: Server = None,
    access: Access = Access(),  # noqa: B008
    config: Config = None,
    json: Json = False,
) -> None:
    """Describe one algorithm: what it does, its publications and its parameters."""
    from sketchmatch.cli import listing

    item = _named(_catalogue(kind, server, access, config), name, kind)
    if json:
        output.write_message(item)
    else:
        listing.show_algorithm(item)


@app.command("check")
@answering
def check(
    distribution: Annotated[
        str,
        typer.Argument(
            metavar="DISTRIBUTION", help="Name of the distribution for pip, e.g. sketchmatch-tabu."
        ),
    ],
    time_limit: Annotated[
        float,
        typer.Option(
            "--time-limit",
            metavar="SECONDS",
            min=0.001,
            max=86400.0,
            help="Time limit of one check; five times as long for a warm-up, which compiles.",
        ),
    ] = 120.0,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """Check that the algorithms of an installed distribution keep the contracts of their kinds.

    Lists each check with its result, duration and a sentence. A check that exceeds the time limit
    is stopped. The exit code is 0 if none failed, otherwise 5.
    """
    from sketchmatch.cli import checks
    from sketchmatch.cli.app import ExitCode
    from sketchmatch.testing.conformance.apart import check_distribution

    results = check_distribution(distribution, time_limit)
    if not checks.show(distribution, results, as_json=json):
        raise typer.Exit(ExitCode.ALGORITHM_FAILED)


@app.command("reference")
@answering
def reference(
    distribution: Annotated[
        str, typer.Option(metavar="NAME", help="Python distribution that offers them.")
    ] = "sketchmatch",
) -> None:
    """Print the reference page of a distribution's algorithms, in Markdown."""
    from sketchmatch.app import responses
    from sketchmatch.cli import reference
    from sketchmatch.registry import discover

    # Whatever the configuration says, the page tells what the classes say.
    output.write(reference.page(responses.catalogue(discover()), distribution))


def _catalogue(
    kind: str, server: str | None, access: Access, config: Path | None
) -> ListAlgorithmsResponse:
    """Return what there is here or on a server, of one kind or of all."""
    from sketchmatch.cli import catalogue

    if kind and kind not in catalogue.KINDS:
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            "--kind",
            f"is {quoted(kind)}; choose one of: {', '.join(catalogue.KINDS)}",
        )
    found = _everything(server, access, config)
    if kind:
        kept = [item for item in found.algorithms if catalogue.kind(item) == kind]
        del found.algorithms[:]
        found.algorithms.extend(kept)
    return found


def _everything(server: str | None, access: Access, config: Path | None) -> ListAlgorithmsResponse:
    from sketchmatch.cli.answering import answerer

    refuse_config(config, server)
    with answerer(server, config, access) as asked:
        return asked.algorithms()


def _named(found: ListAlgorithmsResponse, name: str, kind: str) -> Algorithm:
    """Return the algorithm of a name.

    Raises
    ------
    InvalidInputError
        If there is none, or if there are several.
    """
    from sketchmatch.cli import catalogue
    from sketchmatch.registry import OWN_DISTRIBUTION

    items = [item for item in found.algorithms if item.name == name]
    own = [item for item in items if item.distribution == OWN_DISTRIBUTION]
    kinds = {catalogue.kind(item) for item in items}
    if not items:
        problem = f"is not {f'a {kind}' if kind else 'an algorithm'}; {_nearest(found, name)}"
    elif len(kinds) > 1:
        problem = f"is a {' and a '.join(sorted(kinds))}; say which with --kind"
    elif len(items) > 1 and not own:
        owners = " and ".join(map(catalogue.origin, items))
        problem = f"is offered by {owners}, so it cannot be selected; uninstall one of them"
    else:
        return (own or items)[0]
    raise InvalidInputError(Reason.UNKNOWN_ALGORITHM, quoted(name), problem)


def _nearest(found: ListAlgorithmsResponse, name: str) -> str:
    from difflib import get_close_matches

    known = dict.fromkeys(item.name for item in found.algorithms)
    close = get_close_matches(name, known, cutoff=0.5)
    if close:
        return f"the nearest names are: {', '.join(close)}"
    return f"choose one of: {', '.join(known) or 'none'}"
