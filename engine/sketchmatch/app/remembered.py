"""What a process remembers of scenes, so that requests about the same ones need not begin anew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from sketchmatch.api import Histogram
from sketchmatch.api.forces import hold_own_histogram
from sketchmatch.app.setup import Setup
from sketchmatch.app.shelf import LARGEST_KEPT, Described, Shelf, described_by
from sketchmatch.model import FloatArray, Scene, SceneDescriptor
from sketchmatch.pipeline.memory import Lookups, Memory

__all__ = ["Remembered"]


class Remembered:
    """Scenes that are kept, and histograms of those met lately.

    Parameters
    ----------
    path
        The file of the scenes that are kept; None where none are.
    """

    def __init__(self, path: Path | None) -> None:
        self.path = path
        self._shelf = Shelf(path, self._met)
        self._hand_in: Callable[[Described], None] = lambda _: None
        self._memory = Memory(fetch=self._fetch, described=self._described)

    def setup(self, setup: Setup, hand_in: Callable[[Described], None]) -> Setup:
        """Return a setup whose engine remembers; ``hand_in`` takes what is to be kept."""
        self._hand_in = hand_in
        engine = replace(setup.engine, memory=self._memory)
        return replace(setup, engine=engine, shelf=self._shelf)

    def take_lookups(self) -> Lookups:
        """Return how often histograms were needed since this was asked last."""
        return self._memory.take_lookups()

    def close(self) -> None:
        """Close the file, until it is read again."""
        self._shelf.close()

    def _met(self, scene: Scene) -> None:
        """Take what is kept of the objects of a scene that was decoded, or have it kept."""
        if self.path is None:
            return
        kept = self._shelf.own_histograms(scene)
        if kept is None:
            self._hand_in(Described.within(scene))
            return
        for item, row in zip(scene.objects, kept, strict=True):
            hold_own_histogram(item, row)

    def _fetch(self, scene: Scene, histogram: Histogram) -> FloatArray | None:
        return self._shelf.histograms(scene, histogram) if self._shelf.holds(scene) else None

    def _described(self, scene: Scene, descriptor: SceneDescriptor) -> None:
        small = descriptor.histograms.nbytes <= LARGEST_KEPT
        if self.path is not None and small and self._shelf.holds(scene):
            told = described_by(descriptor.described_by)
            self._hand_in(Described(scene.identity, told, descriptor.histograms))
