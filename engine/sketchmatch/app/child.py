"""The life of a child process that answers requests with other people's plugins."""

from __future__ import annotations

import faulthandler
import os
import queue
import signal
import threading
from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

from google.protobuf.message import Message

from sketchmatch.app.faults import told
from sketchmatch.app.jobs import Job, answers
from sketchmatch.app.setup import RequestLimits, Setup
from sketchmatch.errors import (
    AnswerUnavailableError,
    InvalidInputError,
    PluginError,
    Reason,
    SketchmatchError,
)
from sketchmatch.model.limits import SourceLimits
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.selection import Defaults
from sketchmatch.pipeline.warmup import warm_up, warm_up_others
from sketchmatch.registry import OWN_DISTRIBUTION, PluginRules, discover

__all__ = ["LEFT_TO_THE_SERVER", "STOP", "Answer", "Ended", "Errand", "Failed", "Ready", "live"]

STOP = "stop"
"""Ends the errand under way."""

LEFT_TO_THE_SERVER = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGHUP", "SIGTERM") if hasattr(signal, name)
)
"""Signals that a terminal or an init system sends to a whole group; only the server decides."""

_LOADING = 120.0
_POLITE = 10
_FIRST_TO_GO = 500


@dataclass(frozen=True)
class Errand:
    """What a child is to do.

    Attributes
    ----------
    job
        The request; None for a warm-up.
    defaults, sources, limits
        Of the server.
    patience
        Seconds without a sign of life after which the child ends itself, should nobody be left
        to end it.
    """

    job: Job | None
    defaults: Defaults
    sources: SourceLimits
    limits: RequestLimits
    patience: float


@dataclass(frozen=True)
class Ready:
    """The plugins are loaded, and so are the kernels of the default pipeline."""


@dataclass(frozen=True)
class Answer:
    """A response."""

    response: Message


@dataclass(frozen=True)
class Ended:
    """The errand is done, or was stopped."""


@dataclass(frozen=True)
class Failed:
    """The errand ended with an error.

    Attributes
    ----------
    error
        What the caller is told; None where it is something that nobody foresaw.
    log
        Where it happened, for the log.
    """

    error: SketchmatchError | None
    log: str = ""


def live(connection: Connection, distributions: tuple[str, ...]) -> None:
    """Answer requests until the server is gone; the entry of the process.

    Parameters
    ----------
    connection
        The pipe to the server.
    distributions
        Whose algorithms are loaded, beside the engine's own.
    """
    _step_back()
    _end_unless_alive(_LOADING)
    registry = discover(rules=PluginRules.of(allow=distributions))
    warm_up(registry)
    errands: queue.SimpleQueue[Errand] = queue.SimpleQueue()
    stop = threading.Event()
    listening = threading.Thread(target=_listen, args=(connection, errands, stop), daemon=True)
    listening.start()
    connection.send(Ready())
    while True:
        faulthandler.cancel_dump_traceback_later()
        errand = errands.get()
        setup = Setup(Engine(registry, errand.defaults, errand.sources), errand.limits)
        _end_unless_alive(errand.patience)
        for message in _messages(errand, setup, stop):
            _end_unless_alive(errand.patience)
            connection.send(message)


def _end_unless_alive(patience: float) -> None:
    """End the process if it is not called again in time, even while no Python can run."""
    faulthandler.dump_traceback_later(2.0 * patience, exit=True)


def _step_back() -> None:
    """Leave signals to the server, and processor and memory to it first."""
    own = os.getpid()

    def leave(number: int, _frame: object) -> None:
        if os.getpid() != own:  # a plugin ends a process that it has forked
            signal.signal(number, signal.SIG_DFL)
            os.kill(os.getpid(), number)

    for number in LEFT_TO_THE_SERVER:
        signal.signal(number, leave if number == signal.SIGTERM else signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, LEFT_TO_THE_SERVER)
    if hasattr(os, "nice"):
        os.nice(_POLITE)
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(str(_FIRST_TO_GO), encoding="ascii")


def _listen(
    connection: Connection, errands: queue.SimpleQueue[Errand], stop: threading.Event
) -> None:
    while True:
        try:
            message = connection.recv()
        except (EOFError, OSError):
            os._exit(0)  # the server is gone, and a plugin may be at work in the main thread
        if message == STOP:
            stop.set()
        else:
            stop.clear()
            errands.put(message)


def _messages(
    errand: Errand, setup: Setup, stop: threading.Event
) -> Iterator[Answer | Ended | Failed]:
    """Do an errand; the last message is Ended or Failed."""
    try:
        if errand.job is None:
            engine = setup.engine
            warm_up_others(engine.registry.without(OWN_DISTRIBUTION), engine.defaults)
        else:
            with closing(answers(errand.job, setup)) as responses:
                for response in responses:
                    if stop.is_set():
                        break
                    yield Answer(response)
        yield Ended()
    except Exception as error:
        _, _, where = told(error).partition("\n")
        yield Failed(_plain(error), where)


def _plain(error: Exception) -> SketchmatchError | None:
    """Return what the server can read without a plugin's own classes, which it never loads."""
    match error:
        case InvalidInputError():
            return InvalidInputError(Reason(error.reason), f"{error.field}", f"{error.problem}")
        case AnswerUnavailableError():
            return AnswerUnavailableError(f"{error}")
        case SketchmatchError():
            return PluginError(f"{error}")
    return None
