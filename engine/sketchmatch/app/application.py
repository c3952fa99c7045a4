"""Requests admitted, done somewhere, and followed: what every transport stands in front of."""

from __future__ import annotations

import logging
import threading
import time
import uuid
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from typing import Protocol

from google.protobuf.message import Message

from sketchmatch.app import responses
from sketchmatch.app.children import Children
from sketchmatch.app.jobs import Job, algorithms, answers
from sketchmatch.app.setup import RequestLimits, Setup
from sketchmatch.app.tasks import Task
from sketchmatch.errors import InvalidInputError, Reason, TooBusyError
from sketchmatch.pipeline.warmup import warm_up, warm_up_others
from sketchmatch.registry import Registered, Registry
from sketchmatch_proto.v1.catalog_service_pb2 import (
    GetServerInfoResponse,
    ListAlgorithmsResponse,
)
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse

__all__ = ["Application", "Place"]

_log = logging.getLogger(__name__)


class Place(Protocol):
    """Somewhere that jobs can be done."""

    def answers(
        self, job: Job, setup: Setup, stop: threading.Event
    ) -> Generator[Message, None, None]:
        """Do a job, yielding its responses.

        Closing the generator ends it; so may ``stop``, set in another thread, while it waits.
        """


class Here:
    """Does jobs in this process, in the thread that asks for them."""

    def answers(
        self, job: Job, setup: Setup, stop: threading.Event
    ) -> Generator[Message, None, None]:
        """Do a job, yielding its responses; it waits for nothing."""
        del stop
        return answers(job, setup)


class Application:
    """Answers requests of the contract.

    Parameters
    ----------
    setup
        What they are answered with.
    """

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._began = time.monotonic()
        self._here, self._children = Here(), Children()
        self._lock = threading.Lock()
        self._running = 0
        self._threads = _threads(setup.limits)
        self._tasks: set[Task[Message]] = set()

    @property
    def setup(self) -> Setup:
        """What requests are answered with from now on; each keeps what it began with."""
        return self._setup

    def change(self, setup: Setup) -> None:
        """Answer with another setup from now on, and admit by its limits."""
        most = setup.limits.max_concurrent_matches
        if most != self._setup.limits.max_concurrent_matches:
            self._threads.shutdown(wait=False)
            self._threads = _threads(setup.limits)
        self._setup = setup

    @property
    def idle(self) -> bool:
        """Whether no task is under way."""
        return not self._tasks

    def answers(self, request: Message) -> Generator[Message, None, None]:
        """Do a request in this thread, yielding its responses; no admission, no limit of size.

        Raises
        ------
        SketchmatchError
            As the engine does, with paths of the request.
        """
        job, setup = Job(uuid.uuid4().hex, request), self._setup
        work = self._place(job, setup).answers(job, setup, threading.Event())
        yield from work

    @contextmanager
    def running(self, request: Message, caller: str = "") -> Iterator[Task[Message]]:
        """Admit a request and do it in a thread, until the end of the block.

        Parameters
        ----------
        request
            A message of the contract that wants work.
        caller
            The name of who asks; empty where nobody has names.

        Raises
        ------
        InvalidInputError
            If it is too large.
        TooBusyError
            If there is no room for it.
        """
        setup = self._setup
        _check_size(request, setup.limits)
        task = Task[Message](uuid.uuid4().hex, caller)
        self._take_place(setup.limits)
        self._tasks.add(task)
        try:
            self._threads.submit(self._run, task, Job(task.id, request), setup)
            yield task
        finally:
            self._tasks.discard(task)
            task.stop()

    def algorithms(self) -> ListAlgorithmsResponse:
        """Return what there is to choose from."""
        return responses.catalogue(self._setup.engine.registry, self._setup.engine.defaults)

    def info(self) -> GetServerInfoResponse:
        """Return versions and limits."""
        return responses.server_info(self._setup, time.monotonic() - self._began)

    def warm_up(self, unwanted: Callable[[], bool], warm: Callable[[Registered], None]) -> None:
        """Compile what the default pipeline needs in this process, telling of what is warm."""
        setup = self._setup
        warm_up(_trusted(setup), setup.engine.defaults, unwanted, warm)

    def warm_up_others(
        self,
        unwanted: Callable[[], bool],
        stop: threading.Event,
        warm: Callable[[Registered], None],
    ) -> None:
        """Compile the rest, strangers' algorithms in processes of their own."""
        setup = self._setup
        warm_up_others(_trusted(setup), setup.engine.defaults, unwanted, warm)
        strangers = _strangers(setup)
        for distribution in sorted({item.distribution for item in strangers}):
            if unwanted():
                return
            own = tuple(item for item in strangers if item.distribution == distribution)
            try:
                self._children.warm_up(own, setup, stop)
            except Exception:  # it will fail again, and be blamed, when a request asks for it
                _log.exception("the plugins of %s failed to warm up", distribution)
            else:
                for item in own:
                    warm(item)

    def close(self) -> None:
        """Stop all tasks that are under way and wait for their threads and processes."""
        for task in tuple(self._tasks):
            task.stop()
        self._threads.shutdown()
        self._children.close()

    def _run(self, task: Task[Message], job: Job, setup: Setup) -> None:
        """Do a job, and tell of it in its task's log; its place is free when this ends."""
        error: BaseException | None = None
        try:
            work = self._place(job, setup).answers(job, setup, task.stopping)
            with closing(work) as told:
                for response in told:
                    if task.stopping.is_set():
                        break
                    task.log.add(response, news=_is_progress(response))
        except BaseException as raised:
            error = raised
        finally:
            with self._lock:
                self._running -= 1
            task.log.end(error)

    def _place(self, job: Job, setup: Setup) -> Place:
        """Return where a job is to be done."""
        if setup.isolation.strangers(algorithms(job, setup)):
            return self._children
        return self._here

    def _take_place(self, limits: RequestLimits) -> None:
        with self._lock:
            if self._running >= limits.max_concurrent_matches:
                raise TooBusyError(self._running)
            self._running += 1


def _threads(limits: RequestLimits) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(limits.max_concurrent_matches, "sketchmatch-worker")


def _check_size(request: Message, limits: RequestLimits) -> None:
    size, limit = request.ByteSize(), limits.max_request_bytes
    if size > limit:
        raise InvalidInputError(
            Reason.MESSAGE_TOO_LARGE,
            "",
            f"the request has {size} bytes, more than the limit of {limit}; "
            "send fewer points or a smaller picture",
        )


def _strangers(setup: Setup) -> tuple[Registered, ...]:
    return setup.isolation.strangers(setup.engine.registry.algorithms)


def _trusted(setup: Setup) -> Registry:
    """Return the algorithms that run in this process."""
    return setup.engine.registry.without(*(item.distribution for item in _strangers(setup)))


def _is_progress(response: Message) -> bool:
    return isinstance(response, MatchResponse) and response.WhichOneof("event") == "progress"
