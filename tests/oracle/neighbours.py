"""NN, FSNN and the particle swarm (thesis 3.5, 3.6 and 3.7.1), step by step as they are printed.

L̂ counts from the mean of the table's. R̂ is folded, as printed, or circular: R/180°, with
differences modulo 2.

Degrees of closeness are decimals of many digits: near a cluster they differ from 1 by less than a
float can tell.
"""

import math
from decimal import Decimal, localcontext

from tests.oracle.relations import correspondence


def vectors(table, folded):
    """Return (σ̂, R̂, L̂) by (i, j'), duals included."""
    half, result = table.argument_pairs, {}
    logarithms = [math.log(float(dilation)) for dilation in table.dilation.flat]
    mean = math.fsum(logarithms) / len(logarithms)
    for i in range(table.template_pairs):
        for column in range(half):
            for j in (column, column + half):
                rotation = float(table.rotation[i, column]) + (math.pi if j >= half else 0.0)
                degrees = math.degrees(rotation) % 360
                turn = (360 - degrees) / 180 if folded and degrees > 180 else degrees / 180
                level = math.log(float(table.dilation[i, column])) - mean
                level *= 1.5 / math.log(2)
                result[i, j] = (float(table.similarity[i, column]), turn, level)
    count = table.argument_objects
    assert correspondence(count, count - 1, count) == 2 * half - 1
    return result


def distance(first, second, folded):
    """Return how far two points are apart."""
    turned = abs(first[1] - second[1])
    if not folded:
        turned = min(turned % 2, 2 - turned % 2)
    return math.hypot(first[0] - second[0], turned, first[2] - second[2])


def fits(fmap, i, j, argument_pairs):
    """Whether FMAP[i] may become j', by the condition of steps 4.1 (NN) and 7.1 (FSNN)."""
    dual = j - argument_pairs // 2 if j >= argument_pairs // 2 else j + argument_pairs // 2
    return fmap[i] is None and all(entry not in (j, dual) for entry in fmap)


def grow_nearest(table, seed, folded):
    """Grow an FMAP by distance (3.5)."""
    x, argument_pairs = vectors(table, folded), 2 * table.argument_pairs
    fmap = [None] * table.template_pairs
    ordered = sorted(x, key=lambda key: (distance(seed, x[key], folded), key))
    h = 0
    while None in fmap:
        i, j = ordered[h]
        if fits(fmap, i, j, argument_pairs):
            fmap[i] = j
        h += 1
    return fmap


def mean_and_variance(table, folded):
    """Return m and v (3.6.2 and 3.6.3)."""
    x, rows, columns = vectors(table, folded), table.template_pairs, 2 * table.argument_pairs
    distances = [
        distance(x[i, j], x[v, z], folded)
        for i in range(rows)
        for j in range(columns)
        for v in range(rows)
        if v != i
        for z in range(columns)
        if z not in (j, j + columns // 2, j - columns // 2)
    ]
    assert len(distances) == rows * columns * (rows - 1) * (columns - 2)
    mean = math.fsum(distances) / len(distances)
    return mean, math.fsum((d - mean) ** 2 for d in distances) / len(distances)


def closeness(apart, mean, variance, alpha, k):
    """Return μ_close (3.6.1)."""
    d, m, v = Decimal(apart), Decimal(mean), Decimal(variance)
    return 1 / (1 + (Decimal(alpha) * (d - m + Decimal(k) * v) / v).exp())


def grow_fuzzy(table, seed, folded, alpha=10.0, k=1.0):
    """Grow an FMAP by aggregate confidence (3.6)."""
    with localcontext() as context:
        context.prec = 100
        return _grow_fuzzy(table, seed, folded, alpha, k)


def _grow_fuzzy(table, seed, folded, alpha, k):
    x, rows, columns = vectors(table, folded), table.template_pairs, 2 * table.argument_pairs
    fmap = [None] * rows
    if rows == 1:
        return [min(x, key=lambda key: (distance(seed, x[key], folded), key))[1]]
    mean, variance = mean_and_variance(table, folded)

    def mu(first, second):
        return closeness(distance(first, second, folded), mean, variance, alpha, k)

    i, j = min(x, key=lambda key: (distance(seed, x[key], folded), key))
    fmap[i] = j
    added, confidences = [(i, j)], [mu(x[i, j], seed)]
    while len(added) < rows:
        aggregates = {}
        for i in range(rows):
            for j in range(columns):
                if fits(fmap, i, j, columns):
                    terms = [
                        c * mu(x[i, j], x[key]) for c, key in zip(confidences, added, strict=True)
                    ]
                    aggregates[i, j] = sum(terms) / len(added)
        i, j = max(aggregates, key=lambda key: (aggregates[key], -key[0], -key[1]))
        confidences.append(aggregates[i, j])
        fmap[i] = j
        added.append((i, j))
    return fmap


def move(x, v, own_best, best, r1, r2, c1=2.0, c2=2.0, limit=0.2, folded=True):
    """Return position and velocity of one particle after an update (3.7.1 and 3.7.2)."""
    position, velocity = [], []
    for d in range(3):
        to_own, to_best = own_best[d] - x[d], best[d] - x[d]
        if d == 1 and not folded:
            to_own, to_best = (math.remainder(way, 2) for way in (to_own, to_best))
        speed = v[d] + r1 * c1 * to_own + r2 * c2 * to_best
        velocity.append(min(max(speed, -limit), limit))
        position.append(x[d] + velocity[d])
    return position, velocity
