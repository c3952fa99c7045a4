"""A whole transfer: two sources, what is carried between them, and what became of it."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from numbers import Integral
from typing import Any

import numpy as np

from sketchmatch.api import Segmentation
from sketchmatch.errors import InvalidInputError, Reason, counted, quoted
from sketchmatch.model import OccupancyGrid, Scene, Source
from sketchmatch.model.text import Table, Tabular
from sketchmatch.pipeline.clock import Clock
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.events import Finished, MatchEvent, Phase, Progress, Segmented
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch.pipeline.result import MatchResult
from sketchmatch.pipeline.slices import retold
from sketchmatch.transfers.carrying import Course, carried, course_between
from sketchmatch.transfers.features import Carried, Feature, FeatureKind
from sketchmatch.transfers.obstacles import Obstacles
from sketchmatch.transfers.warp import DRAWN, MAPPED, Warp

__all__ = ["ROUTE", "Direction", "TransferRequest", "TransferResult", "run_transfer"]

ROUTE = "route"
"""Name of the route that a segmenter found in a sketch."""

_MOST_RADIUS = 1e6
_UNLIKELY = 0.5


class Direction(StrEnum):
    """Direction of a transfer."""

    SKETCH_TO_MAP = "sketch-to-map"
    MAP_TO_SKETCH = "map-to-sketch"


@dataclass(frozen=True, eq=False)
class TransferRequest:
    """What to transfer, and how.

    Attributes
    ----------
    match
        Sketch and map, and how they are matched; of two maps the old one is the sketch.
    features
        The features to transfer; the route that the segmenter finds in a sketch is added.
    object_map
        Pairs (sketch index, map index) of the same objects, if known: then nothing is matched.
    direction
        Direction of the transfer.
    radius
        Distance of routes from obstacles. None means 0 on a grid; elsewhere routes then do not
        avoid objects.
    allow_unknown
        Whether routes may cross unknown cells.
    sources
        What sketch and map were found in, where they are segmented already.

    Raises
    ------
    InvalidInputError
        If a value is out of its bounds.
    """

    match: MatchRequest
    features: tuple[Feature, ...] = ()
    object_map: tuple[tuple[int, int], ...] | None = None
    direction: Direction = Direction.SKETCH_TO_MAP
    radius: float | None = None
    allow_unknown: bool = False
    sources: tuple[Source | None, Source | None] = (None, None)

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "direction", Direction(self.direction))
        except ValueError:
            raise _refused(
                "direction", f"is {quoted(self.direction)}; give {' or '.join(Direction)}"
            ) from None
        if self.radius is not None and not 0.0 <= self.radius <= _MOST_RADIUS:
            raise _refused(
                "radius", f"is {self.radius:g}; give a number from 0 to {_MOST_RADIUS:g}"
            )
        if self.object_map is not None:
            _check_pairs(self.object_map)


@dataclass(frozen=True, eq=False, repr=False)
class TransferResult(Tabular):
    """The result of a transfer.

    Attributes
    ----------
    carried
        The transferred features: the route of the sketch, if it has one, then the given ones, in
        their order.
    drawn
        How many of them were found in the sketch: one or none.
    warp
        How they were transferred.
    object_map
        Pairs (sketch index, map index) of objects that are the same.
    sketch, map
        What was found on both sides.
    match
        The match, or None if the object map was given.
    """

    carried: tuple[Carried, ...]
    drawn: int
    warp: Warp
    object_map: tuple[tuple[int, int], ...]
    sketch: Segmentation
    map: Segmentation
    match: MatchResult | None

    @property
    def features(self) -> tuple[Feature, ...]:
        """The transferred features, without those of which nothing is left."""
        return tuple(each.feature for each in self.carried if each.feature is not None)

    @property
    def unsureness(self) -> tuple[bool, float]:
        """How little it tells: whether it is probably another place, and the mean deviation."""
        match = self.match
        likely = None if match is None else match.place_probability
        known = [ring for each in self.carried for ring in each.deviations]
        mean = float(np.concatenate(known).mean()) if known else math.inf
        return likely is not None and likely < _UNLIKELY, mean

    def _headline(self) -> str:
        things = counted(len(self.carried), "feature")
        through = f"{len(self.object_map)} objects"
        return f"{things} carried by a warp of kind {self.warp.kind} through {through}"

    def _table(self) -> Table:
        rows = [
            (
                each.name,
                each.kind,
                "" if each.feature is None else f"{each.deviation:.3g}",
                " ".join(change.sentence for change in each.changes),
            )
            for each in self.carried
        ]
        return Table(self._headline(), ("name", "kind", "deviation", "changes"), rows, 3)


def run_transfer(
    request: TransferRequest, engine: Engine, match_id: str = "", clock: Clock | None = None
) -> Generator[MatchEvent, None, TransferResult]:
    """Carry features, yielding the events of the match and then progress; return the result.

    Closing the generator stops the work.

    Raises
    ------
    InvalidInputError
        If the request cannot be used, or the objects' places cannot be carried.
    AnswerUnavailableError
        If the time budget ends before there is any map.
    PluginError
        If a plugin breaks its contract.
    """
    clock = clock or Clock(request.match.time_budget)
    if request.object_map is None:
        sketch, map_, match = yield from _matched(request.match, engine, match_id, clock)
        pairs = tuple(match.object_map.items())
        weights = [1.0 if line.probability is None else line.probability for line in match.matches]
    else:
        sketch, map_ = _segmented(request.match, engine)
        match, pairs, weights = None, request.object_map, [1.0] * len(request.object_map)
        _check_objects(pairs, sketch.scene, map_.scene)
    forth = request.direction is Direction.SKETCH_TO_MAP
    drawn = _drawn_route(sketch) if forth else ()
    features = (*drawn, *request.features)
    if not features:
        raise _refused("features", "is empty, and the sketch has no route; give something to carry")
    sides = (
        request.sources[0] or request.match.sketch,
        request.sources[1] or request.match.map,
    )
    doubt = MAPPED if all(isinstance(each, OccupancyGrid) for each in sides) else DRAWN
    source, target = (sketch, map_) if forth else (map_, sketch)
    ways = pairs if forth else tuple((b, a) for a, b in pairs)
    try:
        course = course_between(source.scene, target.scene, ways, weights, features, doubt)
    except InvalidInputError as error:
        raise InvalidInputError(error.reason, "object_map", error.problem) from None
    given = sides[1] if forth else sides[0]
    obstacles = _obstacles(request, given, target.scene, course, features)
    unit = "m" if isinstance(given, OccupancyGrid) else "units"
    work = carried(features, course, obstacles, request.radius or 0.0, unit)
    found = yield from retold(work, lambda share: _told(share, clock))
    return TransferResult(found, len(drawn), course.warp, pairs, sketch, map_, match)


def _told(share: float, clock: Clock) -> Iterator[Progress]:
    """Give a sign of life, where whoever stops the work stops it; the budget is the match's."""
    if clock.is_time_to_tell():
        yield Progress(Phase.SEARCH, clock.elapsed(), share)
    if clock.curtailed:
        clock.check(Phase.SEARCH)


def _matched(
    request: MatchRequest, engine: Engine, match_id: str, clock: Clock
) -> Generator[MatchEvent, None, tuple[Segmentation, Segmentation, MatchResult]]:
    found: Segmented | None = None
    for event in engine.match(request, match_id, clock):
        if isinstance(event, Segmented):
            found = event
        if isinstance(event, Finished):
            assert found is not None
            return found.sketch, found.map, event.result
        yield event
    raise AssertionError("a match ends with a result or an error")


def _segmented(request: MatchRequest, engine: Engine) -> tuple[Segmentation, Segmentation]:
    given = (request.sketch, request.map)
    sources = [None if isinstance(each, Scene | Segmentation) else each for each in given]
    pipeline = engine.resolve(request.selection, sources[0], sources[1], request.profile)
    sketch = engine.segment_side("sketch", request.sketch, pipeline)
    return sketch, engine.segment_side("map", request.map, pipeline)


def _drawn_route(sketch: Segmentation) -> tuple[Feature, ...]:
    route = sketch.route
    if route is None or len(route) < 2:
        return ()
    return (Feature(FeatureKind.ROUTE, (route,), ROUTE),)


def _obstacles(
    request: TransferRequest,
    given: Source | Scene | Segmentation,
    target: Scene,
    course: Course,
    features: Sequence[Feature],
) -> Obstacles | None:
    """Return what routes are kept out of, if anything."""
    if isinstance(given, OccupancyGrid):
        return Obstacles.of_grid(given, request.allow_unknown)
    if request.radius is None:
        return None
    # All of them: beyond the cells that are drawn here there is no border.
    around = np.vstack([ring for each in features for ring in each.rings])
    return Obstacles.of_scene(target, course.warp(around), request.radius)


def _check_pairs(pairs: tuple[tuple[int, int], ...]) -> None:
    for side, name in enumerate(("sketch_object", "map_object")):
        seen: set[int] = set()
        for k, pair in enumerate(pairs):
            index: Any = pair[side]
            field = f"object_map[{k}].{name}"
            if not isinstance(index, Integral) or index < 0:
                raise _refused(field, f"is {quoted(index)}; give the index of an object, from 0")
            if index in seen:
                raise _refused(field, f"is {index} again; name each object at most once")
            seen.add(int(index))


def _check_objects(pairs: tuple[tuple[int, int], ...], sketch: Scene, map_: Scene) -> None:
    for k, (a, b) in enumerate(pairs):
        for name, index, scene in (("sketch", a, sketch), ("map", b, map_)):
            if index >= len(scene):
                raise _refused(
                    f"object_map[{k}].{name}_object",
                    f"is {index}, but the {name} has objects 0 … {len(scene) - 1}",
                )


def _refused(field: str, problem: str) -> InvalidInputError:
    return InvalidInputError(Reason.INVALID_FIELD, field, problem)
