"""What was described and compared before: scenes, their pairs of objects, rows of tables."""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import NamedTuple
from weakref import WeakValueDictionary

import numpy as np

from sketchmatch.api import Histogram, Similarity
from sketchmatch.model import (
    BoolArray,
    FloatArray,
    IntArray,
    RelationTable,
    Scene,
    SceneDescriptor,
    SceneObject,
    object_pairs,
    pair_index,
)

__all__ = ["Lookups", "Memory"]

_RECENT = 16
_BYTES = 128 * 1024 * 1024
_TABLE_BYTES = 4 * 1024 * 1024
"""What a table of relations, and the histograms of its rows, may take to be remembered."""


@dataclass(frozen=True)
class _Described:
    """A scene whose histograms were met lately, with the place of each object by its outline."""

    key: tuple[str, str]
    scene: Scene
    places: dict[bytes, int]


@dataclass(frozen=True)
class _Related:
    """A table of relations, with the place of each row by the histogram that it compares."""

    key: tuple[str, ...]
    places: dict[bytes, int]
    table: RelationTable


class Lookups(NamedTuple):
    """How often the histograms of a scene were needed, by where they came from.

    Attributes
    ----------
    held
        They were in memory.
    kept
        They were kept elsewhere, and read.
    computed
        They had to be computed.
    """

    held: int = 0
    kept: int = 0
    computed: int = 0


class Memory:
    """Histograms and relations that need not be computed again; several threads may use it.

    What it returns is what would be computed, to the last digit: whoever remembers answers like
    everybody else.

    Parameters
    ----------
    max_bytes
        Of the histograms of whole scenes that it holds; those used longest ago go first.
    fetch
        Returns the histograms of a scene that are kept elsewhere, by its identity and that of the
        histogram; None where there are none.
    described
        Told of each scene that had to be described, with its histograms.
    """

    def __init__(
        self,
        max_bytes: int = _BYTES,
        fetch: Callable[[Scene, Histogram], FloatArray | None] = lambda *_: None,
        described: Callable[[Scene, SceneDescriptor], None] = lambda *_: None,
    ) -> None:
        self._max_bytes = max_bytes
        self._fetch = fetch
        self._described = described
        self._lock = Lock()
        self._bytes = 0
        self._lookups = Lookups()
        self._known: OrderedDict[tuple[str, str], SceneDescriptor] = OrderedDict()
        self._recent: deque[_Described] = deque(maxlen=_RECENT)
        self._related: deque[_Related] = deque(maxlen=_RECENT)
        self._objects: WeakValueDictionary[tuple[object, ...], SceneObject] = WeakValueDictionary()

    def forget(self) -> None:
        """Compute everything anew."""
        with self._lock:
            self._bytes = 0
            for held in (self._known, self._recent, self._related, self._objects):
                held.clear()

    def met(self, scene: Scene) -> Scene:
        """Return a scene that was just found, with the objects that were met before in it.

        They take the places of those like them, as what is measured of an object is kept with it.
        """
        with self._lock:
            objects = tuple(
                self._objects.setdefault((_outline(item), item.label, item.certainty), item)
                for item in scene.objects
            )
        alike = all(one is other for one, other in zip(objects, scene.objects, strict=True))
        return scene if alike else Scene(objects)

    def descriptor(self, scene: Scene, histogram: Histogram) -> SceneDescriptor | None:
        """Return the histograms of a scene, or None where they have to be computed."""
        key = scene.identity, histogram.identity
        with self._lock:
            if (known := self._known.get(key)) is not None:
                self._known.move_to_end(key)
                self._count(held=1)
                return known
        found = self._fetch(scene, histogram)
        if found is None:
            return None
        known = SceneDescriptor(found, len(scene), histogram.exponent, key[1], key[0])
        with self._lock:
            self._count(kept=1)
        self._hold(scene, known)
        return known

    def keep(self, scene: Scene, descriptor: SceneDescriptor) -> None:
        """Remember the histograms of a scene, which had to be computed."""
        with self._lock:
            self._count(computed=1)
        self._hold(scene, descriptor)
        self._described(scene, descriptor)

    def take_lookups(self) -> Lookups:
        """Return how often histograms were needed since this was asked last."""
        with self._lock:
            taken, self._lookups = self._lookups, Lookups()
        return taken

    def _count(self, held: int = 0, kept: int = 0, computed: int = 0) -> None:
        before = self._lookups
        self._lookups = Lookups(before.held + held, before.kept + kept, before.computed + computed)

    def _hold(self, scene: Scene, descriptor: SceneDescriptor) -> None:
        key, size = (descriptor.scene, descriptor.described_by), descriptor.histograms.nbytes
        places = {_outline(item): k for k, item in enumerate(scene.objects)}
        with self._lock:
            if key in self._known or size > self._max_bytes:
                return
            self._recent.appendleft(_Described(key, scene, places))
            self._known[key] = descriptor
            self._bytes += size
            while self._bytes > self._max_bytes:
                _, old = self._known.popitem(last=False)
                self._bytes -= old.histograms.nbytes

    def pairs(self, scene: Scene, histogram: Histogram) -> tuple[BoolArray, FloatArray] | None:
        """Return which pairs of a scene are known from another one, and their histograms.

        Returns
        -------
        tuple or None
            Shapes (Q,) and (Q, n), of which only the rows of known pairs mean anything; None where
            nothing is known.
        """
        if not histogram.of_pairs:
            return None
        wanted = histogram.identity
        with self._lock:
            recent = [
                (each, self._known[each.key])
                for each in self._recent
                if each.key[1] == wanted and each.key in self._known
            ]
        outlines = [_outline(item) for item in scene.objects]
        best: tuple[int, _Described, SceneDescriptor] | None = None
        for each, descriptor in recent:
            if each.scene.middle == scene.middle:
                shared = sum(outline in each.places for outline in outlines)
                if shared >= 2 and (best is None or shared > best[0]):
                    best = shared, each, descriptor
        if best is None:
            return None
        _, other, descriptor = best
        return _copied([other.places.get(outline, -1) for outline in outlines], descriptor)

    def rows(
        self, template: SceneDescriptor, argument: SceneDescriptor, similarity: Similarity
    ) -> tuple[BoolArray, tuple[FloatArray, FloatArray, FloatArray]] | None:
        """Return which rows of a table are known from another one, and σ, R and L of them.

        Returns
        -------
        tuple or None
            Shapes (Q,) and, three times, (Q, Q'/2), of which only known rows mean anything; None
            where nothing is known.
        """
        key = _compared(template, argument, similarity)
        with self._lock:
            recent = [each for each in self._related if each.key == key]
        if not recent:
            return None
        wanted = [row.tobytes() for row in template.histograms]
        best = max(recent, key=lambda each: sum(row in each.places for row in wanted))
        former = np.array([best.places.get(row, -1) for row in wanted])
        known = former >= 0
        return (known, _rows(best.table, former, known)) if known.any() else None

    def keep_rows(
        self,
        template: SceneDescriptor,
        argument: SceneDescriptor,
        similarity: Similarity,
        table: RelationTable,
    ) -> None:
        """Remember how the histograms of two scenes compare, unless that is too much."""
        if template.histograms.nbytes + 3 * table.similarity.nbytes > _TABLE_BYTES:
            return
        places = {row.tobytes(): k for k, row in enumerate(template.histograms)}
        related = _Related(_compared(template, argument, similarity), places, table)
        with self._lock:
            self._related.appendleft(related)


def _compared(
    template: SceneDescriptor, argument: SceneDescriptor, similarity: Similarity
) -> tuple[str, ...]:
    """Return what a row of a table depends on beside its own histogram."""
    return template.described_by, argument.described_by, argument.scene, similarity.identity


def _rows(
    table: RelationTable, former: IntArray, known: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return σ, R and L with the known rows of a table in their new places."""
    shape = (former.size, table.argument_pairs)
    sigma, rotation, dilation = np.empty(shape), np.empty(shape), np.empty(shape)
    sigma[known] = table.similarity[former[known]]
    rotation[known] = table.rotation[former[known]]
    dilation[known] = table.dilation[former[known]]
    return sigma, rotation, dilation


def _outline(item: SceneObject) -> bytes:
    return b"|".join(ring.tobytes() for ring in item.rings)


def _copied(former: list[int], descriptor: SceneDescriptor) -> tuple[BoolArray, FloatArray]:
    """Return what a descriptor says of pairs of objects that come in the same order there."""
    a, b = np.array(former)[object_pairs(len(former))].T
    known = (a >= 0) & (a < b)
    histograms = np.empty((len(a), descriptor.directions))
    rows = pair_index(a[known], b[known], descriptor.objects)
    histograms[known] = descriptor.histograms[rows]
    return known, histograms
