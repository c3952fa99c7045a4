"""A match that a server is doing."""

from __future__ import annotations

from collections.abc import Callable, Generator
from threading import Event, RLock
from typing import Any, Protocol, Self

from sketchmatch_client._course import Course
from sketchmatch_client._match import Match, MatchCollector, ProgressCallback, tell_progress
from sketchmatch_client._retry import Attempts
from sketchmatch_client.errors import CallCancelledError, SketchmatchError, translated_errors
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse, WatchMatchResponse

__all__ = ["MatchCall"]


class _Stream(Protocol):
    """What gRPC returns from a call that streams."""

    def __next__(self) -> MatchResponse | WatchMatchResponse: ...

    def cancel(self) -> object: ...


class MatchCall(Generator[MatchResponse, None, None]):
    """A match that a server is doing, as :meth:`Client.events` returns it.

    Iterate over its events, or wait for its :meth:`result`. It starts when the first event is asked
    for. Leaving a ``with`` statement over it, closing it or dropping it stops the match, unless it
    is to keep running. One thread goes through the events; :meth:`cancel` and :meth:`close` may be
    called from any other. When the link is lost or the server starts anew, it goes on by itself.
    """

    def __init__(
        self,
        course: Course,
        begin: Callable[[Course, float | None], _Stream],
        cancel: Callable[[str], object],
        address: str,
        begun: Callable[[], Attempts],
    ) -> None:
        self._course = course
        self._begin = begin
        self._cancel = cancel
        self._cancelling: object = None  # what nobody holds gRPC cancels
        self._address = address
        self._begun = begun
        self._attempts: Attempts | None = None
        self._over = Event()
        self._lock = RLock()  # a handler of signals may cancel, too
        self._call: _Stream | None = None
        self._collector = MatchCollector(None)
        self._error: SketchmatchError | None = None
        self._ended = self._closed = False

    def cancel(self) -> None:
        """Stop the match: whoever waits for it gets a :class:`CallCancelledError`.

        One that has ended stays as it is.
        """
        request = self._course.request
        if not self._ended and self._course.match_id and (request is None or request.keep_running):
            with translated_errors(self._address):
                self._cancelling = self._cancel(self._course.match_id)
        self._end(CallCancelledError("the match was cancelled before its end"))

    def close(self) -> None:
        """Stop the match: whoever iterates over it comes to the end."""
        with self._lock:
            self._closed = self._closed or not self._ended
            self._end()

    def result(self, on_progress: ProgressCallback | None = None) -> Match:
        """Wait for the end of the match.

        Parameters
        ----------
        on_progress
            Called with each :class:`Progress`, at most 20 a second. What it raises ends the match.

        Returns
        -------
        Match
            How it ran, the objects found and the result.

        Raises
        ------
        SketchmatchError
            What ended the match before; a :class:`CallCancelledError` if it was stopped.
        """
        with self:
            for event in self:
                tell_progress(event, on_progress)
        if self._closed and not self._collector.complete:
            raise CallCancelledError("the match was closed before its end")
        return self._collector.match()

    def send(self, _value: None = None, /) -> MatchResponse:
        """Return the next event, as ``next`` does."""
        try:
            event = self._next()
        except BaseException:
            self.close()
            raise
        if event is None:
            raise StopIteration
        self._collector.add(event)
        return event

    def throw(self, *error: Any) -> MatchResponse:
        """Stop the match and raise an error, as generators do."""
        self.close()
        return super().throw(*error)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _next(self) -> MatchResponse | None:
        """Return the next event, or None at the end."""
        event = None
        while (call := self._started()) is not None:
            try:
                with translated_errors(self._address):
                    response = next(call, None)
            except SketchmatchError as error:
                if self._course.ends(error):
                    self._end()
                elif not self._starts_again(error):
                    self._end(error)
                continue
            if self._attempts is not None:
                self._attempts.succeeded()
            event = None if response is None else self._course.take(response)
            if response is None or event is not None:
                break
        if event is None:
            self._end()
            if self._error is not None:
                raise self._error
        return event

    def _started(self) -> _Stream | None:
        """Return the call, made where there was none; None if the match has ended."""
        with self._lock:
            if self._attempts is None:
                self._attempts = self._begun()
            if self._call is None and not self._ended:
                with translated_errors(self._address):
                    self._call = self._begin(self._course, self._attempts.limit)
            return None if self._ended else self._call

    def _starts_again(self, error: SketchmatchError) -> bool:
        """Wait for the next attempt; False if there is none."""
        if self._attempts is None:
            return False
        pause = self._course.pause_after(error, self._attempts)
        if pause is None:
            return False
        self._over.wait(pause)
        with self._lock:
            self._call = None
        return True

    def _end(self, error: SketchmatchError | None = None) -> None:
        """Come to the end, unless it was reached; the error is for whoever asks for more."""
        with self._lock:
            if not self._ended:
                self._ended, self._error = True, error
                self._over.set()
                if self._call is not None:
                    self._call.cancel()
