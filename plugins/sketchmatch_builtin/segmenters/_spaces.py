"""Spaces of a plan that are no rooms: what is left between rooms that are drawn as shapes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from sketchmatch.model import FloatArray
from sketchmatch_builtin.segmenters._lines import is_closed, plain_outlines

__all__ = ["spaces_between"]

# So many rooms that are shapes, and of them those with a name, tell that a room has both. A shape
# that holds more rooms is a frame.
_FEWEST, _NAMED = 3, 0.8
# Of a room, and of the shape that it is: how much the two share. Furniture and what lies over a
# shape may take the rest of it.
_WITHIN, _FILLED = 0.9, 0.5
# In a drawing of more lines it is not looked for: each could lie across all rooms.
_MOST_LINES = 3000
# Of the way around a space: how much of it walls may bound, which are lines, not shapes. Of the
# span of all: how near to it they are.
_WALLED, _NEAR = 0.2, 0.01


def spaces_between(
    rooms: Sequence[shapely.Polygon], labels: Sequence[str], lines: Sequence[FloatArray]
) -> frozenset[int]:
    """Return which rooms of a plan are only what is left between the others.

    Some draw each room as a shape of its own and write a name into it. What lies between these
    shapes, or between them and a frame around all, has no name, and no wall bounds it.

    Parameters
    ----------
    rooms
        What was found.
    labels
        What each is called, empty if it has no name.
    lines
        What is drawn, shape (k, 2) each.
    """
    if len(rooms) <= _FEWEST or all(labels) or len(lines) > _MOST_LINES:
        return frozenset()
    found, named = np.array(rooms, dtype=object), np.array([bool(each) for each in labels])
    shapes = np.array([*plain_outlines(lines).values()], dtype=object)
    k, shape = shapely.STRtree(shapes).query(found, "intersects")
    shared = shapely.area(shapely.intersection(found[k], shapes[shape]))
    holds = shared >= _WITHIN * shapely.area(found[k])
    held = np.bincount(shape[holds], minlength=len(shapes))
    is_one = holds & (shared >= _FILLED * shapely.area(shapes[shape])) & (held[shape] <= _FEWEST)
    drawn = np.isin(np.arange(len(rooms)), k[is_one])
    if drawn.sum() < _FEWEST or named[drawn].mean() < _NAMED:
        return frozenset()
    spaces = np.flatnonzero(~drawn & ~named)
    around = shapely.boundary(found[spaces])
    near = _NEAR * float(np.ptp(np.concatenate(lines), axis=0).max())
    opened = [shapely.LineString(each) for each in lines if len(each) > 1 and not is_closed(each)]
    walls = np.array(opened, dtype=object)
    close = np.unique(shapely.STRtree(walls).query(around, "dwithin", near)[1])
    walled = shapely.intersection(around, shapely.buffer(shapely.union_all(walls[close]), near))
    return frozenset(spaces[shapely.length(walled) <= _WALLED * shapely.length(around)].tolist())
