"""FMAPs, their confidence, and the object maps that follow (SPEC 4 and 5), by loops.

An entry here is an ordered pair of argument objects and a table a function of it: nothing is
packed into indices, but for the reading of a :class:`~sketchmatch.model.Fmap`.
"""

import itertools
import math
from fractions import Fraction

from tests.oracle.relations import correspondence


def pairs(objects):
    return [(a, b) for a in range(objects) for b in range(a + 1, objects)]


def read(entries, argument_objects):
    """Return the ordered pair of argument objects of each entry of an FMAP, from 0."""
    meaning = {
        correspondence(c + 1, d + 1, argument_objects): (c, d)
        for c in range(argument_objects)
        for d in range(argument_objects)
        if c != d
    }
    return [meaning[int(entry)] for entry in entries]


def look_up(table, i, pair):
    """Return σ, R and L of template pair i on an ordered argument pair."""
    c, d = pair
    column = correspondence(min(c, d) + 1, max(c, d) + 1, table.argument_objects)
    turn = 0.0 if c < d else math.pi
    return (
        float(table.similarity[i, column]),
        float(table.rotation[i, column]) + turn,
        float(table.dilation[i, column]),
    )


def confidence(table, mapped, weights=(1.0, 1.0, 1.0)):
    """Return ζ, ζσ, ζR and ζL of an FMAP given as ordered argument pairs."""
    entries = [look_up(table, i, pair) for i, pair in enumerate(mapped)]
    count = len(entries)
    zeta_s = sum(sigma for sigma, _, _ in entries) / count
    zeta_r = abs(sum(complex(math.cos(r), math.sin(r)) for _, r, _ in entries)) / count
    levels = [1.5 / math.log(2) * math.log(dilation) for _, _, dilation in entries]
    gaps = [abs(x - y) for k, x in enumerate(levels) for y in levels[k + 1 :]]
    zeta_l = math.exp(-math.log(2) * (sum(gaps) / len(gaps) if gaps else 0.0))
    w1, w2, w3 = (weight / sum(weights) for weight in weights)
    return w1 * zeta_s + w2 * zeta_r + w3 * zeta_l, zeta_s, zeta_r, zeta_l


def induced(partners):
    """Return the FMAP of an object map."""
    return [(partners[a], partners[b]) for a, b in pairs(len(partners))]


def is_pairwise_legal(mapped):
    """Whether no argument pair is used twice, be it as such or as its dual."""
    return len({frozenset(pair) for pair in mapped}) == len(mapped)


def is_object_legal(mapped, template_objects):
    """Whether one injective object map induces the FMAP."""
    partners = {}
    for (a, b), (c, d) in zip(pairs(template_objects), mapped, strict=True):
        if partners.setdefault(a, c) != c or partners.setdefault(b, d) != d:
            return False
    return len(set(partners.values())) == template_objects


def best_object_map(table, weights=(1.0, 1.0, 1.0)):
    """Return the highest ζ of all object maps, and the map, by trying every one."""
    every = itertools.permutations(range(table.argument_objects), table.template_objects)
    return max((confidence(table, induced(p), weights)[0], p) for p in every)


def occm(table, mapped):
    """Return the evidence matrix and its part implied by order, of exact fractions."""
    rows, columns = table.template_objects, table.argument_objects
    evidence = [[Fraction(0)] * columns for _ in range(rows)]
    implied = [[Fraction(0)] * columns for _ in range(rows)]
    for i, ((a, b), (c, d)) in enumerate(zip(pairs(rows), mapped, strict=True)):
        sigma = Fraction(look_up(table, i, (c, d))[0])
        for g, h in ((a, c), (b, d), (a, d), (b, c)):
            evidence[g][h] += sigma
        for g, h in ((a, c), (b, d)):
            implied[g][h] += sigma
    return evidence, implied


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
