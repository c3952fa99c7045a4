"""Leaving objects without partner on both sides, where that is likelier than any pairing.

A map that leaves u of the N template objects out is worth ζ − price·u/N: ζ of the others, less
what leaving out costs. Searchers know nothing of it: they are given parts of the relation table.
"""

from __future__ import annotations

from collections.abc import Collection, Generator, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from sketchmatch.api import Outcome, SearchProgress
from sketchmatch.kernels import exchange
from sketchmatch.kernels.evidence import SelfRelations
from sketchmatch.model import (
    Confidence,
    FloatArray,
    Fmap,
    IntArray,
    ObjectMap,
    RelationTable,
    Weights,
    object_pairs,
)
from sketchmatch.model.arrays import sealed
from sketchmatch.model.caching import cached_property
from sketchmatch.pipeline.correspond import (
    entry_relations,
    fmap_confidence,
    induced_map,
    object_map,
    occm,
)
from sketchmatch.pipeline.guard import FEWEST
from sketchmatch.pipeline.slices import in_slices

__all__ = [
    "Part",
    "PartSearch",
    "Rival",
    "Trial",
    "net_confidence",
    "omission_confidences",
    "part_of",
    "trials",
]

_Item = TypeVar("_Item", bound=np.generic)

_FEW = 10
"""Template objects up to which each is left out in turn."""

_WIDTH = 5
"""Parts of each size that are searched where there are more."""

_BRANCHES = 3
"""Parts of each size that one object more is taken from."""

# Beyond this many entries in all, ζ without each object in turn would take too long at once.
_MOST_ENTRIES = 3_000_000


@dataclass(frozen=True, eq=False)
class Part:
    """The relations of some of the template objects.

    Attributes
    ----------
    kept
        Shape (k,): which objects of the template these are, in ascending order.
    objects
        N, how many the template has.
    table
        Their relations.
    own
        How they compare themselves; None where that does not count.
    """

    kept: IntArray
    objects: int
    table: RelationTable
    own: SelfRelations | None = None

    @classmethod
    def whole(cls, table: RelationTable, own: SelfRelations | None = None) -> Part:
        """Return the part that leaves nothing out."""
        return cls(np.arange(table.template_objects), table.template_objects, table, own)

    @property
    def left_out(self) -> int:
        """u, the number of objects that are left out."""
        return self.objects - len(self.kept)

    def known(self, values: NDArray[_Item] | None) -> NDArray[_Item] | None:
        """Return the rows of its objects, of what has one for each object of the template."""
        return values if values is None or not self.left_out else values[self.kept]

    def in_whole(self, partners: IntArray) -> IntArray:
        """Return a map of its objects as one of the whole template: −1 for all others."""
        whole = np.full(self.objects, -1)
        whole[self.kept] = partners
        return whole


@dataclass(frozen=True)
class Trial:
    """What to search next.

    Attributes
    ----------
    kept
        The template objects that are to find a partner, in ascending order.
    share
        Of the time that is left, what the search may take.
    """

    kept: tuple[int, ...]
    share: float = 1.0


@dataclass(frozen=True, eq=False)
class PartSearch:
    """What the search of a part has come to.

    Attributes
    ----------
    part
        What was searched.
    best
        The last progress.
    outcome
        Why it ended.
    partners
        The map of the part, where more is known of it than its histogram map says.
    obeys
        Whether it holds nothing that the caller rules out.
    """

    part: Part
    best: SearchProgress
    outcome: Outcome = Outcome.TIME_BUDGET
    partners: IntArray | None = None
    obeys: bool = True

    def value(self, price: float) -> float:
        """Return what the best map is worth; −inf if it is ruled out."""
        if not self.obeys:
            return -np.inf
        return net_confidence(self.best.confidence, self.part.left_out, self.part.objects, price)

    @cached_property
    def mapped(self) -> ObjectMap:
        """The object map, of the objects of the part alone."""
        if self.partners is not None:
            return induced_map(self.partners, self.part.table)
        return object_map(occm(self.best.fmap, self.part.table))

    def rival(self, weights: Weights) -> Rival:
        """Return the map found, without the relations, which may be large."""
        part = self.part
        confidence = fmap_confidence(self.best.fmap, part.table, weights, part.own)
        return Rival(part.kept, part.objects, self.mapped, confidence)


@dataclass(frozen=True, eq=False)
class Rival:
    """An object map that may be the answer, of all objects or of some.

    Attributes
    ----------
    kept, objects
        As in :class:`Part`.
    mapped
        The object map, of the kept objects alone.
    confidence
        ζ of its FMAP, and the parts.
    """

    kept: IntArray
    objects: int
    mapped: ObjectMap
    confidence: Confidence

    @cached_property
    def partners(self) -> IntArray:
        """The map of the whole template, shape (N,): −1 for an object that is left out."""
        partners = np.full(self.objects, -1)
        partners[self.kept] = self.mapped.partners
        return sealed(partners)

    def value(self, price: float) -> float:
        """Return what the map is worth."""
        left_out = self.objects - len(self.kept)
        return net_confidence(self.confidence.total, left_out, self.objects, price)


def net_confidence(confidence: float, left_out: int, objects: int, price: float) -> float:
    """Return ζ − price·u/N, what a map is worth that leaves u of N template objects out.

    Examples
    --------
    >>> net_confidence(0.9, left_out=1, objects=8, price=0.4)
    0.85
    """
    return confidence - price * left_out / objects if left_out else confidence


def trials(
    first: Sequence[tuple[int, ...]],
    weights: Weights,
    price: float,
    fixed: Collection[int] = (),
) -> Generator[Trial, PartSearch, None]:
    """Say which parts of a template to search, given what came of those before.

    First comes all of it. Then each object is left out in turn, or, of more than ten, the five
    without which ζ of the map found is highest; then one object more, from the best three parts;
    and so on until that makes nothing better. So of two maps, the later one that is worth more
    has the higher ζ.

    Parameters
    ----------
    first
        The objects to begin with, in ascending order: all, or, where not all can find a partner,
        as many as can, in several ways.
    weights
        Of ζ.
    price
        Of leaving out; infinite where that is not allowed.
    fixed
        The objects that are not left out.

    Yields
    ------
    Trial
        What to search; what was found is to be sent.
    """
    objects = len(first[0])
    most = objects - max(FEWEST, len(fixed)) if price < np.inf else 0
    level = []
    for k, kept in enumerate(first):
        found = yield Trial(kept, share=(0.5 if most > 0 else 1.0) / (len(first) - k))
        level.append(_Lead.of(found, weights, price))
    level.sort(key=lambda lead: -lead.value)
    for _ in range(most):
        best, wanted = level[0].value, _without_one_more(level[:_BRANCHES], objects, fixed)
        level = []
        for k, kept in enumerate(wanted):
            found = yield Trial(kept, share=1.0 / (len(wanted) - k + 1))
            level.append(_Lead.of(found, weights, price))
        level.sort(key=lambda lead: -lead.value)
        if not level or level[0].value <= best:
            return


def part_of(whole: Part, kept: Iterable[int]) -> Generator[float, None, Part]:
    """Return the relations of some of the objects, at least two.

    Yields
    ------
    float
        The share that is done.
    """
    chosen = np.array(list(kept))
    if len(chosen) == whole.objects:
        return whole
    table, own = whole.table, whole.own
    rows = np.flatnonzero(np.isin(object_pairs(whole.objects), chosen).all(axis=1))
    relations = [table.similarity, table.rotation, table.dilation]
    if table.evidence is not None:
        relations.append(table.evidence)
    copies = [np.empty((len(rows), array.shape[1])) for array in relations]

    def work(first: int, last: int) -> None:
        for array, copy in zip(relations, copies, strict=True):
            copy[first:last] = array[rows[first:last]]

    yield from in_slices(len(rows), work)
    similarity, rotation, dilation, *evidence = (sealed(copy) for copy in copies)
    part = RelationTable(
        similarity,
        rotation,
        dilation,
        len(chosen),
        table.argument_objects,
        evidence[0] if evidence else None,
        table.rotation_weights[rows],
    )
    if own is not None:
        own = SelfRelations(*(sealed(each[chosen]) for each in own))
    return Part(chosen, whole.objects, part, own)


def omission_confidences(fmap: Fmap, table: RelationTable, weights: Weights) -> FloatArray | None:
    """Return ζ of a map without each of its objects in turn.

    Returns
    -------
    ndarray
        Shape (N,); None where there are too many objects, or fewer than 4: ζ of two means nothing.
    """
    objects, pairs = table.template_objects, object_pairs(table.template_objects)
    if objects <= FEWEST or objects * len(pairs) > _MOST_ENTRIES:
        return None
    return exchange.omission_confidences(
        sealed(np.zeros(len(pairs), dtype=np.int64)),
        pairs,
        table.rotation_weights,
        entry_relations(fmap, table, weights),
    )


@dataclass(frozen=True)
class _Lead:
    """What is left of a search for the next: its objects, its worth, and ζ without each object."""

    kept: tuple[int, ...]
    value: float
    without: tuple[float, ...]

    @classmethod
    def of(cls, found: PartSearch, weights: Weights, price: float) -> _Lead:
        without = omission_confidences(found.best.fmap, found.part.table, weights)
        return cls(
            tuple(found.part.kept.tolist()),
            found.value(price),
            () if without is None else tuple(without.tolist()),
        )


def _without_one_more(
    level: Iterable[_Lead], objects: int, fixed: Collection[int]
) -> list[tuple[int, ...]]:
    """Return what is kept where some parts lose an object more, the most promising first."""
    promise: dict[tuple[int, ...], float] = {}
    for lead in level:
        for g, value in enumerate(lead.without):
            if lead.kept[g] in fixed:
                continue
            kept = lead.kept[:g] + lead.kept[g + 1 :]
            promise[kept] = max(value, promise.get(kept, value))
    width = objects if objects <= _FEW else _WIDTH
    return sorted(promise, key=lambda kept: -promise[kept])[:width]
