"""What speaks for an object map: of each line, and of the whole, compiled.

Deviations are those under the pose that fits the map best: of places in units of the sketch's
spacing, of ln of the areas, and of shapes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sketchmatch.api.kernels import kernel, pair_index, sort_values
from sketchmatch.model import BoolArray, FloatArray, IntArray, RelationTable, Scene
from sketchmatch.model.arrays import frozen, sealed
from sketchmatch_builtin.alignment._forms import form_distances
from sketchmatch_builtin.alignment._poses import (
    TOLERANCES,
    Tolerances,
    fitted_pose,
    grown,
    pair_score,
    square,
)
from sketchmatch_builtin.alignment._selves import self_similarities
from sketchmatch_builtin.alignment._things import Things

__all__ = ["Line", "Measured", "Relations", "Whole", "measure", "measured", "relations_of"]


class _Line(NamedTuple):
    """What is measured of a line, by its place in a row; 0 for an object without partner.

    ``PLACE`` and ``SHAPE`` are squares of deviations, ``SIZE`` is one with its sign, and ``ROUND``
    is 0 where the mapped object is round. ``SELF`` is what the histograms of the forces within both
    objects lack of being alike, ``RELATION`` what σ lacks of 1, in the mean over the other lines.
    ``WAY`` is the square of how far the ways to the others deviate, each in units of its length,
    in the mean over all of them, ``NEAR`` over the two nearest. ``ALONE`` is ``PLACE`` under the
    pose that the other lines alone lead to, or about that, and ``BENT`` on a page that is stretched
    and grows to one side as fits best. ``ROOM`` is the square of how far the mapped object is from
    the nearest other one, in units of the spacing.
    """

    PLACE: int = 0
    SIZE: int = 1
    SHAPE: int = 2
    ROUND: int = 3
    SELF: int = 4
    RELATION: int = 5
    WAY: int = 6
    NEAR: int = 7
    ALONE: int = 8
    BENT: int = 9
    ROOM: int = 10
    FORM: int = 11


Line = _Line()


class _Whole(NamedTuple):
    """What is measured of a map as a whole, by its place in a row.

    ``SCORE`` is the sum of ℓ and −λ, ``MATCHED`` counts lines, ``MISSING`` and ``CROWD`` mapped
    objects that nobody drew amid those that somebody did, ``ALIKE`` and ``UNLIKE`` labels that
    mean the same and that do not. ``OFFSET`` is the square of how much larger things are drawn
    than their distances, ``BEND`` that of how far the page is stretched or grows to one side.
    """

    SCORE: int = 0
    MATCHED: int = 1
    MISSING: int = 2
    CROWD: int = 3
    OFFSET: int = 4
    BEND: int = 5
    ALIKE: int = 6
    UNLIKE: int = 7


Whole = _Whole()


class Measured(NamedTuple):
    """What speaks for maps.

    Attributes
    ----------
    lines
        Shape (c, n, len(Line)).
    wholes
        Shape (c, len(Whole)).
    matched
        Shape (c, n): which objects have a partner.
    """

    lines: FloatArray
    wholes: FloatArray
    matched: BoolArray

    def at(self, which: IntArray | slice) -> Measured:
        """Return what speaks for some of the maps."""
        return Measured(self.lines[which], self.wholes[which], self.matched[which])


_FEWEST_AROUND = 3
_BENDS = 6
_PAGE = 0.12
_FARTHEST = 1e4
_LEAST_ALONE = 0.2
"""What is left at least of a line's own share in where it lies."""


class Relations(NamedTuple):
    """What speaks for pairs of objects, and for each.

    Attributes
    ----------
    similarity
        Shape (Q, Q'/2) of template and argument: σ.
    selves
        Shape (n, m, bins): how alike the own histograms of a sketched and a mapped object are for
        turns from sketch to map over half of the full turn.
    forms
        Shape (n, m): how far the forms of a sketched and a mapped object are apart, squared.
    names
        int64, shape (n, m): 1 where labels mean the same, −1 where they do not, 0 without one.
    swapped
        Whether the template is the map.
    """

    similarity: FloatArray
    selves: FloatArray
    forms: FloatArray
    names: IntArray
    swapped: bool


@kernel
def measure(
    maps: IntArray,
    drawn: Things,
    mapped: Things,
    relations: Relations,
    tolerances: Tolerances,
    lines: FloatArray,
    wholes: FloatArray,
) -> None:
    """Measure what speaks for maps.

    Parameters
    ----------
    maps
        int64, shape (c, n): the mapped object of each sketched one, −1 for none.
    drawn, mapped, relations
        What is known of objects and of pairs.
    tolerances
        How far sketches leave the truth.
    lines, wholes
        As of :class:`Measured`, all 0, written.
    """
    n, m = drawn.places.size, mapped.places.size
    used, room = np.empty(m, dtype=np.bool_), _rooms(mapped)
    for x in range(maps.shape[0]):
        partners, row = maps[x], wholes[x]
        u, t, growth, count = fit_map(partners, drawn, mapped, tolerances)
        row[Whole.MATCHED] = count
        row[Whole.SCORE] = -tolerances.omission * (n - count)
        if count < 2:
            row[Whole.SCORE] = -tolerances.omission * n
            continue
        for j in range(m):
            used[j] = False
        for i in range(n):
            j = partners[i]
            if j >= 0:
                used[j] = True
                row[Whole.SCORE] += pair_score(u, t, growth, drawn, i, mapped, j, tolerances)
        row[Whole.OFFSET] = min((growth - 2.0 * np.log(abs(u))) ** 2, 6.0)
        row[Whole.BEND] = _bend(partners, drawn, mapped, u, t, count, lines[x])
        _surround(partners, used, drawn, mapped, u, row)
        _compare(partners, drawn, mapped, u, t, growth, lines[x])
        _stand_alone(partners, drawn, count, lines[x])
        for i in range(n):
            if partners[i] >= 0:
                lines[x, i, Line.ROOM] = room[partners[i]] / (square(u) * drawn.spacing**2)
        if relations.selves.size > 0:
            _relate(partners, n, m, relations, u, lines[x], row)


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
def _compare(
    partners: IntArray,
    drawn: Things,
    mapped: Things,
    u: complex,
    t: complex,
    growth: float,
    lines: FloatArray,
) -> None:
    """Measure the lines under a pose, and the ways between them, which need none but the turn."""
    unit, twist = abs(u) * drawn.spacing, u * u / square(u)
    for i in range(partners.size):
        j = partners[i]
        if j < 0:
            continue
        line = lines[i]
        line[Line.PLACE] = square(mapped.places[j] - u * drawn.places[i] - t) / (unit * unit)
        line[Line.SIZE] = mapped.sizes[j] - drawn.sizes[i] - growth
        line[Line.SHAPE] = square(drawn.shapes[i] * twist - mapped.shapes[j])
        line[Line.ROUND] = abs(mapped.shapes[j])
        total, count, near, next_near, first, second = 0.0, 0, np.inf, np.inf, 0.0, 0.0
        for k in range(partners.size):
            if k == i or partners[k] < 0:
                continue
            way = drawn.places[k] - drawn.places[i]
            other = (mapped.places[partners[k]] - mapped.places[j]) / u
            length = max(square(way), 1e-12 * drawn.spacing**2)
            deviation = min(square(other - way) / length, _FARTHEST)
            total += deviation
            count += 1
            if length < near:
                near, next_near, first, second = length, near, deviation, first
            elif length < next_near:
                next_near, second = length, deviation
        line[Line.WAY] = total / count
        line[Line.NEAR] = 0.5 * (first + second) if count > 1 else first


@kernel
def _stand_alone(partners: IntArray, drawn: Things, count: int, lines: FloatArray) -> None:
    """Measure how far lines deviate under the pose of all others, as least squares have it."""
    middle, extent = 0.0j, 0.0
    for i in range(partners.size):
        if partners[i] >= 0:
            middle += drawn.places[i] / count
    for i in range(partners.size):
        if partners[i] >= 0:
            extent += square(drawn.places[i] - middle)
    for i in range(partners.size):
        if partners[i] >= 0:
            own = 1.0 / count
            if extent > 0.0:
                own += square(drawn.places[i] - middle) / extent
            lines[i, Line.ALONE] = lines[i, Line.PLACE] / max(1.0 - own, _LEAST_ALONE) ** 2


@kernel
def _rooms(mapped: Things) -> FloatArray:
    """Return how far each mapped object is from the nearest other one, squared."""
    room = np.full(mapped.places.size, np.inf)
    for i in range(room.size):
        for j in range(i):
            apart = square(mapped.places[i] - mapped.places[j])
            room[i], room[j] = min(room[i], apart), min(room[j], apart)
    return room


@kernel
def _bin_of(u: complex, bins: int) -> tuple[int, int, float]:
    """Return the bins between which the turn of a pose lies, and how far between."""
    turn = np.arctan2(u.imag, u.real) % np.pi * bins / np.pi
    whole = int(turn)
    rest = turn - whole
    whole %= bins
    return whole, whole + 1 if whole + 1 < bins else 0, rest


@kernel
def _bend(
    partners: IntArray,
    drawn: Things,
    mapped: Things,
    u: complex,
    t: complex,
    count: int,
    lines: FloatArray,
) -> float:
    """Return how far the page is stretched and grows to one side, squared; write what is left.

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
        return 0.0
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
    _straighten(partners, drawn, mapped, u, t, middle, extent, found, lines)
    bent = 0.0
    for p in range(2, _BENDS):
        bent += found[p] ** 2
    return float(min(bent / (_PAGE * ratio) ** 2, 9.0))


@kernel
def _straighten(
    partners: IntArray,
    drawn: Things,
    mapped: Things,
    u: complex,
    t: complex,
    middle: complex,
    extent: float,
    found: FloatArray,
    lines: FloatArray,
) -> None:
    """Write what a bend leaves of how far each line deviates."""
    effects = np.zeros((2, _BENDS))
    for i in range(partners.size):
        if partners[i] >= 0:
            left = (mapped.places[partners[i]] - u * drawn.places[i] - t) / (u * drawn.spacing)
            _write_effects((drawn.places[i] - middle) / extent, effects)
            x, y = left.real, left.imag
            for p in range(_BENDS):
                x -= effects[0, p] * found[p]
                y -= effects[1, p] * found[p]
            lines[i, Line.BENT] = min(x * x + y * y, _FARTHEST)


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
    """Write what each unknown of a bend does to x and to y of a place; the rest is 0 already."""
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
    low, high = complex(np.inf, np.inf), complex(-np.inf, -np.inf)
    for i in range(partners.size):
        if partners[i] >= 0:
            place = mapped.places[partners[i]]
            low = complex(min(low.real, place.real), min(low.imag, place.imag))
            high = complex(max(high.real, place.real), max(high.imag, place.imag))
    for j in range(used.size):
        # What is beside all of them is not amid them.
        beyond = _beyond(mapped.places[j], low, high)
        if used[j] or square(beyond) >= near:
            continue
        count, close = 0, 0
        for i in range(partners.size):
            if partners[i] >= 0:
                way = mapped.places[partners[i]] - mapped.places[j]
                close += square(way) < near
                if beyond == 0.0:
                    angles[count] = np.arctan2(way.imag, way.real)
                count += 1
        row[Whole.CROWD] += close >= _FEWEST_AROUND
        if count < _FEWEST_AROUND or beyond != 0.0:
            continue
        around = angles[:count]
        sort_values(around)
        gap = around[0] + 2.0 * np.pi - around[count - 1]
        for i in range(1, count):
            gap = max(gap, around[i] - around[i - 1])
        row[Whole.MISSING] += min(1.0, max(0.0, (np.pi - gap) / (0.25 * np.pi)))


@kernel
def _beyond(place: complex, low: complex, high: complex) -> complex:
    """Return how far a place is from a box along either axis."""
    return complex(
        max(low.real - place.real, place.real - high.real, 0.0),
        max(low.imag - place.imag, place.imag - high.imag, 0.0),
    )


@kernel
def _relate(
    partners: IntArray,
    n: int,
    m: int,
    relations: Relations,
    u: complex,
    lines: FloatArray,
    row: FloatArray,
) -> None:
    """Measure what relations, single objects and labels tell of each line."""
    whole, after, rest = _bin_of(u, relations.selves.shape[2])
    for a in range(n):
        c = partners[a]
        if c < 0:
            continue
        selves = relations.selves[a, c]
        alike = (1.0 - rest) * selves[whole] + rest * selves[after]
        lines[a, Line.SELF] = max(0.0, 1.0 - alike)
        lines[a, Line.FORM] = relations.forms[a, c]
        if relations.names[a, c] > 0:
            row[Whole.ALIKE] += 1.0
        elif relations.names[a, c] < 0:
            row[Whole.UNLIKE] += 1.0
        total, count = 0.0, 0
        for b in range(n):
            d = partners[b]
            if b == a or d < 0:
                continue
            i, j = pair_index(min(a, b), max(a, b), n), pair_index(min(c, d), max(c, d), m)
            if relations.swapped:
                i, j = j, i
            total += 1.0 - relations.similarity[i, j]
            count += 1
        lines[a, Line.RELATION] = total / count


def measured(
    maps: IntArray, drawn: Things, mapped: Things, relations: Relations | None = None
) -> Measured:
    """Return what speaks for maps; without relations nothing of these."""
    lines, wholes = np.zeros((*maps.shape, len(Line))), np.zeros((len(maps), len(Whole)))
    measure(maps, drawn, mapped, relations or _UNRELATED, TOLERANCES, lines, wholes)
    return Measured(lines, wholes, maps >= 0)


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
        sealed(self_similarities(*scenes)),
        sealed(form_distances(*scenes)),
        sealed(alike),
        swapped,
    )


_UNRELATED = Relations(
    frozen(np.zeros((0, 0))),
    frozen(np.zeros((0, 0, 0))),
    frozen(np.zeros((0, 0))),
    frozen(np.zeros((0, 0), dtype=np.int64)),
    False,
)
