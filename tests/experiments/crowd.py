"""A crowd: places and people of every kind, each with parameters of its own from wide ranges.

Who draws what a judge is to judge is not known, so where it learns how sure to be has to be wider
than any one model of places and people: how large things are for their distances, how they stand
and what is repeated, what is forgotten and what is invented and where, and how far, and how much
alike for neighbours, places, sizes, shapes and headings are wrong. This is domain randomisation.

References
----------
J. Tobin et al., "Domain randomization for transferring deep neural networks from simulation to the
real world", IROS 2017.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
import shapely

from sketchmatch.model import FloatArray, IntArray, Scene

__all__ = ["Style", "drawn_by_somebody", "invented", "kept_of", "place_of", "style_of"]

_FORGOTTEN = (0.4, 0.3, 0.2, 0.1)
_GAP = 0.03
_TRIES = 60
_SMALLER, _BETTER = 0.88, 0.9
_AT_ONCE = 6
_CORNERS = 18
_LEVELS = ((0.02, 0.36), (0.02, 0.5))
"""How far places are wrong, of the mean distance to what is nearest: from this up to that, rms;
first of people who are about as good at everything, then of the uneven, as below."""

_SHAPES = (0.5, 0.2, 0.14, 0.08, 0.08), (0.6, 0.2, 0.12, 0.04, 0.04)
_STRAIGHT, _SQUARER = (0.25, 0.1), (0.3, 0.1)

_Field: TypeAlias = Callable[[FloatArray, np.random.Generator], FloatArray]


class Style(NamedTuple):
    """What the places of one builder have in common.

    Attributes
    ----------
    size, varied
        Of things beside the distance between them, and the deviation of its logarithm.
    longer
        Deviation of the logarithm of aspects.
    shapes
        Shares of boxes, ellipses, polygons, L-shapes and triangles.
    kinds, repeated
        Things that are met again and again, and the share of them.
    layout
        Index of how things stand.
    regular
        How far from a lattice, a line or a ring things stand, beside their distance.
    heading
        Whether things head along where they stand, along few directions, or anyhow.
    modules
        Groups of things that are met again, as places, headings and indices of kinds.
    """

    size: float
    varied: float
    longer: float
    shapes: FloatArray
    kinds: tuple[FloatArray, ...]
    repeated: float
    layout: int
    regular: float
    heading: int
    modules: tuple[tuple[FloatArray, FloatArray, IntArray], ...]


def style_of(rng: np.random.Generator) -> Style:
    """Return how somebody furnishes places."""
    varied, longer = rng.uniform(0.0, 0.7), rng.uniform(0.0, 0.8)
    shapes = rng.dirichlet((1.2, 0.5, 0.6, 0.4, 0.2))
    kinds = tuple(_thing(rng, varied, longer, shapes) for _ in range(rng.integers(2, 10)))
    modules = []
    for _ in range(int(rng.integers(1, 4))):
        count = int(rng.integers(2, 7))
        at = rng.normal(0.0, 1.0, (count, 2)) * math.sqrt(count) * 0.55
        modules.append(
            (at, rng.integers(4, size=count) * np.pi / 2.0, rng.integers(len(kinds), size=count))
        )
    return Style(
        math.exp(rng.uniform(math.log(0.15), math.log(0.85))),
        varied,
        longer,
        shapes,
        kinds,
        rng.choice((0.0, rng.uniform(0.0, 1.0), 1.0), p=(0.4, 0.53, 0.07)),
        int(rng.choice(6, p=(0.3, 0.17, 0.13, 0.15, 0.1, 0.15))),
        rng.choice((0.03, rng.uniform(0.0, 0.4)), p=(0.2, 0.8)),
        int(rng.choice(3, p=(0.4, 0.3, 0.3))),
        tuple(modules),
    )


def place_of(style: Style, objects: int, rng: np.random.Generator) -> Scene:
    """Return so many things as somebody furnishes a place with; about 1 from each to the next."""
    rings: list[FloatArray] = []
    outlines: list[shapely.Polygon] = []
    spread = 1.0
    while len(rings) < objects:
        spots = (_modular if style.layout == 5 else _spots)(style, objects, spread, rng)
        for centre, heading, outline in spots:
            if len(rings) == objects:
                break
            ring = outline @ _turning(-heading) * style.size
            for _ in range(4):
                polygon = shapely.Polygon(ring + centre)
                if not outlines or shapely.distance(outlines, polygon).min() > _GAP:
                    rings.append(ring + centre)
                    outlines.append(polygon)
                    break
                ring = ring * 0.75
        spread *= 1.15
    turn = _turning(rng.uniform(0.0, 7.0))
    return Scene.from_polygons([rings[k] @ turn for k in rng.permutation(objects)])


_Spot: TypeAlias = tuple[FloatArray, float, FloatArray]


def _spots(style: Style, objects: int, spread: float, rng: np.random.Generator) -> list[_Spot]:
    """Return where things may stand: anyhow, on a lattice, in clusters, along lines or rings."""
    side = math.sqrt(objects) * spread
    floor = side * rng.uniform(0.6, 1.6) ** np.array([1.0, -1.0])
    count = 2 * objects
    headings = np.zeros(count)
    match style.layout:
        case 0:
            at = rng.uniform(0.0, 1.0, (count, 2)) * floor
        case 1:
            columns = max(1, round(float(floor[0])))
            row, column = np.divmod(np.arange(count), columns)
            shifted = rng.choice((0.0, 0.5)) * (row % 2)
            at = spread * np.column_stack([column + shifted, row * rng.uniform(0.8, 1.5)])
            at = at[rng.permutation(max(objects, round(rng.uniform(1.0, 1.5) * objects)))]
        case 2:
            middles = rng.uniform(0.0, 1.0, (max(2, objects // 6), 2)) * floor
            at = middles[rng.integers(len(middles), size=count)]
            at = at + rng.normal(0.0, rng.uniform(0.5, 1.3), at.shape)
        case 3:
            lines = max(1, round(side * rng.uniform(0.4, 1.0)))
            line = rng.integers(lines, size=count)
            begins = rng.uniform(0.0, 1.0, (lines, 2)) * floor
            angles = rng.integers(2, size=lines) * np.pi / 2.0 + rng.uniform(0.0, 7.0) * (
                rng.random() < 0.3
            )
            along = rng.integers(0, 9, size=count) * rng.uniform(0.8, 1.2)
            headings = angles[line]
            at = begins[line] + along[:, None] * _directions(headings)
        case _:
            rings = max(1, objects // 9)
            ring = rng.integers(rings, size=count)
            middles = rng.uniform(0.0, 1.0, (rings, 2)) * floor
            angles = rng.integers(0, 10, size=count) * np.pi / 5.0
            radius = rng.choice((0.9, 1.5, 2.4), size=rings)[ring]
            headings = angles
            at = middles[ring] + radius[:, None] * _directions(angles)
    at = at + rng.normal(0.0, 1.0, at.shape) * style.regular
    few = rng.integers(4, size=len(at)) * np.pi / 2.0 + rng.normal(0.0, 0.03, len(at))
    anyhow = rng.uniform(0.0, 7.0, len(at))
    heads = (headings[: len(at)], few, anyhow)[style.heading]
    found = []
    for centre, heading in zip(at, heads, strict=True):
        again = rng.random() < style.repeated
        outline = (
            style.kinds[rng.integers(len(style.kinds))]
            if again
            else _thing(rng, style.varied, style.longer, style.shapes)
        )
        found.append((centre, float(heading), outline))
    return found


def _modular(style: Style, objects: int, spread: float, rng: np.random.Generator) -> list[_Spot]:
    """Return where things may stand in groups that are met again, turned or in the mirror."""
    cells = max(1, math.ceil(1.6 * objects / 3))
    columns = max(1, round(math.sqrt(cells)))
    step = rng.uniform(2.2, 3.2) * spread
    rare = rng.uniform(0.0, 0.35)
    found = []
    for cell in range(cells):
        at, headings, kinds = style.modules[rng.integers(len(style.modules))]
        middle = np.array([cell % columns, cell // columns]) * step
        middle = middle + rng.normal(0.0, style.regular, 2)
        turn = rng.integers(4) * np.pi / 2.0
        mirrored = np.array([rng.choice((-1.0, 1.0)), 1.0])
        for place, heading, kind in zip(at, headings, kinds, strict=True):
            if rng.random() < rare:
                continue
            where = (place * mirrored) @ _turning(-turn) + middle
            where = where + rng.normal(0.0, 0.15 * style.regular, 2)
            found.append((where, float(heading + turn), style.kinds[kind] * mirrored))
    return found


def kept_of(place: Scene, count: int, rng: np.random.Generator) -> tuple[IntArray, IntArray]:
    """Return what is drawn of a place, and what is seen there: that, and what is forgotten."""
    centres = _middles([item.rings[0] for item in place.objects])
    forgotten = int(rng.choice(len(_FORGOTTEN), p=_FORGOTTEN))
    ways = centres - centres[rng.integers(len(centres))]
    # What is seen is round, long, or to one side of who stands there.
    ways = ways @ _turning(rng.uniform(0.0, 7.0)) * rng.choice((1.0, rng.uniform(0.3, 1.0)), size=2)
    far = np.hypot(*ways.T) + (rng.random() < 0.2) * np.maximum(0.0, 3.0 * ways[:, 0])
    order = np.argsort(far, kind="stable")
    seen: IntArray = order if rng.random() < 0.12 else order[: count + forgotten]
    areas = np.array([place.objects[k].area for k in seen])
    weights = np.where(rng.random() < 0.4, areas, 1.0) + 1e-9
    count = max(2, min(count, len(seen)))
    kept: IntArray = rng.choice(seen, count, replace=False, p=weights / weights.sum())
    return kept, seen


def invented(
    style: Style,
    place: Scene,
    seen: IntArray,
    kept: IntArray,
    count: int,
    rng: np.random.Generator,
) -> list[FloatArray]:
    """Return things that are not there, clear of what is drawn, and mostly of all there is.

    They are anywhere amid what is seen, at its rim, beside one thing, or where one is forgotten.
    """
    centres = _middles([place.objects[k].rings[0] for k in seen])
    drawn = [place.objects[k].polygon for k in kept]
    every = [item.polygon for item in place.objects]
    low, high = centres.min(axis=0), centres.max(axis=0)
    rim, like = rng.uniform(0.0, 0.35) * (high - low), rng.random()
    over = rng.random() < 0.2
    found: list[FloatArray] = []
    for _ in range(_TRIES):
        if len(found) == count:
            break
        at = rng.uniform(low - rim, high + rim)
        if rng.random() < 0.25:
            at = centres[rng.integers(len(centres))] + rng.normal(0.0, 0.8, 2)
        if rng.random() < like:
            ring = place.objects[rng.integers(len(place))].rings[0]
            ring = ring - _middles([ring])[0]
        else:
            ring = _thing(rng, style.varied, style.longer, style.shapes) * style.size
        ring = ring * math.exp(rng.normal(0.0, 0.2)) @ _turning(rng.integers(4) * np.pi / 2.0)
        outline = shapely.Polygon(ring + at)
        if shapely.distance(drawn if over else every, outline).min() > _GAP:
            found.append(ring + at)
            drawn.append(outline)
            every.append(outline)
    return found


def drawn_by_somebody(
    things: Sequence[FloatArray], rng: np.random.Generator, uneven: bool = False
) -> list[FloatArray]:
    """Return things as somebody draws them, clear of each other."""
    person, care = int(rng.integers(2**32)), 1.0
    while True:
        # The same person, who now takes a little more care, and more room.
        rings = _drawn(things, care, np.random.default_rng(person), uneven)
        for _ in range(_AT_ONCE):
            outlines = [shapely.Polygon(ring) for ring in rings]
            first, second = shapely.STRtree(outlines).query(outlines, predicate="intersects")
            meeting = set(first[first != second].tolist())
            if not meeting:
                return rings
            for k in meeting:
                middle = rings[k].mean(axis=0)
                rings[k] = middle + _SMALLER * (rings[k] - middle)
        care *= _BETTER


def _drawn(
    things: Sequence[FloatArray], care: float, rng: np.random.Generator, uneven: bool
) -> list[FloatArray]:
    centres = _middles(things)
    unit = _nearest(centres)
    level = care * unit * _between(*_LEVELS[uneven], rng, uneven)
    places = centres + level * _wrong(centres, rng)
    areas = np.array([shapely.Polygon(ring).area for ring in things])
    sizes, turns, stretches = _of_things(np.log(areas) / 2.0, centres, care, rng, uneven)
    shape = int(rng.choice(5, p=_SHAPES[uneven]))
    straight, in_world = rng.random() < _STRAIGHT[uneven], rng.random() < 0.4
    squarer = rng.uniform(0.0, 0.6) if rng.random() < _SQUARER[uneven] else 0.0
    rings = []
    for k, (ring, centre) in enumerate(zip(things, centres, strict=True)):
        own = int(rng.integers(4)) if shape == 4 else shape
        outline, heading = _simplified(ring - centre, own)
        # Along its own axes, where it may be drawn squarer, and straighter, than it is.
        outline = outline @ _turning(heading)
        sides = np.ptp(outline, axis=0)
        ratio = math.log(sides[0] / sides[1])
        outline = outline * np.exp(0.5 * care * squarer * ratio * np.array([-1.0, 1.0]))
        if not in_world:
            outline = outline * np.exp(stretches[k])
        nearest = round(heading / (np.pi / 2.0)) * np.pi / 2.0
        outline = outline @ _turning(-(nearest if straight else heading) - turns[k])
        if in_world:
            outline = outline * np.exp(stretches[k])
        rings.append(outline * math.exp(sizes[k]) + places[k])
    page = _turning(rng.uniform(0.0, 7.0)) * math.exp(rng.uniform(-1.0, 4.0))
    return [ring @ page for ring in rings]


def _wrong(centres: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return by how much places are wrong: a mixture of ways to be, of 1 in the root mean square.

    What a turn, a shift or a scale makes good is no mistake, and is taken away.
    """
    some = [*{0, *rng.integers(len(_FIELDS), size=rng.integers(0, 4)).tolist()}]
    shares = np.sqrt(rng.dirichlet(np.ones(len(some))))
    own = (centres - centres.mean(axis=0)) / (float(np.abs(centres - centres.mean(axis=0)).max()))
    wrong = np.zeros(centres.shape)
    for share, k in zip(shares, some, strict=True):
        field = _unfitted(_FIELDS[k](own, rng), own)
        wrong += share * field / (math.sqrt(float((field**2).sum(axis=1).mean())) + 1e-9)
    return wrong


def _unfitted(field: FloatArray, own: FloatArray) -> FloatArray:
    """Return what the best turn, shift and scale leave of a field."""
    z = own @ [1.0, 1.0j]
    f = field @ [1.0, 1.0j]
    f = f - f.mean()
    f = f - np.vdot(z, f) / np.vdot(z, z) * z
    return np.column_stack([f.real, f.imag]) if len(own) > 2 else field


def _alone(own: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Each thing by itself, some more than others."""
    uneven = rng.choice((0.0, rng.uniform(0.0, 0.8)))
    careless = np.exp(rng.normal(0.0, uneven, (len(own), 1)))
    across = rng.uniform(0.4, 1.0) if rng.random() < 0.3 else 1.0
    moved: FloatArray = careless * rng.normal(0.0, 1.0, own.shape) * [1.0, across]
    return moved @ _turning(rng.uniform(0.0, 7.0))


def _drifting(own: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Neighbours alike, within a reach of any length."""
    reach = rng.uniform(0.25, 2.0)
    waves, phases = rng.normal(0.0, 1.0 / reach, (2, 12)), rng.uniform(0.0, 7.0, 12)
    drift: FloatArray = np.sin(own @ waves + phases) @ rng.normal(0.0, 1.0, (12, 2))
    return drift


def _grouped(own: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Groups as one, and turned on their own."""
    heads = own[rng.permutation(len(own))[: rng.integers(2, 5)]]
    group = np.hypot(*(own[:, None] - heads).transpose(2, 0, 1)).argmin(axis=1)
    moved: FloatArray = rng.normal(0.0, 0.5, heads.shape)[group]
    turns = rng.normal(0.0, rng.uniform(0.0, 1.0), len(heads))[group][:, None]
    return moved + turns * ((own - heads[group]) @ _turning(np.pi / 2.0))


def _stretched(own: FloatArray, rng: np.random.Generator) -> FloatArray:
    """The page stretched and sheared."""
    stretched: FloatArray = own @ rng.normal(0.0, 1.0, (2, 2))
    return stretched


def _in_perspective(own: FloatArray, rng: np.random.Generator) -> FloatArray:
    """What is near drawn larger, or what is in the middle, or at the rim."""
    direction = rng.normal(0.0, 1.0, 2)
    seen = own * (own @ direction)[:, None]
    return seen if rng.random() < 0.6 else own * (own**2).sum(axis=1, keepdims=True)


def _evened(own: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Distances along two axes made more alike, or what is about in line put in line."""
    axes = _turning(rng.uniform(0.0, 7.0))
    turned = own @ axes
    moved = np.zeros(own.shape)
    for axis in (0, 1):
        along = turned[:, axis]
        if rng.random() < 0.5:
            ranks = np.argsort(np.argsort(along, kind="stable"), kind="stable")
            even = along.min() + np.ptp(along) * ranks / max(1, len(own) - 1)
            moved[:, axis] = even - along
        else:
            lines = rng.uniform(along.min(), along.max(), max(2, len(own) // 2))
            moved[:, axis] = lines[np.abs(along[:, None] - lines).argmin(axis=1)] - along
    return moved @ axes.T


_FIELDS: tuple[_Field, ...] = (
    _alone,
    _drifting,
    _grouped,
    _stretched,
    _in_perspective,
    _evened,
)


def _of_things(
    sizes: FloatArray, centres: FloatArray, care: float, rng: np.random.Generator, uneven: bool
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return by how much sizes, headings and proportions are wrong, the first and last as ln."""
    count = len(sizes)
    sized, turned, stretched = (
        _between(0.01 * uneven, most, rng, uneven) for most in (0.32, 0.25, 0.25)
    )
    careless = np.exp(rng.normal(0.0, rng.choice((0.0, rng.uniform(0.0, 0.7))), count))
    alike = rng.uniform(0.0, 0.7) if rng.random() < 0.4 else 0.0
    small = rng.normal(0.0, 0.3) + math.log(care)
    own = (centres - centres.mean(axis=0)) / (np.abs(centres - centres.mean(axis=0)).max() + 1e-9)
    growth = own @ rng.normal(0.0, rng.choice((0.0, 0.15)), 2)
    grown = small + care * (
        alike * (sizes.mean() - sizes) + growth + careless * _errors(sized, (count,), rng)
    )
    return (
        grown,
        care * careless * _errors(turned, (count,), rng),
        care * careless[:, None] * _errors(stretched, (count, 2), rng),
    )


def _between(least: float, most: float, rng: np.random.Generator, evenly: bool) -> float:
    """Return a deviation, where small ones are as frequent as large ones by ratio, or not."""
    if evenly:
        return float(math.exp(rng.uniform(math.log(least), math.log(most))))
    return float(rng.uniform(least, most))


def _errors(deviation: float, shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
    """Return errors of a deviation: normal, even, or mostly small and some large."""
    match int(rng.integers(3)):
        case 0:
            errors = rng.normal(0.0, 1.0, shape)
        case 1:
            errors = rng.uniform(-1.73, 1.73, shape)
        case _:
            errors = np.clip(rng.laplace(0.0, 0.71, shape), -4.0, 4.0)
    return np.asarray(deviation * errors)


def _thing(
    rng: np.random.Generator, varied: float, longer: float, shapes: FloatArray
) -> FloatArray:
    """Return an outline around the origin."""
    match int(rng.choice(5, p=shapes)):
        case 0:
            ring = _box()
        case 1:
            ring = _round(_CORNERS)
        case 2:
            corners = int(rng.integers(5, 10))
            ring = _round(corners) * rng.uniform(0.5, 1.0, (corners, 1))
        case 3:
            a, b = rng.uniform(0.2, 0.7, 2)
            ring = np.array([[0, 0], [1, 0], [1, a], [b, a], [b, 1], [0, 1]], dtype=float)
        case _:
            ring = np.array([[0.0, 0.0], [1.0, 0.0], [rng.uniform(0.0, 1.0), 1.0]])
    aspect = math.exp(np.clip(rng.normal(0.0, longer), -1.6, 1.6))
    ring = ring * aspect ** np.array([0.5, -0.5])
    size = math.exp(np.clip(rng.normal(0.0, varied), -1.5, 1.2))
    scaled: FloatArray = (ring - _middles([ring])[0]) * size / math.sqrt(shapely.Polygon(ring).area)
    return scaled


def _simplified(ring: FloatArray, shape: int) -> tuple[FloatArray, float]:
    """Return an outline, or a box, an ellipse or a hull as large; and where its long side heads."""
    polygon = shapely.Polygon(ring)
    sides = np.diff(shapely.get_coordinates(shapely.minimum_rotated_rectangle(polygon))[:3], axis=0)
    lengths = np.hypot(*sides.T)
    heading = math.atan2(sides[0, 1], sides[0, 0])
    match shape:
        case 0:
            outline = ring
        case 3:
            outline = shapely.get_coordinates(polygon.convex_hull)[:-1]
        case _:
            form = _box() - 0.5 if shape == 1 else 0.5 * _round(_CORNERS)
            outline = (form * lengths) @ _turning(-heading)
    scaled: FloatArray = outline * math.sqrt(polygon.area / shapely.Polygon(outline).area)
    return scaled, heading


def _middles(rings: Sequence[FloatArray]) -> FloatArray:
    """Return centroids, shape (n, 2)."""
    return shapely.get_coordinates(shapely.centroid([shapely.Polygon(ring) for ring in rings]))


def _nearest(centres: FloatArray) -> float:
    """Return the mean distance to what is nearest."""
    apart = np.hypot(*(centres[:, None] - centres).transpose(2, 0, 1))
    np.fill_diagonal(apart, np.inf)
    return float(apart.min(axis=1).mean())


def _box() -> FloatArray:
    return np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def _round(corners: int) -> FloatArray:
    return _directions(np.arange(corners) * (2.0 * np.pi / corners))


def _directions(angles: FloatArray) -> FloatArray:
    return np.column_stack([np.cos(angles), np.sin(angles)])


def _turning(angle: float) -> FloatArray:
    """Return the matrix by which rows of points are turned clockwise."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])
