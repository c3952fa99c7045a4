"""The worker processes of a server: each does one request at a time, and may be lost.

A thread cannot be stopped from outside, a loop in plain Python holds up all threads of its process,
a crash ends them, and threads of one process take turns to run Python. So requests are answered in
processes, as many as run at a time; they decode, match and serialise, and what the server itself
does is to pass bytes on. A worker that has ended, or that does not stop when it is told to, is
killed and replaced.

One rule more holds for other people's plugins: a worker loads those that it was started for, and a
request that asks for one is answered by a worker of that kind. If that one gives no sign of life
for too long, does not end when its time is over, or ends its process, then the request fails with
the names of plugin and distribution. A worker in which a plugin has failed, or has left threads
behind, does no other request.
"""

from __future__ import annotations

import asyncio
import atexit
import logging
import math
import os
import pickle
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, cast
from weakref import WeakSet

from sketchmatch.app.forking import forking, renew
from sketchmatch.app.frames import Flag, Frames, Says, failure_of, frame
from sketchmatch.app.jobs import time_budget
from sketchmatch.app.lengths import Lengths
from sketchmatch.app.setup import Setup
from sketchmatch.app.tasks import Task
from sketchmatch.app.worker import LOOKUPS, SECONDS, WorkerSetup, live
from sketchmatch.errors import InvalidInputError, PluginError, WorkerLostError
from sketchmatch.pipeline.memory import Lookups
from sketchmatch.registry import OWN_DISTRIBUTION, Registered, RegisteredReader
from sketchmatch.registry.distributions import canonical

if TYPE_CHECKING:
    from multiprocessing.context import SpawnProcess

__all__ = ["WorkerError", "Workers"]

_log = logging.getLogger(__name__)

_MOMENT = 0.01
_STOPPING = 0.5
_OVERTIME = 2.0
_STARTING = 60.0
_WARMING = 120.0
_IDLE_SECONDS = 30.0
_LONG_PROCESSOR, _LONG, _STUCK = 0.2, 0.5, 5.0
"""Seconds of processor time after which a request gives way to those that may be short.

Those that may be short are done one a processor: more would only hold each other up. On a busy
machine a short one takes long, too; so other time counts only where the system does not tell that
of the processor, and for what waits for something else than a processor.
"""
_COMPILING = 2
"""Workers that compile at the same time: one begins at the beginning, and one at the end."""
_GIVES_WAY = 10
_NAMED = 5
_TICKS = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100
_REMEDY = "report it to its author, or choose another"
_Key = frozenset[tuple[str, str]]
"""Distributions, with their versions, whose algorithms a worker loads beside the engine's own."""
_Strangers = tuple[Registered | RegisteredReader, ...]
_Ended = Callable[[Task, BaseException | None], None]


class WorkerError(Exception):
    """Something that nobody foresaw happened in a worker; it says where."""


class Workers:
    """All workers of a server.

    Parameters
    ----------
    kept
        How many wait at least, for requests that need no stranger's plugin.
    ended
        Called when a task has come to its end, with the error if there was one.
    gave_way
        Called when a task turns out to be long.
    """

    def __init__(self, kept: int, ended: _Ended, gave_way: Callable[[], None]) -> None:
        self.compiling: Callable[[], None] = lambda: None
        """Called whenever a worker has to compile a kernel."""
        self.described: Callable[[bytes], None] = lambda _: None
        self.looked_up: Callable[[Lookups], None] = lambda _: None
        """Called with what a worker that needs no stranger's plugin hands in to be kept."""
        self.scenes: Path | None = None
        """The file of the scenes that are kept."""
        self.gave_way = gave_way
        self.lengths = Lengths()
        """How long requests take that need no stranger's plugin."""
        self._kept = kept
        self._ended = ended
        self._all: set[_Worker] = set()
        self._doing: dict[Task, _Worker] = {}
        self._own: _Key = frozenset()
        self._background: set[asyncio.Task[None]] = set()
        self._closing = False

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self._all)

    @property
    def busy(self) -> int:
        """How many of them do a request."""
        return len(self._doing)

    async def start(self, setup: Setup) -> None:
        """Start the workers that are kept: two first, since they may have to compile kernels.

        Raises
        ------
        WorkerLostError
            If that cannot be done.
        """
        self._own = _own(setup)
        first = [self._new(self._own, ()) for _ in range(min(self._kept, _COMPILING))]
        await asyncio.gather(
            *(each.start(setup, backwards=bool(k)) for k, each in enumerate(first))
        )
        if any(each.compiled for each in first):
            renew()
        others = [self._new(self._own, ()) for _ in range(self._kept - len(first))]
        await asyncio.gather(*(each.start(setup) for each in others))

    def change(self, setup: Setup) -> None:
        """Keep workers for another setup from now on."""
        self._own = _own(setup)

    def begin(self, task: Task) -> None:
        """Let a worker do a task, unless it is known already that it is refused."""
        if task.refusal is not None:
            asyncio.get_running_loop().call_soon(self.done, task, task.refusal)
            return
        key = _key(task)
        idle = [each for each in self._all if each.idle and each.key == key]
        if idle:
            self._begin(task, max(idle, key=lambda each: each.since))
        else:
            self._in_background(self._begin_in_new(task, self._new(key, task.strangers)))

    def stop(self, task: Task) -> None:
        """See that a task ends soon, whatever comes of it."""
        task.stopping.set()
        if (worker := self._doing.get(task)) is not None:
            worker.stop()

    def curtail(self, seconds: float) -> None:
        """Leave the tasks so much time to come to an end with what they have."""
        for worker in self._doing.values():
            worker.send(Says.CURTAIL, SECONDS.pack(seconds))

    def look(self) -> None:
        """See that nobody is silent or idle for too long; to be called many times a second."""
        now = time.monotonic()
        waiting = sorted(
            (each for each in self._all if each.idle and each.key == self._own),
            key=lambda each: each.since,
        )
        for worker in tuple(self._all):
            kept = worker in waiting[-self._kept :] if self._kept else False
            if worker.idle and not kept and now - worker.since > _IDLE_SECONDS:
                worker.kill()
            else:
                worker.look(now)

    async def warm_up(self, strangers: _Strangers, setup: Setup) -> None:
        """Compile, in a worker that then ends, what requests may ask for.

        Parameters
        ----------
        strangers
            The algorithms of one distribution, or none for those that need no worker of their own.
        setup
            What the server answers with.

        Raises
        ------
        SketchmatchError, WorkerError
            If that fails.
        """
        worker = self._new(_own(setup) | _versions(strangers), strangers)
        try:
            await worker.start(setup)
            await worker.warm_up()
        finally:
            worker.kill()

    async def close(self) -> None:
        """Kill all workers, those too that are asked for from now on, and wait until they end."""
        self._closing = True
        for worker in tuple(self._all):
            worker.kill()
        while self._all or self._background:
            await asyncio.sleep(_MOMENT)

    def lost(self, worker: _Worker) -> None:
        """Bury a worker whose connection is gone."""
        self._all.discard(worker)
        self._in_background(self._bury(worker))

    async def _bury(self, worker: _Worker) -> None:
        error = await worker.buried()
        for task in [task for task, each in self._doing.items() if each is worker]:
            self.done(task, None if task.stopping.is_set() else error)

    def done(self, task: Task, error: BaseException | None) -> None:
        """Hear of the end of a task."""
        self._doing.pop(task, None)
        self._ended(task, error)

    def learn(self, task: Task, *, long: bool) -> None:
        """Hear whether a task took long."""
        if not task.strangers:
            self.lengths.learn(task.order, long=long)

    def _new(self, key: _Key, strangers: _Strangers) -> _Worker:
        worker = _Worker(self, key, strangers)
        self._all.add(worker)
        _living.add(worker)
        if self._closing:
            worker.kill()
        return worker

    def _begin(self, task: Task, worker: _Worker) -> None:
        self._doing[task] = worker
        worker.begin(task)

    async def _begin_in_new(self, task: Task, worker: _Worker) -> None:
        self._doing[task] = worker
        try:
            await worker.start(task.setup)
        except Exception as error:
            worker.kill()
            if self._doing.get(task) is worker:
                self.done(task, None if task.stopping.is_set() else error)
            return
        if task.stopping.is_set():
            self.done(task, None)
        else:
            worker.begin(task)

    def _in_background(self, work: object) -> None:
        task = asyncio.ensure_future(cast("asyncio.Future[None]", work))
        self._background.add(cast("asyncio.Task[None]", task))
        task.add_done_callback(self._background.discard)


class _Worker(asyncio.Protocol):
    """One worker process, and the connection to it."""

    def __init__(self, workers: Workers, key: _Key, strangers: _Strangers) -> None:
        self.key = key
        self.since = math.inf
        """When it was last given something or ended it."""
        self.compiled = False
        """Whether some kernels were not in the cache."""
        self._workers = workers
        self._strangers = strangers
        self._process: SpawnProcess | None = None
        self._transport: asyncio.Transport | None = None
        self._frames = Frames()
        self._next: asyncio.Future[None] | None = None
        self._setup: Setup | None = None
        self._task: Task | None = None
        self._budget: float | None = None
        self._heard = self._started = math.inf
        self._stop_until = math.inf
        self._killed = False
        self._spent = 0.0
        self._threads = ""
        """Names of those that strangers' plugins have left behind."""
        self._verdict: BaseException | None = None

    @property
    def idle(self) -> bool:
        """Whether it waits for something to do."""
        return self.since < math.inf and self._task is None and not self._killed

    async def start(self, setup: Setup, *, backwards: bool = False) -> None:
        """Start the process and wait until it is ready, with the last kernels first or not.

        Raises
        ------
        PluginError, WorkerLostError
            If it does not get ready.
        """
        if self._killed:
            raise self._blame("was no longer needed")
        ours, theirs = socket.socketpair()
        try:
            with theirs:
                await asyncio.to_thread(self._fork, theirs)
        except (OSError, EOFError) as error:
            ours.close()
            problem = f"a worker process could not be started ({_said(error)})"
            raise WorkerLostError(problem) from error
        loop = asyncio.get_running_loop()
        self._transport, _ = await loop.create_connection(lambda: self, sock=ours)
        if self._killed:
            self._transport.abort()
            raise self._blame("was no longer needed")
        self._set_up(setup, backwards)
        self._heard = time.monotonic()
        patience = _STARTING + (setup.isolation.patience if self._strangers else 0.0)
        await self._answered(patience, "did not load in its own process")
        self.since = time.monotonic()

    def _fork(self, theirs: socket.socket) -> None:
        """Start the process; once more if what it is forked from has died and is replaced."""
        for last in (False, True):
            names = tuple(sorted(name for name, _ in self.key))
            process = forking().Process(  # type: ignore[attr-defined]
                target=live,
                args=(theirs, names, bool(self._strangers)),
                name="-".join(("sketchmatch-worker", *names)),
                daemon=True,
            )
            try:
                process.start()
            except (OSError, EOFError):
                if last:
                    raise
            else:
                self._process = process
                return

    async def warm_up(self) -> None:
        """Compile what requests may ask for."""
        self.since = math.inf
        self.send(Says.WARM)
        await self._answered(_WARMING, "did not warm up")

    def begin(self, task: Task) -> None:
        """Do a task; the workers are told of its end."""
        if task.setup is not self._setup:
            self._set_up(task.setup)
        self.since = self._heard = time.monotonic()
        self._started = self._stop_until = math.inf
        self._budget = self._seconds(task)
        self._spent = self._processor_seconds()
        self._task, self._strangers = task, task.strangers
        if task.long:
            self._give_way()
        self.send(Says.ORDER, pickle.dumps(task.order))

    def stop(self) -> None:
        """Ask it to stop; it is killed if it does not."""
        if self._task is not None:
            self._stop_until = min(self._stop_until, time.monotonic() + _STOPPING)
            self.send(Says.STOP)

    def look(self, now: float) -> None:
        """Kill it if it takes too long, and let it give way if it takes long."""
        if self._task is None:
            return
        if now > self._stop_until:
            self.kill()
        elif self._strangers and now - self._heard > self._patience:
            self._kill(f"gave no sign of life for {self._patience:g} s")
        elif self._strangers and self._budget and now - self._started > self._budget + _OVERTIME:
            self._kill(f"did not end {_OVERTIME:g} s after its time budget of {self._budget:g} s")
        elif not self._task.long and self._is_long(now):
            self._task.long = True
            self._give_way()
            self._workers.learn(self._task, long=True)
            self._workers.gave_way()

    def kill(self) -> None:
        """End the process, and the connection to it."""
        self._killed = True
        self.end_process()
        if self._transport is not None:
            self._transport.abort()
        elif self._process is None:
            self._workers.lost(self)

    def end_process(self) -> None:
        """End the process, in any thread, if there is one."""
        if self._process is not None and self._process.pid is not None:
            with suppress(OSError, ValueError):
                self._process.kill()

    def send(self, kind: int, content: bytes = b"") -> None:
        """Tell it something."""
        if self._transport is not None:
            self._transport.write(frame(kind, content))

    def data_received(self, data: bytes) -> None:
        """Hear what it says."""
        self._heard = time.monotonic()
        for kind, content in self._frames.cut(data):
            self._hear(kind, content)

    def connection_lost(self, error: Exception | None) -> None:
        """Hear that it is gone."""
        del error
        self._workers.lost(self)

    async def buried(self) -> BaseException:
        """Wait until the process has ended, and return what that means for who waits for it."""
        process = self._process
        if process is not None and process.pid is not None:
            await asyncio.to_thread(process.join, _STOPPING)
            self.end_process()
            await asyncio.to_thread(process.join)
            ending = _ending(process.exitcode)
        else:
            ending = "before it began"
        verdict = self._verdict or self._blame(f"ended its process ({ending})")
        if not (self._killed or self._strangers):
            _log.error("a worker process ended unexpectedly (%s)", ending)
        if self._next is not None and not self._next.done():
            self._next.set_exception(verdict)
        return verdict

    @property
    def _patience(self) -> float:
        assert self._setup is not None
        return self._setup.isolation.patience

    def _hear(self, kind: int, content: bytes) -> None:
        task = self._task
        if kind & Says.ANSWER:
            if not kind & Flag.EARLY:
                self._started = min(self._started, self._heard)
            if task is not None and not task.stopping.is_set():
                task.log.add(content, news=bool(kind & Flag.NEWS))
            return
        match kind:
            case Says.COMPILING:
                self.compiled = True
                self._workers.compiling()
            case Says.DESCRIBED if not self._strangers:
                self._workers.described(content)
            case Says.READY:
                self._answer(None)
            case Says.LEFT if self._strangers:
                self._threads = content.decode()
            case Says.ENDED:
                if not self._strangers:
                    self._workers.looked_up(Lookups(*LOOKUPS.unpack(content)))
                self._end(None)
            case Says.FAILED:
                error, log = failure_of(content)
                failed: BaseException = error or WorkerError("a request failed in a worker process")
                if log:
                    failed.add_note(log)
                self._end(failed)

    def _end(self, error: BaseException | None) -> None:
        task, self._task = self._task, None
        if task is None:
            self._answer(error)
            return
        if error is None and not task.stopping.is_set():
            self._workers.learn(task, long=self._took_long(time.monotonic()))
        self.since = time.monotonic()
        if task.long:
            self._step_forward()
        if self._threads:
            _log.warning(
                "%s left threads running (%s), so its process was ended; %s",
                _culprits(self._strangers),
                self._threads,
                _REMEDY,
            )
        if self._threads or (self._strangers and isinstance(error, PluginError | WorkerError)):
            self.kill()  # who failed may have changed what other requests would meet
        self._workers.done(task, None if task.stopping.is_set() else error)

    def _answer(self, error: BaseException | None) -> None:
        if self._next is not None and not self._next.done():
            if error is None:
                self._next.set_result(None)
            else:
                self._next.set_exception(error)

    async def _answered(self, patience: float, complaint: str) -> None:
        """Wait for the end of what the server itself asked for; compiling is a sign of life."""
        self._next = asyncio.get_running_loop().create_future()
        while not self._next.done():
            left = self._heard + patience - time.monotonic()
            if left <= 0.0:
                self._kill(complaint)
                left = _STARTING
            await asyncio.wait((self._next,), timeout=left)
        try:
            self._next.result()
        finally:
            self._next = None

    def _set_up(self, setup: Setup, backwards: bool = False) -> None:
        self._setup, engine = setup, setup.engine
        patience = setup.isolation.patience if self._strangers else None
        scenes = self._workers.scenes
        told = WorkerSetup(
            engine.defaults, engine.limits, setup.limits, patience, scenes, backwards
        )
        self.send(Says.SETUP, pickle.dumps(told))

    def _seconds(self, task: Task) -> float | None:
        """Return the time budget of a task for strangers, who may not keep to it."""
        if not self._strangers:
            return None
        try:
            return time_budget(task.order.outline(task.setup.limits.max_request_bytes), task.setup)
        except InvalidInputError:
            return None

    def _kill(self, what: str) -> None:
        self._verdict = self._blame(f"{what} and was stopped")
        self.kill()

    def _blame(self, what: str) -> BaseException:
        if self._strangers:
            return PluginError(f"{_culprits(self._strangers)} {what}; {_REMEDY}")
        return WorkerLostError(f"the worker {what}")

    def _is_long(self, now: float) -> bool:
        return self._took_long(now) or now - self.since > _STUCK

    def _took_long(self, now: float) -> bool:
        spent = self._processor_seconds()
        return spent - self._spent > _LONG_PROCESSOR if spent else now - self.since > _LONG

    def _processor_seconds(self) -> float:
        """Return what the process has taken of processors; 0 where the system does not tell."""
        assert self._process is not None
        try:
            with open(f"/proc/{self._process.pid}/stat", "rb") as file:  # noqa: PTH123 (often)
                ticks = file.read().rpartition(b")")[2].split()[11:13]
            return sum(map(int, ticks)) / _TICKS
        except OSError:
            return 0.0

    def _give_way(self) -> None:
        """Let the processor go to others first."""
        with suppress(OSError):
            self._set_niceness(_GIVES_WAY)

    def _step_forward(self) -> None:
        """Take that back where the system allows it; else another worker comes in its place."""
        try:
            self._set_niceness(os.getpriority(os.PRIO_PROCESS, 0))
        except OSError:
            self.kill()

    def _set_niceness(self, value: int) -> None:
        """Set that of each thread: here, only these have one."""
        assert self._process is not None
        if self._strangers or not hasattr(os, "setpriority"):
            return
        folder = Path(f"/proc/{self._process.pid}/task")
        threads = [int(thread.name) for thread in folder.iterdir()] if folder.is_dir() else []
        for thread in threads or [self._process.pid or 0]:
            os.setpriority(os.PRIO_PROCESS, thread, value)


_living: WeakSet[_Worker] = WeakSet()


@atexit.register
def _kill_all() -> None:
    """End what a server has left that did not come to close its workers.

    They heed no signals, and after this Python waits for the end of processes that it has started.
    """
    for worker in tuple(_living):
        worker.end_process()


def _own(setup: Setup) -> _Key:
    """Return what workers load that need no stranger."""
    return _versions(setup.trusted)


def _key(task: Task) -> _Key:
    return _own(task.setup) | _versions(task.strangers)


def _versions(offered: _Strangers) -> _Key:
    return frozenset(
        (item.distribution, item.version)
        for item in offered
        if canonical(item.distribution) != OWN_DISTRIBUTION
    )


def _culprits(strangers: _Strangers) -> str:
    """Return who is to blame, to begin a sentence with."""
    if len(strangers) > _NAMED:
        distributions = sorted({item.distribution for item in strangers})
        return f"an algorithm of {' or '.join(distributions)}"
    return " or ".join(dict.fromkeys(item.origin for item in strangers))


def _said(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}"


def _ending(code: int | None) -> str:
    return f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"
