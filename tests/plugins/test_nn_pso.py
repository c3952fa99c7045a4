"""The particle swarm of ``nn-pso`` and ``fsnn-pso``."""

import numpy as np
import pytest

from sketchmatch.api import MatchProblem, Outcome
from sketchmatch.pipeline.slices import finish
from sketchmatch_builtin.searchers._growers import Found, Grower
from sketchmatch_builtin.searchers._swarm import SwarmParams, moved, swarm
from sketchmatch_builtin.searchers.fsnn_pso import FsnnPso
from sketchmatch_builtin.searchers.nn import Nn
from sketchmatch_builtin.searchers.nn_pso import NnPso
from tests.oracle import neighbours
from tests.strategies import random_table


class Landscape(Grower):
    """Notes the seed points and gives each the value of a function, in some slices."""

    def __init__(self, value):
        self.value = value
        self.seeds = []

    def grow(self, seed):
        self.seeds.append(seed.copy())
        yield
        return self.value(seed)


def fly(value, seed=0, **params):
    landscape = Landscape(value)
    found = Found(MatchProblem(random_table(np.random.default_rng(0), 2, 2)))
    work = swarm(landscape, SwarmParams(**params), found, np.random.default_rng(seed))
    return finish(work), found.iteration, np.array(landscape.seeds)


def bowl(seed):
    return -float(np.sum((seed - [0.7, 0.2, 1.5]) ** 2))


@pytest.mark.parametrize("folded", [True, False], ids=["folded", "circular"])
def test_a_particle_moves_as_the_thesis_says(folded):
    rng = np.random.default_rng(1)
    positions, velocities, own_bests = rng.normal(size=(3, 12, 3)) * [[[1.0]], [[0.1]], [[1.0]]]
    best = own_bests[3]
    r1, r2 = rng.random((2, 12))
    pulls = np.stack([1.5 * r1, 0.7 * r2], axis=1)
    after = moved(positions, velocities, own_bests, best, pulls, 0.2, folded)
    for k in range(12):
        expected = neighbours.move(
            *(positions[k], velocities[k], own_bests[k], best),
            *(r1[k], r2[k], 1.5, 0.7),
            folded=folded,
        )
        assert after[0][k] == pytest.approx(expected[0])
        assert after[1][k] == pytest.approx(expected[1])


def test_the_whole_flight_is_the_one_of_the_thesis():
    size, iterations = 5, 12
    _, _, seeds = fly(bowl, seed=3, particles=size, iterations=iterations, rotation="folded")
    rng = np.random.default_rng(3)
    x = [list(rng.random(3) - [0.0, 0.0, 0.5]) for _ in range(size)]
    v = rng.uniform(-0.2, 0.2, (size, 3)).tolist()
    own = [(-np.inf, None)] * size
    best = (-np.inf, None)
    for t in range(iterations):
        for k in range(size):
            assert seeds[t * size + k] == pytest.approx(x[k])
            fitness = bowl(np.array(x[k]))
            if fitness > own[k][0]:
                own[k] = (fitness, x[k])
            if fitness > best[0]:
                best = (fitness, x[k])
        draws = rng.random((size, 2)).tolist()
        for k in range(size):
            x[k], v[k] = neighbours.move(x[k], v[k], own[k][1], best[1], *draws[k])


def test_no_step_is_longer_than_the_limit():
    _, _, seeds = fly(bowl, particles=6, iterations=40, velocity_limit=0.05)
    steps = np.diff(seeds.reshape(40, 6, 3), axis=0)
    assert np.abs(steps).max() <= 0.05 + 1e-12


def test_it_climbs():
    _, _, seeds = fly(bowl, particles=20, iterations=100)
    values = np.array([bowl(seed) for seed in seeds])
    assert values[:20].max() < -0.5, "the top is outside of where particles begin"
    assert values.max() > -0.02


def test_patience_counts_iterations_without_a_better_best():
    assert fly(lambda _: 1.0, patience=7)[:2] == (Outcome.CONVERGED, 8)
    assert fly(lambda _: 1.0)[:2] == (Outcome.CONVERGED, 31)
    assert fly(lambda _: 1.0, patience=7, iterations=5)[:2] == (Outcome.ITERATION_LIMIT, 5)


def test_the_numbers_of_the_thesis_are_the_defaults():
    for searcher in (NnPso, FsnnPso):
        params = searcher.Params()
        assert (params.velocity_limit, params.patience) == (0.2, 30)
        assert params.c1 + params.c2 <= 4
    assert (FsnnPso.Params().alpha, FsnnPso.Params().k) == (10, 1)


@pytest.mark.slow
def test_a_swarm_seldom_does_worse_than_as_many_random_seed_points():
    better = 0
    for seed in range(20):
        table = random_table(np.random.default_rng(seed), 5, 6)
        problem = MatchProblem(table)
        *_, last = NnPso().search(problem, np.random.default_rng(seed))
        random = Nn(Nn.Params(seed_points=last.evaluations))
        *_, other = random.search(problem, np.random.default_rng(seed))
        better += last.confidence >= other.confidence
    assert better >= 16
