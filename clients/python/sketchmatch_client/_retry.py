"""When the same request is sent again: it changes nothing, so that any may be."""

from __future__ import annotations

import math
import random
import reprlib
import time
from collections.abc import Callable
from typing import Any

from sketchmatch_client._channel import within
from sketchmatch_client.errors import (
    InvalidRequestError,
    ServerBusyError,
    ServerUnavailableError,
    SketchmatchError,
)

__all__ = ["Attempts", "Counted", "checked_retries"]

_SHORTEST = 0.1
_LONGEST = 5.0
_LONGEST_BEGUN = 1.0
_AWAY = 60.0
"""Seconds in which a server is expected back that had begun to answer."""


class Attempts:
    """The attempts of one call, which share its time.

    Parameters
    ----------
    retries
        How often the request may be sent again.
    limit
        Seconds for all attempts together, or None for no limit.
    """

    def __init__(self, retries: int, limit: float | None) -> None:
        self._retries = retries
        self._deadline = math.inf if limit is None else time.monotonic() + limit
        self._backoff = _SHORTEST
        self._gives_up = math.inf

    @property
    def limit(self) -> float | None:
        """Seconds that the next attempt may take, for gRPC."""
        return within(self._deadline, time.monotonic())

    def pause_after(self, error: SketchmatchError, begun: bool = False) -> float | None:
        """Return the seconds after which to send the request again; None if it is in vain.

        They are no fewer than the server asks for, grow from one attempt to the next, and differ
        from caller to caller, so that not all come back at once. An answer that had begun is worth
        a minute's attempts, whatever their number, unless there are to be none.
        """
        match error:
            case ServerBusyError(retry_after=float(asked)):
                shortest = asked
            case ServerUnavailableError():
                shortest = 0.0
            case _:
                return None
        pause = max(shortest, self._backoff) * random.uniform(1.0, 1.5)
        if begun and self._gives_up == math.inf:
            self._gives_up = time.monotonic() + _AWAY
        if self._retries < 1 or time.monotonic() + pause >= min(self._deadline, self._gives_up):
            return None
        if not begun:
            self._retries -= 1
        self._backoff = min(2.0 * self._backoff, _LONGEST_BEGUN if begun else _LONGEST)
        return pause

    def succeeded(self) -> None:
        """Hear that the server answers."""
        self._backoff, self._gives_up = _SHORTEST, math.inf


class Counted:
    """A method of the server that knows how often it was asked.

    Parameters
    ----------
    method
        The method.
    """

    def __init__(self, method: Callable[..., Any]) -> None:
        self._method = method
        self.asked = 0

    def __call__(self, *request: Any, **options: Any) -> Any:
        """Ask it."""
        self.asked += 1
        return self._method(*request, **options)


def checked_retries(retries: int) -> int:
    """Return how often a request may be sent again.

    Raises
    ------
    InvalidRequestError
        If it is no such number.
    """
    if not isinstance(retries, int) or retries < 0:
        raise InvalidRequestError(
            f"retries is {reprlib.repr(retries)}; give how often a request may be sent again, "
            "at least 0",
            "INVALID_FIELD",
            "retries",
        )
    return retries
