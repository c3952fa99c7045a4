"""Matches on disk: written by a thread of its own, so that neither answers nor readers wait."""

from __future__ import annotations

import logging
import sqlite3
import threading
import time
from collections.abc import Callable, Iterable
from typing import Protocol, TypeVar

from sketchmatch.app.frames import failure, failure_of
from sketchmatch.app.orders import Wish
from sketchmatch.app.store import Store
from sketchmatch.app.tasks import Record, State, is_progress
from sketchmatch.errors import MatchInterruptedError, StoreError

__all__ = ["INTERRUPTED", "Archive", "Kept"]

_log = logging.getLogger(__name__)
_Result = TypeVar("_Result")
_Row = tuple[str, str, str, bytes, int, float, float | None, int, int, bytes | None]

INTERRUPTED = "the server stopped or crashed during the match"

_VERSION = 1
_SCHEMA = """
CREATE TABLE matches (
    id TEXT PRIMARY KEY,
    caller TEXT NOT NULL,
    request_id TEXT NOT NULL,
    digest BLOB NOT NULL,
    state INTEGER NOT NULL,
    created REAL NOT NULL,
    ended REAL,
    outcome INTEGER NOT NULL,
    run INTEGER NOT NULL,
    error BLOB
) WITHOUT ROWID;
CREATE INDEX matches_by_name ON matches (caller, request_id) WHERE request_id != '';
CREATE INDEX matches_by_time ON matches (caller, created, id);
CREATE INDEX matches_by_end ON matches (ended);
CREATE TABLE events (
    match TEXT NOT NULL REFERENCES matches (id) ON DELETE CASCADE,
    number INTEGER NOT NULL,
    event BLOB NOT NULL,
    PRIMARY KEY (match, number)
)
"""
_COLUMNS = "id, caller, request_id, digest, state, created, ended, outcome, run, error"
_WRITE = f"""
INSERT INTO matches ({_COLUMNS}) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)
ON CONFLICT (id) DO UPDATE SET state = excluded.state, ended = excluded.ended,
    outcome = excluded.outcome, run = excluded.run, error = excluded.error
"""
_ENDS = ", ".join(str(int(state)) for state in State if state.ended)
_UNENDED = f"state NOT IN ({_ENDS})"

_BATCH_SECONDS = 0.05
_TIDY_SECONDS = 60.0
_FULL = 0.9
_MOST_NAMES = 500_000
_FEWEST_DELETED = 100
_DELETED_SHARE = 20
_SAY_AGAIN_SECONDS = 60.0


class Kept(Protocol):
    """A match, whether it runs or not."""

    def record(self) -> Record:
        """Return it as it is now."""


class Archive:
    """The matches of a server on disk.

    Where the disk fails, matches go on and are not kept: the log says so, and it is counted.

    Parameters
    ----------
    store
        The server's folder.
    max_seconds
        How long a match is kept after its end.
    max_bytes
        Bytes that the file may grow to; the matches that ended first go first.
    failed
        Called when matches could not be kept, with how many; from any thread.
    """

    def __init__(
        self, store: Store, max_seconds: float, max_bytes: int, failed: Callable[[int], None]
    ) -> None:
        self._database = store.database("matches", _SCHEMA, _VERSION, max_bytes)
        self._max_seconds = max_seconds
        self._max_bytes = max_bytes
        self._failed = failed
        self._lock = threading.Lock()
        self._changed: dict[str, Kept] = {}
        self._wanted = threading.Event()
        self._idle = threading.Condition(self._lock)
        self._writing = False
        self._closing = False
        self._tidied = -_TIDY_SECONDS
        self._fault, self._said = "", 0.0
        self._claiming, self._claimed = threading.Lock(), False
        self._names: set[int] | None = None
        self._writer = threading.Thread(
            target=self._write_on, name="sketchmatch-archive", daemon=True
        )
        self._wanted.set()  # what a former server left is to be seen to at once
        self._writer.start()

    def keep(self, match: Kept, name: str) -> None:
        """Have a match written as it is in a moment; returns at once."""
        with self._lock:
            self._changed[name] = match
        self._wanted.set()

    def may_know(self, caller: str, request_id: str) -> bool:
        """Whether it may be worth asking for a match by its caller's name for it."""
        names = self._names
        return names is None or hash((caller, request_id)) in names

    def flush(self, seconds: float = 5.0) -> None:
        """Wait until all that was to be kept is written, or has failed."""
        with self._idle:
            self._idle.wait_for(lambda: not (self._changed or self._writing), seconds)

    def find(self, caller: str, name: str) -> Record | None:
        """Return the match of a name; None if there is none, or it is another caller's.

        Raises
        ------
        StoreError
            If that cannot be read.
        """
        found = self._matches("id = ? AND caller = ?", (name, caller), with_events=True)
        return found[0] if found else None

    def same(self, caller: str, request_id: str) -> Record | None:
        """Return the latest match that a caller gave a certain name to.

        Raises
        ------
        StoreError
            If that cannot be read.
        """
        which = "request_id != '' AND caller = ? AND request_id = ? ORDER BY created DESC LIMIT 1"
        found = self._matches(which, (caller, request_id), with_events=True)
        return found[0] if found else None

    def page(self, caller: str, before: tuple[float, str] | None, size: int) -> list[Record]:
        """Return a caller's matches before a certain one, the latest first, without their events.

        Raises
        ------
        StoreError
            If that cannot be read.
        """
        created, name = before or (float("inf"), "")
        which = "caller = ? AND (created, id) < (?, ?) ORDER BY created DESC, id DESC LIMIT ?"
        return self._matches(which, (caller, created, name, size), with_events=False)

    def close(self) -> None:
        """Write what is left, and end."""
        self.flush()
        self._closing = True
        self._wanted.set()
        self._writer.join()
        self._database.close()

    def _matches(self, which: str, values: tuple[object, ...], with_events: bool) -> list[Record]:
        def read(connection: sqlite3.Connection) -> list[Record]:
            rows = connection.execute(f"SELECT {_COLUMNS} FROM matches WHERE {which}", values)
            return [_record(row, events(connection, row)) for row in rows.fetchall()]

        def events(connection: sqlite3.Connection, row: _Row) -> list[tuple[int, bytes]]:
            if with_events:
                query = "SELECT number, event FROM events WHERE match = ? ORDER BY number"
            else:
                query = "SELECT max(number), x'' FROM events WHERE match = ?"
            return [each for each in connection.execute(query, row[:1]) if each[0] is not None]

        return self._work(read)

    def _write_on(self) -> None:
        while not self._closing:
            self._wanted.wait(_TIDY_SECONDS)
            if self._wanted.is_set() and not self._closing:
                time.sleep(_BATCH_SECONDS)  # what changes meanwhile is written at once
            self._wanted.clear()
            with self._lock:
                batch, self._changed, self._writing = self._changed, {}, True
            try:
                self._write(batch)
            except Exception:  # the thread is to live on
                _log.exception("matches could not be saved")
                self._failed(len(batch))
            with self._idle:
                self._writing = False
                self._idle.notify_all()

    def _write(self, batch: dict[str, Kept]) -> None:
        records = [match.record() for match in batch.values()]
        try:
            try:
                self._work(lambda connection: _insert(connection, records))
            except StoreError as error:
                if not _is_full(error):
                    raise
                self._work(_delete_oldest)
                self._work(lambda connection: _insert(connection, records))
            self._tidy()
        except StoreError as error:
            if records:
                self._failed(len(records))
            self._say(f"{error}; until then, matches continue but are not kept")
            return
        self._know(records)
        if self._fault:
            self._fault = ""
            _log.info("matches are kept again")

    def _know(self, records: Iterable[Record]) -> None:
        """Know the names of what was written."""
        if self._names is not None:
            named = (record for record in records if record.wish.request_id)
            self._names |= {hash((each.caller, each.wish.request_id)) for each in named}
            if len(self._names) > _MOST_NAMES:
                self._names = None

    def _tidy(self) -> None:
        """Delete what is too old, and the oldest where there is too much."""
        if time.monotonic() - self._tidied < _TIDY_SECONDS:
            return

        def tidy(connection: sqlite3.Connection) -> bool:
            connection.execute(
                "DELETE FROM matches WHERE ended < ?", (time.time() - self._max_seconds,)
            )
            full = _used_bytes(connection) > _FULL * self._max_bytes
            if full:
                _delete_oldest(connection)
            return full

        while self._work(tidy):
            pass
        self._tidied = time.monotonic()

    def _work(self, job: Callable[[sqlite3.Connection], _Result]) -> _Result:
        """Do something with the file, once nothing in it pretends to be running."""
        with self._claiming:
            if not self._claimed:
                self._names = self._database.work(_claim)
                self._claimed = True
        return self._database.work(job)

    def _say(self, fault: str) -> None:
        """Say in the log what is wrong, but not again and again."""
        now = time.monotonic()
        if fault != self._fault or now - self._said > _SAY_AGAIN_SECONDS:
            _log.error("%s", fault)
            self._fault, self._said = fault, now


def _insert(connection: sqlite3.Connection, records: Iterable[Record]) -> None:
    for record in records:
        connection.execute(_WRITE, _row(record))
        if record.run:
            connection.execute(
                "DELETE FROM events WHERE match = ? AND number <= ?", (record.id, record.first)
            )
        connection.executemany(
            "INSERT OR IGNORE INTO events VALUES (?, ?, ?)",
            [
                (record.id, number, event)
                for number, event in record.events
                if record.state.ended or not is_progress(event)
            ],
        )


def _claim(connection: sqlite3.Connection) -> set[int] | None:
    """Say of what a former server did that it was interrupted.

    Returns what tells the names that callers gave, or None if they are too many.
    """
    connection.execute(
        f"UPDATE matches SET state = ?, ended = ? WHERE {_UNENDED}",
        (int(State.INTERRUPTED), time.time()),
    )
    rows = connection.execute(
        "SELECT caller, request_id FROM matches WHERE request_id != '' LIMIT ?", (_MOST_NAMES + 1,)
    )
    names = {hash(row) for row in rows}
    return names if len(names) <= _MOST_NAMES else None


def _used_bytes(connection: sqlite3.Connection) -> int:
    (pages,), (free,), (size,) = (
        connection.execute(f"PRAGMA {name}").fetchone()
        for name in ("page_count", "freelist_count", "page_size")
    )
    return int((pages - free) * size)


def _is_full(error: StoreError) -> bool:
    code = getattr(error.__cause__, "sqlite_errorcode", None)
    return code is not None and code & 0xFF == sqlite3.SQLITE_FULL


def _delete_oldest(connection: sqlite3.Connection) -> None:
    """Delete a share of the matches that have ended, those that ended first."""
    (count,) = connection.execute("SELECT count(*) FROM matches WHERE ended NOT NULL").fetchone()
    share = max(_FEWEST_DELETED, count // _DELETED_SHARE)
    connection.execute(
        "DELETE FROM matches WHERE id IN "
        "(SELECT id FROM matches WHERE ended NOT NULL ORDER BY ended LIMIT ?)",
        (share,),
    )


def _row(record: Record) -> _Row:
    return (
        record.id,
        record.caller,
        record.wish.request_id,
        record.wish.digest,
        int(record.state),
        record.created,
        record.ended,
        record.outcome,
        record.run,
        failure(record.error, "") if isinstance(record.error, Exception) else None,
    )


def _record(row: _Row, events: list[tuple[int, bytes]]) -> Record:
    name, caller, request_id, digest, state, created, ended, outcome, run, packed = row
    error: BaseException | None = None
    if packed is not None:
        error = failure_of(packed)[0] or RuntimeError("the match failed with an unexpected error")
    elif state == State.INTERRUPTED:
        error = MatchInterruptedError(INTERRUPTED)
    return Record(
        name,
        caller,
        Wish(request_id, digest),
        State(state),
        created,
        ended,
        outcome,
        run,
        tuple(events),
        error,
    )
