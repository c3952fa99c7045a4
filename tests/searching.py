"""What the tests of searchers share: relation tables with some order in them, and runs."""

import numpy as np

from sketchmatch.model import RelationTable
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.slices import finish
from sketchmatch.testing import random_scene, simulate_sketch
from sketchmatch_builtin.histograms.constant import ConstantForce
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation

WEIGHTS = [
    (1.0, 1.0, 1.0),
    (1.0, 0.0, 0.0),
    (0.0, 1.0, 0.0),
    (0.0, 0.0, 1.0),
    (0.3, 2.0, 0.0),
    (0.0, 1.0, 5.0),
    (10.0, 0.0, 0.1),
]


def drain(work):
    """Return everything that a search yields, and what it returns."""
    seen = []
    while True:
        try:
            seen.append(next(work))
        except StopIteration as stop:
            return seen, stop.value


def relations_of(template, argument):
    first, second = (finish(describe(each, ConstantForce())) for each in (template, argument))
    return finish(relate(first, second, CrossCorrelation()))


def sketched_table(seed, drawn, objects, **drawing):
    """Return the relations of a simulated sketch and its map."""
    rng = np.random.default_rng(seed)
    scene = random_scene(rng, objects)
    chosen = rng.permutation(objects)[:drawn].tolist()
    return relations_of(simulate_sketch(scene, rng, objects=chosen, **drawing).scene, scene)


def geometric_table(points, others, noise, rng):
    """Return relations of point objects: directions, distances, and σ by chance."""

    def polar(places):
        low, high = np.triu_indices(len(places), k=1)
        offset = places[low] - places[high]
        return np.arctan2(offset[:, 1], offset[:, 0]), np.hypot(*offset.T)

    (angles, lengths), (other_angles, other_lengths) = polar(points), polar(others)
    return RelationTable(
        rng.uniform(1.0 - noise, 1.0, (len(angles), len(other_angles))),
        np.mod(other_angles - angles[:, None], 2 * np.pi),
        other_lengths / lengths[:, None],
        len(points),
        len(others),
    )
