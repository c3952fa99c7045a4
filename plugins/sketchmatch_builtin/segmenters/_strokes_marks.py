"""Strokes and outlines that are no objects: drawn over again, marks, flicks, the route."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from ._lines import is_straight
from ._strokes_trace import SAMPLES, Trace, span_of

__all__ = [
    "along_others",
    "are_straight",
    "frames",
    "hosts",
    "places",
    "repeated",
    "typical_span",
]

# A stroke within this share of its own span of another line is drawn over that.
_ALONG = 0.06
# … and of an object's span, of its outline.
_ALONG_OUTLINE = 0.08
# Overlap, as intersection over union, from which on two outlines are one drawn twice.
_SAME = 0.7
# Share of a stroke's points beside an outline that is drawn over it.
_BESIDE = 0.9
# What is around so many others, so many times as large as is typical of what is around nothing,
# and has this share of the whole sketch's span, is no thing among them.
_FRAMED, _LARGER, _SPREAD = 3, 3.0, 0.3
# A line is straight that leaves its chord by no more than this share of it.
_STRAIGHT = 0.02
# Share of an outline's area, or of a stroke's points, within an object that lies in it.
_WITHIN = 0.8


def along_others(strokes: Sequence[Trace]) -> list[int | None]:
    """Return for each stroke a longer one that it is drawn over from end to end, or None."""
    found: list[int | None] = [None] * len(strokes)
    if not strokes:
        return found
    samples = np.stack([stroke.samples for stroke in strokes])
    near = _ALONG * np.array([stroke.span for stroke in strokes])
    lengths = np.array([stroke.length for stroke in strokes])
    lines = np.asarray(shapely.linestrings(samples))
    points = np.asarray(shapely.points(samples))
    middle = SAMPLES // 2
    which, other = shapely.STRtree(lines).query(points[:, middle], "dwithin", near)
    longer = lengths[other] > lengths[which]
    longer |= (lengths[other] == lengths[which]) & (other > which)
    which, other = which[longer], other[longer]
    for k in (0, SAMPLES - 1, *range(1, SAMPLES - 1)):
        beside = shapely.dwithin(lines[other], points[which, k], near[which])
        which, other = which[beside], other[beside]
    for k, j in zip(which.tolist(), other.tolist(), strict=True):
        found[k] = j
    return found


def repeated(outlines: Sequence[shapely.Polygon]) -> list[int | None]:
    """Return for each outline the larger one that it repeats, or None."""
    found: list[int | None] = [None] * len(outlines)
    sizes = [outline.area for outline in outlines]
    order = sorted(range(len(outlines)), key=lambda k: -sizes[k])
    rank = {k: r for r, k in enumerate(order)}
    # What two share is less than the smaller: k must be nearly as large as j, and all but in it.
    pairs = [(k, j) for k, j in _meeting(outlines, _SAME) if sizes[k] > _SAME * sizes[j]]
    for k, j in sorted(pairs, key=lambda pair: [rank[i] for i in pair]):
        if rank[j] < rank[k] and found[k] is None and found[j] is None:
            both = shapely.intersection(outlines[k], outlines[j]).area
            if both > _SAME * (sizes[k] + sizes[j] - both):
                found[k] = j
    return found


def hosts(outlines: Sequence[shapely.Polygon]) -> list[int | None]:
    """Return for each outline the smallest other one that it lies in, or None."""
    found: list[int | None] = [None] * len(outlines)
    sizes = [outline.area for outline in outlines]
    for k, j in _meeting(outlines, _WITHIN):
        best = found[k]
        if (
            sizes[k] < sizes[j]
            and (best is None or sizes[j] < sizes[best])
            and shapely.intersection(outlines[k], outlines[j]).area > _WITHIN * sizes[k]
        ):
            found[k] = j
    return found


def frames(spans: Sequence[float], within: Sequence[int | None], whole: float) -> frozenset[int]:
    """Return the outlines that are around other things rather than things: walls, a page, a box.

    These are far larger than the others, or around all of them.

    Parameters
    ----------
    spans
        Of the outlines.
    within
        In which other one each lies, as from :func:`hosts`.
    whole
        The span of all that is drawn.
    """
    inside, around = [0] * len(spans), [0] * len(spans)
    for k in range(len(spans)):
        host = within[k]
        while host is not None:
            inside[host] += 1
            around[k] += 1
            host = within[host]
    typical = typical_span([span for span, count in zip(spans, inside, strict=True) if not count])
    least = max(_LARGER * typical, _SPREAD * whole)
    return frozenset(
        k
        for k, span in enumerate(spans)
        if inside[k] >= _FRAMED and (span >= least or inside[k] + around[k] == len(spans) - 1)
    )


def are_straight(strokes: Sequence[Trace]) -> list[bool]:
    """Return for each stroke whether it is a straight line."""
    return [is_straight(stroke.samples, _STRAIGHT) for stroke in strokes]


def _meeting(outlines: Sequence[shapely.Polygon], share: float) -> list[tuple[int, int]]:
    """Return the pairs whose boxes overlap in more than a share of the first's area."""
    if not outlines:
        return []
    first, second = shapely.STRtree(outlines).query(outlines)
    boxes = shapely.bounds(outlines)
    a, b = boxes[first], boxes[second]
    both = np.minimum(a[:, 2:], b[:, 2:]) - np.maximum(a[:, :2], b[:, :2])
    enough = both.clip(0.0).prod(axis=1) > share * shapely.area(outlines)[first]
    enough &= first != second
    return list(zip(first[enough].tolist(), second[enough].tolist(), strict=True))


def typical_span(spans: Sequence[float]) -> float:
    """Return the span such that half of all that is drawn is in outlines as large or larger."""
    if not len(spans):
        return 0.0
    ordered = np.sort(np.asarray(spans))
    return float(ordered[np.searchsorted(np.cumsum(ordered), 0.5 * ordered.sum())])


def places(
    strokes: Sequence[Trace], outlines: Sequence[shapely.Polygon]
) -> tuple[list[int | None], list[int | None]]:
    """Return for each stroke the outline that it runs along, and that which it lies in, or None."""
    along: list[int | None] = [None] * len(strokes)
    within: list[int | None] = [None] * len(strokes)
    if not strokes:
        return along, within
    samples = np.stack([stroke.samples for stroke in strokes])
    every = np.asarray(shapely.points(samples))
    tree = shapely.STRtree(shapely.box(*samples.min(axis=1).T, *samples.max(axis=1).T))
    for j in sorted(range(len(outlines)), key=lambda k: -outlines[k].area):
        outline = outlines[j]
        shapely.prepare(outline)
        border = outline.exterior
        near = _ALONG_OUTLINE * span_of(shapely.get_coordinates(outline.convex_hull))
        x0, y0, x1, y1 = outline.bounds
        which = tree.query(shapely.box(x0 - near, y0 - near, x1 + near, y1 + near))
        points = every[which]
        shapely.prepare(border)
        beside = shapely.dwithin(border, points, near).mean(axis=1) > _BESIDE
        inside = shapely.contains(outline, points).mean(axis=1) > _WITHIN
        for k in which[beside].tolist():
            along[k] = j
        for k in which[inside].tolist():
            within[k] = j
    return along, within
