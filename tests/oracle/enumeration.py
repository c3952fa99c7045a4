"""The best object map by trying every one: by the slow oracle, or compiled for larger scenes.

The compiled one visits the maps in lexicographic order and takes ζ of each with the engine's own
:func:`~sketchmatch.api.kernels.fmap_confidence`, which other tests compare with the slow oracle.
"""

import itertools

import numpy as np

from sketchmatch.api.kernels import fmap_confidence, kernel
from sketchmatch.model import correspondences, object_pairs
from tests.oracle import maps


def every_confidence(table, weights=(1.0, 1.0, 1.0)):
    """Return ζ of every object map as a dictionary, by the slow oracle."""
    every = itertools.permutations(range(table.argument_objects), table.template_objects)
    return {p: maps.confidence(table, maps.induced(p), weights)[0] for p in every}


def best_of_all(table, weights=(1.0, 1.0, 1.0)):
    """Return the highest ζ of all object maps, the first map that has it, and how many maps."""
    return _extreme(table, weights, 1.0)


def worst_of_all(table, weights=(1.0, 1.0, 1.0)):
    """Return the lowest ζ of all object maps, the first map that has it, and how many maps."""
    value, partners, count = _extreme(table, weights, -1.0)
    return -value, partners, count


def _extreme(table, weights, sign):
    partners = np.empty(table.template_objects, dtype=np.int64)
    relations = (table.entry_evidence, table.cosine, table.sine, table.normalized_dilation)
    value, count = _enumerate(
        object_pairs(table.template_objects),
        correspondences(table.argument_objects),
        *relations,
        np.array(weights, dtype=np.float64),
        sign,
        partners,
    )
    return value, partners, count


@kernel
def _enumerate(pairs, columns, evidence, cosine, sine, dilation, weights, sign, best):
    objects, others = best.size, columns.shape[0]
    entries = np.empty(pairs.shape[0], dtype=np.int64)
    scratch = np.empty(pairs.shape[0])
    partners = np.full(objects, -1)
    used = np.zeros(others, dtype=np.bool_)
    highest, count, a = -np.inf, 0, 0
    while a >= 0:
        if a == objects:
            for i in range(entries.size):
                entries[i] = columns[partners[pairs[i, 0]], partners[pairs[i, 1]]]
            value = fmap_confidence(entries, scratch, evidence, cosine, sine, dilation, weights)[0]
            value *= sign
            count += 1
            if value > highest:
                highest = value
                best[:] = partners
            a -= 1
            continue
        c = partners[a]
        if c >= 0:
            used[c] = False
        c += 1
        while c < others and used[c]:
            c += 1
        if c < others:
            partners[a] = c
            used[c] = True
            a += 1
        else:
            partners[a] = -1
            a -= 1
    return highest, count
