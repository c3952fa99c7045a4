"""The client asks for stored scenes and sketches by golden messages, and reads golden answers."""

import inspect
from concurrent import futures

import grpc
import pytest

from sketchmatch_client import InvalidRequestError, NotFoundError, sources
from sketchmatch_proto.v1 import scene_service_pb2, sketch_service_pb2
from tests.client.test_golden import POLYGONS
from tests.contract.golden import golden

NAME, OTHER = "5f2b" * 16, "c07d" * 16
STREAM = [
    golden(f"WatchSketchResponse.{kind}")
    for kind in ("map", "objects", "progress", "result", "problem")
]


class Fake(grpc.GenericRpcHandler):
    """Answers each method with its golden response, and keeps the requests."""

    def __init__(self):
        self.requests, self.missing = [], False
        self.pages = [golden("ListScenesResponse")]
        self._methods = {
            f"/{service.full_name}/{method.name}": method
            for file in (scene_service_pb2, sketch_service_pb2)
            for service in file.DESCRIPTOR.services_by_name.values()
            for method in service.methods
        }

    def service(self, handler_call_details):
        method = self._methods.get(handler_call_details.method)
        if method is None:
            return None
        read = type(golden(method.input_type.name)).FromString

        def answer(request, context):
            self.requests.append(request)
            if self.missing:
                context.abort(grpc.StatusCode.NOT_FOUND, "there is none")
            if method.name == "ListScenes":
                return self.pages.pop(0)
            return golden(method.output_type.name)

        def stream(request, _):
            self.requests.append(request)
            yield from STREAM

        write = {"response_serializer": lambda message: message.SerializeToString()}
        if method.name == "WatchSketch":
            return grpc.unary_stream_rpc_method_handler(stream, request_deserializer=read, **write)
        return grpc.unary_unary_rpc_method_handler(answer, request_deserializer=read, **write)


@pytest.fixture
def fake():
    handler = Fake()
    server = grpc.server(futures.ThreadPoolExecutor(4), handlers=(handler,))
    handler.address = f"127.0.0.1:{server.add_insecure_port('127.0.0.1:0')}"
    server.start()
    yield handler
    server.stop(grace=None).wait()


def test_scenes_are_asked_for_and_answered(call, fake):
    params = {"closing": 0.125, "mode": "neat"}
    kept = call(
        fake.address,
        "put_scene",
        POLYGONS,
        segmenter="tracing",
        params=params,
        profile="careful",
        title="snack bar",
    )
    got = call(fake.address, "get_scene", NAME, include_source=True)
    labelled = call(fake.address, "update_scene", NAME, {1: "rack", 3: ""}, title="rack room")
    assert call(fake.address, "delete_scene", OTHER) is None
    assert fake.requests == [
        golden(f"{method}SceneRequest") for method in ("Put", "Get", "Update", "Delete")
    ]
    assert (kept, got) == (golden("PutSceneResponse"), golden("GetSceneResponse"))
    assert labelled == golden("UpdateSceneResponse").stored_scene


def test_all_pages_of_a_list_are_one(call, fake):
    last = golden("ListScenesResponse")
    last.next_page_token = ""
    fake.pages.append(last)
    found = call(fake.address, "list_scenes")
    assert [each.name for each in found] == [NAME, OTHER, NAME, OTHER]
    first, second = fake.requests
    assert (first.page_token, second.page_token) == (
        "",
        golden("ListScenesResponse").next_page_token,
    )


def test_a_stored_scene_is_a_source():
    stored = golden("MatchRequest.stored")
    assert sources.stored_scene(NAME) == stored.sketch
    assert sources.stored_scene(OTHER) == stored.map


@pytest.fixture(params=["Client", "AsyncClient"])
def drawn(request, fake):
    """What a sketch answers, and the events of its stream."""
    import asyncio

    import sketchmatch_client

    async def waited(value):
        return await value if inspect.isawaitable(value) else value

    async def draw():
        client = getattr(sketchmatch_client, request.param)(fake.address, timeout=30)
        options = {"searcher": "guessing", "seed": 2**53 + 1, "alternatives": 5}
        map_ = sources.stored_scene(NAME)
        sketch = await waited(client.sketch(map_, y_axis="down", **options))
        answer = await waited(
            sketch.update(
                {"s7": [(1.5, 2.5, 0.25), (3.5, 4.75, 0.5)], "s9": [(7.5, -8.5)]},
                erase=["s3", "s4"],
                restore=12,
                labels={"s7": "sofa"},
                pins={"sofa": 3},
            )
        )
        watching = sketch.watch()
        if hasattr(watching, "__aiter__"):
            events = [event async for event in watching]
        else:
            events = list(watching)
        await waited(sketch.delete())
        fake.missing = True
        await waited(sketch.delete())  # which it was before
        with pytest.raises(NotFoundError, match="there is none"):
            await waited(sketch.update())
        await waited(client.close())
        return sketch.id, answer, events

    return asyncio.run(draw())


def test_a_sketch_is_drawn_and_watched(drawn, fake):
    name, answer, events = drawn
    assert name == golden("CreateSketchResponse").sketch_id
    assert answer == golden("UpdateSketchResponse")
    assert events == STREAM
    asked = ["CreateSketch", "UpdateSketch", "WatchSketch", "DeleteSketch"]
    assert fake.requests[:4] == [golden(f"{method}Request") for method in asked]


@pytest.mark.parametrize(
    ("method", "arguments", "field"),
    [
        ("get_scene", [7], "name"),
        ("delete_scene", [None], "name"),
        ("update_scene", [NAME, "rack"], "labels"),
        ("update_scene", [NAME, {"first": "rack"}], "labels"),
        ("update_scene", [NAME, {-1: "rack"}], "labels"),
    ],
)
def test_what_is_of_the_wrong_form_is_refused_in_one_sentence(call, fake, method, arguments, field):
    with pytest.raises(InvalidRequestError) as caught:
        call(fake.address, method, *arguments)
    assert caught.value.field == field
    assert fake.requests == []


def test_a_name_of_a_scene_is_text():
    with pytest.raises(InvalidRequestError, match="stored_scene is 7; give the name of a scene"):
        sources.stored_scene(7)
