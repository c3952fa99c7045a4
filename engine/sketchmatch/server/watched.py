"""Files that are read again when they change, while a server runs."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Generic, TypeVar

from sketchmatch.errors import InvalidInputError, Reason

__all__ = ["Watched", "content_of"]

_LOOK_SECONDS = 1.0
_MOST_BYTES = 4 * 1024 * 1024
_Value = TypeVar("_Value")
_State = tuple[tuple[int, int, int] | None, ...]


class Watched(Generic[_Value]):
    """What files say; what they say wrongly later leaves it as it was.

    Files are looked at when their value is asked for, at most once a second. It may be used from
    any thread.

    Parameters
    ----------
    what
        What the files hold, for sentences.
    paths
        The files.
    read
        Returns what they say.
    say
        Called with a sentence when they have changed.
    known
        Returns what else to say of the new value.

    Raises
    ------
    InvalidInputError
        If ``read`` does the first time.
    """

    def __init__(
        self,
        what: str,
        paths: Sequence[Path],
        read: Callable[[], _Value],
        say: Callable[[str], None],
        known: Callable[[_Value], str] = lambda _: "",
    ) -> None:
        self._what, self._paths, self._read = what, tuple(paths), read
        self._say, self._known = say, known
        self._lock = threading.Lock()
        self._state, self._value = _state(self._paths), read()
        self._looked = time.monotonic()

    @property
    def value(self) -> _Value:
        """What the files say now, or said when they were last sound."""
        if time.monotonic() - self._looked >= _LOOK_SECONDS:
            self.look()
        return self._value

    def look(self) -> None:
        """Read the files again if they have changed."""
        with self._lock:
            self._looked = time.monotonic()
            state = _state(self._paths)
            if state == self._state:
                return
            # Before reading: what changes meanwhile is read once more.
            self._state = state
            try:
                self._value = self._read()
            except InvalidInputError as error:
                self._say(f"{self._what} stay as they were: {error}")
                return
        more = self._known(self._value)
        self._say(f"{self._what} are read again{'; ' if more else ''}{more}")


def content_of(path: Path, what: str, setting: str) -> bytes:
    """Return what is in a file.

    Raises
    ------
    InvalidInputError
        If it cannot be read, with the setting that names it.
    """
    try:
        with path.open("rb") as file:
            data = file.read(_MOST_BYTES + 1)
    except (OSError, ValueError) as error:
        why = (getattr(error, "strerror", None) or str(error)).lower()
        problem = f"cannot be read ({why}); check {setting}, which names {what}"
        raise InvalidInputError(Reason.INVALID_FILE, str(path), problem) from None
    if len(data) > _MOST_BYTES:
        limit = f"{_MOST_BYTES // 1024**2} MiB"
        problem = f"has more than {limit}; check {setting}, which names {what}"
        raise InvalidInputError(Reason.INVALID_FILE, str(path), problem)
    return data


def _state(paths: Sequence[Path]) -> _State:
    return tuple(map(_state_of, paths))


def _state_of(path: Path) -> tuple[int, int, int] | None:
    """Return what tells one content of a file from another without reading it."""
    try:
        found = path.stat()
    except (OSError, ValueError):
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino
