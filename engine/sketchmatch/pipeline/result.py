"""The answer to a match: which sketched object is which mapped object, and how sure it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from sketchmatch.api import Outcome
from sketchmatch.model import Confidence, FloatArray, Scene
from sketchmatch.model.text import Table, Tabular, likelihood, name

__all__ = [
    "AlternativeMap",
    "Correspondence",
    "MatchResult",
    "ObjectMatch",
    "ObjectRelation",
    "Statistics",
]


@dataclass(frozen=True)
class ObjectRelation:
    """How an object lies to another one of the same scene, in words.

    Attributes
    ----------
    reference_object
        Index of the other object, from 0.
    phrase
        Completes "the object is … the reference object", e.g. "to the left of and below".
    degree
        How well the phrase describes it, within [0, 1].
    """

    reference_object: int
    phrase: str
    degree: float


@dataclass(frozen=True)
class ObjectMatch:
    """One sketched object and the mapped object that it is.

    Attributes
    ----------
    sketch_object, map_object
        Indices from 0.
    confidence
        How much of the evidence speaks for it, within [0, 1].
    margin
        By how much ζ falls if the sketched object takes its best other partner, in one exchange
        or in one of the alternatives; about 0 where it is ambiguous, None where unknown.
    relation
        How the sketched object lies, in the sketch, to the nearest other matched one; None in
        progress and alternatives.
    probability
        How likely this is its partner; None where unknown, see :class:`MatchResult`.
    """

    sketch_object: int
    map_object: int
    confidence: float
    margin: float | None = None
    relation: ObjectRelation | None = None
    probability: float | None = None


@dataclass(frozen=True)
class AlternativeMap:
    """An object map that is not the best, with ζ of its FMAP and Ω."""

    matches: tuple[ObjectMatch, ...]
    confidence: Confidence
    omap_confidence: float

    @property
    def object_map(self) -> dict[int, int]:
        """Sketch index → map index, from 0."""
        return {match.sketch_object: match.map_object for match in self.matches}

    def __repr__(self) -> str:
        confidences = _confidences(self.confidence.total, self.omap_confidence)
        return f"<{type(self).__name__}: {confidences}, {self.object_map}>"


@dataclass(frozen=True)
class Correspondence:
    """One entry of the FMAP, read from sketch to map.

    Attributes
    ----------
    sketch_pair, map_pair
        Objects (a, b) of the sketch whose relation corresponds to that of (c, d) on the map.
    similarity
        σ of the two histograms.
    rotation
        Turn from the sketch's to the map's, radians counter-clockwise within (−π, π].
    dilation
        Size on the map relative to the sketch.
    """

    sketch_pair: tuple[int, int]
    map_pair: tuple[int, int]
    similarity: float
    rotation: float
    dilation: float


@dataclass(frozen=True)
class Statistics:
    """What a match took.

    Attributes
    ----------
    iterations, evaluations
        Of the searcher: its iterations, and the FMAPs that it evaluated.
    seconds
        Time of each stage, ``segment``, ``describe``, ``relate``, ``search`` with the judgement,
        and ``total``, all without the compilation of kernels.
    """

    iterations: int
    evaluations: int
    seconds: Mapping[str, float]


@dataclass(frozen=True, repr=False)
class MatchResult(Tabular):
    """The result of a match.

    Attributes
    ----------
    matches
        The matched objects, by index in the sketch.
    omap_confidence
        Ω, the mean of their confidences.
    confidence
        ζ of the FMAP and its parts.
    fmap
        The histogram map that was found.
    rotation
        Turn from sketch to map, radians counter-clockwise within (−π, π].
    scale
        Size of the map relative to the sketch.
    outcome
        Why the search ended.
    upper_bound
        A ζ that no legal FMAP exceeds, or None where the searcher proves nothing. Where objects
        may stay unmatched, it and an outcome OPTIMAL speak of maps of the objects of the smaller
        scene that are matched; that no other objects should be is not proved. An outcome is
        OPTIMAL only where the judge answers the map with the highest ζ, and there is no bound
        where it answers a map of other objects than the search proved one for.
    seed
        With it, the same request gives the same result.
    match_id
        Unique to this match.
    statistics
        What it took.
    sketch, map
        The scenes that were matched.
    warnings
        What segmentation left out or decided, each naming its side.
    alternatives
        The next best object maps that were found, the highest ζ first; where objects may stay
        unmatched, the highest ζ less the price of those that do.
    search_note
        What the searcher says of what it did, or empty.
    sketch_route
        Shape (k, 2), the way drawn through the sketch, in its coordinates, or None.
    probability
        How likely the object map is right as a whole, learned from simulated sketches. None where
        nothing was learned: for other weights than 1, 1, 1 and those of the profile ``learned``,
        histograms of other than constant forces, other similarities than the default, maps of
        pairs, and too many objects.
    """

    matches: tuple[ObjectMatch, ...]
    omap_confidence: float
    confidence: Confidence
    fmap: tuple[Correspondence, ...]
    rotation: float
    scale: float
    outcome: Outcome
    upper_bound: float | None
    seed: int
    match_id: str
    statistics: Statistics
    sketch: Scene
    map: Scene
    warnings: tuple[str, ...] = ()
    alternatives: tuple[AlternativeMap, ...] = ()
    search_note: str = ""
    sketch_route: FloatArray | None = field(default=None, compare=False)
    probability: float | None = None

    @property
    def object_map(self) -> dict[int, int]:
        """Sketch index → map index, from 0; sketched objects without a partner are left out."""
        return {match.sketch_object: match.map_object for match in self.matches}

    @property
    def fmap_confidence(self) -> float:
        """ζ."""
        return self.confidence.total

    @property
    def unmatched_sketch_objects(self) -> tuple[int, ...]:
        """Sketched objects without a partner."""
        matched = set(self.object_map)
        return tuple(k for k in range(len(self.sketch)) if k not in matched)

    @property
    def unmatched_map_objects(self) -> tuple[int, ...]:
        """Mapped objects without a partner."""
        matched = set(self.object_map.values())
        return tuple(k for k in range(len(self.map)) if k not in matched)

    def _headline(self) -> str:
        matched = f"{len(self.matches)} of {len(self.sketch)} sketched objects matched"
        confidences = _confidences(self.fmap_confidence, self.omap_confidence)
        likely = "" if self.probability is None else f", probability {likelihood(self.probability)}"
        return f"{matched}, {confidences}{likely}, {self.outcome}"

    def _table(self) -> Table:
        heads = ("in the sketch", "on the map", "confidence", "probability", "margin")
        rows = [
            (
                name(match.sketch_object, self.sketch.labels[match.sketch_object]),
                name(match.map_object, self.map.labels[match.map_object]),
                f"{match.confidence:.3f}",
                "" if match.probability is None else likelihood(match.probability),
                "" if match.margin is None else f"{match.margin:.3f}",
            )
            for match in self.matches
        ]
        return Table(self._headline(), heads, rows, 2)


def _confidences(fmap: float, omap: float) -> str:
    return f"FMAP confidence {fmap:.3f}, OMAP confidence {omap:.3f}"
