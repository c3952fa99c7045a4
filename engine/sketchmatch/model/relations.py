"""Spatial relations: histograms of one scene, and the comparison of two scenes' histograms.

Pairs (a, b), a < b, are numbered row by row: (0, 1), (0, 2) … (0, N−1), (1, 2) …; that is the
thesis's numbering (section 3.3), counted from 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TypeVar

import numpy as np

from sketchmatch.errors import counted
from sketchmatch.model.arrays import FloatArray, IntArray, frozen, frozen_floats, sealed
from sketchmatch.model.caching import cached_property

__all__ = [
    "DILATION_SCALE",
    "Pairs",
    "RelationTable",
    "SceneDescriptor",
    "correspondences",
    "object_pairs",
    "pair_count",
    "pair_index",
]

Pairs = Sequence[tuple[int, int]]
"""Ordered pairs of objects, by their indices."""

_Index = TypeVar("_Index", int, IntArray)

DILATION_SCALE = 1.5 / math.log(2.0)
"""C in L̂ = C·ln L (thesis 3.3: 2.164)."""


def pair_count(objects: int) -> int:
    """Return Q = N(N−1)/2, the number of unordered pairs of N objects.

    Examples
    --------
    >>> pair_count(8)
    28
    """
    return objects * (objects - 1) // 2


def pair_index(a: _Index, b: _Index, objects: int) -> _Index:
    """Return the index of pair (a, b), a < b, among ``objects`` objects, all from 0.

    Compiled code calls ``pair_index`` of :mod:`sketchmatch.api.kernels`, which is this function.

    Parameters
    ----------
    a, b
        Two objects, or arrays of one shape that hold those of many pairs.
    objects
        How many objects there are.

    Examples
    --------
    >>> [pair_index(a, b, 3) for a, b in [(0, 1), (0, 2), (1, 2)]]
    [0, 1, 2]
    >>> pair_index(np.array([0, 2]), np.array([3, 3]), 4)
    array([2, 5])
    """
    return a * objects - a * (a + 1) // 2 + b - a - 1


@lru_cache(maxsize=64)
def object_pairs(objects: int) -> IntArray:
    """Return all pairs (a, b), a < b, in the order of their index, shape (Q, 2)."""
    return frozen(np.stack(np.triu_indices(objects, k=1), axis=1).astype(np.int64))


@lru_cache(maxsize=64)
def correspondences(objects: int) -> IntArray:
    """Return the index of the histogram of every ordered pair of objects.

    Returns
    -------
    ndarray
        Shape (N, N): pair (c, d) has its index if c < d and that of its dual, Q more, if c > d;
        the diagonal means nothing.

    Examples
    --------
    >>> int(correspondences(3)[2, 0])
    4
    """
    columns = np.zeros((objects, objects), dtype=np.int64)
    c, d = object_pairs(objects).T
    columns[c, d] = np.arange(len(c))
    columns[d, c] = columns[c, d] + len(c)
    return sealed(columns)


@dataclass(frozen=True, eq=False)
class SceneDescriptor:
    """All histograms of one scene, F_rD in the thesis.

    Attributes
    ----------
    histograms
        Shape (Q, n): row (a, b), a < b, supports "a is in direction 2πk/n of b". The dual
        (b, a) is the same row turned by half, so it is not stored.
    objects
        N, the number of objects.
    exponent
        r of the forces.
    described_by
        The identity of the algorithm that made them, with its parameters; empty where they were
        made by hand.
    scene
        The identity of the scene; empty where there is none.
    """

    histograms: FloatArray
    objects: int
    exponent: float
    described_by: str = ""
    scene: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "histograms", frozen_floats(self.histograms))
        if self.histograms.shape[0] != pair_count(self.objects):
            raise ValueError("a descriptor needs one histogram for each pair of objects")

    @property
    def directions(self) -> int:
        """The number n of directions."""
        return int(self.histograms.shape[1])

    def __repr__(self) -> str:
        by = f", by {self.described_by.split()[0]}" if self.described_by else ""
        size = f"{counted(len(self.histograms), 'histogram')} in {self.directions} directions"
        return f"<{type(self).__name__}: {size} of {self.objects} objects{by}>"

    def histogram(self, a: int, b: int) -> FloatArray:
        """Return the histogram of object a on object b, in either order."""
        if a < b:
            row: FloatArray = self.histograms[pair_index(a, b, self.objects)]
            return row
        dual = self.histograms[pair_index(b, a, self.objects)]
        half = self.directions - self.directions // 2
        return sealed(np.concatenate([dual[half:], dual[:half]]))


@dataclass(frozen=True, eq=False)
class RelationTable:
    """How every template pair compares with every argument pair.

    Columns are the Q'/2 argument pairs (c, d), c < d. The dual of column j is histogram
    correspondence j + Q'/2: it has the same σ, the same L, and R + π, so it is not stored.

    Attributes
    ----------
    similarity
        σ, shape (Q, Q'/2), within [0, 1].
    rotation
        R in radians within [0, 2π), the turn from template to argument, shape (Q, Q'/2).
    dilation
        L > 0, the size of the argument relative to the template, shape (Q, Q'/2).
    template_objects, argument_objects
        N ≤ N'.
    evidence
        Shape (Q, Q'), within [0, 1]: the evidence of every correspondence, duals included, if it is
        more than σ; None if it is σ.
    rotation_weights
        Shape (Q,), above 0, 1 on average: the weight of R of each template pair in ζR. Given in any
        scale, one for each pair or one for all; by default all are equal.
    """

    similarity: FloatArray
    rotation: FloatArray
    dilation: FloatArray
    template_objects: int
    argument_objects: int
    evidence: FloatArray | None = None
    rotation_weights: FloatArray = field(default_factory=lambda: np.ones(1))

    def __post_init__(self) -> None:
        if not 2 <= self.template_objects <= self.argument_objects:
            raise ValueError("the template must have at least 2 and at most N' objects")
        shape = (pair_count(self.template_objects), pair_count(self.argument_objects))
        for name in ("similarity", "rotation", "dilation"):
            array = frozen_floats(getattr(self, name))
            if array.shape != shape:
                raise ValueError(f"{name} has shape {array.shape}, not {shape}")
            object.__setattr__(self, name, array)
        if self.evidence is not None:
            evidence = frozen_floats(self.evidence)
            if evidence.shape != (shape[0], 2 * shape[1]):
                wanted = (shape[0], 2 * shape[1])
                raise ValueError(f"evidence has shape {evidence.shape}, not {wanted}")
            object.__setattr__(self, "evidence", evidence)
        weights = np.asarray(self.rotation_weights, dtype=np.float64)
        if weights.shape not in ((1,), shape[:1]) or not (weights > 0).all():
            raise ValueError("rotation_weights must be one number above 0 for each template pair")
        weights = np.broadcast_to(weights / weights.mean(), shape[:1])
        object.__setattr__(self, "rotation_weights", frozen_floats(weights))

    def __repr__(self) -> str:
        least, most = self.similarity.min(), self.similarity.max()
        return (
            f"<{type(self).__name__}: {self.template_pairs} x {self.argument_pairs} relations of "
            f"{self.template_objects} x {self.argument_objects} objects, "
            f"similarity {least:.3f} to {most:.3f}>"
        )

    @property
    def entry_evidence(self) -> FloatArray:
        """What an entry counts for in ζ, as kernels read it.

        Shape (Q, Q'): the evidence; or, where there is none, shape (Q, Q'/2): σ, and a dual has
        that of its column.
        """
        return self.similarity if self.evidence is None else self.evidence

    @property
    def template_pairs(self) -> int:
        """Q."""
        return int(self.similarity.shape[0])

    @property
    def argument_pairs(self) -> int:
        """Q'/2, the number of columns; correspondences run to twice this."""
        return int(self.similarity.shape[1])

    @cached_property
    def normalized_dilation(self) -> FloatArray:
        """L̂ = C·ln L, shape (Q, Q'/2)."""
        return sealed(DILATION_SCALE * np.log(self.dilation))

    @cached_property
    def cosine(self) -> FloatArray:
        """cos R times the pair's rotation weight, shape (Q, Q'/2); a dual has it negated."""
        return sealed(self.rotation_weights[:, None] * np.cos(self.rotation))

    @cached_property
    def sine(self) -> FloatArray:
        """sin R times the pair's rotation weight, shape (Q, Q'/2); a dual has it negated."""
        return sealed(self.rotation_weights[:, None] * np.sin(self.rotation))
