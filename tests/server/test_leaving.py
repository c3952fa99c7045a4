"""Who leaves a request about a scene, a sketch or a transfer frees the place that it took."""

import time

import grpc
import pytest

from sketchmatch_builtin.segmenters.polygons import PolygonSegmenter
from sketchmatch_client import Client, match_request, transfer_request
from sketchmatch_client.features import point
from sketchmatch_proto.v1.scene_service_pb2 import PutSceneRequest, SegmentRequest
from sketchmatch_proto.v1.sketch_service_pb2 import (
    CreateSketchRequest,
    UpdateSketchRequest,
    WatchSketchRequest,
)
from sketchmatch_proto.v1.sketch_service_pb2_grpc import SketchServiceStub
from tests.pace import wait_until
from tests.server.harness import ENDLESS, hosting, scene, serving_setup, when_there_is_room

SCENE = scene(4)


class PonderingSegmenter(PolygonSegmenter):
    """Takes its time, however fast the machine is."""

    name = "pondering"

    def segment(self, source):
        time.sleep(1.0)
        return super().segment(source)


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """The address of a server with one place, which keeps scenes."""
    setup = serving_setup(
        PonderingSegmenter, max_concurrent_matches=1, max_waiting=0, max_time_budget=600.0
    )
    with hosting(setup, store=tmp_path_factory.mktemp("state") / "store") as host:
        yield host.address


def long(method):
    """Return the path of a method, and a request with which it takes long."""
    match method:
        case "Transfer":
            asked = transfer_request(scene(8, 0), scene(8, 1), [point(0, 0)], **ENDLESS)
            return "/sketchmatch.v1.TransferService/Transfer", asked
        case "CreateSketch":
            asked = CreateSketchRequest()
            asked.match.map.CopyFrom(SCENE)
            asked.match.pipeline.map_segmenter.name = "pondering"
            return "/sketchmatch.v1.SketchService/CreateSketch", asked
    kind = PutSceneRequest if method == "PutScene" else SegmentRequest
    asked = kind(source=SCENE, segmenter={"name": "pondering"})
    return f"/sketchmatch.v1.SceneService/{method}", asked


def assert_there_is_room(address):
    """Check that the one place is free again, soon, and used as before."""
    with Client(address, timeout=60) as client:
        found = when_there_is_room(lambda: client.match(SCENE, SCENE))
        assert len(found.result.object_matches) == 4


@pytest.mark.parametrize("method", ["Transfer", "CreateSketch", "PutScene", "Segment"])
@pytest.mark.parametrize("leaves", ["by its deadline", "by cancelling"])
def test_who_leaves_frees_the_place(address, method, leaves):
    path, asked = long(method)
    with grpc.insecure_channel(address) as channel:
        call = channel.unary_unary(path)
        timeout = 0.3 if leaves == "by its deadline" else 60.0
        answer = call.future(asked.SerializeToString(), timeout=timeout)
        if leaves == "by cancelling":
            time.sleep(0.3)
            answer.cancel()
        wait_until(answer.done, "it is not ended")
        expected = "DEADLINE_EXCEEDED" if leaves == "by its deadline" else "CANCELLED"
        assert answer.code().name == expected
    assert_there_is_room(address)


@pytest.mark.parametrize("leaves", ["by its deadline", "by cancelling"])
def test_who_no_longer_watches_a_sketch_leaves_it_as_it_was(address, leaves):
    request = CreateSketchRequest(match=match_request(SCENE, SCENE, **ENDLESS))
    request.match.ClearField("sketch")
    with grpc.insecure_channel(address) as channel:
        service = SketchServiceStub(channel)
        name = when_there_is_room(lambda: service.CreateSketch(request, timeout=60)).sketch_id
        timeout = 0.5 if leaves == "by its deadline" else 60.0
        events = service.WatchSketch(WatchSketchRequest(sketch_id=name), timeout=timeout)
        assert next(events).HasField("map")
        if leaves == "by cancelling":
            events.cancel()
        with pytest.raises(grpc.RpcError) as caught:
            list(events)
        expected = "DEADLINE_EXCEEDED" if leaves == "by its deadline" else "CANCELLED"
        assert caught.value.code().name == expected
        update = UpdateSketchRequest(sketch_id=name)
        assert service.UpdateSketch(update, timeout=60).revision == 1
        again = service.WatchSketch(WatchSketchRequest(sketch_id=name), timeout=60)
        assert next(again).HasField("map")
        again.cancel()
