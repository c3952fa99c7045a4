"""The three services of the contract, over the pipeline."""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from typing import Any, NoReturn, TypeVar

import grpc
from google.protobuf.duration_pb2 import Duration
from google.protobuf.message import Message

import sketchmatch
from sketchmatch.api import API_VERSION
from sketchmatch.errors import InvalidInputError, PluginError, Reason, SketchmatchError
from sketchmatch.model.limits import limited_to
from sketchmatch.pipeline.match import run_match
from sketchmatch.pipeline.plugins import segmented
from sketchmatch.pipeline.selection import resolve_segmenter
from sketchmatch.registry import Registry
from sketchmatch.server import requests, responses
from sketchmatch.server.limits import Limits
from sketchmatch.server.mailbox import Mailbox
from sketchmatch.server.status import Refusal, refusal, too_busy
from sketchmatch_proto.v1 import (
    catalog_service_pb2,
    catalog_service_pb2_grpc,
    match_service_pb2,
    match_service_pb2_grpc,
    scene_service_pb2,
    scene_service_pb2_grpc,
)

__all__ = ["CatalogService", "MatchService", "SceneService", "Workers"]

_log = logging.getLogger(__name__)
_Context = grpc.aio.ServicerContext[Any, Any]
_Answer = TypeVar("_Answer")


class Workers:
    """The threads that do the work, and the limit on how much of it there may be.

    Parameters
    ----------
    limits
        The limits of the server.
    """

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self._running = 0
        self._threads = ThreadPoolExecutor(limits.max_concurrent_matches, "sketchmatch-worker")
        self._stops: set[threading.Event] = set()

    @contextmanager
    def admitted(self, request: Message) -> Iterator[threading.Event]:
        """Take a place for a request, and yield the event that is set when it is over.

        Raises
        ------
        InvalidInputError
            If the request is too large.
        TooBusyError
            If there is no place.
        """
        size, limit = request.ByteSize(), self.limits.max_request_bytes
        if size > limit:
            raise InvalidInputError(
                Reason.MESSAGE_TOO_LARGE,
                "",
                f"the request has {size} bytes, more than the limit of {limit}; "
                "send fewer points or a smaller picture",
            )
        if self._running >= self.limits.max_concurrent_matches:
            raise TooBusyError(self._running)
        stop = threading.Event()
        self._stops.add(stop)
        try:
            yield stop
        finally:
            self._stops.discard(stop)
            stop.set()

    @property
    def idle(self) -> bool:
        """Whether no request is under way."""
        return not self._stops

    def run(self, work: Callable[[], _Answer]) -> asyncio.Future[_Answer]:
        """Run something in a thread; its place is free again when the thread is."""

        def limited() -> _Answer:
            with limited_to(self.limits.sources):
                return work()

        loop = asyncio.get_running_loop()
        self._running += 1
        job = self._threads.submit(limited)
        job.add_done_callback(lambda _: loop.call_soon_threadsafe(self._free))
        return asyncio.wrap_future(job)

    async def close(self) -> None:
        """Stop all work that is under way and wait for its threads."""
        for stop in tuple(self._stops):
            stop.set()
        await asyncio.to_thread(self._threads.shutdown)

    def _free(self) -> None:
        self._running -= 1


class TooBusyError(SketchmatchError):
    """There is no place for one more request."""

    def __init__(self, running: int) -> None:
        super().__init__(f"{running} requests are running")
        self.running = running


class MatchService(match_service_pb2_grpc.MatchServiceServicer):
    """Matches, streaming the search while it runs."""

    def __init__(self, registry: Registry, workers: Workers) -> None:
        self._registry = registry
        self._workers = workers

    async def Match(  # type: ignore[override]  # noqa: N802
        self, request: match_service_pb2.MatchRequest, context: _Context
    ) -> None:
        """Run a match in a thread and pass its events on."""
        try:
            with self._workers.admitted(request) as stop:
                mailbox = Mailbox[match_service_pb2.MatchResponse](_is_progress)
                work = self._workers.run(lambda: self._match(request, mailbox, stop))
                async for response in mailbox:
                    await context.write(response)
                await work
        except grpc.aio.InternalError:
            return  # nobody is left to write to: the caller has gone
        except Exception as error:
            await _abort(context, error)

    def _match(
        self,
        request: match_service_pb2.MatchRequest,
        mailbox: Mailbox[match_service_pb2.MatchResponse],
        stop: threading.Event,
    ) -> None:
        try:
            value = requests.match_request(request, self._workers.limits.max_time_budget)
            writer = responses.ResponseWriter(value)
            with requests.paths_of(request), closing(run_match(value, self._registry)) as events:
                for event in events:
                    if stop.is_set():
                        return
                    mailbox.put(writer.response(event))
        finally:
            mailbox.close()


class SceneService(scene_service_pb2_grpc.SceneServiceServicer):
    """Finds the objects in one source."""

    def __init__(self, registry: Registry, workers: Workers) -> None:
        self._registry = registry
        self._workers = workers

    async def Segment(  # noqa: N802
        self, request: scene_service_pb2.SegmentRequest, context: _Context
    ) -> scene_service_pb2.SegmentResponse:
        """Segment in a thread."""
        try:
            with self._workers.admitted(request):
                return await self._workers.run(lambda: self._segment(request))
        except Exception as error:
            await _abort(context, error)

    def _segment(
        self, request: scene_service_pb2.SegmentRequest
    ) -> scene_service_pb2.SegmentResponse:
        source = requests.source(request.source, "source", request.HasField("source"))
        chosen = requests.choice(request.segmenter)
        segmenter = resolve_segmenter(self._registry, chosen, source)
        with requests.paths_of(request):
            found = segmented(source, segmenter, self._registry, f"source.{source.field}")
        return responses.segmented(found, segmenter)


class CatalogService(catalog_service_pb2_grpc.CatalogServiceServicer):
    """Says what this server can do."""

    def __init__(self, registry: Registry, limits: Limits) -> None:
        self._registry = registry
        self._limits = limits
        self._started = time.monotonic()

    async def ListAlgorithms(  # noqa: N802
        self, request: catalog_service_pb2.ListAlgorithmsRequest, context: _Context
    ) -> catalog_service_pb2.ListAlgorithmsResponse:
        """List what the registry holds."""
        del request, context
        return responses.catalogue(self._registry)

    async def GetServerInfo(  # noqa: N802
        self, request: catalog_service_pb2.GetServerInfoRequest, context: _Context
    ) -> catalog_service_pb2.GetServerInfoResponse:
        """Tell versions and limits."""
        del request, context
        limits = catalog_service_pb2.ServerLimits(
            max_request_bytes=self._limits.max_request_bytes,
            max_objects=self._limits.sources.max_objects,
            max_concurrent_matches=self._limits.max_concurrent_matches,
        )
        if self._limits.max_time_budget is not None:
            limits.max_time_budget.FromMilliseconds(round(1e3 * self._limits.max_time_budget))
        return catalog_service_pb2.GetServerInfoResponse(
            version=sketchmatch.__version__,
            api_version="sketchmatch.v1",
            plugin_api_version=API_VERSION,
            limits=limits,
            uptime=Duration(seconds=int(time.monotonic() - self._started)),
        )


def _is_progress(response: match_service_pb2.MatchResponse) -> bool:
    return response.WhichOneof("event") == "progress"


async def _abort(context: _Context, error: Exception) -> NoReturn:
    status = _status(error)
    await context.abort(status.code, status.message, status.trailing_metadata)


def _status(error: Exception) -> Refusal:
    if isinstance(error, TooBusyError):
        return too_busy(error.running)
    if isinstance(error, PluginError):
        _log.error("%s", error, exc_info=error.__cause__)
    elif not isinstance(error, SketchmatchError):
        _log.error("a request failed in a way nobody foresaw", exc_info=error)
    return refusal(error)
