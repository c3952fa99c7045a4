"""What a server counts of its calls and matches, for whoever watches it."""

from __future__ import annotations

import asyncio
import inspect
import threading
import time
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Awaitable, Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import grpc
from google.rpc import error_details_pb2, status_pb2

from sketchmatch.pipeline.memory import Lookups
from sketchmatch.server.wrapping import WrappingInterceptor, kind_of, status_of
from sketchmatch_proto.v1.match_pb2 import MatchAccepted, MatchResult, Outcome
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse

__all__ = ["Counter", "Gauge", "Histogram", "Metric", "Metrics", "MetricsInterceptor"]

_BOUNDS = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0, 300.0)
_HEALTH = "/grpc.health.v1.Health/"
_OTHER = "other"
# A caller's own clock may end a call a moment earlier than ours.
_CLOCKS_APART = 0.1
_QUEUE = "queue"
_STAGES = ("segment", "describe", "relate", "search")
_Labels = tuple[str, ...]
_Handler = Any


@dataclass(frozen=True)
class Metric:
    """Something that is counted.

    Attributes
    ----------
    name
        As Prometheus has names, with the unit.
    text
        What it is.
    labels
        What tells its values apart.
    """

    name: str
    text: str
    labels: _Labels = ()


class Counter:
    """How often something happened.

    Parameters
    ----------
    metric
        What.
    """

    def __init__(self, metric: Metric) -> None:
        self.metric = metric
        self._lock = threading.Lock()
        self._values: dict[_Labels, float] = defaultdict(float)

    def add(self, *labels: str, count: float = 1) -> None:
        """Count."""
        with self._lock:
            self._values[labels] += count

    def values(self) -> dict[_Labels, float]:
        """Return the counts so far by their labels."""
        with self._lock:
            return dict(self._values)


class Histogram:
    """How long something took, in seconds.

    Parameters
    ----------
    metric
        What.
    """

    bounds = _BOUNDS

    def __init__(self, metric: Metric) -> None:
        self.metric = metric
        self._lock = threading.Lock()
        self._counts: dict[_Labels, list[int]] = defaultdict(lambda: [0] * (len(_BOUNDS) + 1))
        self._sums: dict[_Labels, float] = defaultdict(float)

    def add(self, *labels: str, seconds: float) -> None:
        """Count one that took so long."""
        with self._lock:
            self._counts[labels][bisect_left(_BOUNDS, seconds)] += 1
            self._sums[labels] += seconds

    def values(self) -> dict[_Labels, tuple[list[int], float]]:
        """Return how many took up to each bound, and beyond them, with their sum, by labels."""
        with self._lock:
            return {
                labels: (_running_totals(counts), self._sums[labels])
                for labels, counts in self._counts.items()
            }


@dataclass(frozen=True)
class Gauge:
    """How something is at the moment that somebody looks.

    Attributes
    ----------
    metric
        What.
    read
        Returns its values by labels.
    """

    metric: Metric
    read: Callable[[], Mapping[_Labels, float]]

    def values(self) -> Mapping[_Labels, float]:
        """Return the values now."""
        return self.read()


class Metrics:
    """All that a server counts.

    Parameters
    ----------
    methods
        Full names of the methods that have counts of their own; all others share one, since a
        stranger may invent names.
    """

    def __init__(self, methods: Iterable[str]) -> None:
        self._methods = frozenset(methods)
        self.calls = Counter(
            Metric("sketchmatch_calls_total", "Calls that have ended.", ("method", "code"))
        )
        self.call_seconds = Histogram(
            Metric("sketchmatch_call_seconds", "How long calls took.", ("method",))
        )
        self.refusals = Counter(
            Metric("sketchmatch_refusals_total", "Calls that were refused.", ("reason",))
        )
        self.matches = Counter(
            Metric("sketchmatch_matches_total", "Matches with a result.", ("searcher", "outcome"))
        )
        self.unkept = Counter(
            Metric("sketchmatch_matches_not_kept_total", "Matches that the store failed to keep.")
        )
        self.scenes = Counter(
            Metric(
                "sketchmatch_described_scenes_total",
                "Scenes whose histograms were needed: held in memory, kept in the store, computed.",
                ("histograms",),
            )
        )
        self.stage_seconds = Histogram(
            Metric(
                "sketchmatch_stage_seconds",
                "How long stages of matches took, and the wait before them; of both scenes, a "
                "stage has the algorithm of the map.",
                ("stage", "algorithm"),
            )
        )
        self._open: dict[str, int] = defaultdict(int)
        self._gauges: list[Gauge] = []
        self.watch(
            Metric("sketchmatch_calls_open", "Calls under way.", ("method",)),
            lambda: {(method,): count for method, count in dict(self._open).items()},
        )

    def watch(self, metric: Metric, read: Callable[[], Mapping[_Labels, float]]) -> None:
        """Have something read whenever somebody looks."""
        self._gauges.append(Gauge(metric, read))

    def __iter__(self) -> Iterator[Counter | Histogram | Gauge]:
        yield from (self.calls, self.refusals, self.matches, self.unkept, self.scenes)
        yield from (self.call_seconds, self.stage_seconds)
        yield from self._gauges

    def label_of(self, method: str) -> str:
        """Return what a method is counted as."""
        return method.rpartition("/")[2] if method in self._methods else _OTHER

    def began(self, method: str) -> None:
        """Count a call that begins."""
        self._open[method] += 1

    def ended(self, method: str, code: str, reason: str, seconds: float) -> None:
        """Count a call that has ended."""
        self._open[method] -= 1
        self.calls.add(method, code)
        self.call_seconds.add(method, seconds=seconds)
        if reason:
            self.refusals.add(reason)

    def matched(self, events: Iterable[MatchResponse], waited: float) -> None:
        """Count a match with its outcome and its stages, by its events and how long it waited."""
        accepted, result = MatchAccepted(), MatchResult()
        for event in events:
            accepted = event.accepted if event.HasField("accepted") else accepted
            result = event.result if event.HasField("result") else result
        pipeline, statistics = accepted.pipeline, result.statistics
        outcome = Outcome.Name(result.outcome).removeprefix("OUTCOME_").lower()
        self.matches.add(pipeline.searcher.name, outcome)
        algorithms = (
            pipeline.map_segmenter.name,
            pipeline.histogram.name,
            pipeline.similarity.name,
            pipeline.searcher.name,
        )
        self.stage_seconds.add(_QUEUE, pipeline.searcher.name, seconds=waited)
        for stage, algorithm in zip(_STAGES, algorithms, strict=True):
            elapsed = getattr(statistics, f"{stage}_elapsed").ToTimedelta()
            self.stage_seconds.add(stage, algorithm, seconds=elapsed.total_seconds())

    def looked_up(self, lookups: Lookups) -> None:
        """Count where the histograms of scenes came from."""
        for source, count in lookups._asdict().items():
            self.scenes.add(source, count=count)


class MetricsInterceptor(WrappingInterceptor):
    """Counts calls, those that other interceptors refuse too; so it comes first.

    Parameters
    ----------
    metrics
        Where they are counted.
    """

    def __init__(self, metrics: Metrics) -> None:
        self._metrics = metrics

    def wrapped(self, handler: Any, path: str) -> Any:
        """Return the method's handler, counting."""
        kind = kind_of(handler)
        behaviour = getattr(handler, kind)
        if path.startswith(_HEALTH) or not inspect.iscoroutinefunction(behaviour):
            return handler
        return handler._replace(**{kind: self._counted(behaviour, self._metrics.label_of(path))})

    def _counted(self, behaviour: Callable[[Any, Any], Awaitable[Any]], method: str) -> Any:
        metrics = self._metrics

        async def call(request: Any, context: Any) -> Any:
            began = time.monotonic()
            code = "UNKNOWN"
            metrics.began(method)
            try:
                answer = await behaviour(request, context)
                code = "OK"
                return answer
            except (asyncio.CancelledError, grpc.aio.InternalError):
                code = _gone(context)
                raise
            except BaseException:  # what aborts a call is no Exception
                code = (status_of(context) or grpc.StatusCode.UNKNOWN).name
                raise
            finally:
                seconds = time.monotonic() - began
                metrics.ended(method, code, _reason(context.trailing_metadata()), seconds)

        return call


def _gone(context: Any) -> str:
    """Return the status that the caller has, who waited no longer."""
    left = context.time_remaining()
    return "CANCELLED" if left is None or left > _CLOCKS_APART else "DEADLINE_EXCEEDED"


def _reason(trailer: Any) -> str:
    """Return the reason of a refusal, for programs; empty where there is none."""
    packed = dict(trailer or ()).get("grpc-status-details-bin", b"")
    info = error_details_pb2.ErrorInfo()
    for detail in status_pb2.Status.FromString(packed).details:
        if detail.Unpack(info):
            return str(info.reason)
    return ""


def _running_totals(counts: list[int]) -> list[int]:
    total, totals = 0, []
    for count in counts:
        total += count
        totals.append(total)
    return totals
