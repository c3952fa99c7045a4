"""The three services of the contract, over the pipeline."""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from typing import Any, NoReturn, TypeVar

import grpc
from google.protobuf.duration_pb2 import Duration
from google.protobuf.message import Message

import sketchmatch
from sketchmatch.api import API_VERSION
from sketchmatch.errors import InvalidInputError, Reason, SketchmatchError
from sketchmatch.model.limits import limited_to
from sketchmatch.server import responses, work
from sketchmatch.server.child import Job, Method
from sketchmatch.server.isolation import Children, IsolatedFailureError, Watch
from sketchmatch.server.limits import Limits
from sketchmatch.server.mailbox import Mailbox
from sketchmatch.server.setup import Current, Setup
from sketchmatch.server.status import Refusal, is_fault, refusal, too_busy
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
        self._threads = _threads(limits)
        self._stops: set[threading.Event] = set()

    def change_limits(self, limits: Limits) -> None:
        """Admit requests by other limits from now on."""
        if limits.max_concurrent_matches != self.limits.max_concurrent_matches:
            self._threads.shutdown(wait=False)
            self._threads = _threads(limits)
        self.limits = limits

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

    def run(self, job: Callable[[], _Answer]) -> asyncio.Future[_Answer]:
        """Run something in a thread; its place is free again when the thread is."""
        sources = self.limits.sources

        def limited() -> _Answer:
            with limited_to(sources):
                return job()

        loop = asyncio.get_running_loop()
        self._running += 1
        running = self._threads.submit(limited)
        running.add_done_callback(lambda _: loop.call_soon_threadsafe(self._free))
        return asyncio.wrap_future(running)

    async def close(self) -> None:
        """Stop all work that is under way and wait for its threads."""
        for stop in tuple(self._stops):
            stop.set()
        await asyncio.to_thread(self._threads.shutdown)

    def _free(self) -> None:
        self._running -= 1


def _threads(limits: Limits) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(limits.max_concurrent_matches, "sketchmatch-worker")


class TooBusyError(SketchmatchError):
    """There is no place for one more request."""

    def __init__(self, running: int) -> None:
        super().__init__(f"{running} requests are running")
        self.running = running


class MatchService(match_service_pb2_grpc.MatchServiceServicer):
    """Matches, streaming the search while it runs."""

    def __init__(self, current: Current, workers: Workers, children: Children) -> None:
        self._current = current
        self._workers = workers
        self._children = children

    async def Match(  # type: ignore[override]  # noqa: N802
        self, request: match_service_pb2.MatchRequest, context: _Context
    ) -> None:
        """Run a match in a thread and pass its events on."""
        try:
            with self._workers.admitted(request) as stop:
                mailbox = Mailbox[match_service_pb2.MatchResponse](_is_progress)
                job = self._workers.run(lambda: self._match(request, mailbox, stop))
                async for response in mailbox:
                    await context.write(response)
                await job
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
            with closing(self._responses(request, stop)) as responding:
                for response in responding:
                    if stop.is_set():
                        return
                    mailbox.put(response)
        finally:
            mailbox.close()

    def _responses(
        self, request: match_service_pb2.MatchRequest, stop: threading.Event
    ) -> Generator[match_service_pb2.MatchResponse, None, None]:
        setup = self._current.setup
        value = work.read_match(request, setup)
        strangers = setup.isolation.strangers(work.match_algorithms(value, setup))
        if not strangers:
            yield from work.match_responses(request, value, setup)
            return
        job = _job(Method.MATCH, request, setup)
        watch = Watch(strangers, setup.isolation.patience, value.time_budget)
        for answer in self._children.answer(job, watch, stop):
            yield match_service_pb2.MatchResponse.FromString(answer)


class SceneService(scene_service_pb2_grpc.SceneServiceServicer):
    """Finds the objects in one source."""

    def __init__(self, current: Current, workers: Workers, children: Children) -> None:
        self._current = current
        self._workers = workers
        self._children = children

    async def Segment(  # noqa: N802
        self, request: scene_service_pb2.SegmentRequest, context: _Context
    ) -> scene_service_pb2.SegmentResponse:
        """Segment in a thread."""
        try:
            with self._workers.admitted(request) as stop:
                return await self._workers.run(lambda: self._segment(request, stop))
        except Exception as error:
            await _abort(context, error)

    def _segment(
        self, request: scene_service_pb2.SegmentRequest, stop: threading.Event
    ) -> scene_service_pb2.SegmentResponse:
        setup = self._current.setup
        source = work.read_source(request)
        strangers = setup.isolation.strangers(work.segment_algorithms(request, source, setup))
        if not strangers:
            return work.segment_response(request, source, setup)
        job = _job(Method.SEGMENT, request, setup)
        watch = Watch(strangers, setup.isolation.patience)
        answers = list(self._children.answer(job, watch, stop))
        # Nobody waits for an answer to a request that was stopped.
        answer = answers[0] if answers else b""
        return scene_service_pb2.SegmentResponse.FromString(answer)


class CatalogService(catalog_service_pb2_grpc.CatalogServiceServicer):
    """Says what this server can do."""

    def __init__(self, current: Current) -> None:
        self._current = current
        self._started = time.monotonic()

    async def ListAlgorithms(  # noqa: N802
        self, request: catalog_service_pb2.ListAlgorithmsRequest, context: _Context
    ) -> catalog_service_pb2.ListAlgorithmsResponse:
        """List what the registry holds."""
        del request, context
        setup = self._current.setup
        return responses.catalogue(setup.registry, setup.defaults)

    async def GetServerInfo(  # noqa: N802
        self, request: catalog_service_pb2.GetServerInfoRequest, context: _Context
    ) -> catalog_service_pb2.GetServerInfoResponse:
        """Tell versions and limits."""
        del request, context
        given = self._current.setup.limits
        limits = catalog_service_pb2.ServerLimits(
            max_request_bytes=given.max_request_bytes,
            max_objects=given.sources.max_objects,
            max_concurrent_matches=given.max_concurrent_matches,
        )
        if given.max_time_budget is not None:
            limits.max_time_budget.FromMilliseconds(round(1e3 * given.max_time_budget))
        return catalog_service_pb2.GetServerInfoResponse(
            version=sketchmatch.__version__,
            api_version="sketchmatch.v1",
            plugin_api_version=API_VERSION,
            limits=limits,
            uptime=Duration(seconds=int(time.monotonic() - self._started)),
        )


def _job(method: Method, request: Message, setup: Setup) -> Job:
    return Job(
        method,
        request.SerializeToString(),
        setup.defaults,
        setup.limits,
        setup.isolation.patience,
    )


def _is_progress(response: match_service_pb2.MatchResponse) -> bool:
    return response.WhichOneof("event") == "progress"


async def _abort(context: _Context, error: Exception) -> NoReturn:
    status = _status(error)
    await context.abort(status.code, status.message, status.trailing_metadata)


def _status(error: Exception) -> Refusal:
    if isinstance(error, TooBusyError):
        return too_busy(error.running)
    if isinstance(error, IsolatedFailureError):
        if error.log:
            _log.error("%s\n%s", error, error.log)
        return error.refusal
    if is_fault(error):
        _log.error("%s", error, exc_info=error)
    return refusal(error)
