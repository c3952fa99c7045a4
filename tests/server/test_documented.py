"""Each status that the contract says of a method is one that a caller can get."""

import re
from contextlib import ExitStack

import grpc
import pytest
from google.protobuf import json_format, message_factory

from sketchmatch_client import match_request
from sketchmatch_proto.v1 import (
    catalog_service_pb2,
    match_service_pb2,
    scene_service_pb2,
    sketch_service_pb2,
    transfer_service_pb2,
)
from tests.pace import wait_until
from tests.server.harness import ENDLESS, hosting, scene, serving_setup
from tests.server.misbehaving import RaisingSearcher, RaisingSegmenter
from tests.tools import ROOT

FILES = (
    catalog_service_pb2,
    match_service_pb2,
    scene_service_pb2,
    sketch_service_pb2,
    transfer_service_pb2,
)
METHODS = {
    method.name: method
    for file in FILES
    for service in file.DESCRIPTOR.services_by_name.values()
    for method in service.methods
}
_COMMENTED = re.compile(r"((?:^  //.*\n)+)  rpc (\w+)\(", re.MULTILINE)
_CODE = re.compile(r"^  // \* `([A-Z_]+)`:", re.MULTILINE)
DOCUMENTED = [
    (method, code)
    for file in sorted((ROOT / "proto/sketchmatch/v1").glob("*_service.proto"))
    for comment, method in _COMMENTED.findall(file.read_text("utf-8"))
    for code in _CODE.findall(comment)
]

POLYGONS = json_format.MessageToDict(scene(3))
STORED = {"storedScene": "ab" * 32}
FAILING = {"pipeline": {"searcher": {"name": RaisingSearcher.name}}}
"""A pipeline that fails."""
SOUND = {
    "Match": {"sketch": POLYGONS, "map": POLYGONS},
    "Transfer": {"sketch": POLYGONS, "map": POLYGONS},
    "Segment": {"source": POLYGONS},
    "PutScene": {"source": POLYGONS},
    "CreateSketch": {"match": {"map": POLYGONS}},
    "GetMatch": {"matchId": "0" * 32},
    "WatchMatch": {"matchId": "0" * 32},
    "CancelMatch": {"matchId": "0" * 32},
    "GetScene": {"name": "ab" * 32},
    "UpdateScene": {"name": "ab" * 32},
    "DeleteScene": {"name": "ab" * 32},
    "UpdateSketch": {"sketchId": "0" * 32},
    "WatchSketch": {"sketchId": "0" * 32},
    "DeleteSketch": {"sketchId": "0" * 32},
}
"""What a server does, or looks for and does not find."""
OF_STORED = {
    "Match": {"sketch": POLYGONS, "map": STORED},
    "Transfer": {"sketch": POLYGONS, "map": STORED},
    "CreateSketch": {"match": {"map": STORED}},
}
REQUESTS = {
    "INVALID_ARGUMENT": {"ListMatches": {"pageSize": -1}, "ListScenes": {"pageSize": -1}},
    "NOT_FOUND": SOUND | OF_STORED,
    "FAILED_PRECONDITION": SOUND | OF_STORED,
    "RESOURCE_EXHAUSTED": SOUND,
    "INTERNAL": {
        "Match": {**SOUND["Match"], **FAILING},
        "Transfer": {**SOUND["Transfer"], **FAILING},
        "Segment": {"source": POLYGONS, "segmenter": {"name": RaisingSegmenter.name}},
        "PutScene": {"source": POLYGONS, "segmenter": {"name": RaisingSegmenter.name}},
        "CreateSketch": {
            "match": {
                "map": POLYGONS,
                "pipeline": {"mapSegmenter": {"name": RaisingSegmenter.name}},
            }
        },
    },
}
"""What brings a method to a status, where nothing at all does not."""

SERVERS = {
    "UNAUTHENTICATED": "guarded",
    "FAILED_PRECONDITION": "damaged",
    "RESOURCE_EXHAUSTED": "full",
}
"""Which of the servers below brings methods to a status."""
AWAY = "127.0.0.1:1"


def called(address, method, request, timeout):
    """Call a method, and return its status and its answers."""
    found = METHODS[method]
    path = f"/{found.containing_service.full_name}/{method}"
    with grpc.insecure_channel(address) as channel:
        shape = "unary_stream" if found.server_streaming else "unary_unary"
        answer_type = _class(found.output_type)
        call = getattr(channel, shape)(
            path, lambda each: each.SerializeToString(), answer_type.FromString
        )
        try:
            answer = call(request, timeout=timeout)
            return "OK", list(answer) if found.server_streaming else [answer]
        except grpc.RpcError as error:
            return error.code().name, []


def _class(descriptor):
    return message_factory.GetMessageClass(descriptor)


def _message(method, values):
    return json_format.ParseDict(values, _class(METHODS[method].input_type)())


@pytest.fixture(scope="module")
def keeping(tmp_path_factory):
    """A server that keeps a little for its callers, and has algorithms that fail."""
    store = tmp_path_factory.mktemp("state") / "store"
    setup = serving_setup(RaisingSearcher, RaisingSegmenter, max_stored_bytes=20_000)
    with hosting(setup, store=store) as host:
        yield host.address


@pytest.fixture(scope="module")
def damaged(tmp_path_factory):
    """A server whose files are none."""
    store = tmp_path_factory.mktemp("state") / "store"
    store.mkdir()
    for name in ("matches", "scenes"):
        (store / f"{name}.sqlite").write_bytes(b"no database " * 1000)
    with hosting(serving_setup(), store=store) as host:
        yield host.address


@pytest.fixture(scope="module")
def guarded(tmp_path_factory):
    """A server that wants a token, and knows none."""
    tokens = tmp_path_factory.mktemp("tokens") / "tokens"
    tokens.write_text("", encoding="utf-8")
    with hosting(serving_setup(), tokens=tokens) as host:
        yield host.address


@pytest.fixture(scope="module")
def full(tmp_path_factory):
    """A server whose one place is taken."""
    store = tmp_path_factory.mktemp("state") / "store"
    setup = serving_setup(max_concurrent_matches=1, max_waiting=0, max_time_budget=600.0)
    with hosting(setup, store=store) as host, ExitStack() as stack:
        channel = stack.enter_context(grpc.insecure_channel(host.address))
        request = match_request(scene(8, 0), scene(8, 1), **ENDLESS)
        events = channel.unary_stream("/sketchmatch.v1.MatchService/Match")(
            request.SerializeToString()
        )
        next(events)
        stack.callback(events.cancel)
        yield host.address


def status_of(method, code, fixture):
    """Return the status that a method ends with when it is brought to a certain one."""
    if (method, code) == ("UpdateScene", "RESOURCE_EXHAUSTED"):
        return _over_its_quota(fixture("keeping"))
    if code == "CANCELLED":
        return _cancelled(fixture("keeping"), method)
    address = AWAY if code == "UNAVAILABLE" else fixture(SERVERS.get(code, "keeping"))
    asked = _message(method, REQUESTS.get(code, {}).get(method, {}))
    # A deadline that is over: a quick answer comes before one that is merely near.
    return called(address, method, asked, -1.0 if code == "DEADLINE_EXCEEDED" else 60.0)[0]


def _over_its_quota(address):
    code, (put,) = called(address, "PutScene", _message("PutScene", SOUND["PutScene"]), 60.0)
    assert code == "OK"
    for k in range(100):
        labels = [{"object": 0, "label": f"thing {k}"}]
        wanted = {"name": put.stored_scene.name, "labels": labels}
        code, _ = called(address, "UpdateScene", _message("UpdateScene", wanted), 60.0)
        if code != "OK":
            break
    return code


def _cancelled(address, method):
    """Cancel a match that is read by a method."""
    request = match_request(scene(8, 0), scene(8, 1), **ENDLESS)
    with grpc.insecure_channel(address) as channel:
        service = "/sketchmatch.v1.MatchService"
        match = channel.unary_stream(
            f"{service}/Match", None, match_service_pb2.MatchResponse.FromString
        )(request.SerializeToString())
        name = next(match).accepted.match_id
        reading = match
        if method == "WatchMatch":
            watched = match_service_pb2.WatchMatchRequest(match_id=name)
            reading = channel.unary_stream(f"{service}/WatchMatch")(watched.SerializeToString())
            next(reading)
        wanted = _message("CancelMatch", {"matchId": name})
        assert called(address, "CancelMatch", wanted, 60.0)[0] == "OK"
        with pytest.raises(grpc.RpcError) as refused:
            list(reading)
        match.cancel()
    wait_until(lambda: refused.value.code() is not None, "it has no status")
    return refused.value.code().name


@pytest.mark.parametrize(("method", "code"), DOCUMENTED)
def test_a_documented_status_is_reached(method, code, request):
    assert status_of(method, code, request.getfixturevalue) == code


def test_the_contract_is_read_whole():
    assert {method for method, _ in DOCUMENTED} == set(METHODS)
    assert len(DOCUMENTED) > 90
