"""The degree of a direction by its definition (Matsakis et al. 2001), one small force at a time."""

import math


def degree(histogram, direction, steps=4000):
    """Return how well a direction describes a histogram that is constant within each bin."""
    sides = [[force(histogram, direction + sign * t) for t in middles(steps)] for sign in (1, -1)]
    total = sum(map(sum, sides))
    if total == 0:
        return 0.0
    effective, moment = 0.0, 0.0
    for sign, forces in zip((1, -1), sides, strict=True):
        ahead = list(zip(middles(steps), forces, strict=True))[: steps // 2]
        contradictory = sum(forces[steps // 2 :])
        for deviation, amount in reversed(ahead):
            compensatory = min(amount, contradictory)
            contradictory -= compensatory
            effective += amount - compensatory
            moment += sign * deviation * (amount - compensatory)
    if effective == 0:
        return 0.0
    mean = moment / effective
    return (1 - 2 * abs(mean) / math.pi) * effective / total


def middles(steps):
    """Return the middles of ``steps`` equal parts of half a turn."""
    return [(k + 0.5) * math.pi / steps for k in range(steps)]


def force(histogram, angle):
    n = len(histogram)
    return float(histogram[math.floor(angle * n / (2 * math.pi) + 0.5) % n])
