"""The engine's values become the golden responses, and its errors the golden statuses."""

from dataclasses import replace

import pytest
from google.rpc import code_pb2, status_pb2

import sketchmatch
from sketchmatch.app.archive import INTERRUPTED
from sketchmatch.app.orders import Wish
from sketchmatch.app.setup import RequestLimits, Setup
from sketchmatch.app.tasks import Record, State
from sketchmatch.errors import (
    AnswerUnavailableError,
    InvalidInputError,
    MatchCancelledError,
    MatchInterruptedError,
    NotFoundError,
    PluginError,
    Reason,
    StoreError,
    TooBusyError,
    WorkerLostError,
)
from sketchmatch.model.limits import SourceLimits
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.events import Phase, Progress
from sketchmatch_proto.v1.source_pb2 import MapServerMap
from tests.contract.conversions import responses, status
from tests.contract.golden import NAMES, as_json, as_written, golden
from tests.contract.values import (
    ACCEPTED,
    DEFAULTS,
    EVENTS,
    MATCHES,
    REGISTRY,
    SEGMENTATION,
    TRACING,
)

REFUSALS = {
    "Status.invalid_argument": status.refusal(
        InvalidInputError(
            Reason.INVALID_STROKE, "sketch.stroke_set.strokes[3]", "has one point; draw a line"
        )
    ),
    "Status.resource_exhausted": status.refusal(
        TooBusyError("the server is busy: 12 requests are running, which is its limit")
    ),
    "Status.deadline_exceeded": status.refusal(
        AnswerUnavailableError(
            "the time budget of 0.25 s ended in phase describe, before there was any answer"
        )
    ),
    "Status.unavailable": status.refusal(
        WorkerLostError("the worker ended its process (signal 9)", 2)
    ),
    "Status.not_found": status.refusal(
        NotFoundError("no match is called 6f1c; it ended long ago, or is another caller's")
    ),
    "Status.failed_precondition": status.refusal(
        StoreError(
            "the store's file /srv/matches.sqlite is full; delete what is not needed, or raise "
            "its size limit"
        )
    ),
    "Status.cancelled": status.refusal(MatchCancelledError("the match was cancelled")),
    "Status.interrupted": status.refusal(
        MatchInterruptedError("the match was stopped because no client was reading it any more")
    ),
    "Status.internal": status.refusal(
        PluginError("searcher guessing of acme-tiles 2.1 failed: it ended without any answer")
    ),
}


def test_every_golden_event_and_status_is_written_here():
    named = {name for name in NAMES if name.startswith(("MatchResponse.", "Status."))}
    others = {"MatchResponse.turned", "MatchResponse.numbered"}
    assert named - others == {*EVENTS, *REFUSALS}


def test_the_events_of_a_match_are_written_field_by_field():
    writer = responses.ResponseWriter(MATCHES["MatchRequest"])
    written = {name: as_json(writer.response(event)) for name, event in EVENTS.items()}
    assert written == {name: as_written(name) for name in EVENTS}


def test_a_time_budget_and_a_price_that_there_are_not_are_absent():
    writer = responses.ResponseWriter(MATCHES["MatchRequest.sparse"])
    expected = as_written("MatchResponse.accepted")
    del expected["accepted"]["timeBudget"], expected["accepted"]["unmatchedPrice"]
    expected["accepted"]["allowUnmatched"] = False
    assert as_json(writer.response(replace(ACCEPTED, unmatched_price=None))) == expected


def test_what_nobody_knows_yet_is_absent_from_progress():
    writer = responses.ResponseWriter(MATCHES["MatchRequest"])
    early = writer.response(Progress(Phase.DESCRIBE, 0.5))
    assert as_json(early) == {"progress": {"phase": "PHASE_DESCRIBE", "elapsed": "0.500s"}}


def test_what_a_segmenter_found_is_written():
    yaml = (
        "image: room.pgm\nresolution: 0.25\norigin: [-1.5, 2.25, 0.75]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    pgm = b"P2\n3 2\n255\n0 254 128\n254 0 254\n"
    map_ = MapServerMap(yaml=yaml, image=pgm, objects="{}", own_objects=True)
    written = responses.segmented(SEGMENTATION, TRACING, map_)
    assert as_json(written) == as_written("SegmentResponse")


def test_the_catalogue_is_written():
    written = responses.catalogue(REGISTRY, DEFAULTS)
    assert as_json(written) == as_written("ListAlgorithmsResponse")


def test_the_server_tells_versions_limits_and_its_age(monkeypatch):
    monkeypatch.setattr(sketchmatch, "__version__", "4.5.6")
    monkeypatch.setattr(responses, "API_VERSION", 3)
    engine = Engine(REGISTRY, limits=SourceLimits(max_objects=250))
    written = responses.server_info(
        Setup(engine, RequestLimits(1_048_576, 12, 90.5, 40, 7.5, max_waiting_bytes=5_000_000_000)),
        75.5,
        True,
    )
    assert as_json(written) == as_written("GetServerInfoResponse")


def test_limits_on_cost_and_on_callers_are_told():
    given = RequestLimits(
        default_time_budget=12.5,
        max_per_caller=3,
        max_per_minute=90,
        max_comparisons=81_000_000,
        max_candidates=2**53 + 1,
    )
    written = responses.server_info(Setup(Engine(REGISTRY), given), 0.0, False).limits
    for field, value in golden("GetServerInfoResponse.limits").limits.ListFields():
        assert getattr(written, field.name) == value


def test_what_is_known_of_a_match_is_written():
    expected = golden("GetMatchResponse")
    match = expected.match
    record = Record(
        "6f1c",
        "alice",
        Wish("3f0e-17"),
        State.SUCCEEDED,
        match.created_at.ToNanoseconds() / 1e9,
        match.ended_at.ToNanoseconds() / 1e9,
        match.outcome,
        events=tuple((event.number, unnumbered(event)) for event in expected.events),
    )
    assert responses.details(record) == expected
    failed = golden("ListMatchesResponse").matches[1]
    interrupted = replace(
        record,
        id=failed.match_id,
        wish=Wish(failed.request_id),
        state=State.INTERRUPTED,
        created=float(failed.created_at.seconds),
        ended=float(failed.ended_at.seconds),
        outcome=0,
        events=(*record.events[:1], (2, b"")),
        error=MatchInterruptedError(INTERRUPTED),
    )
    assert responses.summary(interrupted) == failed
    nobody = responses.summary(replace(record, error=ZeroDivisionError("secret"), ended=None))
    assert not nobody.HasField("ended_at")
    assert nobody.error_reason == ""
    assert "secret" not in nobody.error_message


def unnumbered(event):
    copy = type(event)()
    copy.CopyFrom(event)
    copy.ClearField("number")
    return copy.SerializeToString()


@pytest.mark.parametrize("name", REFUSALS)
def test_an_error_is_written_as_a_status(name):
    refusal, expected = REFUSALS[name], as_written(name)
    ((key, packed),) = refusal.trailing_metadata
    assert key == "grpc-status-details-bin"
    assert as_json(status_pb2.Status.FromString(packed)) == expected
    assert code_pb2.Code.Value(refusal.code.name) == expected["code"]
    assert refusal.message == expected["message"]
