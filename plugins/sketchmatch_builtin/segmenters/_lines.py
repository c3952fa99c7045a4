"""What a drawn line is: closed, or straight."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from sketchmatch.model import FloatArray

__all__ = ["is_closed", "is_outline", "is_straight", "plain_outlines"]

# A triangle has so many points, the first of them twice.
_CORNERS = 4


def is_closed(line: FloatArray) -> bool:
    """Whether a line, shape (k, 2), ends where it begins and is more than there and back."""
    return len(line) > 2 and bool((line[0] == line[-1]).all())


def is_outline(line: FloatArray) -> bool:
    """Whether a line, shape (k, 2), is closed and may enclose something."""
    return len(line) >= _CORNERS and is_closed(line)


def plain_outlines(lines: Sequence[FloatArray]) -> dict[int, shapely.Polygon]:
    """Return what lines enclose, by their numbers, but for those that cross themselves.

    These have no inside that one could tell soon.
    """
    closed = {k: shapely.Polygon(line) for k, line in enumerate(lines) if is_outline(line)}
    return {k: outline for k, outline in closed.items() if outline.is_valid}


def is_straight(line: FloatArray, stray: float) -> bool:
    """Whether a line, shape (k, 2), leaves its chord by no more than a share of that."""
    chord = line[-1] - line[0]
    across = np.abs((line - line[0]) @ np.array([-chord[1], chord[0]]))
    return bool(across.max() <= stray * float(chord @ chord))
