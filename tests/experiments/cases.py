"""What is matched with what, and what came of it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from sketchmatch import MatchResult, match
from sketchmatch.model import (
    Confidence,
    Fmap,
    IntArray,
    RelationTable,
    Scene,
    SceneDescriptor,
    object_pairs,
)
from sketchmatch.pipeline.correspond import fmap_confidence
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.slices import finish
from sketchmatch_builtin.histograms.constant import ConstantForce
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation
from tests.experiments.methods import METHODS
from tests.experiments.scenes import DRIVES, charted, place_named
from tests.experiments.study import Sketch, Style, sketch, traced

__all__ = ["NOTHING", "Case", "CaseName", "Record", "Removal", "answer", "cases", "evaluate"]

_HIGHER = 1e-9


@dataclass(frozen=True)
class Removal:
    """Pieces of furniture that are taken out before a match.

    Attributes
    ----------
    sketch
        Out of the sketch alone.
    both
        Out of the sketch and the map: a smaller scene.
    """

    sketch: tuple[int, ...] = ()
    both: tuple[int, ...] = ()


NOTHING = Removal()


@dataclass(frozen=True)
class CaseName:
    """Which case it is.

    Attributes
    ----------
    place
        The scene: A, B, or a number of objects; see :func:`tests.experiments.scenes.place_named`.
    number
        Which sketch.
    style
        How the sketch was drawn.
    grid
        Whether the map is an occupancy grid; the sketch's number says from which drive.
    removed
        What was taken out.
    """

    place: str
    number: int
    style: Style
    grid: bool = False
    removed: Removal = NOTHING


@dataclass(frozen=True, eq=False)
class Case:
    """One sketch and one map, ready to be matched.

    Attributes
    ----------
    name
        Which it is.
    sketch, map
        The objects.
    truth
        Shape (N,): for each sketched object its partner on the map, −1 where it has none.
    furniture
        Shape (N,): for each sketched object which piece of furniture it is, −1 for none.
    faults
        How many drawn objects the segmenters lost or invented.
    table
        The relations. The template is the sketch, or the map where it has fewer objects.
    """

    name: CaseName
    sketch: Scene
    map: Scene
    truth: IntArray
    furniture: IntArray
    faults: int
    table: RelationTable

    @property
    def true_map(self) -> dict[int, int]:
        """Sketch index → map index, as it should be."""
        return {k: partner for k, partner in enumerate(self.truth.tolist()) if partner >= 0}

    def confidence(self, object_map: Mapping[int, int]) -> Confidence | None:
        """Return the thesis's ζ of the FMAP that an object map from sketch to map induces.

        None unless every object of the smaller side has a partner.
        """
        pairs = dict(object_map)
        if len(self.sketch) > len(self.map):
            pairs = {b: a for a, b in pairs.items()}
        if len(pairs) < self.table.template_objects:
            return None
        partners = np.array([pairs[k] for k in range(len(pairs))])
        fmap = Fmap.from_object_map(partners, self.table.argument_objects)
        return fmap_confidence(fmap, self.table)

    def zeta(self, object_map: Mapping[int, int]) -> float:
        """Return :meth:`confidence` as a number, NaN where there is none."""
        found = self.confidence(object_map)
        return float("nan") if found is None else found.total


@dataclass(frozen=True)
class Record:
    """What a method made of a case.

    Attributes
    ----------
    case, method
        What was done.
    objects, right
        How many sketched objects have a true partner, and how many of these got it.
    wrong
        The furniture that sketched objects with a wrong partner are, −1 for one that is not there.
    faults
        How many drawn objects the segmenters lost or invented.
    zeta, omega
        ζ of the FMAP found, and Ω, as the method gives them.
    map_zeta, true_zeta
        The thesis's ζ of the FMAPs that the object map found, and the true one, induce; NaN where
        an object of the smaller side has no partner.
    seconds
        Time of the search.
    probability
        That the answer is wholly right, as the method gives it; None where it gives none.
    """

    case: CaseName
    method: str
    objects: int
    right: int
    wrong: tuple[int, ...]
    faults: int
    zeta: float
    omega: float
    map_zeta: float
    true_zeta: float
    seconds: float
    probability: float | None = None

    @property
    def perfect(self) -> bool:
        """Whether the answer is wholly right."""
        return not self.wrong and not self.faults and self.right == self.objects

    @property
    def misled(self) -> bool:
        """Whether ζ of a wrong object map is higher than the true one's: no search can mend it."""
        return bool(self.wrong) and self.map_zeta > self.true_zeta + _HIGHER


def cases(
    place: str,
    number: int,
    style: Style,
    removals: Collection[Removal] = (NOTHING,),
    *,
    grids: Collection[bool] = (False,),
) -> Iterator[Case]:
    """Yield the cases of one sketch: with each removal, on the map and on the grid.

    Parameters
    ----------
    place, number, style
        Which sketch; see :func:`tests.experiments.study.sketch`.
    removals
        What is taken out, for each case.
    grids
        Whether the map is an occupancy grid.
    """
    for grid in grids:
        drive = number % DRIVES if grid else None
        known = place_named(place)
        drawn = traced(known, drive) if style.traced else sketch(known, number, style)
        described = _described(drawn.scene)
        for removed in removals:
            yield _case(CaseName(place, number, style, grid, removed), drive, drawn, described)


def answer(case: Case, method: str) -> MatchResult:
    """Match as the method does; the seed is the sketch's number."""
    chosen = METHODS[method]
    options = {"alternatives": 0, **chosen.options}
    return match(case.sketch, case.map, searcher=chosen.searcher, seed=case.name.number, **options)


def evaluate(case: Case, method: str) -> Record:
    """Match and compare the answer with the truth. Kernels are compiled beforehand."""
    result = answer(case, method)
    found = np.full(len(case.sketch), -1)
    found[[*result.object_map]] = [*result.object_map.values()]
    wrong = found != case.truth
    partnered = case.truth >= 0
    return Record(
        case.name,
        method,
        int(partnered.sum()),
        int((partnered & ~wrong).sum()),
        tuple(case.furniture[wrong].tolist()),
        case.faults,
        result.fmap_confidence,
        result.omap_confidence,
        case.zeta(result.object_map),
        case.zeta(case.true_map),
        result.statistics.seconds["search"],
        result.probability,
    )


def _case(name: CaseName, drive: int | None, drawn: Sketch, described: SceneDescriptor) -> Case:
    map_, removed = charted(place_named(name.place), drive), name.removed
    drawn_kept = _others(drawn.furniture, (*removed.sketch, *removed.both))
    map_kept = _others(map_.furniture, removed.both)
    ours, theirs = drawn.furniture[drawn_kept], map_.furniture[map_kept]
    template = _part(described, drawn_kept)
    argument = _part(_map_described(name.place, drive), map_kept)
    if len(ours) > len(theirs):
        template, argument = argument, template
    return Case(
        name,
        _of(drawn.scene, drawn_kept),
        _of(map_.scene, map_kept),
        _partners(ours, theirs),
        ours,
        drawn.lost + drawn.invented + int((map_.furniture < 0).sum()),
        finish(relate(template, argument, CrossCorrelation())),
    )


def _others(furniture: IntArray, removed: tuple[int, ...]) -> IntArray:
    """Return the indices of the objects that are none of these pieces."""
    return np.flatnonzero(~np.isin(furniture, removed))


def _of(scene: Scene, kept: IntArray) -> Scene:
    return Scene(tuple(scene.objects[k] for k in kept))


def _partners(sketched: IntArray, mapped: IntArray) -> IntArray:
    """Return for each sketched object the mapped object that is the same piece, or −1."""
    same = (sketched[:, None] == mapped[None, :]) & (sketched >= 0)[:, None]
    return np.where(same.any(axis=1), same.argmax(axis=1), -1)


def _part(descriptor: SceneDescriptor, kept: IntArray) -> SceneDescriptor:
    """Return the histograms among some of the objects: the same as of a scene of these."""
    pairs = np.isin(object_pairs(descriptor.objects), kept).all(axis=1)
    return SceneDescriptor(descriptor.histograms[pairs], len(kept), descriptor.exponent)


@cache
def _map_described(place: str, drive: int | None) -> SceneDescriptor:
    return _described(charted(place_named(place), drive).scene)


def _described(scene: Scene) -> SceneDescriptor:
    return finish(describe(scene, ConstantForce()))
