"""How sure a share is."""

from __future__ import annotations

import math

__all__ = ["wilson"]

_NORMAL_95 = 1.959963984540054


def wilson(successes: int, tests: int) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a share.

    References
    ----------
    E. B. Wilson, "Probable inference, the law of succession, and statistical inference", Journal
    of the American Statistical Association 22, 1927.

    Examples
    --------
    The thesis's Table 4.18, 239 of 270:

    >>> [round(limit, 3) for limit in wilson(239, 270)]
    [0.842, 0.918]
    """
    share, z2 = successes / tests, _NORMAL_95**2
    middle = share + z2 / (2 * tests)
    reach = _NORMAL_95 * math.sqrt(share * (1 - share) / tests + z2 / (4 * tests**2))
    scale = 1 + z2 / tests
    return max(0.0, (middle - reach) / scale), min(1.0, (middle + reach) / scale)
