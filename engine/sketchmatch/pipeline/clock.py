"""The time of a match: what is left of it, what each stage takes, and when to tell of it."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager

from sketchmatch.errors import AnswerUnavailableError

__all__ = ["Clock"]

_TELL_EVERY = 0.05


class Clock:
    """Runs from when it is made.

    Parameters
    ----------
    budget
        Seconds that there are, or None for no limit.

    Attributes
    ----------
    seconds
        What the stages took so far.
    curtailed
        Whether somebody had less time than the budget.
    """

    def __init__(self, budget: float | None = None) -> None:
        self.seconds: dict[str, float] = {}
        self._budget = math.inf if budget is None else budget
        self._started = time.monotonic()
        self._stopped = 0.0
        self._told = -math.inf
        self.curtailed = False

    def elapsed(self) -> float:
        """Return the seconds since the beginning."""
        return time.monotonic() - self._started

    def spent(self) -> float:
        """Return those of them that count."""
        return self.elapsed() - self._stopped

    def left(self) -> float:
        """Return the seconds that are left; infinite without a budget, and never below 0."""
        return max(0.0, self._budget - self.spent())

    def curtail(self, seconds: float) -> None:
        """Leave no more than so many seconds from now on; any thread may do so."""
        if (end := self.spent() + seconds) < self._budget:
            self._budget, self.curtailed = end, True

    def check(self, phase: str) -> None:
        """Go on in a phase that has no answer to give.

        Raises
        ------
        AnswerUnavailableError
            If there is no time left.
        """
        if self.left() <= 0.0:
            raise AnswerUnavailableError(
                f"the time budget of {self._budget:g} s ended in phase {phase.lower()}, before "
                "there was any answer; allow more time or match fewer objects"
            )

    def is_time_to_tell(self) -> bool:
        """Whether 50 ms have passed since this was last true."""
        now = time.monotonic()
        if now - self._told < _TELL_EVERY:
            return False
        self._told = now
        return True

    @contextmanager
    def stopped(self) -> Iterator[None]:
        """Let the time of a block not count."""
        began = time.monotonic()
        yield
        self._stopped += time.monotonic() - began

    @contextmanager
    def timing(self, stage: str) -> Iterator[None]:
        """Take the time of a stage, of several times that of all together."""
        began = time.monotonic()
        yield
        spent = time.monotonic() - began
        self.seconds[stage] = self.seconds.get(stage, 0.0) + spent
