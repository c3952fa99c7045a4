import asyncio
import gc
import time
from contextlib import aclosing, closing
from datetime import timedelta
from threading import Timer

import grpc
import pytest
from grpc_health.v1 import health_pb2

from sketchmatch_client import AsyncClient, Client, ServerUnavailableError, sources
from sketchmatch_client.errors import (
    DeadlineExceededError,
    InvalidRequestError,
    ServerBusyError,
    ServerFailedError,
    SketchmatchError,
)
from tests.client.fake_server import EVENTS, reason, retry_after, running, violation
from tests.contract.golden import KINDS
from tests.pace import within

TRIANGLE = [(0, 0), (2, 0), (2, 1)]
SKETCH = sources.strokes([TRIANGLE, TRIANGLE], y_axis="down")
MAP = sources.polygons([TRIANGLE, TRIANGLE])


class TestMatch:
    def test_returns_the_answer_and_what_it_is_about(self, call, server):
        match = call(server.address, "match", SKETCH, MAP)
        assert match.accepted == EVENTS[0].accepted
        assert match.scenes == EVENTS[1].scenes
        assert match.result == EVENTS[-1].result
        assert match.object_map == {0: 2, 1: 0}

    def test_reports_progress_and_skips_unknown_events(self, call, server):
        seen = []
        call(server.address, "match", SKETCH, MAP, on_progress=seen.append)
        assert [progress.confidence for progress in seen] == [0.5, 0.75]

    def test_a_callback_that_raises_ends_the_match(self, call, server):
        def give_up(_progress):
            raise RuntimeError("seen enough")

        server.endless = True
        with pytest.raises(RuntimeError, match="seen enough"):
            call(server.address, "match", SKETCH, MAP, on_progress=give_up)
        assert server.cancelled.wait(5)

    def test_a_stream_without_a_result_is_an_error(self, call, server):
        server.events = EVENTS[:2]
        with pytest.raises(ServerFailedError, match="without a result"):
            call(server.address, "match", SKETCH, MAP)


class TestRequest:
    def test_leaves_everything_to_the_server(self, call, server):
        call(server.address, "match", SKETCH, MAP)
        (request,) = server.requests
        assert (request.sketch, request.map) == (SKETCH, MAP)
        assert not request.HasField("seed")
        assert not request.HasField("time_budget")
        assert not request.HasField("weights")
        assert not request.pipeline.ListFields()

    def test_carries_every_option(self, call, server):
        call(
            server.address,
            "match",
            SKETCH,
            MAP,
            searcher="easm",
            map_segmenter="polygons",
            params={"searcher": {"population": 200}, "histogram": {"directions": 90}},
            seed=2**64 - 1,
            time_budget=2.5,
            weights=(1, 0, 0.5),
            profile="proof",
        )
        (request,) = server.requests
        pipeline = request.pipeline
        assert pipeline.searcher.name == "easm"
        assert pipeline.searcher.parameters["population"] == 200
        assert pipeline.map_segmenter.name == "polygons"
        assert pipeline.histogram.name == ""
        assert pipeline.histogram.parameters["directions"] == 90
        assert not pipeline.HasField("similarity")
        assert pipeline.profile == "proof"
        assert request.seed == 2**64 - 1
        assert request.time_budget.ToTimedelta() == timedelta(seconds=2.5)
        weights = request.weights
        assert (weights.similarity, weights.rotation, weights.dilation) == (1, 0, 0.5)
        assert weights.HasField("rotation")
        assert not weights.HasField("shape")

    def test_carries_whether_objects_may_stay_unmatched(self, call, server):
        call(server.address, "match", SKETCH, MAP, allow_unmatched=False)
        call(server.address, "match", SKETCH, MAP, allow_unmatched=True, unmatched_price=0.5)
        without, allowing = server.requests
        assert without.HasField("allow_unmatched")
        assert not without.allow_unmatched
        assert not without.HasField("unmatched_price")
        assert allowing.allow_unmatched
        assert allowing.unmatched_price == 0.5

    def test_carries_what_is_known_of_objects(self, call, server):
        pins = {"old desk": 3, 0: "sofa", 5: None}
        call(server.address, "match", SKETCH, MAP, pins=pins, synonyms=[("couch", "sofa")])
        (request,) = server.requests
        first, second, third = request.pins
        assert (first.sketch_object.label, first.map_object.index) == ("old desk", 3)
        assert (second.sketch_object.index, second.map_object.label) == (0, "sofa")
        assert second.sketch_object.HasField("index")
        assert third.sketch_object.index == 5
        assert not third.HasField("map_object")
        assert not any(pin.excluded for pin in request.pins)
        assert [list(group.labels) for group in request.synonyms] == [["couch", "sofa"]]

    def test_carries_weights_of_shape_size_and_distance(self, call, server):
        for given in ((1, 2, 3, 0.5, 0), (1, 2, 3, 0.5, 0, 1.5)):
            call(server.address, "match", SKETCH, MAP, weights=given)
        five, six = (request.weights for request in server.requests)
        assert (five.dilation, five.shape, five.size) == (3, 0.5, 0)
        assert five.HasField("size")
        assert not five.HasField("distance")
        assert (six.shape, six.size, six.distance) == (0.5, 0, 1.5)

    @pytest.mark.parametrize(
        ("options", "sentence"),
        [
            ({"seed": -1}, "seed is -1; give an integer 0 … 2**64 − 1"),
            ({"seed": 2**64}, "seed is 18446744073709551616; give an integer"),
            ({"seed": "one"}, "seed is 'one'; give an integer"),
            ({"time_budget": "1 s"}, "time_budget is '1 s'; give a positive time"),
            ({"time_budget": float("nan")}, "time_budget is nan; give a positive time"),
            ({"time_budget": float("inf")}, "time_budget is inf; give a positive time"),
            ({"allow_unmatched": "yes"}, "allow_unmatched is 'yes'; give True or False"),
            ({"unmatched_price": "dear"}, "unmatched_price is 'dear'; give a number"),
            ({"pins": 5}, "pins is 5; give a dict from sketched to mapped objects, or Pin"),
            ({"pins": [(0, 1)]}, "pins is [(0, 1)]; give a dict"),
            ({"pins": {-1: 2}}, "pins is {-1: 2}; give a dict"),
            ({"pins": {True: 2}}, "pins is {True: 2}; give a dict"),
            ({"pins": {0: 1.5}}, "pins is {0: 1.5}; give a dict"),
            ({"synonyms": "couch"}, "synonyms is 'couch'; give groups of labels"),
            ({"synonyms": ["couch"]}, "synonyms is ['couch']; give groups of labels"),
            ({"synonyms": [(1, 2)]}, "synonyms is [(1, 2)]; give groups of labels"),
            ({"weights": (1, 1)}, "weights is (1, 1); give three numbers"),
            ({"weights": "abc"}, "weights is 'abc'; give three numbers"),
            (
                {"weights": (1, 1, 1, 1)},
                "weights is (1, 1, 1, 1); give three numbers, similarity, rotation, dilation, or",
            ),
            ({"weights": (1,) * 7}, "weights is (1, 1, 1, 1, 1, 1, ...); give three numbers"),
            ({"params": {"serch": {}}}, "params has no stage 'serch'; the stages are sketch_seg"),
            ({"params": {5: {}}}, "params has no stage 5; the stages are sketch_segmenter"),
            ({"params": 5}, "params is 5; give a dict"),
            ({"params": [("searcher", {})]}, "params is [('searcher', {})]; give a dict"),
            ({"params": {"searcher": 5}}, "pipeline.searcher.parameters is 5; give a dict"),
            ({"searcher": 5}, "pipeline.searcher.name is 5; give the name of an algorithm"),
            ({"map_segmenter": ["rooms"]}, "pipeline.map_segmenter.name is ['rooms']; give the na"),
            ({"searcher": "\ud800"}, "pipeline.searcher.name is '\\ud800'; give the name"),
            ({"profile": 5}, "profile is 5; give the name of a profile"),
            (
                {"params": {"searcher": {"population": object()}}},
                "pipeline.searcher.parameters holds a value that is not JSON",
            ),
        ],
    )
    def test_refuses_what_cannot_be_sent(self, call, server, options, sentence):
        with pytest.raises(InvalidRequestError) as caught:
            call(server.address, "events", SKETCH, MAP, **options)
        assert str(caught.value).startswith(sentence)
        assert caught.value.reason == "INVALID_FIELD"
        assert not server.requests

    @pytest.mark.parametrize("given", [None, "sketch.svg", TRIANGLE, 5])
    def test_refuses_what_is_no_source(self, call, server, given):
        remedy = "make a source of it with sketchmatch_client.sources"
        for sides in ((given, MAP), (SKETCH, given)):
            with pytest.raises(InvalidRequestError, match=remedy) as caught:
                call(server.address, "match", *sides)
            assert caught.value.field == ("sketch" if sides[0] is given else "map")
        with pytest.raises(InvalidRequestError, match=f"^source is .*; {remedy}"):
            call(server.address, "segment", given)

    def test_an_unknown_option_is_a_mistake_in_the_program(self, call, server):
        with pytest.raises(TypeError, match="unknown option 'serch'"):
            call(server.address, "match", SKETCH, MAP, serch="easm")


class TestEvents:
    def test_come_as_they_were_sent(self, call, server):
        assert call(server.address, "events", SKETCH, MAP) == list(EVENTS)

    def test_closing_cancels(self, server):
        server.endless = True
        with Client(server.address) as client, closing(client.events(SKETCH, MAP)) as events:
            assert next(events) == EVENTS[0]
            assert not server.cancelled.is_set()
            events.close()
            assert server.cancelled.wait(5)

    def test_leaving_the_loop_cancels(self, server):
        server.endless = True
        with Client(server.address) as client:
            for _event in client.events(SKETCH, MAP):
                break
            gc.collect()
            assert server.cancelled.wait(5)

    def test_closing_cancels_with_asyncio(self, server):
        async def first():
            async with AsyncClient(server.address) as client:
                async with aclosing(client.events(SKETCH, MAP)) as events:
                    event = await anext(events)
                return event, await asyncio.to_thread(server.cancelled.wait, 5)

        server.endless = True
        assert asyncio.run(first()) == (EVENTS[0], True)

    def test_cancelling_the_task_cancels(self, server):
        async def cancel_soon():
            async with AsyncClient(server.address) as client:
                task = asyncio.create_task(client.match(SKETCH, MAP))
                await asyncio.sleep(0.2)
                task.cancel()
                with pytest.raises(asyncio.CancelledError):
                    await task
                return await asyncio.to_thread(server.cancelled.wait, 5)

        server.endless = True
        assert asyncio.run(cancel_soon())


class TestOtherCalls:
    def test_an_async_client_may_be_made_before_its_loop(self, server):
        async def info(client):
            async with client:
                return await client.server_info()

        client = AsyncClient(server.address)
        assert asyncio.run(info(client)).api_version == "sketchmatch.v1"

    def test_segment(self, call, server):
        answer = call(
            server.address, "segment", MAP, segmenter="polygons", params={"tolerance": 0.1}
        )
        (request,) = server.requests
        assert request.source == MAP
        assert answer.segmenter.name == "polygons"
        assert answer.segmenter.parameters["tolerance"] == 0.1

    def test_segment_names_a_profile(self, call, server):
        call(server.address, "segment", MAP, profile="mine")
        assert server.requests[0].profile == "mine"

    def test_segment_leaves_the_segmenter_to_the_server(self, call, server):
        call(server.address, "segment", MAP)
        assert not server.requests[0].HasField("segmenter")

    def test_algorithms(self, call, server):
        assert call(server.address, "algorithms").algorithms[0].name == "easm"

    def test_server_info(self, call, server):
        assert call(server.address, "server_info").api_version == "sketchmatch.v1"


class TestWaitUntilServing:
    def test_returns_when_it_serves(self, call, server):
        call(server.address, "wait_until_serving")

    def test_says_whether_a_part_serves(self, call, server):
        server.health.set("searcher/easm", health_pb2.HealthCheckResponse.NOT_SERVING)
        assert call(server.address, "is_serving") is True
        assert call(server.address, "is_serving", "searcher/easm") is False
        for name in ("searcher/esm", "ζ" * 100):
            with pytest.raises(InvalidRequestError, match="which the server does not have") as no:
                call(server.address, "is_serving", name)
            assert no.value.field == "name"

    def test_asks_an_absent_server_in_vain(self, call, nobody):
        with pytest.raises(ServerUnavailableError):
            call(nobody, "is_serving")

    def test_waits_while_kernels_compile(self, call, server):
        server.set_health("NOT_SERVING")
        timer = Timer(0.3, server.set_health, ["SERVING"])
        timer.start()
        began = time.monotonic()
        call(server.address, "wait_until_serving", timeout=60)
        timer.join()
        assert time.monotonic() - began > 0.2

    def test_gives_up(self, call, server):
        server.set_health("NOT_SERVING")
        with pytest.raises(ServerUnavailableError, match=r"did not serve within 0\.2 s"):
            call(server.address, "wait_until_serving", timeout=0.2)

    def test_gives_up_where_nobody_listens(self, call, nobody):
        with pytest.raises(ServerUnavailableError, match=nobody):
            call(nobody, "wait_until_serving", timeout=0.3)


class TestErrors:
    @pytest.mark.parametrize(("code", "kind"), [line[1:3] for line in KINDS])
    @pytest.mark.parametrize("method", ["match", "segment"])
    def test_each_status_is_one_kind(self, call, server, method, code, kind):
        server.fail(grpc.StatusCode[code], "the server's own sentence", reason("PLUGIN_FAILED"))
        with pytest.raises(SketchmatchError, match="the server's own sentence") as caught:
            call(server.address, method, *[SKETCH, MAP][: 2 if method == "match" else 1])
        assert type(caught.value).__name__ == kind
        assert caught.value.reason == "PLUGIN_FAILED"

    def test_a_refused_request_names_its_field(self, call, server):
        sentence = "sketch.stroke_set.strokes[3] has one point; draw a line"
        server.fail(
            grpc.StatusCode.INVALID_ARGUMENT,
            sentence,
            reason("INVALID_STROKE"),
            violation("sketch.stroke_set.strokes[3]"),
        )
        with pytest.raises(InvalidRequestError) as caught:
            call(server.address, "match", SKETCH, MAP)
        assert str(caught.value) == sentence
        assert caught.value.reason == "INVALID_STROKE"
        assert caught.value.field == "sketch.stroke_set.strokes[3]"

    def test_a_busy_server_says_when_to_come_back(self, call, server):
        server.fail(
            grpc.StatusCode.RESOURCE_EXHAUSTED, "full", reason("LIMIT_EXCEEDED"), retry_after(3)
        )
        with pytest.raises(ServerBusyError) as caught:
            call(server.address, "match", SKETCH, MAP)
        assert caught.value.retry_after == 3.0

    def test_errors_without_details_are_translated_as_well(self, call, server):
        server.fail(grpc.StatusCode.INVALID_ARGUMENT, "no")
        with pytest.raises(InvalidRequestError) as caught:
            call(server.address, "match", SKETCH, MAP)
        assert (caught.value.reason, caught.value.field) == ("", "")

    def test_an_absent_server_is_noticed_at_once(self, call, nobody):
        with within(3.0), pytest.raises(ServerUnavailableError) as caught:
            call(nobody, "match", SKETCH, MAP)
        assert str(caught.value).startswith(
            f"the sketchmatch server at {nobody} is not available; start it, or check the address"
        )

    def test_a_server_without_tls_is_not_available_with_tls(self, server):
        credentials = grpc.ssl_channel_credentials()
        with (
            Client(server.address, credentials=credentials) as client,
            pytest.raises(ServerUnavailableError, match=server.address),
        ):
            client.server_info()

    def test_a_server_without_tls_is_not_available_with_tls_and_asyncio(self, server):
        async def info():
            async with AsyncClient(
                server.address, credentials=grpc.ssl_channel_credentials()
            ) as client:
                await client.server_info()

        with pytest.raises(ServerUnavailableError, match=server.address):
            asyncio.run(info())

    def test_a_timeout_ends_the_call(self, call, server):
        server.endless = True
        with pytest.raises(DeadlineExceededError, match="within the timeout; allow more time"):
            call(server.address, "match", SKETCH, MAP, timeout=0.2)

    def test_a_request_that_the_transport_refuses_is_too_large(self, call):
        with running(("grpc.max_receive_message_length", 100)) as server:
            big = sources.image(bytes(1000))
            with pytest.raises(InvalidRequestError, match="make it smaller") as caught:
                call(server.address, "match", big, big)
        assert caught.value.reason == "MESSAGE_TOO_LARGE"


@pytest.fixture
def nobody() -> str:
    """An address where nobody listens."""
    with running() as server:
        return server.address
