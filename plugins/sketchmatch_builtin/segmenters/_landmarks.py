"""Names that a map's file gives to places, for the objects that stand there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import shapely

from sketchmatch.model import Landmark

__all__ = ["ROOM", "labels_of", "left_over"]

ROOM = "room"
"""The kind of landmark that names a room, and no thing in it."""

_MOST_NAMED = 8
_LONGEST_NAME = 40


def labels_of(
    polygons: Sequence[shapely.Polygon],
    landmarks: Iterable[Landmark],
    reach: float,
    doubtful: Sequence[bool] | None = None,
) -> tuple[list[str], list[Landmark]]:
    """Return a label for each object, empty if it has no name, and the names that none has.

    A name goes to the object in which its place lies, or else to the nearest within reach; of
    several that could have it, or of several names for one object, the nearest are joined first,
    and what lies within the same object by how near its middle is.

    Parameters
    ----------
    polygons
        The objects, in the map's frame.
    landmarks
        The names and places.
    reach
        In metres.
    doubtful
        Which objects get names whose place does not lie within them last; left out, none.
    """
    named = tuple(landmarks)
    labels, left = [""] * len(polygons), set(range(len(named)))
    if not named or not polygons:
        return labels, [*named]
    points = shapely.points([item.point for item in named])
    objects = np.array(polygons, dtype=object)
    k, j = shapely.STRtree(objects).query(points, predicate="dwithin", distance=reach)
    away = shapely.distance(points[k], objects[j])
    last = (away > 0.0) & np.asarray(doubtful or [False] * len(polygons))[j]
    middle = shapely.distance(points[k], shapely.centroid(objects[j]))
    for pair in np.lexsort((middle, away, last)).tolist():
        if k[pair] in left and not labels[j[pair]]:
            labels[j[pair]] = named[k[pair]].name
            left.remove(k[pair])
    return labels, [named[k] for k in sorted(left)]


def left_over(landmarks: Sequence[Landmark], where: str, what: str) -> tuple[str, ...]:
    """Return a warning about names that no object has, or nothing if there are none.

    Parameters
    ----------
    landmarks
        The names.
    where
        Where no object is, such as ``"around"``.
    what
        What has the names, such as ``"the drawing"``.
    """
    names = [item.name for item in landmarks]
    if not names:
        return ()
    shown = [name if name.isprintable() else repr(name) for name in names[:_MOST_NAMED]]
    listed = ", ".join(name[:_LONGEST_NAME] for name in shown)
    more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
    return (f"No object is left {where} {listed}{more}, which {what} names.",)
