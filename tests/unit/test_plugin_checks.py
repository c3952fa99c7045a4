"""Each contract of a plugin is broken once, and its check, and no other, says so."""

import re
import subprocess
import sys
import threading
import time
from dataclasses import replace
from types import SimpleNamespace
from typing import Annotated, Literal

import numpy as np
import pytest
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from sketchmatch.api import (
    Histogram,
    HistogramParams,
    InvalidInputError,
    Judge,
    JudgedMap,
    Judgement,
    Outcome,
    Params,
    ProductSimilarity,
    Reason,
    Searcher,
    SearchProgress,
    Segmentation,
    Segmenter,
    Similarity,
)
from sketchmatch.model import Fmap, OccupancyGrid, PolygonSet, Scene, SceneObject
from sketchmatch.testing import (
    ContractViolationError,
    check_plugin,
    matching_problem,
    parametrize_plugins,
    plugin_checks,
    score_fmap,
    search_report,
)

# Plugins in plain Python that keep every contract ------------------------------------------------


class RandomMaps(Searcher):
    """Tries random object maps one after the other, and keeps the best. Source: none."""

    name = "random-maps"
    summary = "Random object maps."

    class Params(Params):
        tries: int = Field(25, ge=1, le=1_000_000, description="Number of maps.")

    def search(self, problem, rng):
        table, best, found = problem.table, -1.0, None
        for k in range(1, self.params.tries + 1):
            partners = rng.permutation(table.argument_objects)[: table.template_objects]
            fmap = Fmap.from_object_map(partners, table.argument_objects)
            zeta = score_fmap(fmap, table, problem.weights).total
            if zeta > best:
                best, found = zeta, fmap
            yield SearchProgress(found, best, iteration=k, evaluations=k, upper_bound=1.0)
        return Outcome.ITERATION_LIMIT


class Centres(Histogram):
    """Spreads a pair's force over the half turn about the direction of the centroids."""

    name = "centres"
    summary = "Direction of centroids, spread over half a turn."
    exponent = 0.0

    class Params(HistogramParams):
        """The number of directions alone."""

    def describe(self, scene, pairs):
        angles = 2 * np.pi * np.arange(self.params.directions) / self.params.directions
        rows = np.zeros((len(pairs), len(angles)))
        for row, (a, b) in zip(rows, pairs, strict=True):
            offset = np.subtract(scene.objects[a].centroid, scene.objects[b].centroid)
            main = np.arctan2(offset[1], offset[0])
            # Blunter than a half turn, or with 4 directions some would be all but empty.
            row[:] = np.hypot(*offset) ** 3 * (1.0 + np.cos(angles - main)) ** 4
        return rows


class Cosine(Similarity):
    """Takes two histograms as vectors and returns the cosine of the angle between them."""

    name = "cosine"
    summary = "Cosine of the angle."

    def compare(self, aligned, argument):
        norms = np.linalg.norm(aligned, axis=1) * np.linalg.norm(argument, axis=1)
        return np.clip((aligned * argument).sum(axis=1) / norms, 0.0, 1.0)


class ProductCosine(ProductSimilarity):
    """Takes two histograms as vectors and returns the cosine of the angle, from their products."""

    name = "product-cosine"
    summary = "Cosine of the angle."

    def combine(self, product, template_square, argument_square):
        return np.clip(product / np.sqrt(template_square * argument_square), 0.0, 1.0)


class Boxes(Segmenter):
    """Takes the box around each polygon as an object, as a child would stack them."""

    name = "boxes"
    summary = "Boxes around polygons."
    sources = (PolygonSet,)

    def segment(self, source):
        if len(source.polygons) < 2:
            raise InvalidInputError(Reason.TOO_FEW_OBJECTS, "polygons", "are too few; give two")
        boxes = []
        for k, polygon in enumerate(source.polygons):
            if not polygon.rings or not np.isfinite(polygon.rings[0]).all():
                raise InvalidInputError(
                    Reason.INVALID_POLYGON, f"polygons[{k}]", "has no shape; draw an outline"
                )
            boxes.append(box(polygon.rings[0].min(axis=0), polygon.rings[0].max(axis=0)))
        return Segmentation(Scene.from_polygons(boxes))


class Ranks(Judge):
    """Takes the candidates as they come, and believes in the first. Source: none."""

    name = "ranks"
    summary = "The first candidate, and then the others."

    def judge(self, problem):
        believed = 0.5
        first, *others = problem.candidates
        lines = np.zeros((len(first.partners), problem.table.argument_objects + 1))
        lines[np.arange(len(lines)), first.partners] = believed
        maps = (JudgedMap(first.partners, believed), *(JudgedMap(o.partners) for o in others))
        return Judgement(maps, lines, elsewhere=0.25)


class Blocks(Segmenter):
    """Takes the box around each group of occupied cells as an object, walls among them."""

    name = "blocks"
    summary = "Boxes around occupied cells."
    sources = (OccupancyGrid,)

    def segment(self, source):
        boxes = [self.placed(corners, source) for corners in groups(source.cells)]
        if len(boxes) < 2:
            raise InvalidInputError(Reason.TOO_FEW_OBJECTS, "cells", "hold too little; map more")
        return Segmentation(Scene.from_polygons(boxes))

    def placed(self, corners, source):
        x, y, yaw = source.origin
        turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
        return corners * source.resolution @ turn + [x, y]


def box(low, high):
    return np.array([low, [high[0], low[1]], high, [low[0], high[1]]])


def groups(cells):
    """Yield the box around each group of occupied cells, in cells."""
    left = set(map(tuple, np.argwhere(cells > 50)))
    while left:
        group, reached = [], [left.pop()]
        while reached:
            row, column = reached.pop()
            group.append((column, row))
            beside = {(row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)}
            reached += left & beside
            left -= beside
        yield box(np.min(group, axis=0), np.max(group, axis=0) + 1)


GOOD = [RandomMaps, Centres, Cosine, ProductCosine, Boxes, Blocks, Ranks]


@pytest.mark.slow
@parametrize_plugins(GOOD)
def test_plain_python_keeps_every_contract(check):
    check()


# Such that break one ------------------------------------------------------------------------------


def like(base, **changed):
    """Return a class like another but for some attributes."""
    return type(f"Broken{base.__name__}", (base,), {"__doc__": base.__doc__, **changed})


def params(base=Params, config=None, **fields):
    """Return a class of parameters, each given as (type, default)."""
    body = {
        "__module__": __name__,
        "__annotations__": {name: kind for name, (kind, _) in fields.items()},
        **{name: default for name, (_, default) in fields.items()},
    }
    return type("Params", (base,), body if config is None else {**body, "model_config": config})


def no_nine(value):
    if value == 9:
        raise ValueError("makes an unlucky number; take another")
    return value


def forgetful(self, _=None):
    self.params = type(self).Params()


def warm_twice(cls):
    cls.warmed = getattr(cls, "warmed", 0) + 1
    return "warm again" if cls.warmed > 1 else None


NINE = Field(5, ge=1, le=9, description="A number.")
ANY_KIND = {
    "name-is-kebab-case": ("'Cosine_2'", like(Cosine, name="Cosine_2")),
    "summary-is-one-sentence": ("'Cosine'", like(Cosine, summary="Cosine")),
    "docstring-says-more": ("0 characters", like(Cosine, __doc__=None)),
    "params-derive-from-params": (
        "Params",
        like(Cosine, Params=params(BaseModel, ConfigDict(frozen=True, extra="forbid"))),
    ),
    "params-are-frozen": (
        "not frozen",
        like(Cosine, Params=params(config=ConfigDict(frozen=False))),
    ),
    "params-forbid-others": (
        "no_such_parameter = 1 is accepted",
        like(Cosine, Params=params(config=ConfigDict(extra="ignore"))),
    ),
    "parameters-are-described": (
        "power",
        like(Cosine, Params=params(power=(int, Field(1, ge=1, le=9)))),
    ),
    "defaults-are-valid": (
        "power is refused",
        like(Cosine, Params=params(power=(int, Field(0, ge=1, description="A power.")))),
    ),
    "parameters-reach-the-object": (
        "given power = 1",
        like(Cosine, Params=params(power=(int, NINE)), __init__=forgetful),
    ),
    "bounds-are-accepted": (
        "power = 9 is refused",
        like(Cosine, Params=params(power=(Annotated[int, AfterValidator(no_nine)], NINE))),
    ),
    "bad-parameters-are-refused": (
        "power = nan is accepted",
        like(
            Cosine,
            Params=params(
                config=ConfigDict(allow_inf_nan=True),
                power=(float, Field(1.0, description="A power.")),
            ),
        ),
    ),
    "warm-up-can-be-repeated": ("'warm again'", like(Cosine, warm_up=classmethod(warm_twice))),
}


def search(change):
    """Return a search like RandomMaps' whose progress, numbered from 1, is changed."""

    def changed(self, problem, rng):
        work, k = RandomMaps.search(self, problem, rng), 0
        while True:
            try:
                progress = next(work)
            except StopIteration as stop:
                return stop.value
            k += 1
            yield change(progress, problem, k)

    return changed


def other(progress, **changed):
    return SearchProgress(**{**vars(progress), **changed})


def is_usual(problem):
    """Whether it is the first problem that a searcher is put to."""
    return (problem.table.template_objects, problem.table.argument_objects) == (4, 6)


def is_large(problem):
    return problem.table.template_objects > 10


class Wrapped:
    """A generator that is none."""

    def __init__(self, work):
        self.work, self.close = work, work.close

    def __iter__(self):
        return self

    def __next__(self):
        return next(self.work)


def duck(progress, *_):
    return SimpleNamespace(**vars(progress))


def illegal(progress, problem, _):
    if not is_usual(problem):
        return progress
    fmap = Fmap(np.zeros(6))
    return other(
        progress, fmap=fmap, confidence=score_fmap(fmap, problem.table, problem.weights).total
    )


def crossing(progress, problem, _):
    if not is_usual(problem):
        return progress
    fmap = Fmap(np.arange(6))
    return other(
        progress, fmap=fmap, confidence=score_fmap(fmap, problem.table, problem.weights).total
    )


def seeing_pairs_alone(self, problem, rng):
    table = replace(problem.table, evidence=None)
    yield from RandomMaps.search(self, replace(problem, table=table), rng)
    return Outcome.ITERATION_LIMIT


def weighing_alike(self, problem, rng):
    table = replace(problem.table, rotation_weights=np.ones(1))
    yield from RandomMaps.search(self, replace(problem, table=table), rng)
    return Outcome.ITERATION_LIMIT


def boasting_of_starts(progress, problem, _):
    return other(progress, confidence=progress.confidence + (0.1 if problem.start else 0.0))


def boasting(progress, problem, _):
    return other(progress, confidence=progress.confidence + (1e-6 if is_usual(problem) else 0.0))


def forgetting(progress, problem, k):
    if k < 25 or not is_usual(problem):
        return progress
    fmap = Fmap.from_object_map(np.array([3, 1, 0, 2]), 6)
    return other(
        progress, fmap=fmap, confidence=score_fmap(fmap, problem.table, problem.weights).total
    )


def with_one_object(progress, problem, _):
    partners = np.full(problem.table.template_objects, -1)
    partners[0] = 2
    return other(progress, maps=(partners,))


def first_only(outcome, **changed):
    def at_once(self, problem, rng):
        progress = next(RandomMaps.search(self, problem, rng))
        bound = changed.get("bound", 1.0)
        yield other(progress, upper_bound=progress.confidence if bound is None else bound)
        return outcome

    return at_once


def no_two(self, problem, rng):
    if problem.table.template_objects == 2:
        raise ZeroDivisionError("one pair has no spread")
    return (yield from RandomMaps.search(self, problem, rng))


def global_dice(self, problem, rng):
    np.random.random()  # noqa: NPY002 - it must not
    return (yield from RandomMaps.search(self, problem, rng))


def until_late(self, problem, rng):
    begun = time.monotonic()
    for progress in RandomMaps.search(self, problem, rng):
        yield progress
        time.sleep(0.001)
        if time.monotonic() - begun > 1.0:
            break
    return Outcome.ITERATION_LIMIT


def slow(progress, problem, k):
    if is_large(problem) and k == 2:
        time.sleep(0.6)
    return progress


def slow_to_end(self, problem, rng):
    try:
        return (yield from RandomMaps.search(self, problem, rng))
    except GeneratorExit:
        time.sleep(0.12)
        raise


def with_a_thread(self, problem, rng):
    if is_large(problem):
        threading.Thread(target=time.sleep, args=(1.0,), name="left", daemon=True).start()
    return (yield from RandomMaps.search(self, problem, rng))


def noisy(self, given=None):
    type(self).__mro__[1].__init__(self, given)
    self.noise = 1.0 + 1e-12 * np.random.default_rng().random()


def with_own_dice(self, problem, rng):
    for progress in RandomMaps.search(self, problem, rng):
        yield other(progress, confidence=progress.confidence * self.noise)
    return Outcome.ITERATION_LIMIT


def sharing(self, problem, rng):
    self.problem = problem
    time.sleep(0.005)
    return (yield from RandomMaps.search(self, self.problem, rng))


def opened(array):
    """Whether a view of what can be written to is made to be one that can."""
    if array.base is None or not array.base.flags.writeable:
        return False
    array.flags.writeable = True
    return True


def writing(self, problem, rng):
    values = problem.table.similarity
    if opened(values):
        values[0, 0] += 1e-13
    return (yield from RandomMaps.search(self, problem, rng))


SEARCHERS = {
    "search-returns-a-generator": (
        "a Wrapped",
        like(RandomMaps, search=lambda *given: Wrapped(RandomMaps.search(*given))),
    ),
    "search-yields-progress": ("a SimpleNamespace", like(RandomMaps, search=search(duck))),
    "search-returns-an-outcome": ("returned None", like(RandomMaps, search=first_only(None))),
    "fmaps-are-legal": ("[0, 0, 0, 0, 0, 0]", like(RandomMaps, search=search(illegal))),
    "alternatives-are-legal": (
        "an FMAP has shape (1,)",
        like(
            RandomMaps,
            search=search(lambda progress, *_: other(progress, alternatives=(Fmap([0]),))),
        ),
    ),
    "confidence-is-zeta": ("it claims ζ =", like(RandomMaps, search=search(boasting))),
    "confidence-never-falls": ("ζ fell from", like(RandomMaps, search=search(forgetting))),
    "upper-bound-is-true": (
        "and a map has",
        like(RandomMaps, search=first_only(Outcome.CONVERGED, bound=None)),
    ),
    "upper-bound-never-rises": (
        "it rose from",
        like(
            RandomMaps,
            search=search(lambda progress, _, k: other(progress, upper_bound=1.0 + 0.01 * k)),
        ),
    ),
    "optimal-is-optimal": (
        "it returned OPTIMAL",
        like(RandomMaps, search=first_only(Outcome.OPTIMAL)),
    ),
    "object-maps-are-kept-to": (
        "an FMAP leads to no object map",
        like(RandomMaps, search=search(crossing)),
    ),
    "maps-beside-are-possible": (
        "its object map matches 1 objects, fewer than 3",
        like(RandomMaps, partial=True, search=search(with_one_object)),
    ),
    "iterations-are-no-more-than-maps": (
        "it says most_maps = 24, and has made 25 iterations",
        like(RandomMaps, most_maps=24),
    ),
    "starts-are-taken": (
        "it claims ζ =",
        like(RandomMaps, warm=True, search=search(boasting_of_starts)),
    ),
    "evidence-is-weighed": ("it claims ζ =", like(RandomMaps, search=seeing_pairs_alone)),
    "rotations-are-weighed": ("it claims ζ =", like(RandomMaps, search=weighing_alike)),
    "odd-problems-are-solved": (
        "with 2 on 2 objects, it raised ZeroDivisionError",
        like(RandomMaps, search=no_two),
    ),
    "randomness-is-the-generators": ("of np.random", like(RandomMaps, search=global_dice)),
    "clock-plays-no-part": ("another answer", like(RandomMaps, search=until_late)),
    "yields-come-promptly": ("s from one yield to the next", like(RandomMaps, search=search(slow))),
    "closing-ends-the-search": (
        "closing it after yield 1 took",
        like(RandomMaps, search=slow_to_end),
    ),
    "answers-repeat": ("different answers", like(RandomMaps, __init__=noisy, search=with_own_dice)),
    "threads-agree": ("4 threads", like(RandomMaps, search=sharing)),
    "inputs-stay-untouched": (
        "it wrote to table.similarity of a problem of 4 on 6 objects",
        like(RandomMaps, search=writing),
    ),
}


def describe(change):
    """Return a describe() like Centres' whose rows are changed."""

    def changed(self, scene, pairs):
        return change(Centres.describe(self, scene, pairs), scene, pairs, self)

    return changed


def as_crowded_as_the_scene(rows, scene, *_):
    return rows * (1.0 + 1e-9 * sum(item.area for item in scene.objects))


def as_seen_from_the_origin(rows, scene, pairs, _):
    centres = np.array([item.centroid for item in scene.objects])
    seen = np.arctan2(centres[:, 1], centres[:, 0])
    return rows * (2.0 + np.cos(seen[pairs[:, 0]] - seen[pairs[:, 1]]))[:, None]


def mostly_along_the_axes(rows, *_):
    angles = 2 * np.pi * np.arange(rows.shape[1]) / rows.shape[1]
    return rows * (1.0 + 0.1 * np.cos(4 * angles))


def changing_the_pairs(rows, _, pairs, __):
    if len(pairs) > 1 and opened(pairs):
        pairs[0] = pairs[0, ::-1].copy()
    return rows


def sharing_the_scene(self, scene, pairs):
    self.scene = scene
    time.sleep(0.005)
    return Centres.describe(self, self.scene, pairs)


HISTOGRAMS = {
    "rows-are-finite": (
        "of float32",
        like(Centres, describe=describe(lambda rows, *_: rows.astype(np.float32))),
    ),
    "rows-have-the-directions-asked-for": (
        "of 4 directions it gave 36",
        like(
            Centres,
            describe=lambda _, *given: Centres(Centres.Params(directions=36)).describe(*given),
        ),
    ),
    "directions-go-counter-clockwise": (
        "right of another is 180°",
        like(
            Centres,
            describe=lambda self, scene, pairs: Centres.describe(self, scene, pairs[:, ::-1]),
        ),
    ),
    "dual-is-turned-by-half": (
        "differ",
        like(
            Centres,
            describe=describe(
                lambda rows, _, pairs, __: rows * np.where(pairs[:, :1] > pairs[:, 1:], 2.0, 1.0)
            ),
        ),
    ),
    "rotation-shifts-the-rows": (
        "turned by 10°",
        like(Centres, describe=describe(mostly_along_the_axes)),
    ),
    "scale-multiplies-the-rows": ("r = 1", like(Centres, exponent=1.0)),
    "translation-changes-nothing": (
        "moved by (40, −70)",
        like(Centres, describe=describe(as_seen_from_the_origin)),
    ),
    "pairs-are-described-alone": (
        "1 at a time",
        like(Centres, describe=describe(lambda rows, *_: rows * len(rows))),
    ),
    "rows-of-pairs-last": (
        "a row changed with another object",
        like(Centres, of_pairs=True, describe=describe(as_crowded_as_the_scene)),
    ),
    "answers-repeat": (
        "different answers",
        like(
            Centres,
            __init__=noisy,
            describe=describe(lambda rows, _, __, self: rows * self.noise),
        ),
    ),
    "threads-agree": ("4 threads", like(Centres, describe=sharing_the_scene)),
    "inputs-stay-untouched": (
        "it wrote to pairs of a scene of 5 objects",
        like(Centres, describe=describe(changing_the_pairs)),
    ),
}


def sharing_rows(self, aligned, argument):
    self.rows = aligned
    time.sleep(0.005)
    return Cosine.compare(self, self.rows, argument)


def writing_rows(self, aligned, argument):
    for rows in (aligned, argument):
        if opened(rows):
            np.multiply(rows, 1.0 + 1e-13, out=rows)
    return Cosine.compare(self, aligned, argument)


def compare(change):
    """Return a compare() like Cosine's whose values are changed."""
    return lambda self, aligned, argument: change(Cosine.compare(self, aligned, argument), self)


SIMILARITIES = {
    "alignment-is-known": ("'peak'", like(Cosine, alignment="peak")),
    "similarity-is-within-0-and-1": (
        "a value is",
        like(Cosine, compare=compare(lambda values, _: 2.0 * values - 1.0)),
    ),
    "equal-rows-have-similarity-1": (
        "0.5",
        like(Cosine, compare=compare(lambda values, _: 0.5 * values)),
    ),
    "rows-are-compared-alone": (
        "1 at a time",
        like(Cosine, compare=compare(lambda values, _: values ** len(values))),
    ),
    "combine-agrees-with-compare": (
        "combine() and compare() differ",
        like(ProductCosine, compare=compare(lambda values, _: values**2)),
    ),
    "answers-repeat": (
        "different answers",
        like(Cosine, __init__=noisy, compare=compare(lambda values, self: values / self.noise)),
    ),
    "threads-agree": ("4 threads", like(Cosine, compare=sharing_rows)),
    "inputs-stay-untouched": (
        "it wrote to aligned and argument of 12 pairs of rows",
        like(Cosine, compare=writing_rows),
    ),
}


def segment(change):
    """Return a segment() like Boxes' whose scene's rings are changed."""

    def changed(self, source):
        found = Boxes.segment(self, source)
        rings = [item.rings[0] for item in found.scene.objects]
        return Segmentation(Scene.from_polygons([change(ring, self) for ring in rings]))

    return changed


def sharing_the_source(self, source):
    self.source = source
    time.sleep(0.005)
    return Boxes.segment(self, self.source)


def writing_the_source(self, source):
    found = Boxes.segment(self, source)
    ring = source.polygons[0].rings[0]
    ring.flags.writeable = True
    ring[0] += 1e-9
    return found


def raising(self, source):
    if len(source.polygons) < 2:
        raise IndexError("no polygon")
    return Boxes.segment(self, source)


def naming_the_stage(self, source):
    try:
        return Boxes.segment(self, source)
    except InvalidInputError as error:
        raise error.within("sketch") from None


def saying(*warnings):
    return lambda self, source: Segmentation(Boxes.segment(self, source).scene, warnings)


SEGMENTERS = {
    "sources-are-known": ("sources is [", like(Boxes, sources=[PolygonSet])),
    "scenes-are-found": (
        "a SimpleNamespace",
        like(Boxes, segment=lambda *given: SimpleNamespace(**vars(Boxes.segment(*given)))),
    ),
    "warnings-are-sentences": ("'no stop'", like(Boxes, segment=saying("no stop"))),
    "blank-sources-are-refused": (
        "no polygon made it raise IndexError",
        like(Boxes, segment=raising),
    ),
    "y-points-up": (
        "of polygon_set",
        like(Boxes, segment=segment(lambda ring, _: ring * [1.0, -1.0])),
    ),
    "grids-are-in-the-frame-of-the-map": (
        "m off",
        like(Blocks, placed=lambda _, corners, source: corners * source.resolution),
    ),
    "resolution-scales-the-scene": (
        "m off",
        like(
            Blocks,
            placed=lambda self, corners, source: Blocks.placed(
                self, corners * (0.05 / source.resolution), source
            ),
        ),
    ),
    "answers-repeat": (
        "different answers",
        like(Boxes, __init__=noisy, segment=segment(lambda ring, self: ring * self.noise)),
    ),
    "threads-agree": ("4 threads", like(Boxes, segment=sharing_the_source)),
    "inputs-stay-untouched": (
        "it wrote to polygons[0].rings[0] of a source of type polygon_set",
        like(Boxes, segment=writing_the_source),
    ),
}


def judge(change):
    """Return a judge() like Ranks' whose judgement of usual problems is changed."""

    def changed(self, problem):
        judgement = Ranks.judge(self, problem)
        if not has_shape(problem, 5, 6):
            return judgement
        return change(judgement, problem, self)

    return changed


def has_shape(problem, few, many):
    table = problem.table
    return (table.template_objects, table.argument_objects) == (few, many)


def with_first(judgement, **changed):
    first, *others = judgement.maps
    return replace(judgement, maps=(replace(first, **changed), *others))


def taking_one_twice(judgement, *_):
    first = judgement.maps[0].partners
    twice = np.where(first == first[1], first[0], first)
    return with_first(judgement, partners=twice, probability=None)


def no_pair(self, problem):
    if has_shape(problem, 2, 2):
        raise ZeroDivisionError("nothing to compare")
    return Ranks.judge(self, problem)


def sharing_the_problem(self, problem):
    self.problem = problem
    time.sleep(0.005)
    return Ranks.judge(self, self.problem)


def writing_for_judges(self, problem):
    if opened(problem.table.similarity):
        problem.table.similarity[0, 0] += 1e-13
    return Ranks.judge(self, problem)


JUDGES = {
    "maps-are-possible": (
        "its object map takes an object of the argument twice",
        like(Ranks, judge=judge(taking_one_twice)),
    ),
    "probabilities-agree": (
        "its map is right with probability 0.625, but one of its lines only with 0.5",
        like(Ranks, judge=judge(lambda given, *_: with_first(given, probability=0.625))),
    ),
    "price-is-a-number": ("its price is 0.0", like(Ranks, price=lambda *_: 0.0)),
    "odd-problems-are-judged": (
        "with 2 on 2 objects, it raised ZeroDivisionError",
        like(Ranks, judge=no_pair),
    ),
    "answers-repeat": (
        "different answers",
        like(
            Ranks,
            __init__=noisy,
            judge=judge(lambda given, _, self: replace(given, elsewhere=0.1 * self.noise)),
        ),
    ),
    "threads-agree": ("4 threads", like(Ranks, judge=sharing_the_problem)),
    "inputs-stay-untouched": (
        "it wrote to table.similarity of a problem of 5 on 6 objects",
        like(Ranks, judge=writing_for_judges),
    ),
}

BROKEN = [
    pytest.param(name, seen, algorithm, id=f"{kind}-{name}")
    for kind, cases in (
        ("any", ANY_KIND),
        ("searcher", SEARCHERS),
        ("histogram", HISTOGRAMS),
        ("similarity", SIMILARITIES),
        ("segmenter", SEGMENTERS),
        ("judge", JUDGES),
    )
    for name, (seen, algorithm) in cases.items()
]


def violations(algorithm):
    """Return what each check that a class fails says, by its name."""
    said = {}
    for check in plugin_checks(algorithm):
        try:
            check()
        except ContractViolationError as violation:
            said[check.name] = str(violation)
    return said


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seen", "algorithm"), BROKEN)
def test_what_breaks_one_contract_fails_that_check_alone(name, seen, algorithm):
    said = violations(algorithm)
    assert list(said) == [name], said
    sentence = said[name]
    assert sentence.startswith(f"{algorithm.__module__}.{algorithm.__qualname__} breaks {name}: ")
    assert seen in sentence
    assert "; expected: " in sentence
    assert "\n" not in sentence


@pytest.mark.parametrize("search", [search(crossing), seeing_pairs_alone])
def test_a_search_of_pairs_may_say_so(search):
    assert not violations(like(RandomMaps, search=search, object_consistent=False))


def test_every_check_has_a_class_that_breaks_it():
    tested = {case.values[0] for case in BROKEN}
    known = {check.name for algorithm in GOOD for check in plugin_checks(algorithm)}
    assert known == tested


def writing_sigma(self, problem, rng):
    problem.table.similarity[0] = 0.5
    return (yield from RandomMaps.search(self, problem, rng))


def writing_weights(self, problem, rng):
    problem.weights = (1.0, 0.0, 0.0)
    return (yield from RandomMaps.search(self, problem, rng))


def sorting_pairs(self, scene, pairs):
    pairs.sort(axis=1)
    return Centres.describe(self, scene, pairs)


def normalising(self, aligned, argument):
    aligned /= np.linalg.norm(aligned, axis=1)[:, None]
    return Cosine.compare(self, aligned, argument)


def cleaning(self, source):
    for polygon in source.polygons:
        np.nan_to_num(polygon.rings[0], copy=False)
    return Boxes.segment(self, source)


@pytest.mark.parametrize(
    ("algorithm", "untouched", "elsewhere", "function", "words"),
    [
        (
            like(RandomMaps, search=writing_sigma),
            "table.similarity of a problem",
            "odd-problems-are-solved",
            "writing_sigma",
            "ValueError: assignment destination is read-only",
        ),
        (
            like(RandomMaps, search=writing_weights),
            "what it is given, which is read-only",
            "fmaps-are-legal",
            "writing_weights",
            "FrozenInstanceError: cannot assign to field 'weights'",
        ),
        (
            like(Centres, describe=sorting_pairs),
            "what it is given, which is read-only",
            "dual-is-turned-by-half",
            "sorting_pairs",
            "ValueError: sort array is read-only",
        ),
        (
            like(Cosine, compare=normalising),
            "aligned of 12 pairs of rows",
            "rows-are-compared-alone",
            "normalising",
            "ValueError: output array is read-only",
        ),
        (
            like(Boxes, segment=cleaning),
            "what it is given, which is read-only",
            "blank-sources-are-refused",
            "cleaning",
            "ValueError: assignment destination is read-only",
        ),
    ],
)
def test_what_writes_to_its_input_is_told_so_by_every_check(
    algorithm, untouched, elsewhere, function, words
):
    said = violations(algorithm)
    assert f"it wrote to {untouched}" in said["inputs-stay-untouched"]
    sentence = said[elsewhere]
    assert f": it wrote to what it is given, which is read-only, and raised {words} at " in sentence
    assert re.search(rf" at test_plugin_checks\.py, line \d+, in {function}; expected: ", sentence)


def unpaired(rows, _, pairs, __):
    return rows if len(pairs) else np.zeros((1, rows.shape[1]))


def found_two(*_):
    return Segmentation(Scene.from_polygons([box([0, 0], [1, 1]), box([2, 0], [3, 1])]))


def unchecked(turned):
    """Return a segmenter of boxes that makes each object without a check."""

    def segment(self, source):
        objects = Boxes.segment(self, source).scene.objects
        return Segmentation(Scene(tuple(SceneObject((turned(o.rings[0]),)) for o in objects)))

    return like(Boxes, segment=segment)


def never(*_):
    yield from ()
    return Outcome.CONVERGED


@pytest.mark.parametrize(
    ("name", "seen", "algorithm"),
    [
        ("closing-ends-the-search", "thread left running", like(RandomMaps, search=with_a_thread)),
        ("search-yields-progress", "without yielding", like(RandomMaps, search=never)),
        ("blank-sources-are-refused", "'sketch.polygons'", like(Boxes, segment=naming_the_stage)),
        ("blank-sources-are-refused", "it found 2 objects", like(Boxes, segment=found_two)),
        ("scenes-are-found", "goes the wrong way round", unchecked(lambda ring: ring[::-1])),
        ("scenes-are-found", "is of int32, not float64", unchecked(lambda r: r.astype(np.int32))),
        ("pairs-are-described-alone", "of no pairs", like(Centres, describe=describe(unpaired))),
        (
            "defaults-are-valid",
            "power has no default",
            like(Cosine, Params=params(power=(int, Field(ge=1, description="A power.")))),
        ),
    ],
)
def test_a_check_sees_other_faults_too(name, seen, algorithm):
    assert seen in violations(algorithm)[name]


@pytest.mark.parametrize(
    ("kind", "field", "bad"),
    [
        (int, {"default": 2, "ge": 1, "le": 9}, "0"),
        (int, {"default": 2, "ge": 1, "le": 9}, "10"),
        (int, {"default": 2, "gt": 1, "le": 9}, "1"),
        (int, {"default": 4, "ge": 4, "le": 8, "multiple_of": 4}, "9"),
        (float, {"default": 2.0, "ge": 1, "lt": 9}, "9"),
        (float, {"default": 2.0, "gt": 1, "le": 9}, "9.000000000000002"),
        (float | None, {"default": None, "ge": 1}, "0.9999999999999999"),
        (float, {"default": 2.0}, "inf"),
        (Literal["auto", "keep"], {"default": "auto"}, "'no such value'"),
        (str, {"default": "auto"}, "None"),
        (bool, {"default": True}, "1.5"),
    ],
)
def test_values_that_must_be_refused_are_made_from_the_bounds(kind, field, bad):
    strict = params(power=(kind, Field(description="A power.", **field)))
    check_plugin(like(Cosine, Params=strict))

    class Careless(strict):
        @model_validator(mode="wrap")
        @classmethod
        def takes_one_bad_value(cls, values, handler):
            if isinstance(values, dict) and repr(values.get("power")) == bad:
                values = {}
            return handler(values)

    said = violations(like(Cosine, Params=Careless))
    assert f"power = {bad} is accepted" in said["bad-parameters-are-refused"]


LAZY = like(Cosine, summary="Cosine")


def test_the_first_violation_is_raised():
    check_plugin(Cosine)
    with pytest.raises(ContractViolationError, match="breaks summary-is-one-sentence: "):
        check_plugin(LAZY)


def test_a_failure_can_be_expected_with_a_reason():
    check_plugin(LAZY, expected_failures={"summary-is-one-sentence": "it is lazy"})


def test_an_expected_failure_that_passes_is_a_violation():
    with pytest.raises(ContractViolationError, match="expected to fail, and passes"):
        check_plugin(Cosine, expected_failures={"summary-is-one-sentence": "it was lazy"})


def test_an_expected_failure_names_a_check_of_a_class_that_is_checked():
    with pytest.raises(ValueError, match="'no-such-check', which is not a check; choose one of: "):
        check_plugin(Cosine, expected_failures={"no-such-check": "?"})
    with pytest.raises(ValueError, match="'no-such-check', which is not a check; choose one of: "):
        parametrize_plugins([Cosine], {Cosine: {"no-such-check": "?"}})
    with pytest.raises(ValueError, match="names Boxes, which is not checked"):
        parametrize_plugins([Cosine], {Boxes: {"y-points-up": "?"}})


def test_a_class_of_no_kind_is_refused():
    with pytest.raises(
        TypeError, match="derives from none of Segmenter, Histogram, Similarity, Searcher and J"
    ):
        check_plugin(dict)


PLUGIN = """
from sketchmatch.api import Similarity

class Half(Similarity):
    '''Finds all histograms half alike, which two that are equal should not be.'''

    name = "half"
    summary = "One half."

    def compare(self, aligned, argument):
        return 0.5 + 0.0 * aligned.sum(axis=1)
"""
TESTS = """
from half import Half
from sketchmatch.testing import parametrize_plugins

class Other(Half):
    '''Finds all histograms half alike, and nobody expects it to.'''

@parametrize_plugins([Half, Other], expected_failures={Half: {
    "equal-rows-have-similarity-1": "a half is enough", "threads-agree": "it does",
}})
def test_it_keeps_the_contract(check):
    check()
"""


@pytest.mark.slow
def test_in_pytest_expected_failures_are_strict(tmp_path):
    (tmp_path / "half.py").write_text(PLUGIN)
    (tmp_path / "test_half.py").write_text(TESTS)
    command = [sys.executable, "-m", "pytest", "-q", "-rA", "-p", "no:cacheprovider", "."]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    summary = ran.stdout.partition("short test summary")[2]
    assert "[Half-equal-rows-have-similarity-1] - a half is enough" in summary
    assert "FAILED test_half.py::test_it_keeps_the_contract[Half-threads-agree]" in summary
    assert "[XPASS(strict)] it does" in ran.stdout
    assert "FAILED test_half.py::test_it_keeps_the_contract[Other-equal-rows-have" in summary
    assert "2 failed, " in summary
    assert ", 1 xfailed" in summary
    assert ran.returncode == 1


@pytest.mark.slow
def test_no_pytest_is_needed_to_check(tmp_path):
    (tmp_path / "half.py").write_text(PLUGIN)
    code = (
        "import sys; sys.modules['pytest'] = None\n"
        "from half import Half; from sketchmatch.testing import check_plugin\n"
        "check_plugin(Half, {'equal-rows-have-similarity-1': 'a half is enough'})"
    )
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True)


def test_the_report_counts_what_no_contract_asks_for():
    report = search_report(like(RandomMaps, Params=params(tries=(int, Field(400)))), problems=3)
    assert report.problems == report.object_consistent == 3
    assert report.optimal >= 2
    worse = search_report(like(RandomMaps, Params=params(tries=(int, Field(1)))), problems=3)
    assert worse.optimal < 3
    assert worse.true < 3


def test_a_problem_has_the_objects_asked_for_and_its_truth():
    rng = np.random.default_rng(2)
    problem, truth = matching_problem(rng, 7, missing=2, extra=1, distortion=0.0)
    assert (problem.table.template_objects, problem.table.argument_objects) == (6, 7)
    assert np.count_nonzero(truth < 0) == 1
    known = truth[truth >= 0]
    assert len(set(known.tolist())) == len(known) == 5
    exact, truth = matching_problem(rng, 5, distortion=0.0)
    fmap = Fmap.from_object_map(truth, 5)
    assert score_fmap(fmap, exact.table).total == pytest.approx(1.0, abs=0.01)
    with pytest.raises(ValueError, match="no more than the map"):
        matching_problem(rng, 5, missing=1, extra=2)
