"""The answer to a match: which sketched object is which mapped object, and how sure it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import zip_longest
from types import MappingProxyType
from typing import Any

from sketchmatch.api import Outcome
from sketchmatch.model import Confidence, FloatArray, Scene
from sketchmatch.model.text import Table, Tabular, likelihood, name
from sketchmatch_views import Line, MatchRow, MatchView, Shape

__all__ = [
    "AlternativeMap",
    "Ambiguity",
    "Correspondence",
    "MatchResult",
    "ObjectGroup",
    "ObjectMatch",
    "ObjectRelation",
    "Statistics",
]


@dataclass(frozen=True)
class ObjectRelation:
    """How an object lies relative to another one of the same scene, in words.

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
        By how much ζ falls if the sketched object takes its best other partner, in one exchange or
        in one of the alternatives; about 0 if it is ambiguous, None if unknown.
    relation
        How the sketched object lies, in the sketch, relative to the nearest other matched one; None
        in progress and alternatives.
    probability
        Probability that the sketch shows this place and this is its partner; None if unknown, see
        :class:`MatchResult`.
    """

    sketch_object: int
    map_object: int
    confidence: float
    margin: float | None = None
    relation: ObjectRelation | None = None
    probability: float | None = None


@dataclass(frozen=True)
class AlternativeMap:
    """An object map that is not the best.

    Attributes
    ----------
    matches
        Its lines, without margins, relations and probabilities.
    confidence
        ζ of its FMAP, and the parts.
    omap_confidence
        Ω, the mean of the lines' confidences.
    probability
        Probability that it is the right one, as :attr:`MatchResult.probability`; None if unknown.
    """

    matches: tuple[ObjectMatch, ...]
    confidence: Confidence
    omap_confidence: float
    probability: float | None = None

    @property
    def object_map(self) -> dict[int, int]:
        """Sketch index → map index, from 0."""
        return {match.sketch_object: match.map_object for match in self.matches}

    def __repr__(self) -> str:
        confidences = _confidences(self.confidence.total, self.omap_confidence)
        likely = _likely(self.probability)
        return f"<{type(self).__name__}: {confidences}{likely}, {self.object_map}>"


@dataclass(frozen=True)
class Ambiguity:
    """Several object maps that the sketch does not distinguish, as in a symmetric room.

    Attributes
    ----------
    maps
        Number of maps that are about equally likely, including the best; 2 or more.
    alternatives
        Which of :attr:`MatchResult.alternatives` are among them, by index from 0; fewer than
        ``maps`` − 1 if fewer alternatives were requested.
    deciding_sketch_objects
        The sketched objects whose partners differ between them, the most informative one first.
    """

    maps: int
    alternatives: tuple[int, ...]
    deciding_sketch_objects: tuple[int, ...]


@dataclass(frozen=True)
class ObjectGroup:
    """Several objects of one side, or of both, that are one place on the other.

    Attributes
    ----------
    sketch_objects, map_objects
        Indices from 0, in order; at most one line of :attr:`MatchResult.matches` joins two of them.
    probability
        Probability that the sketch shows this place and these belong together, all of them taken as
        one object; None if unknown.
    """

    sketch_objects: tuple[int, ...]
    map_objects: tuple[int, ...]
    probability: float | None = None


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
    """What a match cost.

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
    seconds: Mapping[str, float] = field(hash=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "seconds", MappingProxyType(dict(self.seconds)))

    def __reduce__(self) -> tuple[Any, ...]:
        return Statistics, (self.iterations, self.evaluations, dict(self.seconds))


@dataclass(frozen=True, repr=False)
class MatchResult(Tabular):
    """The result of a match.

    All probabilities are consistent. That the map is right means that the sketch shows this place
    and that every sketched object is what the map says, including those without partner. This is
    never more likely than the place or any of its lines, and at least as likely as 1 minus the sum
    of what all lines, and objects without partner, lack to 1. A line sums over all maps that
    contain it, so many likely lines can form an unlikely map: twenty lines of 0.95 may each fail in
    another map. That an object has no partner includes that the sketch shows another place.

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
        A ζ that no legal FMAP exceeds, or None if the searcher proves nothing. If objects may stay
        unmatched, it and the outcome OPTIMAL refer to maps of the matched objects of the smaller
        scene; whether other objects should be matched is not proved. The outcome is OPTIMAL only if
        the judge's answer is the map with the highest ζ, and there is no bound if its answer has
        other objects than the map for which the search proved one.
    seed
        With it, the same request gives the same result.
    match_id
        Unique to this match.
    statistics
        What it took.
    sketch, map
        The scenes that were matched.
    warnings
        Notes of the segmentation: what it left out or decided, each naming its side.
    alternatives
        The next best object maps that were found, in the order of the judge.
    search_note
        The searcher's note on what it did, or empty.
    sketch_route
        Shape (k, 2), the route drawn in the sketch, in its coordinates, or None.
    probability
        Probability that the object map is right as a whole, on this place, as learned from
        simulated sketches. None if the judge gives no probabilities for such a match.
    place_probability
        Probability that the sketch shows the place of the map at all: below 0.5 it is probably
        another one, and the object map means little. None if the judge does not know.
    ambiguity
        If several maps are about equally likely: which, and what to ask. None if one is clearly the
        best, if this is probably not the place, and without probabilities.
    unmatched_sketch_probabilities
        Probability that each of ``unmatched_sketch_objects`` has no partner on this map; empty if
        unknown.
    provisional
        Whether it is a quick answer, searched only near former maps.
    groups
        Groups of objects that are, together, one of the other side, such as regions that people
        draw as one. Those without a line of their own are among the unmatched, since all other
        fields take objects one by one.
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
    place_probability: float | None = None
    ambiguity: Ambiguity | None = None
    unmatched_sketch_probabilities: tuple[float, ...] = ()
    provisional: bool = False
    groups: tuple[ObjectGroup, ...] = ()

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

    def rows(self) -> list[MatchRow]:
        """Return a plain dict for each sketched object, in their order, as data frames take them.

        Its keys are those of :class:`sketchmatch_views.MatchRow`: indices and labels of the object
        and its partner, the partner's place, and what is known of both. What is unknown is None.
        """
        return self._view().rows()

    def to_geojson(self) -> dict[str, Any]:
        """Return a GeoJSON FeatureCollection in the map's frame, in its units.

        One feature for each row of :meth:`rows`, with the row as its properties and the polygon of
        the partner, or no geometry without one; then one for each mapped object without partner.
        The property ``label`` is the mapped object's label, or else the sketched one's.
        ``sketchmatch`` reads such a file as a map.
        """
        return self._view().geojson()

    def _repr_html_(self) -> str:
        """Return the table for a notebook, with a picture of both scenes."""
        return f"{self._view().svg()}{super()._repr_html_()}"

    def _view(self) -> MatchView:
        likely = dict(
            zip(
                self.unmatched_sketch_objects,
                self.unmatched_sketch_probabilities,
                strict=bool(self.unmatched_sketch_probabilities),
            )
        )
        return MatchView(
            _shapes(self.sketch),
            _shapes(self.map),
            [_line(match) for match in self.matches],
            {k: likely.get(k) for k in self.unmatched_sketch_objects},
            [] if self.sketch_route is None else self.sketch_route.tolist(),
            [(group.sketch_objects, group.map_objects) for group in self.groups],
        )

    def _headline(self) -> str:
        grouped = {k for group in self.groups for k in group.sketch_objects}
        left = sum(k not in grouped for k in self.unmatched_sketch_objects)
        facts = [
            f"{len(self.sketch) - left} of {len(self.sketch)} sketched objects matched",
            _confidences(self.fmap_confidence, self.omap_confidence) + _likely(self.probability),
        ]
        if self.place_probability is not None:
            likely = likelihood(self.place_probability)
            if self.place_probability < 0.5:
                facts[0] = f"probably not this place (this place: {likely}): {facts[0]}"
            else:
                facts.append(f"this place {likely}")
        if self.ambiguity is not None:
            first = self.ambiguity.deciding_sketch_objects[0]
            asked = name(first, self.sketch.labels[first])
            facts.append(f"{self.ambiguity.maps} maps about as likely, ask what {asked} is")
        return ", ".join([*facts, self.outcome])

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
        unmatched = zip_longest(
            self.unmatched_sketch_objects, map(likelihood, self.unmatched_sketch_probabilities)
        )
        rows += [
            (name(k, self.sketch.labels[k]), "no partner", "", likely or "", "")
            for k, likely in unmatched
            if not any(k in group.sketch_objects for group in self.groups)
        ]
        rows += [
            (
                " + ".join(name(k, self.sketch.labels[k]) for k in group.sketch_objects),
                " + ".join(name(k, self.map.labels[k]) for k in group.map_objects),
                "as one",
                "" if group.probability is None else likelihood(group.probability),
                "",
            )
            for group in self.groups
        ]
        return Table(self._headline(), heads, rows, 2)


def _confidences(fmap: float, omap: float) -> str:
    return f"FMAP confidence {fmap:.3f}, OMAP confidence {omap:.3f}"


def _likely(probability: float | None) -> str:
    return "" if probability is None else f", probability {likelihood(probability)}"


def _shapes(scene: Scene) -> list[Shape]:
    return [
        Shape([ring.tolist() for ring in item.rings], item.centroid, item.label)
        for item in scene.objects
    ]


def _line(match: ObjectMatch) -> Line:
    seen = match.relation
    return Line(
        match.sketch_object,
        match.map_object,
        match.confidence,
        match.probability,
        match.margin,
        None if seen is None else seen.phrase,
        None if seen is None else seen.reference_object,
    )
