"""What speaks for an object map, part by part, compiled.

Each part is a sum over the lines of the map, so that maps of more and of fewer lines can be
compared by sums of these. Deviations d, e and h are those of places (in units of the sketch's
spacing), of ln of the areas, and of shapes, under the pose that fits the map best.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from sketchmatch.api.kernels import kernel, mean_absolute_difference, pair_index
from sketchmatch.model import BoolArray, FloatArray, IntArray, RelationTable, Scene
from sketchmatch.model.arrays import frozen
from sketchmatch_builtin.alignment._poses import (
    TOLERANCES,
    Tolerances,
    fitted_pose,
    grown,
    square,
)
from sketchmatch_builtin.alignment._selves import self_similarities
from sketchmatch_builtin.alignment._things import Things

__all__ = ["PARTS", "Part", "Relations", "measure", "measured", "relations_of"]


class Part(IntEnum):
    """The parts, by their places in a row.

    ``PLACE``, ``SIZE`` and ``SHAPE`` are Σ ln(1 + x²/3) of deviations x in wide units, ``_TIGHT``
    in narrow ones, and ``_SQUARE`` Σ min(x², 4); ``SCATTER`` and its kin are the number of lines
    times ln of the root mean square. ``BENT`` is as ``PLACE`` where the page may be stretched and
    grow to one side, which costs ``BEND``; ``OFFSET`` is the square of how much larger things are
    drawn than their distances. ``MATCHED`` counts lines, ``MISSING`` and ``CROWD`` mapped objects
    that nobody drew amid those that somebody did, ``ALIKE`` and ``UNLIKE`` labels that mean the
    same and that do not. ``WORST`` and ``SECOND`` are the two worst lines, ``OUTLIER``
    the one that is worst for what the others are. ``NEAR`` is as ``PLACE``, of the way from each
    object to its two nearest, in units of its length. ``SIMILARITY``,
    ``ROTATION`` and ``DILATION`` are the number of lines times what ζσ, ζR and ζL lack of 1,
    ``SELF`` is
    Σ ln(1 + 100 x) of what the objects' own histograms lack of being alike.
    """

    PLACE = 0
    PLACE_TIGHT = 1
    PLACE_SQUARE = 2
    BENT = 3
    BENT_TIGHT = 4
    SIZE = 5
    SIZE_TIGHT = 6
    SIZE_SQUARE = 7
    SHAPE = 8
    SHAPE_TIGHT = 9
    SHAPE_SQUARE = 10
    SCATTER = 11
    SCATTER_SIZE = 12
    SCATTER_SHAPE = 13
    OFFSET = 14
    BEND = 15
    MATCHED = 16
    MISSING = 17
    CROWD = 18
    WORST = 19
    SECOND = 20
    SIMILARITY = 21
    ROTATION = 22
    DILATION = 23
    SELF = 24
    ALIKE = 25
    UNLIKE = 26
    NEAR = 27
    NEAR_TIGHT = 28
    OUTLIER = 29


PARTS = tuple(part.name.lower() for part in Part)

_FEWEST_AROUND = 3
_USUAL = 0.04
_BENDS = 6
_PAGE = 0.12


class Relations(NamedTuple):
    """What speaks for pairs of objects, and for each.

    Attributes
    ----------
    similarity, rotation, level
        Shape (Q, Q'/2) of template and argument: σ, R and L̂.
    selves
        Shape (n, m, bins): how alike the own histograms of a sketched and a mapped object are for
        turns from sketch to map over half of the full turn.
    names
        int64, shape (n, m): 1 where labels mean the same, −1 where they do not, 0 without one.
    swapped
        Whether the template is the map.
    """

    similarity: FloatArray
    rotation: FloatArray
    level: FloatArray
    selves: FloatArray
    names: IntArray
    swapped: bool


@kernel
def measure(
    maps: IntArray,
    drawn: Things,
    mapped: Things,
    relations: Relations,
    tolerances: Tolerances,
    parts: FloatArray,
) -> None:
    """Measure what speaks for maps.

    Parameters
    ----------
    maps
        int64, shape (c, n): the mapped object of each sketched one, −1 for none.
    drawn, mapped, relations
        What is known of objects and of pairs.
    tolerances
        How far sketches leave the truth, for the fit of poses.
    parts
        Shape (c, parts), written.
    """
    n, m = drawn.places.size, mapped.places.size
    scratch = np.empty(n * (n - 1) // 2)
    used = np.empty(m, dtype=np.bool_)
    for x in range(maps.shape[0]):
        partners, row = maps[x], parts[x]
        row[:] = 0.0
        u, t, growth, count = fit_map(partners, drawn, mapped, tolerances)
        row[Part.MATCHED] = count
        if count < 2:
            continue
        used[:] = False
        for i in range(n):
            if partners[i] >= 0:
                used[partners[i]] = True
        _compare_lines(partners, drawn, mapped, relations, u, t, growth, count, row)
        _compare_ways(partners, drawn, mapped, u, row)
        _bend(partners, drawn, mapped, u, t, count, row)
        _surround(partners, used, drawn, mapped, u, row)
        if relations.similarity.size > 0:
            _relate(partners, n, m, relations, scratch, count, row)


@kernel
def fit_map(
    partners: IntArray, drawn: Things, mapped: Things, tolerances: Tolerances
) -> tuple[complex, complex, float, int]:
    """Return the pose that fits a map best, how much sizes grow, and how many lines it has."""
    count, before, after = 0, 0.0j, 0.0j
    for i in range(partners.size):
        if partners[i] >= 0:
            count += 1
            before += drawn.places[i]
            after += mapped.places[partners[i]]
    if count < 2:
        return 1.0 + 0.0j, 0.0j, 0.0, count
    before, after = before / count, after / count
    product, near, far = 0.0j, 0.0, 0.0
    for i in range(partners.size):
        if partners[i] >= 0:
            z, w = drawn.places[i] - before, mapped.places[partners[i]] - after
            product += w * z.conjugate()
            near += square(z)
            far += square(w)
    if near == 0.0 or far == 0.0:
        return 1.0 + 0.0j, after - before, 0.0, count
    # Where no turn fits, least squares would shrink the sketch to a point, which fits anything.
    u, least = product / near, 0.1 * np.sqrt(far / near)
    if abs(u) < least:
        u = u / abs(u) * least if abs(u) > 0.0 else least + 0.0j
    t = after - u * before
    for _ in range(3):
        v, s = fitted_pose(u, t, drawn, mapped, tolerances, partners)
        if abs(v) < least:
            break
        u, t = v, s
    return u, t, grown(drawn, mapped, partners, 2.0 * np.log(abs(u)), tolerances), count


@kernel
def _compare_lines(
    partners: IntArray,
    drawn: Things,
    mapped: Things,
    relations: Relations,
    u: complex,
    t: complex,
    growth: float,
    count: int,
    row: FloatArray,
) -> None:
    """Measure each line under a pose."""
    unit, twist = abs(u) * drawn.spacing, u * u / square(u)
    bins = relations.selves.shape[2]
    whole, after, rest = _bin_of(u, bins)
    places = sizes = shapes = 0.0
    deviations = np.empty((count, 3))
    line = 0
    for i in range(partners.size):
        j = partners[i]
        if j < 0:
            continue
        d = square(mapped.places[j] - u * drawn.places[i] - t) / (unit * unit)
        e = (mapped.sizes[j] - drawn.sizes[i] - growth) ** 2
        h = square(drawn.shapes[i] * twist - mapped.shapes[j])
        deviations[line, 0], deviations[line, 1], deviations[line, 2] = d, e, h
        line += 1
        row[Part.PLACE] += _robust(d, 0.35)
        row[Part.PLACE_TIGHT] += _robust(d, 0.12)
        row[Part.PLACE_SQUARE] += min(d / 0.5**2, 4.0)
        row[Part.SIZE] += _robust(e, 0.4)
        row[Part.SIZE_TIGHT] += _robust(e, 0.15)
        row[Part.SIZE_SQUARE] += min(e / 0.5**2, 4.0)
        row[Part.SHAPE] += _robust(h, 0.35)
        row[Part.SHAPE_TIGHT] += _robust(h, 0.12)
        row[Part.SHAPE_SQUARE] += min(h / 0.4**2, 4.0)
        odd = _robust(d, 0.2) + _robust(e, 0.25) + _robust(h, 0.2)
        if odd > row[Part.WORST]:
            row[Part.SECOND], row[Part.WORST] = row[Part.WORST], odd
        elif odd > row[Part.SECOND]:
            row[Part.SECOND] = odd
        places += min(d, 1.0)
        sizes += min(e, 2.0)
        shapes += min(h, 1.0)
        if bins == 0:
            continue
        alike = (1.0 - rest) * relations.selves[i, j, whole] + rest * relations.selves[i, j, after]
        row[Part.SELF] += np.log(1.0 + max(0.0, 1.0 - alike) / 0.01)
        if relations.names[i, j] > 0:
            row[Part.ALIKE] += 1.0
        elif relations.names[i, j] < 0:
            row[Part.UNLIKE] += 1.0
    row[Part.SCATTER] = count * np.log(0.03 + np.sqrt(places / count))
    row[Part.SCATTER_SIZE] = count * np.log(0.05 + np.sqrt(sizes / count))
    row[Part.SCATTER_SHAPE] = count * np.log(0.03 + np.sqrt(shapes / count))
    row[Part.OUTLIER] = _outlier(deviations)
    row[Part.OFFSET] = min((growth - 2.0 * np.log(abs(u))) ** 2, 6.0)


@kernel
def _bin_of(u: complex, bins: int) -> tuple[int, int, float]:
    """Return the bins between which the turn of a pose lies, and how far between."""
    if bins == 0:
        return 0, 0, 0.0
    turn = np.angle(u) % np.pi * bins / np.pi
    whole = int(turn)
    rest = turn - whole
    whole %= bins
    return whole, whole + 1 if whole + 1 < bins else 0, rest


@kernel
def _outlier(deviations: FloatArray) -> float:
    """Return ln(1 + x²/3) of the line that is worst in units of what the others deviate by."""
    count, sums = deviations.shape[0], deviations.sum(axis=0)
    worst = 0.0
    for k in range(count):
        odd = 0.0
        for part in range(deviations.shape[1]):
            others = (sums[part] - deviations[k, part] + _USUAL) / count
            odd += deviations[k, part] / others
        worst = max(worst, odd)
    return float(np.log(1.0 + worst / 3.0))


@kernel
def _compare_ways(
    partners: IntArray, drawn: Things, mapped: Things, u: complex, row: FloatArray
) -> None:
    """Measure the ways from objects to their nearest, which shifts of whole groups leave alone."""
    for i in range(partners.size):
        if partners[i] < 0:
            continue
        first, second, near, next_near = -1, -1, np.inf, np.inf
        for k in range(partners.size):
            if k == i or partners[k] < 0:
                continue
            distance = square(drawn.places[k] - drawn.places[i])
            if distance < near:
                first, second, near, next_near = k, first, distance, near
            elif distance < next_near:
                second, next_near = k, distance
        for k in (first, second):
            if k < 0:
                continue
            way = drawn.places[k] - drawn.places[i]
            other = (mapped.places[partners[k]] - mapped.places[partners[i]]) / u
            length = max(square(way), 1e-12 * drawn.spacing**2)
            deviation = square(other - way) / length
            row[Part.NEAR] += 0.5 * _robust(deviation, 0.4)
            row[Part.NEAR_TIGHT] += 0.5 * _robust(deviation, 0.15)


@kernel
def _robust(deviation: float, unit: float) -> float:
    """Return ln(1 + x²/3) of a square of deviations."""
    return float(np.log(1.0 + deviation / (3.0 * unit * unit)))


@kernel
def _bend(
    partners: IntArray,
    drawn: Things,
    mapped: Things,
    u: complex,
    t: complex,
    count: int,
    row: FloatArray,
) -> None:
    """Measure what is left of the places where the page is stretched and one side larger.

    What a pose leaves, in units of the spacing, is fitted by a shift, by a stretch, conj(z) times
    a complex number, and by z times a scale that grows along x and y; z is from the middle in
    units of the extent. A ridge keeps the last two small.
    """
    middle, extent = 0.0j, 0.0
    for i in range(partners.size):
        if partners[i] >= 0:
            middle += drawn.places[i] / count
    for i in range(partners.size):
        if partners[i] >= 0:
            extent += square(drawn.places[i] - middle) / count
    extent = np.sqrt(extent)
    if extent == 0.0:
        return
    ratio = extent / drawn.spacing
    normal, right = np.zeros((_BENDS, _BENDS)), np.zeros(_BENDS)
    effects = np.zeros((2, _BENDS))
    for i in range(partners.size):
        if partners[i] < 0:
            continue
        left = (mapped.places[partners[i]] - u * drawn.places[i] - t) / (u * drawn.spacing)
        share = 1.0 / (1.0 + square(left) / (3.0 * 0.35**2))
        _write_effects((drawn.places[i] - middle) / extent, effects)
        for p in range(_BENDS):
            right[p] += share * (effects[0, p] * left.real + effects[1, p] * left.imag)
            for q in range(_BENDS):
                normal[p, q] += share * (
                    effects[0, p] * effects[0, q] + effects[1, p] * effects[1, q]
                )
    for p in range(_BENDS):
        normal[p, p] += 1e-6 if p < 2 else 1e-6 + (0.2 / (_PAGE * ratio)) ** 2
    found = _solve(normal, right)
    for i in range(partners.size):
        if partners[i] < 0:
            continue
        left = (mapped.places[partners[i]] - u * drawn.places[i] - t) / (u * drawn.spacing)
        _write_effects((drawn.places[i] - middle) / extent, effects)
        x, y = left.real - (effects[0] * found).sum(), left.imag - (effects[1] * found).sum()
        row[Part.BENT] += _robust(x * x + y * y, 0.35)
        row[Part.BENT_TIGHT] += _robust(x * x + y * y, 0.12)
    row[Part.BEND] = min((found[2:] ** 2).sum() / (_PAGE * ratio) ** 2, 9.0)


@kernel
def _solve(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve linear equations with a symmetric, positive definite matrix, which is overwritten.

    By Cholesky's decomposition; ``np.linalg`` in a kernel needs SciPy, which not everyone has.
    """
    found = right.copy()
    for i in range(right.size):
        for j in range(i + 1):
            rest = matrix[i, j]
            for k in range(j):
                rest -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = np.sqrt(rest) if i == j else rest / matrix[j, j]
        for k in range(i):
            found[i] -= matrix[i, k] * found[k]
        found[i] /= matrix[i, i]
    for i in range(right.size - 1, -1, -1):
        for k in range(i + 1, right.size):
            found[i] -= matrix[k, i] * found[k]
        found[i] /= matrix[i, i]
    return found


@kernel
def _write_effects(z: complex, effects: FloatArray) -> None:
    """Write what each unknown of a bend does to x and to y of a place."""
    effects[:] = 0.0
    effects[0, 0] = effects[1, 1] = 1.0
    effects[0, 2], effects[1, 2] = z.real, -z.imag
    effects[0, 3], effects[1, 3] = z.imag, z.real
    effects[0, 4], effects[1, 4] = z.real * z.real, z.imag * z.real
    effects[0, 5], effects[1, 5] = z.real * z.imag, z.imag * z.imag


@kernel
def _surround(
    partners: IntArray, used: BoolArray, drawn: Things, mapped: Things, u: complex, row: FloatArray
) -> None:
    """Count the mapped objects that nobody drew amid those that somebody did.

    One is the more amid them, the less its directions to them leave a gap, and in a crowd where
    three of them are nearer than twice the spacing.
    """
    near, angles = 4.0 * square(u) * drawn.spacing**2, np.empty(partners.size)
    for j in range(used.size):
        if used[j]:
            continue
        count, close = 0, 0
        for i in range(partners.size):
            if partners[i] >= 0:
                way = mapped.places[partners[i]] - mapped.places[j]
                close += square(way) < near
                angles[count] = np.angle(way)
                count += 1
        row[Part.CROWD] += close >= _FEWEST_AROUND
        if count < _FEWEST_AROUND:
            continue
        around = np.sort(angles[:count])
        gap = around[0] + 2.0 * np.pi - around[count - 1]
        for i in range(1, count):
            gap = max(gap, around[i] - around[i - 1])
        row[Part.MISSING] += min(1.0, max(0.0, (np.pi - gap) / (0.25 * np.pi)))


@kernel
def _relate(
    partners: IntArray,
    n: int,
    m: int,
    relations: Relations,
    scratch: FloatArray,
    count: int,
    row: FloatArray,
) -> None:
    """Measure the relations of the lines."""
    pairs, similarity, cosine, sine = 0, 0.0, 0.0, 0.0
    for a in range(n):
        for b in range(a + 1, n):
            c, d = partners[a], partners[b]
            if c < 0 or d < 0:
                continue
            sign = 1.0
            if c > d:
                c, d, sign = d, c, -1.0
            i, j = pair_index(a, b, n), pair_index(c, d, m)
            if relations.swapped:
                i, j = j, i
            similarity += relations.similarity[i, j]
            cosine += sign * np.cos(relations.rotation[i, j])
            sine += sign * np.sin(relations.rotation[i, j])
            scratch[pairs] = relations.level[i, j]
            pairs += 1
    row[Part.SIMILARITY] = count * (1.0 - similarity / pairs)
    row[Part.ROTATION] = count * (1.0 - np.sqrt(cosine * cosine + sine * sine) / pairs)
    spread = mean_absolute_difference(scratch[:pairs])
    row[Part.DILATION] = count * (1.0 - np.exp2(-spread))


def measured(
    maps: IntArray, drawn: Things, mapped: Things, relations: Relations | None = None
) -> FloatArray:
    """Return what speaks for maps, shape (c, parts); without relations nothing of these."""
    parts = np.empty((len(maps), len(PARTS)))
    measure(maps, drawn, mapped, relations or _UNRELATED, TOLERANCES, parts)
    return parts


def relations_of(
    scenes: tuple[Scene, Scene], table: RelationTable, names: IntArray | None, swapped: bool
) -> Relations:
    """Return what speaks for pairs of objects, and for each.

    Parameters
    ----------
    scenes
        The sketch and the map.
    table, names
        Of template and argument.
    swapped
        Whether the template is the map.
    """
    alike = np.zeros(tuple(map(len, scenes)), dtype=np.int64)
    if names is not None:
        alike[:] = names.T if swapped else names
    return Relations(
        table.similarity,
        table.rotation,
        table.normalized_dilation,
        self_similarities(*scenes),
        alike,
        swapped,
    )


_NOTHING = frozen(np.zeros((0, 0)))
_UNRELATED = Relations(
    _NOTHING,
    _NOTHING,
    _NOTHING,
    frozen(np.zeros((0, 0, 0))),
    frozen(np.zeros((0, 0), dtype=np.int64)),
    False,
)
