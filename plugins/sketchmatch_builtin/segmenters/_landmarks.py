"""Names that a map's file gives to places, for the objects that stand there."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import shapely

from sketchmatch.model import Landmark

__all__ = ["ROOM", "labels_of", "left_over", "names_of_rooms"]

ROOM = "room"
"""The kind of landmark that names a room, and no thing in it."""

_MOST_NAMED = 8
_LONGEST_NAME = 40
# Letters are larger that are so many times as high.
_LARGER, _LEAST = 1.1, 1e-100
# What a measure is made of: numbers, and what says that these are no number of a room. Each looks
# at a character once: what is possessive never tries again with less.
_UNITS = (
    r"(?:[cm]?[mм][²2]?|qm|sqm|sq\.?\s?(?:m|ft|feet)\.?|кв\.?\s?м\.?|ft[²2]?|feet|in|㎡"
    r"|°\s?[CF]?|[℃℉%]|kwh?|lx|lux|ppm)"
)
_SIGNS = r"(?:['\"′″’”]|[x×✕*]|by)"
_UNIT = re.compile(rf"{_UNITS}|{_SIGNS}|\d[.,]\d", re.IGNORECASE)
_MEASURE = re.compile(
    rf"(?:\d++(?:[.,/⁄]\d++)*+|{_UNITS}|{_SIGNS}|[½¼¾]|ca\.?|[\s~≈=±+:;,.()/-])++",
    re.IGNORECASE,
)
# What a compass says: it has no other letters.
_COMPASS = frozenset("NESWO")
# An area, or two lengths, behind a name.
_SIZE = r"\d++(?:[.,]\d++)?\s?"
_AREA = re.compile(
    rf"(?<![\s,;:(/·|–-])[\s,;:(/·|–-]++(?:ca\.?\s*+)?(?:{_SIZE}[x×✕*]\s?)?{_SIZE}{_UNITS}\)?$",
    re.IGNORECASE,
)


def labels_of(
    polygons: Sequence[shapely.Polygon],
    landmarks: Iterable[Landmark],
    reach: float,
    doubtful: Sequence[bool] | None = None,
) -> tuple[list[str], list[Landmark]]:
    """Return a label for each object, empty if it has no name, and the names that none has.

    A name goes to the object in which its place lies, or else to the nearest within reach; of
    several that could have it, or of several names for one object, the nearest are joined first,
    and of what lies within the same object what is written largest, then nearest to its middle.

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
    size = np.array([item.size for item in named])[k]
    small = -np.round(np.log(np.maximum(size, _LEAST)) / math.log(_LARGER))
    for pair in np.lexsort((middle, small, away, last)).tolist():
        if k[pair] in left and not labels[j[pair]]:
            labels[j[pair]] = named[k[pair]].name
            left.remove(k[pair])
    return labels, [named[k] for k in sorted(left)]


def names_of_rooms(written: Iterable[Landmark]) -> list[Landmark]:
    """Return what is written in a plan without measures, such as ``3.5 x 4``, and a compass's N.

    Signs without a letter or number, such as a picture of a bed, count as the smallest writing.
    """
    written = [*written]
    letters = {item.name for item in written if len(item.name) == 1 and item.name.isalpha()}
    # Who calls rooms by letters has other ones, too.
    compass = letters if "N" in letters and letters <= _COMPASS else frozenset[str]()
    found = []
    for item in written:
        if item.name in compass:
            continue
        measured = _MEASURE.fullmatch(item.name) and _UNIT.search(item.name)
        name = _AREA.sub("", item.name).strip()
        if name and not (measured and re.search(r"\d", item.name)):
            size = item.size if any(map(str.isalnum, name)) else 0.0
            found.append(replace(item, name=name, size=size))
    return found


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
    named = "this name" if len(names) == 1 else "these names"
    return (f"No object was named {listed}{more}: none is left {where} where {what} has {named}.",)
