"""Running other people's plugins in processes of their own, so that they can be stopped.

A thread cannot be stopped from outside, a loop in plain Python holds up all threads of its
process, and a crash ends them. So a request that uses an algorithm of a distribution which is not
the engine's own is answered in a child process: it reads the request, runs the very same pipeline,
and sends the responses through a pipe. A child that gives no sign of life for too long, or does
not end when its time is over, is killed, and the request fails with the names of plugin and
distribution. A child that behaved is kept for the next request.
"""

from __future__ import annotations

import math
import multiprocessing
import signal
import threading
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import wait
from typing import TYPE_CHECKING

from google.protobuf.message import Message

from sketchmatch.app.child import (
    LEFT_TO_THE_SERVER,
    STOP,
    Answer,
    Ended,
    Errand,
    Failed,
    Ready,
    live,
)
from sketchmatch.app.jobs import Job, algorithms, time_budget
from sketchmatch.app.setup import Setup
from sketchmatch.errors import PluginError
from sketchmatch_proto.v1 import match_pb2
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse

if TYPE_CHECKING:
    from multiprocessing.context import SpawnProcess

    from sketchmatch.registry import Registered, RegisteredReader

__all__ = ["ChildError", "Children"]

_LOOK = 0.05
_STOPPING = 0.5
_OVERTIME = 2.0
_STARTING = 60.0
_WARMING = 120.0
_IDLE = 2
_NAMED = 5
_REMEDY = "tell its author or choose another"
_Key = frozenset[str]

_spawning = multiprocessing.get_context("spawn")


class ChildError(Exception):
    """Something that nobody foresaw happened in a child process; it says where."""


@dataclass(frozen=True)
class _Watch:
    """How a child is watched while it answers.

    Attributes
    ----------
    strangers
        The algorithms that it is started for, which are to blame if it fails.
    patience
        Seconds without a sign of life.
    time_budget
        Seconds for the whole request once its kernels are compiled, or None for no limit.
    """

    strangers: tuple[Registered | RegisteredReader, ...]
    patience: float
    time_budget: float | None = None

    @property
    def distributions(self) -> _Key:
        """What the child loads beside the engine's own."""
        return frozenset(item.distribution for item in self.strangers)

    @property
    def culprits(self) -> str:
        """Who is to blame, to begin a sentence with."""
        if len(self.strangers) > _NAMED:
            return f"an algorithm of {' or '.join(sorted(self.distributions))}"
        return " or ".join(dict.fromkeys(item.origin for item in self.strangers))


class Children:
    """The child processes of a server, by the distributions that they load."""

    def __init__(self) -> None:
        self._idle: dict[_Key, list[_Child]] = {}
        self._lock = threading.Lock()
        self._closed = False

    def answers(
        self, job: Job, setup: Setup, stop: threading.Event
    ) -> Generator[Message, None, None]:
        """Let a child do a job, and yield its responses.

        Parameters
        ----------
        job, setup
            What it does, and with what.
        stop
            Ends the job from another thread.

        Raises
        ------
        SketchmatchError
            As the job does in this process.
        PluginError
            If the child crashes, or has to be killed.
        ChildError
            If it fails in a way that nobody foresaw.
        """
        strangers = setup.isolation.strangers(algorithms(job, setup))
        watch = _Watch(strangers, setup.isolation.patience, time_budget(job, setup))
        yield from self._done(_errand(job, setup, watch.patience), watch, stop)

    def warm_up(
        self, strangers: tuple[Registered, ...], setup: Setup, stop: threading.Event
    ) -> None:
        """Let a child compile what some algorithms need.

        Raises
        ------
        PluginError, ChildError
            As :meth:`answers` does.
        """
        watch = _Watch(strangers, _WARMING)
        for _ in self._done(_errand(None, setup, _WARMING), watch, stop):
            pass

    def _done(self, errand: Errand, watch: _Watch, stop: threading.Event) -> Iterator[Message]:
        with self._child(watch, stop) as child:
            yield from child.answers(errand, watch, stop)

    def close(self) -> None:
        """End the children that wait; those at work end with their requests."""
        with self._lock:
            self._closed = True
            waiting = [child for children in self._idle.values() for child in children]
            self._idle.clear()
        for child in waiting:
            child.kill()

    @contextmanager
    def _child(self, watch: _Watch, stop: threading.Event) -> Iterator[_Child]:
        """Lend a child; one that is not done in the end is killed."""
        child = self._waiting(watch.distributions) or _Child(watch.distributions)
        try:
            child.wait_until_ready(watch, stop)
            yield child
        finally:
            if not (child.done and self._keep(watch.distributions, child)):
                child.kill()

    def _waiting(self, distributions: _Key) -> _Child | None:
        with self._lock:
            children = self._idle.get(distributions, [])
            while children:
                child = children.pop()
                if child.alive:
                    return child
                child.kill()
        return None

    def _keep(self, distributions: _Key, child: _Child) -> bool:
        with self._lock:
            children = self._idle.setdefault(distributions, [])
            if self._closed or len(children) >= _IDLE:
                return False
            children.append(child)
            return True


class _Child:
    """One child process and the pipe to it."""

    def __init__(self, distributions: _Key) -> None:
        self.done = False
        self._ready = False
        self._connection, theirs = _spawning.Pipe()
        self._process: SpawnProcess = _spawning.Process(
            target=live,
            args=(theirs, tuple(sorted(distributions))),
            name=f"sketchmatch-plugins-{'-'.join(sorted(distributions))}",
            daemon=True,
        )
        with _signals_held_back():
            self._process.start()
        theirs.close()

    @property
    def alive(self) -> bool:
        return self._process.is_alive()

    def kill(self) -> None:
        self._process.kill()
        self._process.join()
        self._connection.close()

    def wait_until_ready(self, watch: _Watch, stop: threading.Event) -> None:
        """Wait until it has loaded its plugins, or is no longer wanted."""
        deadline = time.monotonic() + _STARTING + watch.patience
        while not (self._ready or stop.is_set()):
            self._ready = self.done = isinstance(self._received(watch), Ready)
            if time.monotonic() > deadline:
                raise _silent(watch, "did not load in its own process")

    def answers(self, errand: Errand, watch: _Watch, stop: threading.Event) -> Iterator[Message]:
        """Do an errand; one that is given up or stopped is over, if the child obeys."""
        if stop.is_set():
            return
        self.done = False
        self._send(errand, watch)
        try:
            yield from self._responses(watch, stop)
        except GeneratorExit:
            self._stop(watch)
            raise
        if not self.done:
            self._stop(watch)

    def _responses(self, watch: _Watch, stop: threading.Event) -> Iterator[Message]:
        """Yield responses until the errand is done or to be stopped."""
        heard, started = time.monotonic(), math.inf
        while not stop.is_set():
            message = self._received(watch)
            now = time.monotonic()
            match message:
                case Answer(response):
                    heard = now
                    if not _comes_before_the_budget(response):
                        started = min(started, now)
                    yield response
                case Ended():
                    self.done = True
                    return
                case Failed(error, log):
                    self.done = True
                    failure = error or ChildError("a request failed in a child process")
                    if log:
                        failure.add_note(log)
                    raise failure
            if now - heard > watch.patience:
                raise _silent(watch, f"gave no sign of life for {watch.patience:g} s")
            if watch.time_budget is not None and now - started > watch.time_budget + _OVERTIME:
                raise _silent(
                    watch,
                    f"did not end {_OVERTIME:g} s after its time budget of {watch.time_budget:g} s",
                )

    def _stop(self, watch: _Watch) -> None:
        """Ask it to stop; it is done if it does so in time."""
        deadline = time.monotonic() + _STOPPING
        with suppress(PluginError):
            self._send(STOP, watch)
            while not self.done and time.monotonic() < deadline:
                self.done = isinstance(self._received(watch), Ended | Failed)

    def _send(self, message: object, watch: _Watch) -> None:
        try:
            self._connection.send(message)
        except OSError:
            raise self._gone(watch) from None

    def _received(self, watch: _Watch) -> object:
        """Return the next message, or None if there is none for a moment."""
        ready = wait([self._connection, self._process.sentinel], _LOOK)
        if not ready:
            return None
        if self._connection in ready:
            with suppress(EOFError, OSError):
                return self._connection.recv()
        raise self._gone(watch)

    def _gone(self, watch: _Watch) -> PluginError:
        self._process.join()
        ending = _ending(self._process.exitcode)
        return PluginError(f"{watch.culprits} ended its process ({ending}); {_REMEDY}")


@contextmanager
def _signals_held_back() -> Iterator[None]:
    """Start processes for which signals wait until they say how they take them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # which would let signals through when it starts
    before = signal.pthread_sigmask(signal.SIG_BLOCK, LEFT_TO_THE_SERVER)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _comes_before_the_budget(response: Message) -> bool:
    """Whether a match has not begun yet, because its kernels may have to be compiled."""
    if not isinstance(response, MatchResponse):
        return False
    compiles = response.progress.phase == match_pb2.PHASE_COMPILE
    return response.HasField("accepted") or compiles


def _silent(watch: _Watch, what: str) -> PluginError:
    return PluginError(f"{watch.culprits} {what} and was stopped; {_REMEDY}")


def _ending(code: int | None) -> str:
    return f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"


def _errand(job: Job | None, setup: Setup, patience: float) -> Errand:
    engine = setup.engine
    return Errand(job, engine.defaults, engine.limits, setup.limits, patience)
