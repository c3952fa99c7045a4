"""What was found in a sketch before it was changed, and where to begin with what it is now."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sketchmatch.model import IntArray, Scene

__all__ = ["Former", "starts"]

_FEWEST = 2


@dataclass(frozen=True, eq=False)
class Former:
    """What was found a moment ago.

    Attributes
    ----------
    sketch
        The objects of the sketch as it was.
    maps
        The answer and the maps next to it, each from sketched to mapped objects.
    elsewhere
        How likely the sketch did not show this place; None where that was not told.
    """

    sketch: Scene
    maps: tuple[Mapping[int, int], ...]
    elsewhere: float | None


def starts(former: Former, sketch: Scene, map_objects: int, swapped: bool) -> tuple[IntArray, ...]:
    """Return the former maps of the objects that are still there, from template to argument.

    Objects are the same that have the same outlines. A map of fewer than two of them says nothing.

    Parameters
    ----------
    former
        What was found.
    sketch
        The sketch as it is.
    map_objects
        How many objects the map has.
    swapped
        Whether the template is the map.

    Examples
    --------
    >>> boxes = [[[x, 0], [x + 1, 0], [x + 1, 2]] for x in (0, 3, 7, 9)]
    >>> was, now = Scene.from_polygons(boxes[:3]), Scene.from_polygons(boxes[1:])
    >>> [each.tolist() for each in starts(Former(was, ({0: 4, 1: 3, 2: 0},), None), now, 5, False)]
    [[3, 0, -1]]
    >>> [each.tolist() for each in starts(Former(was, ({0: 1, 1: 0, 2: 2},), None), now, 2, True)]
    []
    """
    places = {_outline(former.sketch, k): k for k in range(len(former.sketch))}
    known = [places.get(_outline(sketch, k), -1) for k in range(len(sketch))]
    found: dict[bytes, IntArray] = {}
    for each in former.maps:
        lines = [(k, each[place]) for k, place in enumerate(known) if place in each]
        lines = [(k, partner) for k, partner in lines if 0 <= partner < map_objects]
        if len(lines) < _FEWEST:
            continue
        partners = np.full(map_objects if swapped else len(sketch), -1, dtype=np.int64)
        for k, partner in lines:
            partners[partner if swapped else k] = k if swapped else partner
        found.setdefault(partners.tobytes(), partners)
    return tuple(found.values())


def _outline(scene: Scene, k: int) -> bytes:
    return b"|".join(ring.tobytes() for ring in scene.objects[k].rings)
