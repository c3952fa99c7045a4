"""Writing beside what is drawn: small shapes close to each other in a row."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from sketchmatch.model import FloatArray
from sketchmatch_builtin.segmenters._merging import groups

__all__ = ["written"]

# In a row: at least so many, up to this share of the larger one's span apart, in a box that is no
# wider than this many times the largest, and so many times as long.
_LETTERS, _SPACED, _WIDE, _LONG = 3, 0.6, 1.6, 1.5
# They are writing, of the typical object's span, if some are open, or if there are several rows.
_LETTER, _ROUND_LETTER = 0.3, 0.2
_OPEN, _ROWS = 1 / 3, 2


def written(
    points: Sequence[FloatArray],
    closed: Sequence[bool],
    typical: float,
    joined: Sequence[Sequence[int]] = (),
) -> frozenset[int]:
    """Return the shapes that are writing: small, and close to each other in a row.

    Rows of closed shapes alone, as stools are, count if there are several and these are smaller.
    The parts of one outline are one letter at most.

    Parameters
    ----------
    points
        Of each shape, shape (k, 2) each.
    closed
        Whether each encloses something by itself.
    typical
        Span of the typical object.
    joined
        Shapes that are an outline together.
    """
    boxes = np.array([(*each.min(axis=0), *each.max(axis=0)) for each in points]).reshape(-1, 4)
    spans = (boxes[:, 2:] - boxes[:, :2]).max(axis=1)
    which = np.flatnonzero((spans > 0.0) & (spans <= _LETTER * typical))
    if len(which) < _LETTERS:
        return frozenset()
    small = np.asarray(shapely.box(*boxes[which].T), dtype=object)
    pairs = shapely.STRtree(small).query(small, "dwithin", _SPACED * spans[which])
    group = groups(len(which), pairs)
    found: list[list[int]] = []
    others: list[list[int]] = []
    for members in np.split(
        which[np.argsort(group, kind="stable")], np.bincount(group).cumsum()[:-1]
    ):
        row, largest = members.tolist(), float(spans[members].max())
        letters = len(row) - sum(len(parts) - 1 for parts in joined if set(row).issuperset(parts))
        if letters < _LETTERS or not _is_row([points[k] for k in row], largest):
            continue
        if sum(not closed[k] for k in row) >= _OPEN * len(row):
            found.append(row)
        elif largest <= _ROUND_LETTER * typical:
            others.append(row)
    if len(found) + len(others) >= _ROWS:
        found += others
    return frozenset(k for row in found for k in row)


def _is_row(points: Sequence[FloatArray], largest: float) -> bool:
    """Whether shapes lie in a row about as high as the largest of them."""
    around = shapely.MultiPoint(np.concatenate(points)).minimum_rotated_rectangle
    corners = shapely.get_coordinates(around)
    if len(corners) < 4:
        return True
    short, long = np.sort(np.hypot(*(corners[1:3] - corners[:2]).T)).tolist()
    return bool(short <= _WIDE * largest and long >= _LONG * short)
