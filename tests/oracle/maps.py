"""FMAPs, their confidence, and the object maps that follow (SPEC 4 and 5), by loops.

An entry here is an ordered pair of argument objects and a table a function of it. What
contributors score maps with is part of it, and lives in :mod:`sketchmatch.testing.oracle`.
"""

from fractions import Fraction

from sketchmatch.testing.oracle import (
    best_object_map,
    evidence,
    induced,
    is_object_legal,
    is_pairwise_legal,
    look_up,
    pairs,
    read,
)
from sketchmatch.testing.oracle import score_pairs as confidence

__all__ = [
    "best_object_map",
    "confidence",
    "evidence",
    "induced",
    "is_object_legal",
    "is_pairwise_legal",
    "look_up",
    "object_map",
    "occm",
    "pairs",
    "read",
]


def occm(table, mapped):
    """Return the evidence matrix and its part implied by order, of exact fractions."""
    rows, columns = table.template_objects, table.argument_objects
    every = [[Fraction(0)] * columns for _ in range(rows)]
    implied = [[Fraction(0)] * columns for _ in range(rows)]
    for i, ((a, b), (c, d)) in enumerate(zip(pairs(rows), mapped, strict=True)):
        sigma = Fraction(look_up(table, i, (c, d))[0])
        for g, h in ((a, c), (b, d), (a, d), (b, c)):
            every[g][h] += sigma
        for g, h in ((a, c), (b, d)):
            implied[g][h] += sigma
    return every, implied


def object_map(evidence, implied):
    """Return the partner of each template object, and Ω."""
    rows, columns = len(evidence), len(evidence[0])
    partners, total = {}, Fraction(0)
    while len(partners) < rows:
        free = [
            (g, h)
            for g in range(rows)
            for h in range(columns)
            if g not in partners and h not in partners.values()
        ]
        g, h = min(
            free, key=lambda cell: (-evidence[cell[0]][cell[1]], -implied[cell[0]][cell[1]], cell)
        )
        partners[g] = h
        total += evidence[g][h]
    return [partners[g] for g in range(rows)], float(total / (rows * (rows - 1)))
