"""Which cut of regions fits, and which regions are one."""

import math
import re
import time
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
import shapely.affinity

from sketchmatch.api import Segmentation, Segmenter
from sketchmatch.errors import AnswerUnavailableError, InvalidInputError, PluginError, Reason
from sketchmatch.model import LabelledPolygon, PolygonSet, Scene
from sketchmatch.pipeline.clock import Clock
from sketchmatch.pipeline.cuts import _as_one, fitting_cut
from sketchmatch.pipeline.events import Finished, Phase, Progress, Segmented
from sketchmatch.pipeline.knowledge import Pin
from sketchmatch.pipeline.match import run_match
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch.pipeline.result import ObjectMatch
from sketchmatch.pipeline.segment import cuts_of_side, segment_side
from sketchmatch.pipeline.selection import Choice, resolve
from sketchmatch.pipeline.slices import finish
from sketchmatch.registry import Kind, Registered, Registry, default_registry

ROOMS = {
    "hall": (0.0, 0.0, 9.0, 3.0),
    "kitchen": (0.0, 3.2, 4.0, 9.0),
    "bath": (4.2, 3.2, 6.4, 6.0),
    "store": (4.2, 6.2, 6.4, 9.0),
    "study": (6.6, 3.2, 9.0, 9.0),
    "porch": (9.2, 1.0, 14.0, 4.0),
    "garage": (9.2, 4.2, 15.0, 9.0),
}
NAMES = list(ROOMS)
PASSAGES = (
    ("hall", "kitchen"),
    ("hall", "bath"),
    ("bath", "store"),
    ("hall", "study"),
    ("hall", "porch"),
    ("porch", "garage"),
)


def regions(*shapes, passages=()):
    return Segmentation(Scene.from_polygons(shapes), passages=passages)


def floor():
    boxes = [shapely.box(*box) for box in ROOMS.values()]
    doors = tuple((NAMES.index(a), NAMES.index(b)) for a, b in PASSAGES)
    return regions(*boxes, passages=doors)


def _grown(x, y, u, v):
    return shapely.box(x - 0.11, y - 0.11, u + 0.11, v + 0.11)


def drawn(*groups):
    """The same floor, turned by half a radian and three times as large, rooms of a group as one."""
    named = [name for group in groups for name in group]
    parts = [*groups, *((name,) for name in NAMES if name not in named)]
    shapes = []
    for part in parts:
        shape = shapely.union_all([_grown(*ROOMS[name]) for name in part])
        moved = shapely.affinity.scale(
            shape.buffer(-0.11, join_style="mitre"), 3.0, 3.0, origin=(0, 0)
        )
        shapes.append(shapely.affinity.rotate(moved, 0.5, origin=(0, 0), use_radians=True))
    return regions(*shapes), parts


def told(sketch, map_, registry=None, **settings):
    request = MatchRequest(sketch, map_, **settings)
    return [*run_match(request, registry or default_registry())]


def matched(sketch, map_, **settings):
    return told(sketch, map_, **settings)[-1].result


def indices(names):
    return tuple(sorted(map(NAMES.index, names)))


@pytest.mark.parametrize("group", [("bath", "store"), ("porch", "garage"), ("hall", "study")])
def test_rooms_that_a_person_drew_as_one_are_told_as_one(group):
    sketch, parts = drawn(group)
    result = matched(sketch, floor())
    assert [(each.sketch_objects, each.map_objects) for each in result.groups] == [
        ((0,), indices(group))
    ]
    assert result.groups[0].probability > 0.9
    for a, b in result.object_map.items():
        assert NAMES[b] in parts[a]


def test_the_other_way_round_several_of_the_sketch_are_one_of_the_map():
    sketch, _ = drawn(("porch", "garage"))
    result = matched(floor(), sketch)
    assert [(each.sketch_objects, each.map_objects) for each in result.groups] == [
        (indices(("porch", "garage")), (0,))
    ]


def test_a_group_changes_nothing_that_is_said_of_lines():
    sketch, _ = drawn(("porch", "garage"))
    alone = matched(sketch.scene, floor().scene)
    result = matched(sketch, floor())
    assert result.matches == alone.matches
    assert result.probability == alone.probability
    assert result.unmatched_map_objects == alone.unmatched_map_objects
    assert result.unmatched_map_objects[0] in result.groups[0].map_objects
    assert alone.groups == ()


def test_a_printed_result_says_which_are_one():
    sketch, _ = drawn(("porch", "garage"))
    printed = str(matched(sketch, floor()))
    assert re.search(r"\n0 +5 \+ 6 +as one +>?0\.9", printed)
    assert "no partner" not in printed


def test_a_room_that_the_person_left_out_is_no_part_of_another():
    sketch, _ = drawn()
    kept = [item.polygon for item in sketch.scene.objects if item is not sketch.scene.objects[3]]
    result = matched(regions(*kept), floor())
    assert result.unmatched_map_objects == (3,)
    assert result.groups == ()


@pytest.mark.parametrize(
    "settings",
    [{"allow_unmatched": False}, {"pins": (Pin(1, 0),)}],
    ids=["each has a partner", "something is known of single objects"],
)
def test_nothing_is_tried_where_cuts_are_settled(settings):
    sketch, _ = drawn(("porch", "garage"))
    assert matched(sketch, floor(), **settings).groups == ()


def stand_in(shares, asked=None, errors=None, seconds=0.0, clock=None, place=None):
    """A match whose lines are right with the probability of its pair of cuts."""

    def trial(sketch, map_):
        pair = len(sketch.scene), len(map_.scene)
        if asked is not None:
            asked.append(pair)
        yield Segmented(sketch, map_)
        if pair in (errors or {}):
            raise errors[pair]
        if clock is not None:
            clock.now += seconds
        yield Progress(Phase.SEARCH, 0.0, confidence=0.5)
        line = ObjectMatch(0, 0, 0.5, probability=shares[pair])
        yield Finished(SimpleNamespace(matches=(line,), place_probability=place))

    return trial


def boxes(count):
    return regions(*(shapely.box(3 * k, 0, 3 * k + 1 + 0.1 * count, 2) for k in range(count)))


def chosen(fit):
    return len(fit.sketch.scene), len(fit.map.scene)


def test_the_cut_is_taken_of_which_most_is_expected_to_be_right():
    shares = {(3, 3): 0.6, (3, 2): 0.5, (2, 3): 0.5, (2, 2): 0.8}
    sides = ([boxes(3), boxes(2)], [boxes(3), boxes(2)])
    assert chosen(finish(fitting_cut(*sides, stand_in(shares), Clock()))) == (2, 2)
    # Of more regions, the same lines are a smaller share.
    shares = {(3, 3): 0.6, (3, 2): 0.49, (2, 3): 0.49, (2, 2): 0.39}
    assert chosen(finish(fitting_cut(*sides, stand_in(shares), Clock()))) == (3, 3)


def test_of_cuts_that_fit_alike_the_first_is_taken_and_each_is_tried_once():
    asked = []
    shares = {(3, 3): 0.6, (4, 3): 0.7}
    sides = ([boxes(3), boxes(4), boxes(3)], [boxes(3), boxes(3)])
    assert chosen(finish(fitting_cut(*sides, stand_in(shares, asked), Clock()))) == (3, 3)
    assert asked == [(3, 3), (4, 3)]


@pytest.mark.parametrize(("place", "taken"), [(0.09, (3, 3)), (0.1, (2, 3))])
def test_how_well_another_place_fits_speaks_for_no_cut(place, taken):
    shares, sides = {(3, 3): 0.01, (2, 3): 0.05}, ([boxes(3), boxes(2)], [boxes(3)])
    assert chosen(finish(fitting_cut(*sides, stand_in(shares, place=place), Clock()))) == taken


def test_without_probabilities_the_first_cut_is_taken_at_once():
    asked = []
    sides = ([boxes(3), boxes(2)], [boxes(3)])
    trial = stand_in({(3, 3): None, (2, 3): None}, asked)
    assert chosen(finish(fitting_cut(*sides, trial, Clock()))) == (3, 3)
    assert asked == [(3, 3)]


REFUSED = InvalidInputError(Reason.INVALID_FIELD, "alternatives", "is 20; ask for no more")


@pytest.mark.parametrize("error", [REFUSED, AnswerUnavailableError("the time ended")])
def test_a_cut_that_cannot_be_matched_is_no_reason_to_fail_unless_it_is_the_first(error):
    shares, sides = {(3, 3): 0.6, (2, 3): 0.9}, ([boxes(3), boxes(2)], [boxes(3)])
    work = fitting_cut(*sides, stand_in(shares, errors={(2, 3): error}), Clock())
    assert chosen(finish(work)) == (3, 3)
    work = fitting_cut(*sides, stand_in(shares, errors={(3, 3): error}), Clock())
    with pytest.raises(type(error)):
        finish(work)


def test_cuts_are_tried_only_while_there_is_time(monkeypatch):
    time = SimpleNamespace(now=0.0)
    for module in ("clock", "cuts"):
        monkeypatch.setattr(
            f"sketchmatch.pipeline.{module}.time.monotonic", lambda: time.now, raising=True
        )
    shares = {(3, 3): 0.1, (2, 3): 0.2, (4, 3): 0.9}
    sides = ([boxes(3), boxes(2), boxes(4)], [boxes(3)])
    for budget, taken in ((2.5, (3, 3)), (3.5, (2, 3)), (4.5, (4, 3))):
        clock = Clock(budget)
        work = fitting_cut(*sides, stand_in(shares, seconds=1.0, clock=time), clock)
        assert chosen(finish(work)) == taken


def test_while_cuts_are_tried_only_time_goes_by():
    shares = {(3, 3): 0.6, (2, 3): 0.9}
    work = fitting_cut([boxes(3), boxes(2)], [boxes(3)], stand_in(shares), Clock())
    seen = list(work)
    assert {each.phase for each in seen} == {Phase.SEGMENT}
    assert all(each.confidence is None for each in seen)


class Cut(Segmenter):
    """Finds each polygon, and otherwise all but the last, or what a test says."""

    name = "cut"
    summary = "Finds polygons, and fewer of them."
    sources = (PolygonSet,)
    passages = ()

    def segment(self, source):
        rings = [polygon.rings[0] for polygon in source.polygons]
        return Segmentation(Scene.from_polygons(rings), passages=self.passages)

    def cuts(self, source):
        yield self.segment(source)
        rings = [polygon.rings[0] for polygon in source.polygons[:-1]]
        yield Segmentation(Scene.from_polygons(rings))


def with_cuts():
    return Registry([*default_registry().algorithms, Registered(Kind.SEGMENTER, Cut, "acme", "1")])


def source_of(scene):
    return PolygonSet(tuple(LabelledPolygon(item.rings) for item in scene.objects))


CUT = {"sketch_segmenter": Choice("cut")}


def test_scenes_are_told_once_and_are_those_of_the_cut_that_fits():
    invented = shapely.box(60.0, -40.0, 61.0, -20.0)
    sketch, _ = drawn()
    more = Scene.from_polygons([*(item.polygon for item in sketch.scene.objects), invented])
    seen = told(source_of(more), floor().scene, with_cuts(), selection=CUT)
    (scenes,) = (each for each in seen if isinstance(each, Segmented))
    assert len(scenes.sketch.scene) == len(seen[-1].result.sketch) == len(NAMES)
    assert seen[-1].result.object_map == {k: k for k in range(len(NAMES))}


def test_what_is_too_much_is_refused_before_any_cut_is_compared(monkeypatch):
    asked = []

    def check(_, scenes):
        asked.append(scenes and tuple(map(len, scenes)))
        if scenes:
            raise InvalidInputError(Reason.LIMIT_EXCEEDED, "sketch", "is too much")

    monkeypatch.setattr("sketchmatch.pipeline.match.described", lambda *_: pytest.fail("compared"))
    sketch, _ = drawn()
    request = MatchRequest(source_of(sketch.scene), floor().scene, selection=CUT)
    with pytest.raises(InvalidInputError, match="is too much"):
        list(run_match(request, with_cuts(), check=check))
    assert asked == [None, (7, 7)]


def cut_once(segmenter, source):
    yield segmenter.segment(source)
    pytest.fail("it was asked for another cut")


def test_with_little_time_no_other_cut_is_made(monkeypatch):
    monkeypatch.setattr(Cut, "cuts", cut_once)
    monkeypatch.setattr("sketchmatch.pipeline.match._AMPLE", math.inf)
    sketch, _ = drawn()
    request = (source_of(sketch.scene), floor().scene, with_cuts())
    assert told(*request, selection=CUT, time_budget=60.0)[-1].result.object_map


@pytest.mark.parametrize(("budget", "most"), [(None, 12), (3.0, 3)])
def test_a_segmenter_of_cuts_without_end_is_asked_for_a_few_while_there_is_time(
    monkeypatch, budget, most
):
    made = []

    def cuts(segmenter, source):
        while True:
            made.append(time.sleep(0.1 if budget else 0.0))
            yield segmenter.segment(source)

    monkeypatch.setattr(Cut, "cuts", cuts)
    sketch, _ = drawn()
    request = (source_of(sketch.scene), floor().scene, with_cuts())
    assert told(*request, selection=CUT, time_budget=budget)[-1].result.object_map
    assert len(made) <= most if budget else len(made) == most


@pytest.mark.parametrize("given", [source_of, lambda scene: scene, Segmentation])
def test_what_is_found_is_the_first_cut_and_what_is_given_as_a_scene_has_no_other(given):
    scene, registry = floor().scene, with_cuts()
    sketch = given(scene)
    source = sketch if isinstance(sketch, PolygonSet) else None
    pipeline = resolve(registry, CUT if source else {}, source)
    cuts = [len(each.scene) for each in cuts_of_side("sketch", sketch, pipeline, registry)]
    assert cuts == ([7, 6] if source else [7])
    assert len(segment_side("sketch", sketch, pipeline, registry).scene) == 7


def test_a_cut_that_cannot_be_made_ends_them(monkeypatch):
    def cuts(segmenter, source):
        yield segmenter.segment(source)
        raise REFUSED

    monkeypatch.setattr(Cut, "cuts", cuts)
    pipeline = resolve(with_cuts(), CUT, source_of(floor().scene))
    found = cuts_of_side("sketch", source_of(floor().scene), pipeline, with_cuts())
    assert [len(each.scene) for each in found] == [7]


def test_a_segmenter_without_any_cut_is_blamed(monkeypatch):
    monkeypatch.setattr(Cut, "cuts", lambda *_: iter(()))
    with pytest.raises(PluginError, match="it returned a NoneType, not a Segmentation"):
        told(source_of(floor().scene), floor().scene, with_cuts(), selection=CUT)


@pytest.mark.parametrize("passages", [((0, 0),), ((0, 7),), ((-1, 2),), ((0, 1, 2),)])
def test_passages_between_no_two_objects_are_blamed_on_the_segmenter(monkeypatch, passages):
    monkeypatch.setattr(Cut, "passages", passages)
    sketch, _ = drawn()
    with pytest.raises(PluginError, match=r"its passages join .*, not two of its 7 objects"):
        told(source_of(sketch.scene), floor().scene, with_cuts(), selection=CUT)


def test_regions_that_are_one_are_closed_where_they_meet():
    sketch, _ = drawn(("porch", "garage"))
    joined = matched(sketch, floor()).groups[0]
    assert joined.map_objects == indices(("porch", "garage"))
    # The union's area is that of both and of the wall between them, where both have it.
    one = _as_one(floor(), ((0,), (1,), (2,), (3,), (4,), (5, 6))).scene.objects[5]
    assert one.area == pytest.approx(4.8 * 3.0 + 5.8 * 4.8 + 0.2 * 4.8, rel=0.02)
    assert np.allclose(one.polygon.bounds, (9.2, 1.0, 15.0, 9.0), atol=0.01)
