"""Progress is sent less often the longer a match runs, so that slow readers catch up."""

from itertools import pairwise
from types import SimpleNamespace

import grpc
import pytest

from sketchmatch.server import pacing as module
from sketchmatch.server.pacing import Pacing
from sketchmatch_client import match_request
from sketchmatch_proto.v1.match_service_pb2_grpc import MatchServiceStub
from tests.server.harness import ENDLESS, scene


def sent_until(seconds, monkeypatch):
    """Return the times at which progress that comes 20 times a second is sent."""
    clock = [100.0]
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    pacing, times = Pacing(), []
    for k in range(20 * seconds):
        clock[0] = 100.0 + k / 20
        if pacing.is_due():
            times.append(k / 20)
    return times


def test_in_the_first_second_all_of_it_is_sent(monkeypatch):
    assert len(sent_until(1, monkeypatch)) == 20


def test_later_it_is_sent_once_a_second(monkeypatch):
    times = sent_until(60, monkeypatch)
    pauses = [after - before for before, after in pairwise(times)]
    assert max(pauses) < 1.06
    assert min(pauses[-30:]) > 0.99


def test_who_reads_two_a_second_is_not_behind_after_a_minute(monkeypatch):
    read = 0.0
    lags = []
    for sent in sent_until(120, monkeypatch):
        read = max(read, sent) + 0.5
        lags.append(read - sent)
    assert max(lags) > 5.0
    assert max(lags[-30:]) == 0.5


@pytest.mark.slow
def test_a_foreign_client_gets_less_of_it_as_time_goes_by(address):
    request = match_request(scene(8), scene(8, 1), **ENDLESS, time_budget=5.0)
    with grpc.insecure_channel(address) as channel:
        events = list(MatchServiceStub(channel).Match(request, timeout=60))
    told = [event.progress.elapsed.ToTimedelta().total_seconds() for event in events[2:-1]]
    assert 1 <= sum(seconds > 4 for seconds in told) <= 7
    assert sum(seconds < 1 for seconds in told) >= 10
    assert events[-1].HasField("result")
