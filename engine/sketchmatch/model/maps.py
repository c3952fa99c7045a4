"""Histogram maps and object maps: what a search finds and what follows from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sketchmatch.model.arrays import FloatArray, IntArray, frozen, frozen_floats
from sketchmatch.model.relations import (
    correspondences,
    object_pairs,
    pair_count,
    pair_index,
)

__all__ = [
    "MAX_DISTANCE",
    "MAX_WEIGHT",
    "WEIGHT_COUNTS",
    "Confidence",
    "ConfidenceWeights",
    "Fmap",
    "ObjectMap",
    "Occm",
    "RequestWeights",
    "Weights",
]

Weights = tuple[float, float, float]
"""Weights of ζσ, ζR and ζL; where a table holds evidence, its mean takes the place of ζσ."""

RequestWeights = (
    Weights
    | tuple[float, float, float, float, float]
    | tuple[float, float, float, float, float, float]
)
"""Weights of ζσ, ζR and ζL, perhaps of ζS and ζM, and perhaps the exponent of distance."""

WEIGHT_COUNTS = (3, 5, 6)
"""How many numbers that may be."""

MAX_WEIGHT, MAX_DISTANCE = 1e6, 4.0
"""The largest weight, and the largest exponent."""


class ConfidenceWeights(NamedTuple):
    """What each part of ζ counts for: ζ = (w₁ζσ + w₂ζR + w₃ζL + w₄ζS + w₅ζM) / Σw.

    Attributes
    ----------
    similarity, rotation, dilation
        Weights of ζσ, ζR and ζL, which compare only relations of objects; the thesis's ζ.
    shape, size
        Weights of ζS and ζM, which compare each object with its partner.
    distance
        β, an exponent and not a weight: the rotation of a pair of template objects at distance d
        counts d^β in ζR, so ζR = |Σ d^β e^{iR}| / Σ d^β. With 0 all pairs count alike, as in the
        thesis.
    """

    similarity: float = 1.0
    rotation: float = 1.0
    dilation: float = 1.0
    shape: float = 0.0
    size: float = 0.0
    distance: float = 0.0

    @property
    def total(self) -> float:
        """w₁ + w₂ + w₃ + w₄ + w₅."""
        return self.of_entries + self.rotation + self.dilation

    @property
    def of_entries(self) -> float:
        """w₁ + w₄ + w₅, the weight of all parts that are means over the entries of an FMAP."""
        return self.similarity + self.shape + self.size

    @property
    def of_objects(self) -> float:
        """w₄ + w₅; above 0 objects are compared beside their relations."""
        return self.shape + self.size

    @property
    def searched(self) -> Weights:
        """The weights of a search, whose evidence holds shapes and sizes.

        Examples
        --------
        >>> ConfidenceWeights(1, 2, 3, 0.5, 0.5).searched
        (2.0, 2, 3)
        """
        return (self.of_entries, self.rotation, self.dilation)


@dataclass(frozen=True, eq=False)
class Fmap:
    """A histogram map: one argument correspondence for each template pair.

    Attributes
    ----------
    entries
        int64, shape (Q,), each within [0, Q'): j < Q'/2 is the argument pair (c, d), c < d, and
        j + Q'/2 its dual (d, c).
    """

    entries: IntArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "entries", frozen(np.asarray(self.entries, dtype=np.int64)))

    @classmethod
    def from_object_map(cls, partners: IntArray, argument_objects: int) -> Fmap:
        """Return the FMAP that an injective object map induces.

        Parameters
        ----------
        partners
            Shape (N,), the argument object of each template object, all different.
        argument_objects
            N'.

        Examples
        --------
        >>> Fmap.from_object_map(np.array([2, 0, 1]), 3).entries
        array([4, 5, 0])
        """
        c, d = np.asarray(partners, dtype=np.int64)[object_pairs(len(partners))].T
        return cls(correspondences(argument_objects)[c, d])

    def object_pair(self, i: int, argument_objects: int) -> tuple[int, int]:
        """Return the argument objects (c, d) that template pair i is mapped to, in order."""
        half = pair_count(argument_objects)
        column = int(self.entries[i]) % half
        c, d = (int(k) for k in object_pairs(argument_objects)[column])
        assert pair_index(c, d, argument_objects) == column
        return (c, d) if self.entries[i] < half else (d, c)


@dataclass(frozen=True)
class Confidence:
    """ζ of an FMAP and its parts.

    Attributes
    ----------
    total
        ζ, the weighted mean of the parts.
    similarity, rotation, dilation
        ζσ, ζR and ζL.
    shape, size
        ζS and ζM; None where objects were not compared, because neither counts.
    """

    total: float
    similarity: float
    rotation: float
    dilation: float
    shape: float | None = None
    size: float | None = None


@dataclass(frozen=True, eq=False)
class Occm:
    """Object correspondence confidence matrix.

    Attributes
    ----------
    evidence
        Shape (N, N'): the sum of σ over all histogram correspondences that speak for a pairing.
    implied
        Shape (N, N'): the part of it from those whose order implies the pairing.
    """

    evidence: FloatArray
    implied: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "evidence", frozen_floats(self.evidence))
        object.__setattr__(self, "implied", frozen_floats(self.implied))


@dataclass(frozen=True, eq=False)
class ObjectMap:
    """A one-to-one map of template objects to argument objects.

    Attributes
    ----------
    partners
        int64, shape (N,): the argument object of each template object, all different.
    confidences
        Shape (N,): the evidence for each pairing divided by N−1, within [0, 1] for an
        object-consistent FMAP.
    confidence
        Ω, their mean.
    """

    partners: IntArray
    confidences: FloatArray
    confidence: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "partners", frozen(np.asarray(self.partners, dtype=np.int64)))
        object.__setattr__(self, "confidences", frozen_floats(self.confidences))
