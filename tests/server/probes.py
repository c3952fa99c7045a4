"""Algorithms that keep a record of when they work and when they are stopped."""

import queue
import threading
import time

from sketchmatch.api import Searcher
from sketchmatch_builtin.histograms.constant import ConstantForce
from sketchmatch_builtin.searchers.easm import Easm

started: queue.Queue[float] = queue.Queue()
"""When a recorded algorithm began to work."""
ended: queue.Queue[float] = queue.Queue()
"""When a recorded search was over, whatever ended it."""
described: list[float] = []
"""When a recorded histogram was last done with a slice."""


class RecordedEasm(Easm):
    name = "recorded-easm"
    summary = "The default search, which says when it begins and when it ends."

    @classmethod
    def warm_up(cls):
        """Leave it to easm: the server's own searches, some time later, are none of a test's."""

    def search(self, problem, rng):
        started.put(time.monotonic())
        try:
            return (yield from super().search(problem, rng))
        finally:
            ended.put(time.monotonic())


class RecordedHistogram(ConstantForce):
    name = "recorded-constant"
    summary = "The default histogram, which says when it works."

    @classmethod
    def warm_up(cls):
        """Leave it to the default histogram."""

    def describe(self, scene, pairs):
        if not described:
            started.put(time.monotonic())
        found = super().describe(scene, pairs)
        described.append(time.monotonic())
        return found


class SlowToWarm(Searcher):
    name = "slow-to-warm"
    summary = "Warms up only when a test lets it."
    may_finish = threading.Event()

    @classmethod
    def warm_up(cls):
        cls.may_finish.wait(30)

    def search(self, problem, rng):
        raise NotImplementedError


class TellsWhenWarm(Searcher):
    name = "tells-when-warm"
    summary = "Tells a test that it was warmed up."
    warm = threading.Event()

    @classmethod
    def warm_up(cls):
        cls.warm.set()

    def search(self, problem, rng):
        raise NotImplementedError


class Exploding(Searcher):
    name = "exploding"
    summary = "Cannot even warm up."

    @classmethod
    def warm_up(cls):
        raise MemoryError("no room")

    def search(self, problem, rng):
        raise NotImplementedError
