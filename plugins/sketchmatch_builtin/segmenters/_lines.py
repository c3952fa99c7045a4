"""What a drawn line is: closed, or straight."""

from __future__ import annotations

import numpy as np

from sketchmatch.model import FloatArray

__all__ = ["is_closed", "is_straight"]


def is_closed(line: FloatArray) -> bool:
    """Whether a line, shape (k, 2), ends where it begins and is more than there and back."""
    return len(line) > 2 and bool((line[0] == line[-1]).all())


def is_straight(line: FloatArray, stray: float) -> bool:
    """Whether a line, shape (k, 2), leaves its chord by no more than a share of that."""
    chord = line[-1] - line[0]
    across = np.abs((line - line[0]) @ np.array([-chord[1], chord[0]]))
    return bool(across.max() <= stray * float(chord @ chord))
