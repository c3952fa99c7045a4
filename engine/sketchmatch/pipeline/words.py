"""Relations in words: from a histogram of forces to "to the left of and below"."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.kernels.directions import HalfTurns, effective_forces
from sketchmatch.model import FloatArray, IntArray, Scene, SceneDescriptor, object_pairs
from sketchmatch.model.arrays import real_floats, sealed
from sketchmatch.pipeline.result import ObjectRelation

__all__ = [
    "NO_DIRECTION",
    "PHRASES",
    "DirectionalRelation",
    "directional_degrees",
    "directional_relation",
    "directional_relations",
    "nearest_relations",
]

PHRASES = (
    "to the right of",
    "to the right of and above",
    "above",
    "to the left of and above",
    "to the left of",
    "to the left of and below",
    "below",
    "to the right of and below",
)
"""What completes "a is … b" for each eighth of a turn, from +x counter-clockwise."""

NO_DIRECTION = "in no clear direction from"
"""What completes "a is … b" where no direction suits, as when one surrounds the other."""

_LEAST_DEGREE = 0.3
_EIGHTH = math.pi / 4.0
_TURNS = _EIGHTH * np.arange(8.0)
# The four plain directions win a tie against the four between them, and then the first does.
_PLAIN_FIRST = np.array([0, 2, 4, 6, 1, 3, 5, 7])
# Degrees this close are a tie: what differs is rounding.
_DECIMALS = 9
_ROWS = 256
# Of so many objects all distances are measured sooner than a tree is asked.
_FEW = 24


@dataclass(frozen=True)
class DirectionalRelation:
    """How one object lies to another, in words.

    Attributes
    ----------
    phrase
        Completes "a is … b": one of :data:`PHRASES`, or :data:`NO_DIRECTION`.
    degree
        How well the best of the eight directions describes it, within [0, 1]; below 0.3 there is
        no clear direction.
    direction
        That direction in radians counter-clockwise from +x, a multiple of π/4 within (−π, π];
        None where there is no clear one.
    """

    phrase: str
    degree: float
    direction: float | None


def directional_relation(histogram: Any) -> DirectionalRelation:
    """Put the relation that a histogram of forces describes into words.

    Each direction α has a degree: forces that point more than 90° away from α contradict it, and
    on either side of α they are compensated by as many forces of the same side, taken from 90°
    inwards. What is left is effective. The degree is the share of the effective forces, times
    1 − 2|φ|/π for their mean deviation φ from α. The relation is the best of eight directions.

    A histogram counts as constant within each bin, which is 2π/n wide and has its direction in
    the middle. So the degree changes continuously with α and with the histogram, and of a bin
    that lies across α, α ± 90° or α + 180° each half counts where it lies.

    Parameters
    ----------
    histogram
        Shape (n,), n even and at least 4, not negative: entry k supports "a is in direction
        2πk/n of b", as :func:`sketchmatch.force_histogram` returns it.

    Returns
    -------
    DirectionalRelation
        Of a on b. A histogram that is zero everywhere has no clear direction, with degree 0; of
        directions that suit equally well it is a plain one such as "above", or else the first
        counter-clockwise from the right.

    Raises
    ------
    InvalidInputError
        If it is no such histogram.

    References
    ----------
    P. Matsakis, J. M. Keller, L. Wendling, J. Marjamaa, O. Sjahputera, "Linguistic description of
    relative positions in images", IEEE Trans. SMC-B 31(4), 2001.

    Examples
    --------
    >>> from sketchmatch import force_histogram
    >>> desk, plant = [[0, 0], [2, 0], [2, 1], [0, 1]], [[5, 4], [6, 4], [6, 5], [5, 5]]
    >>> relation = directional_relation(force_histogram(desk, plant))
    >>> f"the desk is {relation.phrase} the plant, {relation.degree:.2f}"
    'the desk is to the left of and below the plant, 0.97'
    """
    try:
        row = real_floats(histogram)
    except (TypeError, ValueError):
        problem = f"is {quoted(histogram)}; give a list of real numbers, one for each direction"
        raise InvalidInputError(Reason.INVALID_PARAMETER, "histogram", problem) from None
    if row.ndim != 1 or len(row) < 4 or len(row) % 2:
        raise InvalidInputError(
            Reason.INVALID_PARAMETER,
            "histogram",
            f"has shape {row.shape}; give one number for each of an even count of directions, "
            "4 or more",
        )
    if not (np.isfinite(row).all() and (row >= 0.0).all()):
        raise InvalidInputError(
            Reason.INVALID_PARAMETER,
            "histogram",
            "has values that are negative or not finite; give forces",
        )
    (relation,) = directional_relations(row[None])
    return relation


def directional_relations(histograms: FloatArray) -> tuple[DirectionalRelation, ...]:
    """Put each row of an array of histograms, shape (m, n), into words.

    As :func:`directional_relation`; what is negative counts as 0.
    """
    return tuple(
        relation
        for first in range(0, len(histograms), _ROWS)
        for relation in _relations(directional_degrees(histograms[first : first + _ROWS], _TURNS))
    )


def nearest_relations(
    scene: Scene, descriptor: SceneDescriptor, objects: Sequence[int]
) -> dict[int, ObjectRelation]:
    """Say of some objects of a scene how each lies to the nearest other of them.

    Parameters
    ----------
    scene, descriptor
        The scene and the histograms of its pairs.
    objects
        Indices, from 0, each once.

    Returns
    -------
    dict
        By index. Of others that are equally near, the one with the lower index; nothing where
        there are fewer than two objects.
    """
    pairs = _nearest_pairs(scene, sorted(objects))
    if not pairs:
        return {}
    rows = np.array([descriptor.histogram(a, b) for a, b in pairs])
    return {
        a: ObjectRelation(b, relation.phrase, relation.degree)
        for (a, b), relation in zip(pairs, directional_relations(rows), strict=True)
    }


def directional_degrees(histograms: FloatArray, directions: FloatArray) -> FloatArray:
    """Return how well each of some directions describes each of some histograms.

    Parameters
    ----------
    histograms
        Shape (m, n); what is negative counts as 0.
    directions
        Shape (d,), radians counter-clockwise.

    Returns
    -------
    ndarray
        Shape (m, d), within [0, 1], as :func:`directional_relation` defines it; 0 for a
        histogram that is zero everywhere.
    """
    rows = np.maximum(histograms, 0.0)
    peaks = rows.max(axis=1, keepdims=True)
    rows = rows / np.where(peaks > 0.0, peaks, 1.0)
    bins = rows.shape[1]
    totals = np.maximum(rows.sum(axis=1), 1.0)
    starts = directions * bins / (2.0 * math.pi)
    left, left_moments = effective_forces(rows, _half_turns(bins, tuple(starts.tolist())), 1)
    right, right_moments = effective_forces(rows, _half_turns(bins, tuple((-starts).tolist())), -1)
    # share · (1 − 2|φ|/π), where φ is the moment over the forces, times 2π/n.
    loss = np.abs(left_moments - right_moments) * 4.0 / bins
    degrees: FloatArray = np.minimum(np.maximum((left + right - loss) / totals[:, None], 0.0), 1.0)
    return degrees


@lru_cache(maxsize=64)
def _half_turns(bins: int, starts: tuple[float, ...]) -> HalfTurns:
    """Return the bins of half a turn counter-clockwise of some directions, given in bins."""
    half, least = bins / 2.0, bins // 2 + 3
    places = np.zeros((len(starts), least), dtype=np.int64)
    low, width = np.full(places.shape, half), np.zeros(places.shape)
    for k, start in enumerate(starts):
        edges = np.arange(bins // 2 + 1) + (0.5 - start) % 1.0
        stops = np.unique([0.0, bins / 4.0, *edges[edges < half], half])
        count = len(stops) - 1
        low[k, :count], width[k, :count] = stops[:-1], np.diff(stops)
        middles = start + low[k, :count] + width[k, :count] / 2.0
        places[k, :count] = np.floor(middles + 0.5).astype(np.int64) % bins
    return HalfTurns(sealed(places), sealed(low), sealed(width), sealed(low < bins / 4.0))


def _relations(degrees: FloatArray) -> Iterator[DirectionalRelation]:
    """Yield the best of the eight directions with each row of degrees."""
    best = _PLAIN_FIRST[degrees[:, _PLAIN_FIRST].round(_DECIMALS).argmax(axis=1)]
    for k, row in zip(best.tolist(), degrees.tolist(), strict=True):
        if row[k] < _LEAST_DEGREE:
            yield DirectionalRelation(NO_DIRECTION, row[k], None)
        else:
            yield DirectionalRelation(PHRASES[k], row[k], _EIGHTH * (k if k <= 4 else k - 8))


def _nearest_pairs(scene: Scene, objects: Sequence[int]) -> list[tuple[int, int]]:
    """Return each of the objects with the nearest other of them."""
    if len(objects) < 2:
        return []
    # np.array would first ask each polygon whether it is a sequence.
    shapes = np.fromiter((scene.objects[k].polygon for k in objects), object, len(objects))
    near = _nearest_of_few(shapes) if len(shapes) <= _FEW else _nearest_by_tree(shapes)
    return [(objects[k], objects[other]) for k, other in enumerate(near.tolist())]


def _nearest_of_few(shapes: NDArray[np.object_]) -> IntArray:
    """Return the nearest other of each of some shapes: all distances are measured."""
    a, b = object_pairs(len(shapes)).T
    distances = np.full((len(shapes), len(shapes)), np.inf)
    distances[a, b] = distances[b, a] = shapely.distance(shapes[a], shapes[b])
    return np.asarray(distances.argmin(axis=1))


def _nearest_by_tree(shapes: NDArray[np.object_]) -> IntArray:
    """Return the nearest other of each of many shapes, as :func:`_nearest_of_few` does."""
    tree = shapely.STRtree(shapes)
    near = np.full(len(shapes), len(shapes))
    touching, touched = tree.query(shapes, predicate="intersects")
    others = touching != touched
    np.minimum.at(near, touching[others], touched[others])
    # Nothing touches these, so nothing is their equal, and "exclusive" leaves out itself alone.
    apart = np.flatnonzero(near == len(shapes))
    distant, nearest = tree.query_nearest(shapes[apart], exclusive=True)
    np.minimum.at(near, apart[distant], nearest)
    return near
