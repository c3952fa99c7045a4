"""Tests of kernels where numba compiles nothing: ``NUMBA_DISABLE_JIT=1``.

Kernels are plain Python then, a hundred times slower, and coverage and mutation testing see their
lines. Tests draw fewer examples, and some are left to compiled kernels.
"""

import numba
import pytest
from hypothesis import settings

INTERPRETED = bool(numba.config.DISABLE_JIT)
"""Whether kernels run as plain Python."""

QUICK = 0.4
"""Share of the examples that quick tests draw."""

compiled_only = pytest.mark.skipif(
    INTERPRETED, reason="takes minutes, or says nothing, where kernels are not compiled"
)


def examples(count: int) -> settings:
    """Return settings with so many examples, or fewer, but at least 2.

    Where kernels are plain Python it is a fifteenth of them, and in the quick tests two fifths.
    """
    share = 1 / 15 if INTERPRETED else QUICK if _is_quick() else 1.0
    return settings(max_examples=max(2, int(share * count)))


def _is_quick() -> bool:
    return settings.get_current_profile_name() == "quick"
