"""Requests admitted, done somewhere, and followed: what every transport stands in front of."""

from __future__ import annotations

import asyncio
import hashlib
import json
import logging
import math
import time
import uuid
from collections.abc import AsyncIterator, Callable, Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager, closing, contextmanager, suppress
from dataclasses import replace
from operator import attrgetter
from typing import NamedTuple, Protocol, TypeVar

from google.protobuf.message import Message

from sketchmatch.app import responses
from sketchmatch.app.archive import Archive
from sketchmatch.app.frames import Flag
from sketchmatch.app.jobs import Job, answers
from sketchmatch.app.keeping import Keeping
from sketchmatch.app.matches import Matches
from sketchmatch.app.orders import Order, Wish
from sketchmatch.app.packed import check_size
from sketchmatch.app.quotas import Rates
from sketchmatch.app.remembered import Remembered
from sketchmatch.app.scenes import SceneArchive
from sketchmatch.app.setup import Setup
from sketchmatch.app.sketches import Sketches
from sketchmatch.app.tasks import Record, State, Task
from sketchmatch.app.waiting import Caller, FairQueue
from sketchmatch.app.worker import flags
from sketchmatch.app.workers import Workers
from sketchmatch.errors import (
    MatchCancelledError,
    MatchInterruptedError,
    ServerStoppingError,
    TooBusyError,
    WorkerLostError,
    counted,
)
from sketchmatch.pipeline.clock import Clock
from sketchmatch.pipeline.memory import Lookups
from sketchmatch.pipeline.warmup import (
    COMPILING,
    announcing_compilation,
    default_algorithms,
    warm_up,
    warm_up_others,
)
from sketchmatch.registry import Registered, Registry
from sketchmatch_proto.v1.catalog_service_pb2 import (
    GetServerInfoResponse,
    ListAlgorithmsResponse,
)
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest, MatchResponse

__all__ = ["Application", "Load", "Place"]

_log = logging.getLogger(__name__)
_LOOK = 0.05
_MOMENT = 0.005
_LONGEST_RETRY = 60
_FIRST_GUESS = 1.0
_STOPS = "the server is about to stop"
_Ended = Callable[[Task, BaseException | None], None]
_Match = TypeVar("_Match", bound=Task | Record)


class Load(NamedTuple):
    """How busy an application is.

    Attributes
    ----------
    running, waiting, waiting_bytes
        Requests that run, those that wait, and how many bytes these have.
    workers, busy_workers
        Worker processes, and those that do something.
    """

    running: int = 0
    waiting: int = 0
    waiting_bytes: int = 0
    workers: int = 0
    busy_workers: int = 0


class Place(Protocol):
    """Somewhere that tasks can be done; it tells of their ends in the event loop."""

    def begin(self, task: Task) -> None:
        """Do a task."""

    def stop(self, task: Task) -> None:
        """See that a task ends soon, whatever comes of it."""

    def curtail(self, seconds: float) -> None:
        """Leave the tasks so much time to come to an end with what they have."""

    async def close(self) -> None:
        """End the tasks, and wait for that."""


class Here:
    """Does tasks in threads of this process."""

    def __init__(self, ended: _Ended) -> None:
        self._ended = ended
        self._threads = ThreadPoolExecutor(1024, "sketchmatch-worker")  # no more than are needed
        self._clocks: dict[Task, Clock | None] = {}

    def begin(self, task: Task) -> None:
        """Do a task."""
        self._clocks[task] = None
        self._threads.submit(self._run, task, asyncio.get_running_loop())

    def stop(self, task: Task) -> None:
        """See that a task ends at its next step."""
        task.stopping.set()

    def curtail(self, seconds: float) -> None:
        """Leave the tasks so much time to come to an end with what they have."""
        for clock in tuple(self._clocks.values()):
            if clock is not None:
                clock.curtail(seconds)

    async def close(self) -> None:
        """End the tasks, and wait for that."""
        for task in tuple(self._clocks):
            self.stop(task)
        await asyncio.to_thread(self._threads.shutdown)

    def _run(self, task: Task, loop: asyncio.AbstractEventLoop) -> None:
        error: BaseException | None = None

        def begun(clock: Clock) -> None:
            self._clocks[task] = clock

        try:
            with closing(answers(_job(task), task.setup, begun)) as work:
                for response in work:
                    if task.stopping.is_set():
                        break
                    news = bool(flags(response) & Flag.NEWS)
                    task.log.add(response.SerializeToString(), news=news)
        except BaseException as raised:
            error = raised
        del self._clocks[task]
        loop.call_soon_threadsafe(self._ended, task, error)


class Application:
    """Answers requests of the contract.

    All but :meth:`answers` and what tells of it belongs into one event loop.

    Parameters
    ----------
    setup
        What they are answered with.
    workers
        How many worker processes wait at least; without any, requests are answered in threads of
        this process, but for strangers' plugins.
    scenes, archive
        Where scenes and matches are kept; None for nowhere.
    matched
        Called when a match has ended that has a result, with its events but progress, and the
        seconds that it waited for its turn.
    looked_up
        Told, whenever a request has ended, where the histograms of scenes came from.

    Attributes
    ----------
    scenes
        The scenes that are kept.
    sketches
        The sketches in progress.
    matches
        All matches that are known.
    """

    def __init__(
        self,
        setup: Setup,
        workers: int = 0,
        scenes: SceneArchive | None = None,
        archive: Archive | None = None,
        matched: Callable[[list[MatchResponse], float], None] = lambda *_: None,
        looked_up: Callable[[Lookups], None] = lambda _: None,
    ) -> None:
        self.scenes = Keeping(self, scenes)
        self.sketches = Sketches(self)
        self._remembered = Remembered(self.scenes.path)
        self._setup = self._remembering(setup)
        self._kept = workers
        self.matches = Matches(archive)
        self._matched = matched
        self._looked_up = looked_up
        self._began = time.monotonic()
        self._workers = Workers(workers, self._ended, self._dispatch)
        self._workers.scenes = self.scenes.path
        self._workers.described = self.scenes.keep
        self._workers.looked_up = looked_up
        self._here = Here(self._ended)
        self._running: set[Task] = set()
        self._waiting = FairQueue[Task](lambda task: task.wish.priority)
        self._rates = Rates()
        self._typical = _FIRST_GUESS
        self._stopping = False
        self._inflating = asyncio.Lock()
        self._unread = 0
        self._load = Load()
        self._looking: asyncio.Task[None] | None = None
        self._catalogue: tuple[Setup, ListAlgorithmsResponse] | None = None

    @property
    def setup(self) -> Setup:
        """What requests are answered with from now on; each keeps what it began with."""
        return self._setup

    def change(self, setup: Setup) -> None:
        """Answer with another setup from now on, and admit by its limits."""
        self._setup = self._remembering(setup)
        self._workers.change(self._setup)
        self._dispatch()

    @property
    def idle(self) -> bool:
        """Whether no task is under way."""
        return not (self._running or self._waiting)

    @property
    def load(self) -> Load:
        """How busy it was a moment ago; from any thread."""
        return self._load

    def answers(self, request: Message) -> Generator[Message, None, None]:
        """Do a request in this thread, yielding its responses; no admission, no limit of size.

        Raises
        ------
        SketchmatchError
            As the engine does, with paths of the request.
        """
        return answers(Job(uuid.uuid4().hex, request), self._setup)

    @contextmanager
    def running(
        self,
        kind: str,
        data: bytes,
        caller: Caller = Caller(),  # noqa: B008
        brought: tuple[bytes, ...] = (),
        former: tuple[bytes, bytes] | None = None,
        inner: bool = False,
    ) -> Iterator[Task]:
        """Admit a request and do it, in its turn, until the end of the block.

        Parameters
        ----------
        kind, data
            Name of the message, and the message.
        caller
            Who asks.
        brought, former, inner
            As of an :class:`~sketchmatch.app.orders.Order`.

        Raises
        ------
        InvalidInputError
            If it is too large.
        TooBusyError
            If there is no room for it. One that waited in vain is told in the task's log.
        ServerStoppingError
            If nothing is begun any more.
        """
        order = Order(uuid.uuid4().hex, kind, data, caller.known, brought, former, inner)
        with self.reading(self._begun(order, caller)) as task:
            yield task

    @asynccontextmanager
    async def matching(
        self,
        data: bytes,
        caller: Caller = Caller(),  # noqa: B008
    ) -> AsyncIterator[Task | Record]:
        """Read the match that a request asks for, which begins if there is no such match yet.

        It stops at the end of the block if nobody else reads it, unless it is to keep running.

        Parameters
        ----------
        data
            The request, encoded.
        caller
            Who asks.

        Raises
        ------
        SketchmatchError
            As :meth:`running` does.
        InvalidInputError
            If the caller gave the request's name to another.
        """
        check_size(len(data), self._setup.limits.max_request_bytes)
        order = Order(uuid.uuid4().hex, MatchRequest.DESCRIPTOR.name, data, caller.known)
        wish = await self._wish(order)
        if wish.request_id:  # the same name again if all that was known of the match is lost
            order = replace(order, id=_name_of(caller.name, wish.request_id))
        match = await self.matches.same(caller.name, wish)
        if match is None:
            match = self._begun(order, caller, wish)
        elif isinstance(match, Record) and match.state is State.INTERRUPTED:
            match = self._begun(order, caller, wish, match)
        with self.reading(match):
            yield match

    @contextmanager
    def reading(self, match: _Match) -> Iterator[_Match]:
        """Read a match until the end of the block, and stop it then as :meth:`matching` does."""
        if isinstance(match, Record):
            yield match
            return
        match.readers += 1
        try:
            yield match
        finally:
            match.readers -= 1
            if not (match.readers or match.wish.keep_running):
                problem = "the match was stopped because no client was reading it any more"
                self._stop(match, MatchInterruptedError(problem))

    def cancel(self, match: Task | Record) -> Record:
        """Stop a match, whoever reads it, and return how it is."""
        error = MatchCancelledError("the match was cancelled")
        if isinstance(match, Record):
            return self.matches.cancelled(match, error)
        self._stop(match, error)
        return match.record()

    def algorithms(self) -> ListAlgorithmsResponse:
        """Return what there is to choose from, put together once for each setup."""
        setup = self._setup
        if self._catalogue is None or self._catalogue[0] is not setup:
            listed = responses.catalogue(setup.engine.registry, setup.engine.defaults)
            self._catalogue = setup, listed
        return self._catalogue[1]

    def info(self) -> GetServerInfoResponse:
        """Return versions and limits."""
        uptime = time.monotonic() - self._began
        return responses.server_info(self._setup, uptime, self.scenes.path is not None)

    async def start(
        self,
        say: Callable[[str], None],
        unwanted: Callable[[], bool] = lambda: False,
        warm: Callable[[Registered], None] = lambda _: None,
    ) -> None:
        """Get ready: compile or load what the default pipeline needs.

        Parameters
        ----------
        say
            Called, once, if kernels have to be compiled, which takes long.
        unwanted
            Whether nobody waits any more.
        warm
            Called with each algorithm that is ready, from any thread.
        """
        silent = True

        def compiling() -> None:
            nonlocal silent
            if silent:
                silent = False
                say(COMPILING)

        self._looking = asyncio.create_task(self._look())
        await self.scenes.open()
        if self._kept:
            self._workers.compiling = compiling
            await self._workers.start(self._setup)
        with announcing_compilation(say):
            await self.warm_up(unwanted, warm)

    async def warm_up(
        self, unwanted: Callable[[], bool], warm: Callable[[Registered], None]
    ) -> None:
        """Compile what the default pipeline needs, which workers have when they are started."""
        registry, defaults = _trusted(self._setup), self._setup.engine.defaults
        if self._kept:
            for item in default_algorithms(registry, defaults):
                warm(item)
        else:
            await asyncio.to_thread(warm_up, registry, defaults, unwanted, warm)

    async def warm_up_others(
        self, unwanted: Callable[[], bool], warm: Callable[[Registered], None]
    ) -> None:
        """Compile the rest, strangers' algorithms in workers of their own."""
        setup = self._setup
        registry, defaults = _trusted(setup), setup.engine.defaults
        if not self._kept:
            await asyncio.to_thread(warm_up_others, registry, defaults, unwanted, warm)
        elif not await asyncio.to_thread(unwanted):
            with suppress(WorkerLostError):
                await self._workers.warm_up((), setup)
                for algorithm in registry.algorithms:
                    warm(algorithm)
        for distribution in sorted({item.distribution for item in setup.strangers}):
            if await asyncio.to_thread(unwanted):
                return
            own = tuple(item for item in setup.strangers if item.distribution == distribution)
            try:
                await self._workers.warm_up(own, setup)
            except Exception:  # it will fail again, and be blamed, when a request asks for it
                _log.exception("the plugins of %s failed to warm up", distribution)
            else:
                for item in own:
                    if isinstance(item, Registered):
                        warm(item)

    async def drain(self, seconds: float) -> None:
        """Begin nothing more; what runs ends by itself, or in so many seconds with what it has."""
        self._stopping = True
        self.sketches.stop()
        for task in tuple(self._waiting):
            self._waiting.remove(task, task.caller)
            self._finish(task, ServerStoppingError(_STOPS))
        deadline = time.monotonic() + seconds
        while self._running and time.monotonic() < deadline:
            await asyncio.sleep(_LOOK)
        for place in (self._here, self._workers):
            place.curtail(0.0)

    async def close(self) -> None:
        """End all tasks that are under way, and wait for their threads and processes."""
        self._stopping = True
        self.sketches.stop()
        for task in tuple(self._running):
            self._stop(task, ServerStoppingError(_STOPS))
        await self._here.close()
        await self._workers.close()
        while self._running:  # ends that threads told of
            await asyncio.sleep(_MOMENT)
        await self.matches.close()
        await self.scenes.close()
        self._remembered.close()
        if self._looking is not None:
            self._looking.cancel()

    def _remembering(self, setup: Setup) -> Setup:
        """Return a setup with what this process remembers of scenes."""
        return self._remembered.setup(setup, self.scenes.keep_described)

    async def _wish(self, order: Order) -> Wish:
        limit = self._setup.limits.max_request_bytes
        if not order.is_large:
            return order.wish(limit)
        full = self._full(1, self._unread + order.size)
        if full and (self._unread or not self._has_room()):
            raise self._busy(full)  # before memory is spent on it
        self._unread += order.size
        try:
            async with self._inflating:  # one at a time: a few bytes may become very many
                return await asyncio.to_thread(order.wish, limit)
        finally:
            self._unread -= order.size

    def _begun(
        self,
        order: Order,
        caller: Caller,
        wish: Wish = Wish(),  # noqa: B008
        former: Record | None = None,
    ) -> Task:
        """Return a request that is admitted."""
        setup = self._setup
        if self._stopping:
            raise ServerStoppingError(_STOPS)
        check_size(len(order.data), setup.limits.max_request_bytes)
        task = Task(order, setup, caller, wish, former)
        if not order.inner:
            self._rates.take(caller.name, setup.limits.max_per_minute)
        task.long = bool(self._kept) and not task.strangers and self._workers.lengths.is_long(order)
        self._admit(task)
        if order.is_match:
            self.matches.begin(task)
        return task

    def _stop(self, task: Task, why: BaseException) -> None:
        """See that a task comes to an end, unless it has."""
        if self._waiting.remove(task, task.caller):
            self._finish(task, why)
        elif task in self._running:
            task.stop(why)
            self.matches.changed(task)
            self._place(task).stop(task)

    def _finish(self, task: Task, error: BaseException | None = None) -> None:
        """Tell of the end of a task."""
        task.end(error)
        if not task.order.is_match:
            return
        self.matches.end(task)
        if task.state is State.SUCCEEDED:
            self._matched(task.events(), task.waited)

    def _admit(self, task: Task) -> None:
        """Let a task begin or wait; if there is no room, it or those of the greediest go away."""
        self._waiting.add(task, task.caller)
        self._dispatch()
        while full := self._full():
            too_many = len(self._waiting) > self._setup.limits.max_waiting
            crowded = self._waiting.crowd_out(task.caller, _one if too_many else _size)
            assert crowded is not None
            if crowded[0] is task:
                raise self._busy(full)
            self._finish(crowded[0], self._busy(full))

    def _full(self, requests: int = 0, size: int = 0) -> str:
        """Return which limit would be passed if so many more waited, of so many bytes."""
        limits = self._setup.limits
        if len(self._waiting) + requests > limits.max_waiting:
            waiting = f" and {limits.max_waiting} are waiting" if limits.max_waiting else ""
            return f"{waiting}, which is its limit"
        if sum(map(_size, self._waiting)) + size > limits.max_waiting_bytes:
            return (
                f", and the waiting ones would have more than {limits.max_waiting_bytes} bytes "
                "together, which is its limit"
            )
        return ""

    def _busy(self, full: str) -> TooBusyError:
        """Return the error of a request for which there is no room."""
        running = len(self._running)
        there_are = f"{counted(running, 'request')} {'is' if running == 1 else 'are'} running"
        return TooBusyError(f"the server is busy: {there_are}{full}", self._retry_seconds())

    def _dispatch(self) -> None:
        """Begin what waits, as far as there are places."""
        while len(self._running) < self._setup.limits.max_concurrent_matches:
            task = self._waiting.take(self._fits if self._has_room() else self._gives_way)
            if task is None:
                return
            self._running.add(task)
            task.begin()
            self._place(task).begin(task)

    def _has_room(self) -> bool:
        """Whether there is a place: one a worker, and more beside what gives way to it."""
        short = sum(1 for task in self._running if not (task.long or task.strangers))
        all_places = len(self._running) < self._setup.limits.max_concurrent_matches
        return all_places and (not self._kept or short < self._kept)

    def _fits(self, task: Task) -> bool:
        """Whether a task may have a place: neither strangers nor a caller ever have all.

        What is expected to be long leaves those to the others that short ones are likely to want.
        """
        most = self._setup.limits.max_per_caller
        if most is not None:
            name = task.caller.name
            if sum(1 for other in self._running if other.caller.name == name) >= most:
                return False
        if task.long:
            places = self._setup.limits.max_concurrent_matches - self._kept
            return sum(1 for other in self._running if other.long) < max(1, places)
        if not task.strangers:
            return True
        theirs = sum(1 for other in self._running if other.strangers)
        return theirs < self._setup.limits.strangers_places

    def _gives_way(self, task: Task) -> bool:
        """Whether a task may have a place where those for short ones are taken."""
        return task.long and self._fits(task)

    def _place(self, task: Task) -> Place:
        return self._workers if self._kept or task.strangers else self._here

    def _ended(self, task: Task, error: BaseException | None) -> None:
        """Tell of the end of a task in its log, and give its place to the next."""
        if isinstance(error, WorkerLostError) and not (task.log.begun or task.again):
            task.again = True
            self._workers.begin(task)
            return
        self._running.discard(task)
        self._looked_up(self._remembered.take_lookups())
        taken = time.monotonic() - task.asked
        self._typical += 0.1 * (min(taken, _LONGEST_RETRY) - self._typical)
        self._finish(task, error)
        self._dispatch()

    def _retry_seconds(self) -> int:
        """Return when there is likely to be room: when half of what waits has had its turn."""
        places = self._setup.limits.max_concurrent_matches
        turns = math.ceil((1 + len(self._waiting) / 2) / places)
        return max(1, min(_LONGEST_RETRY, math.ceil(self._typical * turns)))

    async def _look(self) -> None:
        """See to what nobody else would notice: silence, and too long a wait."""
        while True:
            await asyncio.sleep(_LOOK)
            try:
                self._workers.look()
                self.sketches.look()
                self._look_at_tasks()
            except Exception:  # nobody else would look from then on
                _log.exception("the regular check of workers, sketches and waiting requests failed")

    def _look_at_tasks(self) -> None:
        size = sum(map(_size, self._waiting))
        self._load = Load(
            len(self._running), len(self._waiting), size, self._workers.count, self._workers.busy
        )
        for task in self._running:
            if task.log.kept > task.noted:
                task.noted = task.log.kept
                self.matches.changed(task)
        now, longest = time.monotonic(), self._setup.limits.max_wait
        for task in [task for task in self._waiting if now - task.asked > longest]:
            self._waiting.remove(task, task.caller)
            problem = f"the request waited {longest:g} s for its turn, which is the limit"
            self._finish(task, TooBusyError(problem, self._retry_seconds()))


def _name_of(caller: str, request_id: str) -> str:
    """Return the name of the match that a caller gave a name to."""
    named = json.dumps([caller, request_id]).encode()
    return hashlib.blake2b(named, digest_size=16).hexdigest()


_size = attrgetter("size")


def _one(_: Task) -> int:
    return 1


def _job(task: Task) -> Job:
    return task.order.job(task.setup.limits.max_request_bytes)


def _trusted(setup: Setup) -> Registry:
    """Return the algorithms that run in this process."""
    return setup.engine.registry.without(*(item.distribution for item in setup.strangers))
