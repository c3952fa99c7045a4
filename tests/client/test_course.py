"""A match is one stream for who reads it, however often the link or the server is lost."""

import pytest

from sketchmatch_client import Client, sources
from sketchmatch_client._course import Course
from sketchmatch_client._retry import Attempts
from sketchmatch_client.errors import (
    CallCancelledError,
    InvalidRequestError,
    NotFoundError,
    ServerFailedError,
    ServerUnavailableError,
)
from sketchmatch_proto.v1.match_pb2 import MatchAccepted, MatchProgress, MatchResult, MatchScenes
from sketchmatch_proto.v1.match_service_pb2 import (
    MatchRequest,
    MatchResponse,
    WatchMatchRequest,
    WatchMatchResponse,
)
from tests.client.fake_server import EVENTS

SKETCH = sources.polygons([[(0, 0), (1, 0), (1, 1)], [(5, 5), (6, 5), (6, 6)]])
NUMBERED = tuple(
    MatchResponse.FromString(
        event.SerializeToString() + MatchResponse(number=k).SerializeToString()
    )
    for k, event in enumerate(EVENTS, 1)
)
LOST = ServerUnavailableError("away")
INTERRUPTED = ServerUnavailableError("nobody read it", "MATCH_INTERRUPTED", 1.0)


def lost_link(server, count):
    """Have the next match break off after some events, and all events there for who watches."""
    server.events, server.breaks_off = NUMBERED, True
    server.breaks_after = count


@pytest.mark.parametrize("count", range(1, len(NUMBERED)))
def test_a_match_goes_on_after_the_event_at_which_the_link_was_lost(call, server, count):
    lost_link(server, count)
    assert call(server.address, "events", SKETCH, SKETCH, retries=1) == list(NUMBERED)
    begun, watched = server.requests
    assert isinstance(begun, MatchRequest)
    assert watched == WatchMatchRequest(match_id="m1", after=count)


def test_a_link_that_is_lost_after_the_result_takes_nothing_away(call, server):
    lost_link(server, len(NUMBERED))
    assert call(server.address, "events", SKETCH, SKETCH, retries=3) == list(NUMBERED)
    assert len(server.requests) == 1


def test_a_match_that_was_interrupted_is_sent_again_and_told_once(call, server):
    lost_link(server, 3)
    server.unknown = True  # after its restart the server does not know the match
    found = call(server.address, "events", SKETCH, SKETCH, retries=1)
    kinds = [event.WhichOneof("event") for event in found]
    assert [kind for kind in kinds if kind not in ("progress", None)] == [
        "accepted",
        "scenes",
        "result",
    ]
    begun, watched, again = server.requests
    assert isinstance(watched, WatchMatchRequest)
    assert again == begun


def test_who_wants_no_retries_is_told_at_once(call, server):
    lost_link(server, 2)
    with pytest.raises(ServerUnavailableError):
        call(server.address, "events", SKETCH, SKETCH, retries=0)
    assert len(server.requests) == 1


def test_a_match_that_is_watched_begins_after_the_event_that_is_known(call, server):
    server.events = NUMBERED
    assert call(server.address, "watch", "m1", 3) == list(NUMBERED[3:])


@pytest.mark.parametrize(("name", "after"), [(7, 0), ("m1", -1), ("m1", "all")])
def test_what_is_no_match_or_event_is_refused(call, server, name, after):
    with pytest.raises(InvalidRequestError):
        call(server.address, "watch", name, after)
    assert server.requests == []


def test_cancelling_a_match_that_would_keep_running_asks_the_server_to_stop_it(server):
    server.events, server.endless = NUMBERED[:3], True
    with Client(server.address) as client:
        match = client.events(SKETCH, SKETCH, keep_running=True)
        next(match)
        match.cancel()
        with pytest.raises(CallCancelledError):
            match.result()
        assert server.cancelled_match.wait(10)


def progress(confidence=None):
    return MatchResponse(progress=MatchProgress(confidence=confidence), number=1)


def test_a_match_that_is_done_again_tells_no_less_than_was_known():
    course = Course(MatchRequest())
    accepted = MatchResponse(accepted=MatchAccepted(match_id="m1"), number=1)
    scenes = MatchResponse(scenes=MatchScenes(), number=2)
    first = [accepted, progress(), scenes, progress(0.5)]
    assert [course.take(event) for event in first] == first
    again = [accepted, progress(), scenes, progress(0.25), progress(0.5), progress(0.75)]
    told = [course.take(event) for event in again]
    assert told == [None, None, None, None, progress(0.5), progress(0.75)]
    result = MatchResponse(result=MatchResult(match_id="m1"), number=9)
    assert course.take(WatchMatchResponse(event=result)) == result


def test_progress_without_confidence_is_told_after_the_search_too():
    course = Course(MatchRequest())
    events = [progress(0.5), progress(), progress(0.5), progress()]
    assert [course.take(event) for event in events] == events


def test_a_match_that_is_done_again_and_caught_up_tells_all_its_progress():
    course = Course(MatchRequest())
    accepted = MatchResponse(accepted=MatchAccepted(match_id="m1"), number=1)
    first = [accepted, progress(0.5), progress()]
    assert [course.take(event) for event in first] == first
    again = [accepted, progress(), progress(0.5), progress(), progress(0.4), progress(0.6)]
    told = [course.take(event) for event in again]
    assert told == [None, None, progress(0.5), progress(), None, progress(0.6)]


@pytest.mark.parametrize(
    ("error", "watches"),
    [(LOST, True), (INTERRUPTED, False), (NotFoundError("none", "NOT_FOUND"), False)],
)
def test_what_is_asked_next_depends_on_what_the_server_still_has(error, watches):
    course, attempts = Course(MatchRequest()), Attempts(1, None)
    course.take(MatchResponse(accepted=MatchAccepted(match_id="m1"), number=4))
    assert course.pause_after(error, attempts) is not None
    assert course.watching == (WatchMatchRequest(match_id="m1", after=4) if watches else None)


def test_what_fails_again_and_what_cannot_go_on_is_told():
    course, attempts = Course(MatchRequest()), Attempts(3, None)
    course.take(MatchResponse(accepted=MatchAccepted(match_id="m1")))  # of a server without numbers
    assert course.pause_after(LOST, attempts) is None
    course.take(MatchResponse(scenes=MatchScenes(), number=2))
    assert course.pause_after(ServerFailedError("no"), attempts) is None
    watching = Course(None, "m1", 3)
    watching.take(MatchResponse(scenes=MatchScenes(), number=4))
    assert watching.pause_after(INTERRUPTED, attempts) is None
    assert watching.pause_after(LOST, attempts) is not None


def test_a_match_that_had_begun_is_worth_more_attempts_than_are_given_to_others():
    attempts = Attempts(1, None)
    for _ in range(20):
        assert attempts.pause_after(LOST, begun=True) <= 1.5
    assert attempts.pause_after(LOST) is not None
    assert attempts.pause_after(LOST) is None
    assert Attempts(3, 0.05).pause_after(LOST, begun=True) is None
    assert Attempts(0, None).pause_after(LOST, begun=True) is None


def test_an_answer_makes_pauses_short_again():
    attempts = Attempts(1, None)
    for _ in range(5):
        attempts.pause_after(LOST, begun=True)
    attempts.succeeded()
    assert attempts.pause_after(LOST, begun=True) <= 0.15
