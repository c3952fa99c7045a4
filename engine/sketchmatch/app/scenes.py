"""The file of the scenes that a server keeps: written by it, read by its workers (``shelf``)."""

from __future__ import annotations

import json
import sqlite3
import time
import zlib
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from sketchmatch.app.shelf import (
    RECORD_OF,
    SOURCE_OF,
    Described,
    kept_record,
    not_kept,
    segmentation,
    source_of,
    summed,
    unsummed,
)
from sketchmatch.app.store import Database, Store
from sketchmatch.errors import InvalidInputError, QuotaError, Reason, StoreError, quoted
from sketchmatch.model.labels import cleaned_label
from sketchmatch_proto.v1.scene_service_pb2 import (
    GetSceneResponse,
    ListScenesResponse,
    SceneSummary,
    StoredScene,
)

__all__ = ["SceneArchive"]

_FILE, _VERSION = "scenes", 3
_MIB = 1024 * 1024
_PAGE, _LONGEST_PAGE = 100, 1000

_SCHEMA = """
CREATE TABLE contents (
    content TEXT PRIMARY KEY, source BLOB NOT NULL, labels TEXT NOT NULL
) WITHOUT ROWID;
CREATE TABLE scenes (
    name TEXT PRIMARY KEY, content TEXT NOT NULL, outlines TEXT NOT NULL, record BLOB NOT NULL,
    objects INTEGER NOT NULL, labels TEXT NOT NULL
);
CREATE INDEX scenes_by_content ON scenes (content);
CREATE INDEX scenes_by_outlines ON scenes (outlines);
CREATE TABLE owners (
    caller TEXT NOT NULL, put_time INTEGER NOT NULL, name TEXT NOT NULL, title TEXT NOT NULL,
    PRIMARY KEY (caller, name)
) WITHOUT ROWID;
CREATE INDEX owners_by_name ON owners (name);
CREATE TABLE histograms (
    outlines TEXT NOT NULL, described_by TEXT NOT NULL, bytes BLOB NOT NULL,
    PRIMARY KEY (outlines, described_by)
)
"""


class SceneArchive:
    """All scenes of a server, for any thread.

    Parameters
    ----------
    store
        Where they are kept.
    max_bytes
        Bytes of all together.
    """

    def __init__(self, store: Store, max_bytes: int) -> None:
        self._file: Database = store.database(_FILE, _SCHEMA, _VERSION, max_bytes)

    @property
    def path(self) -> Path:
        """The file, for a :class:`~sketchmatch.app.shelf.Shelf`."""
        return self._file.path

    def open(self) -> None:
        """Make the file where there is none, so that there is something to read.

        Raises
        ------
        StoreError
            As all methods do, if the file cannot be used.
        """
        self._file.work(lambda _: None)

    def put(
        self, found: GetSceneResponse, caller: str, title: str = "", most: int | None = None
    ) -> tuple[StoredScene, bool]:
        """Keep what a segmenter found in a source, and what the caller calls it.

        Parameters
        ----------
        found, caller, title
            What it found, for whom, and what that caller calls it.
        most
            Bytes that the caller may keep, or None for no limit.

        Raises
        ------
        QuotaError
            If these would be more; then nothing is kept.

        Returns
        -------
        tuple
            The scene, and whether the caller had not put it.
        """
        record = found.stored_scene
        source = summed(zlib.compress(found.source.SerializeToString(deterministic=True), 1))
        labels = _labels_of(record)

        def job(connection: sqlite3.Connection) -> tuple[StoredScene, bool]:
            connection.execute(
                "INSERT OR REPLACE INTO contents VALUES (?, ?, ?)",
                (record.name, source, json.dumps(labels)),
            )
            created = _put(connection, record, record.name, caller, most)
            return _titled(connection, record, caller, title or None), created

        return self._file.work(job)

    def claim(
        self, name: str, caller: str, title: str = "", most: int | None = None
    ) -> tuple[StoredScene, bool] | None:
        """Let a caller have a scene that it could put; None where nobody has put it.

        Raises
        ------
        QuotaError
            As :meth:`put` does.

        Returns
        -------
        tuple or None
            The scene, and whether the caller had not put it.
        """

        def job(connection: sqlite3.Connection) -> tuple[StoredScene, bool] | None:
            found = connection.execute(RECORD_OF, (name,)).fetchone()
            if found is None:
                return None
            created = _own(connection, name, caller, most)
            record = StoredScene.FromString(unsummed(found[0]))
            return _titled(connection, record, caller, title or None), created

        return self._file.work(job)

    def get(
        self, name: str, caller: str, include_source: bool = False, field: str = "name"
    ) -> GetSceneResponse:
        """Return a scene of a caller.

        Raises
        ------
        NotFoundError
            If the caller has put none of this name.
        """

        def job(connection: sqlite3.Connection) -> GetSceneResponse:
            record = _record(connection, name, caller, field)
            source = None
            if include_source:
                source = source_of(unsummed(connection.execute(SOURCE_OF, (name,)).fetchone()[0]))
            return GetSceneResponse(stored_scene=record, source=source)

        return self._file.work(job)

    def relabel(
        self,
        name: str,
        labels: Sequence[tuple[int, str]],
        caller: str,
        title: str | None = None,
        most: int | None = None,
    ) -> StoredScene:
        """Keep a scene with other labels, beside the one of this name, and under another title.

        Parameters
        ----------
        name, labels, caller
            Of the scene; by object; whose it is.
        title
            What the caller calls it from now on; None: as before.
        most
            Bytes that the caller may keep, or None for no limit.

        Raises
        ------
        InvalidInputError
            If it has no such object.
        NotFoundError
            If the caller has put none of this name.
        QuotaError
            As :meth:`put` does.
        """

        def job(connection: sqlite3.Connection) -> StoredScene:
            record = _record(connection, name, caller, "name")
            content, found = connection.execute(
                "SELECT content, contents.labels FROM contents JOIN scenes USING (content) "
                "WHERE name = ?",
                (name,),
            ).fetchone()
            for k, (place, label) in enumerate(labels):
                if place >= len(record.scene.objects):
                    last = len(record.scene.objects) - 1
                    problem = f"is {place}; give the index of an object, from 0 to {last}"
                    raise InvalidInputError(Reason.INVALID_FIELD, f"labels[{k}].object", problem)
                record.scene.objects[place].label = cleaned_label(label)
            wanted = _labels_of(record)
            record.name = content if wanted == json.loads(found) else _relabelled(content, wanted)
            called = record.title if title is None else title
            record.ClearField("title")
            _put(connection, record, content, caller, most)
            return _titled(connection, record, caller, called)

        return self._file.work(job)

    def list(self, caller: str, page_size: int, page_token: str) -> ListScenesResponse:
        """Return a part of the list of a caller's scenes, the latest first.

        Raises
        ------
        InvalidInputError
            If there is no such part.
        """
        if not 0 <= page_size <= _LONGEST_PAGE:
            problem = (
                f"is {page_size}; give a number of scenes up to {_LONGEST_PAGE}, "
                f"or 0 for the default of {_PAGE}"
            )
            raise InvalidInputError(Reason.INVALID_FIELD, "page_size", problem)
        size, (before, last) = page_size or _PAGE, _place(page_token)

        def job(connection: sqlite3.Connection) -> list[Any]:
            return connection.execute(
                "SELECT name, put_time, objects, labels, title "
                "FROM owners JOIN scenes USING (name) "
                "WHERE caller = ? AND (put_time, name) < (?, ?) "
                "ORDER BY put_time DESC, name DESC LIMIT ?",
                (caller, before, last, size + 1),
            ).fetchall()

        rows = self._file.work(job)
        response = ListScenesResponse()
        for name, put_time, objects, labels, title in rows[:size]:
            named = [label for label in json.loads(labels) if label]
            summary = SceneSummary(name=name, object_count=objects, labels=named, title=title)
            summary.put_time.FromNanoseconds(put_time)
            response.scenes.append(summary)
        if len(rows) > size:
            name, put_time, *_ = rows[size - 1]
            response.next_page_token = f"{put_time}-{name}"
        return response

    def delete(self, name: str, caller: str) -> None:
        """Forget a scene of a caller, and all of it where it was nobody else's.

        Raises
        ------
        NotFoundError
            If the caller has put none of this name.
        """

        def job(connection: sqlite3.Connection) -> None:
            gone = connection.execute(
                "DELETE FROM owners WHERE caller = ? AND name = ?", (caller, name)
            )
            if not gone.rowcount:
                raise not_kept(name, "name")
            for statement in (
                "DELETE FROM scenes WHERE name NOT IN (SELECT name FROM owners)",
                "DELETE FROM contents WHERE content NOT IN (SELECT content FROM scenes)",
                "DELETE FROM histograms WHERE outlines NOT IN (SELECT outlines FROM scenes)",
            ):
                connection.execute(statement)

        self._file.work(job)

    def keep(self, described: Described) -> None:
        """Keep the histograms of a scene that is kept; without room for them, others do."""

        def job(connection: sqlite3.Connection) -> None:
            connection.execute(
                "INSERT OR REPLACE INTO histograms SELECT ?, ?, ? "
                "WHERE EXISTS (SELECT 1 FROM scenes WHERE outlines = ?)",
                (
                    described.outlines,
                    described.described_by,
                    summed(np.ascontiguousarray(described.histograms, dtype="<f8").tobytes()),
                    described.outlines,
                ),
            )

        try:
            self._file.work(job)
        except StoreError:
            return  # it is computed again, and whoever needs the store is told

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def _put(
    connection: sqlite3.Connection,
    record: StoredScene,
    content: str,
    caller: str,
    most: int | None,
) -> bool:
    """Write a scene and who has it; return whether that is new."""
    labels = _labels_of(record)
    connection.execute(
        "INSERT OR REPLACE INTO scenes VALUES (?, ?, ?, ?, ?, ?)",
        (
            record.name,
            content,
            segmentation(record).scene.identity,
            summed(record.SerializeToString(deterministic=True)),
            len(labels),
            json.dumps(labels),
        ),
    )
    return _own(connection, record.name, caller, most)


def _own(connection: sqlite3.Connection, name: str, caller: str, most: int | None) -> bool:
    made = connection.execute(
        "INSERT OR IGNORE INTO owners VALUES (?, ?, ?, '')", (caller, time.time_ns(), name)
    )
    new = made.rowcount > 0
    if new and most is not None and (kept := _kept_bytes(connection, caller)) > most:
        raise QuotaError(
            f"with this scene you would store {kept / _MIB:.3g} MiB, and the limit for each caller "
            f"is {most / _MIB:.3g} MiB; delete scenes that you do not need"
        )
    return new


def _kept_bytes(connection: sqlite3.Connection, caller: str) -> int:
    """Return the bytes of a caller's scenes and of their sources, each counted once."""
    (scenes,) = connection.execute(
        "SELECT total(length(record)) FROM scenes JOIN owners USING (name) WHERE caller = ?",
        (caller,),
    ).fetchone()
    (sources,) = connection.execute(
        "SELECT total(length(source)) FROM contents WHERE content IN "
        "(SELECT content FROM scenes JOIN owners USING (name) WHERE caller = ?)",
        (caller,),
    ).fetchone()
    return int(scenes + sources)


def _titled(
    connection: sqlite3.Connection, record: StoredScene, caller: str, title: str | None
) -> StoredScene:
    """Return a record with what its caller calls it, from now on or as before."""
    whose = (caller, record.name)
    if title is not None:
        connection.execute(
            "UPDATE owners SET title = ? WHERE caller = ? AND name = ?", (title, *whose)
        )
    (called,) = connection.execute(
        "SELECT title FROM owners WHERE caller = ? AND name = ?", whose
    ).fetchone()
    with_title = StoredScene()
    with_title.CopyFrom(record)
    with_title.title = called
    return with_title


def _record(connection: sqlite3.Connection, name: str, caller: str, field: str) -> StoredScene:
    """Return a scene of a caller, with its title."""
    kept, title = kept_record(connection, name, caller, field)
    record = StoredScene.FromString(kept)
    record.title = title
    return record


def _labels_of(record: StoredScene) -> list[str]:
    return [item.label for item in record.scene.objects]


def _relabelled(content: str, labels: list[str]) -> str:
    """Return the name of a scene with labels that were not found but given."""
    return sha256(f"{content} {json.dumps(labels)}".encode()).hexdigest()


def _place(page_token: str) -> tuple[int, str]:
    """Return where a page of the list begins."""
    if not page_token:
        return 2**63 - 1, ""
    time_, _, name = page_token.partition("-")
    if not (time_.isascii() and time_.isdigit() and len(time_) < 19 + 1):
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            "page_token",
            f"is {quoted(page_token)}; give the next_page_token of the page before, or none",
        )
    return min(int(time_), 2**63 - 1), name
