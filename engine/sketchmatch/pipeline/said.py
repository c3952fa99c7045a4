"""What a judgement says, read from sketch to map, whichever of the two was the template."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sketchmatch.api import JudgedMap, Judgement
from sketchmatch.model import FloatArray, IntArray
from sketchmatch.pipeline.ambiguity import ambiguity
from sketchmatch.pipeline.result import Ambiguity

__all__ = ["Said", "said"]


@dataclass(frozen=True, eq=False)
class Said:
    """How likely the answer is right, and what else it could be.

    Attributes
    ----------
    of_map
        As a whole, or None where unknown.
    of_place
        That it is this place at all, or None.
    of_objects
        Shape (N,), what the answer says of each sketched object: its partner, or that it has none;
        or None.
    of_unmatched
        The same, of those that have none.
    of_alternatives
        Of each of the next maps.
    ambiguity
        Which of them are about as likely.
    """

    of_map: float | None
    of_place: float | None
    of_objects: FloatArray | None
    of_unmatched: tuple[float, ...]
    of_alternatives: tuple[float | None, ...]
    ambiguity: Ambiguity | None


def said(
    judgement: Judgement, sketch_objects: int, map_objects: int, swapped: bool, shown: int
) -> Said:
    """Return what a judgement says.

    Parameters
    ----------
    judgement
        From template to argument.
    sketch_objects, map_objects
        How many there are.
    swapped
        Whether the template is the map.
    shown
        How many maps beside the answer the result holds.

    Examples
    --------
    A map of one object, which is the first or the second of two sketched ones:

    >>> maps = (JudgedMap([0], 0.5), JudgedMap([1], 0.4))
    >>> found = said(Judgement(maps, [[0.5, 0.4, 0.1]], elsewhere=0.1), 2, 1, True, 1)
    >>> found.of_place, found.of_objects.tolist(), found.of_alternatives
    (0.9, [0.5, 0.6], (0.4,))
    >>> found.of_unmatched
    (0.6,)
    >>> found.ambiguity
    Ambiguity(maps=2, alternatives=(0,), deciding_sketch_objects=(0, 1))
    """
    judged = judgement.maps
    maps = _from_sketch(judged, sketch_objects, swapped)
    of_objects, of_unmatched = None, ()
    if judgement.lines is not None:
        # An object without partner has −1, which picks the last column: that it has none.
        of_objects = _lines_from_sketch(judgement.lines, swapped)[np.arange(len(maps[0])), maps[0]]
        of_unmatched = tuple(of_objects[maps[0] < 0].tolist())
    place = None if judgement.elsewhere is None else 1.0 - judgement.elsewhere
    known = [each.probability or 0.0 for each in judged]
    here = place is None or place >= 0.5
    return Said(
        judged[0].probability,
        place,
        of_objects,
        of_unmatched,
        tuple(each.probability for each in judged[1 : shown + 1]),
        ambiguity(maps, known, map_objects, shown) if here else None,
    )


def _from_sketch(judged: tuple[JudgedMap, ...], sketch_objects: int, swapped: bool) -> IntArray:
    """Return the mapped object of each sketched one in each map, shape (K, N), −1 for none."""
    partners = np.stack([each.partners for each in judged])
    if not swapped:
        return partners
    maps = np.full((len(judged), sketch_objects), -1, dtype=np.int64)
    rows, objects = np.nonzero(partners >= 0)
    maps[rows, partners[rows, objects]] = objects
    return maps


def _lines_from_sketch(lines: FloatArray, swapped: bool) -> FloatArray:
    """Return how likely each sketched object's partner is each mapped one, and, last, none."""
    if not swapped:
        return lines
    partners = lines[:, :-1].T
    none = np.maximum(1.0 - partners.sum(axis=1), 0.0)  # a sum may be rounded up
    return np.column_stack([partners, none])
