"""Which progress is worth sending."""

from __future__ import annotations

import time

__all__ = ["Pacing"]

_SHARE = 0.05
_LONGEST = 1.0


class Pacing:
    """Thins the progress of a match out, the longer it runs.

    What a slow reader has not read yet lies in buffers of its own, which no server sees: however
    late the reader is, what comes next is behind all of that. At a rate that falls it catches up,
    while one that is quick sees at first everything and later once a second how it goes.
    """

    def __init__(self) -> None:
        self._began = time.monotonic()
        self._next = 0.0

    def is_due(self) -> bool:
        """Whether it is time to send progress; if so, it counts as sent."""
        elapsed = time.monotonic() - self._began
        if elapsed < self._next:
            return False
        self._next = elapsed + min(_SHARE * elapsed, _LONGEST)
        return True
