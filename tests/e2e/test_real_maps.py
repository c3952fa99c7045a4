"""Simulated sketches of real robots' maps: the search finds what is there to be found.

Each run draws 6 to 10 objects of a map, displaced by a tenth of their spacing, each turned and
stretched a little, with wobbling outlines, all turned and scaled at random. It is matched with the
whole map and with the map cropped to what was drawn.
"""

import itertools
import math

import numpy as np
import pytest

from sketchmatch import Scene, match, read_scene
from sketchmatch.model import Fmap
from sketchmatch.pipeline.correspond import fmap_confidence
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.slices import finish
from sketchmatch.testing import simulate_sketch
from sketchmatch_builtin.histograms.constant import ConstantForce
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation
from tests.tools import ROOT, require

MAPS = ROOT.parent / "shared" / "data" / "ogm"
FILES = {
    "turtlebot3": "map.yaml",
    "nav2-depot": "depot.yaml",
    "husky-playpen": "playpen_map.yaml",
    "pmb2-small-office": "map.yaml",
}
RUNS = 10
AMBIGUOUS = 0.96
"""ζ from which another map of the drawn objects onto themselves counts as equally right.

A sketch as noisy as these reaches 0.92 to 0.98 with its truth. The nine pillars of turtlebot3,
symmetric on purpose, reach 0.969 with each of the three wrong turns: this lies below.
"""


@pytest.fixture(scope="module", params=FILES)
def runs(request):
    path = MAPS / request.param / FILES[request.param]
    require(path.exists(), f"shared/data/ogm/{request.param}")
    scene = read_scene(path)
    results = [run(scene, seed) for seed in range(RUNS)]
    print(f"\n{request.param}: {len(scene)} objects; ζ found − ζ of the truth, and right or not")
    for seed, result in enumerate(results):
        told = "  ".join(
            f"{setting} {r['confidence']:.3f} {r['confidence'] - r['truth']:+.3f} {r['right']!s:5}"
            for setting, r in result.items()
            if setting != "rival"
        )
        print(f"  {seed:2}  {told}  rival {result['rival']:.3f}")
    return results


@pytest.mark.slow
@pytest.mark.parametrize("setting", ["whole", "cropped"])
def test_the_search_ends_at_least_as_high_as_the_truth(runs, setting):
    reached = [r[setting]["confidence"] >= r[setting]["truth"] - 1e-9 for r in runs]
    assert sum(reached) >= 0.9 * RUNS


@pytest.mark.slow
def test_what_is_not_ambiguous_is_matched_right(runs):
    right = [r["cropped"]["right"] for r in runs if r["rival"] < AMBIGUOUS]
    assert len(right) >= RUNS / 2, "most runs can tell"
    assert sum(right) >= 0.9 * len(right) - 1e-9


def run(scene, seed):
    """Draw some objects of a map; match the drawing with the map and with what was drawn of it."""
    rng = np.random.default_rng(seed)
    count = min(6 + seed % 5, len(scene))
    chosen = np.sort(rng.permutation(len(scene))[:count])
    cropped = Scene(tuple(scene.objects[k] for k in chosen))
    sketch = simulate_sketch(cropped, rng, displacement=0.1)
    return {
        "whole": outcome(sketch.scene, scene, chosen[sketch.partners], seed),
        "cropped": outcome(sketch.scene, cropped, sketch.partners, seed),
        "rival": rival(cropped),
    }


def outcome(sketch, scene, truth, seed):
    """Match a sketch the thesis's way for the highest ζ and by default for the right map."""
    fmap = Fmap.from_object_map(truth, len(scene))
    return {
        "confidence": match(sketch, scene, profile="thesis", seed=seed).fmap_confidence,
        "truth": fmap_confidence(fmap, relations(sketch, scene)).total,
        "right": match(sketch, scene, seed=seed).object_map == dict(enumerate(truth.tolist())),
    }


def relations(template, argument):
    first, second = (finish(describe(scene, ConstantForce())) for scene in (template, argument))
    return finish(relate(first, second, CrossCorrelation()))


def rival(scene):
    """Return the highest ζ with which a scene maps onto itself other than by the identity.

    It knows nothing of sketch or search. It tries every exchange of two objects and every turn
    and shift that brings one pair of objects to another, each object then taking the nearest that
    is left. Against all permutations of 6 to 8 objects of these maps it missed the highest in 2 of
    174 cases, by less than 0.01.
    """
    table = relations(scene, scene)
    tried = {tuple(p) for p in itertools.chain(exchanges(len(scene)), motions(scene))}
    tried.discard(tuple(range(len(scene))))
    maps = (Fmap.from_object_map(np.array(p), len(scene)) for p in tried)
    return max(fmap_confidence(fmap, table).total for fmap in maps)


def exchanges(count):
    for a, b in itertools.combinations(range(count), 2):
        order = list(range(count))
        order[a], order[b] = b, a
        yield order


def motions(scene):
    centres = np.array([complex(*item.centroid) for item in scene.objects])
    pairs = list(itertools.permutations(centres, 2))
    for (a, b), (c, d) in itertools.product(itertools.combinations(centres, 2), pairs):
        turn = (d - c) / (b - a)
        moved = (centres - (a + b) / 2) * turn / abs(turn) + (c + d) / 2
        yield nearest_first(np.abs(moved[:, None] - centres))


def nearest_first(distances):
    """Return a one-to-one map that takes the nearest two, then the nearest of the rest …"""
    order = [0] * len(distances)
    for _ in order:
        g, h = divmod(int(distances.argmin()), len(distances))
        order[g] = h
        distances[g, :] = distances[:, h] = math.inf
    return order
