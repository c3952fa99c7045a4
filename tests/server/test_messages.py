"""Requests as bytes: compressed, exploding, cut off and broken ones, on every method."""

import gzip
import zlib

import grpc
import pytest
from google.protobuf import descriptor_pool
from google.rpc import error_details_pb2, status_pb2
from grpc_health.v1 import health_pb2
from grpc_reflection.v1alpha import reflection_pb2
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sketchmatch_client import (
    Client,
    features,
    match_request,
    segment_request,
    transfer_request,
)
from sketchmatch_proto.v1 import catalog_service_pb2, match_service_pb2, scene_service_pb2
from sketchmatch_proto.v1.match_service_pb2 import MATCH_STATE_QUEUED, MatchResponse
from tests.pace import wait_until
from tests.processes import memory_of, server
from tests.server.harness import ENDLESS, scene, serving

OURS = {
    "/sketchmatch.v1.MatchService/Match": match_request(scene(3), scene(3)),
    "/sketchmatch.v1.SceneService/Segment": segment_request(scene(3), None, None, None),
    "/sketchmatch.v1.TransferService/Transfer": transfer_request(
        scene(3), scene(3), [features.point(1, 2)]
    ),
    "/sketchmatch.v1.CatalogService/ListAlgorithms": catalog_service_pb2.ListAlgorithmsRequest(),
    "/sketchmatch.v1.CatalogService/GetServerInfo": catalog_service_pb2.GetServerInfoRequest(),
}
ADMITTED = [*OURS][:3]
"""They are opened once there is a place for them."""

HEALTH = "/grpc.health.v1.Health/Check"
REFLECTION = "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo"
MIB = 1 << 20
COMPRESSED = [grpc.Compression.Gzip, grpc.Compression.Deflate]
# Field 1 is said to have 127 bytes, and has one.
CUT_OFF = b"\x0a\x7f\x0a"


def sent(address, path, data, compression=grpc.Compression.NoCompression):
    """Send bytes to a method, and return those that are answered."""
    options = [("grpc.max_receive_message_length", -1), ("grpc.max_send_message_length", -1)]
    with grpc.insecure_channel(address, options) as channel:
        if path == REFLECTION:
            call = channel.stream_stream(path)(iter([data]), timeout=60, compression=compression)
        else:
            call = channel.unary_stream(path)(data, timeout=60, compression=compression)
        return list(call)


def refused(address, path, data, compression=grpc.Compression.NoCompression):
    """Return code, sentence and reason with which bytes are refused."""
    with pytest.raises(grpc.RpcError) as raised:
        sent(address, path, data, compression)
    packed = dict(raised.value.trailing_metadata()).get("grpc-status-details-bin", b"")
    info = error_details_pb2.ErrorInfo()
    for detail in status_pb2.Status.FromString(packed).details:
        if detail.Is(info.DESCRIPTOR):
            detail.Unpack(info)
    return raised.value.code(), raised.value.details(), info.reason


@pytest.mark.parametrize("compression", COMPRESSED)
@pytest.mark.parametrize("path", OURS)
def test_compressed_requests_are_answered(address, path, compression):
    plain = OURS[path].SerializeToString()
    # Begin, scenes and result; how much progress is told between is a matter of time.
    events = 3 if path == ADMITTED[0] else 1
    for told in (sent(address, path, plain, compression), sent(address, path, plain)):
        assert len(told) >= events
        if events == 3:
            assert MatchResponse.FromString(told[-1]).WhichOneof("event") == "result"


@pytest.mark.parametrize("compression", COMPRESSED)
def test_health_and_reflection_read_compressed_requests_too(address, compression):
    service = health_pb2.HealthCheckRequest(service="sketchmatch.v1.CatalogService")
    healthy = health_pb2.HealthCheckResponse(status="SERVING").SerializeToString()
    assert sent(address, HEALTH, service.SerializeToString(), compression) == [healthy]
    asked = reflection_pb2.ServerReflectionRequest(file_containing_symbol="x" * 200)
    (answer,) = sent(address, REFLECTION, asked.SerializeToString(), compression)
    told = reflection_pb2.ServerReflectionResponse.FromString(answer)
    assert told.original_request == asked


@pytest.mark.parametrize(
    "data",
    [CUT_OFF, gzip.compress(CUT_OFF, mtime=0), b"\x1f\x8b", b"\x78\x9cjunk"],
    ids=["cut off", "cut off, then compressed", "a head alone", "a head, then junk"],
)
@pytest.mark.parametrize("path", [*OURS, HEALTH, REFLECTION])
def test_what_cannot_be_decoded_is_an_invalid_argument(address, path, data):
    code, sentence, reason = refused(address, path, data)
    assert code is grpc.StatusCode.INVALID_ARGUMENT
    assert sentence.startswith("the request cannot be decoded; send the message")
    assert reason == "INVALID_FIELD"


@given(
    path=st.sampled_from([*OURS, HEALTH, REFLECTION]),
    like=st.sampled_from([*OURS.values()]),
    cut=st.tuples(st.integers(0, 200), st.integers(0, 20)),
    put=st.binary(max_size=8),
    pack=st.sampled_from([bytes, bytes, gzip.compress, zlib.compress]),
)
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_whatever_the_bytes_they_are_answered_or_are_the_callers_fault(
    address, path, like, cut, put, pack
):
    (first, count), data = cut, like.SerializeToString()
    code = grpc.StatusCode.OK
    try:
        sent(address, path, pack(data[:first] + put + data[first + count :]))
    except grpc.RpcError as error:
        code = error.code()
    assert code in (
        grpc.StatusCode.OK,
        grpc.StatusCode.INVALID_ARGUMENT,
        grpc.StatusCode.NOT_FOUND,  # of health, for a service that there is not
    )


def test_a_compressed_request_that_is_cut_off_or_goes_on_is_not_taken_for_a_shorter_one(address):
    whole = gzip.compress(OURS["/sketchmatch.v1.MatchService/Match"].SerializeToString())
    assert len(sent(address, "/sketchmatch.v1.MatchService/Match", whole)) > 2
    for broken in (whole[:-9], whole + b"more", whole + whole):
        code, _, _ = refused(address, "/sketchmatch.v1.MatchService/Match", broken)
        assert code is grpc.StatusCode.INVALID_ARGUMENT


@pytest.mark.slow
@pytest.mark.parametrize("compression", COMPRESSED)
@pytest.mark.parametrize("path", [*OURS, HEALTH, REFLECTION])
def test_what_explodes_is_refused_at_the_limit(path, compression):
    explosive = b"\x0a" + varint(20 * MIB) + bytes(20 * MIB)
    with serving(max_request_bytes=100_000, warm=False) as host:
        code, sentence, reason = refused(host.address, path, explosive, compression)
    assert code is grpc.StatusCode.INVALID_ARGUMENT
    drawn = path == "/sketchmatch.v1.SketchService/UpdateSketch"
    limit = 100_000 if path in ADMITTED else MIB if drawn else 65_536
    assert sentence.startswith(f"the request has more than the limit of {limit} bytes when")
    assert reason == "MESSAGE_TOO_LARGE"


def varint(number):
    digits = bytearray()
    while number > 127:
        digits.append(number & 127 | 128)
        number >>= 7
    return bytes([*digits, number])


@pytest.mark.slow
def test_nothing_is_inflated_for_which_there_is_no_place():
    explosive = zlib.compress(b"\x0a" + varint(60 * MIB) + bytes(60 * MIB))
    assert len(explosive) < MIB
    path = "/sketchmatch.v1.MatchService/Match"
    with (
        server("--max-matches", "1", "--max-waiting", "0") as running,
        Client(running.address) as client,
    ):
        events = client.events(scene(8), scene(8, 1), **ENDLESS, time_budget=60)
        while not next(events).progress.HasField("confidence"):
            pass
        before = memory_of(running.process.pid, "VmHWM")
        for _ in range(6):
            assert refused(running.address, path, explosive)[0] is (
                grpc.StatusCode.RESOURCE_EXHAUSTED
            )
        assert memory_of(running.process.pid, "VmHWM") - before < 40 * MIB
        events.close()


@pytest.mark.slow
def test_a_queue_takes_no_more_memory_than_it_may():
    large = scene(8, labels=["x" * (5 * MIB // 8)] * 8)
    request = match_request(large, large).SerializeToString()
    assert len(request) > 10 * MIB
    path = "/sketchmatch.v1.MatchService/Match"
    with (
        server("--max-matches", "1", "--max-waiting-mib", "32") as running,
        Client(running.address) as client,
        grpc.insecure_channel(running.address) as channel,
    ):
        events = client.events(scene(8), scene(8, 1), **ENDLESS, time_budget=60)
        while not next(events).progress.HasField("confidence"):
            pass
        before = memory_of(running.process.pid, "VmHWM")
        calls = [channel.unary_stream(path)(request, timeout=8) for _ in range(3)]
        wait_until(
            lambda: [each.state for each in client.matches()].count(MATCH_STATE_QUEUED) == 3,
            "they do not wait",
        )
        for _ in range(20):
            code, sentence, _ = refused(running.address, path, request)
            assert code is grpc.StatusCode.RESOURCE_EXHAUSTED
            assert f"would have more than {32 * MIB} bytes together" in sentence
        # What comes and goes beside what waits is little; what was refused must not stay.
        assert memory_of(running.process.pid, "VmHWM") - before < 4 * 32 * MIB
        for call in calls:
            call.cancel()
        events.close()


@pytest.mark.parametrize(
    "file", [match_service_pb2, scene_service_pb2, catalog_service_pb2, health_pb2, reflection_pb2]
)
def test_no_request_can_begin_as_what_is_compressed_does(file):
    for service in file.DESCRIPTOR.services_by_name.values():
        for method in service.methods:
            request = descriptor_pool.Default().FindMessageTypeByName(method.input_type.full_name)
            assert 15 not in request.fields_by_number
