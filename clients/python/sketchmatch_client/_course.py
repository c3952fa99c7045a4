"""The course of a match as its reader sees it: one stream, however often the link is lost."""

from __future__ import annotations

import math
import uuid

from sketchmatch_client._retry import Attempts
from sketchmatch_client.errors import (
    NotFoundError,
    ServerUnavailableError,
    SketchmatchError,
    refused_as,
)
from sketchmatch_proto.v1.match_pb2 import MatchProgress
from sketchmatch_proto.v1.match_service_pb2 import (
    MatchRequest,
    MatchResponse,
    WatchMatchRequest,
    WatchMatchResponse,
)

__all__ = ["Course", "watched"]

_ENDED = ("MATCH_INTERRUPTED", "SERVER_STOPPING", "WORKER_LOST")
"""Why a match may have ended before its time: the same request does it again."""
_TOLD_ONCE = ("accepted", "scenes")


class Course:
    """What is known of a match that is read, and so, how to go on after a link was lost.

    Parameters
    ----------
    request
        What began it, or will; None where it is only watched. It is given a name if it has none.
    match_id, after
        The match to watch, and the number of the last event that is known of it.
    """

    def __init__(self, request: MatchRequest | None, match_id: str = "", after: int = 0) -> None:
        self.request = request
        if request is not None and not request.request_id:
            request.request_id = uuid.uuid4().hex
        self.match_id = match_id
        self._after = after
        self._resumes = request is None
        self._told: set[str] = set()
        self._best = -math.inf
        self._again = False

    @property
    def watching(self) -> WatchMatchRequest | None:
        """What to ask for to go on; None to begin, by the request."""
        if self._resumes:
            return WatchMatchRequest(match_id=self.match_id, after=self._after)
        return None

    def ends(self, error: SketchmatchError) -> bool:
        """Whether all is told: a link that is lost after the result is none of the match."""
        return "result" in self._told and isinstance(error, ServerUnavailableError)

    def take(self, response: MatchResponse | WatchMatchResponse) -> MatchResponse | None:
        """Return the event that came next; None if its like was told before."""
        event = response.event if isinstance(response, WatchMatchResponse) else response
        kind = event.WhichOneof("event") or ""
        if kind == "accepted":
            self.match_id = event.accepted.match_id
        self._after = event.number
        if kind in self._told and kind in _TOLD_ONCE:
            self._again = True
            return None
        self._told.add(kind)
        if kind == "progress" and not self._is_further(event.progress):
            return None
        return event

    def _is_further(self, progress: MatchProgress) -> bool:
        """Whether a match is as far as was told; one that is done again may not be for a while.

        Other progress than that of the search, as that of rooms that are joined, has no confidence.
        """
        if not progress.HasField("confidence"):
            return not self._again or self._best == -math.inf
        if progress.confidence < self._best:
            return False
        self._best, self._again = progress.confidence, False
        return True

    def pause_after(self, error: SketchmatchError, attempts: Attempts) -> float | None:
        """Return the seconds after which to ask again; None if it is in vain.

        What to ask for then is what ``watching`` says.
        """
        if not self._told:
            return attempts.pause_after(error)
        if not self._after:  # a server that cannot go on
            return None
        if self.request is None:
            ended = isinstance(error, ServerUnavailableError) and error.reason in _ENDED
            return None if ended else attempts.pause_after(error, begun=True)
        if isinstance(error, NotFoundError):
            error = ServerUnavailableError(str(error), "MATCH_INTERRUPTED")
        if isinstance(error, ServerUnavailableError):
            self._resumes = error.reason not in _ENDED
        return attempts.pause_after(error, begun=True)


def watched(match_id: str, after: int) -> Course:
    """Return the course of a match that was begun before.

    Raises
    ------
    InvalidRequestError
        If these are no name and no number.
    """
    with refused_as("INVALID_FIELD", "match_id", "is not text; give the name of a match"):
        WatchMatchRequest(match_id=match_id)
    with refused_as("INVALID_FIELD", "after", f"is {after!r}; give the number of an event, or 0"):
        WatchMatchRequest(after=after)
    return Course(None, match_id, after)
