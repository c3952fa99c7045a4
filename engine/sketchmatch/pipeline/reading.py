"""Reading what was found from sketch to map, whichever of the two was the template."""

from __future__ import annotations

import math

from sketchmatch.model import FloatArray, Fmap, ObjectMap, RelationTable, object_pairs
from sketchmatch.pipeline.result import Correspondence, ObjectMatch

__all__ = ["correspondences", "half_turned", "matches"]


def matches(
    mapped: ObjectMap, exchanged: bool, margins: FloatArray | None = None
) -> tuple[ObjectMatch, ...]:
    """Return the lines of an object map, in the order of the sketch.

    Parameters
    ----------
    mapped
        From template to argument.
    exchanged
        Whether the template is the map.
    margins
        Shape (N,), of each template object, or None where unknown.
    """
    known = [None] * len(mapped.partners) if margins is None else margins.tolist()
    lines = zip(mapped.partners.tolist(), mapped.confidences.tolist(), known, strict=True)
    read = (
        ObjectMatch(h if exchanged else g, g if exchanged else h, confidence, margin)
        for g, (h, confidence, margin) in enumerate(lines)
    )
    return tuple(sorted(read, key=lambda match: match.sketch_object))


def correspondences(
    fmap: Fmap, table: RelationTable, exchanged: bool
) -> tuple[Correspondence, ...]:
    """Return the entries of a histogram map, in the order of the template's pairs."""
    half = table.argument_pairs
    argument_pairs = object_pairs(table.argument_objects)
    entries = []
    for i, (a, b) in enumerate(object_pairs(table.template_objects).tolist()):
        column = int(fmap.entries[i]) % half
        dual = bool(fmap.entries[i] >= half)
        c, d = argument_pairs[column].tolist()[:: -1 if dual else 1]
        rotation = float(table.rotation[i, column]) + (math.pi if dual else 0.0)
        dilation = float(table.dilation[i, column])
        entries.append(
            Correspondence(
                sketch_pair=(c, d) if exchanged else (a, b),
                map_pair=(a, b) if exchanged else (c, d),
                similarity=float(table.similarity[i, column]),
                rotation=half_turned(-rotation if exchanged else rotation),
                dilation=1.0 / dilation if exchanged else dilation,
            )
        )
    return tuple(entries)


def half_turned(angle: float) -> float:
    """Return the same angle within (−π, π]."""
    turned = math.remainder(angle, 2.0 * math.pi)
    return math.pi if turned == -math.pi else turned
