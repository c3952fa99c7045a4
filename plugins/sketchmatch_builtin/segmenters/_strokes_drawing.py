"""The strokes of a sketch, the outlines found in it, and what is said of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from sketchmatch.model.caching import cached_property

from ._strokes_trace import Trace, span_of

__all__ = ["FLICK", "LONGHAND", "ROUTE", "TANGLED", "Drawing", "Outline"]

FLICK = "left out: far smaller than the objects"
LONGHAND = "left out: many small loops, as longhand has them"
ROUTE = "taken as the route: open, and across much of the sketch"
TANGLED = "left out: the strokes cross themselves too often to look at them all; draw fewer"

# Strokes named in one sentence.
_NAMED = 8


@dataclass(frozen=True, eq=False)
class Outline:
    """A closed outline.

    Attributes
    ----------
    strokes
        Indices of the strokes that it is made of.
    area
        The largest area that they enclose.
    label
        Name for people, or empty.
    open
        Share of its length that is gaps between strokes.
    parted
        Whether they enclose more, apart from it.
    """

    strokes: tuple[int, ...]
    area: shapely.Polygon
    label: str
    open: float
    parted: bool

    @cached_property
    def span(self) -> float:
        """Largest distance between two points of it."""
        return span_of(shapely.get_coordinates(self.area.convex_hull))


class Drawing:
    """All strokes of a sketch, and what the person who drew it is told about them.

    Parameters
    ----------
    strokes
        The strokes in the order they were drawn.
    labels
        A name for each, or empty.
    """

    def __init__(self, strokes: Sequence[Trace], labels: Sequence[str]) -> None:
        self.strokes = strokes
        self.labels = labels
        self.explained: set[int] = set()
        self._reasons: dict[str, list[int]] = {}
        self._notes: list[tuple[int, str]] = []

    @property
    def span(self) -> float:
        """Largest distance between two points of the sketch."""
        points = np.concatenate([stroke.samples for stroke in self.strokes])
        return span_of(shapely.get_coordinates(shapely.MultiPoint(points).convex_hull))

    def named(self, which: Iterable[int]) -> str:
        """Return strokes as a phrase: one, two and three; of many, the first few."""
        labels = ((k, self.labels[k]) for k in which)
        names = [f"strokes[{k}] ({label})" if label else f"strokes[{k}]" for k, label in labels]
        if len(names) > _NAMED:
            names = [*names[: _NAMED - 1], f"{len(names) - _NAMED + 1} more"]
        return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)

    def inside(self, host: Iterable[int]) -> str:
        """Return the reason to leave out what lies in an object."""
        return f"left out: inside {self.named(host)}, as marks and labels are"

    def again(self, first: Iterable[int]) -> str:
        """Return the reason to leave out what repeats an outline."""
        return f"counted once with {self.named(first)}: drawn over it again"

    def explain(self, which: Iterable[int], reason: str) -> None:
        """Say why strokes are no object; those with the same reason share a sentence."""
        self.explained.update(which)
        self._reasons.setdefault(reason, []).extend(which)

    def note(self, stroke: int, sentence: str) -> None:
        """Say something of one stroke, or of an object that begins with it."""
        self._notes.append((stroke, sentence))

    def sentences(self) -> tuple[str, ...]:
        """Return all that is said, in the order of the strokes."""
        notes = list(self._notes)
        for reason, which in self._reasons.items():
            verb = "was" if len(which) == 1 else "were"
            notes.append((min(which), f"{self.named(sorted(which))} {verb} {reason}."))
        return tuple(sentence for _, sentence in sorted(notes, key=lambda note: note[0]))
