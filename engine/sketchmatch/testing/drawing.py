"""Scenes drawn by hand: pen strokes as a tablet records them, and the same as SVG.

A hand rounds corners and swings past them, trembles, slows down in bends and does not end where
it began. Speed follows the two-thirds power law of human movement: along a path of curvature κ it
is proportional to κ^(−1/3) (Lacquaniti, Terzuolo & Viviani, Acta Psychologica 54, 1983).
"""

from __future__ import annotations

import math
from xml.sax.saxutils import escape

import numpy as np

from sketchmatch.model import FloatArray, Scene, Stroke, StrokeSet

__all__ = ["draw_strokes", "strokes_to_svg"]

_INK = "#1d2c5e"
_PAPER = "#fffefa"


def draw_strokes(
    scene: Scene,
    rng: np.random.Generator,
    *,
    gap: tuple[float, float] = (-0.025, 0.03),
    drift: float = 0.006,
    rounding: float = 0.008,
    overshoot: float = 0.25,
    tremor: float = 0.0012,
    speed: float = 0.25,
    rate: float = 80.0,
) -> StrokeSet:
    """Draw each object of a scene with one stroke along its outline.

    Lengths are shares of the scene's extent, the diagonal of the box around it, as a hand does not
    draw small things more finely. Holes are not drawn.

    Parameters
    ----------
    scene
        What is drawn, in this order; see :func:`~sketchmatch.testing.simulate_sketch` for shapes
        as a person remembers them.
    rng
        Chooses where each stroke begins, which way round it goes, and its irregularities.
    gap
        Least and largest share of the outline that is left out at a stroke's end; where it is
        negative the pen goes on past the beginning.
    drift
        Standard deviation of how far the end of the stroke has drifted off its beginning.
    rounding
        Radius about which corners are rounded; at most an eighth of the object's width.
    overshoot
        How much the pen swings out before and after a corner: 0 not at all, 1 much.
    tremor
        Standard deviation of the fast tremor of about 5 to 10 Hz.
    speed
        Speed on a straight line in extents per second.
    rate
        Points a second.

    Returns
    -------
    StrokeSet
        Strokes in scene units with times in seconds since the first pen down, and the objects'
        labels.
    """
    x0, y0, x1, y1 = scene.bounds
    extent = math.hypot(x1 - x0, y1 - y0)
    strokes = []
    now = 0.0
    # Each stroke has a generator of its own, so that a longer one does not change those after it.
    for item, own in zip(scene.objects, rng.spawn(len(scene)), strict=True):
        outline = _rounded(item.rings[0], rounding * extent, overshoot)
        path = _from_anywhere(outline, own, own.uniform(*gap))
        points, times = _sampled(path, speed * extent, rate)
        points = points + _fading_in(times)[:, None] * own.normal(0.0, drift * extent, 2)
        points = points + tremor * extent * _smooth_noise(own, len(points), 0.05 * rate)
        strokes.append(Stroke(points, times + now, item.label))
        now += float(times[-1]) + float(own.uniform(0.4, 1.2))
    return StrokeSet(tuple(strokes))


def strokes_to_svg(stroke_set: StrokeSet) -> str:
    """Return strokes as an SVG document.

    Parameters
    ----------
    stroke_set
        At least one stroke; y up.

    Returns
    -------
    str
        One ``<path>`` of straight lines a stroke, with the label as its ``<title>``, y down, on a
        page with a margin of 5 %. Coordinates are in the strokes' units, moved so that the page
        begins at (0, 0), and rounded to less than a thousandth of the page.

    Examples
    --------
    >>> import numpy as np
    >>> line = Stroke(np.array([[0.0, 0.0], [90.0, 45.0]]), label="shelf")
    >>> "<title>shelf</title>" in strokes_to_svg(StrokeSet((line,)))
    True
    """
    everything = np.concatenate([stroke.points for stroke in stroke_set.strokes])
    low, high = everything.min(axis=0), everything.max(axis=0)
    size = float((high - low).max()) or 1.0
    margin = 0.05 * size
    digits = max(0, 4 - math.ceil(math.log10(size)))
    width, height = (float(side) for side in high - low + 2.0 * margin)
    corner = np.array([low[0] - margin, high[1] + margin])
    paths = [_path(stroke, corner, digits) for stroke in stroke_set.strokes]
    page = f"{_number(width, digits)} {_number(height, digits)}"
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {page}"'
            f' style="background:{_PAPER}">',
            f'  <g fill="none" stroke="{_INK}" stroke-width="{_number(0.005 * size, digits + 1)}"'
            ' stroke-linecap="round" stroke-linejoin="round">',
            *paths,
            "  </g>",
            "</svg>",
            "",
        ]
    )


def _path(stroke: Stroke, corner: FloatArray, digits: int) -> str:
    page = (stroke.points - corner) * [1.0, -1.0]
    steps = " ".join(f"{_number(x, digits)},{_number(y, digits)}" for x, y in page)
    title = f"<title>{escape(stroke.label)}</title>" if stroke.label else ""
    return f'    <path d="M{steps}">{title}</path>'


def _number(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}"
    return text.rstrip("0").rstrip(".") if digits else text


def _rounded(ring: FloatArray, radius: float, overshoot: float) -> FloatArray:
    """Return the closed outline, finely and evenly spaced, as a hand would smooth its corners.

    Sharpening a smoothed curve by a still smoother one bends it outwards beside each corner.
    """
    closed = np.vstack([ring, ring[:1]])
    lengths = np.hypot(*np.diff(closed, axis=0).T)
    around = np.concatenate([[0.0], np.cumsum(lengths)])
    radius = min(radius, 0.125 * float(np.ptp(ring, axis=0).min()))
    count = math.ceil(min(max(128.0, 6.0 * around[-1] / max(radius, 1e-9)), 2048.0))
    at = np.linspace(0.0, around[-1], count, endpoint=False)
    fine = np.stack([np.interp(at, around, axis) for axis in closed.T], axis=1)
    sigma = radius / (around[-1] / count)
    return (1.0 + overshoot) * _blurred(fine, sigma) - overshoot * _blurred(fine, 2.5 * sigma)


def _blurred(ring: FloatArray, sigma: float) -> FloatArray:
    """Return a closed line smoothed by a Gaussian of ``sigma`` points."""
    half = math.ceil(3.0 * sigma)
    if half == 0:
        return ring
    kernel = np.exp(-0.5 * (np.arange(-half, half + 1) / sigma) ** 2)
    longer = ring[np.arange(-half, len(ring) + half) % len(ring)]
    columns = [np.convolve(axis, kernel / kernel.sum(), mode="valid") for axis in longer.T]
    return np.stack(columns, axis=1)


def _from_anywhere(outline: FloatArray, rng: np.random.Generator, gap: float) -> FloatArray:
    """Return the outline from a random point, either way round, short of its end by ``gap``."""
    if rng.random() < 0.5:
        outline = outline[::-1]
    turn = np.roll(outline, -int(rng.integers(len(outline))), axis=0)
    twice = np.vstack([turn, turn, turn[:1]])
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(twice, axis=0).T))])
    at = np.linspace(0.0, (1.0 - gap) * way[len(turn)], len(turn))
    return np.stack([np.interp(at, way, axis) for axis in twice.T], axis=1)


def _sampled(path: FloatArray, speed: float, rate: float) -> tuple[FloatArray, FloatArray]:
    """Return points (k, 2) and times (k,) as a tablet records a pen that follows a path."""
    steps = np.hypot(*np.diff(path, axis=0).T)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    between = speed * _speed_share(path, float(way[-1]))
    clock = np.concatenate([[0.0], np.cumsum(steps / between)])
    ticks = np.arange(max(3, math.ceil(clock[-1] * rate))) / rate
    times = np.append(ticks[ticks < clock[-1]], clock[-1])
    at = np.interp(times, clock, way)
    return np.stack([np.interp(at, way, axis) for axis in path.T], axis=1), times


def _speed_share(path: FloatArray, length: float) -> FloatArray:
    """Return the speed on each step as a share of that on a straight line."""
    direction = np.unwrap(np.arctan2(*np.diff(path, axis=0).T[::-1]))
    curvature = np.abs(np.gradient(direction)) * (len(path) - 1) / length
    shape = np.maximum(curvature * length / (2.0 * np.pi), 1.0) ** (-1.0 / 3.0)
    along = (np.arange(len(shape)) + 0.5) / len(shape)
    ends = np.minimum(1.0, 0.3 + 14.0 * np.minimum(along, 1.0 - along))
    return np.asarray(shape * ends, dtype=np.float64)


def _fading_in(times: FloatArray) -> FloatArray:
    """Return 0 at the first point and 1 at the last, evenly in time."""
    share: FloatArray = times / times[-1]
    return share


def _smooth_noise(rng: np.random.Generator, count: int, sigma: float) -> FloatArray:
    """Return noise of unit deviation, shape (count, 2), smoothed by a Gaussian of sigma points."""
    half = math.ceil(3.0 * sigma)
    kernel = np.exp(-0.5 * (np.arange(-half, half + 1) / sigma) ** 2)
    kernel /= math.sqrt(float(kernel @ kernel))
    white = rng.normal(size=(2, count + 2 * half))
    return np.stack([np.convolve(axis, kernel, mode="valid") for axis in white], axis=1)
