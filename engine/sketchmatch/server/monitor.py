"""A small HTTP server beside gRPC: metrics for Prometheus, and probes of orchestrators."""

from __future__ import annotations

import asyncio
import socket
import socketserver
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from typing import Any

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.server.metrics import Counter, Gauge, Histogram, Metrics

__all__ = ["Monitor"]

_PATIENCE_SECONDS = 5.0
_PLAIN = "text/plain; charset=utf-8"
_Answer = tuple[HTTPStatus, str, bytes]


class Monitor:
    """Answers ``/metrics``, ``/livez`` (the event loop turns) and ``/readyz`` (requests are taken).

    It has a thread of its own, and so answers when the event loop does not.

    Parameters
    ----------
    address
        Host and port to listen on; port 0 picks a free one.
    metrics
        What is told.
    serving
        Whether requests are taken.

    Raises
    ------
    InvalidInputError
        If the address cannot be listened on, or the package prometheus-client is not installed.
    """

    def __init__(self, address: str, metrics: Metrics, serving: Callable[[], bool]) -> None:
        self._loop = asyncio.get_running_loop()
        self._serving = serving
        self._exposed = _exposition(metrics)
        host, _, port = address.rpartition(":")
        try:
            self._server = _server_at(host.strip("[]"), int(port), self._answer)
        except (OSError, OverflowError) as error:
            why = (getattr(error, "strerror", None) or str(error)).lower()
            problem = f"{address!r} cannot be listened on ({why}); choose a free port of this host"
            raise InvalidInputError(
                Reason.INVALID_FIELD, "server.metrics_address", problem
            ) from None
        self.address = f"{host}:{self._server.server_address[1]}"
        threading.Thread(
            target=self._server.serve_forever, name="sketchmatch-monitor", daemon=True
        ).start()

    def close(self) -> None:
        """Listen no longer."""
        self._server.shutdown()
        self._server.server_close()

    def _answer(self, path: str) -> _Answer:
        match path.partition("?")[0]:
            case "/metrics":
                kind, text = self._exposed()
                return HTTPStatus.OK, kind, text
            case "/livez":
                return _said(self._turns())
            case "/readyz":
                return _said(self._serving())
        return HTTPStatus.NOT_FOUND, _PLAIN, b"there are /metrics, /livez and /readyz\n"

    def _turns(self) -> bool:
        """Whether the event loop gets round to something new."""
        try:
            turn = asyncio.run_coroutine_threadsafe(asyncio.sleep(0), self._loop)
            turn.result(_PATIENCE_SECONDS)
        except (TimeoutError, CancelledError, RuntimeError):
            return False
        return True


def _said(fine: bool) -> _Answer:
    if fine:
        return HTTPStatus.OK, _PLAIN, b"ok\n"
    return HTTPStatus.SERVICE_UNAVAILABLE, _PLAIN, b"not now\n"


def _server_at(host: str, port: int, answer: Callable[[str], _Answer]) -> socketserver.TCPServer:
    class Handler(BaseHTTPRequestHandler):
        server_version, sys_version = "sketchmatch", ""
        timeout = _PATIENCE_SECONDS

        def do_GET(self) -> None:
            status, kind, text = answer(self.path)
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(text)))
            self.end_headers()
            self.wfile.write(text)

        def log_message(self, *_: Any) -> None:
            """Keep silent: probes come every few seconds."""

    class Server(socketserver.ThreadingTCPServer):
        address_family = socket.AF_INET6 if ":" in host else socket.AF_INET
        allow_reuse_address, daemon_threads = True, True

        def handle_error(self, *_: Any) -> None:
            """Keep silent: whoever asked has gone."""

    return Server((host, port), Handler)


def _exposition(metrics: Metrics) -> Callable[[], tuple[str, bytes]]:
    """Return what returns the metrics as Prometheus reads them, with the type of that."""
    try:
        import prometheus_client
        from prometheus_client import core
    except ImportError:
        problem = "is set, but the package prometheus-client is not installed; "
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            "server.metrics_address",
            f"{problem}run pip install 'sketchmatch[metrics]'",
        ) from None

    class Collector:
        def collect(self) -> Iterator[core.Metric]:
            for item in metrics:
                name, text, labels = item.metric.name, item.metric.text, item.metric.labels
                match item:
                    case Histogram():
                        histogram = core.HistogramMetricFamily(name, text, labels=labels)
                        bounds = (*map(str, item.bounds), "+Inf")
                        for values, (counts, total) in item.values().items():
                            buckets = list(zip(bounds, counts, strict=True))
                            histogram.add_metric(values, buckets, total)
                        yield histogram
                    case Counter() | Gauge():
                        family = (
                            core.CounterMetricFamily
                            if isinstance(item, Counter)
                            else core.GaugeMetricFamily
                        )(name, text, labels=labels)
                        for values, value in item.values().items():
                            family.add_metric(values, value)
                        yield family

    registry = prometheus_client.CollectorRegistry()
    registry.register(Collector())
    prometheus_client.ProcessCollector(registry=registry)
    return lambda: (
        prometheus_client.CONTENT_TYPE_LATEST,
        prometheus_client.generate_latest(registry),
    )
