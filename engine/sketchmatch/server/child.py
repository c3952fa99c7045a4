"""The life of a child process that answers requests with other people's plugins."""

from __future__ import annotations

import faulthandler
import os
import queue
import signal
import threading
import traceback
from collections.abc import Generator, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass
from enum import StrEnum
from multiprocessing.connection import Connection
from pathlib import Path

from sketchmatch.model.limits import limited_to
from sketchmatch.pipeline.selection import Defaults
from sketchmatch.pipeline.warmup import warm_up, warm_up_others
from sketchmatch.registry import OWN_DISTRIBUTION, PluginRules, discover
from sketchmatch.server import work
from sketchmatch.server.limits import Limits
from sketchmatch.server.setup import Setup
from sketchmatch.server.status import Refusal, is_fault, refusal
from sketchmatch_proto.v1 import match_service_pb2, scene_service_pb2

__all__ = ["STOP", "Answer", "Ended", "Failed", "Job", "Method", "Ready", "live"]

STOP = "stop"
"""Ends the job under way."""

_LOADING = 120.0
_POLITE = 10
_FIRST_TO_GO = 500


class Method(StrEnum):
    """What a child can do."""

    MATCH = "match"
    SEGMENT = "segment"
    WARM_UP = "warm-up"


@dataclass(frozen=True)
class Job:
    """One request.

    Attributes
    ----------
    method
        What to do.
    request
        The request message, serialised; empty for a warm-up.
    defaults, limits
        Of the server.
    patience
        Seconds without a sign of life after which the child ends itself, should nobody be left
        to end it.
    """

    method: Method
    request: bytes
    defaults: Defaults
    limits: Limits
    patience: float


@dataclass(frozen=True)
class Ready:
    """The plugins are loaded, and so are the kernels of the default pipeline."""


@dataclass(frozen=True)
class Answer:
    """A response message, serialised."""

    response: bytes


@dataclass(frozen=True)
class Ended:
    """The job is done, or was stopped."""


@dataclass(frozen=True)
class Failed:
    """The job ended with an error.

    Attributes
    ----------
    refusal
        What the caller is told.
    log
        What the server's log is told; empty if it is the caller's fault.
    """

    refusal: Refusal
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
    jobs: queue.SimpleQueue[Job] = queue.SimpleQueue()
    stop = threading.Event()
    listening = threading.Thread(target=_listen, args=(connection, jobs, stop), daemon=True)
    listening.start()
    connection.send(Ready())
    while True:
        faulthandler.cancel_dump_traceback_later()
        job = jobs.get()
        setup = Setup(registry, job.defaults, job.limits)
        _end_unless_alive(job.patience)
        for message in _messages(job, setup, stop):
            _end_unless_alive(job.patience)
            connection.send(message)


def _end_unless_alive(patience: float) -> None:
    """End the process if it is not called again in time, even while no Python can run."""
    faulthandler.dump_traceback_later(2.0 * patience, exit=True)


def _step_back() -> None:
    """Leave signals to the server, and processor and memory to it first."""
    for name in ("SIGINT", "SIGHUP"):
        if number := getattr(signal, name, None):
            signal.signal(number, signal.SIG_IGN)
    if hasattr(os, "nice"):
        os.nice(_POLITE)
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(str(_FIRST_TO_GO), encoding="ascii")


def _listen(connection: Connection, jobs: queue.SimpleQueue[Job], stop: threading.Event) -> None:
    while True:
        try:
            message = connection.recv()
        except (EOFError, OSError):
            os._exit(0)  # the server is gone, and a plugin may be at work in the main thread
        if message == STOP:
            stop.set()
        else:
            stop.clear()
            jobs.put(message)


def _messages(job: Job, setup: Setup, stop: threading.Event) -> Iterator[Answer | Ended | Failed]:
    """Do a job; the last message is Ended or Failed."""
    try:
        with limited_to(job.limits.sources), closing(_responses(job, setup)) as responses:
            for response in responses:
                if stop.is_set():
                    break
                yield Answer(response)
        yield Ended()
    except Exception as error:
        log = "".join(traceback.format_exception(error)) if is_fault(error) else ""
        yield Failed(refusal(error), log)


def _responses(job: Job, setup: Setup) -> Generator[bytes, None, None]:
    match job.method:
        case Method.MATCH:
            request = match_service_pb2.MatchRequest.FromString(job.request)
            value = work.read_match(request, setup)
            for response in work.match_responses(request, value, setup):
                yield response.SerializeToString()
        case Method.SEGMENT:
            wanted = scene_service_pb2.SegmentRequest.FromString(job.request)
            source = work.read_source(wanted)
            yield work.segment_response(wanted, source, setup).SerializeToString()
        case Method.WARM_UP:
            warm_up_others(setup.registry.without(OWN_DISTRIBUTION), setup.defaults)
