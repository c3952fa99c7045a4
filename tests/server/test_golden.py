"""A real server gives the golden answer about the golden scene, which is known beforehand."""

from math import pi

import grpc
import pytest

from sketchmatch_proto.v1.match_service_pb2_grpc import MatchServiceStub
from sketchmatch_proto.v1.scene_service_pb2 import SegmentRequest
from sketchmatch_proto.v1.scene_service_pb2_grpc import SceneServiceStub
from tests.contract.golden import as_json, as_written, golden
from tests.server.harness import kinds


@pytest.fixture(scope="module")
def channel(address):
    with grpc.insecure_channel(address) as channel:
        yield channel


def matched(channel, request):
    """Return all events but progress, by kind."""
    events = list(MatchServiceStub(channel).Match(request, timeout=120))
    return {
        kind: getattr(event, kind)
        for kind, event in zip(kinds(events), events, strict=True)
        if kind != "progress"
    }


@pytest.fixture(scope="module")
def answer(channel):
    return matched(channel, golden("MatchRequest.turned"))


def leaves(value, path=""):
    """Return every number and every text of a JSON value by its path."""
    if not isinstance(value, dict | list):
        return {path: value}
    items = value.items() if isinstance(value, dict) else enumerate(value)
    return {
        place: leaf for key, item in items for place, leaf in leaves(item, f"{path}/{key}").items()
    }


def is_close(found, expected):
    """Check that messages say the same, but for rounding."""
    found, expected = leaves(found), leaves(expected)
    assert found.keys() == expected.keys()
    for path, value in expected.items():
        is_number = isinstance(value, float | int) and not isinstance(value, bool)
        assert found[path] == (pytest.approx(value, abs=1e-9) if is_number else value), path


def test_the_result_is_the_known_one(answer):
    found = as_json(answer["result"])
    # Its name, what it cost and what the searcher says of itself are nobody's to know beforehand.
    for name in ("matchId", "statistics", "searchNote"):
        found.pop(name, None)
    is_close(found, as_written("MatchResponse.turned")["result"])


def test_the_scenes_are_those_that_were_sent_with_areas_and_centroids(answer):
    expected = as_written("MatchResponse.scenes")["scenes"]
    is_close(as_json(answer["scenes"]), {side: expected[side] for side in ("sketch", "map")})


def test_seed_and_weights_are_in_force_as_they_were_sent(answer):
    request, accepted = golden("MatchRequest.turned"), answer["accepted"]
    assert accepted.seed == request.seed
    assert accepted.weights == request.weights
    assert accepted.pipeline.searcher.name == "exact"
    assert accepted.pipeline.judge.name == "confidence"
    assert accepted.pipeline.histogram.parameters["directions"] == 36
    assert accepted.match_id == answer["result"].match_id != ""


def test_sketch_and_map_exchanged_turn_the_answer_back(channel):
    request = golden("MatchRequest.turned")
    request.sketch.CopyFrom(golden("MatchRequest.turned").map)
    request.map.CopyFrom(golden("MatchRequest.turned").sketch)
    result = matched(channel, request)["result"]
    lines = [
        (line.sketch_object, line.map_object, line.sketch_label, line.map_label)
        for line in result.object_matches
    ]
    assert lines == [(0, 1, "table", "desk"), (2, 0, "bunk", "bed"), (3, 2, "rack", "shelf")]
    assert list(result.unmatched_sketch_objects) == [1]
    assert list(result.unmatched_map_objects) == []
    assert result.rotation_radians == pytest.approx(-pi / 2)
    assert result.scale == pytest.approx(0.5)
    pairs = [(entry.sketch_pair, entry.map_pair) for entry in result.fmap_entries]
    assert [(a.first, a.second, c.first, c.second) for a, c in pairs] == [
        (2, 0, 0, 1),
        (2, 3, 0, 2),
        (0, 3, 1, 2),
    ]
    for entry in result.fmap_entries:
        assert entry.similarity == pytest.approx(1)
        assert entry.rotation_radians == pytest.approx(-pi / 2)
        assert entry.dilation == pytest.approx(0.5)


@pytest.mark.parametrize("side", ["sketch", "map"])
def test_segment_finds_the_same_objects(channel, side):
    request = SegmentRequest(source=getattr(golden("MatchRequest.turned"), side))
    found = SceneServiceStub(channel).Segment(request, timeout=60)
    is_close(as_json(found.scene), as_written("MatchResponse.scenes")["scenes"][side])
    assert found.segmenter.name == "polygons"
