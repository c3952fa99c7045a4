"""How much each caller may ask for."""

from __future__ import annotations

import math
import time
from collections import OrderedDict
from collections.abc import Callable

from sketchmatch.errors import TooBusyError, counted

__all__ = ["Rates"]

_MINUTE = 60.0
_MOST_CALLERS = 10_000


class Rates:
    """Lets each caller begin so many requests in a minute: at once, or spread over it.

    Parameters
    ----------
    clock
        Returns seconds that only rise.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._left: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def take(self, caller: str, per_minute: int | None) -> None:
        """Count a request of a caller.

        Raises
        ------
        TooBusyError
            If there were too many; it is not counted then.
        """
        if per_minute is None:
            return
        now = self._clock()
        left, at = self._left.get(caller, (float(per_minute), now))
        left = min(float(per_minute), left + (now - at) * per_minute / _MINUTE)
        if left < 1.0:
            raise TooBusyError(
                f"you have sent {counted(per_minute, 'request')} in a minute, which is the limit "
                "for each caller",
                max(1, math.ceil(round((1.0 - left) * _MINUTE / per_minute, 6))),
            )
        self._left[caller] = left - 1.0, now
        self._left.move_to_end(caller)
        if len(self._left) > _MOST_CALLERS:  # who has not asked for longest has most left
            self._left.popitem(last=False)
