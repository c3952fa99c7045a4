"""The interface of segmenters: from a source to a scene."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

from sketchmatch.api._algorithm import Algorithm
from sketchmatch.model import FloatArray, Scene

__all__ = ["Segmentation", "Segmenter"]


@dataclass(frozen=True, eq=False)
class Segmentation:
    """What a segmenter found.

    Attributes
    ----------
    scene
        The objects.
    warnings
        What it left out or decided, each one sentence for the person who drew it.
    route
        Shape (k, 2), the route that a person drew through the scene, in its coordinates, from start
        to end, or None. It is not an object and never influences a match.
    passages
        Pairs of objects, by index, that open into each other, as rooms do: people may draw two of
        these as one. Empty if objects are things.
    """

    scene: Scene
    warnings: tuple[str, ...] = ()
    route: FloatArray | None = None
    passages: tuple[tuple[int, int], ...] = ()


class Segmenter(Algorithm, ABC):
    """Finds the objects in a source.

    Attributes
    ----------
    sources
        The source types that it reads, from :mod:`sketchmatch.model`.
    """

    sources: ClassVar[tuple[type[Any], ...]]

    @abstractmethod
    def segment(self, source: Any) -> Segmentation:
        """Return the objects of ``source``, which is of one of the types in ``sources``.

        Raises
        ------
        InvalidInputError
            With a path relative to the source, if nothing usable is in it.
        """

    def cuts(self, source: Any) -> Iterator[Segmentation]:
        """Yield what :meth:`segment` returns, then what else the objects may be.

        Where one object ends and the next begins may be unclear, as in free space, which can be cut
        coarser or finer. A match takes the cut of either side that fits the other side best, or the
        first if none fits better; it asks for further cuts only while there is time, and for twelve
        at most. By default there is only one.

        Raises
        ------
        InvalidInputError
            As :meth:`segment` does, before the first; other cuts without use are left out.
        """
        yield self.segment(source)
