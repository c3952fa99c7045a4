"""What histograms of forces share: which objects overlap or touch, and the forces between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import shapely
from pydantic import Field

from sketchmatch.api.histogram import HistogramParams
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.kernels.constant_force import constant_force_histograms
from sketchmatch.kernels.hybrid_force import hybrid_force_histograms
from sketchmatch.kernels.power_force import (
    APART,
    MEETING,
    OVERLAPPING,
    PLAIN,
    TOUCHING,
    power_force_histograms,
)
from sketchmatch.model import Edges, FloatArray, IntArray, Scene, SceneObject
from sketchmatch.model.arrays import sealed

__all__ = [
    "APART",
    "MEETING",
    "OVERLAPPING",
    "OWN_DIRECTIONS",
    "TOUCHING",
    "ForceParams",
    "about_object",
    "exponent_field",
    "force_histograms",
    "hybrid_force_histograms",
    "object_name",
    "own_histograms",
    "refuse_infinite",
    "relations_matter",
    "scene_relations",
]

# Shares of two objects' extent, and of the smaller one's area, that are rounding, not geometry.
_HAIR = 1e-12

OWN_DIRECTIONS = 180
"""Directions of the histograms within objects, where nothing else is asked for."""

_OWN: WeakKeyDictionary[SceneObject, dict[int, FloatArray]] = WeakKeyDictionary()


def exponent_field(default: float) -> Any:
    """Return the parameter r of forces d^−r, with its bounds and text."""
    return Field(
        default=default,
        ge=-10.0,
        le=10.0,
        description="The force at distance d is d^-r; objects may overlap for r < 1 and "
        "touch for r < 2.",
    )


class ForceParams(HistogramParams):
    """The number of directions, and the exponent."""

    r: float = exponent_field(1.0)


def relations_matter(r: float) -> bool:
    """Whether forces d^−r want to know which objects overlap and which touch."""
    return r > PLAIN


def scene_relations(scene: Scene, pairs: IntArray) -> IntArray:
    """Say of each pair of a scene's objects whether they overlap, touch, meet or lie apart.

    What could be the rounding of coordinates counts as touching.

    Parameters
    ----------
    scene
        The scene.
    pairs
        Shape (p, 2), indices into ``scene.objects``.

    Returns
    -------
    ndarray
        Shape (p,): OVERLAPPING, TOUCHING along a line, MEETING at points alone, or APART.
    """
    polygons = np.array([item.polygon for item in scene.objects])
    first, second = pairs.T
    boxes = shapely.bounds(polygons)
    low, high = boxes[:, :2], boxes[:, 2:]
    extents = np.maximum(high[first], high[second]) - np.minimum(low[first], low[second])
    hair = _HAIR * extents.max(axis=1)
    gaps = np.maximum(low[first] - high[second], low[second] - high[first]).max(axis=1)
    relations = np.full(len(pairs), APART, dtype=np.int64)
    (near,) = np.nonzero(gaps <= hair)
    a, b = polygons[first[near]], polygons[second[near]]
    close = shapely.distance(a, b) <= hair[near]
    near, a, b = near[close], a[close], b[close]
    shared = shapely.intersection(a, b)
    smaller = np.minimum(shapely.area(a), shapely.area(b))
    overlapping = shapely.area(shared) > _HAIR * smaller
    # Within a hair nothing tells a line from a point.
    meeting = ~shapely.is_empty(shared) & (shapely.length(shared) <= hair[near])
    relations[near] = np.where(overlapping, OVERLAPPING, np.where(meeting, MEETING, TOUCHING))
    return relations


def object_name(scene: Scene, index: int) -> str:
    """Return an object as a sentence names it: its path and, if it has one, its label."""
    label = scene.objects[index].label
    return f"objects[{index}] ({label!r})" if label else f"objects[{index}]"


def about_object(reason: Reason, name: str, problem: str) -> InvalidInputError:
    """Return an error about an object that is named as :func:`object_name` names it."""
    path, _, label = name.partition(" ")
    return InvalidInputError(reason, path, f"{label} {problem}".lstrip())


def refuse_infinite(
    relations: IntArray, pairs: IntArray, r: float, name: Callable[[int], str]
) -> None:
    """Refuse forces d^−r between objects that overlap, for r ≥ 1, or that touch, for r ≥ 2.

    Parameters
    ----------
    relations, pairs
        Shapes (p,) and (p, 2): how the objects of each pair lie to each other.
    r
        Exponent of the force.
    name
        Gives the path of an object, and what else a sentence should call it.

    Raises
    ------
    InvalidInputError
        If there is an infinite force; the sentence names both objects.
    """
    for closest, least, verb in ((OVERLAPPING, 1, "overlap"), (MEETING, 2, "touch")):
        (found,) = np.nonzero(relations <= closest)
        if r >= least and found.size > 0:
            a, b = pairs[found[0]]
            raise about_object(
                Reason.INFINITE_FORCE,
                name(int(a)),
                f"and {name(int(b))} {verb}, so forces with r = {r:g} between them are infinite; "
                f"use the hybrid histogram, or r below {least}",
            )


def force_histograms(
    edges: Edges, pairs: IntArray, directions: int, r: float, relations: IntArray
) -> FloatArray:
    """Return the exact histograms of the forces d^−r between objects.

    Parameters
    ----------
    edges
        Outlines of the objects.
    pairs
        Shape (p, 2): objects (a, b) of each pair.
    directions
        n, even.
    r
        Exponent of the force.
    relations
        Shape (p,): how the objects of each pair lie to each other; OVERLAPPING where that is not
        known, which it need not be unless :func:`relations_matter`.

    Returns
    -------
    ndarray
        Shape (p, n).
    """
    if r == 0.0:
        return constant_force_histograms(*edges, pairs, directions)
    return power_force_histograms(*edges, pairs, directions, float(r), relations)


def own_histograms(objects: Sequence[SceneObject], directions: int = OWN_DIRECTIONS) -> FloatArray:
    """Return F^aa of each object: the constant forces within it, over half a turn.

    After that they repeat. They carry the object's shape, size and direction, and are computed
    once for as long as the object is there.

    Parameters
    ----------
    objects
        Of any scenes.
    directions
        n, even, over the full turn.

    Returns
    -------
    ndarray
        Shape (objects, n/2).

    Examples
    --------
    A box of 4 by 1: each of the lines along it holds 4²/2 of force, and those across 1²/2.

    >>> box = np.array([[0, 0], [4, 0], [4, 1], [0, 1]])
    >>> own_histograms(Scene.from_polygons([box, box + [9, 0]]).objects, 4)
    array([[8., 2.],
           [8., 2.]])
    """
    missing = [item for item in objects if directions not in _OWN.get(item, ())]
    if missing:
        pairs = np.repeat(np.arange(len(missing)), 2).reshape(-1, 2)
        overlapping = np.full(len(missing), OVERLAPPING, dtype=np.int64)
        found = force_histograms(_centred(missing), pairs, directions, 0.0, overlapping)
        for item, row in zip(missing, found[:, : directions // 2], strict=True):
            hold_own_histogram(item, row, directions)
    return np.array([_OWN[item][directions] for item in objects])


def hold_own_histogram(
    item: SceneObject, row: FloatArray, directions: int = OWN_DIRECTIONS
) -> None:
    """Take a histogram for what :func:`own_histograms` would compute of an object."""
    _OWN.setdefault(item, {})[directions] = sealed(row.copy())


def _centred(objects: Sequence[SceneObject]) -> Edges:
    """Return the edges of objects, each about its own middle: nothing depends on the others."""
    starts, ends = [], []
    for item in objects:
        low, high = item.rings[0].min(axis=0), item.rings[0].max(axis=0)
        rings = [ring - 0.5 * (low + high) for ring in item.rings]
        starts += rings
        ends += [np.roll(ring, -1, axis=0) for ring in rings]
    counts = [sum(map(len, item.rings)) for item in objects]
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    return Edges(np.concatenate(starts), np.concatenate(ends), offsets)
