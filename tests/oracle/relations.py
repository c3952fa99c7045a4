"""The comparison of histograms (SPEC 3; thesis 3.2), pair by pair and bin by bin."""

import math

import numpy as np

from sketchmatch.testing.oracle import correspondence
from tests.oracle.forces import force_histogram


def descriptor(scene, directions):
    """Return the histogram of each ordered pair (a, b) of a scene, counted from 0."""
    count = len(scene)
    return {
        (a, b): force_histogram(scene.objects[a].rings, scene.objects[b].rings, directions)
        for a in range(count)
        for b in range(count)
        if a != b
    }


def main_direction(histogram):
    n = len(histogram)
    sine = sum(h * math.sin(2 * math.pi * k / n) for k, h in enumerate(histogram))
    cosine = sum(h * math.cos(2 * math.pi * k / n) for k, h in enumerate(histogram))
    return math.atan2(sine, cosine)


def turned(histogram, rotation):
    """Return h(θ − rotation) at every bin, read by periodic linear interpolation."""
    n = len(histogram)
    result = []
    for k in range(n):
        place = k - rotation * n / (2 * math.pi)
        low = math.floor(place)
        share = place - low
        result.append((1 - share) * histogram[low % n] + share * histogram[(low + 1) % n])
    return result


def cross_correlation(first, second):
    product = sum(x * y for x, y in zip(first, second, strict=True))
    return product / math.sqrt(sum(x * x for x in first)) / math.sqrt(sum(y * y for y in second))


def pappis(first, second):
    pairs = list(zip(first, second, strict=True))
    return sum(min(pair) for pair in pairs) / sum(max(pair) for pair in pairs)


def overlap(first, second):
    empty = 1e-9 * max(*first, *second)
    pairs = [pair for pair in zip(first, second, strict=True) if max(pair) > empty]
    return sum(min(pair) / max(pair) for pair in pairs) / len(pairs)


def santini_jain(first, second, alpha=0.5, beta=0.5):
    common = sum(min(x, y) for x, y in zip(first, second, strict=True))
    first_alone = sum(max(x - y, 0.0) for x, y in zip(first, second, strict=True))
    second_alone = sum(max(y - x, 0.0) for x, y in zip(first, second, strict=True))
    apart = alpha * first_alone + beta * second_alone
    return common / (common + apart) if common > 0.0 else 0.0


def main_rotation(template, argument):
    return (main_direction(argument) - main_direction(template)) % (2 * math.pi)


def peak_rotation(template, argument):
    """Return the rotation of the largest cross-correlation, by ternary search between all bins."""
    step = 2 * math.pi / len(template)

    def alike(rotation):
        return cross_correlation(turned(template, rotation), argument)

    found = []
    for w in range(len(template)):
        low, high = w * step, (w + 1) * step
        while high - low > 1e-9 * step:
            early, late = low + (high - low) / 3, high - (high - low) / 3
            low, high = (early, high) if alike(early) < alike(late) else (low, late)
        found += [w * step, (low + high) / 2]
    return max(found, key=alike)


def relation(
    template, argument, exponent=0.0, measure=cross_correlation, rotation_of=main_rotation
):
    """Return (σ, R, L) of two histograms."""
    power = 3 - exponent
    dilation = (np.mean(argument) / np.mean(template)) ** (1 / power)
    rotation = rotation_of(template, argument)
    aligned = turned([h * dilation**power for h in template], rotation)
    return measure(aligned, argument), rotation, dilation


def relation_table(template, argument):
    """Return (σ, R, L) by (row, histogram correspondence), duals included."""
    rows = sorted({a for pair in template for a in pair})
    columns = sorted({c for pair in argument for c in pair})
    return {
        (
            correspondence(a + 1, b + 1, len(rows)),
            correspondence(c + 1, d + 1, len(columns)),
        ): relation(template[a, b], argument[c, d])
        for a in rows
        for b in rows
        if a < b
        for c in columns
        for d in columns
        if c != d
    }
