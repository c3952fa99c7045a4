"""Where commands write: answers to standard output, all else that anybody prints elsewhere.

Whatever the encoding is, no character stops a command; and whatever a file or a plugin calls its
objects, no text of theirs moves a cursor or ends a line.
"""

from __future__ import annotations

import codecs
import errno
import functools
import io
import json
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, ParamSpec, TextIO, TypeVar

from sketchmatch.errors import InvalidInputError, Reason

if TYPE_CHECKING:
    from google.protobuf.message import Message
    from rich.console import Console, RenderableType

__all__ = [
    "answering",
    "clean",
    "console",
    "discard",
    "document_of",
    "for_people",
    "open_again",
    "show",
    "tell",
    "unwritable",
    "use_any_encoding",
    "write",
    "write_json",
    "write_line",
    "write_message",
]

_Parameters = ParamSpec("_Parameters")

_Value = TypeVar("_Value")

# What terminals obey instead of showing it, and half characters, which no encoding has.
_CONTROLS = "\x00-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff"
_OBEYED = re.compile(f"[{_CONTROLS}]")
# In JSON the controls of ASCII are escaped already, and line ends are its own.
_OBEYED_IN_JSON = re.compile(f"[{_CONTROLS}]".replace("\x00-\x1f", ""))
_NOT_ASCII = re.compile("[^\x00-\x7e]")
_SPELLED = {
    "…": "...", "→": "->", "≤": "<=", "≥": ">=", "×": "x", "−": "-", "–": "-", "—": "-",
    "°": " deg", "ζ": "zeta", "σ": "sigma", "β": "beta", "Ω": "Omega", "²": "2", "’": "'",
}  # fmt: skip

_answer: TextIO | None = None
"""Standard output, while ``sys.stdout`` is something else."""


def open_again() -> None:
    """Let standard output that was closed take nothing, as a full disk does.

    Without this nobody would hear that the answer was lost, or it would go to the next file that
    is opened.
    """
    if sys.stdout is None:
        nothing = os.fdopen(os.open(os.devnull, os.O_RDONLY), "wb", buffering=0)
        sys.stdout = io.TextIOWrapper(nothing, encoding="utf-8", write_through=True)


def use_any_encoding() -> None:
    """Let what an encoding lacks be spelled, on both standard streams, instead of failing."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="sketchmatch.spelled")


def answering(command: Callable[_Parameters, _Value]) -> Callable[_Parameters, _Value]:
    """Keep standard output for what a command answers: what others print goes to standard error.

    Others are plugins and their libraries, also those that are written in C.
    """

    @functools.wraps(command)
    def run(*arguments: _Parameters.args, **options: _Parameters.kwargs) -> _Value:
        with _answers_apart():
            return command(*arguments, **options)

    return run


def for_people() -> bool:
    """Whether answers go to a terminal."""
    return _stream().isatty()


def console(*, error: bool = False) -> Console:
    """Return the console of the answers, or of all else."""
    from rich.console import Console

    stream = sys.stderr if error else _stream()
    return Console(file=stream, width=_width(stream))


def show(answer: RenderableType) -> None:
    """Write an answer for people, as wide as their terminal."""
    screen = console()
    with screen.capture() as shown:
        screen.print(answer)
    write(shown.get())


def write(text: str) -> None:
    """Write a part of the answer, at once.

    Raises
    ------
    InvalidInputError
        If standard output takes no more, as a full disk does, or was closed.
    BrokenPipeError
        If nobody reads it any longer.
    """
    stream = _stream()
    try:
        stream.write(text)
        stream.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise unwritable(error) from None


def write_line(*cells: object) -> None:
    """Write one line of cells with tabs between them, whatever is in the cells."""
    write("\t".join(clean(str(cell)) for cell in cells) + "\n")


def write_json(document: Mapping[str, Any]) -> None:
    """Write what no message of the contract holds as JSON, in the same style."""
    write(_json_for(_stream(), json.dumps(document, ensure_ascii=False, indent=2)) + "\n")


def write_message(message: Message) -> None:
    """Write a message of the contract as JSON, as :func:`document_of` has it."""
    write_json(document_of(message))


def document_of(message: Message) -> dict[str, Any]:
    """Return a message of the contract for JSON, with index 0 and empty lists written out."""
    from google.protobuf import __version__ as version
    from google.protobuf.json_format import MessageToDict

    major, minor = map(int, version.split(".")[:2])
    if (major, minor) < (5, 26):  # which has another name for it
        return MessageToDict(message, including_default_value_fields=True)  # type: ignore[call-arg]
    return MessageToDict(message, always_print_fields_with_no_presence=True)


def tell(text: str) -> None:
    """Write a line that is no part of the answer; it may be lost."""
    if sys.stderr is not None:
        with suppress(OSError):
            print(text, file=sys.stderr, flush=True)


def clean(text: str) -> str:
    r"""Return a text on one line, in which nothing is left that a terminal would obey.

    Examples
    --------
    >>> print(clean("desk\nby the \x1b[31mwall"))
    desk by the \x1b[31mwall
    """
    return _OBEYED.sub(_seen, text)


def discard() -> None:
    """Let go what is still to be written to standard output, which takes no more.

    Python would try once more at its end, and complain.
    """
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def unwritable(error: OSError) -> InvalidInputError:
    """Return what to tell of an answer that could not be written."""
    why = (error.strerror or str(error)).lower()
    problem = f"cannot be written ({why}); free some space there, or send the answer elsewhere"
    if error.errno == errno.EBADF:
        problem = "is closed; send the answer to a file, or to /dev/null"
    return InvalidInputError(Reason.INVALID_FILE, "standard output", problem)


@contextmanager
def _answers_apart() -> Iterator[None]:
    global _answer
    own = sys.stdout
    if _answer is not None:
        yield
        return
    own.flush()
    try:
        answers, others = own.fileno(), sys.stderr.fileno()
    except (OSError, ValueError, AttributeError):  # one of them is no file, or closed
        _answer, sys.stdout = own, sys.stderr or io.StringIO()
        try:
            yield
        finally:
            _answer, sys.stdout = None, own
        return
    kept = os.dup(answers)
    os.dup2(others, answers)
    stream = os.fdopen(kept, "w", encoding=own.encoding, errors="sketchmatch.spelled")
    _answer, sys.stdout = stream, sys.stderr
    try:
        yield
    finally:
        _answer, sys.stdout = None, own
        with suppress(OSError):
            stream.flush()
        _flush_c()
        os.dup2(kept, answers)
        with suppress(OSError):
            stream.close()


def _flush_c() -> None:
    """Let C libraries write what they hold back, while that still goes to standard error."""
    import ctypes

    with suppress(Exception):  # not every system has this name for its C library
        ctypes.CDLL(None).fflush(None)


def _stream() -> TextIO:
    return _answer or sys.stdout


def _width(stream: TextIO | None) -> int | None:
    """Return how wide a terminal is; None leaves it to the variable COLUMNS, or to 80.

    A console asks the standard streams, one of which is replaced.
    """
    if stream is None or os.environ.get("COLUMNS"):
        return None
    try:
        return os.get_terminal_size(stream.fileno()).columns or None
    except (OSError, ValueError):
        return None


def _seen(found: re.Match[str]) -> str:
    return " " if found[0].isspace() else found[0].encode("unicode_escape").decode()


def _json_for(stream: TextIO, text: str) -> str:
    """Return JSON in an encoding's characters, the others escaped as JSON does it."""
    encoding = getattr(stream, "encoding", None) or "utf-8"
    unsafe = _OBEYED_IN_JSON if encoding.lower().startswith("utf") else _NOT_ASCII
    return unsafe.sub(_escaped_for_json, text)


def _escaped_for_json(found: re.Match[str]) -> str:
    units = found[0].encode("utf-16-be", "surrogatepass").hex()
    return re.sub("(....)", r"\\u\1", units)


def _spelled(error: UnicodeError) -> tuple[str | bytes, int]:
    """Spell what an encoding lacks: our own signs in letters, others as TOML and Python do."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_spelling, error.object[error.start : error.end])), error.end


def _spelling(char: str) -> str:
    code = ord(char)
    return _SPELLED.get(char) or (f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}")


codecs.register_error("sketchmatch.spelled", _spelled)
