"""What searchers and judges are given, with the truth about it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from sketchmatch.api import Histogram, JudgeProblem, MatchProblem, Similarity
from sketchmatch.model import (
    ConfidenceWeights,
    IntArray,
    RelationTable,
    Scene,
    Weights,
    pair_count,
)
from sketchmatch.model.arrays import sealed
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.judge import considered, problem_of
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.request import finds_partial
from sketchmatch.pipeline.search import Goal
from sketchmatch.pipeline.selection import resolve
from sketchmatch.pipeline.slices import finish
from sketchmatch.registry import default_registry
from sketchmatch.testing.sketches import random_scene, simulate_sketch

__all__ = ["judging_problem", "matching_problem", "random_relations"]


def matching_problem(
    rng: np.random.Generator,
    objects: int = 6,
    *,
    missing: int = 0,
    extra: int = 0,
    distortion: float = 1.0,
    weights: Weights = (1.0, 1.0, 1.0),
    histogram: Histogram | None = None,
    similarity: Similarity | None = None,
) -> tuple[MatchProblem, IntArray]:
    """Return the problem of a random scene and a simulated sketch of it, and its truth.

    Parameters
    ----------
    rng
        Source of randomness.
    objects
        How many objects the map has.
    missing
        How many of them the sketch leaves out.
    extra
        How many objects the sketch has that the map has not; at most as many as are missing.
    distortion
        How badly it is drawn: 0 is a copy that is turned, scaled and shuffled, 1 what
        :func:`~sketchmatch.testing.simulate_sketch` takes for a person's.
    weights
        Of ζσ, ζR and ζL.
    histogram, similarity
        How scenes are described and compared; those of the default pipeline when left out.

    Returns
    -------
    MatchProblem
        The sketch is the template, the map the argument.
    ndarray
        int64, shape (objects − missing + extra,): the map object of each sketched object, −1
        for one that the map has not.

    Raises
    ------
    ValueError
        If the sketch would have fewer than two objects or more than the map.

    Examples
    --------
    >>> problem, truth = matching_problem(np.random.default_rng(3), 5, missing=2, extra=1)
    >>> problem.table.template_objects, problem.table.argument_objects, truth.tolist()
    (4, 5, [2, -1, 4, 3])
    """
    sketch, map_, truth = _drawn(rng, objects, missing, extra, distortion)
    usual = resolve(default_registry(), {})
    table = _related(sketch, map_, histogram or usual.histogram, similarity or usual.similarity)
    return MatchProblem(table, weights, scenes=lambda: (sketch, map_)), truth


def judging_problem(
    rng: np.random.Generator,
    objects: int = 6,
    *,
    missing: int = 0,
    extra: int = 0,
    distortion: float = 1.0,
    weights: ConfidenceWeights = ConfidenceWeights(),  # noqa: B008 (frozen)
    price: float = math.inf,
    alternatives: int = 3,
    pinned: Mapping[int, int] = MappingProxyType({}),
    swapped: bool = False,
) -> tuple[JudgeProblem, IntArray]:
    """Return what a judge is given of a random scene and a simulated sketch of it, and the truth.

    The candidates are those that a match with the default pipeline would find.

    Parameters
    ----------
    rng, objects, missing, extra, distortion
        As for :func:`matching_problem`.
    weights
        Of the parts of ζ.
    price
        Of leaving all objects out; infinite where none may be left out.
    alternatives
        How many maps beside the best are wanted.
    pinned
        The argument objects that some template objects are known to be.
    swapped
        Whether the template, which is drawn, is the map, and the argument the sketch; then the
        sketch must leave out more than it adds.

    Returns
    -------
    JudgeProblem
        The scene with fewer objects is the template.
    ndarray
        int64, shape (N,): the argument object of each template object, −1 for none.

    Examples
    --------
    >>> problem, truth = judging_problem(np.random.default_rng(3), 5, missing=1)
    >>> problem.candidates[0].partners.tolist() == truth.tolist()
    True
    """
    template, argument, truth = _drawn(rng, objects, missing, extra, distortion)
    if swapped and len(template) == len(argument):
        raise ValueError("scenes of as many objects are not swapped; leave one out")
    known = np.full(len(template), -1)
    allowed = np.ones((len(template), len(argument)), dtype=bool)
    for g, h in pinned.items():
        known[g] = h
        allowed[g], allowed[:, h] = False, False
        allowed[g, h] = True
    engine = Engine(default_registry())
    usual = engine.resolve({})
    goal = Goal(
        weights,
        price,
        alternatives,
        at_once=finds_partial(usual, engine.registry),
        allowed=sealed(allowed) if pinned else None,
        pinned=sealed(known) if pinned else None,
    )
    scenes = (argument, template) if swapped else (template, argument)
    comparison = finish(engine.compare(scenes, usual.histogram, usual.similarity, weights))
    found = finish(engine.search(comparison, usual.searcher, goal))
    first, others = finish(considered(comparison, found, goal))
    return problem_of(comparison, first, others, goal), truth


def random_relations(
    rng: np.random.Generator, template_objects: int, argument_objects: int
) -> RelationTable:
    """Return a table of independent random relations, which no scenes have: a hard problem.

    Examples
    --------
    >>> random_relations(np.random.default_rng(0), 2, 4).similarity.shape
    (1, 6)
    """
    shape = (pair_count(template_objects), pair_count(argument_objects))
    return RelationTable(
        rng.uniform(0.0, 1.0, shape),
        rng.uniform(0.0, 2.0 * np.pi, shape),
        np.exp(rng.uniform(-1.5, 1.5, shape)),
        template_objects,
        argument_objects,
    )


def _drawn(
    rng: np.random.Generator, objects: int, missing: int, extra: int, distortion: float
) -> tuple[Scene, Scene, IntArray]:
    """Return a sketch, a map, and the map object of each sketched one."""
    if not (0 <= extra <= missing and objects - missing + extra >= 2):
        raise ValueError("a sketch has two objects or more, and no more than the map")
    world = random_scene(rng, objects + extra)
    known = rng.permutation(objects)[: objects - missing]
    sketch = simulate_sketch(
        world,
        rng,
        objects=[*known.tolist(), *range(objects, objects + extra)],
        displacement=0.1 * distortion,
        turn=0.1 * distortion,
        stretch=0.1 * distortion,
        wobble=0.05 * distortion,
    )
    truth = np.where(sketch.partners < objects, sketch.partners, -1)
    return sketch.scene, Scene(world.objects[:objects]), truth


def _related(
    template: Scene, argument: Scene, histogram: Histogram, similarity: Similarity
) -> RelationTable:
    drawn, mapped = (finish(describe(scene, histogram)) for scene in (template, argument))
    return finish(relate(drawn, mapped, similarity))
