"""Where regions end: which cut of either side fits the other best, and which regions are one there.

Free space has no objects of its own: what one person draws as a hall is two rooms to another. Each
cut, and each two regions taken for one, is tried by a whole match, and what the judge says of it
decides.
"""

from __future__ import annotations

import cmath
import itertools
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
import shapely

from sketchmatch.api import Segmentation
from sketchmatch.errors import AnswerUnavailableError, InvalidInputError
from sketchmatch.model import FloatArray, Scene, SceneObject
from sketchmatch.pipeline.clock import Clock
from sketchmatch.pipeline.events import Finished, MatchEvent, Phase, Progress
from sketchmatch.pipeline.result import MatchResult, ObjectGroup, ObjectMatch
from sketchmatch.pipeline.slices import retold

__all__ = ["Fit", "fitting_cut", "groups_of"]

Trial = Callable[[Segmentation, Segmentation], Generator[MatchEvent, None, None]]
"""Matches a sketch with a map."""

_LARGEST = 24
"""Objects of a side up to which trials take little time."""

_MOST = 60
"""Trials of a match."""

_CHANCE = 0.1
"""How likely it is this place from which on a fit says something."""

_CLOSED = 1.5
"""How far regions that are one grow towards each other, by their distance."""

_REST = 0.9
"""Of what outlines do not have in common: what is left at most where regions are one."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A match of one cut of either side.

    Attributes
    ----------
    sketch, map
        The cuts.
    result
        What came of it.
    """

    sketch: Segmentation
    map: Segmentation
    result: MatchResult

    @property
    def expected(self) -> float | None:
        """How many lines are right, by their probabilities; None where these are unknown."""
        likely = [line.probability for line in self.result.matches]
        return sum(filter(None, likely)) if None not in likely else None

    @property
    def share(self) -> float:
        """How much of both sides is expected to be matched right."""
        return 2.0 * (self.expected or 0.0) / (len(self.sketch.scene) + len(self.map.scene))

    @property
    def speaks(self) -> bool:
        """Whether it may be this place at all; how well another place fits is chance."""
        place = self.result.place_probability
        return place is None or place >= _CHANCE


def fitting_cut(
    sketches: Sequence[Segmentation], maps: Sequence[Segmentation], trial: Trial, clock: Clock
) -> Generator[MatchEvent, None, Fit]:
    """Match each cut of the sketch with each of the map, and return what fits best.

    That is where the largest share of both sides is expected to be matched right; of several the
    first. Where the judge knows no probabilities, or takes it for another place with each of the
    others, it is the first of all.

    Raises
    ------
    InvalidInputError, AnswerUnavailableError
        As the match of the first two does.
    """
    trials = _Trials(trial, clock, Phase.SEGMENT)
    first, *others = itertools.product(_different(sketches), _different(maps))
    best = yield from trials.matched(*first)
    for sketch, map_ in others if best.expected is not None else ():
        found = yield from trials.tried(sketch, map_)
        if found is not None and found.speaks and found.share > best.share:
            best = found
    return best


def groups_of(
    fit: Fit, trial: Trial, clock: Clock
) -> Generator[MatchEvent, None, tuple[ObjectGroup, ...]]:
    """Return which regions of one side are, together, one of the other.

    Two regions that open into each other, of which one has no partner, are taken for one where that
    has clearly more of a partner's outline, more lines are expected to be right, and none is
    another: what gains most comes first.
    """
    trials = _Trials(trial, clock, Phase.SEARCH)
    singles = tuple(tuple((k,) for k in range(len(side.scene))) for side in (fit.sketch, fit.map))
    best = _Joined((fit.sketch, fit.map), singles, fit)
    while best.fit.expected is not None:
        found: list[_Joined] = []
        for parts in best.joins():
            tried = yield from trials.tried(*map(_as_one, best.given, parts))
            if tried is not None:
                found.append(_Joined(best.given, parts, tried))
        better = [each for each in found if each.expected > best.expected and each.keeps(best)]
        if not better:
            break
        best = max(better, key=lambda each: each.expected)
    return tuple(
        ObjectGroup(drawn, mapped, line.probability)
        for line, drawn, mapped in best.lines()
        if len(drawn) + len(mapped) > 2
    )


_Parts = tuple[tuple[int, ...], ...]
"""Objects that are one, by index, for each."""


@dataclass(frozen=True, eq=False)
class _Joined:
    """A match of two sides on which objects may be taken for one.

    Attributes
    ----------
    given
        Both sides as they are.
    parts
        Of each side, the objects that each object of the match is.
    fit
        The match.
    """

    given: tuple[Segmentation, ...]
    parts: tuple[_Parts, ...]
    fit: Fit

    @property
    def expected(self) -> float:
        """How many lines are right; 0 where that is unknown."""
        return self.fit.expected or 0.0

    def lines(self) -> list[tuple[ObjectMatch, tuple[int, ...], tuple[int, ...]]]:
        """Return each line with the objects that it joins."""
        drawn, mapped = self.parts
        return [
            (line, drawn[line.sketch_object], mapped[line.map_object])
            for line in self.fit.result.matches
        ]

    def keeps(self, other: _Joined) -> bool:
        """Whether each line of another match is one, or part of one, of this."""
        lines = [(set(drawn), set(mapped)) for _, drawn, mapped in self.lines()]
        return all(
            any(set(drawn) <= a and set(mapped) <= b for a, b in lines)
            for _, drawn, mapped in other.lines()
        )

    def joins(self) -> Iterator[tuple[_Parts, ...]]:
        """Yield the parts with two that open into each other as one, where that may be a partner.

        It has clearly more of the outline of the one's partner, or of an object without any where
        none of the two has one, than each of the two.
        """
        partners = self.fit.result.object_map
        known = (partners, {b: a for a, b in partners.items()})
        for side, of in enumerate(known):
            free = [k for k in range(len(self.parts[1 - side])) if k not in known[1 - side]]
            for a, b in self._doors(side):
                if a in of and b in of:
                    continue
                joined = tuple(sorted(self.parts[side][a] + self.parts[side][b]))
                shape = _union([self.given[side].scene.objects[k] for k in joined]).polygon
                others = [of[a]] if a in of else [of[b]] if b in of else free
                if any(self._fits_better(side, shape, (a, b), other) for other in others):
                    rest = [part for k, part in enumerate(self.parts[side]) if k not in (a, b)]
                    fewer = tuple(sorted([*rest, joined]))
                    yield (*self.parts[:side], fewer, *self.parts[side + 1 :])

    def _fits_better(
        self, side: int, joined: shapely.Polygon, apart: tuple[int, int], other: int
    ) -> bool:
        """Whether two as one have clearly more in common with an object than each of them has."""
        single = max(self._overlap(side, self._shape(side, each), other) for each in apart)
        return 1.0 - self._overlap(side, joined, other) < _REST * (1.0 - single)

    def _doors(self, side: int) -> list[tuple[int, int]]:
        """Return which objects of a side open into each other."""
        owner = {each: number for number, part in enumerate(self.parts[side]) for each in part}
        pairs = {(owner[a], owner[b]) for a, b in self.given[side].passages}
        return sorted({(min(pair), max(pair)) for pair in pairs if pair[0] != pair[1]})

    def _shape(self, side: int, k: int) -> shapely.Polygon:
        return (self.fit.sketch, self.fit.map)[side].scene.objects[k].polygon

    def _overlap(self, side: int, shape: shapely.Polygon, other: int) -> float:
        """Return how much a shape and an object of the other side have in common, of both together.

        The sketched one lies upon the other, turned and scaled as the whole sketch is.
        """
        drawn, mapped = (shape, self._shape(1 - side, other))[:: 1 - 2 * side]
        result = self.fit.result
        factor = result.scale * cmath.exp(1j * result.rotation)
        from_, to = (complex(each.centroid.x, each.centroid.y) for each in (drawn, mapped))

        def laid(points: FloatArray) -> FloatArray:
            placed = (points @ (1.0, 1j) - from_) * factor + to
            return np.stack([placed.real, placed.imag], axis=1)

        upon = shapely.transform(drawn, laid)
        common = upon.intersection(mapped).area
        return float(common / (upon.area + mapped.area - common))


class _Trials:
    """Matches that nobody sees, as long as there is time for them and they are few and small."""

    def __init__(self, trial: Trial, clock: Clock, phase: Phase) -> None:
        self._trial, self._clock, self._phase = trial, clock, phase
        self._count, self._longest = 0, 0.0

    def matched(self, sketch: Segmentation, map_: Segmentation) -> Generator[MatchEvent, None, Fit]:
        """Match, telling only that time goes by."""
        found: list[MatchResult] = []

        def tell(event: MatchEvent) -> Iterator[MatchEvent]:
            if isinstance(event, Finished):
                found.append(event.result)
            if isinstance(event, Progress):
                yield Progress(self._phase, self._clock.elapsed())

        began = time.monotonic()
        yield from retold(self._trial(sketch, map_), tell)
        self._count += 1
        self._longest = max(self._longest, time.monotonic() - began)
        if self._clock.is_time_to_tell():
            yield Progress(self._phase, self._clock.elapsed())
        return Fit(sketch, map_, found[0])

    def tried(
        self, sketch: Segmentation, map_: Segmentation
    ) -> Generator[MatchEvent, None, Fit | None]:
        """Match where that is worth its time; None where it is not, or has no answer."""
        largest = max(len(sketch.scene), len(map_.scene))
        # Trials take about as long as one another; whoever waits still wants an answer.
        in_time = self._clock.left() > 2.0 * self._longest
        if largest > _LARGEST or self._count >= _MOST or not in_time:
            return None
        try:
            return (yield from self.matched(sketch, map_))
        except (InvalidInputError, AnswerUnavailableError):
            return None


def _different(cuts: Sequence[Segmentation]) -> list[Segmentation]:
    """Return the cuts without those that are the same as an earlier one."""
    found: dict[str, Segmentation] = {}
    for each in cuts:
        found.setdefault(each.scene.identity, each)
    return list(found.values())


def _as_one(found: Segmentation, parts: _Parts) -> Segmentation:
    """Return what a segmenter found with some of its objects as one."""
    objects = found.scene.objects
    joined = tuple(
        objects[part[0]] if len(part) == 1 else _union([objects[k] for k in part]) for part in parts
    )
    return Segmentation(Scene(joined))


def _union(objects: list[SceneObject]) -> SceneObject:
    """Return objects as one, with the label of the largest that has one."""
    shapes = [item.polygon for item in objects]
    while len(shapes) > 1:
        first = shapes.pop(0)
        nearest = min(range(len(shapes)), key=lambda k: first.distance(shapes[k]))
        shapes.append(_bridged(first, shapes.pop(nearest)))
    labels = [item.label for item in sorted(objects, key=lambda item: -item.area) if item.label]
    return SceneObject.from_polygon(shapes[0], labels[0] if labels else "")


def _bridged(a: shapely.Polygon, b: shapely.Polygon) -> shapely.Polygon:
    """Return two shapes as one, closed where they are nearest."""
    reach = _CLOSED * a.distance(b)
    grown = shapely.union_all([each.buffer(reach, join_style="mitre") for each in (a, b)])
    parts = shapely.get_parts(grown.buffer(-reach, join_style="mitre")).tolist()
    return cast(shapely.Polygon, max(parts, key=lambda part: part.area))
