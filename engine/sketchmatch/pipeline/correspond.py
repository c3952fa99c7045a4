"""From a histogram map to the object map, and how sure it is (thesis 3.6.1, 3.9, 3.10)."""

from __future__ import annotations

import math

import numpy as np

from sketchmatch.kernels import confidence as kernels
from sketchmatch.kernels.evidence import SelfRelations, mean_parts
from sketchmatch.model import (
    DILATION_SCALE,
    Confidence,
    FloatArray,
    Fmap,
    IntArray,
    ObjectMap,
    Occm,
    RelationTable,
    Weights,
    object_pairs,
    pair_index,
)
from sketchmatch.model.arrays import sealed

__all__ = [
    "confidence_relations",
    "entry_relations",
    "fmap_confidence",
    "global_dilation",
    "global_rotation",
    "induced_map",
    "map_confidence",
    "object_map",
    "occm",
    "own_confidence",
]

# Sums of the same similarities in another order differ by less than this.
_TIE = 1e-12


def fmap_confidence(
    fmap: Fmap,
    table: RelationTable,
    weights: Weights = (1.0, 1.0, 1.0),
    own: SelfRelations | None = None,
) -> Confidence:
    """Return ζ of a histogram map and its parts.

    Parameters
    ----------
    fmap
        Any FMAP into the table.
    table
        The relations. Where they hold evidence, its mean takes the place of ζσ in ζ.
    weights
        Of ζσ, ζR and ζL.
    own
        How the objects compare, for ζS and ζM beside the others.

    Examples
    --------
    A perfect map of two objects onto two objects turned by a quarter:

    >>> table = RelationTable([[1.0]], [[math.pi / 2]], [[2.0]], 2, 2)
    >>> fmap_confidence(Fmap([0]), table)
    Confidence(total=1.0, similarity=1.0, rotation=1.0, dilation=1.0, shape=None, size=None)
    """
    total, similarity, rotation, dilation = _alone(entry_relations(fmap, table, weights))
    if table.evidence is not None:
        similarity = _entry_similarity(fmap, table).mean()
    shape, size = (None, None) if own is None else own_confidence(fmap, table, own)
    return Confidence(
        float(total), float(similarity), float(rotation), float(dilation), shape, size
    )


def confidence_relations(
    table: RelationTable, weights: Weights
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the evidence, cos R, sin R, L̂ and the weights, as kernels of ζ take them."""
    return (
        table.entry_evidence,
        table.cosine,
        table.sine,
        table.normalized_dilation,
        np.array(weights, dtype=np.float64),
    )


def entry_relations(
    fmap: Fmap, table: RelationTable, weights: Weights, rows: IntArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return what :func:`confidence_relations` does, of the entries of one histogram map alone.

    Each has one column; sines of a whole table would take seconds where objects are many.

    Parameters
    ----------
    fmap
        The histogram map.
    table, weights
        The relations, and the weights of the parts of ζ.
    rows
        The template pairs that the map is of, where these are not all.
    """
    rows = np.arange(table.template_pairs) if rows is None else rows
    entries, half = fmap.entries, table.argument_pairs
    columns = entries % half
    turns = table.rotation[rows, columns]
    turned = np.where(entries >= half, -1.0, 1.0) * table.rotation_weights[rows]
    evidence = table.entry_evidence[rows, columns if table.evidence is None else entries]
    level = DILATION_SCALE * np.log(table.dilation[rows, columns])
    return (
        sealed(evidence[:, None]),
        sealed((turned * np.cos(turns))[:, None]),
        sealed((turned * np.sin(turns))[:, None]),
        sealed(level[:, None]),
        np.array(weights, dtype=np.float64),
    )


def _alone(
    relations: tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray],
) -> tuple[float, float, float, float]:
    """Return ζ and its parts of the one histogram map that relations are of."""
    count = len(relations[0])
    first = sealed(np.zeros(count, dtype=np.int64))
    return kernels.fmap_confidence(first, np.empty(count), *relations)


def own_confidence(fmap: Fmap, table: RelationTable, own: SelfRelations) -> tuple[float, float]:
    """Return ζS and ζM of a histogram map."""
    pairs = object_pairs(table.template_objects), object_pairs(table.argument_objects)
    shape, size = mean_parts(fmap.entries, pairs, table.rotation, table.dilation, own)
    return float(shape), float(size)


def occm(fmap: Fmap, table: RelationTable) -> Occm:
    """Collect what every entry of a histogram map says about every pairing of objects.

    An entry (a, b) → (c, d) adds its σ to the pairings a→c and b→d, which its order implies, and
    to a→d and b→c.
    """
    columns = fmap.entries % table.argument_pairs
    sigma = _entry_similarity(fmap, table)
    a, b = object_pairs(table.template_objects).T
    low, high = object_pairs(table.argument_objects)[columns].T
    dual = fmap.entries >= table.argument_pairs
    c, d = np.where(dual, high, low), np.where(dual, low, high)
    implied = np.zeros((table.template_objects, table.argument_objects))
    crossed = np.zeros_like(implied)
    np.add.at(implied, (a, c), sigma)
    np.add.at(implied, (b, d), sigma)
    np.add.at(crossed, (a, d), sigma)
    np.add.at(crossed, (b, c), sigma)
    return Occm(implied + crossed, implied)


def map_confidence(
    partners: IntArray,
    table: RelationTable,
    weights: Weights = (1.0, 1.0, 1.0),
    own: SelfRelations | None = None,
) -> Confidence:
    """Return ζ of the histogram map that an object map induces, and its parts.

    Parameters
    ----------
    partners
        Shape (N,), all different, −1 for an object without partner; at least two have one.
    table, weights, own
        As in :func:`fmap_confidence`.
    """
    kept = np.flatnonzero(partners >= 0)
    fmap = Fmap.from_object_map(partners[kept], table.argument_objects)
    if len(kept) == table.template_objects:
        return fmap_confidence(fmap, table, weights, own)
    rows, entries = _rows_of(kept, table), fmap.entries
    columns = entries % table.argument_pairs
    evidence, cosine, sine, level, shares = entry_relations(fmap, table, weights, rows)
    mean = table.rotation_weights[rows].mean()
    total, similarity, rotation, dilation = _alone(
        (evidence, sealed(cosine / mean), sealed(sine / mean), level, shares)
    )
    if table.evidence is not None:
        similarity = table.similarity[rows, columns].mean()
    shape = size = None
    if own is not None:
        pairs = (
            sealed(object_pairs(table.template_objects)[rows]),
            object_pairs(table.argument_objects),
        )
        turns, growth = sealed(table.rotation[rows]), sealed(table.dilation[rows])
        shape, size = map(float, mean_parts(entries, pairs, turns, growth, own))
    return Confidence(
        float(total), float(similarity), float(rotation), float(dilation), shape, size
    )


def induced_map(partners: IntArray, table: RelationTable) -> ObjectMap:
    """Return an object map with what the histogram map that it induces says for each line.

    Parameters
    ----------
    partners
        As in :func:`map_confidence`.
    table
        The relations.

    Returns
    -------
    ObjectMap
        Of the objects that have a partner alone.
    """
    kept = np.flatnonzero(partners >= 0)
    fmap, rows = Fmap.from_object_map(partners[kept], table.argument_objects), _rows_of(kept, table)
    sigma = table.similarity[rows, fmap.entries % table.argument_pairs]
    confidences = np.zeros(len(kept))
    a, b = object_pairs(len(kept)).T
    np.add.at(confidences, a, sigma)
    np.add.at(confidences, b, sigma)
    confidences /= len(kept) - 1
    return ObjectMap(partners[kept], confidences, float(confidences.mean()))


def _rows_of(kept: IntArray, table: RelationTable) -> IntArray:
    """Return the rows of the pairs of some template objects."""
    a, b = kept[object_pairs(len(kept))].T
    return np.asarray(pair_index(a, b, table.template_objects))


def object_map(matrix: Occm) -> ObjectMap:
    """Take the pairing with the most evidence among the objects left, again and again.

    Ties go to the pairing that the order of the entries implies, then to the lower indices.
    """
    evidence = matrix.evidence.copy()
    left, known, implied = evidence.ravel(), matrix.evidence.ravel(), matrix.implied.ravel()
    objects, columns = evidence.shape
    partners = np.full(objects, -1, dtype=np.int64)
    confidences = np.zeros(objects)
    for _ in range(objects):
        first = int(left.argmax())
        (best,) = (left >= left[first] - _TIE).nonzero()
        if len(best) > 1:
            told = implied[best]
            first = int(best[(told >= told.max() - _TIE).argmax()])
        g, h = divmod(first, columns)
        partners[g], confidences[g] = h, known[first] / (objects - 1)
        evidence[g] = evidence[:, h] = -np.inf
    return ObjectMap(partners, confidences, float(confidences.mean()))


def global_rotation(fmap: Fmap, table: RelationTable) -> float:
    """Return the turn from template to argument, arg Σ e^{iR}, in radians within [−π, π]."""
    _, cosine, sine, *_ = entry_relations(fmap, table, (1.0, 1.0, 1.0))
    return math.atan2(sine.sum(), cosine.sum())


def global_dilation(fmap: Fmap, table: RelationTable) -> float:
    """Return the median size of the argument relative to the template."""
    columns = fmap.entries % table.argument_pairs
    return float(np.median(table.dilation[np.arange(len(columns)), columns]))


def _entry_similarity(fmap: Fmap, table: RelationTable) -> FloatArray:
    """Return σ of each entry."""
    rows = np.arange(table.template_pairs)
    sigma: FloatArray = table.similarity[rows, fmap.entries % table.argument_pairs]
    return sigma
