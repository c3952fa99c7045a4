"""Features carried by a warp, and on a grid kept clear of obstacles."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
import shapely

from sketchmatch.errors import InvalidInputError, quoted
from sketchmatch.model import FloatArray, IntArray, Scene
from sketchmatch.pipeline.slices import retold
from sketchmatch.transfers.features import Carried, Change, ChangeReason, Feature, FeatureKind
from sketchmatch.transfers.obstacles import Obstacles
from sketchmatch.transfers.planning import Landmarks, Way, kept_clear
from sketchmatch.transfers.warp import DRAWN, Warp, fit_warp

__all__ = ["Course", "carried", "course_between"]

_FINE = 1.0 / 400.0
"""How far apart points are carried, as a share of the objects' extent."""
_COARSE = 1.0 / 4000.0
"""By how much a carried line may be simplified, likewise."""
_NEARLY = 1.02
_FARTHEST_CLEAR = 3.0
_MOST_POINTS = 20_000


@dataclass(frozen=True, eq=False)
class Course:
    """How features get from one scene to another.

    Attributes
    ----------
    warp
        The way there.
    landmarks
        The matched objects.
    extent
        Of the objects there, along the longer side.
    """

    warp: Warp
    landmarks: Landmarks
    extent: float


def course_between(
    source: Scene,
    target: Scene,
    pairs: Sequence[tuple[int, int]],
    weights: Sequence[float] | None = None,
    features: Sequence[Feature] = (),
    doubt: float = DRAWN,
) -> Course:
    """Return how features get from one scene to another, through pairs of their objects.

    Parameters
    ----------
    source, target
        The scenes.
    pairs
        Objects of the source and of the target that are the same, by index.
    weights
        How likely each pair is, 0 … 1; all certain when left out.
    features
        What is to be carried: there the warp must not fold.
    doubt
        As :func:`~sketchmatch.transfers.warp.fit_warp` takes it.

    Raises
    ------
    InvalidInputError
        As :func:`~sketchmatch.transfers.warp.fit_warp`.
    """
    drawn, places = _centres(source, [a for a, _ in pairs]), _centres(target, [b for _, b in pairs])
    rings = [ring for feature in features for ring in feature.rings]
    around = np.vstack(rings) if rings else None
    likely = None if weights is None else np.asarray(weights, dtype=np.float64)
    warp = fit_warp(drawn, places, likely, around, doubt)
    names = tuple(
        target.labels[b] or source.labels[a] or f"the object at ({x:.4g}, {y:.4g})"
        for (a, b), (x, y) in zip(pairs, places, strict=True)
    )
    sizes = np.array([math.sqrt(target.objects[b].area) for _, b in pairs])
    return Course(warp, Landmarks(drawn, places, sizes, names), _extent(target))


def carried(
    features: Sequence[Feature],
    course: Course,
    obstacles: Obstacles | None = None,
    radius: float = 0.0,
    unit: str = "",
) -> Generator[float, None, tuple[Carried, ...]]:
    """Carry features, in their order, yielding the share that is done.

    Parameters
    ----------
    features
        What is carried.
    course
        How.
    obstacles
        What routes are kept out of, if anything.
    radius
        How far they are kept away from it.
    unit
        Of the target, for sentences.
    """
    found: list[Carried] = []
    points = _carried_points(features, course, obstacles, radius, unit)
    for k, feature in enumerate(features):
        if feature.kind is FeatureKind.POINT:
            found.append(next(points))
        else:
            done = partial(_done, k / len(features))
            work = _carried_line(feature, course, obstacles, radius, unit)
            found.append((yield from retold(work, done)))
        yield (k + 1) / len(features)
    return tuple(found)


def _done(share: float, _: None) -> tuple[float]:
    return (share,)


def _carried_points(
    features: Sequence[Feature],
    course: Course,
    obstacles: Obstacles | None,
    radius: float,
    unit: str,
) -> Iterator[Carried]:
    """Yield what becomes of each feature that is a point; they are carried all at once."""
    points = [each for each in features if each.kind is FeatureKind.POINT]
    if not points:
        return
    drawn = np.vstack([each.points for each in points])
    places, deviations = course.warp(drawn), course.warp.deviations(drawn)
    inside = clear = np.ones(len(points), dtype=bool)
    if obstacles is not None:
        inside, clear = obstacles.inside(places), obstacles.clear(places, radius)
    for k, each in enumerate(points):
        there = _there(each, (places[k : k + 1],))
        found = Carried(each.kind, each.name, there, (deviations[k : k + 1],), (np.zeros(1),))
        if not inside[k]:
            found = found.changed(Change(ChangeReason.OUTSIDE, 0, 0, "It lies beyond the grid."))
        elif obstacles is not None and not clear[k]:
            found = found.changed(_blocked(places[k], obstacles, radius, unit))
        yield found


def _blocked(place: FloatArray, obstacles: Obstacles, radius: float, unit: str) -> Change:
    """Return what is to be said of a point that is no place for a robot: it is not moved."""
    near = obstacles.nearest_clear(place, radius, max(_FARTHEST_CLEAR, 10.0 * radius))
    there = "" if near is None else f"; the nearest clear place is ({near[0]:.6g}, {near[1]:.6g})"
    kept = obstacles.kept(radius)
    sentence = f"It lies in an obstacle, or less than {kept:.6g} {unit} from one{there}."
    return Change(ChangeReason.BLOCKED, 0, 0, sentence)


def _carried_line(
    feature: Feature, course: Course, obstacles: Obstacles | None, radius: float, unit: str
) -> Generator[None, None, Carried]:
    if feature.kind is FeatureKind.ROUTE:
        return (yield from _carried_route(feature, course, obstacles, radius, unit))
    ways = [_dense(ring, course, closed=True) for ring in feature.rings]
    thin = [way.at(_kept(way, course.extent * _COARSE)) for way in ways]
    if not _is_area(thin):
        thin = ways  # as narrow as it was simplified by
    found = _result(feature, thin, course)
    assert found.feature is not None
    if obstacles is None or obstacles.meets(found.feature.rings):
        return found
    last = len(found.feature.points) - 1
    return found.changed(Change(ChangeReason.OUTSIDE, 0, last, "It lies beyond the grid."))


def _is_area(ways: Sequence[Way]) -> bool:
    outline, *holes = (way.points for way in ways)
    return bool(shapely.Polygon(outline, holes).is_valid)


def _carried_route(
    feature: Feature, course: Course, obstacles: Obstacles | None, radius: float, unit: str
) -> Generator[None, None, Carried]:
    step = course.extent * _FINE if obstacles is None else obstacles.resolution
    way: Way | None = _dense(feature.points, course, closed=False, step=step)
    assert way is not None
    if obstacles is None:
        return _result(feature, [way.at(_kept(way, course.extent * _COARSE))], course)
    way, changes = yield from kept_clear(way, obstacles, radius, course.landmarks, unit)
    if way is None:
        return Carried(feature.kind, feature.name, None, (), (), changes)
    kept = _kept(way, obstacles.resolution / 2.0, obstacles, radius)
    return _result(feature, [way.at(kept)], course).changed(*_placed(changes, kept))


def _placed(changes: Sequence[Change], kept: IntArray) -> list[Change]:
    """Return changes with the indices that points have once only some of them are kept."""
    return [
        replace(
            each,
            first=int(np.searchsorted(kept, each.first, side="right")) - 1,
            last=int(np.searchsorted(kept, each.last)),
        )
        for each in changes
    ]


def _dense(ring: FloatArray, course: Course, closed: bool, step: float | None = None) -> Way:
    """Return a line carried point by point, so closely that what lies between is nearly straight.

    Of a closed one the first point comes again as the last.
    """
    drawn = np.vstack([ring, ring[:1]]) if closed else ring
    places = course.warp(drawn)
    wanted = (course.extent * _FINE if step is None else step) * _NEARLY
    lengths = np.hypot(*np.diff(places, axis=0).T)
    most = max(1, _MOST_POINTS // max(1, len(lengths)))
    counts = np.clip(np.ceil(lengths / wanted), 1, most).astype(int)
    sources = np.concatenate(
        [k + np.arange(count) / count for k, count in enumerate(counts)] + [[len(drawn) - 1.0]]
    )
    whole = np.arange(len(drawn), dtype=np.float64)
    between = np.stack([np.interp(sources, whole, column) for column in drawn.T], axis=1)
    return Way(course.warp(between), sources, between)


def _kept(
    way: Way, tolerance: float, obstacles: Obstacles | None = None, radius: float = 0.0
) -> IntArray:
    """Return which points of a line are kept: those that were given, and others that it takes."""
    given = np.flatnonzero(way.sources == np.floor(way.sources))
    pinned = np.unique(np.concatenate([[0], given, [len(way.points) - 1]]))
    kept: list[int] = [0]
    for first, last in pairwise(pinned.tolist()):
        if last == first + 1:
            kept.append(last)
            continue
        leg = way.points[first : last + 1]
        finer = tolerance
        chosen = _simplified(leg, finer)
        # Close to obstacles a line may be simplified less.
        while obstacles is not None and not obstacles.line_is_clear(leg[chosen], radius):
            finer = finer / 4.0 if finer > tolerance / 100.0 else -1.0
            chosen = _simplified(leg, finer)
            if finer < 0.0:
                break
        kept += [first + k for k in chosen[1:]]
    return np.array(kept)


def _simplified(leg: FloatArray, tolerance: float) -> list[int]:
    """Return which points of a line are kept (Douglas and Peucker)."""
    if len(leg) <= 2:
        return list(range(len(leg)))
    kept, todo = {0, len(leg) - 1}, [(0, len(leg) - 1)]
    while todo:
        a, b = todo.pop()
        if b - a < 2:
            continue
        line = shapely.LineString(leg[[a, b]])
        away = np.atleast_1d(shapely.distance(shapely.points(leg[a + 1 : b]), line))
        far = int(np.argmax(away))
        if away[far] > tolerance:
            kept.add(a + 1 + far)
            todo += [(a, a + 1 + far), (a + 1 + far, b)]
    return sorted(kept)


def _result(feature: Feature, ways: Sequence[Way], course: Course) -> Carried:
    if feature.kind is FeatureKind.ZONE:
        ways = [way.part(0, len(way.points) - 2) for way in ways]
    speeds = None
    if feature.speeds is not None:
        speeds = feature.speeds[np.floor(ways[0].sources).astype(int)]
    there = _there(feature, tuple(way.points for way in ways), speeds)
    deviations, sources = [], []
    for kept, given, way in zip(there.numbers, feature.numbers, ways, strict=True):
        drawn = np.stack([_between(kept, column) for column in way.drawn.T], axis=1)
        deviations.append(course.warp.deviations(drawn))
        around = np.append(given, math.floor(given[-1]) + 1.0)  # a zone ends where it began
        sources.append(_between(_between(kept, way.sources), around))
    return Carried(feature.kind, feature.name, there, tuple(deviations), tuple(sources))


def _between(numbers: FloatArray, values: FloatArray) -> FloatArray:
    """Return values by their number; one with a fraction lies between two of them."""
    return np.interp(numbers, np.arange(len(values), dtype=np.float64), values)


def _there(
    feature: Feature, rings: tuple[FloatArray, ...], speeds: FloatArray | None = None
) -> Feature:
    """Return a feature with other rings."""
    try:
        return Feature(feature.kind, rings, feature.name, speeds)
    except InvalidInputError as error:
        problem = f"hold a {feature.kind} {quoted(feature.name)} that cannot be carried: there it "
        raise InvalidInputError(error.reason, "features", problem + error.problem) from None


def _centres(scene: Scene, indices: Sequence[int]) -> FloatArray:
    return np.array([scene.objects[k].centroid for k in indices]).reshape(-1, 2)


def _extent(scene: Scene) -> float:
    x0, y0, x1, y1 = scene.bounds
    return max(x1 - x0, y1 - y0)
