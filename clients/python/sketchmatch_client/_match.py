"""A finished match, how its events become one, and how far it is until then."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from google.protobuf.duration_pb2 import Duration

from sketchmatch_client._summary import enum_name, match_headline, match_table, progress_line
from sketchmatch_client.errors import ServerFailedError
from sketchmatch_proto.v1.match_pb2 import (
    Ambiguity,
    MatchAccepted,
    MatchProgress,
    MatchResult,
    MatchScenes,
    ObjectMatch,
    Outcome,
    Phase,
)
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse
from sketchmatch_proto.v1.scene_pb2 import Scene
from sketchmatch_views import Line, MatchRow, MatchView, Shape

__all__ = ["Match", "MatchCollector", "Progress", "ProgressCallback", "tell_progress"]


@dataclass(frozen=True, eq=False)
class Progress:
    """State of a running match: the contract's message, but None for values that are not known yet.

    Attributes
    ----------
    message
        The message; a Progress equals it and equal ones.
    """

    message: MatchProgress

    @property
    def phase(self) -> Phase.ValueType:
        """What is being done, e.g. ``PHASE_SEARCH`` of ``sketchmatch_proto.v1.match_pb2``."""
        return self.message.phase

    @property
    def fraction(self) -> float | None:
        """How much of the phase is done, from 0 to 1; None if unknown."""
        return self._known("fraction")

    @property
    def iteration(self) -> int:
        """Iterations of the search so far."""
        return self.message.iteration

    @property
    def evaluations(self) -> int:
        """Maps that the search has evaluated so far."""
        return self.message.evaluations

    @property
    def confidence(self) -> float | None:
        """ζ of the best map so far, which never falls; None before and after the search."""
        return self._known("confidence")

    @property
    def upper_bound(self) -> float | None:
        """A ζ that no map exceeds; None where the searcher proves nothing."""
        return self._known("upper_bound")

    @property
    def object_matches(self) -> Sequence[ObjectMatch]:
        """The best object map so far, line by line; empty before the search."""
        return self.message.object_matches

    @property
    def object_map(self) -> dict[int, int]:
        """The same, from the index of a sketched object to that of the mapped one."""
        return _object_map(self.object_matches)

    @property
    def elapsed(self) -> Duration:
        """Time since the request was accepted."""
        return self.message.elapsed

    def HasField(self, name: str) -> bool:  # noqa: N802 (as messages call it)
        """Return whether the message has an optional field."""
        return self.message.HasField(name)  # type: ignore[arg-type]

    def __eq__(self, other: object) -> bool:
        return self.message == (other.message if isinstance(other, Progress) else other)

    __hash__ = None  # type: ignore[assignment]  # as of messages

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {progress_line(self.message)}>"

    def _known(self, name: str) -> float | None:
        return getattr(self.message, name) if self.HasField(name) else None


ProgressCallback = Callable[[Progress], object]
"""Called with each progress; what it returns is ignored."""


@dataclass(frozen=True)
class Match:
    """A finished match.

    Printed, it is a small table; its parts are messages of the contract, which print at length.

    Attributes
    ----------
    accepted
        How it ran: seed, and every algorithm with every parameter.
    scenes
        The objects that the indices of the result point to.
    result
        The answer.
    """

    accepted: MatchAccepted
    scenes: MatchScenes
    result: MatchResult

    @property
    def object_map(self) -> dict[int, int]:
        """For each sketched object with a partner the index of its mapped object, from 0."""
        return _object_map(self.result.object_matches)

    @property
    def fmap_confidence(self) -> float:
        """ζ of the answer."""
        return self.result.fmap_confidence.total

    @property
    def omap_confidence(self) -> float:
        """Ω, the mean confidence of the matched objects."""
        return self.result.omap_confidence

    @property
    def probability(self) -> float | None:
        """How likely the object map is right as a whole, on this place; None if unknown."""
        return self.result.probability if self.result.HasField("probability") else None

    @property
    def place_probability(self) -> float | None:
        """How likely the sketch shows the map's place at all; None if unknown."""
        known = self.result.HasField("place_probability")
        return self.result.place_probability if known else None

    @property
    def ambiguity(self) -> Ambiguity | None:
        """Which maps are about as likely, and what to ask; None if one is clearly the best."""
        return self.result.ambiguity if self.result.HasField("ambiguity") else None

    @property
    def upper_bound(self) -> float | None:
        """A ζ that no map exceeds; None where the searcher proves nothing."""
        return self.result.upper_bound if self.result.HasField("upper_bound") else None

    @property
    def outcome(self) -> str:
        """Why the search ended, e.g. ``"OPTIMAL"``."""
        return enum_name(Outcome, "OUTCOME_", self.result.outcome)

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {match_headline(self.result, self.scenes.sketch)}>"

    def __str__(self) -> str:
        """Return which object is which, for a terminal; objects are numbered from 0."""
        return match_table(self.result, self.scenes.sketch, self.scenes.map)

    def rows(self) -> list[MatchRow]:
        """Return a plain dict for each sketched object, in their order, as data frames take them.

        Its keys are those of :class:`MatchRow`: indices and labels of the object and its partner,
        the partner's place, and what is known of both. What is unknown is None.
        """
        return self._view().rows()

    def to_geojson(self) -> dict[str, Any]:
        """Return a GeoJSON FeatureCollection in the map's frame, in metres.

        One feature for each row of :meth:`rows`, with the row as its properties and the polygon of
        the partner, or no geometry without one; then one for each mapped object without partner.
        The property ``label`` is the mapped object's label, or else the sketched one's.
        """
        return self._view().geojson()

    def _repr_html_(self) -> str:
        """Return the same for a notebook, with a picture of both scenes."""
        return f"{self._view().svg()}<pre>{escape(str(self))}</pre>"

    def _view(self) -> MatchView:
        result = self.result
        known = len(result.unmatched_sketch_probabilities) > 0
        alone = {
            k: result.unmatched_sketch_probabilities[n] if known else None
            for n, k in enumerate(result.unmatched_sketch_objects)
        }
        return MatchView(
            _shapes(self.scenes.sketch),
            _shapes(self.scenes.map),
            [_line(line) for line in result.object_matches],
            alone,
            [(point.x, point.y) for point in self.scenes.sketch_route],
            [(group.sketch_objects, group.map_objects) for group in result.object_groups],
        )


class MatchCollector:
    """Takes the events of one match as they come.

    Parameters
    ----------
    on_progress
        Called with the message of each progress.
    """

    def __init__(self, on_progress: Callable[[MatchProgress], object] | None) -> None:
        self._on_progress = on_progress
        self._accepted = MatchAccepted()
        self._scenes = MatchScenes()
        self._result: MatchResult | None = None

    @property
    def complete(self) -> bool:
        """Whether there is a result."""
        return self._result is not None

    def add(self, event: MatchResponse) -> None:
        """Take the next event; one of a kind that this version does not know is left out."""
        match event.WhichOneof("event"):
            case "accepted":
                self._accepted = event.accepted
            case "scenes":
                self._scenes = event.scenes
            case "progress" if self._on_progress:
                self._on_progress(event.progress)
            case "result":
                self._result = event.result

    def match(self) -> Match:
        """Return the match, once the stream has ended."""
        if self._result is None:
            raise ServerFailedError("the server ended the match without a result; send it again")
        return Match(self._accepted, self._scenes, self._result)


def tell_progress(event: MatchResponse, on_progress: ProgressCallback | None) -> None:
    """Call back where an event is progress."""
    if on_progress is not None and event.HasField("progress"):
        on_progress(Progress(event.progress))


def _object_map(lines: Sequence[ObjectMatch]) -> dict[int, int]:
    return {line.sketch_object: line.map_object for line in lines}


def _shapes(scene: Scene) -> list[Shape]:
    return [
        Shape(
            [[(point.x, point.y) for point in ring.points] for ring in item.rings],
            (item.centroid.x, item.centroid.y),
            item.label,
        )
        for item in scene.objects
    ]


def _line(line: ObjectMatch) -> Line:
    seen = line.HasField("relation")
    return Line(
        line.sketch_object,
        line.map_object,
        line.confidence,
        line.probability if line.HasField("probability") else None,
        line.margin if line.HasField("margin") else None,
        line.relation.phrase if seen else None,
        line.relation.reference_object if seen else None,
    )
