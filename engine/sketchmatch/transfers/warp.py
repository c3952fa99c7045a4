"""The warp that carries points of one scene to another, through objects that both have.

A point w of the target is seen as w(z) = u·z + t + v·z̄ + b(z) + e(z), all as complex numbers: a
turn, a scale and a shift; a stretch and a shear; a thin-plate spline, whose bending is not
free; and what each object was displaced by for itself, which the things around it share. How much
of each there is says the likelihood of the objects' own places, so that few objects lead to a
similarity, more of them to an affine map, and many that agree on a bend to a spline. Objects that
contradict all others count for little.

All of it is one Gaussian process, so every point has a standard deviation with it.

References
----------
.. [1] G. Wahba, "Spline Models for Observational Data", SIAM, 1990, chapters 1 and 2.
.. [2] F. L. Bookstein, "Principal warps: thin-plate splines and the decomposition of
   deformations", IEEE TPAMI 11(6), 1989.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import FloatArray
from sketchmatch.model.arrays import ComplexArray
from sketchmatch.model.caching import cached_property

__all__ = ["DRAWN", "MAPPED", "Warp", "WarpKind", "fit_warp"]

_FEWEST = 2
_FEWEST_AFFINE = 4
_FEWEST_SPLINE = 5
_BENDS = (0.0, *np.logspace(-2.0, 3.0, 11))
_STRETCHES = (0.0, *np.logspace(-1.0, 4.0, 6))
_SHARED = (0.95, 0.6, 0.3, 0.0)
"""Shares of an object's own displacement that go with what is around it; the first by default."""
_REACH = 4.0
"""How far these are, in distances to the nearest object."""
DRAWN, MAPPED = 0.3, 0.04
"""What is expected of objects' own displacements before any is seen, in units of the spread divided
by the root of their number: of things that somebody drew, and of things on maps of one place."""
_DOUBT_COUNTS = 2.0
"""What that counts for, in coordinates."""
_TAIL = 4.0
_ROUNDS = 8
_LEAST_WEIGHT = 1e-3
_MOST_STARTS = 2000
_FAR = 1.0
"""How far around the objects and points a fold counts, in spreads."""
_COARSEST, _FINEST = 48, 192
_PART = 2048
_THINNEST = 0.02
"""The least area that a piece of the plane may be left with, as a share of the average."""
_MIRRORED = 6.0
"""By how much a mirror image's likelihood, as a logarithm, must exceed that of what was given."""


class WarpKind(StrEnum):
    """What a warp may do beside turning, scaling and shifting the whole."""

    SIMILARITY = "similarity"
    AFFINE = "affine"
    SPLINE = "spline"


@dataclass(frozen=True, eq=False)
class _Shape:
    """How much of each part there is, in units of the variance of an object's own displacement.

    Attributes
    ----------
    weights
        Shape (n,), of the objects: the variance of one is divided by it.
    stretch, bend
        Of the affine part and the spline.
    shared
        How much of their own displacement objects share with what is around them, 0 … 1.
    """

    weights: FloatArray
    stretch: float = 0.0
    bend: float = 0.0
    shared: float = 0.0

    @property
    def kind(self) -> WarpKind:
        if self.bend or self.shared:
            return WarpKind.SPLINE
        return WarpKind.AFFINE if self.stretch else WarpKind.SIMILARITY


@dataclass(frozen=True, eq=False)
class _Frame:
    """The objects' places around their mean, the spread of the sources being 1.

    Attributes
    ----------
    places
        Shape (n,), of the sources.
    trend
        Shape (3, n): what of an affine function its values at the objects tell of it.
    bending
        Shape (n, n), of the thin-plate spline.
    reach
        How far an object's own displacement goes.
    expected
        The variance that an object's own displacement is expected to have, along each axis.
    bent, near
        Shape (n, n), covariances of the objects' places: of the spline, and of what they share.
    """

    middle: complex
    spread: float
    places: ComplexArray
    trend: FloatArray
    bending: FloatArray
    reach: float
    expected: float

    @classmethod
    def around(cls, sources: ComplexArray, doubt: float = DRAWN) -> _Frame:
        middle = complex(sources.mean())
        spread = float(np.sqrt(np.mean(np.abs(sources - middle) ** 2)))
        places = (sources - middle) / spread
        apart = np.abs(places[:, None] - places[None, :])
        np.fill_diagonal(apart, np.inf)
        reach = _REACH * float(np.median(apart.min(axis=1)))
        np.fill_diagonal(apart, 0.0)
        # A plane through objects on one line is no plane: the least of all that fit is taken.
        trend = np.asarray(np.linalg.pinv(_planes(places), rcond=1e-6), dtype=np.float64)
        return cls(
            middle, spread, places, trend, _thin_plate(apart), reach, doubt**2 / len(sources)
        )

    def bend(self, points: ComplexArray) -> tuple[FloatArray, FloatArray]:
        """Return covariances (m, n) of the spline at points and objects, and its variances (m,)."""
        shares = _planes(points) @ self.trend
        seen = _thin_plate(np.abs(points[:, None] - self.places[None, :]))
        inner = seen - shares @ self.bending
        toward = _planes(self.places) @ self.trend
        variances = np.einsum("ij,ij->i", shares @ self.bending - 2.0 * seen, shares)
        return inner - inner @ toward.T, variances

    @cached_property
    def bent(self) -> FloatArray:
        return self.bend(self.places)[0]

    @cached_property
    def near(self) -> FloatArray:
        return self.neighbourhood(self.places)

    def neighbourhood(self, points: ComplexArray) -> FloatArray:
        """Return how much points (m,) share of the displacement of the objects, shape (m, n)."""
        near = np.abs(points[:, None] - self.places[None, :]) / self.reach
        return np.clip(1.0 - near, 0.0, None) ** 4 * (4.0 * near + 1.0)  # Wendland


class Warp:
    """A smooth map of the plane without folds; :func:`fit_warp` makes it.

    Attributes
    ----------
    kind
        What it may do.
    weights
        Shape (n,), what each object counts for, 0 … 1: little where it contradicts the others.
    residual
        Root mean square of what the objects that count miss by, along x and y, in units of the
        target.
    """

    def __init__(
        self, shape: _Shape, frame: _Frame, middle: complex, unit: float, goals: ComplexArray
    ) -> None:
        self.kind = shape.kind
        self.weights = shape.weights
        self._shape, self._frame, self._middle, self._unit = shape, frame, middle, unit
        self._inverse, self._solution, variance = _solved(frame, goals, shape)
        self._own = unit * math.sqrt(variance)
        missed = np.abs(self._carried(frame.places) - middle - unit * goals) ** 2 / 2.0
        self.residual = math.sqrt(float(self.weights @ missed) / float(self.weights.sum()))

    @property
    def rotation(self) -> float:
        """By how much it turns the whole, in radians counter-clockwise within (−π, π]."""
        return float(np.angle(self._solution[-2]))

    @property
    def scale(self) -> float:
        """By how much it enlarges the whole."""
        return float(abs(self._solution[-2])) * self._unit / self._frame.spread

    def __call__(self, points: FloatArray) -> FloatArray:
        """Return where points of shape (m, 2) come to."""
        found = self._carried(self._at(points))
        return np.stack([found.real, found.imag], axis=1)

    def deviations(self, points: FloatArray) -> FloatArray:
        """Return the standard deviation of carried points along each axis, shape (m,)."""
        places = self._at(points)
        found = np.empty(len(places))
        for part in _parts(len(places)):
            rows, own = self._rows(places[part])
            known = np.einsum("ij,ij->i", rows @ self._inverse, rows.conj()).real
            found[part] = self._own * np.sqrt(np.clip(own - known, 0.0, None))
        return found

    def folds(self, lattice: ComplexArray) -> bool:
        """Whether some piece of a lattice, in the warp's own frame, comes to lie upside down."""
        places = self._carried(lattice.ravel()).reshape(lattice.shape)
        right, up = np.diff(places, axis=1), np.diff(places, axis=0)
        corners = (
            (right[:-1], up[:, :-1]),
            (right[:-1], up[:, 1:]),
            (right[1:], up[:, :-1]),
            (right[1:], up[:, 1:]),
        )
        areas = np.array([(a.conj() * b).imag for a, b in corners])
        whole = abs(self._solution[-2]) * self._unit
        piece = whole**2 * abs((lattice[0, 1] - lattice[0, 0]) * (lattice[1, 0] - lattice[0, 0]))
        return bool(areas.min() < _THINNEST * piece)

    def _carried(self, places: ComplexArray) -> ComplexArray:
        found = np.empty(len(places), dtype=np.complex128)
        for part in _parts(len(places)):
            found[part] = self._rows(places[part])[0] @ self._solution
        return self._middle + self._unit * found

    def _rows(self, places: ComplexArray) -> tuple[ComplexArray, FloatArray]:
        found, variances = _covariances(places, self._frame, self._shape)
        return np.concatenate([found, _rigid(places)], axis=1), variances

    def _at(self, points: FloatArray) -> ComplexArray:
        return (_complex(points) - self._frame.middle) / self._frame.spread


def _parts(count: int) -> Iterator[slice]:
    """Yield parts of an array that fit into the memory together with all objects."""
    yield from (slice(first, first + _PART) for first in range(0, count, _PART))


def fit_warp(
    sources: FloatArray,
    targets: FloatArray,
    weights: FloatArray | None = None,
    around: FloatArray | None = None,
    doubt: float = DRAWN,
) -> Warp:
    """Fit the warp that carries the objects of one scene to their partners in another.

    Parameters
    ----------
    sources, targets
        Shape (n, 2), the places of the objects and of their partners, two or more.
    weights
        Shape (n,), how likely each is its partner, 0 … 1; all certain when left out.
    around
        Shape (m, 2), points that are to be carried: there the warp must not fold, either.
    doubt
        How far objects are expected to be displaced, each for itself: ``DRAWN``, or ``MAPPED``
        where both sides are maps. The more objects there are, the less it counts.

    Raises
    ------
    InvalidInputError
        If there are too few objects, they lie at one place, the target is the source's mirror
        image, or every warp that fits them folds the plane.

    Examples
    --------
    >>> square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> warp = fit_warp(square, 2.0 * square + 1.0)
    >>> warp(np.array([[0.5, 0.5]])).round(6).tolist(), str(warp.kind)
    ([[2.0, 2.0]], 'similarity')
    """
    given, wanted = _complex(sources), _complex(targets)
    certain = np.ones(len(given)) if weights is None else np.clip(weights, _LEAST_WEIGHT, 1.0)
    _check(given, wanted)
    frame = _Frame.around(given, doubt)
    middle = complex(wanted.mean())
    unit = float(np.sqrt(np.mean(np.abs(wanted - middle) ** 2)))
    goals = (wanted - middle) / unit
    fitted = _fitted(frame, goals, certain * _agreeing(frame, goals, certain), certain)
    # One of its own around the objects, where details are: with far points it would be too coarse.
    lattices = [_lattice(frame.places, frame.reach)]
    if around is not None:
        near = np.concatenate([frame.places, (_complex(around) - frame.middle) / frame.spread])
        lattices.append(_lattice(near, frame.reach))
    for stiffer in _stiffer(fitted):
        warp = Warp(stiffer, frame, middle, unit, goals)
        if not any(map(warp.folds, lattices)):
            return warp
    raise InvalidInputError(
        Reason.INVALID_FIELD,
        "",
        "cannot be carried: every warp through the matched objects folds the plane; check which "
        "object is which",
    )


def _check(given: ComplexArray, wanted: ComplexArray) -> None:
    if len(given) < _FEWEST:
        count = "one object" if len(given) else "no object"
        raise InvalidInputError(
            Reason.TOO_FEW_OBJECTS,
            "",
            f"has {count} with a partner; carrying needs at least two",
        )
    for places in (given, wanted):
        if not np.isfinite(places).all():
            raise InvalidInputError(
                Reason.INVALID_FIELD,
                "",
                "has an object at no finite place; give plain numbers",
            )
        if np.abs(places - places[0]).max() <= 1e-12 * np.abs(places).max():
            raise InvalidInputError(
                Reason.INVALID_FIELD, "", "has all its objects at one place; a warp needs two"
            )


def _agreeing(frame: _Frame, goals: ComplexArray, certain: FloatArray) -> FloatArray:
    """Return how far each object agrees with the pose that most of them agree on."""
    score, misses = _consensus(frame.places, goals, certain, frame.expected)
    mirrored, _ = _consensus(frame.places.conj(), goals, certain, frame.expected)
    if mirrored - score > _MIRRORED:
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            "",
            "cannot be carried: the matched objects of one side are a mirror image of the other's; "
            "check which way y grows, and which object is which",
        )
    return _trust(misses)


def _consensus(
    given: ComplexArray, wanted: ComplexArray, certain: FloatArray, expected: float
) -> tuple[float, FloatArray]:
    """Return the logarithmic likelihood of the best pose through two objects, and its misses."""
    first, second = np.triu_indices(len(given), 1)
    if len(first) > _MOST_STARTS:
        chosen = np.random.default_rng(0).choice(len(first), _MOST_STARTS, replace=False)
        first, second = first[chosen], second[chosen]
    apart = np.abs(given[second] - given[first]) > 1e-9
    first, second = first[apart], second[apart]
    turns = (wanted[second] - wanted[first]) / (given[second] - given[first])
    shifts = wanted[first] - turns * given[first]
    misses = np.abs(turns[:, None] * given + shifts[:, None] - wanted) ** 2
    misses /= 2.0 * expected
    scores = -0.5 * (_TAIL + 2.0) * np.log1p(misses / _TAIL) @ certain
    best = int(np.argmax(scores))
    return float(scores[best]), misses[best]


def _trust(misses: FloatArray) -> FloatArray:
    """Return weights for squared misses, in variances: those of Student's t."""
    trusted: FloatArray = np.clip((_TAIL + 2.0) / (_TAIL + misses), _LEAST_WEIGHT, 1.0)
    return trusted


def _fitted(frame: _Frame, goals: ComplexArray, weights: FloatArray, certain: FloatArray) -> _Shape:
    """Return the likeliest shape of warp, and what each object counts for in it."""
    shape = _likeliest(frame, goals, weights)
    if len(goals) > _FEWEST + 1:
        for _ in range(_ROUNDS):
            shape = replace(shape, weights=certain * _trust(_misses(frame, goals, shape)))
        shape = _likeliest(frame, goals, shape.weights)
    return shape


def _likeliest(frame: _Frame, goals: ComplexArray, weights: FloatArray) -> _Shape:
    """Return the shape of warp for which the objects' places are likeliest, as REML has it."""
    count = len(goals)
    stretches = _STRETCHES if count >= _FEWEST_AFFINE else (0.0,)
    bends = _BENDS if count >= _FEWEST_SPLINE else (0.0,)
    shape = _Shape(weights, shared=_SHARED[0] if count >= _FEWEST_SPLINE else 0.0)
    for name, values in (("stretch", stretches), ("bend", bends)):
        tried = [replace(shape, **{name: value}) for value in values]
        shape = max(tried, key=lambda each: _likelihood(frame, goals, each))
    return shape


def _likelihood(frame: _Frame, goals: ComplexArray, shape: _Shape) -> float:
    count = len(goals)
    factor = np.linalg.cholesky(_covariance(frame, shape))
    rigid = np.linalg.solve(factor, _rigid(frame.places))
    seen = np.linalg.solve(factor, goals)
    basis, upper = np.linalg.qr(rigid)
    left = seen - basis @ (basis.conj().T @ seen)
    squares = float(np.vdot(left, left).real) + _DOUBT_COUNTS * frame.expected
    freedom = 2.0 * (count - 2) + _DOUBT_COUNTS
    spent = np.log(np.abs(np.diag(factor))).sum() + np.log(np.abs(np.diag(upper))).sum()
    return -0.5 * freedom * math.log(squares) - 2.0 * float(spent)


def _misses(frame: _Frame, goals: ComplexArray, shape: _Shape) -> FloatArray:
    """Return the squared misses of each object by the warp of all others, in variances."""
    inverse, solution, variance = _solved(frame, goals, shape)
    alone = np.diag(inverse).real[: len(goals)]
    left = np.abs(solution[: len(goals)] / alone) ** 2
    expected: FloatArray = 1.0 / alone - 1.0 / shape.weights + 1.0
    return left / (variance * expected)


def _solved(
    frame: _Frame, goals: ComplexArray, shape: _Shape
) -> tuple[ComplexArray, ComplexArray, float]:
    """Return the inverse of the kriging matrix, its solution, and the variance of an object."""
    count = len(goals)
    matrix = np.zeros((count + 2, count + 2), dtype=np.complex128)
    matrix[:count, :count] = _covariance(frame, shape)
    matrix[:count, count:] = _rigid(frame.places)
    matrix[count:, :count] = matrix[:count, count:].conj().T
    inverse = np.asarray(np.linalg.inv(matrix), dtype=np.complex128)
    solution = inverse[:, :count] @ goals
    squares = max(0.0, float(np.vdot(goals, solution[:count]).real))
    doubted = _DOUBT_COUNTS * frame.expected
    return inverse, solution, (squares + doubted) / (2.0 * (count - 2) + _DOUBT_COUNTS)


def _covariance(frame: _Frame, shape: _Shape) -> ComplexArray:
    """Return the covariance of the objects' places but for turn, scale and shift, shape (n, n)."""
    stretched = shape.stretch * np.outer(frame.places.conj(), frame.places)
    together = shape.bend * frame.bent + shape.shared * frame.near
    found: ComplexArray = stretched + together + np.diag(1.0 / shape.weights - shape.shared)
    return found


def _covariances(
    points: ComplexArray, frame: _Frame, shape: _Shape
) -> tuple[ComplexArray, FloatArray]:
    """Return covariances of points with the objects, (m, n), and variances of the points, (m,)."""
    found = shape.stretch * np.outer(points.conj(), frame.places)
    variances = 1.0 + shape.stretch * np.abs(points) ** 2
    if shape.bend:
        bent, own = frame.bend(points)
        found, variances = found + shape.bend * bent, variances + shape.bend * own
    if shape.shared:
        found = found + shape.shared * frame.neighbourhood(points)
    return found, variances


def _rigid(points: ComplexArray) -> ComplexArray:
    return np.stack([points, np.ones_like(points)], axis=1)


def _planes(points: ComplexArray) -> FloatArray:
    return np.stack([np.ones(len(points)), points.real, points.imag], axis=1)


def _thin_plate(distances: FloatArray) -> FloatArray:
    safe = np.maximum(distances, 1e-300)
    bent: FloatArray = distances**2 * np.log(safe)
    return bent


def _stiffer(shape: _Shape) -> Iterator[_Shape]:
    """Yield a shape of warp and ever stiffer ones, to one that cannot fold."""
    yield shape
    for shared in _SHARED[1:] if shape.shared else ():
        yield replace(shape, shared=shared)
    softest = replace(shape, shared=_SHARED[-1])
    for bend in reversed([bend for bend in _BENDS if bend < softest.bend]):
        yield replace(softest, bend=bend)
    for stretch in reversed([stretch for stretch in _STRETCHES if stretch < softest.stretch]):
        yield replace(softest, bend=0.0, stretch=stretch)


def _lattice(points: ComplexArray, step: float) -> ComplexArray:
    """Return a lattice around points, as fine as the warp's details as far as that is bearable."""
    low = complex(points.real.min() - _FAR, points.imag.min() - _FAR)
    high = complex(points.real.max() + _FAR, points.imag.max() + _FAR)
    sides = [
        np.linspace(a, b, int(np.clip((b - a) / (step / 16.0), _COARSEST, _FINEST)))
        for a, b in ((low.real, high.real), (low.imag, high.imag))
    ]
    return sides[0][None, :] + 1j * sides[1][:, None]


def _complex(points: FloatArray) -> ComplexArray:
    rows = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    return rows[:, 0] + 1j * rows[:, 1]
