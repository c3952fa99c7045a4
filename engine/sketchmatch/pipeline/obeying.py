r"""Making searchers obey that know nothing of what the caller rules out.

A searcher looks for the highest ζ. So it is given other relations and weights, whose ζ′ is higher
for every map that holds nothing ruled out than for any other. With S = w₁ + w₂ + w₃, e the
evidence of an entry, o = 0 where the entry rests on a pairing that is ruled out and else 1, and a
number r

    w₁′ = w₁ + rS,    e′ = (w₁e + rS·o) / w₁′,    ζ′ = (ζ + r·ō) / (1 + r).

ō, the mean of o, is 1 for a map that obeys, and ζ = ζ′(1 + r) − r: the order among these is that
of ζ, and a bound of ζ′ is one of their ζ. A pairing is part of N − 1 of the Q = N(N−1)/2 entries,
so for any other map ō ≤ 1 − 2/N. As ζ is within [0, 1], r > N/2 makes ζ′ of each such map less.
e′ is within [0, 1] as e is, and no searcher meets values that it does not expect.
"""

from __future__ import annotations

from collections.abc import Collection, Generator
from dataclasses import dataclass, replace
from itertools import combinations, islice

import numpy as np

from sketchmatch.api import Outcome, SearchProgress
from sketchmatch.model import (
    BoolArray,
    Fmap,
    IntArray,
    RelationTable,
    Weights,
    object_pairs,
)
from sketchmatch.model.arrays import sealed
from sketchmatch.pipeline.correspond import fmap_confidence, object_map, occm
from sketchmatch.pipeline.knowledge import matching
from sketchmatch.pipeline.slices import in_slices
from sketchmatch.pipeline.unmatched import Part, PartSearch

__all__ = ["Obedience", "first_parts", "obedience", "ruled_out"]

_MARGIN = 1.001
_FEW = 10
"""Parts to begin with at most, where not all objects can find a partner."""

_TRIED = 1000
"""Parts that are looked at for these."""


@dataclass(frozen=True, eq=False)
class Obedience:
    """How a searcher is made to obey in the search of a part, and what its answers mean.

    Attributes
    ----------
    part
        What is searched.
    weights
        Of ζ.
    allowed
        Shape (k, N'): the pairings of its objects that are not ruled out.
    table, searched
        The relations and the weights for the searcher.
    """

    part: Part
    weights: Weights
    allowed: BoolArray
    table: RelationTable
    searched: Weights

    def read(self, told: SearchProgress, former: PartSearch | None) -> PartSearch:
        """Return what a progress of the searcher means, after the former one."""
        table, fmap = self.part.table, told.fmap
        if former is not None and former.best.fmap is fmap:
            confidence, partners, obeys = former.best.confidence, former.partners, former.obeys
        else:
            confidence = fmap_confidence(fmap, table, self.weights).total
            partners = _partners_of(fmap, table)
            obeys = self._allows(
                object_map(occm(fmap, table)).partners if partners is None else partners
            )
        bound = told.upper_bound
        if bound is not None:
            ratio = self._ratio
            bound = max(confidence, min(1.0, bound * (1.0 + ratio) - ratio))
        progress = replace(told, confidence=confidence, upper_bound=bound)
        return PartSearch(self.part, progress, partners=partners, obeys=obeys)

    def mended(self, found: PartSearch) -> PartSearch:
        """Return what a search came to, with another map if that breaks what is known.

        The objects keep the partners that they may have, as far as that goes.
        """
        if found.obeys:
            return found
        table, best = self.part.table, found.best
        matrix = occm(best.fmap, table)
        preference = matrix.evidence.copy()
        kept = object_map(matrix).partners if found.partners is None else found.partners
        preference[np.arange(len(kept)), kept] = np.inf
        partners = matching(self.allowed, preference)
        fmap = Fmap.from_object_map(partners, table.argument_objects)
        confidence = fmap_confidence(fmap, table, self.weights).total
        return replace(
            found,
            best=replace(best, fmap=fmap, confidence=confidence),
            outcome=Outcome.CONVERGED if found.outcome is Outcome.OPTIMAL else found.outcome,
            partners=sealed(partners),
            obeys=True,
        )

    @property
    def _ratio(self) -> float:
        return _ratio(self.part.table)

    def _allows(self, partners: IntArray) -> bool:
        return bool(self.allowed[np.arange(len(partners)), partners].all())


def obedience(
    part: Part, weights: Weights, allowed: BoolArray
) -> Generator[float, None, Obedience]:
    """Return how to make a searcher obey in the search of a part.

    Parameters
    ----------
    part, weights
        What is searched.
    allowed
        Shape (k, N'): the pairings that are not ruled out.

    Yields
    ------
    float
        The share that is done.
    """
    table = part.table
    pairs, (c, d) = object_pairs(table.template_objects), object_pairs(table.argument_objects).T
    half, added = table.argument_pairs, _ratio(table) * sum(weights)
    most = weights[0] + added
    known, directed = weights[0] / most, table.evidence is not None
    evidence = np.empty((table.template_pairs, 2 * half))

    def work(first: int, last: int) -> None:
        for i in range(first, last):
            a, b = pairs[i]
            own, row = table.entry_evidence[i], evidence[i]
            row[:half] = allowed[a, c] & allowed[b, d]
            row[half:] = allowed[a, d] & allowed[b, c]
            row *= added / most
            row[:half] += known * own[:half]
            row[half:] += known * (own[half:] if directed else own)

    yield from in_slices(len(pairs), work)
    np.clip(evidence, 0.0, 1.0, out=evidence)
    lowered = replace(table, evidence=sealed(evidence))
    return Obedience(part, weights, allowed, lowered, (most, weights[1], weights[2]))


def ruled_out(allowed: BoolArray | None, pinned: IntArray, table: RelationTable) -> BoolArray:
    """Return the pairings that are not ruled out, by known partners neither.

    Parameters
    ----------
    allowed
        Shape (N, N'): those that nothing else rules out; None for all.
    pinned
        Shape (N,): the known partners, −1 where none is known.
    table
        Of N and N' objects.
    """
    known = np.flatnonzero(pinned >= 0)
    left = np.ones((table.template_objects, table.argument_objects), dtype=np.bool_)
    left[known] = False
    left[:, pinned[known]] = False
    left[known, pinned[known]] = True
    return sealed(left if allowed is None else left & allowed)


def first_parts(allowed: BoolArray, fixed: Collection[int]) -> list[tuple[int, ...]]:
    """Return with which template objects to begin: as many as can all find a partner.

    Parameters
    ----------
    allowed
        Shape (N, N').
    fixed
        The objects that must be among them.

    Returns
    -------
    list
        Of objects in ascending order; ten at most, where these can be chosen in several ways.
    """
    free = np.flatnonzero(allowed.any(axis=1)).tolist()
    found = tuple(np.flatnonzero(matching(allowed) >= 0).tolist())
    if len(found) == len(free):
        return [found]
    must = set(fixed)
    others = (
        kept
        for kept in islice(combinations(free, len(found)), _TRIED)
        if kept != found and must <= set(kept) and (matching(allowed[list(kept)]) >= 0).all()
    )
    return [found, *islice(others, _FEW - 1)]


def _ratio(table: RelationTable) -> float:
    """Return r."""
    return _MARGIN * 0.5 * table.template_objects


def _partners_of(fmap: Fmap, table: RelationTable) -> IntArray | None:
    """Return the object map that induces a histogram map; None if none does."""
    partners = np.full(table.template_objects, -1)
    half = table.argument_pairs
    ends = object_pairs(table.argument_objects)[fmap.entries % half]
    ends = np.where((fmap.entries >= half)[:, None], ends[:, ::-1], ends)
    partners[object_pairs(table.template_objects)] = ends
    if len(np.unique(partners)) < len(partners):
        return None
    induced = Fmap.from_object_map(partners, table.argument_objects)
    return sealed(partners) if np.array_equal(induced.entries, fmap.entries) else None
