"""Reading what was found from sketch to map, whichever of the two was the template."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from sketchmatch.model import FloatArray, Fmap, IntArray, ObjectMap, RelationTable, object_pairs
from sketchmatch.pipeline.result import Correspondence, ObjectMatch, ObjectRelation

__all__ = ["correspondences", "half_turned", "matches"]

_UNKNOWN: Mapping[int, ObjectRelation] = MappingProxyType({})


def matches(
    mapped: ObjectMap,
    swapped: bool,
    kept: IntArray,
    margins: FloatArray | None = None,
    probabilities: FloatArray | None = None,
    relations: Mapping[int, ObjectRelation] = _UNKNOWN,
) -> tuple[ObjectMatch, ...]:
    """Return the lines of an object map, in the order of the sketch.

    Parameters
    ----------
    mapped
        From kept objects of the template to the argument.
    swapped
        Whether the template is the map.
    kept
        Shape (k,), which template objects these are.
    margins, probabilities
        Shape (k,), of each of them, or None where unknown; an infinite margin is none.
    relations
        By sketched object, where known.
    """
    partners = mapped.partners.tolist()
    pairs = ((h, g) if swapped else (g, h) for g, h in zip(kept.tolist(), partners, strict=True))
    unknown = [None] * len(partners)
    lines = zip(
        pairs,
        mapped.confidences.tolist(),
        unknown if margins is None else margins.tolist(),
        unknown if probabilities is None else probabilities.tolist(),
        strict=True,
    )
    read = (
        ObjectMatch(
            a,
            b,
            confidence,
            None if margin == math.inf else margin,
            relations.get(a),
            probability,
        )
        for (a, b), confidence, margin, probability in lines
    )
    return tuple(sorted(read, key=lambda match: match.sketch_object))


def correspondences(
    fmap: Fmap, table: RelationTable, swapped: bool, kept: IntArray
) -> tuple[Correspondence, ...]:
    """Return the entries of a histogram map of kept objects, in the order of their pairs."""
    half = table.argument_pairs
    argument_pairs = object_pairs(table.argument_objects)
    entries = []
    for i, (a, b) in enumerate(kept[object_pairs(table.template_objects)].tolist()):
        column = int(fmap.entries[i]) % half
        dual = bool(fmap.entries[i] >= half)
        c, d = argument_pairs[column].tolist()[:: -1 if dual else 1]
        rotation = float(table.rotation[i, column]) + (math.pi if dual else 0.0)
        dilation = float(table.dilation[i, column])
        entries.append(
            Correspondence(
                sketch_pair=(c, d) if swapped else (a, b),
                map_pair=(a, b) if swapped else (c, d),
                similarity=float(table.similarity[i, column]),
                rotation=half_turned(-rotation if swapped else rotation),
                dilation=1.0 / dilation if swapped else dilation,
            )
        )
    return tuple(entries)


def half_turned(angle: float) -> float:
    """Return the same angle within (−π, π]."""
    turned = math.remainder(angle, 2.0 * math.pi)
    return math.pi if turned == -math.pi else turned
