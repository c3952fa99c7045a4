"""A request with a life of its own: where it is, and what it told, for any number of readers."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum
from typing import Generic, TypeVar

from sketchmatch.app.jobs import algorithms
from sketchmatch.app.orders import Order, Wish
from sketchmatch.app.setup import Setup
from sketchmatch.app.waiting import Caller
from sketchmatch.errors import InvalidInputError, MatchCancelledError, RetryableError
from sketchmatch.registry import Registered, RegisteredReader
from sketchmatch_proto.v1 import match_service_pb2
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse

__all__ = ["Log", "Record", "State", "Task", "is_progress"]

_Item = TypeVar("_Item")


class Log(Generic[_Item]):
    """What has been told, numbered; items are added and read from any thread.

    Of items that are news alone only the latest is kept, so a slow reader misses old ones; all
    others stay.

    Parameters
    ----------
    before
        The number before that of the first item.
    """

    def __init__(self, before: int = 0) -> None:
        self._lock = threading.Lock()
        self._kept: list[tuple[int, _Item]] = []
        self._news: tuple[int, _Item] | None = None
        self._first = self._count = before
        self._ended = False
        self._error: BaseException | None = None
        self._readers: set[Callable[[], None]] = set()

    def add(self, item: _Item, *, news: bool = False) -> None:
        """Add an item; the next one that is news takes the place of one that is."""
        with self._lock:
            self._count += 1
            if news:
                self._news = (self._count, item)
            else:
                self._kept.append((self._count, item))
        self._wake()

    def end(self, error: BaseException | None = None) -> None:
        """Add nothing more; with an error, each reader is told it in the end."""
        with self._lock:
            self._error = error
            self._ended = True
        self._wake()

    @classmethod
    def told(cls, items: Iterable[tuple[int, _Item]], error: BaseException | None) -> Log[_Item]:
        """Return one that has ended, of numbered items."""
        log = cls()
        log._kept = list(items)
        log.end(error)
        return log

    def next(self, seen: int) -> tuple[int, _Item] | None:
        """Return the first item that is left of those after number ``seen``; None for none yet."""
        return min((each for each in self.items() if each[0] > seen), default=None, key=_number)

    def items(self) -> tuple[tuple[int, _Item], ...]:
        """Return what is left of all items, in order."""
        with self._lock:
            news = () if self._news is None else (self._news,)
            return tuple(sorted((*self._kept, *news), key=_number))

    @property
    def begun(self) -> bool:
        """Whether anything has been told."""
        return self._count > self._first

    @property
    def kept(self) -> int:
        """How many items there are that stay."""
        return len(self._kept)

    @property
    def last(self) -> int:
        """The number of the latest item; one less than the first has, where there is none."""
        return self._count

    @property
    def error(self) -> BaseException | None:
        """The error that the log ended with, if it did."""
        return self._error

    @property
    def ended(self) -> bool:
        """Whether there will be no more."""
        return self._ended

    def check(self) -> None:
        """Raise the error that the log ended with, if it did."""
        if self._error is not None:
            raise self._error

    @contextmanager
    def waking(self, reader: Callable[[], None]) -> Iterator[None]:
        """Call a reader, from any thread, whenever something is new."""
        with self._lock:
            self._readers.add(reader)
        try:
            yield
        finally:
            with self._lock:
                self._readers.discard(reader)

    def _wake(self) -> None:
        with self._lock:
            readers = tuple(self._readers)
        for reader in readers:
            reader()


def _number(item: tuple[int, object]) -> int:
    return item[0]


_LENGTH_DELIMITED = 2


def _first_byte(field: str) -> bytes:
    """Return how an encoded event begins that has a certain field."""
    return bytes([MatchResponse.DESCRIPTOR.fields_by_name[field].number << 3 | _LENGTH_DELIMITED])


_RUN_BITS = 32
"""Events of a match that is done again have larger numbers than all that it told before."""
_PROGRESS, _RESULT = _first_byte("progress"), _first_byte("result")


def is_progress(response: bytes) -> bool:
    """Whether an encoded event is progress; it has no other field."""
    return response[:1] == _PROGRESS


class State(IntEnum):
    """Where a request is in its life, with the contract's numbers."""

    QUEUED = match_service_pb2.MATCH_STATE_QUEUED
    RUNNING = match_service_pb2.MATCH_STATE_RUNNING
    CANCELLING = match_service_pb2.MATCH_STATE_CANCELLING
    SUCCEEDED = match_service_pb2.MATCH_STATE_SUCCEEDED
    FAILED = match_service_pb2.MATCH_STATE_FAILED
    CANCELLED = match_service_pb2.MATCH_STATE_CANCELLED
    INTERRUPTED = match_service_pb2.MATCH_STATE_INTERRUPTED

    @property
    def ended(self) -> bool:
        """Whether nothing comes after it."""
        return self >= State.SUCCEEDED

    @classmethod
    def after(cls, error: BaseException | None) -> State:
        """Return the state of what ended with an error, or with none."""
        match error:
            case None:
                return cls.SUCCEEDED
            case MatchCancelledError():
                return cls.CANCELLED
            case RetryableError():
                return cls.INTERRUPTED
        return cls.FAILED


_ENDS = {state for state in State if state.ended}
_NEXT = {
    State.QUEUED: {State.RUNNING} | _ENDS,
    State.RUNNING: {State.CANCELLING} | _ENDS,
    State.CANCELLING: _ENDS,
}


@dataclass(frozen=True)
class Record:
    """A match as it is, or was, at some moment.

    Attributes
    ----------
    id, caller
        Its name, and that of who asked for it.
    wish
        What the request says of the match's own life.
    state
        Where it is in it.
    created, ended
        When it was asked for and when it ended, in seconds since 1970; None for not yet.
    outcome
        Why its search ended, as the contract has it; 0 unless it succeeded.
    run
        How often it was begun before, and interrupted.
    events
        What is left of its events, encoded, with their numbers.
    error
        What it ended with, if with an error.
    """

    id: str
    caller: str
    wish: Wish
    state: State
    created: float
    ended: float | None = None
    outcome: int = 0
    run: int = 0
    events: tuple[tuple[int, bytes], ...] = ()
    error: BaseException | None = None

    @property
    def log(self) -> Log[bytes]:
        """Its events, for readers, once it has ended."""
        return Log[bytes].told(self.events, self.error)

    @property
    def first(self) -> int:
        """The number before that of its first event."""
        return self.run << _RUN_BITS

    @property
    def size(self) -> int:
        """Bytes of its events."""
        return sum(len(event) for _, event in self.events)

    def event(self, _number: int, response: bytes) -> MatchResponse:
        """Return an event, decoded."""
        return MatchResponse.FromString(response)

    def record(self) -> Record:
        """Return the record itself, as tasks return theirs."""
        return self


class Task:
    """One request that was admitted, or waits to be.

    All but ``log`` and ``record`` belongs into the application's event loop.

    Parameters
    ----------
    order
        The request.
    setup
        What it is answered with.
    caller
        Who asks.
    wish
        What the request says of its own life.
    former
        What came of it when it was begun before, and interrupted.

    Attributes
    ----------
    strangers
        The algorithms and readers it asks for that run in a process of their own.
    refusal
        Why a name in it is of no use; None where all are known. A worker knows some plugins alone,
        and would give another reason.
    size
        Bytes of the request, with what comes with it.
    log
        Its responses, as bytes.
    stopping
        Set once nobody wants more of them.
    asked, begun
        When it came, and when it had its turn; None for not yet.
    again
        Whether it was begun before, by a worker that was lost.
    long
        Whether it has turned out to take long, or is expected to, so that it gives way to others.
    readers
        How many read it.
    noted
        How many of its events were kept when somebody last looked.
    """

    def __init__(
        self,
        order: Order,
        setup: Setup,
        caller: Caller = Caller(),  # noqa: B008
        wish: Wish = Wish(),  # noqa: B008
        former: Record | None = None,
    ) -> None:
        self.order = order
        self.size = order.size
        self.setup = setup
        self.caller = caller
        self.wish = wish
        self.refusal: InvalidInputError | None = None
        self.strangers: tuple[Registered | RegisteredReader, ...] = ()
        if setup.plugins:
            outline = order.outline(setup.limits.max_request_bytes)
            try:
                self.strangers = setup.isolation.strangers(algorithms(outline, setup))
            except InvalidInputError as error:
                self.refusal = error
        self._run = 0 if former is None else former.run + 1
        self.log = Log[bytes](self._run << _RUN_BITS)
        self.stopping = threading.Event()
        self.asked = time.monotonic()
        self.begun: float | None = None
        self.again = False
        self.long = False
        self.readers = 0
        self.noted = 0
        self._created = time.time() if former is None else former.created
        self._ended: float | None = None
        self._state = State.QUEUED
        self._stopped_by: BaseException | None = None
        self._outcome = 0
        self._events: dict[int, MatchResponse] = {}

    @property
    def id(self) -> str:
        """A name that no other task of the application has."""
        return self.order.id

    @property
    def state(self) -> State:
        """Where it is in its life."""
        return self._state

    @property
    def waited(self) -> float:
        """Seconds that it waited for its turn; 0 for what has not had it yet."""
        return 0.0 if self.begun is None else self.begun - self.asked

    def begin(self) -> None:
        """Have its turn."""
        self.begun = time.monotonic()
        self._move(State.RUNNING)

    def stop(self, why: BaseException) -> None:
        """Be told to come to an end without a result, and why; that it is cancelled counts most."""
        if self._state is State.RUNNING:
            self._move(State.CANCELLING)
        if self._stopped_by is None or isinstance(why, MatchCancelledError):
            self._stopped_by = why

    def end(self, error: BaseException | None = None) -> None:
        """Come to the one end, with an error or without."""
        if error is None and self._stopped_by is not None and not self._has_result():
            error = self._stopped_by
        result = next((e for e in self.events() if e.HasField("result")), None)
        self._outcome = 0 if result is None else result.result.outcome
        self._ended = time.time()
        self._move(State.after(error))
        self.log.end(error)

    def event(self, number: int, response: bytes) -> MatchResponse:
        """Return an event, which is decoded once however many read it."""
        if number not in self._events:
            self._events[number] = MatchResponse.FromString(response)
        return self._events[number]

    def events(self) -> list[MatchResponse]:
        """Return all events of a match so far that are no progress."""
        if not self.order.is_match:
            return []
        return [
            self.event(number, response)
            for number, response in self.log.items()
            if not is_progress(response)
        ]

    def record(self) -> Record:
        """Return the match as it is; from any thread."""
        # What comes after the state may be newer than it, and is written once more then.
        return Record(
            self.id,
            self.caller.name,
            self.wish,
            self._state,
            self._created,
            self._ended,
            self._outcome,
            self._run,
            self.log.items(),
            self.log.error,
        )

    def _has_result(self) -> bool:
        return any(response[:1] == _RESULT for _, response in self.log.items())

    def _move(self, state: State) -> None:
        if state not in _NEXT.get(self._state, ()):
            raise AssertionError(f"a request that is {self._state.name} cannot be {state.name}")
        self._state = state
