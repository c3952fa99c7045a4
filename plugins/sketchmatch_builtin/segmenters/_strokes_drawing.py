"""The strokes of a sketch, the outlines found in it, and what is said of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from sketchmatch.model import FloatArray
from sketchmatch.model.caching import cached_property

from ._strokes_trace import Trace, span_of

__all__ = [
    "DOT",
    "FLICK",
    "FRAME",
    "LONGHAND",
    "ROUTE",
    "TANGLED",
    "WRITING",
    "Drawing",
    "Outline",
]

DOT = "left out as a dot of the pen, which encloses nothing"
FLICK = "left out as far smaller than the objects"
FRAME = (
    "left out as walls or a page around the objects; set frame to 'keep' to have them as objects"
)
LONGHAND = "left out as longhand, which has many small loops"
ROUTE = "taken as the route, which is open and goes across much of the sketch"
WRITING = "left out as writing, which is small and close together in a row"
TANGLED = "left out, as the strokes cross themselves too often to look at them all; draw fewer"

# Reasons why something that a person drew is missing, who wants to know where it is.
_MISSING = {DOT, FLICK, LONGHAND, TANGLED, WRITING}
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
    frame
        Whether it is around other things, as walls are.
    """

    strokes: tuple[int, ...]
    area: shapely.Polygon
    label: str
    open: float
    parted: bool
    frame: bool = False

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
    numbers
        Their numbers in the sketch, from which what draws nothing is missing.
    """

    def __init__(
        self, strokes: Sequence[Trace], labels: Sequence[str], numbers: Sequence[int]
    ) -> None:
        self.strokes = strokes
        self.labels = labels
        self.numbers = numbers
        self.explained: set[int] = set()
        self._reasons: dict[str, list[int]] = {}
        self._notes: list[tuple[int, str]] = []

    @property
    def span(self) -> float:
        """Largest distance between two points of the sketch."""
        points = np.concatenate([stroke.samples for stroke in self.strokes])
        return span_of(shapely.get_coordinates(shapely.MultiPoint(points).convex_hull))

    def named(self, which: Iterable[int], *, found: bool = False) -> str:
        """Return strokes as a phrase: one, two and three; of many, the first few.

        Parameters
        ----------
        which
            Their indices.
        found
            Whether those without a label are told by where they are.
        """
        names = []
        for k in which:
            label = self.labels[k] or (self._place(k) if found else "")
            number = f"strokes[{self.numbers[k]}]"
            names.append(f"{number} ({label})" if label else number)
        if len(names) > _NAMED:
            names = [*names[: _NAMED - 1], f"{len(names) - _NAMED + 1} more"]
        return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)

    def _place(self, stroke: int) -> str:
        """Return where in the sketch a stroke is, whatever its units and its axes are."""
        low, high = self._corners
        points = self.strokes[stroke].points
        middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
        x, y = np.abs(middle - (low[0], high[1])) / np.maximum(high - low, 1e-300)
        return f"{x:.0%} from the left, {y:.0%} from the top"

    @cached_property
    def _corners(self) -> tuple[FloatArray, FloatArray]:
        """Lower left and upper right corner of the sketch."""
        lows = [stroke.points.min(axis=0) for stroke in self.strokes]
        highs = [stroke.points.max(axis=0) for stroke in self.strokes]
        return np.min(lows, axis=0), np.max(highs, axis=0)

    def inside(self, host: Iterable[int]) -> str:
        """Return the reason to leave out what lies in an object."""
        return f"left out as a mark or label inside {self.named(host)}"

    def again(self, first: Iterable[int]) -> str:
        """Return the reason to leave out what repeats an outline."""
        return f"counted once with {self.named(first)}, over which it was drawn again"

    def explain(self, which: Iterable[int], reason: str) -> None:
        """Say why strokes are no object; those with the same reason share a sentence."""
        self.explained.update(which)
        self._reasons.setdefault(reason, []).extend(which)

    def note(self, stroke: int, sentence: str) -> None:
        """Say something of one stroke, or of an object that begins with it."""
        self._notes.append((self.numbers[stroke], sentence))

    def sentences(self) -> tuple[str, ...]:
        """Return all that is said, in the order of the strokes."""
        notes = list(self._notes)
        for reason, which in self._reasons.items():
            verb = "was" if len(which) == 1 else "were"
            name = self.named(sorted(which), found=reason in _MISSING)
            notes.append((self.numbers[min(which)], f"{name} {verb} {reason}."))
        return tuple(sentence for _, sentence in sorted(notes, key=lambda note: note[0]))
