"""``sketchmatch matches``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from sketchmatch.cli import options, output
from sketchmatch.cli.output import answering

if TYPE_CHECKING:
    from google.protobuf.message import Message

    from sketchmatch_proto.v1.match_service_pb2 import MatchSummary

__all__ = ["app"]

app = typer.Typer(
    help="List, show, watch and cancel your matches on a server.", rich_markup_mode="markdown"
)

_Name = Annotated[
    str, typer.Argument(metavar="MATCH", help="Name of the match, as `matches list` shows it.")
]


@app.callback()
def matches() -> None:
    """List, show, watch and cancel your matches on a server.

    A server keeps matches after their end, and shows each only to the caller who started it.
    """


@app.command("list")
@answering
@options.asking
def list_(
    server: options.OwnServer = options.HERE,
    access: options.Access = options.Access(),  # noqa: B008
    limit: Annotated[int, typer.Option(min=1, help="Largest number of matches.")] = 20,
    timeout: options.Timeout = 10.0,
    json: options.JsonDocument = False,
) -> None:
    """List your matches, the latest first: name, state, outcome, start time, error."""
    from itertools import islice

    from sketchmatch.cli.answering import client_of

    with client_of(server, "--server", access) as client:
        found = list(islice(client.matches(timeout=timeout), limit))
    if json:
        output.write_json({"matches": [_document(match) for match in found]})
        return
    for match in found:
        output.write_line(*_line(match))


@app.command("show")
@answering
@options.asking
def show(
    name: _Name,
    server: options.OwnServer = options.HERE,
    access: options.Access = options.Access(),  # noqa: B008
    timeout: options.Timeout = 10.0,
    json: Annotated[
        bool,
        typer.Option("--json", help="Print the gRPC contract's message in JSON, with all events."),
    ] = False,
) -> None:
    """Show the state of a match, and its answer if it has one."""
    from sketchmatch.cli import display
    from sketchmatch.cli.answering import client_of
    from sketchmatch_client import MatchCollector

    with client_of(server, "--server", access) as client:
        found = client.get_match(name, timeout=timeout)
    if json:
        output.write_message(found)
        return
    collector = MatchCollector(None)
    for event in found.events:
        collector.add(event)
    if collector.complete:
        display.show_match(collector.match(), metres=False, verbose=False)
    else:
        output.write_line(*_line(found.match))


@app.command("watch")
@answering
@options.asking
def watch(
    name: _Name,
    server: options.OwnServer = options.HERE,
    access: options.Access = options.Access(),  # noqa: B008
    json: options.Json = False,
) -> None:
    """Follow a match to its end, then show its answer; at once if it has ended."""
    from sketchmatch.cli import display
    from sketchmatch.cli.answering import client_of

    with client_of(server, "--server", access) as client:
        answer = display.watch(client.watch(name))
    if json:
        output.write_message(answer.result)
    else:
        display.show_match(answer, metres=False, verbose=False)


@app.command("cancel")
@answering
@options.asking
def cancel(
    name: _Name,
    server: options.OwnServer = options.HERE,
    access: options.Access = options.Access(),  # noqa: B008
    timeout: options.Timeout = 10.0,
) -> None:
    """Stop a match; one that has ended stays as it is."""
    from sketchmatch.cli.answering import client_of

    with client_of(server, "--server", access) as client:
        output.write_line(*_line(client.cancel_match(name, timeout=timeout)))


def _line(match: MatchSummary) -> tuple[str, ...]:
    from sketchmatch_proto.v1.match_pb2 import Outcome
    from sketchmatch_proto.v1.match_service_pb2 import MatchState

    state = MatchState.Name(match.state).removeprefix("MATCH_STATE_")
    outcome = Outcome.Name(match.outcome).removeprefix("OUTCOME_") if match.outcome else "-"
    began = match.created_at.ToDatetime().isoformat(timespec="seconds")
    return match.match_id, state, outcome, f"{began}Z", output.clean(match.error_message)


def _document(match: Message) -> dict[str, object]:
    from google.protobuf.json_format import MessageToDict

    return MessageToDict(match)
