"""OpenTelemetry traces: the spans of a call, in its caller's trace, and where they are sent."""

import importlib.util
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from itertools import pairwise
from queue import Queue

import grpc
import pytest

from sketchmatch.api import Searcher
from sketchmatch.errors import InvalidInputError
from sketchmatch.server.traces import Traces
from sketchmatch_client import match_request, segment_request
from tests.pace import wait_until
from tests.server.harness import hosting, scene, serving_setup
from tests.tools import require

SERVICE = "sketchmatch.v1.MatchService"
TRACE, PARENT = 0x4BF92F3577B34DA6A3CE929D0E0E4736, 0x00F067AA0BA902B7
CALLER = (("traceparent", f"00-{TRACE:032x}-{PARENT:016x}-01"),)
SECOND = 1_000_000_000


class Failing(Searcher):
    """Raises."""

    name = "failing"
    summary = "Raises."

    def search(self, problem, rng):  # noqa: ARG002
        raise RuntimeError("it fails")
        yield


@pytest.fixture(scope="module", autouse=True)
def _installed():
    for module in ("opentelemetry.sdk", "opentelemetry.exporter"):
        require(_is_there(module), f"{module} (`pip install '.[otel]'`)")


def _is_there(module):
    try:
        return importlib.util.find_spec(module) is not None
    except ModuleNotFoundError:
        return False


@pytest.fixture(scope="module")
def spans():
    from opentelemetry.sdk.trace.export.in_memory_span_exporter import InMemorySpanExporter

    return InMemorySpanExporter()


@pytest.fixture(scope="module")
def address(spans):
    from opentelemetry.sdk.trace import TracerProvider
    from opentelemetry.sdk.trace.export import SimpleSpanProcessor

    provider = TracerProvider()
    provider.add_span_processor(SimpleSpanProcessor(spans))
    with ExitStack() as stack:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Traces, "sent_to", lambda _: Traces(provider))
            host = stack.enter_context(hosting(serving_setup(Failing)))
        yield host.address


def called(address, spans, method, request, kind="unary_stream", metadata=()):
    """Call a method, and return the spans that come of it, and the status."""
    spans.clear()
    code = grpc.StatusCode.OK
    with grpc.insecure_channel(address) as channel:
        call = getattr(channel, kind)(f"/{method}")
        try:
            answer = call(request.SerializeToString(), metadata=metadata, timeout=60)
            for _ in answer if kind == "unary_stream" else ():
                pass
        except grpc.RpcError as error:
            code = error.code()
    # Its caller may hear of a call's end before its span has one.
    wait_until(lambda: spans.get_finished_spans() or method.startswith("grpc."), "there is no span")
    wait_until(lambda: not _open(spans), "the span of the call does not end")
    return spans.get_finished_spans(), code


def _open(spans):
    return (done := spans.get_finished_spans()) and not done[-1].name.startswith("sketchmatch.")


def test_a_match_is_a_span_of_its_callers_trace_with_its_wait_and_stages_below(address, spans):
    from opentelemetry.trace import SpanKind, StatusCode

    request = match_request(scene(5), scene(5))
    found, _ = called(address, spans, f"{SERVICE}/Match", request, metadata=CALLER)
    *parts, call = found
    assert [part.name for part in parts] == ["queue", "segment", "describe", "relate", "search"]
    assert call.name == f"{SERVICE}/Match"
    assert call.kind is SpanKind.SERVER
    assert (call.context.trace_id, call.parent.span_id) == (TRACE, PARENT)
    assert call.status.status_code is StatusCode.UNSET
    facts = dict(call.attributes)
    assert facts["rpc.system"] == "grpc"
    assert facts["rpc.service"] == SERVICE
    assert facts["rpc.method"] == "Match"
    assert facts["rpc.grpc.status_code"] == 0
    assert facts["sketchmatch.objects"] == "5x5"
    assert facts["sketchmatch.searcher"] == "align"
    assert facts["sketchmatch.outcome"] == "CONVERGED"
    for part in parts:
        assert (part.context.trace_id, part.parent.span_id) == (TRACE, call.context.span_id)
        assert call.start_time - SECOND < part.start_time <= part.end_time
        assert part.end_time < call.end_time + SECOND
    for before, after in pairwise(parts):
        assert abs(after.start_time - before.end_time) < SECOND / 100


def test_a_call_without_a_trace_begins_one(address, spans):
    request = segment_request(scene(5))
    method = "sketchmatch.v1.SceneService/Segment"
    (queue, call), _ = called(address, spans, method, request, "unary_unary")
    assert queue.name == "queue"
    assert call.name == method
    assert call.parent is None
    assert queue.parent.span_id == call.context.span_id


@pytest.mark.parametrize(
    ("searcher", "code", "is_error", "reason"),
    [
        ("unheard-of", grpc.StatusCode.INVALID_ARGUMENT, False, "UNKNOWN_ALGORITHM"),
        ("failing", grpc.StatusCode.INTERNAL, True, "PLUGIN_FAILED"),
    ],
)
def test_a_call_that_fails_has_its_status(address, spans, searcher, code, is_error, reason):
    from opentelemetry.trace import StatusCode

    request = match_request(scene(5), scene(5), searcher=searcher)
    found, told = called(address, spans, f"{SERVICE}/Match", request)
    assert told is code
    assert found[-1].attributes["rpc.grpc.status_code"] == code.value[0]
    assert found[-1].attributes["sketchmatch.reason"] == reason
    assert (found[-1].status.status_code is StatusCode.ERROR) == is_error


def test_health_has_no_spans(address, spans):
    from grpc_health.v1.health_pb2 import HealthCheckRequest

    found, code = called(
        address, spans, "grpc.health.v1.Health/Check", HealthCheckRequest(), "unary_unary"
    )
    assert (found, code) == ((), grpc.StatusCode.OK)


def test_spans_reach_a_collector_under_our_name_and_the_last_ones_when_the_server_ends(monkeypatch):
    from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import (
        ExportTraceServiceRequest,
        ExportTraceServiceResponse,
    )

    monkeypatch.delenv("OTEL_SERVICE_NAME", raising=False)
    monkeypatch.delenv("OTEL_RESOURCE_ATTRIBUTES", raising=False)
    received = Queue()

    def export(request, _):
        received.put(request)
        return ExportTraceServiceResponse()

    handler = grpc.unary_unary_rpc_method_handler(
        export,
        ExportTraceServiceRequest.FromString,
        ExportTraceServiceResponse.SerializeToString,
    )
    name = "opentelemetry.proto.collector.trace.v1.TraceService"
    collector = grpc.server(ThreadPoolExecutor(1))
    collector.add_generic_rpc_handlers(
        [grpc.method_handlers_generic_handler(name, {"Export": handler})]
    )
    port = collector.add_insecure_port("127.0.0.1:0")
    collector.start()
    try:
        traces = Traces.sent_to(f"http://127.0.0.1:{port}")
        (interceptor,) = traces.interceptors
        interceptor._tracer.start_span("one").end()
        traces.close()
        (resource,) = received.get(timeout=30).resource_spans
    finally:
        collector.stop(None)
    attributes = {each.key: each.value.string_value for each in resource.resource.attributes}
    assert attributes["service.name"] == "sketchmatch"
    assert [span.name for span in resource.scope_spans[0].spans] == ["one"]


def test_without_the_packages_the_remedy_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "opentelemetry.exporter.otlp.proto.grpc.trace_exporter", None)
    said = r"^server\.traces_endpoint is set, .* pip install 'sketchmatch\[otel\]'$"
    with pytest.raises(InvalidInputError, match=said):
        Traces.sent_to("http://127.0.0.1:4317")


def test_nothing_of_it_loads_where_nobody_asks():
    code = "import sketchmatch.server.serve, sys; print([m for m in sys.modules if 'telem' in m])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
