"""OpenTelemetry traces of calls: an extra, of which nothing loads unless somebody asks for it."""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import Awaitable, Callable, Iterator
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any

import grpc

from sketchmatch.app.tasks import Record, Task
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.server.calls import facts
from sketchmatch.server.wrapping import WrappingInterceptor, kind_of, status_of
from sketchmatch_proto.v1.match_pb2 import MatchStatistics

if TYPE_CHECKING:
    from opentelemetry.sdk.trace import TracerProvider

__all__ = ["Traces", "TracesInterceptor", "trace"]

_OURS = "/sketchmatch."
_NAME = "sketchmatch"
_NANOSECONDS = 1_000_000_000
_STAGES = ("segment", "describe", "relate", "search")
_FAULTS = frozenset(
    {
        grpc.StatusCode.UNKNOWN,
        grpc.StatusCode.DEADLINE_EXCEEDED,
        grpc.StatusCode.UNIMPLEMENTED,
        grpc.StatusCode.INTERNAL,
        grpc.StatusCode.UNAVAILABLE,
        grpc.StatusCode.DATA_LOSS,
    }
)
"""The statuses that are errors of a server; all others are its caller's."""
_Context = grpc.aio.ServicerContext[Any, Any]
_Stretch = Callable[[str, float, float], None]
_stretch: ContextVar[_Stretch | None] = ContextVar("stretch", default=None)


class Traces:
    """Spans of the calls of a server, below those of their callers.

    Parameters
    ----------
    provider
        Makes the spans, and sends them somewhere; None: there are none.
    """

    def __init__(self, provider: TracerProvider | None) -> None:
        self._provider = provider

    @classmethod
    def sent_to(cls, endpoint: str | None) -> Traces:
        """Return what sends spans to a collector over OTLP; the rest ``OTEL_…`` variables say.

        Parameters
        ----------
        endpoint
            Its URL; None for none.

        Raises
        ------
        InvalidInputError
            If OpenTelemetry is not installed.
        """
        if not endpoint:
            return cls(None)
        try:
            from opentelemetry.exporter.otlp.proto.grpc.trace_exporter import OTLPSpanExporter
            from opentelemetry.sdk.resources import Resource
            from opentelemetry.sdk.trace import TracerProvider
            from opentelemetry.sdk.trace.export import BatchSpanProcessor
        except ImportError:
            problem = "is set, but OpenTelemetry is not installed; "
            raise InvalidInputError(
                Reason.INVALID_FIELD,
                "server.traces_endpoint",
                f"{problem}run pip install 'sketchmatch[otel]'",
            ) from None
        named = {} if _is_named() else {"service.name": _NAME}
        provider = TracerProvider(resource=Resource.create(named))
        provider.add_span_processor(BatchSpanProcessor(OTLPSpanExporter(endpoint=endpoint)))
        return cls(provider)

    @property
    def interceptors(self) -> list[TracesInterceptor]:
        """What makes a span of each call, if anything does."""
        return [] if self._provider is None else [TracesInterceptor(self._provider)]

    def close(self) -> None:
        """Send what there is, and end; it waits for a collector that does not answer."""
        if self._provider is not None:
            self._provider.shutdown()


class TracesInterceptor(WrappingInterceptor):
    """Makes a span of each call; health and reflection, which others poll, have none.

    Parameters
    ----------
    provider
        Makes the spans.
    """

    def __init__(self, provider: TracerProvider) -> None:
        self._tracer = provider.get_tracer(_NAME)

    def wrapped(self, handler: Any, path: str) -> Any:
        """Return the method's handler, traced."""
        if not path.startswith(_OURS):
            return handler
        kind = kind_of(handler)
        return handler._replace(**{kind: self._traced(getattr(handler, kind), path)})

    def _traced(self, method: Callable[[Any, _Context], Awaitable[Any]], path: str) -> Any:
        from opentelemetry import propagate
        from opentelemetry.trace import SpanKind, Status, StatusCode, set_span_in_context

        service, _, name = path[1:].partition("/")
        what = {"rpc.system": "grpc", "rpc.service": service, "rpc.method": name}

        async def call(request: Any, context: _Context) -> Any:
            metadata = context.invocation_metadata() or ()
            given = {key: value for key, value in metadata if isinstance(value, str)}
            span = self._tracer.start_span(
                path[1:], propagate.extract(given), kind=SpanKind.SERVER, attributes=dict(what)
            )
            within = set_span_in_context(span)

            def stretch(name: str, began: float, ended: float) -> None:
                start = self._tracer.start_span(name, within, start_time=_wall(began))
                start.end(_wall(ended))

            _stretch.set(stretch)
            code = grpc.StatusCode.OK
            try:
                return await method(request, context)
            except (asyncio.CancelledError, grpc.aio.InternalError):
                code = grpc.StatusCode.CANCELLED
                raise
            except BaseException:  # what aborts a call is no Exception
                code = status_of(context) or grpc.StatusCode.UNKNOWN
                raise
            finally:
                for fact, value in facts().items():
                    span.set_attribute(f"sketchmatch.{fact}", str(value))
                span.set_attribute("rpc.grpc.status_code", code.value[0])
                if code in _FAULTS:
                    span.set_status(Status(StatusCode.ERROR, code.name))
                span.end()

        return call


def trace(match: Task | Record) -> None:
    """Make spans, in the trace of the call under way, of a request's wait and of its stages.

    How long stages took is told, not when they began: they lie one after the other from the
    request's turn on.
    """
    stretch = _stretch.get()
    if stretch is None or isinstance(match, Record):
        return
    now = time.monotonic()
    began = now if match.begun is None else match.begun
    stretch("queue", match.asked, began)
    if match.begun is None:
        return
    for name, seconds in _stages(match):
        stretch(name, began, began + seconds)
        began += seconds


def _stages(task: Task) -> Iterator[tuple[str, float]]:
    result = next((e.result for e in task.events() if e.HasField("result")), None)
    statistics = MatchStatistics() if result is None else result.statistics
    for field, value in statistics.ListFields():  # in the order in which they are done
        if (name := field.name.removesuffix("_elapsed")) in _STAGES:
            yield name, value.ToTimedelta().total_seconds()


def _is_named() -> bool:
    """Whether the environment says what the service is called."""
    resource = os.environ.get("OTEL_RESOURCE_ATTRIBUTES", "")
    return "OTEL_SERVICE_NAME" in os.environ or "service.name=" in resource


def _wall(moment: float) -> int:
    """Return when it was by the clock of the wall, in nanoseconds."""
    return time.time_ns() - round((time.monotonic() - moment) * _NANOSECONDS)
