"""Methods of others that lay a sketch over a map, given the centroids and areas of its objects.

Neither is told the scale of the sketch, which object may stand for which, or how many of them have
a partner at all.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from sketchmatch.model import BoolArray, FloatArray, IntArray, Scene
from sketchmatch.testing import spacing

__all__ = ["ALIGNERS", "Aligner", "dense_subgraph"]

_REACH = 0.6
"""Of the map's spacing: how far from its place an object may be drawn (RANSAC's threshold)."""

_ALIKE = 4
_ROUNDS = 200_000
_SURENESS = 0.999

# Of logarithms of lengths: how far apart two estimates of the scale may lie, and by how much they
# do (CLIPPER's ε and σ).
_FURTHEST = 0.7
_SPREAD = 0.35

_ZERO = 1e-9
_STEPS = 200
_ASCENTS = 1000
_SHRINK = 0.25


@dataclass(frozen=True)
class Aligner:
    """One method.

    Attributes
    ----------
    name
        As the table shows it.
    packages
        The modules to import; where one is missing, the method is left out.
    given
        In words, what it is given.
    solve
        Returns the map object of each object of a sketch, −1 for those that it leaves out.
    """

    name: str
    packages: tuple[str, ...]
    given: str
    solve: Callable[[Scene, Scene], IntArray]

    @property
    def installed(self) -> bool:
        """Whether all that it needs is there."""
        return all(importlib.util.find_spec(package) for package in self.packages)


def _ransac(alike: float, sketch: Scene, map_: Scene) -> IntArray:
    """Lay the sketch over the map by RANSAC, and assign what lies near each other.

    Each object is paired with as many mapped ones as ``alike`` says, those nearest in size.
    """
    import cv2
    from scipy.optimize import linear_sum_assignment

    drawn, mapped = _centroids(sketch), _centroids(map_)
    sizes = [np.log([item.area for item in scene.objects]) for scene in (sketch, map_)]
    relative, others = (each - np.median(each) for each in sizes)
    order = np.abs(relative[:, None] - others).argsort(axis=1, kind="stable")
    second = order[:, : int(min(alike, len(mapped)))]
    first = np.repeat(np.arange(len(drawn)), second.shape[1])
    second = second.reshape(-1)
    reach = _REACH * spacing(map_)
    pose, _ = cv2.estimateAffinePartial2D(
        drawn[first],
        mapped[second],
        method=cv2.RANSAC,
        ransacReprojThreshold=reach,
        maxIters=_ROUNDS,
        confidence=_SURENESS,
    )
    partners = np.full(len(drawn), -1)
    if pose is None:
        return partners
    laid = drawn @ pose[:, :2].T + pose[:, 2]
    apart = np.hypot(*(laid[:, None] - mapped).transpose(2, 0, 1))
    rows, columns = linear_sum_assignment(np.minimum(apart, 2.0 * reach))
    near = apart[rows, columns] < 2.0 * reach
    partners[rows[near]] = columns[near]
    return partners


def _consistent_subset(sketch: Scene, map_: Scene) -> IntArray:
    """Choose the pairings whose distances agree best, by sizes, about the scale of the sketch."""
    drawn, mapped = _centroids(sketch), _centroids(map_)
    first, second = np.indices((len(drawn), len(mapped))).reshape(2, -1)
    sizes = [0.5 * np.log([item.area for item in scene.objects]) for scene in (sketch, map_)]
    by_size = sizes[1][second] - sizes[0][first]
    with np.errstate(divide="ignore", invalid="ignore"):
        by_distance = np.log(_apart(mapped, second)) - np.log(_apart(drawn, first))
        off = np.abs(by_distance - 0.5 * (by_size[:, None] + by_size))
        off = np.fmax(off, np.abs(by_size[:, None] - by_size))
        consistent = (first[:, None] != first) & (second[:, None] != second) & (off < _FURTHEST)
        weights = np.where(consistent, np.exp(-0.5 * (off / _SPREAD) ** 2), 0.0)
    partners = np.full(len(drawn), -1)
    for pairing in dense_subgraph(weights, consistent):
        partners[first[pairing]] = second[pairing]
    return partners


def dense_subgraph(weights: FloatArray, consistent: BoolArray) -> IntArray:
    """Return the vertices of a dense subgraph in which all are joined, by CLIPPER.

    Maximises uᵀMu over u ≥ 0, ‖u‖ = 1 with u_p·u_q = 0 where p and q are not joined: by projected
    gradients with a penalty d for these, which grows until none is left. As many vertices are kept
    as the value says, those of the largest u.

    Parameters
    ----------
    weights
        Shape (n, n), symmetric, within 0 … 1, M without its diagonal of ones.
    consistent
        Shape (n, n), symmetric: which vertices are joined.

    References
    ----------
    P. C. Lusk, K. Fathian, J. P. How, "CLIPPER: a graph-theoretic framework for robust data
    association", ICRA 2021, algorithm 1.
    """
    matrix = weights + np.eye(len(weights))
    apart = (~consistent & ~np.eye(len(weights), dtype=bool)).astype(np.float64)
    u = matrix @ np.full(len(weights), 1.0 / np.sqrt(len(weights)))
    u /= np.linalg.norm(u)
    penalty = _penalty(matrix, apart, u)
    for _ in range(_ASCENTS):
        u = _ascended(matrix - penalty * apart, u)
        more = _penalty(matrix, apart, u)
        if not more:
            break
        penalty += more
    count = max(1, round(float(u @ matrix @ u)))
    return np.argsort(-u, kind="stable")[:count]


def _penalty(matrix: FloatArray, apart: FloatArray, u: FloatArray) -> float:
    """Return what outweighs, on average, the gain of vertices that are not joined; 0 for none."""
    overlap = apart @ u
    both = (overlap > _ZERO) & (u > _ZERO)
    return float(np.abs((matrix @ u)[both] / overlap[both]).mean()) if both.any() else 0.0


def _ascended(matrix: FloatArray, u: FloatArray) -> FloatArray:
    """Return where projected gradients lead on the sphere's nonnegative part."""
    gradient = matrix @ u
    value = float(u @ gradient)
    for _ in range(_STEPS):
        step = 1.0
        while True:
            further = np.maximum(u + step * gradient, 0.0)
            further /= max(float(np.linalg.norm(further)), _ZERO)
            ahead = matrix @ further
            if float(further @ ahead) >= value - _ZERO or step < _ZERO:
                break
            step *= _SHRINK
        moved, gained = np.abs(further - u).max(), float(further @ ahead) - value
        u, gradient, value = further, ahead, float(further @ ahead)
        if moved < 1e-8 or abs(gained) < _ZERO:
            break
    return u


def _centroids(scene: Scene) -> FloatArray:
    return np.array([item.centroid for item in scene.objects])


def _apart(points: FloatArray, chosen: IntArray) -> FloatArray:
    """Return how far apart chosen points lie, shape (n, n)."""
    distances: FloatArray = np.hypot(*(points[:, None] - points).transpose(2, 0, 1))
    return distances[np.ix_(chosen, chosen)]


ALIGNERS = (
    Aligner(
        "RANSAC, all pairs",
        ("cv2", "scipy"),
        "OpenCV's estimateAffinePartial2D (200 000 rounds) is given the centroids of all N·N' "
        f"pairings as if each were a correspondence, and {_REACH} of the map's spacing as its "
        "threshold; what its pose lays within twice that is assigned, so that the sum of distances "
        "is least. A pose that shrinks the sketch to a point has as many inliers as the right one.",
        partial(_ransac, np.inf),
    ),
    Aligner(
        f"RANSAC, {_ALIKE} by size",
        ("cv2", "scipy"),
        f"the same, given only the {_ALIKE} mapped objects for each sketched one that are nearest "
        "in size, in units of the median of each side.",
        partial(_ransac, _ALIKE),
    ),
    Aligner(
        "CLIPPER (ours)",
        (),
        "the dense subgraph of Lusk et al. 2021, written from the paper, is given all N·N' "
        "pairings of centroids. As the scale is unknown, two of them are consistent where the "
        "ratio of their distances and the roots of both ratios of areas agree about it within a "
        f"factor of {np.exp(_FURTHEST):.0f}. It sees neither directions nor shapes, and mirrors "
        "freely.",
        _consistent_subset,
    ),
)
