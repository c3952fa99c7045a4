"""What fits of conditional logits share."""

from __future__ import annotations

import numpy as np

from sketchmatch.model import FloatArray

__all__ = ["log_shares", "significant"]


def log_shares(scores: FloatArray) -> FloatArray:
    scores = scores - scores.max(axis=1, keepdims=True)
    shares: FloatArray = scores - np.log(np.exp(scores).sum(axis=1, keepdims=True))
    return shares


def significant(number: float, digits: int) -> float:
    return float(f"{number:.{digits}g}")
