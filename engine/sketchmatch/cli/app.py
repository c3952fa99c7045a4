"""The commands, and what becomes of their errors."""

from __future__ import annotations

import errno
import os
import sys
import traceback
import warnings
from enum import IntEnum
from typing import Annotated, NoReturn

import typer

import sketchmatch
from sketchmatch.cli import (
    config,
    demo,
    describe,
    health,
    interrupts,
    match,
    matches,
    output,
    plugins,
    relate,
    scenes,
    segment,
    serve,
    status,
    tokens,
    transfer,
)
from sketchmatch.errors import (
    AnswerUnavailableError,
    InvalidInputError,
    NotFoundError,
    PluginError,
    StoreError,
)

__all__ = ["ExitCode", "main"]

app = typer.Typer(
    name="sketchmatch",
    help="Match a hand-drawn sketch of a place with a robot's map of it, object by object.",
    invoke_without_command=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("match")(match.match)
app.command("segment")(segment.segment)
app.command("describe")(describe.describe)
app.command("relate")(relate.relate)
app.command("transfer")(transfer.transfer)
app.command("carry")(transfer.carry)
app.command("serve")(serve.serve)
app.command("health")(health.health)
app.command("status")(status.status)
app.command("demo")(demo.demo)
app.add_typer(plugins.app, name="plugins")
app.add_typer(config.app, name="config")
app.add_typer(tokens.app, name="tokens")
app.add_typer(scenes.app, name="scenes")
app.add_typer(matches.app, name="matches")


# A full disk, and what was closed before the command began.
_UNWRITABLE = {errno.ENOSPC, errno.EBADF}


class ExitCode(IntEnum):
    """What the exit code of a command means."""

    OK = 0
    UNFORESEEN = 1
    INVALID_INPUT = 2
    SERVER_UNAVAILABLE = 3
    NO_ANSWER_IN_TIME = 4
    ALGORITHM_FAILED = 5
    NOT_AUTHENTICATED = 6
    INTERRUPTED = 130


@app.callback()
def options(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    """Take the options that belong to no command."""
    if version:
        typer.echo(f"sketchmatch {sketchmatch.__version__}")
    elif context.invoked_subcommand is None:
        typer.echo(context.get_help())


def main() -> NoReturn:
    """Run the command line and exit; an error is one line on standard error."""
    # What gRPC's own library logs is for those who develop it.
    os.environ.setdefault("GRPC_VERBOSITY", "NONE")
    # An odd tag in a picture is no news to whoever drew it.
    warnings.filterwarnings("ignore", category=UserWarning, module=r"PIL\.")
    output.open_again()
    output.use_any_encoding()
    interrupts.listen()
    code, message = _run()
    if message:
        output.tell(f"sketchmatch: {message}")
    interrupts.settle()
    sys.exit(code)


def _run() -> tuple[int, str]:
    """Run the command line and return its exit code and what to say about it."""
    try:
        code = app(standalone_mode=False) or ExitCode.OK
        sys.stdout.flush()
        return code, "interrupted" if code == ExitCode.INTERRUPTED else ""
    except (typer.Abort, KeyboardInterrupt) as end:
        # Typer makes an abort of the end of a file, too.
        if isinstance(error := end.__cause__, EOFError):
            return _exit_code(error), _sentence(error)
        return ExitCode.INTERRUPTED, "interrupted"
    except (BrokenPipeError, SystemExit) as end:
        # Typer makes an exit of a broken pipe.
        if BrokenPipeError not in (type(end), type(end.__context__)):
            raise
        output.discard()  # whoever read standard output has had enough
        return ExitCode.OK, ""
    except Exception as error:
        if isinstance(error, OSError) and error.errno in _UNWRITABLE and not error.filename:
            output.discard()
            error = output.unwritable(error)
        return _exit_code(error), _sentence(error)


def _exit_code(error: Exception) -> ExitCode:
    if _is_usage_error(error):
        return ExitCode.INVALID_INPUT
    from sketchmatch_client import errors as client

    codes: dict[type[Exception], ExitCode] = {
        InvalidInputError: ExitCode.INVALID_INPUT,
        AnswerUnavailableError: ExitCode.NO_ANSWER_IN_TIME,
        PluginError: ExitCode.ALGORITHM_FAILED,
        NotFoundError: ExitCode.INVALID_INPUT,
        StoreError: ExitCode.INVALID_INPUT,
        client.InvalidRequestError: ExitCode.INVALID_INPUT,
        client.DeadlineExceededError: ExitCode.NO_ANSWER_IN_TIME,
        client.ServerUnavailableError: ExitCode.SERVER_UNAVAILABLE,
        client.ServerBusyError: ExitCode.SERVER_UNAVAILABLE,
        client.NotFoundError: ExitCode.INVALID_INPUT,
        client.NotAuthenticatedError: ExitCode.NOT_AUTHENTICATED,
        client.SketchmatchError: ExitCode.ALGORITHM_FAILED,
    }
    return next(
        (code for kind, code in codes.items() if isinstance(error, kind)), ExitCode.UNFORESEEN
    )


def _is_usage_error(error: Exception) -> bool:
    """Whether the command line itself is wrong; typer keeps the class of that to itself."""
    return hasattr(error, "format_message")


def _sentence(error: Exception) -> str:
    if _is_usage_error(error):
        problem = error.format_message()  # type: ignore[attr-defined]
        return output.clean(f"{problem.rstrip('.')}; see --help")
    if _exit_code(error) is not ExitCode.UNFORESEEN:
        return output.clean(str(error))
    if os.environ.get("SKETCHMATCH_DEBUG"):
        return "".join(traceback.format_exception(error)).rstrip()
    return output.clean(
        f"failed with an unexpected error ({type(error).__name__}: {error}); please report it, "
        "with what the same command prints if SKETCHMATCH_DEBUG=1 is set"
    )
