"""Sketches as people draw them with a pen in haste, with the truth about them.

What makes them hard is the *failure of co-termination* of Mahoney & Fromherz (AAAI Spring
Symposium on Sketch Understanding, 2002; thesis 2.1): strokes stop short of each other or go on
past each other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely

from sketchmatch.model import FloatArray, Scene, Stroke, StrokeSet

__all__ = ["SloppySketch", "draw_sloppily"]

_CELL = 4.0
_STEPS = 400


@dataclass(frozen=True, eq=False)
class SloppySketch:
    """A sketch, and what was meant.

    Attributes
    ----------
    strokes
        All strokes in random order, the route last.
    truth
        The objects as they were meant.
    route
        Index of the stroke that is the route, or None.
    """

    strokes: StrokeSet
    truth: Scene
    route: int | None


def draw_sloppily(
    rng: np.random.Generator,
    objects: int = 8,
    *,
    sloppiness: float = 0.1,
    wobble: float = 0.008,
    most_strokes: int = 4,
    twice: float = 0.15,
    marks: float = 0.0,
    route: bool = False,
) -> SloppySketch:
    """Draw random shapes, each with a few strokes that do not meet.

    Parameters
    ----------
    rng
        Source of randomness.
    objects
        How many, 1 or more; they lie in the cells of a square grid.
    sloppiness
        Largest gap and largest overshoot at each joint, as a share of the object's size, the
        larger side of the box around it as it was before it was turned. Both are equally likely.
    wobble
        Standard deviation of the trembling line off the outline, as a share of the size.
    most_strokes
        Most strokes an outline is drawn with.
    twice
        Share of the objects whose outline is drawn again, with other strokes.
    marks
        How likely each object gets a flick, a dot, a cross and a squiggle, each on its own.
    route
        Whether a route is drawn last, across the whole sketch.

    Returns
    -------
    SloppySketch
        Objects are about 2 units large and at least half a unit apart.
    """
    side = math.isqrt(objects - 1) + 1
    strokes: list[FloatArray] = []
    outlines = []
    for place in rng.permutation(side * side)[:objects]:
        centre = _CELL * np.array([place % side, place // side]) + rng.uniform(-0.3, 0.3, 2)
        size = float(rng.uniform(1.0, 2.4))
        outline = size * _shape(rng) @ _turning(rng.uniform(0.0, 2.0 * np.pi)).T + centre
        outlines.append(outline)
        for _ in range(1 + (rng.random() < twice)):
            strokes += _outlined(outline, size, rng, sloppiness, wobble, most_strokes)
        for mark in (_flick, _dot, _cross, _squiggle):
            if rng.random() < marks:
                strokes += mark(centre, size, rng)
    strokes = [strokes[k] for k in rng.permutation(len(strokes))]
    if route:
        strokes.append(_route(_CELL * (side - 1.0), rng))
    return SloppySketch(
        StrokeSet(tuple(Stroke(points) for points in strokes)),
        Scene.from_polygons(outlines),
        len(strokes) - 1 if route else None,
    )


def _shape(rng: np.random.Generator) -> FloatArray:
    """Return the corners of a random shape whose larger side is 1, about the origin."""
    kind = rng.choice(["box", "triangle", "ellipse", "corner", "polygon", "blob", "tee"])
    a, b = rng.uniform(0.3, 0.6, 2)
    width = rng.uniform(0.3, 1.0)
    angle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    round_ = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    corners = {
        "box": [[0, 0], [1, 0], [1, width], [0, width]],
        "triangle": [[0, 0], [1, 0], [rng.uniform(0.2, 0.8), max(width, 0.5)]],
        "ellipse": round_ * [1.0, width],
        "corner": [[0, 0], [1, 0], [1, a], [b, a], [b, 1], [0, 1]],
        "polygon": round_[:: 48 // int(rng.integers(5, 7))],
        "blob": round_ * (1.0 + 0.2 * np.cos(3.0 * angle + 6.0 * a))[:, None],
        "tee": [[0, 0], [1, 0], [1, a], [0.7, a], [0.7, 1], [0.3, 1], [0.3, a], [0, a]],
    }[str(kind)]
    ring = np.array(corners, dtype=np.float64)
    ring -= (ring.min(axis=0) + ring.max(axis=0)) / 2.0
    return np.asarray(ring / np.ptp(ring, axis=0).max())


def _outlined(
    ring: FloatArray,
    size: float,
    rng: np.random.Generator,
    sloppiness: float,
    wobble: float,
    most_strokes: int,
) -> list[FloatArray]:
    """Return the strokes of one outline; pens are lifted at corners more often than between."""
    line = shapely.LinearRing(ring)
    cuts = _cuts(line, ring, size, int(rng.integers(1, most_strokes + 1)), rng)
    lengths = np.diff([*cuts, cuts[0] + line.length])
    # Of each joint, how far the stroke before it goes on and the one after it begins too early.
    past = sloppiness * size * rng.uniform(-1.0, 1.0, len(cuts))
    share = rng.uniform(0.0, 1.0, len(cuts))
    strokes = []
    for k, (start, length) in enumerate(zip(cuts, lengths, strict=True)):
        following = (k + 1) % len(cuts)
        before, after = (1.0 - share[k]) * past[k], share[following] * past[following]
        stroke = _along(line, start, length, before, after, rng)
        stroke = stroke + wobble * size * _trembling(rng, len(stroke))
        stroke = stroke + rng.normal(0.0, 0.1 * sloppiness * size, 2)
        strokes.append(stroke[::-1] if rng.random() < 0.5 else stroke)
    return strokes


def _cuts(
    line: shapely.LinearRing,
    ring: FloatArray,
    size: float,
    count: int,
    rng: np.random.Generator,
) -> FloatArray:
    """Return where along an outline strokes begin, in order, fairly far apart."""
    at_corners = np.array([line.project(shapely.Point(corner)) for corner in ring])
    chosen: list[float] = []
    for _ in range(60):
        if len(chosen) == count:
            break
        at = float(rng.choice(at_corners) if rng.random() < 0.7 else rng.uniform(0, line.length))
        apart = [min((at - x) % line.length, (x - at) % line.length) for x in chosen]
        if min(apart, default=math.inf) > 0.4 * size:
            chosen.append(at)
    return np.sort(chosen)


def _along(
    line: shapely.LinearRing,
    start: float,
    length: float,
    before: float,
    after: float,
    rng: np.random.Generator,
) -> FloatArray:
    """Return points along an outline; what goes beyond the part follows it or runs straight on."""
    ends = []
    for extra in (before, after):
        straight = extra > 0.0 and rng.random() < 0.5
        ends.append((0.0, extra) if straight else (extra, 0.0))
    at = np.linspace(start - ends[0][0], start + length + ends[1][0], _STEPS // 4)
    points = shapely.get_coordinates(shapely.line_interpolate_point(line, at % line.length))
    first, last = points[0] - points[1], points[-1] - points[-2]
    head = points[0] + ends[0][1] * first / np.hypot(*first)
    tail = points[-1] + ends[1][1] * last / np.hypot(*last)
    steps = np.linspace(0.0, 1.0, 6, endpoint=False)[:, None]
    pieces = [points]
    if ends[0][1]:
        pieces.insert(0, head + steps * (points[0] - head))
    if ends[1][1]:
        pieces.append((tail + steps * (points[-1] - tail))[::-1])
    return np.concatenate(pieces)


def _trembling(rng: np.random.Generator, count: int) -> FloatArray:
    """Return a smooth wobble of about unit deviation, shape (count, 2)."""
    t = np.linspace(0.0, 1.0, count)[:, None, None]
    waves = np.arange(1.0, 7.0)[:, None]
    phase = rng.uniform(0.0, 2.0 * np.pi, (6, 2))
    size = rng.normal(0.0, 1.0 / math.sqrt(3.0), (6, 2))
    return np.asarray((size * np.sin(2.0 * np.pi * t * waves + phase)).sum(axis=1))


def _flick(centre: FloatArray, size: float, rng: np.random.Generator) -> list[FloatArray]:
    start = centre + rng.uniform(-0.8, 0.8, 2) * size
    return [start + np.linspace(0.0, 1.0, 5)[:, None] * rng.uniform(-0.05, 0.05, 2) * size]


def _dot(centre: FloatArray, size: float, rng: np.random.Generator) -> list[FloatArray]:
    return [centre + rng.uniform(-0.8, 0.8, 2) * size + rng.normal(0.0, 0.005 * size, (6, 2))]


def _cross(centre: FloatArray, size: float, rng: np.random.Generator) -> list[FloatArray]:
    middle = centre + rng.uniform(-0.1, 0.1, 2) * size
    reach = rng.uniform(0.1, 0.25) * size
    t = np.linspace(-reach, reach, 12)
    return [
        middle + np.stack([t, slope * t], axis=1) + 0.01 * size * _trembling(rng, len(t))
        for slope in (1.0, -1.0)
    ]


def _squiggle(centre: FloatArray, size: float, rng: np.random.Generator) -> list[FloatArray]:
    """Return a word in longhand: arches or loops in a row, inside the object or below it."""
    t = np.linspace(0.0, rng.uniform(4.0, 9.0), 120)
    looping = rng.uniform(0.0, 1.6)
    height = rng.uniform(0.05, 0.1) * size
    x = t + looping * np.cos(2.0 * np.pi * t) / 3.0
    width = rng.uniform(0.3, 0.7) * size / np.ptp(x)
    word = np.stack([width * (x - x.mean()), height * np.sin(2.0 * np.pi * t)], axis=1)
    below = rng.random() < 0.5
    return [word + centre - [0.0, (0.9 if below else 0.0) * size]]


def _route(extent: float, rng: np.random.Generator) -> FloatArray:
    """Return a winding way from one corner of the sketch to the opposite one."""
    t = np.linspace(0.0, 1.0, 160)[:, None]
    start, end = np.array([-1.7, -1.7]), np.array([extent + 1.7, extent + 1.7])
    winding = 0.15 * extent * np.sin(2.0 * np.pi * t * rng.uniform(0.8, 2.0)) * [1.0, -1.0]
    return np.asarray(start + t * (end - start) + winding + 0.05 * _trembling(rng, len(t)))


def _turning(angle: float) -> FloatArray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])
