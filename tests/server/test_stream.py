import time

import numpy as np
import pytest
from google.protobuf.json_format import MessageToDict

import sketchmatch
from sketchmatch import Scene, read_scene
from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH
from sketchmatch.io import read_source
from sketchmatch_client import AsyncClient, Client, sources
from sketchmatch_proto.v1.match_pb2 import OUTCOME_TIME_BUDGET, MatchResult
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest
from sketchmatch_proto.v1.match_service_pb2_grpc import MatchServiceStub
from tests.server.harness import ENDLESS, in_loop, kinds, scene, shapes, turned


def timeless(result: MatchResult) -> MatchResult:
    """Return a result without what differs from run to run: its name and its times."""
    bare = MatchResult()
    bare.CopyFrom(result)
    bare.ClearField("match_id")
    for name in ("segment", "describe", "relate", "search", "total"):
        bare.statistics.ClearField(f"{name}_elapsed")
    return bare


def assert_same_answer(sent: MatchResult, local: sketchmatch.MatchResult) -> None:
    """Check that a match over gRPC found what one in process did, to the last bit."""
    assert sent.statistics.evaluations == local.statistics.evaluations
    assert (sent.seed, sent.search_note) == (local.seed, local.search_note)
    assert (sent.rotation_radians, sent.scale) == (local.rotation, local.scale)
    pairs = ((line.sketch_pair, line.map_pair) for line in sent.fmap_entries)
    assert [((a.first, a.second), (c.first, c.second)) for a, c in pairs] == [
        (line.sketch_pair, line.map_pair) for line in local.fmap
    ]
    maps = zip((sent, *sent.alternatives), (local, *local.alternatives), strict=True)
    for found, expected in maps:
        assert [
            (line.sketch_object, line.map_object, line.confidence) for line in found.object_matches
        ] == [(line.sketch_object, line.map_object, line.confidence) for line in expected.matches]
        assert found.fmap_confidence.total == expected.confidence.total
        assert found.omap_confidence == expected.omap_confidence


def living_room_strokes(y_axis: str = "up"):
    upward = 1.0 if y_axis == "up" else -1.0
    drawn = read_source(LIVING_ROOM_SKETCH).strokes
    return sources.strokes(
        [stroke.points * (1.0, upward) for stroke in drawn],
        [stroke.label for stroke in drawn],
        y_axis=y_axis,
    )


def drawn(size: int = 200) -> np.ndarray:
    """Return a picture with three dark rectangles on light paper, row 0 the highest."""
    pixels = np.full((size, size), 255, np.uint8)
    pixels[20:60, 20:50] = 0
    pixels[120:140, 30:110] = 0
    pixels[60:110, 140:180] = 0
    return pixels


def test_a_match_streams_accepted_then_scenes_then_progress_and_ends_with_the_result(address):
    with Client(address) as client:
        events = list(client.events(scene(8), scene(8, 1), **ENDLESS, time_budget=0.5, timeout=30))
    order = [kind for kind in kinds(events) if kind != "progress"]
    assert order == ["accepted", "scenes", "result"]
    assert kinds(events)[0] == "accepted"
    assert kinds(events)[-1] == "result"
    assert "progress" in kinds(events)[kinds(events).index("scenes") :]
    assert events[0].accepted.match_id == events[-1].result.match_id
    assert events[-1].result.outcome == OUTCOME_TIME_BUDGET


def test_accepted_echoes_every_algorithm_with_every_parameter(address):
    with Client(address) as client:
        accepted = client.match(
            scene(4),
            sources.map_server_map(LIVING_ROOM_MAP),
            searcher="easm",
            params={"searcher": {"population": 60}, "map_segmenter": {"min_size": 0.3}},
            seed=11,
            time_budget=20.0,
            weights=(1.0, 2.0, 0.5),
        ).accepted
        catalogue = {item.name: item for item in client.algorithms().algorithms}
    chosen = MessageToDict(accepted.pipeline, preserving_proto_field_name=True)
    assert {stage: choice["name"] for stage, choice in chosen.items()} == {
        "sketch_segmenter": "polygons",
        "map_segmenter": "occupancy-grid",
        "histogram": "constant",
        "similarity": "cross-correlation",
        "searcher": "easm",
        "judge": "posterior",
    }
    for choice in chosen.values():
        schema = MessageToDict(catalogue[choice["name"]].parameters_schema)
        assert choice.get("parameters", {}).keys() == schema.get("properties", {}).keys()
    assert chosen["searcher"]["parameters"]["population"] == 60
    assert chosen["searcher"]["parameters"]["mutation_rate"] == 0.3
    assert chosen["map_segmenter"]["parameters"]["min_size"] == 0.3
    assert accepted.seed == 11
    assert accepted.time_budget.ToTimedelta().total_seconds() == 20.0
    assert (accepted.weights.similarity, accepted.weights.rotation, accepted.weights.dilation) == (
        1.0,
        2.0,
        0.5,
    )


@pytest.mark.parametrize(
    "weights", [(1, 2, 0.5, 0.7, 0), (1, 1, 1, 0, 2), (1, 2, 0.5, 0.7, 0, 1.5)]
)
def test_objects_are_weighed_alike_in_process_and_over_grpc(address, weights):
    sketch, map_ = shapes(5), turned(shapes(6))
    local = sketchmatch.match(
        Scene.from_polygons(sketch), Scene.from_polygons(map_), weights=weights
    )
    with Client(address) as client:
        remote = client.match(sources.polygons(sketch), sources.polygons(map_), weights=weights)
    accepted, parts = remote.accepted.weights, remote.result.fmap_confidence
    sent = (accepted.shape, accepted.size, accepted.distance)
    assert sent == (*weights[3:], 0)[:3]
    assert_same_answer(remote.result, local)
    assert (parts.shape, parts.size) == (local.confidence.shape, local.confidence.size)


def test_without_weights_for_objects_their_parts_are_absent(address):
    with Client(address) as client:
        parts = client.match(scene(4), scene(5)).result.fmap_confidence
    assert not parts.HasField("shape")
    assert not parts.HasField("size")


def test_what_accepted_echoes_sent_again_gives_the_same_result(address):
    sketch, map_ = scene(6), scene(7, 1)
    with Client(address) as client:
        first = client.match(
            sketch, map_, searcher="easm", params={"searcher": {"population": 30}}, seed=4
        )
        echoed = MatchRequest(
            sketch=sketch,
            map=map_,
            pipeline=first.accepted.pipeline,
            seed=first.accepted.seed,
            weights=first.accepted.weights,
        )
        again = list(MatchServiceStub(client._channel).Match(echoed, timeout=30))
    assert timeless(again[-1].result) == timeless(first.result)


@pytest.mark.parametrize("seed", [0, 7, 2**64 - 1])
def test_the_same_request_with_the_same_seed_gives_the_same_answer_in_process_and_over_grpc(
    address, seed
):
    sketch, map_ = shapes(7), turned(shapes(9))
    params = {"searcher": {"population": 40, "consistency": "pairwise"}}
    local = sketchmatch.match(
        Scene.from_polygons(sketch),
        Scene.from_polygons(map_),
        searcher="easm",
        params=params,
        seed=seed,
        weights=(1, 2, 3),
    )
    with Client(address) as client:
        remote = client.match(
            sources.polygons(sketch),
            sources.polygons(map_),
            searcher="easm",
            params=params,
            seed=seed,
            weights=(1, 2, 3),
        )
    assert_same_answer(remote.result, local)
    assert remote.result.seed == seed


def test_the_blocking_and_the_asyncio_client_get_the_same_answer(address):
    async def asked():
        async with AsyncClient(address) as client:
            return await client.match(scene(6), scene(6, 1), seed=3)

    with Client(address) as client:
        blocking = client.match(scene(6), scene(6, 1), seed=3)
    assert timeless(in_loop(asked()).result(30).result) == timeless(blocking.result)


@pytest.mark.slow
def test_another_seed_searches_differently(address):
    with Client(address) as client:
        asked = {"searcher": "auto", "judge": "confidence"}
        answers = [
            client.match(scene(12), scene(12, 1), seed=seed, **asked).result for seed in (1, 2)
        ]
    assert answers[0].statistics.evaluations != answers[1].statistics.evaluations


@pytest.mark.parametrize("y_axis", ["up", "down"])
def test_strokes_give_the_scene_of_the_file_whichever_way_y_grows(address, y_axis):
    assert_same_scene(address, living_room_strokes(y_axis), LIVING_ROOM_SKETCH)


def test_a_map_server_map_gives_the_scene_of_the_files(address):
    assert_same_scene(address, sources.map_server_map(LIVING_ROOM_MAP), LIVING_ROOM_MAP)


def test_an_occupancy_grid_gives_the_scene_of_the_map_that_it_was_made_from(address):
    grid = read_source(LIVING_ROOM_MAP)
    sent = sources.occupancy_grid(grid.cells, grid.resolution, grid.origin)
    assert_same_scene(address, sent, LIVING_ROOM_MAP)


def test_an_image_gives_the_scene_of_the_file(address, tmp_path):
    import cv2

    path = tmp_path / "drawn.png"
    cv2.imwrite(str(path), drawn())
    assert_same_scene(address, sources.image(path), path)


def assert_same_scene(address, sent, path):
    """Check that a match over gRPC and Segment see the scene that a file holds in process."""
    with Client(address) as client:
        matched = client.match(sent, sent, searcher="easm", params={"searcher": {"generations": 1}})
        segmented = client.segment(sent)
    expected = [
        (item.label, [ring.tolist() for ring in item.rings], item.area, list(item.centroid))
        for item in read_scene(path).objects
    ]
    for found in (matched.scenes.sketch, matched.scenes.map, segmented.scene):
        assert [
            (item.label, list(map(corners, item.rings)), item.area, corner(item.centroid))
            for item in found.objects
        ] == expected


def corners(ring):
    return [corner(point) for point in ring.points]


def corner(point):
    return [point.x, point.y]


@pytest.mark.parametrize(("sketched", "mapped"), [(4, 7), (7, 4)])
def test_unequal_numbers_leave_the_rest_of_the_larger_scene_unmatched(address, sketched, mapped):
    polygons = shapes(7)
    with Client(address) as client:
        result = client.match(
            sources.polygons(polygons[:sketched]), sources.polygons(turned(polygons)[:mapped])
        ).result
    assert [(line.sketch_object, line.map_object) for line in result.object_matches] == [
        (k, k) for k in range(4)
    ]
    assert list(result.unmatched_sketch_objects) == list(range(4, sketched))
    assert list(result.unmatched_map_objects) == list(range(4, mapped))
    assert result.rotation_radians == pytest.approx(np.radians(40.0), abs=0.02)
    assert result.scale == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize(("sketched", "mapped"), [(5, 7), (7, 5), (2, 7)])
def test_each_matched_object_comes_with_its_relation_in_the_sketch(address, sketched, mapped):
    polygons = shapes(7)
    with Client(address) as client:
        events = list(
            client.events(
                sources.polygons(polygons[:sketched]), sources.polygons(turned(polygons)[:mapped])
            )
        )
    result, progress = events[-1].result, [event.progress for event in events[:-1]]
    drawn = Scene.from_polygons(polygons[:sketched])
    matched = {line.sketch_object for line in result.object_matches}
    assert len(matched) == min(sketched, mapped)
    for line in result.object_matches:
        assert line.HasField("relation")
        told = line.relation
        assert told.reference_object in matched - {line.sketch_object}
        pair = (drawn.objects[k] for k in (line.sketch_object, told.reference_object))
        expected = sketchmatch.directional_relation(sketchmatch.force_histogram(*pair))
        assert (told.phrase, told.degree) == (expected.phrase, pytest.approx(expected.degree))
    for part in [*progress, *result.alternatives]:
        assert not any(line.HasField("relation") for line in part.object_matches)


@pytest.mark.slow
def test_a_long_search_reports_progress_often_and_at_most_20_times_a_second(address):
    with Client(address) as client:
        started = time.monotonic()
        events = list(client.events(scene(30), scene(30, 1), **ENDLESS, time_budget=2.0))
        seconds = time.monotonic() - started
    progress = [event.progress for event in events if event.WhichOneof("event") == "progress"]
    assert len(progress) <= 20 * seconds + 1
    assert np.diff([elapsed(item) for item in progress]).min() >= 0.049
    assert len(progress) >= 12, "a person wants to see it move"


def test_progress_of_a_search_never_falls_and_carries_the_best_map_so_far(address):
    with Client(address) as client:
        events = list(client.events(scene(20), scene(25, 1), **ENDLESS, time_budget=1.0))
    searching = [e.progress for e in events if e.progress.HasField("confidence")]
    result = events[-1].result
    assert len(searching) >= 5
    assert_never_falls([item.confidence for item in searching])
    assert_never_falls([item.iteration for item in searching])
    assert searching[-1].confidence <= result.fmap_confidence.total + 1e-12
    for item in searching:
        assert [line.sketch_object for line in item.object_matches] == list(range(20))
        assert len({line.map_object for line in item.object_matches}) == 20


@pytest.mark.slow
@pytest.mark.parametrize("label", ["", "x" * 10_000], ids=["small events", "large events"])
def test_a_slow_reader_gets_the_latest_progress_and_misses_no_other_event(address, label):
    seconds, each, labels = 2.5, 0.25, [label] * 8
    events, lags = [], []
    with Client(address) as client:
        started = time.monotonic()
        for event in client.events(
            scene(8, 0, labels), scene(8, 1, labels), **ENDLESS, time_budget=seconds
        ):
            events.append(event)
            if event.WhichOneof("event") == "progress":
                lags.append(time.monotonic() - started - elapsed(event.progress))
            time.sleep(each)
    order = [kind for kind in kinds(events) if kind != "progress"]
    assert order == ["accepted", "scenes", "result"]
    progress = [event.progress for event in events if event.WhichOneof("event") == "progress"]
    assert_never_falls([elapsed(item) for item in progress])
    assert_never_falls([item.iteration for item in progress])
    # A dozen of the forty that a prompt reader gets, and a third of a second late; a loaded machine
    # may hold up both ends. Whoever reads all forty this slowly is seven seconds late in the end.
    assert 3 <= len(progress) <= 26, lags
    assert max(lags) < 3, lags


def assert_never_falls(values):
    assert values == sorted(values)


def elapsed(progress):
    return progress.elapsed.ToTimedelta().total_seconds()
