"""A server that says what a test wants, on a port of this machine."""

import time
from collections.abc import Iterator
from concurrent import futures
from contextlib import contextmanager
from threading import Event

import grpc
from google.protobuf.message import Message
from google.rpc import error_details_pb2, status_pb2
from grpc_health.v1 import health, health_pb2, health_pb2_grpc

from sketchmatch_proto.v1 import (
    catalog_service_pb2,
    catalog_service_pb2_grpc,
    match_pb2,
    match_service_pb2,
    match_service_pb2_grpc,
    scene_service_pb2,
    scene_service_pb2_grpc,
    transfer_service_pb2,
    transfer_service_pb2_grpc,
)

EVENTS = (
    match_service_pb2.MatchResponse(accepted=match_pb2.MatchAccepted(match_id="m1", seed=7)),
    match_service_pb2.MatchResponse(scenes=match_pb2.MatchScenes(sketch_warnings=["one left out"])),
    match_service_pb2.MatchResponse(progress=match_pb2.MatchProgress(confidence=0.5)),
    match_service_pb2.MatchResponse(),  # of a kind that a later version adds
    match_service_pb2.MatchResponse(progress=match_pb2.MatchProgress(confidence=0.75)),
    match_service_pb2.MatchResponse(
        result=match_pb2.MatchResult(
            match_id="m1",
            outcome=match_pb2.OUTCOME_CONVERGED,
            object_matches=[
                match_pb2.ObjectMatch(sketch_object=0, map_object=2, confidence=0.9),
                match_pb2.ObjectMatch(sketch_object=1, map_object=0, confidence=0.8),
            ],
        )
    ),
)


class FakeServer(
    match_service_pb2_grpc.MatchServiceServicer,
    scene_service_pb2_grpc.SceneServiceServicer,
    transfer_service_pb2_grpc.TransferServiceServicer,
    catalog_service_pb2_grpc.CatalogServiceServicer,
):
    """Answers every method, keeps the requests, fails if ``error`` is set.

    Each of ``times`` is how long a caller would wait; requests of the kind ``holds`` wait until
    ``released`` is set.
    """

    def __init__(self) -> None:
        self.address = ""
        self.requests: list[Message] = []
        self.authorizations: list[str | None] = []
        self.times: list[float] = []
        self.holds: type[Message] | None = None
        self.released = Event()
        self.events = EVENTS
        self.endless = False
        self.cancelled = Event()
        self.segments: scene_service_pb2.SegmentResponse | None = None
        self.kept: scene_service_pb2.PutSceneResponse | None = None
        self.catalogue = catalog_service_pb2.ListAlgorithmsResponse(
            algorithms=[catalog_service_pb2.Algorithm(name="easm")]
        )
        self.info = catalog_service_pb2.GetServerInfoResponse(api_version="sketchmatch.v1")
        self.transferred = transfer_service_pb2.TransferResponse()
        self.error: status_pb2.Status | None = None
        self.fails = 1_000_000  # times
        self.breaks_off = False
        self.breaks_after: int | None = None
        self.unknown = False
        self.cancelled_match = Event()
        self.pages: list[match_service_pb2.ListMatchesResponse] = []
        self.health = health.HealthServicer()

    def Match(self, request, context):
        context.add_callback(self.cancelled.set)
        self._take(request, context)
        breaks_off, self.breaks_off = self.breaks_off, False
        yield from self.events[: self.breaks_after if breaks_off else None]
        if breaks_off:
            context.abort(grpc.StatusCode.UNAVAILABLE, "away")
        while self.endless and context.is_active():
            yield EVENTS[2]
            time.sleep(0.01)

    def WatchMatch(self, request, context):
        self._take(request, context)
        if self.unknown:
            context.abort(grpc.StatusCode.NOT_FOUND, "no such match")
        for event in self.events:
            if event.number > request.after:
                yield match_service_pb2.WatchMatchResponse(event=event)

    def GetMatch(self, request, context):
        self._take(request, context)
        return match_service_pb2.GetMatchResponse()

    def CancelMatch(self, request, context):
        self._take(request, context)
        self.cancelled_match.set()
        return match_service_pb2.CancelMatchResponse()

    def ListMatches(self, request, context):
        self._take(request, context)
        return self.pages.pop(0)

    def Segment(self, request, context):
        self._take(request, context)
        if self.segments is not None:
            return self.segments
        return scene_service_pb2.SegmentResponse(segmenter=request.segmenter, warnings=["w"])

    def PutScene(self, request, context):
        if self.kept is None:
            context.abort(grpc.StatusCode.FAILED_PRECONDITION, "the server keeps no scenes")
        self._take(request, context)
        return self.kept

    def DeleteScene(self, request, context):
        self._take(request, context)
        context.abort(grpc.StatusCode.NOT_FOUND, "no such scene")

    def Transfer(self, request, context):
        self._take(request, context)
        return self.transferred

    def ListAlgorithms(self, request, context):
        self._take(request, context)
        return self.catalogue

    def GetServerInfo(self, request, context):
        self._take(request, context)
        return self.info

    def fail(self, code: grpc.StatusCode, message: str, *details: Message) -> None:
        self.error = status_pb2.Status(code=code.value[0], message=message)
        for detail in details:
            self.error.details.add().Pack(detail)

    def set_health(self, status: str) -> None:
        self.health.set("", health_pb2.HealthCheckResponse.ServingStatus.Value(status))

    def _take(self, request, context) -> None:
        self.requests.append(request)
        self.authorizations.append(dict(context.invocation_metadata()).get("authorization"))
        self.times.append(context.time_remaining())
        if self.holds is not None and isinstance(request, self.holds):
            self.released.wait(60)
        if self.error and len(self.requests) <= self.fails:
            (code,) = (code for code in grpc.StatusCode if code.value[0] == self.error.code)
            packed = self.error.SerializeToString() if self.error.details else None
            context.set_trailing_metadata([("grpc-status-details-bin", packed)] if packed else [])
            context.abort(code, self.error.message)


@contextmanager
def running(*options: tuple[str, int]) -> Iterator[FakeServer]:
    """Run a fake server; ``options`` are gRPC's own."""
    fake = FakeServer()
    server = grpc.server(futures.ThreadPoolExecutor(8), options=options)
    match_service_pb2_grpc.add_MatchServiceServicer_to_server(fake, server)
    scene_service_pb2_grpc.add_SceneServiceServicer_to_server(fake, server)
    transfer_service_pb2_grpc.add_TransferServiceServicer_to_server(fake, server)
    catalog_service_pb2_grpc.add_CatalogServiceServicer_to_server(fake, server)
    health_pb2_grpc.add_HealthServicer_to_server(fake.health, server)
    fake.address = f"127.0.0.1:{server.add_insecure_port('127.0.0.1:0')}"
    server.start()
    try:
        yield fake
    finally:
        fake.released.set()
        server.stop(grace=None).wait()


def reason(name: str) -> Message:
    return error_details_pb2.ErrorInfo(domain="sketchmatch", reason=name)


def violation(field: str) -> Message:
    bad = error_details_pb2.BadRequest()
    bad.field_violations.add(field=field, description="is wrong")
    return bad


def retry_after(seconds: int) -> Message:
    info = error_details_pb2.RetryInfo()
    info.retry_delay.seconds = seconds
    return info
