"""Scenes that are kept, as whoever matches with them reads them: under the hash of what they are.

A scene is a record, the message ``StoredScene``, that is decoded once. Beside it lie its source,
and the histograms of its pairs and those within its objects, which the worker that computed them
hands in. Each of these carries a checksum. What does not fit it is damaged: histograms are computed
and kept again, and a scene is mended where it is put again. ``scenes`` writes all this.
"""

from __future__ import annotations

import json
import re
import sqlite3
import zlib
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

import sketchmatch
from sketchmatch.api import Histogram, Segmentation, Segmenter
from sketchmatch.api.forces import OWN_DIRECTIONS, own_histograms
from sketchmatch.app.store import DamagedError, Reading
from sketchmatch.errors import InvalidInputError, NotFoundError, Reason, StoreError, quoted
from sketchmatch.model import FloatArray, Scene, SceneObject, pair_count
from sketchmatch.model.arrays import frozen_floats, sealed
from sketchmatch.model.labels import cleaned_label
from sketchmatch.registry import Registry
from sketchmatch_proto.v1 import source_pb2
from sketchmatch_proto.v1.scene_service_pb2 import StoredScene

__all__ = [
    "LARGEST_KEPT",
    "RECORD_OF",
    "SOURCE_OF",
    "Described",
    "Shelf",
    "cleaned_title",
    "described_by",
    "kept_record",
    "name_of",
    "not_kept",
    "segmentation",
    "source_of",
    "summed",
    "unsummed",
    "without_store",
]

RECORD_OF = "SELECT record FROM scenes WHERE name = ?"
"""Finds a record, with its checksum, by the name of the scene; the next one its source."""
SOURCE_OF = "SELECT source FROM contents JOIN scenes USING (content) WHERE name = ?"
_HISTOGRAMS_OF = "SELECT bytes FROM histograms WHERE outlines = ? AND described_by = ?"
LARGEST_KEPT = 32 * 1024 * 1024
"""Bytes of the histograms of a scene above which these are computed again."""

_OWN = f"within objects, {OWN_DIRECTIONS}"
_SUM_BYTES = 4
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
        problem = f"has {len(title)} characters; give at most {_LONGEST_TITLE}"
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
        f"{field} needs a store, but this server keeps nothing; start it with a store, or send the "
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
        record, _ = self._file.work(lambda connection: kept_record(connection, name, caller, field))
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
        return self._found(RECORD_OF, name)

    def source(self, name: str) -> source_pb2.Source | None:
        """Return what a scene was found in, or None where it is not kept."""
        found = self._found(SOURCE_OF, name)
        return None if found is None else source_of(found)

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
            return None if row is None else unsummed(row[0])

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


def kept_record(
    connection: sqlite3.Connection, name: str, caller: str, field: str
) -> tuple[bytes, str]:
    """Return the record of a scene of a caller, and its title."""
    found = connection.execute(
        "SELECT record, title FROM scenes JOIN owners USING (name) WHERE name = ? AND caller = ?",
        (name, caller),
    ).fetchone()
    if found is None:
        raise not_kept(name, field)
    record, title = found
    return unsummed(record), title


def not_kept(name: str, field: str) -> NotFoundError:
    """Return what there is to say where a caller has put no scene of a name."""
    shown = name if _A_NAME.fullmatch(name) else quoted(name)
    return NotFoundError(
        f"{field} is {shown[:_NAMED]}, but you have stored no scene of this name on this server; "
        "store it first, or list your scenes"
    )


def source_of(kept: bytes) -> source_pb2.Source:
    """Return the source that is kept, compressed."""
    return source_pb2.Source.FromString(zlib.decompress(kept))


def summed(data: bytes) -> bytes:
    """Return bytes with their checksum before them."""
    return zlib.crc32(data).to_bytes(_SUM_BYTES, "little") + data


def unsummed(kept: bytes) -> bytes:
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
