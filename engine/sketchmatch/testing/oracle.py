"""FMAPs, their confidence and the best of them, by loops: slow, obvious, and without a kernel.

An entry here is an ordered pair of argument objects, and a table a function of it: nothing is
packed into indices, but for the reading of a :class:`~sketchmatch.model.Fmap`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from sketchmatch.model import Confidence, Fmap, Pairs, RelationTable, Weights

__all__ = ["best_object_map", "is_legal", "is_object_consistent", "mapped_pairs", "score_fmap"]

_EQUAL: Weights = (1.0, 1.0, 1.0)


def score_fmap(fmap: Fmap, table: RelationTable, weights: Weights = _EQUAL) -> Confidence:
    """Return ζ of a histogram map and its parts, as they are defined (thesis, section 3.4).

    Parameters
    ----------
    fmap
        Any FMAP into the table, legal or not.
    table
        The relations.
    weights
        Of ζσ, ζR and ζL.

    Examples
    --------
    Two equal objects onto two that are turned by a quarter:

    >>> table = RelationTable([[0.5]], [[math.pi / 2]], [[2.0]], 2, 2)
    >>> score_fmap(Fmap([0]), table, weights=(2, 1, 1)).total
    0.75
    """
    return Confidence(*score_pairs(table, mapped_pairs(fmap, table), weights))


def best_object_map(
    table: RelationTable, weights: Weights = _EQUAL
) -> tuple[float, tuple[int, ...]]:
    """Return the highest ζ of all object maps, and the map, by trying every one.

    Of N onto N' objects there are N'!/(N'−N)!: 5 onto 6 take some 30 ms, 6 onto 8 a second.

    Examples
    --------
    >>> table = RelationTable([[0.1, 1.0, 0.2]], [[0.0, 0.0, 0.0]], [[1.0, 1.0, 1.0]], 2, 3)
    >>> best_object_map(table)
    (1.0, (2, 0))
    """
    every = itertools.permutations(range(table.argument_objects), table.template_objects)
    return max((score_pairs(table, induced(p), weights)[0], p) for p in every)


def mapped_pairs(fmap: Fmap, table: RelationTable) -> list[tuple[int, int]]:
    """Return the ordered pair of argument objects that each template pair is mapped to, from 0.

    Examples
    --------
    >>> mapped_pairs(Fmap([4, 5, 0]), RelationTable(*[[[1.0] * 3] * 3] * 3, 3, 3))
    [(2, 0), (2, 1), (0, 1)]
    """
    return read(fmap.entries.tolist(), table.argument_objects)


def is_legal(fmap: Fmap, table: RelationTable) -> bool:
    """Whether no argument pair is used twice, be it as such or as its dual (thesis 3.4)."""
    return is_pairwise_legal(mapped_pairs(fmap, table))


def is_object_consistent(fmap: Fmap, table: RelationTable) -> bool:
    """Whether one injective object map induces the FMAP."""
    return is_object_legal(mapped_pairs(fmap, table), table.template_objects)


def score_pairs(
    table: RelationTable, mapped: Pairs, weights: Weights = _EQUAL
) -> tuple[float, float, float, float]:
    """Return ζ, ζσ, ζR and ζL of an FMAP given as ordered argument pairs.

    Where the table holds evidence, its mean takes the place of ζσ in ζ.
    """
    entries = [look_up(table, i, pair) for i, pair in enumerate(mapped)]
    count = len(entries)
    zeta_s = sum(sigma for sigma, _, _ in entries) / count
    speaks = sum(evidence(table, i, pair) for i, pair in enumerate(mapped)) / count
    turns = [complex(math.cos(r), math.sin(r)) for _, r, _ in entries]
    counts = [float(table.rotation_weights[i]) for i in range(count)]
    zeta_r = abs(sum(w * turn for w, turn in zip(counts, turns, strict=True))) / sum(counts)
    levels = [1.5 / math.log(2) * math.log(dilation) for _, _, dilation in entries]
    gaps = [abs(x - y) for k, x in enumerate(levels) for y in levels[k + 1 :]]
    zeta_l = math.exp(-math.log(2) * (sum(gaps) / len(gaps) if gaps else 0.0))
    w1, w2, w3 = (weight / sum(weights) for weight in weights)
    return w1 * speaks + w2 * zeta_r + w3 * zeta_l, zeta_s, zeta_r, zeta_l


def look_up(table: RelationTable, i: int, pair: tuple[int, int]) -> tuple[float, float, float]:
    """Return σ, R and L of template pair i on an ordered argument pair."""
    c, d = pair
    column = correspondence(min(c, d) + 1, max(c, d) + 1, table.argument_objects)
    turn = 0.0 if c < d else math.pi
    return (
        float(table.similarity[i, column]),
        float(table.rotation[i, column]) + turn,
        float(table.dilation[i, column]),
    )


def evidence(table: RelationTable, i: int, pair: tuple[int, int]) -> float:
    """Return what template pair i on an ordered argument pair counts for beside R and L."""
    if table.evidence is None:
        return look_up(table, i, pair)[0]
    c, d = pair
    return float(table.evidence[i, correspondence(c + 1, d + 1, table.argument_objects)])


def correspondence(a: int, b: int, objects: int) -> int:
    """Return the index of the ordered pair (a, b), all counted from 1 (thesis, section 3.3)."""
    if a > b:
        return correspondence(b, a, objects) + objects * (objects - 1) // 2
    return (b - 1) + (a - 1) * objects - sum(k + 1 for k in range(a))


def read(entries: Sequence[int], argument_objects: int) -> list[tuple[int, int]]:
    """Return the ordered pair of argument objects of each entry of an FMAP, from 0."""
    meaning = {
        correspondence(c + 1, d + 1, argument_objects): (c, d)
        for c in range(argument_objects)
        for d in range(argument_objects)
        if c != d
    }
    return [meaning[int(entry)] for entry in entries]


def pairs(objects: int) -> list[tuple[int, int]]:
    """Return the template pairs in the order of their index."""
    return [(a, b) for a in range(objects) for b in range(a + 1, objects)]


def induced(partners: Sequence[int]) -> list[tuple[int, int]]:
    """Return the FMAP of an object map, as ordered pairs."""
    return [(partners[a], partners[b]) for a, b in pairs(len(partners))]


def is_pairwise_legal(mapped: Pairs) -> bool:
    """Whether no argument pair is used twice, in either order."""
    return len({frozenset(pair) for pair in mapped}) == len(mapped)


def is_object_legal(mapped: Pairs, template_objects: int) -> bool:
    """Whether one injective object map leads to these pairs."""
    partners: dict[int, int] = {}
    for (a, b), (c, d) in zip(pairs(template_objects), mapped, strict=True):
        if partners.setdefault(a, c) != c or partners.setdefault(b, d) != d:
            return False
    return len(set(partners.values())) == template_objects
