"""What else the objects could be: the next best object maps, and each partner's margin."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

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
    correspondences,
    object_pairs,
)
from sketchmatch.pipeline.correspond import (
    confidence_relations,
    fmap_confidence,
    object_map,
    occm,
)
from sketchmatch.pipeline.unmatched import Rival

__all__ = ["Alternative", "exchange_confidences", "other_maps", "partner_margins"]

# One exchange costs about a nanosecond for each entry of the FMAP and each step of its sorting;
# beyond this many entries in all, ζ of every exchange would take longer than a tenth of a second.
_MAX_EXCHANGED_ENTRIES = 3_000_000


@dataclass(frozen=True)
class Alternative:
    """An object map that is not the best.

    Attributes
    ----------
    mapped
        The map, from template to argument.
    confidence
        ζ of its FMAP, and the parts.
    """

    mapped: ObjectMap
    confidence: Confidence


def exchange_confidences(
    mapped: ObjectMap, table: RelationTable, weights: Weights
) -> FloatArray | None:
    """Return ζ of every map that one exchange makes of a map, or None where that is too much.

    Returns
    -------
    ndarray
        Shape (N, N'), as :func:`sketchmatch.kernels.exchange.exchange_confidences` returns it.
    """
    count = table.template_objects * table.argument_objects
    if count * table.template_pairs > _MAX_EXCHANGED_ENTRIES:
        return None
    return exchange.exchange_confidences(
        mapped.partners,
        object_pairs(table.template_objects),
        correspondences(table.argument_objects),
        confidence_relations(table, weights),
    )


def other_maps(
    mapped: ObjectMap,
    candidates: Iterable[Fmap],
    exchanges: FloatArray | None,
    table: RelationTable,
    weights: Weights,
    count: int,
    own: SelfRelations | None = None,
) -> tuple[Alternative, ...]:
    """Return the other object maps that are known: those met, and the best exchanges.

    Parameters
    ----------
    mapped
        The best object map.
    candidates
        FMAPs that the searcher met.
    exchanges
        What :func:`exchange_confidences` returns for the best map.
    table, weights
        What was searched.
    count
        How many exchanges count.
    own
        How the objects compare, for ζS and ζM of each.

    Returns
    -------
    tuple of Alternative
        Different from the best and from each other, the highest ζ first.
    """
    fmaps = list(candidates)
    if exchanges is not None:
        order = np.argsort(exchanges, axis=None, kind="stable")[::-1]
        for flat in order[: 2 * count]:  # an exchange of two objects is there twice
            g, h = (int(k) for k in np.unravel_index(int(flat), exchanges.shape))
            if np.isfinite(exchanges[g, h]):
                partners = _exchange(mapped.partners, g, h)
                fmaps.append(Fmap.from_object_map(partners, table.argument_objects))
    found: dict[tuple[int, ...], Alternative] = {}
    for fmap in {fmap.entries.tobytes(): fmap for fmap in fmaps}.values():
        confidence = fmap_confidence(fmap, table, weights, own)
        other = Alternative(object_map(occm(fmap, table)), confidence)
        key = tuple(other.mapped.partners.tolist())
        if key not in found or found[key].confidence.total < other.confidence.total:
            found[key] = other
    found.pop(tuple(mapped.partners.tolist()), None)
    return tuple(sorted(found.values(), key=lambda other: -other.confidence.total))


def partner_margins(
    mapped: ObjectMap,
    confidence: float,
    others: Iterable[Alternative | Rival],
    exchanges: FloatArray | None,
) -> FloatArray | None:
    """Return by how much ζ falls when an object must take another partner.

    Parameters
    ----------
    mapped, confidence
        The best object map and ζ of its FMAP.
    others, exchanges
        The maps it is compared with: the alternatives, and all single exchanges.

    Returns
    -------
    ndarray
        Shape (N,); about 0 where the object is ambiguous, infinite where it may take no other.
        None where ``exchanges`` is None.
    """
    if exchanges is None:
        return None
    rivals = exchanges.max(axis=1)
    for other in others:
        differs = other.mapped.partners != mapped.partners
        rivals = np.where(differs, np.maximum(rivals, other.confidence.total), rivals)
    return np.asarray(confidence - rivals)


def _exchange(partners: IntArray, g: int, h: int) -> IntArray:
    """Return the map in which g has h, and h's holder what g had."""
    changed = partners.copy()
    changed[partners == h] = partners[g]
    changed[g] = h
    return changed
