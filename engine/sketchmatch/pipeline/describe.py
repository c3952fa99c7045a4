"""From a scene to the histograms of all its pairs of objects."""

from __future__ import annotations

import math
from collections.abc import Generator

import numpy as np

from sketchmatch.api import Histogram
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import (
    BoolArray,
    FloatArray,
    Scene,
    SceneDescriptor,
    object_pairs,
    pair_count,
)
from sketchmatch.model.arrays import sealed
from sketchmatch.pipeline.guard import blamed, blaming, checked_array, inspecting
from sketchmatch.pipeline.memory import Memory
from sketchmatch.pipeline.slices import in_slices
from sketchmatch.registry import Registry

__all__ = ["check_histograms", "describe", "described", "in_directions", "with_directions"]

# What 400 MB hold: the histograms of 700 objects in 180 directions.
_MAX_HISTOGRAM_VALUES = 50_000_000

# A histogram that five directions meet keeps σ > 0.99 with itself turned by a part of one, most of
# them 0.997. One in ten may be narrower: what is far apart says little of what is next to what.
_MEETING = 5.0
_NARROWER = 0.1
_DIRECTIONS = (180, 720)
_DIRECTIONS_STEP = 60
# Of the larger scene: 100 ms to describe and compare.
_QUICK_HISTOGRAM_VALUES = 3_000_000


def check_histograms(field: str, scene: Scene, histogram: Histogram) -> None:
    """Refuse a scene whose histograms would not fit into memory.

    Raises
    ------
    InvalidInputError
        With ``field`` as its path.
    """
    values = pair_count(len(scene)) * histogram.directions
    if values > _MAX_HISTOGRAM_VALUES:
        raise InvalidInputError(
            Reason.LIMIT_EXCEEDED,
            field,
            f"has {len(scene)} objects, whose relations take {values} numbers, more than the "
            f"limit of {_MAX_HISTOGRAM_VALUES}; leave out small objects",
        )


def with_directions(histogram: Histogram, registry: Registry, *scenes: Scene) -> Histogram:
    """Return a histogram with as many directions as scenes need, if it leaves that to them.

    Parameters
    ----------
    histogram
        The algorithm.
    registry
        Where it comes from, to blame it by name.
    scenes
        One to be described, or the two that are to be compared.

    Raises
    ------
    PluginError
        If it cannot be set up so.
    """
    if histogram.params.directions is not None:
        return histogram
    with blaming(histogram, registry):
        return in_directions(histogram, _needed_directions(*scenes))


def describe(
    scene: Scene,
    histogram: Histogram,
    known: tuple[BoolArray, FloatArray] | None = None,
) -> Generator[float, None, SceneDescriptor]:
    """Describe every pair of a scene.

    A pair that none of the directions meets, because the objects are small for their distance,
    gets the limit of its histogram: the whole force A_a·A_b/D between their centroids, shared by
    the two directions next to it.

    Parameters
    ----------
    scene, histogram
        What is described by what.
    known
        Which pairs are known already, and their histograms, as
        :meth:`~sketchmatch.pipeline.memory.Memory.pairs` returns them.

    Yields
    ------
    float
        The share that is done.

    Returns
    -------
    SceneDescriptor
        One histogram for each pair (a, b), a < b.
    """
    if histogram.params.directions is None:
        histogram = in_directions(histogram, histogram.directions)
    pairs = object_pairs(len(scene))
    if known is None:
        missing, histograms = np.arange(len(pairs)), np.empty((len(pairs), histogram.directions))
    else:
        missing, histograms = np.flatnonzero(~known[0]), known[1]

    def fill(first: int, last: int) -> None:
        rows = missing[first:last]
        found = histogram.describe(scene, pairs[rows])
        histograms[rows] = checked_array(found, (last - first, histograms.shape[1]))

    yield from in_slices(len(missing), fill)
    for index in np.flatnonzero(~histograms.any(axis=1)):
        a, b = (scene.objects[k] for k in pairs[index])
        offset = np.subtract(a.centroid, b.centroid)
        distance = float(np.hypot(*offset))
        if distance > 0.0:
            force = a.area * b.area * distance ** (-1.0 - histogram.exponent)
            angle = float(np.arctan2(offset[1], offset[0]))
            histograms[index] = _point_histogram(angle, force, histograms.shape[1])
    return SceneDescriptor(
        sealed(histograms), len(scene), histogram.exponent, histogram.identity, scene.identity
    )


def described(
    scene: Scene,
    histogram: Histogram,
    registry: Registry,
    side: str,
    memory: Memory | None = None,
) -> Generator[float, None, SceneDescriptor]:
    """Describe every pair of a scene by an algorithm that is not trusted.

    Parameters
    ----------
    scene, histogram, registry
        What is described by what, and where that comes from.
    side
        Path of the scene, for errors.
    memory
        What need not be computed again, if anything is remembered.

    Yields
    ------
    float
        The share that is done.

    Raises
    ------
    InvalidInputError
        With a path that begins with ``side``, if the scene cannot be described so.
    PluginError
        If the histogram breaks its contract.
    """
    if memory is not None and (known := memory.descriptor(scene, histogram)) is not None:
        return known
    pairs = None if memory is None else memory.pairs(scene, histogram)
    try:
        with inspecting(histogram, registry, scene):
            work = describe(scene, histogram, pairs)
            descriptor = yield from blamed(work, histogram, registry)
    except InvalidInputError as error:
        raise error.within(side) from None
    if memory is not None:
        memory.keep(scene, descriptor)
    return descriptor


def in_directions(histogram: Histogram, directions: int) -> Histogram:
    """Return a histogram with so many directions."""
    params = histogram.params.model_copy(update={"directions": directions})
    return type(histogram)(params)


def _needed_directions(*scenes: Scene) -> int:
    """Return how many directions meet the relations of the scene with fewer objects.

    Seen from each other, objects of areas A and B at a distance d are about (√A + √B)/d wide.
    """
    template = min(scenes, key=len)
    centroids = np.array([item.centroid for item in template.objects])
    sizes = np.sqrt([item.area for item in template.objects])
    a, b = object_pairs(len(template)).T
    # The narrower, the larger: objects about one centroid are not narrow at all.
    lengths = np.hypot(*(centroids[a] - centroids[b]).T) / (sizes[a] + sizes[b])
    narrow = float(np.sort(lengths)[math.ceil((1.0 - _NARROWER) * (len(lengths) - 1))])
    least, most = _DIRECTIONS
    most = min(most, _QUICK_HISTOGRAM_VALUES // pair_count(max(map(len, scenes))))
    wanted = min(_MEETING * 2.0 * math.pi * narrow, most)
    steps = math.ceil(wanted / _DIRECTIONS_STEP)
    return max(least, min(steps, most // _DIRECTIONS_STEP) * _DIRECTIONS_STEP)


def _point_histogram(angle: float, force: float, directions: int) -> FloatArray:
    """Return a histogram whose integral over all directions is ``force``, all at one angle."""
    histogram = np.zeros(directions)
    step = 2.0 * math.pi / directions
    place = (angle / step) % directions
    low = int(place)
    share = place - low
    histogram[low % directions] = (1.0 - share) * force / step
    histogram[(low + 1) % directions] += share * force / step
    return histogram
