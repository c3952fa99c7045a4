"""Tests of kernels where numba compiles nothing: ``NUMBA_DISABLE_JIT=1``.

Kernels are plain Python then, a hundred times slower, and coverage and mutation testing see their
lines. Tests draw fewer examples, and some are left to compiled kernels.
"""

import numba
import pytest
from hypothesis import settings

INTERPRETED = bool(numba.config.DISABLE_JIT)
"""Whether kernels run as plain Python."""

compiled_only = pytest.mark.skipif(
    INTERPRETED, reason="takes minutes, or says nothing, where kernels are not compiled"
)


def examples(count: int) -> settings:
    """Return settings with so many examples, or with a fifteenth of them, at least 2."""
    return settings(max_examples=max(2, count // 15) if INTERPRETED else count)
