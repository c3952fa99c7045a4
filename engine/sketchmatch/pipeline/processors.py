"""How many processors there are for this process, of all that the machine has."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

__all__ = ["usable_cpus"]

_OWN = Path("/proc/self/cgroup")
_GROUPS = Path("/sys/fs/cgroup")


def usable_cpus() -> int:
    """Return the number of processors that this process may use: those it may run on, and its time.

    A container is given some of the machine's processors, or so much time of all of them.
    """
    if hasattr(os, "sched_getaffinity"):
        there_are = len(os.sched_getaffinity(0))
    else:
        there_are = os.cpu_count() or 1
    return max(1, math.ceil(min(there_are, _granted())))


@cache
def _granted() -> float:
    """Return of how many processors the time may be used, by the control groups of Linux."""
    return min(_quotas(), default=math.inf)


def _quotas() -> Iterator[float]:
    with suppress(OSError):
        for line in _OWN.read_text("utf-8").splitlines():
            number, _, path = line.split(":", 2)
            if number == "0":  # version 2: each group above it has its own, too
                group = _GROUPS / path.strip("/")
                for each in (group, *group.parents):
                    yield _quota(each / "cpu.max")
    yield _quota(_GROUPS / "cpu" / "cpu.cfs_quota_us", _GROUPS / "cpu" / "cpu.cfs_period_us")


def _quota(*files: Path) -> float:
    """Return what files say: the time in each period, and how long that is."""
    with suppress(OSError, ValueError, ZeroDivisionError):
        time, period = (int(word) for file in files for word in file.read_text("utf-8").split())
        return time / period if time > 0 else math.inf
    return math.inf
