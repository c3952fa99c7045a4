"""Where answers are saved: refused before the work, or in one sentence after it."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from sketchmatch.errors import InvalidInputError, Reason

__all__ = ["check_target", "writing"]


def check_target(path: str | Path, field: str, endings: Collection[str], named: str) -> None:
    """Refuse a path that nothing can be saved under, before any work is done.

    Parameters
    ----------
    path
        Where it shall be saved.
    field
        What an error calls the path.
    endings, named
        The endings of names that there are, in lower case, and as a sentence names them.

    Raises
    ------
    InvalidInputError
        If the name has another ending, or its folder does not exist.
    """
    path = Path(path)
    if path.suffix.lower() not in endings:
        raise InvalidInputError(
            Reason.INVALID_FILE, field, f"is {str(path)!r}; give a name that ends in {named}"
        )
    if not path.parent.is_dir():
        raise InvalidInputError(
            Reason.INVALID_FILE,
            field,
            f"is {str(path)!r}, but there is no folder {str(path.parent)!r}; create it first",
        )


@contextmanager
def writing(path: str | Path, field: str) -> Iterator[None]:
    """Turn what the system says against writing a file into one sentence.

    Raises
    ------
    InvalidInputError
        With ``field`` as its path, if the file cannot be written.
    """
    try:
        yield
    except OSError as error:
        why = error.strerror or "the disk refused it"
        raise InvalidInputError(
            Reason.INVALID_FILE,
            field,
            f"cannot be written to {str(path)!r} ({why}); choose a folder in which you may write",
        ) from None
