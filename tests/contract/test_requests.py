"""The engine reads the golden requests as the values that they stand for."""

import pytest

from sketchmatch.app.setup import RequestLimits
from tests.contract.conversions import requests
from tests.contract.golden import NAMES, golden
from tests.contract.values import MATCHES, REGISTRY, SOURCES, plain


def test_every_golden_request_that_holds_something_is_read_here():
    named = {name for name in NAMES if name.startswith(("MatchRequest", "SegmentRequest"))}
    assert named - {"MatchRequest.stored"} == {*MATCHES, *SOURCES}


@pytest.mark.parametrize("name", MATCHES)
def test_a_request_to_match_is_read_field_by_field(name):
    assert plain(requests.match_request(golden(name), RequestLimits())) == plain(MATCHES[name])


@pytest.mark.parametrize("name", SOURCES)
def test_each_form_of_source_is_read(name):
    read = requests.source(golden(name).source, "source", True, REGISTRY.readers)
    assert plain(read) == plain(SOURCES[name])


def test_what_a_request_to_segment_chooses_is_read():
    chosen = requests.choice(golden("SegmentRequest").segmenter)
    assert chosen.name == "tracing"
    assert chosen.parameters == {"closing": 0.125, "mode": "neat"}


@pytest.mark.parametrize(("longest", "in_force"), [(1.5, 1.5), (4.5, 3.25)])
def test_the_shorter_time_budget_holds(longest, in_force):
    request = golden("MatchRequest")
    limits = RequestLimits(max_time_budget=longest, default_time_budget=9.0)
    assert requests.match_request(request, limits).time_budget == in_force


@pytest.mark.parametrize(
    ("longest", "default", "in_force"),
    [(4.5, None, 4.5), (4.5, 2.0, 2.0), (4.5, 9.0, 4.5), (None, 2.0, 2.0), (None, None, None)],
)
def test_the_servers_time_budget_holds_where_a_request_has_none(longest, default, in_force):
    limits = RequestLimits(max_time_budget=longest, default_time_budget=default)
    sparse = golden("MatchRequest.sparse")
    assert requests.match_request(sparse, limits).time_budget == in_force
