"""What a server keeps on disk: a folder of its own, with a SQLite file for each kind of thing."""

from __future__ import annotations

import fcntl
import shutil
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock
from typing import TypeVar

from sketchmatch.errors import StoreError

__all__ = ["DamagedError", "Database", "Reading", "Store"]

_Result = TypeVar("_Result")

_PAGE_BYTES = 4096
_FEWEST_PAGES = 64
_SPARE_PAGES = 256
"""Free pages that a file keeps for what comes next."""

_GIVEN_BACK = 256
"""Free pages that go back to the disk at once: in some hundredths of a second."""

_PATIENCE_SECONDS = 2.0
_FULL = frozenset({sqlite3.SQLITE_FULL})
# With less room on the disk it is not the limit that was met.
_LEAST_FREE = 1 << 20
_DAMAGED = frozenset({sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB})
_TAKEN = frozenset({sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED})


class DamagedError(sqlite3.DatabaseError):
    """What was kept is not what is read: told as what SQLite itself finds damaged."""

    sqlite_errorcode = sqlite3.SQLITE_CORRUPT


class Store:
    """A folder that one server at a time keeps things in.

    Parameters
    ----------
    folder
        Where; it is made, readable by its owner alone, if it is not there.

    Raises
    ------
    StoreError
        If it cannot be written to, or another server uses it.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._lock = (folder / "lock").open("w")
        except OSError as error:
            problem = f"cannot be written to ({error.strerror or error})"
            raise StoreError(f"the store {folder} {problem}; name another folder") from error
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            self._lock.close()
            raise StoreError(
                f"the store {folder} is used by another server; name another folder"
            ) from error

    def database(self, name: str, schema: str, version: int, max_bytes: int) -> Database:
        """Return one of its files, which is opened when it is first used.

        Parameters
        ----------
        name
            The file's name without its ending.
        schema
            The statements that make its tables.
        version
            Which schema it is; a file of another one is refused.
        max_bytes
            Bytes that it may grow to.
        """
        return Database(self.folder / f"{name}.sqlite", schema, version, max_bytes)

    def close(self) -> None:
        """Leave the folder to others."""
        self._lock.close()


class _File:
    """One SQLite file, for one thread at a time.

    A file that fails is opened anew at the next use, so that what was mended is in use again
    without a restart.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._connection: sqlite3.Connection | None = None
        self._one_at_a_time = Lock()

    def close(self) -> None:
        """Close the file, until it is used again."""
        with self._one_at_a_time:
            self._close()

    def _close(self) -> None:
        if self._connection is not None:
            with suppress(sqlite3.Error):
                self._connection.close()
            self._connection = None


class Database(_File):
    """A file that this process alone writes."""

    def __init__(self, path: Path, schema: str, version: int, max_bytes: int) -> None:
        super().__init__(path)
        self._schema = schema
        self._version = version
        self._max_pages = max(max_bytes // _PAGE_BYTES, _FEWEST_PAGES)

    def work(self, job: Callable[[sqlite3.Connection], _Result]) -> _Result:
        """Do something with it in one transaction: all of it, or nothing where it raises.

        Raises
        ------
        StoreError
            If the file is full, damaged, in use or gone.
        """
        with self._one_at_a_time, self._told():
            if self._connection is not None and not self.path.exists():
                self._close()  # what is written to a file without a name is lost
            connection = self._connection or self._opened()
            with connection:
                connection.execute("BEGIN IMMEDIATE")
                result = job(connection)
            _shrink(connection)
            return result

    def _opened(self) -> sqlite3.Connection:
        connection = sqlite3.connect(
            self.path, timeout=_PATIENCE_SECONDS, isolation_level=None, check_same_thread=False
        )
        self._connection = connection
        for pragma in (
            f"page_size = {_PAGE_BYTES}",
            "auto_vacuum = INCREMENTAL",
            "journal_mode = WAL",
            "synchronous = NORMAL",
            "foreign_keys = ON",
            f"max_page_count = {self._max_pages}",
        ):
            connection.execute(f"PRAGMA {pragma}").fetchall()
        (found,) = connection.execute("PRAGMA user_version").fetchone()
        if found not in (0, self._version):
            raise StoreError(
                f"the store's file {self.path} was written by another version of sketchmatch; "
                "move it away"
            )
        if not found:
            connection.executescript(
                f"BEGIN IMMEDIATE; {self._schema}; PRAGMA user_version = {self._version}; COMMIT"
            )
        return connection

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Say in a sentence what is wrong with the file."""
        try:
            yield
        except StoreError:
            self._close()
            raise
        except sqlite3.IntegrityError:
            raise
        except sqlite3.Error as error:
            self._close()
            raise _said(self.path, error) from error


def _shrink(connection: sqlite3.Connection) -> None:
    """Give some of what is no longer needed back to the disk: all at once would hold others up."""
    with suppress(sqlite3.Error):  # the work is done, and the next says what is wrong
        (free,) = connection.execute("PRAGMA freelist_count").fetchone()
        if free > _SPARE_PAGES:
            most = min(free - _SPARE_PAGES, _GIVEN_BACK)
            # Each step gives one page back, and `execute` makes one alone where there are no rows.
            connection.executescript(f"PRAGMA incremental_vacuum({most})")


class Reading(_File):
    """A file as other processes than the one that writes it see it."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._opened: int | None = None

    def work(self, job: Callable[[sqlite3.Connection], _Result]) -> _Result:
        """Read something.

        Raises
        ------
        StoreError
            If the file is damaged, in use or gone.
        """
        with self._one_at_a_time:
            try:
                if self._connection is not None and self._opened != _inode(self.path):
                    self._close()  # there is another one in its place, or none
                if self._connection is None:
                    self._opened = _inode(self.path)
                    self._connection = sqlite3.connect(
                        f"{self.path.absolute().as_uri()}?mode=ro",
                        timeout=_PATIENCE_SECONDS,
                        isolation_level=None,
                        check_same_thread=False,
                        uri=True,
                    )
                return job(self._connection)
            except sqlite3.Error as error:
                self._close()
                raise _said(self.path, error) from error


def _inode(path: Path) -> int | None:
    """Return which file is at a path; None for none."""
    try:
        return path.stat().st_ino
    except OSError:
        return None


def _free_bytes(path: Path) -> int:
    """Return how much room there is on the disk of a file."""
    try:
        return shutil.disk_usage(path.parent).free
    except OSError:
        return 0


def _said(path: Path, error: sqlite3.Error) -> StoreError:
    """Return what is wrong with a file, in a sentence."""
    code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR) & 0xFF
    if code in _FULL and _free_bytes(path) < _LEAST_FREE:
        fault = "cannot grow because its disk is full; free some space"
    elif code in _FULL:
        fault = "is full; delete what is not needed, or raise its size limit"
    elif code in _DAMAGED:
        fault = "is damaged; move it away, and the server makes a new one"
    elif code in _TAKEN:
        fault = "is in use by another process; end that process"
    else:
        fault = f"cannot be used ({error}); check its folder and its disk"
    return StoreError(f"the store's file {path} {fault}")
