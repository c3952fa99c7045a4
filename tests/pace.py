"""Limits in seconds that hold on a slow or busy machine too.

A test that nothing hangs, or that a search lets go soon, needs a limit. Each is written for the
machine on which `_REFERENCE_SECONDS` was measured, several times what the work takes there, and is
multiplied by how much longer the same piece of work takes here and now.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

_REFERENCE_SECONDS = 0.03


@dataclass
class Watch:
    """How long a block took; known when it has ended."""

    seconds: float = 0.0


def slowness() -> float:
    """Return how many times longer than the reference this machine takes just now, at least 1."""
    began = time.monotonic()
    _work()
    return max(1.0, (time.monotonic() - began) / _REFERENCE_SECONDS)


@contextmanager
def within(limit: float) -> Iterator[Watch]:
    """Hold a block to so many seconds of the reference machine."""
    watch, before = Watch(), slowness()
    began = time.monotonic()
    yield watch
    watch.seconds = time.monotonic() - began
    if watch.seconds >= limit:
        allowed = limit * max(before, slowness())
        assert watch.seconds < allowed, f"it took {watch.seconds:.2f} s, more than {allowed:.2f} s"


def wait_until(condition: Callable[[], object], complaint: str, seconds: float = 60.0) -> None:
    """Wait for what takes a moment, or as long as a very slow machine may need."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, complaint
        time.sleep(0.01)


def _work() -> None:
    """Do what our code does: some of it interpreted, some of it in arrays."""
    values = np.linspace(0.0, 1.0, 20_000)
    for _ in range(20):
        count = 0
        for k in range(30_000):
            count += k & 3
        values = np.sort(np.cos(9.0 * values + count))
