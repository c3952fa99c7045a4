"""Shapes and sizes of objects as evidence for an entry (SPEC 8), by loops and the definition."""

import math

import numpy as np

from sketchmatch_builtin.histograms.constant import ConstantForce


def own_histograms(scene, directions):
    """Return F^aa of every object as a list over all directions."""
    pairs = np.array([[a, a] for a in range(len(scene))])
    params = ConstantForce.Params(directions=directions)
    return ConstantForce(params).describe(scene, pairs).tolist()


def shape(h, other, turn):
    """Return the normalised cross-correlation of a histogram that is turned with another."""
    count = len(h)
    turned = []
    for k in range(count):
        place = k - turn / (2 * math.pi) * count
        low = math.floor(place)
        rest = place - low
        turned.append((1 - rest) * h[low % count] + rest * h[(low + 1) % count])
    product = sum(x * y for x, y in zip(turned, other, strict=True))
    return product / math.sqrt(sum(x * x for x in turned) * sum(y * y for y in other))


def dilation(h, other):
    """Return the normalised dilation from one histogram of constant forces to another."""
    return 1.5 / math.log(2) * math.log((sum(other) / sum(h)) ** (1 / 3))


def parts(drawn, mapped, pair, other, turn, level):
    """Return s and m of the entry pair → other, by the histograms of both scenes."""
    both = list(zip(pair, other, strict=True))
    s = sum(shape(drawn[a], mapped[c], turn) for a, c in both) / 2
    m = sum(2 ** -abs(dilation(drawn[a], mapped[c]) - level) for a, c in both) / 2
    return s, m
