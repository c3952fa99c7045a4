"""Scenes that a server keeps under the hash of what they are, written by one, read by its workers.

A scene is a record, the message ``StoredScene``, that whoever matches with it decodes once. Beside
it lie its source, and the histograms of its pairs and those within its objects, which the worker
that computed them hands in. Each of these carries a checksum. What does not fit it is damaged:
histograms are computed and kept again, and a scene is mended where it is put again.
"""

from __future__ import annotations

import json
import re
import sqlite3
import time
import zlib
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

import sketchmatch
from sketchmatch.api import Histogram, Segmentation, Segmenter
from sketchmatch.api.forces import OWN_DIRECTIONS, own_histograms
from sketchmatch.app.store import DamagedError, Database, Reading, Store
from sketchmatch.errors import (
    InvalidInputError,
    NotFoundError,
    QuotaError,
    Reason,
    StoreError,
    quoted,
)
from sketchmatch.model import FloatArray, Scene, SceneObject, pair_count
from sketchmatch.model.arrays import frozen_floats, sealed
from sketchmatch.model.labels import cleaned_label
from sketchmatch.registry import Registry
from sketchmatch_proto.v1 import source_pb2
from sketchmatch_proto.v1.scene_service_pb2 import (
    GetSceneResponse,
    ListScenesResponse,
    SceneSummary,
    StoredScene,
)

__all__ = [
    "LARGEST_KEPT",
    "Described",
    "SceneArchive",
    "Shelf",
    "cleaned_title",
    "described_by",
    "name_of",
    "segmentation",
    "without_store",
]

_FILE, _VERSION = "scenes", 3
_MIB = 1024 * 1024

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
_RECORD_OF = "SELECT record FROM scenes WHERE name = ?"
_HISTOGRAMS_OF = "SELECT bytes FROM histograms WHERE outlines = ? AND described_by = ?"
_SOURCE_OF = "SELECT source FROM contents JOIN scenes USING (content) WHERE name = ?"
LARGEST_KEPT = 32 * 1024 * 1024
"""Bytes of the histograms of a scene above which these are computed again."""

_OWN = f"within objects, {OWN_DIRECTIONS}"
_SUM_BYTES = 4
_PAGE, _LONGEST_PAGE = 100, 1000
_A_NAME = re.compile(r"[0-9a-f]{64}")
_HELD = 32
_NAMED = 80
_LONGEST_TITLE = 200


def name_of(
    source: source_pb2.Source, segmenter: Segmenter, registry: Registry
) -> tuple[str, bytes]:
    """Return the name of the scene that a segmenter finds in a source, and the source's bytes.

    The bytes are the same however the source was encoded.
    """
    plain = source_pb2.Source()
    plain.CopyFrom(source)
    plain.DiscardUnknownFields()
    data = plain.SerializeToString(deterministic=True)
    made = {
        "engine": sketchmatch.__version__,
        "segmenter": registry.whose(segmenter),
        "parameters": segmenter.params.model_dump(mode="json"),
        "readers": [item.origin for item in registry.readers] if plain.HasField("file") else [],
    }
    digest = sha256(json.dumps(made, sort_keys=True).encode())
    digest.update(data)
    return digest.hexdigest(), data


def cleaned_title(given: str) -> str:
    """Return what a caller calls a scene, in one line.

    Raises
    ------
    InvalidInputError
        If it is too long.
    """
    title = cleaned_label(given)
    if len(title) > _LONGEST_TITLE:
        problem = f"has {len(title)} characters; give up to {_LONGEST_TITLE}"
        raise InvalidInputError(Reason.INVALID_FIELD, "title", problem)
    return title


def segmentation(record: StoredScene) -> Segmentation:
    """Return a kept scene as it was found."""
    objects = tuple(
        SceneObject(
            tuple(frozen_floats(_points(ring.points)) for ring in item.rings),
            item.label,
            item.certainty if item.HasField("certainty") else 1.0,
        )
        for item in record.scene.objects
    )
    route = frozen_floats(_points(record.route)) if record.route else None
    passages = tuple((passage.first, passage.second) for passage in record.passages)
    return Segmentation(Scene(objects), tuple(record.warnings), route, passages)


def without_store(field: str) -> StoreError:
    """Return what there is to say of a stored scene where none is kept."""
    return StoreError(
        f"{field} needs a store, and this server keeps nothing; start it with one, or send the "
        "source itself"
    )


@dataclass(frozen=True)
class Described:
    """Histograms of a scene, as a worker hands them in.

    Attributes
    ----------
    outlines, described_by
        Identities of the scene and of the histogram.
    histograms
        Shape (Q, n) of pairs, or (N, n) within objects.
    """

    outlines: str
    described_by: str
    histograms: FloatArray

    @classmethod
    def within(cls, scene: Scene) -> Described:
        """Return the histograms within the objects of a scene."""
        return cls(scene.identity, described_by(_OWN), own_histograms(scene.objects))

    def packed(self) -> bytes:
        """Return it as bytes."""
        head = json.dumps([self.outlines, self.described_by, self.histograms.shape[1]]).encode()
        return head + b"\n" + np.ascontiguousarray(self.histograms, dtype="<f8").tobytes()

    @classmethod
    def unpacked(cls, data: bytes) -> Described:
        """Return what :meth:`packed` made bytes of."""
        head, _, values = data.partition(b"\n")
        outlines, described_by, directions = json.loads(head)
        return cls(outlines, described_by, _table(values, directions))


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
        """The file, for a :class:`Shelf`."""
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
        source = _summed(zlib.compress(found.source.SerializeToString(deterministic=True), 1))
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
            found = connection.execute(_RECORD_OF, (name,)).fetchone()
            if found is None:
                return None
            created = _own(connection, name, caller, most)
            record = StoredScene.FromString(_unsummed(found[0]))
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
                source = _source(_unsummed(connection.execute(_SOURCE_OF, (name,)).fetchone()[0]))
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
                    problem = f"is {place}, which is no object; the scene has objects 0 to {last}"
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
            problem = f"is {page_size}; give a number up to {_LONGEST_PAGE}, or 0 for {_PAGE}"
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
                raise _not_kept(name, "name")
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
                    _summed(np.ascontiguousarray(described.histograms, dtype="<f8").tobytes()),
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


class Shelf:
    """Kept scenes, as those see them who match with them, in any process and thread.

    Parameters
    ----------
    path
        The archive's file; None where none is kept, but for those that come with requests.
    met
        Told of each scene that was decoded.
    """

    def __init__(self, path: Path | None, met: Callable[[Scene], None] = lambda _: None) -> None:
        self._file = None if path is None else Reading(path)
        self._met = met
        self._lock = Lock()
        self._held: OrderedDict[str, Segmentation] = OrderedDict()

    def close(self) -> None:
        """Close the file, until it is read again."""
        if self._file is not None:
            self._file.close()

    def forget(self) -> None:
        """Decode all scenes anew."""
        with self._lock:
            self._held.clear()

    def segmentation(self, name: str, caller: str, field: str) -> Segmentation:
        """Return a scene of a caller as it was found.

        Raises
        ------
        NotFoundError
            If the caller has put none of this name; the sentence begins with ``field``.
        StoreError
            If there is no file, or it cannot be read.
        """
        if self._file is None:
            raise without_store(field)
        record, _ = self._file.work(lambda connection: _kept(connection, name, caller, field))
        return self.decoded(name, record)

    def decoded(self, name: str, record: bytes) -> Segmentation:
        """Return the scene of a record, decoded once."""
        with self._lock:
            if (held := self._held.get(name)) is not None:
                self._held.move_to_end(name)
                return held
        found = segmentation(StoredScene.FromString(record))
        with self._lock:
            self._held[name] = found
            while len(self._held) > _HELD:
                self._held.popitem(last=False)
        self._met(found.scene)
        return found

    def record(self, name: str) -> bytes | None:
        """Return the record of a scene that somebody has put, or None."""
        return self._found(_RECORD_OF, name)

    def source(self, name: str) -> source_pb2.Source | None:
        """Return what a scene was found in, or None where it is not kept."""
        found = self._found(_SOURCE_OF, name)
        return None if found is None else _source(found)

    def histograms(self, scene: Scene, histogram: Histogram) -> FloatArray | None:
        """Return the histograms of a scene, or None where they are not kept, or damaged."""
        shape = pair_count(len(scene)), histogram.directions
        return self._table(scene, histogram.identity, shape)

    def own_histograms(self, scene: Scene) -> FloatArray | None:
        """Return the histograms within the objects of a scene, or None as :meth:`histograms`."""
        return self._table(scene, _OWN, (len(scene), OWN_DIRECTIONS // 2))

    def _table(self, scene: Scene, identity: str, shape: tuple[int, int]) -> FloatArray | None:
        found = self._found(_HISTOGRAMS_OF, scene.identity, described_by(identity))
        fits = found is not None and len(found) == 8 * shape[0] * shape[1]
        return _table(found, shape[1]) if found is not None and fits else None

    def _found(self, query: str, *keys: str) -> bytes | None:
        """Return what is kept, or None for nothing that can be read: who writes is told why."""
        if self._file is None:
            return None

        def job(connection: sqlite3.Connection) -> bytes | None:
            row = connection.execute(query, keys).fetchone()
            return None if row is None else _unsummed(row[0])

        try:
            return self._file.work(job)
        except StoreError:
            return None

    def holds(self, scene: Scene) -> bool:
        """Whether a scene came from here."""
        with self._lock:
            return any(held.scene is scene for held in self._held.values())


def described_by(identity: str) -> str:
    """Return what histograms are kept by: the algorithm's identity, and its version."""
    return f"{sketchmatch.__version__} {identity}"


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
            _summed(record.SerializeToString(deterministic=True)),
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
            f"with this scene you would keep {kept / _MIB:.3g} MiB here, and {most / _MIB:.3g} MiB "
            "are the limit for each caller; delete scenes that you do not need"
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


def _kept(connection: sqlite3.Connection, name: str, caller: str, field: str) -> tuple[bytes, str]:
    """Return the record of a scene of a caller, and its title."""
    found = connection.execute(
        "SELECT record, title FROM scenes JOIN owners USING (name) WHERE name = ? AND caller = ?",
        (name, caller),
    ).fetchone()
    if found is None:
        raise _not_kept(name, field)
    record, title = found
    return _unsummed(record), title


def _not_kept(name: str, field: str) -> NotFoundError:
    shown = name if _A_NAME.fullmatch(name) else quoted(name)
    return NotFoundError(
        f"{field} is {shown[:_NAMED]}, and you keep no scene of this name here; put it, or "
        "list those there are"
    )


def _record(connection: sqlite3.Connection, name: str, caller: str, field: str) -> StoredScene:
    """Return a scene of a caller, with its title."""
    kept, title = _kept(connection, name, caller, field)
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
            f"is {quoted(page_token)}; give the next_page_token of the response before, or none",
        )
    return min(int(time_), 2**63 - 1), name


def _source(kept: bytes) -> source_pb2.Source:
    """Return the source that is kept, compressed."""
    return source_pb2.Source.FromString(zlib.decompress(kept))


def _summed(data: bytes) -> bytes:
    """Return bytes with their checksum before them."""
    return zlib.crc32(data).to_bytes(_SUM_BYTES, "little") + data


def _unsummed(kept: bytes) -> bytes:
    """Return bytes without their checksum, if it fits.

    Raises
    ------
    DamagedError
        If it does not.
    """
    data = kept[_SUM_BYTES:]
    if zlib.crc32(data).to_bytes(_SUM_BYTES, "little") != kept[:_SUM_BYTES]:
        raise DamagedError
    return data


def _points(points: Any) -> FloatArray:
    flat = [value for point in points for value in (point.x, point.y)]
    return np.array(flat, dtype=np.float64).reshape(-1, 2)


def _table(data: bytes, directions: int) -> FloatArray:
    return sealed(np.frombuffer(data, dtype="<f8").reshape(-1, directions).astype(np.float64))
