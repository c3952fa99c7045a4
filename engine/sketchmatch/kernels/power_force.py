"""Exact histograms of the forces d^−r, for any real r, of polygons.

With E_p(x) = (x^p − 1) / p, which is ln x for p = 0, and x a distance in a unit about as large as
the distances at hand, an antiderivative Ψ'' = φ and one more, Θ' = Ψ, are

    Ψ = x^(2−r) / ((1−r)(2−r))     Θ = x^(3−r) / ((1−r)(2−r)(3−r))            for r ≤ 0.9
    Ψ = x E_{1−r}(x) / (2−r)       Θ = x² (E_{1−r}(x) − ½) / ((2−r)(3−r))     for r < 1.5
    Ψ = E_{2−r}(x) / (1−r)         Θ = x (E_{2−r}(x) − 1) / ((1−r)(3−r))      for 1.5 ≤ r < 2.5
    Ψ = E_{2−r}(x) / (1−r)         Θ = (E_{3−r}(x) − x) / ((1−r)(2−r))        for r ≥ 2.5

The others differ from the plain powers by terms that cancel in the sum over the edges: the linear
ones for objects that do not overlap, the constant ones for objects that touch at most at points.
Unlike the powers they keep their digits near 1, 2 and 3.

The mean of Ψ over the distances between two edges is (Θ(x₁) − Θ(x₀)) / (x₁ − x₀), or where x₀ and
x₁ are alike its Taylor series about the middle. Where two objects are small for their distance the
sum over edges would lose digits to cancellation; there φ itself is expanded about the distance of
their middles, and the powers of its expansion are integrated over the sections.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sketchmatch.kernels._jit import kernel
from sketchmatch.kernels.projection import U_HIGH, U_LOW, Projection, Scratch
from sketchmatch.kernels.sweep import pair_sweep, sum_over_edges, sweep_pairs
from sketchmatch.model.arrays import BoolArray, FloatArray, IntArray

__all__ = [
    "APART",
    "MEETING",
    "OVERLAPPING",
    "PLAIN",
    "TOUCHING",
    "power_force_histograms",
]

OVERLAPPING = 0
"""Two objects overlap, or nobody knows."""
TOUCHING = 1
"""Two objects touch along a line."""
MEETING = 2
"""Two objects meet at points alone."""
APART = 3
"""Two objects lie apart."""
PLAIN = 0.9
"""Up to this r the plain powers keep their digits, however objects lie to each other."""

# Half of the sum of two extents over the distance of the middles, below which φ is expanded, and
# the degree of the expansion: it errs by less than 1e-12 for |r| ≤ 10.
_SMALL = 1.0 / 64.0
_DEGREE = 8
# Distances between objects that touch, over their extent, below which they are rounding: any trace
# of a distance counts where Ψ rises as steeply as it does at 0 for r near 2.
_TRACE = 1e-13
# Half of the difference of two distances over their mean, below which Ψ is, and its terms.
_ALIKE = 0.1
_TERMS = 8
# Gauss–Legendre on [0, 1]; six points integrate polynomials up to the eleventh degree.
_NODES = tuple(float(x) for x in 0.5 + 0.5 * np.polynomial.legendre.leggauss(6)[0])
_NODE_WEIGHTS = tuple(float(x) for x in 0.5 * np.polynomial.legendre.leggauss(6)[1])


class PowerLaw(NamedTuple):
    """The force d^−r, prepared.

    Attributes
    ----------
    exponent
        r.
    relations
        Shape (p,): how the objects of each pair lie to each other.
    means
        Shape (_TERMS,): coefficients of the Taylor series of the mean of Ψ.
    moments
        Shape (_DEGREE + 1, _DEGREE + 1): coefficient of y^(i+1) z^(j+1) in the integral of φ over
        sections that reach to y and −z from the middle.
    """

    exponent: float
    relations: IntArray
    means: FloatArray
    moments: FloatArray


class _Line(NamedTuple):
    """A power law for one pair of objects and one direction.

    Attributes
    ----------
    form
        0 for the plain powers, else the number of the pair of formulas.
    ahead
        1 where A lies beyond B, −1 where B lies beyond A, 0 where neither is known.
    trace
        The distance, in units, that counts as none.
    unit
        What distances are divided by.
    """

    exponent: float
    form: int
    ahead: int
    trace: float
    unit: float
    means: FloatArray


def power_law(exponent: float, relations: IntArray) -> PowerLaw:
    """Prepare the force d^−exponent for pairs that lie to each other as ``relations`` says."""
    means = np.empty(_TERMS)
    term = 1.0 / 6.0
    for k in range(_TERMS):
        means[k] = term
        rise = exponent + 2.0 * k
        term *= rise * (rise + 1.0) / ((2.0 * k + 4.0) * (2.0 * k + 5.0))
    moments = np.zeros((_DEGREE + 1, _DEGREE + 1))
    power = 1.0
    for total in range(_DEGREE + 1):
        # power is the binomial coefficient of −r over total; ways, that of total over i.
        ways = 1.0
        for i in range(total + 1):
            j = total - i
            sign = -1.0 if j % 2 else 1.0
            moments[i, j] = sign * power * ways / ((i + 1.0) * (j + 1.0))
            ways *= (total - i) / (i + 1.0)
        power *= (-exponent - total) / (total + 1.0)
    return PowerLaw(exponent, relations, means, moments)


@kernel
def excess(power: float, logarithm: float) -> float:
    """Return (x^p − 1) / p, which is ln x for p = 0, given ln x."""
    return logarithm if power == 0.0 else math.expm1(power * logarithm) / power


@kernel
def _integral(x: float, form: int, r: float) -> float:
    """Return Θ(x) for x ≥ 0."""
    if x <= 0.0:
        return 0.0
    logarithm = math.log(x)
    if form == 0:
        return math.exp((3.0 - r) * logarithm) / ((1.0 - r) * (2.0 - r) * (3.0 - r))
    if form == 1:
        return x * x * (excess(1.0 - r, logarithm) - 0.5) / ((2.0 - r) * (3.0 - r))
    if form == 2:
        return x * (excess(2.0 - r, logarithm) - 1.0) / ((1.0 - r) * (3.0 - r))
    return (excess(3.0 - r, logarithm) - x) / ((1.0 - r) * (2.0 - r))


@kernel
def mean_potential(x0: float, x1: float, form: int, r: float, means: FloatArray) -> float:
    """Return the mean of Ψ(x) for x from x0 to x1, both at least 0."""
    middle = 0.5 * (x0 + x1)
    if middle <= 0.0:
        return 0.0
    alike = 0.5 * (x1 - x0) / middle
    if abs(alike) >= _ALIKE:
        return (_integral(x1, form, r) - _integral(x0, form, r)) / (x1 - x0)
    logarithm = math.log(middle)
    if form == 0:
        power = math.exp((2.0 - r) * logarithm)
        value = power / ((1.0 - r) * (2.0 - r))
    elif form == 1:
        share = excess(1.0 - r, logarithm)
        power = middle * (1.0 + (1.0 - r) * share)
        value = middle * share / (2.0 - r)
    else:
        share = excess(2.0 - r, logarithm)
        power = 1.0 + (2.0 - r) * share
        value = share / (1.0 - r)
    square = alike * alike
    series = 0.0
    for k in range(_TERMS - 1, -1, -1):
        series = means[k] + square * series
    return value + power * square * series


@kernel
def _positive_mean(x0: float, x1: float, line: _Line) -> float:
    """Return the mean of Ψ(x) where x > 0 and 0 elsewhere, for x from x0 to x1."""
    if x0 >= 0.0 and x1 >= 0.0:
        return mean_potential(x0, x1, line.form, line.exponent, line.means)
    if x0 <= 0.0 and x1 <= 0.0:
        return 0.0
    return _integral(max(x0, x1), line.form, line.exponent) / abs(x1 - x0)


@kernel
def _edge_force(a0: float, a1: float, b0: float, b1: float, line: _Line) -> tuple[float, float]:
    x0, x1 = (a0 - b0) / line.unit, (a1 - b1) / line.unit
    x0, x1 = 0.0 if abs(x0) < line.trace else x0, 0.0 if abs(x1) < line.trace else x1
    if line.ahead == 0:
        return _positive_mean(x0, x1, line), _positive_mean(-x0, -x1, line)
    if line.ahead < 0:
        x0, x1 = -x0, -x1
    # Objects that touch may come out behind each other by a rounding.
    mean = mean_potential(max(x0, 0.0), max(x1, 0.0), line.form, line.exponent, line.means)
    return (mean, 0.0) if line.ahead > 0 else (0.0, mean)


_sum_over_edges = sum_over_edges(_edge_force)


@kernel
def _moment_force(
    a0: float, a1: float, b0: float, b1: float, far: tuple[float, float, float, FloatArray]
) -> tuple[float, float]:
    """Return what two edges add to the expansion of φ about the distance of the middles."""
    middle_a, middle_b, distance, moments = far
    total = 0.0
    for k in range(6):
        node = _NODES[k]
        y = (a0 + node * (a1 - a0) - middle_a) / distance
        z = (b0 + node * (b1 - b0) - middle_b) / distance
        outer = 0.0
        for i in range(_DEGREE, -1, -1):
            inner = 0.0
            for j in range(_DEGREE - i, -1, -1):
                inner = moments[i, j] + z * inner
            outer = inner + y * outer
        total -= _NODE_WEIGHTS[k] * y * z * outer
    return total, 0.0


_sum_of_moments = sum_over_edges(_moment_force)


@kernel
def pair_power_force(
    projection: Projection, a: int, b: int, p: int, order: int, law: PowerLaw
) -> tuple[float, float]:
    """Return F^AB of pair p = (a, b) for a direction and for its opposite."""
    r, relation = law.exponent, law.relations[p]
    spans = projection.spans
    low, high = min(spans[a, U_LOW], spans[b, U_LOW]), max(spans[a, U_HIGH], spans[b, U_HIGH])
    middle_a = 0.5 * (spans[a, U_LOW] + spans[a, U_HIGH])
    middle_b = 0.5 * (spans[b, U_LOW] + spans[b, U_HIGH])
    extents = 0.5 * (spans[a, U_HIGH] - spans[a, U_LOW] + spans[b, U_HIGH] - spans[b, U_LOW])
    distance = order * (middle_a - middle_b)
    if extents < _SMALL * distance:
        far = (middle_a, middle_b, middle_a - middle_b, law.moments)
        force, _ = _sum_of_moments(projection, a, b, far)
        force *= distance ** (2.0 - r)
        return (force, 0.0) if order > 0 else (0.0, force)
    if r <= PLAIN:
        form = 0
    elif r < 1.5:
        form = 0 if relation == OVERLAPPING else 1
    elif relation >= MEETING:
        form = 2 if r < 2.5 else 3
    else:
        form = 0
    unit = high - low
    trace = _TRACE if TOUCHING <= relation <= MEETING else 0.0
    line = _Line(r, form, order, trace, unit, law.means)
    forward, backward = _sum_over_edges(projection, a, b, line)
    scale = unit ** (2.0 - r)
    return scale * forward, scale * backward


_compute = pair_sweep(pair_power_force, sections=False)


@kernel
def _sweep(
    room: tuple[Projection, Scratch],
    starts: FloatArray,
    ends: FloatArray,
    used: BoolArray,
    pairs: IntArray,
    directions: int,
    law: PowerLaw,
) -> FloatArray:
    return _compute(room, starts, ends, used, pairs, directions, law)


def power_force_histograms(
    starts: FloatArray,
    ends: FloatArray,
    offsets: IntArray,
    pairs: IntArray,
    directions: int,
    exponent: float,
    relations: IntArray,
) -> FloatArray:
    """Return the histograms of the forces d^−exponent of pairs of objects.

    Parameters
    ----------
    starts, ends, offsets, pairs, directions
        As in :func:`~sketchmatch.kernels.constant_force.constant_force_histograms`.
    exponent
        r, any real number.
    relations
        Shape (p,): OVERLAPPING, TOUCHING, MEETING or APART for each pair; nobody asks for r up to
        PLAIN. Forces between objects that overlap are infinite for r ≥ 1, between objects
        that touch for r ≥ 2: the values of such pairs mean nothing.

    Returns
    -------
    ndarray
        Shape (p, n), in units of length to the power 3 − r.

    Examples
    --------
    Two unit squares, 1 apart along x: for r = 2 the force is Ψ(3) − 2Ψ(2) + Ψ(1) = ln 4/3 along
    x, and none meets both along y.

    >>> corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> starts = np.concatenate([corners, corners + [2.0, 0.0]])
    >>> ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in (starts[:4], starts[4:])])
    >>> offsets, pairs, relations = np.array([0, 4, 8]), np.array([[1, 0]]), np.array([APART])
    >>> power_force_histograms(starts, ends, offsets, pairs, 4, 2.0, relations).round(6)
    array([[0.287682, 0.      , 0.      , 0.      ]])
    """
    law = power_law(exponent, relations)
    return sweep_pairs(_sweep, starts, ends, offsets, pairs, directions, law)
