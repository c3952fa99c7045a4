"""NN, FSNN and the particle swarm (thesis 3.5, 3.6 and 3.7.1), step by step as they are printed.

Degrees of closeness are decimals of many digits: near a cluster they differ from 1 by less than a
float can tell.
"""

import math
from decimal import Decimal, localcontext

from tests.oracle.relations import correspondence


def vectors(table):
    """Return (σ̂, R̂, L̂) by (i, j'), duals included."""
    half, result = table.argument_pairs, {}
    for i in range(table.template_pairs):
        for column in range(half):
            for j in (column, column + half):
                rotation = float(table.rotation[i, column]) + (math.pi if j >= half else 0.0)
                degrees = math.degrees(rotation) % 360
                turn = (360 - degrees) / 180 if degrees > 180 else degrees / 180
                level = 1.5 / math.log(2) * math.log(float(table.dilation[i, column]))
                result[i, j] = (float(table.similarity[i, column]), turn, level)
    count = table.argument_objects
    assert correspondence(count, count - 1, count) == 2 * half - 1
    return result


def fits(fmap, i, j, argument_pairs):
    """Whether FMAP[i] may become j', by the condition of steps 4.1 (NN) and 7.1 (FSNN)."""
    dual = j - argument_pairs // 2 if j >= argument_pairs // 2 else j + argument_pairs // 2
    return fmap[i] is None and all(entry not in (j, dual) for entry in fmap)


def grow_nearest(table, seed):
    """Grow an FMAP by distance (3.5)."""
    x, argument_pairs = vectors(table), 2 * table.argument_pairs
    fmap = [None] * table.template_pairs
    ordered = sorted(x, key=lambda key: (math.dist(seed, x[key]), key))
    h = 0
    while None in fmap:
        i, j = ordered[h]
        if fits(fmap, i, j, argument_pairs):
            fmap[i] = j
        h += 1
    return fmap


def mean_and_variance(table):
    """Return m and v (3.6.2 and 3.6.3)."""
    x, rows, columns = vectors(table), table.template_pairs, 2 * table.argument_pairs
    distances = [
        math.dist(x[i, j], x[v, z])
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


def closeness(distance, mean, variance, alpha, k):
    """Return μ_close (3.6.1)."""
    d, m, v = Decimal(distance), Decimal(mean), Decimal(variance)
    return 1 / (1 + (Decimal(alpha) * (d - m + Decimal(k) * v) / v).exp())


def grow_fuzzy(table, seed, alpha=10.0, k=1.0):
    """Grow an FMAP by aggregate confidence (3.6)."""
    with localcontext() as context:
        context.prec = 100
        return _grow_fuzzy(table, seed, alpha, k)


def _grow_fuzzy(table, seed, alpha, k):
    x, rows, columns = vectors(table), table.template_pairs, 2 * table.argument_pairs
    fmap = [None] * rows
    if rows == 1:
        return [min(x, key=lambda key: (math.dist(seed, x[key]), key))[1]]
    mean, variance = mean_and_variance(table)

    def mu(first, second):
        return closeness(math.dist(first, second), mean, variance, alpha, k)

    i, j = min(x, key=lambda key: (math.dist(seed, x[key]), key))
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


def move(x, v, own_best, best, r1, r2, c1=2.0, c2=2.0, limit=0.2):
    """Return position and velocity of one particle after an update (3.7.1 and 3.7.2)."""
    position, velocity = [], []
    for d in range(3):
        speed = v[d] + r1 * c1 * (own_best[d] - x[d]) + r2 * c2 * (best[d] - x[d])
        velocity.append(min(max(speed, -limit), limit))
        position.append(x[d] + velocity[d])
    return position, velocity
