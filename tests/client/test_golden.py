"""The client builds the golden requests from plain Python, and reads the golden responses."""

from datetime import timedelta

import grpc
import pytest

from sketchmatch_client import (
    CallCancelledError,
    DeadlineExceededError,
    InvalidRequestError,
    NotFoundError,
    Pin,
    ServerBusyError,
    ServerFailedError,
    ServerUnavailableError,
    SketchmatchError,
    StoreError,
    sources,
)
from sketchmatch_proto.v1.match_service_pb2 import ListMatchesResponse
from tests.contract.golden import KINDS, NAMES, golden

BAR = [[(2, 12), (8, 12), (8, 20), (2, 20)], [(3, 17), (5, 17), (5, 13), (3, 13)]]
PICTURE = b"P2\n3 2\n255\n0 64 128 192 224 255\n"
SHEET = b"1.5 2.5 4.5 3.5 0.5 6.5"
YAML = """\
image: room.pgm
resolution: 0.25
origin: [-1.5, 2.25, 0.75]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""

STROKES = sources.strokes(
    [
        [(1.5, 2.5, 0.25), (3.5, 4.75, 0.5), (5.25, 0.125, 0.875)],
        [(7.5, -8.5), (9.25, 6.5)],
    ],
    ["sofa", "route"],
    y_axis="down",
)
RINGS = [BAR, [(1.5, 2.5), (4.5, 3.5), (0.5, 6.5)]]
POLYGONS = sources.polygons(RINGS, ["bar", ""], y_axis="down")
DOUBTFUL = sources.polygons(RINGS, ["bar", ""], y_axis="down", certainties=[None, 0.375])
GRID = sources.occupancy_grid([[0, 100, -1], [0, 100, 30]], 0.05, (-1.5, 2.25, 0.75))
MATCHES = {
    "MatchRequest": (
        STROKES,
        GRID,
        {
            "sketch_segmenter": "tracing",
            "map_segmenter": "tiling",
            "histogram": "compass",
            "similarity": "alikeness",
            "searcher": "guessing",
            "judge": "weighing",
            "params": {
                "sketch_segmenter": {"closing": 0.125, "mode": "neat"},
                "map_segmenter": {"least": None, "walls": True},
                "histogram": {"directions": 36},
                "similarity": {"shares": [0.5, "rest", False]},
                "searcher": {"limits": {"rounds": 9, "quiet": True}},
                "judge": {"scales": ["gold", 2.5]},
            },
            "profile": "careful",
            "seed": 2**53 + 1,
            "time_budget": 3.25,
            "weights": (1.5, 2.5, 0.75, 0.5, 0.25, 1.25),
            "alternatives": 5,
            "allow_unmatched": True,
            "unmatched_price": 0.4375,
            "pins": [Pin("sofa", 3), Pin(0, "couch", excluded=True), Pin(2, None)],
            "synonyms": [("couch", "sofa", "settee"), ("desk", "bureau")],
        },
    ),
    "MatchRequest.sparse": (
        sources.image(PICTURE),
        sources.polygons([[(1, 2), (4, 2), (4, 8)], [(5, 3), (9, 3), (9, 6)]]),
        {
            "params": {"searcher": {"rounds": 4}},
            "weights": (0.5, 0, 2),
            "allow_unmatched": False,
        },
    ),
    "MatchRequest.named": (
        sources.polygons([[(1, 2), (4, 2), (4, 8)]]),
        sources.polygons([[(5, 3), (9, 3), (9, 6)]]),
        {"request_id": "3f0e-17", "keep_running": True, "priority": "high"},
    ),
    "MatchRequest.turned": (
        sources.polygons(
            [
                [(1, -1), (5, -1), (5, -3), (1, -3)],
                [(7, -2), (9, -2), (9, -5), (7, -5)],
                [(2, -6), (3, -6), (3, -11), (2, -11)],
            ],
            ["bed", "desk", "shelf"],
            y_axis="down",
        ),
        sources.polygons(
            [
                [(22, 14), (28, 14), (28, 18), (22, 18)],
                BAR,
                [(26, 2), (30, 2), (30, 10), (26, 10)],
                [(10, 4), (20, 4), (20, 6), (10, 6)],
            ],
            ["table", "bar", "bunk", "rack"],
        ),
        {
            "params": {"histogram": {"directions": 36}},
            "searcher": "exact",
            "judge": "confidence",
            "seed": 7,
            "weights": (1, 2, 3, 0.5, 0.25, 1.5),
            "alternatives": 2,
        },
    ),
}


@pytest.fixture
def map_files(tmp_path):
    """A map as map_server saves it."""
    (tmp_path / "room.pgm").write_bytes(b"P2\n3 2\n255\n0 254 128\n254 0 254\n")
    (tmp_path / "room.yaml").write_text(YAML, encoding="utf-8")
    return tmp_path / "room.yaml"


def asked(server, options):
    """Return what was asked for; a name that the client made itself is nobody's to know."""
    for request in server.requests:
        if "request_id" not in options:
            request.ClearField("request_id")
    return server.requests


class TestRequests:
    @pytest.mark.parametrize("name", MATCHES)
    def test_a_match_is_asked_for(self, call, server, name):
        sketch, map_, options = MATCHES[name]
        call(server.address, "match", sketch, map_, **options)
        assert asked(server, options) == [golden(name)]

    def test_a_time_budget_may_be_a_timedelta(self, call, server):
        options = MATCHES["MatchRequest"][2] | {"time_budget": timedelta(seconds=3.25)}
        call(server.address, "match", STROKES, GRID, **options)
        assert asked(server, options) == [golden("MatchRequest")]

    def test_each_match_has_a_name_of_its_own(self, call, server):
        for _ in range(2):
            call(server.address, "match", STROKES, GRID)
        first, second = (request.request_id for request in server.requests)
        assert first != second
        assert min(len(first), len(second)) >= 32

    def test_a_match_is_asked_for_by_its_name(self, call, server):
        call(server.address, "get_match", "6f1c")
        call(server.address, "cancel_match", "6f1c")
        call(server.address, "watch", "6f1c", 2)
        names = ["GetMatchRequest", "CancelMatchRequest", "WatchMatchRequest"]
        assert server.requests == [golden(name) for name in names]

    def test_each_page_of_matches_is_asked_for_where_the_one_before_ends(self, call, server):
        server.pages = [golden("ListMatchesResponse"), ListMatchesResponse()]
        found = call(server.address, "matches")
        assert found == list(golden("ListMatchesResponse").matches)
        tokens = [request.page_token for request in server.requests]
        assert tokens == ["", golden("ListMatchesResponse").next_page_token]

    def test_a_segmentation_is_asked_for_with_a_segmenter(self, call, server):
        params = {"closing": 0.125, "mode": "neat"}
        call(
            server.address,
            "segment",
            DOUBTFUL,
            segmenter="tracing",
            params=params,
            profile="careful",
            include_map=True,
        )
        assert server.requests == [golden("SegmentRequest")]

    def test_each_other_form_of_source_is_sent(self, call, server, map_files):
        sent = {
            "stroke_set": sources.strokes([[(1.5, 2.5), (3.5, 4.75), (5.25, 0.125)]], ["lamp"]),
            "occupancy_grid": sources.occupancy_grid([[0, 100], [-1, 0], [100, 30]], 0.125),
            "map_server_map": sources.map_server_map(map_files),
            "image": sources.image(PICTURE),
            "file": sources.file(SHEET, name="room.sheet", part="cellar"),
        }
        mended = golden("SegmentRequest.mended_map").source.map_server_map.objects
        map_files.with_suffix(".objects.geojson").write_text(mended, encoding="utf-8")
        with pytest.warns(UserWarning, match="objects"):
            sent["mended_map"] = sources.map_server_map(map_files)
        for source in sent.values():
            call(server.address, "segment", source)
        names = [f"SegmentRequest.{kind}" for kind in sent]
        assert server.requests == [golden(name) for name in names]
        assert {*names, "SegmentRequest"} == {n for n in NAMES if n.startswith("SegmentRequest")}

    def test_the_catalogue_and_the_servers_info_are_asked_for(self, call, server):
        call(server.address, "algorithms")
        call(server.address, "server_info")
        asked = ["ListAlgorithmsRequest", "GetServerInfoRequest"]
        assert server.requests == [golden(name) for name in asked]


class TestResponses:
    STREAM = tuple(
        golden(f"MatchResponse.{kind}") for kind in ("accepted", "scenes", "progress", "result")
    )

    def test_a_stream_becomes_a_match(self, call, server):
        server.events = self.STREAM
        seen = []
        match = call(server.address, "match", STROKES, GRID, on_progress=seen.append)
        accepted, scenes, progress, result = self.STREAM
        assert match.accepted == accepted.accepted
        assert match.scenes == scenes.scenes
        assert seen == [progress.progress]
        assert match.result == result.result
        assert match.object_map == {1: 3, 2: 0}

    def test_its_numbers_are_those_that_are_written(self, call, server):
        server.events = self.STREAM
        match = call(server.address, "match", STROKES, GRID)
        result = match.result
        assert match.accepted.seed == result.seed == 2**53 + 1
        assert (result.scale, result.rotation_radians) == (2.125, 1.75)
        assert result.statistics.total_elapsed.ToTimedelta() == timedelta(seconds=2.625)
        assert match.scenes.map.objects[1].centroid.y == 16.2
        assert match.accepted.pipeline.sketch_segmenter.parameters["mode"] == "neat"

    def test_the_turned_scene_has_its_object_map(self, call, server):
        server.events = (golden("MatchResponse.turned"),)
        match = call(server.address, "match", STROKES, GRID)
        assert match.object_map == {0: 2, 1: 0, 2: 3}

    def test_the_answers_of_the_other_methods_are_those_that_were_sent(self, call, server):
        server.segments = golden("SegmentResponse")
        server.catalogue = golden("ListAlgorithmsResponse")
        server.info = golden("GetServerInfoResponse")
        assert call(server.address, "segment", GRID) == server.segments
        assert call(server.address, "algorithms") == server.catalogue
        assert call(server.address, "server_info") == server.info


def test_every_code_has_a_kind():
    codes = {(str(code.value[0]), code.name) for code in grpc.StatusCode} - {("0", "OK")}
    assert {(number, code) for number, code, _, _ in KINDS} == codes


class TestStatuses:
    @pytest.fixture
    def error(self, call, server, request):
        """What a call raises where the server answers with a golden status."""
        server.error = golden(f"Status.{request.param}")
        with pytest.raises(SketchmatchError) as caught:
            call(server.address, "match", STROKES, GRID)
        assert str(caught.value) == server.error.message
        return caught.value

    @pytest.mark.parametrize("error", ["invalid_argument"], indirect=True)
    def test_a_request_that_cannot_be_used_names_its_field(self, error):
        assert type(error) is InvalidRequestError
        assert error.reason == "INVALID_STROKE"
        assert error.field == "sketch.stroke_set.strokes[3]"

    @pytest.mark.parametrize("error", ["resource_exhausted"], indirect=True)
    def test_a_busy_server_says_when_to_come_back(self, error):
        assert type(error) is ServerBusyError
        assert error.reason == "LIMIT_EXCEEDED"
        assert error.retry_after == 1.0

    @pytest.mark.parametrize("error", ["unavailable"], indirect=True)
    def test_a_server_that_lost_a_worker_says_when_to_send_again(self, error):
        assert type(error) is ServerUnavailableError
        assert error.reason == "WORKER_LOST"
        assert error.retry_after == 2.0

    @pytest.mark.parametrize("error", ["deadline_exceeded"], indirect=True)
    def test_a_time_budget_that_was_too_short_keeps_the_servers_sentence(self, error):
        assert type(error) is DeadlineExceededError
        assert error.reason == "TIME_BUDGET_EXHAUSTED"

    @pytest.mark.parametrize("error", ["not_found"], indirect=True)
    def test_what_the_server_does_not_keep_is_not_found(self, error):
        assert type(error) is NotFoundError
        assert error.reason == "NOT_FOUND"

    @pytest.mark.parametrize("error", ["failed_precondition"], indirect=True)
    def test_a_store_that_fails_is_said(self, error):
        assert type(error) is StoreError
        assert error.reason == "STORE_UNAVAILABLE"

    @pytest.mark.parametrize("error", ["cancelled"], indirect=True)
    def test_a_match_that_was_cancelled_elsewhere_is_said(self, error):
        assert type(error) is CallCancelledError
        assert error.reason == "MATCH_CANCELLED"

    @pytest.mark.parametrize("error", ["interrupted"], indirect=True)
    def test_a_match_that_was_interrupted_may_be_sent_again(self, error):
        assert type(error) is ServerUnavailableError
        assert error.reason == "MATCH_INTERRUPTED"
        assert error.retry_after == 1.0

    @pytest.mark.parametrize("error", ["internal"], indirect=True)
    def test_a_plugin_that_failed_is_the_servers_fault(self, error):
        assert type(error) is ServerFailedError
        assert error.reason == "PLUGIN_FAILED"
