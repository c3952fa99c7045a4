"""``sketchmatch tokens``."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sketchmatch.cli import output
from sketchmatch.cli.options import Config, say, to_path
from sketchmatch.cli.output import answering
from sketchmatch.errors import InvalidInputError, Reason, quoted

if TYPE_CHECKING:
    from sketchmatch.server.tokens import KnownToken

__all__ = ["app"]

app = typer.Typer(
    help="Create, list and remove the tokens that admit callers to a server.",
    rich_markup_mode="markdown",
)

_Name = Annotated[str, typer.Argument(metavar="NAME", help="Name of the caller, e.g. robot-7.")]
_File = Annotated[
    Path | None,
    typer.Option(
        "--file",
        metavar="FILE",
        help="Token file; by default the configured one.",
        parser=to_path,
    ),
]


@app.callback()
def tokens() -> None:
    """Create, list and remove the tokens that admit callers to a server.

    The file holds a salted hash of each token, not the token. A running server rereads the file
    when it changes.
    """


@app.command("add")
@answering
def add(name: _Name, file: _File = None, config: Config = None) -> None:
    """Create a token, add its hash to the file, and print the token, which is shown only once.

    Earlier tokens of the same name stay valid until `sketchmatch tokens remove --old`.
    """
    from sketchmatch.server.tokens import new_token

    path = _file(file, config)
    token, known = new_token(name)
    _change(path, lambda lines, _: [*lines, known.line])
    output.write(f"{token}\n")
    say(f"{path} has a new token of {name}; keep the printed token, it is stored nowhere else")


@app.command("list")
@answering
def list_(file: _File = None, config: Config = None) -> None:
    """List the callers who have tokens, and how many each has."""
    from collections import Counter

    path = _file(file, config)
    counted = Counter(token.name for token in _parsed(_lines(path), path) if token is not None)
    for name in sorted(counted):
        output.write_line(name, counted[name])


@app.command("remove")
@answering
def remove(
    name: _Name,
    file: _File = None,
    config: Config = None,
    old: Annotated[
        bool, typer.Option("--old", help="Keep the newest token of the caller.")
    ] = False,
) -> None:
    """Remove the tokens of a caller from the file; calls with them are refused from then on."""
    path = _file(file, config)

    def without(lines: list[str], known: list[KnownToken | None]) -> list[str]:
        own = [index for index, token in enumerate(known) if token and token.name == name]
        if not own:
            problem = f"has no token in {path}; `sketchmatch tokens list` shows who has one"
            raise InvalidInputError(Reason.INVALID_FIELD, quoted(name), problem)
        removed = own[:-1] if old else own
        return [line for index, line in enumerate(lines) if index not in removed]

    before, after = _change(path, without)
    removed = before - after
    say(f"removed {removed} token{'s' * (removed != 1)} of {name} from {path}")


def _file(named: Path | None, config: Path | None) -> Path:
    if named is not None:
        return named
    from sketchmatch.config import load

    if configured := load(config).settings.server.tokens:
        return Path(configured)
    problem = "is not given, and the configuration has no server.tokens; give --file tokens"
    raise InvalidInputError(Reason.MISSING_FIELD, "--file", problem)


def _lines(path: Path) -> list[str]:
    from sketchmatch.server.watched import content_of

    data = content_of(path, "the file of tokens", "--file")
    return data.decode("utf-8", "replace").splitlines()


def _parsed(lines: list[str], path: Path) -> list[KnownToken | None]:
    """Return the token of each line, or None for a line without one."""
    from sketchmatch.server.tokens import parse_tokens

    parse_tokens("\n".join(lines), str(path))  # an error has the number of the line
    return [next(iter(parse_tokens(line, str(path))), None) for line in lines]


def _change(
    path: Path, change: Callable[[list[str], list[KnownToken | None]], list[str]]
) -> tuple[int, int]:
    """Replace the lines of a file at once, so that no server reads half of them."""
    target = path.resolve()
    scratch = target.with_name(f".{target.name}.new")
    try:
        # Nobody else changes the file while this one is there.
        opened = os.open(scratch, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except OSError as error:
        raise _unwritable(path, scratch, error) from None
    try:
        with os.fdopen(opened, "w", encoding="utf-8") as file:
            lines = _lines(path) if path.exists() else []
            changed = change(lines, _parsed(lines, path))
            file.writelines(f"{line}\n" for line in changed)
        if path.exists():
            shutil.copymode(path, scratch)
        scratch.replace(target)
    except OSError as error:
        raise _unwritable(path, scratch, error) from None
    finally:
        scratch.unlink(missing_ok=True)
    return len(lines), len(changed)


def _unwritable(path: Path, scratch: Path, error: OSError) -> InvalidInputError:
    if isinstance(error, FileExistsError):
        problem = f"is being changed by another command; wait for it, or remove {scratch} if none"
        return InvalidInputError(Reason.INVALID_FILE, str(path), f"{problem} runs")
    problem = f"cannot be written ({(error.strerror or str(error)).lower()}); check the path"
    return InvalidInputError(Reason.INVALID_FILE, str(path), problem)
