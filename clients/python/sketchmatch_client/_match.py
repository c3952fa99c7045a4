"""A finished match, and how its events become one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from sketchmatch_client.errors import ServerFailedError
from sketchmatch_proto.v1.match_pb2 import MatchAccepted, MatchProgress, MatchResult, MatchScenes
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse

__all__ = ["Match", "MatchCollector", "ProgressCallback"]

ProgressCallback = Callable[[MatchProgress], object]
"""Called with each progress event; what it returns is ignored."""


@dataclass(frozen=True)
class Match:
    """A finished match.

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
        return {line.sketch_object: line.map_object for line in self.result.object_matches}


class MatchCollector:
    """Takes the events of one match as they come.

    Parameters
    ----------
    on_progress
        Called with each progress.
    """

    def __init__(self, on_progress: ProgressCallback | None) -> None:
        self._on_progress = on_progress
        self._accepted = MatchAccepted()
        self._scenes = MatchScenes()
        self._result: MatchResult | None = None

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
