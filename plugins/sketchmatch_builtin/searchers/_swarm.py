"""The particle swarm that chooses seed points, whatever grows FMAPs from them."""

from __future__ import annotations

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from sketchmatch.api import Outcome
from sketchmatch.model import FloatArray
from sketchmatch_builtin.searchers._growers import (
    Found,
    Grower,
    GrowthParams,
    Slices,
    random_seed_point,
)

__all__ = ["SwarmParams", "moved", "swarm"]

_LARGEST_SUM = 4.0


class SwarmParams(GrowthParams):
    """Parameters of the swarm; the thesis leaves particles, c1, c2 and iterations open."""

    particles: int = Field(
        100, ge=2, le=100_000, description="Number of particles, each a seed point that moves."
    )
    c1: float = Field(
        2.0, ge=0, le=_LARGEST_SUM, description="Pull of a particle's own best seed point."
    )
    c2: float = Field(
        2.0,
        ge=0,
        le=_LARGEST_SUM,
        validate_default=True,
        description="Pull of the swarm's best seed point; c1 + c2 is at most 4.",
    )
    velocity_limit: float = Field(
        0.2, gt=0, le=10, description="Largest step of a particle in any direction."
    )
    iterations: int = Field(
        1000, ge=1, le=10_000_000, description="Limit on the number of iterations."
    )
    patience: int = Field(
        30,
        ge=1,
        le=10_000_000,
        description="Iterations without an improvement after which the search has converged.",
    )

    @property
    def most_maps(self) -> int:
        """How many maps grow at most: one of each particle, in each iteration."""
        return self.particles * self.iterations

    @field_validator("c2")
    @classmethod
    def _sum_is_bounded(cls, c2: float, others: ValidationInfo) -> float:
        c1 = others.data.get("c1", 0.0)
        if c1 + c2 > _LARGEST_SUM:
            raise ValueError(f"makes c1 + c2 = {c1 + c2:g}; the sum should be 4 or less")
        return c2


def swarm(
    grower: Grower, params: SwarmParams, found: Found, rng: np.random.Generator
) -> Slices[Outcome]:
    """Let a swarm in a star neighbourhood look for the best seed point (thesis 3.7.1).

    Particles start at random with random velocities. Yields at least once per particle.
    """
    size = params.particles
    positions = np.array([random_seed_point(rng, params.folded) for _ in range(size)])
    velocities = rng.uniform(-params.velocity_limit, params.velocity_limit, (size, 3))
    own_bests, own_values = positions.copy(), np.full(size, -np.inf)
    best, best_value, stale = positions[0], -np.inf, 0
    for iteration in range(1, params.iterations + 1):
        stale += 1
        for k in range(size):
            value = yield from grower.grow(positions[k])
            if value > own_values[k]:
                own_values[k], own_bests[k] = value, positions[k]
            if value > best_value:
                best_value, best, stale = value, positions[k].copy(), 0
            yield
        found.iteration = iteration
        if stale == params.patience:
            return Outcome.CONVERGED
        pulls = rng.random((size, 2)) * (params.c1, params.c2)
        positions, velocities = moved(
            positions, velocities, own_bests, best, pulls, params.velocity_limit, params.folded
        )
    return Outcome.ITERATION_LIMIT


def moved(
    positions: FloatArray,
    velocities: FloatArray,
    own_bests: FloatArray,
    best: FloatArray,
    pulls: FloatArray,
    velocity_limit: float,
    folded: bool,
) -> tuple[FloatArray, FloatArray]:
    """Return positions and velocities after one update (thesis 3.7.1 and 3.7.2).

    Parameters
    ----------
    positions, velocities, own_bests
        Shape (particles, 3).
    best
        Shape (3,), the best seed point of all.
    pulls
        Shape (particles, 2): ρ1 = r1·c1 and ρ2 = r2·c2 of each particle.
    velocity_limit
        No component of a velocity exceeds it.
    folded
        Whether R̂ is as the thesis prints it; a circular one is pulled the shorter way round.
    """
    to_own, to_best = own_bests - positions, best - positions
    if not folded:
        for way in (to_own, to_best):
            way[:, 1] -= 2.0 * np.floor(0.5 * way[:, 1] + 0.5)
    wished = velocities + pulls[:, :1] * to_own + pulls[:, 1:] * to_best
    velocities = np.clip(wished, -velocity_limit, velocity_limit)
    return positions + velocities, velocities
