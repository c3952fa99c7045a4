"""A whole match: its events, what comes out both ways round, its limits and its refusals."""

import itertools
import math
import time

import numpy as np
import pytest

from sketchmatch import Scene, directional_relation, force_histogram
from sketchmatch.api import Outcome, Searcher, SearchProgress, Segmentation, Segmenter
from sketchmatch.errors import AnswerUnavailableError, InvalidInputError, PluginError, Reason
from sketchmatch.model import Fmap, LabelledPolygon, OccupancyGrid, PolygonSet, SceneObject
from sketchmatch.pipeline import clock as clock_module
from sketchmatch.pipeline import match as match_module
from sketchmatch.pipeline.clock import Clock
from sketchmatch.pipeline.events import Accepted, Finished, Phase, Progress, Segmented
from sketchmatch.pipeline.match import run_match
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch.pipeline.selection import Choice
from sketchmatch.pipeline.warmup import warm_up, warm_up_others
from sketchmatch.registry import Kind, Registered, Registry, default_registry
from sketchmatch.testing import random_scene, simulate_sketch
from sketchmatch_builtin.searchers.easm import Easm
from tests.oracle import maps as oracle
from tests.pace import within

THESIS = {"searcher": Choice("auto"), "judge": Choice("confidence")}
"""What proves, and judges by ζ alone."""

ENDLESS = {"searcher": Choice("easm", {"patience": 10_000_000, "generations": 10_000_000})}


@pytest.fixture(scope="module", autouse=True)
def _warm():
    # On a new machine the kernels compile here, and not while a test measures time.
    warm_up(default_registry())
    warm_up_others(default_registry())


def polygons(scene, turn=0.0, factor=1.0, order=None):
    """Return a scene's polygons turned, scaled and in another order."""
    c, s = math.cos(turn), math.sin(turn)
    matrix = factor * np.array([[c, s], [-s, c]])
    chosen = range(len(scene)) if order is None else order
    return [[ring @ matrix for ring in scene.objects[k].rings] for k in chosen]


def changed(scene, turn=0.0, factor=1.0, order=None):
    return Scene.from_polygons(polygons(scene, turn, factor, order))


def source(scene):
    return PolygonSet(tuple(LabelledPolygon(item.rings) for item in scene.objects))


def events(sketch, map_, registry=None, **settings):
    return run_match(MatchRequest(sketch, map_, **settings), registry or default_registry())


def matched(sketch, map_, registry=None, **settings):
    *_, last = events(sketch, map_, registry, **settings)
    assert isinstance(last, Finished)
    return last.result


def seven():
    return random_scene(np.random.default_rng(42), 7)


def test_events_come_in_order():
    scene = seven()
    kinds = [type(event) for event in events(source(changed(scene, 1.0)), source(scene))]
    assert kinds[0] is Accepted
    assert kinds[-1] is Finished
    assert kinds.count(Accepted) == kinds.count(Segmented) == kinds.count(Finished) == 1
    assert set(kinds) == {Accepted, Progress, Segmented, Finished}


def test_phases_come_in_order_and_the_search_shows_its_best_map():
    scene = seven()
    seen = list(events(changed(scene, 1.0), scene, selection=ENDLESS, time_budget=0.5))
    progress = [event for event in seen if isinstance(event, Progress)]
    phases = [event.phase for event in progress]
    assert phases == sorted(phases, key=list(Phase).index)
    assert (phases[0], phases[-1]) == (Phase.SEGMENT, Phase.SEARCH)
    assert [event.elapsed for event in progress] == sorted(event.elapsed for event in progress)
    searching = [event for event in progress if event.phase is Phase.SEARCH]
    assert [event.confidence for event in searching] == sorted(
        event.confidence for event in searching
    )
    for event in searching:
        assert sorted(event.object_map) == list(range(7))
        assert len(set(event.object_map.values())) == 7
        assert event.iteration > 0
    assert all(event.object_map == {} for event in progress if event.phase is not Phase.SEARCH)


def test_progress_comes_at_most_twenty_times_a_second():
    result, count = None, 0
    for event in events(seven(), seven(), selection=ENDLESS, time_budget=0.6):
        count += isinstance(event, Progress)
        result = event.result if isinstance(event, Finished) else None
    assert count <= result.statistics.seconds["total"] / 0.05 + 2


def test_what_was_accepted_is_what_runs():
    first = next(events(seven(), seven(), seed=9))
    assert isinstance(first, Accepted)
    assert first.seed == 9
    assert (first.pipeline.searcher.name, first.pipeline.judge.name) == ("align", "posterior")
    result = matched(seven(), seven(), seed=9)
    assert result.seed == 9
    assert result.match_id != first.match_id


@pytest.mark.parametrize("turn", [0.0, 0.7, math.pi, -2.0])
def test_a_scene_and_its_turned_copy_are_one(turn):
    scene = seven()
    result = matched(changed(scene, turn, 3.0), scene, selection=THESIS)
    assert matched(changed(scene, turn, 3.0), scene).object_map == result.object_map
    assert result.object_map == {k: k for k in range(7)}
    assert result.fmap_confidence > 0.99
    assert result.omap_confidence > 0.99
    assert result.outcome is Outcome.OPTIMAL
    assert result.fmap_confidence <= result.upper_bound <= result.fmap_confidence + 1e-12


# Which objects of the map are drawn, and which of the drawn are on the map.
CASES = {
    "as many": (list(range(7)), list(range(7))),
    "the map has more": ([5, 0, 3, 6], list(range(7))),
    "the sketch has more": (list(range(7)), [6, 1, 2, 4, 5]),
}


@pytest.mark.slow
@pytest.mark.parametrize(("drawn", "mapped"), CASES.values(), ids=CASES)
@pytest.mark.parametrize("degrees", [0, 90, 136, 180, -30])
@pytest.mark.parametrize("scale", [0.2, 1.0, 12.0])
def test_turn_and_scale_read_from_sketch_to_map(drawn, mapped, degrees, scale):
    world = seven()
    # A multiple of the 2° between directions, so that nothing is lost between bins.
    sketch = changed(world, -math.radians(degrees), 1 / scale, drawn)
    directions = {"histogram": Choice("constant", {"directions": 180})}
    result = matched(sketch, changed(world, order=mapped), selection=directions)
    common = {drawn.index(k): mapped.index(k) for k in drawn if k in mapped}
    assert result.object_map == common
    assert result.fmap_confidence == pytest.approx(1.0, abs=1e-6)
    apart = math.remainder(result.rotation - math.radians(degrees), math.tau)
    assert apart == pytest.approx(0.0, abs=1e-6)
    assert -math.pi < result.rotation <= math.pi
    assert result.scale == pytest.approx(scale, rel=1e-6)
    assert result.unmatched_sketch_objects == tuple(
        k for k, name in enumerate(drawn) if name not in mapped
    )
    assert result.unmatched_map_objects == tuple(
        k for k, name in enumerate(mapped) if name not in drawn
    )
    assert (len(result.sketch), len(result.map)) == (len(drawn), len(mapped))
    for entry in result.fmap:
        assert tuple(common[k] for k in entry.sketch_pair) == entry.map_pair
        assert entry.similarity == pytest.approx(1.0, abs=1e-6)
        assert entry.dilation == pytest.approx(scale, rel=1e-6)
        off = math.remainder(entry.rotation - math.radians(degrees), math.tau)
        assert off == pytest.approx(0.0, abs=1e-6)


def in_words(scene):
    """Return how each object of a scene lies to the nearest other, by hand."""
    shapes, found = [item.polygon for item in scene.objects], {}
    for a, shape in enumerate(shapes):
        b = min((k for k in range(len(shapes)) if k != a), key=lambda k: shape.distance(shapes[k]))
        relation = directional_relation(force_histogram(scene.objects[a], scene.objects[b]))
        found[a] = (b, relation.phrase, pytest.approx(relation.degree, abs=1e-9))
    return found


def told(result):
    lines = {match.sketch_object: match.relation for match in result.matches}
    return {k: (r.reference_object, r.phrase, r.degree) for k, r in lines.items()}


@pytest.mark.parametrize(("drawn", "mapped"), CASES.values(), ids=CASES)
def test_each_match_tells_how_the_object_lies_in_the_sketch(drawn, mapped):
    world = seven()
    sketch = changed(world, math.radians(-136), 0.2, drawn)
    directions = {"histogram": Choice("constant", {"directions": 180})}
    result = matched(sketch, changed(world, order=mapped), selection=directions)
    kept = list(result.object_map)
    names = dict(enumerate(kept))
    expected = in_words(Scene(tuple(sketch.objects[k] for k in kept)))
    assert told(result) == {names[a]: (names[b], *rest) for a, (b, *rest) in expected.items()}
    turned = in_words(Scene(tuple(world.objects[drawn[k]] for k in kept)))
    assert [line[1] for line in turned.values()] != [line[1] for line in expected.values()]


@pytest.mark.parametrize("swapped", [False, True])
def test_two_matched_objects_are_told_from_each_other(swapped):
    pair = [SQUARE, SQUARE + np.array([4.0, 0.2])]
    scenes = [Scene.from_polygons(pair), Scene.from_polygons([*pair, 3 * SQUARE + [1, 40]])]
    result = matched(*scenes[:: -1 if swapped else 1])
    lines = {match.sketch_object: match.relation for match in result.matches}
    assert len(lines) == 2
    for (a, here), (b, there) in itertools.permutations(lines.items()):
        assert (here.reference_object, there.reference_object) == (b, a)
        assert here.degree == pytest.approx(there.degree, abs=1e-12)


def test_only_the_result_tells_relations():
    scene = seven()
    *before, last = events(scene, scene, selection=ENDLESS, time_budget=0.3)
    lines = [line for event in before if isinstance(event, Progress) for line in event.matches]
    assert lines
    others = [line for other in last.result.alternatives for line in other.matches]
    assert others
    assert all(line.relation is None for line in lines + others)


def test_exchanging_sketch_and_map_turns_the_answer_around():
    scene = seven()
    drawn = simulate_sketch(scene, np.random.default_rng(3), objects=[0, 2, 3, 5, 6]).scene
    there, back = matched(drawn, scene), matched(scene, drawn)
    assert {b: a for a, b in back.object_map.items()} == there.object_map
    assert back.fmap_confidence == there.fmap_confidence
    assert back.omap_confidence == there.omap_confidence
    assert math.remainder(back.rotation + there.rotation, math.tau) == pytest.approx(0.0, abs=1e-9)
    assert back.scale == pytest.approx(1 / there.scale, rel=1e-12)
    confidences = {match.map_object: match.confidence for match in back.matches}
    for match in there.matches:
        assert confidences[match.sketch_object] == match.confidence
    assert [m.sketch_object for m in back.matches] == sorted(m.sketch_object for m in back.matches)


def test_a_result_is_consistent_in_itself():
    scene = seven()
    result = matched(simulate_sketch(scene, np.random.default_rng(1)).scene, scene)
    parts = result.confidence
    assert parts.total == pytest.approx(
        (parts.similarity + parts.rotation + parts.dilation) / 3, rel=1e-12
    )
    assert parts.similarity == pytest.approx(
        np.mean([entry.similarity for entry in result.fmap]), rel=1e-12
    )
    turns = [complex(math.cos(e.rotation), math.sin(e.rotation)) for e in result.fmap]
    assert parts.rotation == pytest.approx(abs(sum(turns)) / len(turns), rel=1e-9)
    assert result.omap_confidence == pytest.approx(np.mean([m.confidence for m in result.matches]))
    assert set(result.statistics.seconds) == {"segment", "describe", "relate", "search", "total"}
    assert result.statistics.iterations > 0
    assert result.statistics.evaluations > 0


def fingerprint(result):
    return (
        result.object_map,
        result.confidence,
        result.omap_confidence,
        result.fmap,
        result.rotation,
        result.scale,
        result.outcome,
        result.statistics.iterations,
        result.statistics.evaluations,
    )


def test_the_same_seed_gives_the_same_result_and_another_another_run():
    scene = seven()
    sketch = simulate_sketch(scene, np.random.default_rng(2)).scene
    evolved = {"searcher": Choice("easm")}
    one, same, other = (matched(sketch, scene, seed=seed, selection=evolved) for seed in (5, 5, 6))
    assert fingerprint(one) == fingerprint(same)
    assert one.statistics.evaluations != other.statistics.evaluations


def test_sources_and_the_scenes_in_them_match_alike():
    scene = seven()
    sketch = simulate_sketch(scene, np.random.default_rng(4)).scene
    direct, segmented = matched(sketch, scene), matched(source(sketch), source(scene))
    assert fingerprint(direct) == fingerprint(segmented)


@pytest.mark.parametrize(("weights", "part"), [((1, 0, 0), 0), ((0, 2, 0), 1), ((0, 0, 0.5), 2)])
def test_weights_decide_what_is_sought_and_told(weights, part):
    scene = seven()
    sketch = simulate_sketch(scene, np.random.default_rng(1)).scene
    result = matched(sketch, scene, selection=THESIS, weights=weights)
    parts = (result.confidence.similarity, result.confidence.rotation, result.confidence.dilation)
    assert result.fmap_confidence == pytest.approx(parts[part], rel=1e-12)
    even = matched(sketch, scene, selection=THESIS).confidence
    assert parts[part] >= (even.similarity, even.rotation, even.dilation)[part] - 1e-9


def test_a_time_budget_ends_the_search_with_its_best():
    scene = seven()
    with within(3.0) as watch:
        result = matched(changed(scene, 1.0), scene, selection=ENDLESS, time_budget=0.4)
    assert result.outcome is Outcome.TIME_BUDGET
    assert 0.4 <= result.statistics.seconds["total"] <= watch.seconds
    assert result.object_map == {k: k for k in range(7)}


@pytest.mark.parametrize("budget", [None, 500.0])
def test_a_searcher_is_told_how_much_time_is_left(budget, monkeypatch):
    told, search = [], Easm.search

    def recorded(self, problem, rng):
        told.append(problem.time_budget)
        return search(self, problem, rng)

    monkeypatch.setattr(Easm, "search", recorded)
    matched(seven(), seven(), selection={"searcher": Choice("easm")}, time_budget=budget)
    (left,) = told
    assert left is None if budget is None else 0.0 < left < budget


def test_a_time_budget_too_short_for_any_answer_says_where_it_went():
    with pytest.raises(AnswerUnavailableError, match=r"1e-09 s ended in phase .*allow more"):
        list(events(source(seven()), source(seven()), time_budget=1e-9))


def compiling(warm_up):
    """Return the algorithms with an endless search of its own warm-up, and the choice of it."""

    class Compiling(Easm):
        name = "compiling"

    Compiling.warm_up = classmethod(lambda _: warm_up())
    added = Registered(Kind.SEARCHER, Compiling, "acme-search", "1.0")
    choice = Choice("compiling", ENDLESS["searcher"].parameters)
    return Registry([*default_registry().algorithms, added]), {"searcher": choice}


def test_what_is_compiled_comes_first_and_does_not_count_for_the_time_budget():
    registry, chosen = compiling(lambda: time.sleep(1.0))
    settings = {"selection": chosen, "time_budget": 0.3}
    first, again = (list(events(seven(), seven(), registry, **settings)) for _ in range(2))
    assert [type(event) for event in first[:2]] == [Accepted, Progress]
    assert [event.phase for event in (first[1], again[1])] == [Phase.COMPILE, Phase.SEGMENT]
    for seen in (first, again):
        assert seen[-1].result.outcome is Outcome.TIME_BUDGET
    assert first[-1].result.statistics.seconds["total"] < first[-2].elapsed


def test_the_time_that_a_clock_is_stopped_does_not_count(monkeypatch):
    now = itertools.count()
    monkeypatch.setattr(clock_module.time, "monotonic", lambda: float(next(now)))
    clock = Clock(10.0)  # made at 0
    with clock.stopped():  # from 1
        assert clock.elapsed() == 2.0
        assert clock.elapsed() == 3.0  # to 4
    assert clock.spent() == 5.0 - 3.0
    assert clock.left() == 10.0 - (6.0 - 3.0)
    assert clock.elapsed() == 7.0


def test_an_algorithm_that_cannot_warm_up_is_tried_all_the_same():
    def explode():
        raise MemoryError("no room")

    registry, chosen = compiling(explode)
    result = matched(seven(), seven(), registry, selection=chosen, time_budget=0.3)
    assert result.outcome is Outcome.TIME_BUDGET


def test_generations_end_a_search_with_their_own_outcome():
    result = matched(seven(), seven(), selection={"searcher": Choice("easm", {"generations": 3})})
    assert (result.outcome, result.statistics.iterations) == (Outcome.ITERATION_LIMIT, 3)


def test_closing_the_events_stops_the_search():
    work = events(seven(), seven(), selection=ENDLESS)
    for event in work:
        if isinstance(event, Progress) and event.phase is Phase.SEARCH:
            break
    with within(0.5):
        work.close()
    with pytest.raises(StopIteration):
        next(work)


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        ({"seed": -1}, "seed"),
        ({"seed": 2**64}, "seed"),
        ({"time_budget": 0.0}, "time_budget"),
        ({"time_budget": -3.0}, "time_budget"),
        ({"time_budget": math.nan}, "time_budget"),
        ({"time_budget": math.inf}, "time_budget"),
        ({"weights": (-1.0, 1.0, 1.0)}, "weights.similarity"),
        ({"weights": (1.0, math.nan, 1.0)}, "weights.rotation"),
        ({"weights": (1.0, 1.0, math.inf)}, "weights.dilation"),
        ({"weights": (0.0, 0.0, 0.0)}, "weights"),
    ],
)
def test_a_request_that_cannot_be_is_refused_by_its_field(settings, field):
    with pytest.raises(InvalidInputError, match="give") as caught:
        MatchRequest(seven(), seven(), **settings)
    assert (caught.value.reason, caught.value.field) == (Reason.INVALID_FIELD, field)


def test_the_largest_seed_is_allowed():
    assert matched(seven(), seven(), seed=2**64 - 1).fmap_confidence > 0.99


def test_a_wrong_choice_is_refused_before_any_work():
    with pytest.raises(InvalidInputError) as caught:
        events(seven(), seven(), selection={"searcher": Choice("easm", {"population": 1})})
    assert caught.value.field == "pipeline.searcher.parameters.population"


SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
NAN = np.array([[0.0, 0.0], [np.nan, 0.0], [1.0, 1.0]])


@pytest.mark.parametrize(
    ("sketch", "map_", "reason", "field"),
    [
        ([SQUARE], [SQUARE, SQUARE + 3], Reason.TOO_FEW_OBJECTS, "sketch.polygon_set"),
        ([SQUARE, SQUARE + 3], [], Reason.TOO_FEW_OBJECTS, "map.polygon_set"),
        (
            [SQUARE, SQUARE + 3],
            [SQUARE, NAN],
            Reason.INVALID_POLYGON,
            "map.polygon_set.polygons[1].rings[0].points[1]",
        ),
    ],
)
def test_a_fault_in_a_source_is_told_with_its_side_and_place(sketch, map_, reason, field):
    given = [PolygonSet(tuple(LabelledPolygon((r,)) for r in each)) for each in (sketch, map_)]
    with pytest.raises(InvalidInputError) as caught:
        list(events(*given))
    assert caught.value.reason is reason
    assert caught.value.field.startswith(field)


def test_a_map_without_objects_is_told_with_its_side():
    empty = OccupancyGrid(np.zeros((20, 20)), 0.1)
    with pytest.raises(InvalidInputError) as caught:
        list(events(seven(), empty))
    assert caught.value.reason is Reason.TOO_FEW_OBJECTS
    assert caught.value.field.startswith("map.occupancy_grid")


def test_objects_that_lie_on_each_other_still_match():
    scene = Scene.from_polygons([SQUARE, SQUARE + 0.5, 2 * SQUARE, SQUARE])
    found = matched(scene, scene)
    assert found.fmap_confidence > 0.9
    # The first and the last are one square, and rounding does not say which is which.
    assert found.probability == found.alternatives[0].probability


def test_very_small_objects_very_far_apart_still_match():
    dots = [0.01 * SQUARE + place for place in ([0, 0], [1000, 37], [-300, 800], [500, -900])]
    scene = Scene.from_polygons(dots)
    result = matched(changed(scene, math.radians(40.0), 5.0), scene)
    assert result.object_map == {k: k for k in range(4)}
    assert math.degrees(result.rotation) == pytest.approx(-40.0, abs=0.01)
    assert result.scale == pytest.approx(0.2, rel=1e-6)


class Slow(Segmenter):
    """A segmenter that takes a moment, and counts how often it is asked."""

    name = "slow"
    summary = "Takes a moment."
    sources = (PolygonSet,)
    asked = 0

    def segment(self, source):
        Slow.asked += 1
        time.sleep(0.05)
        return Segmentation(Scene(tuple(SceneObject.from_rings(p.rings) for p in source.polygons)))


def test_a_time_budget_that_ends_with_the_sketch_leaves_the_map_alone():
    offered = Registered(Kind.SEGMENTER, Slow, "acme-slow", "1.0")
    registry = Registry([*default_registry().algorithms, offered])
    choices = dict.fromkeys(("sketch_segmenter", "map_segmenter"), Choice("slow"))
    Slow.asked = 0
    with pytest.raises(AnswerUnavailableError, match="ended in phase segment"):
        list(
            events(source(seven()), source(seven()), registry, selection=choices, time_budget=0.02)
        )
    assert Slow.asked == 1


def describing_without_end(monkeypatch):
    """Let descriptions go on until they are let go; return of which sides they were."""
    ended = []

    def describing(*given):
        try:
            while True:
                time.sleep(0.01)
                yield 0.5
        finally:
            ended.append(next(each for each in given if isinstance(each, str)))

    monkeypatch.setattr(match_module, "described", describing)
    return ended


def test_what_is_in_progress_is_let_go_when_the_time_ends(monkeypatch):
    ended = describing_without_end(monkeypatch)
    running = events(seven(), seven(), time_budget=1.0)
    with pytest.raises(AnswerUnavailableError, match="phase describe") as caught:
        list(running)
    # The error's traceback still holds the frames: what is let go is let go at once.
    assert caught.value is not None
    assert ended == ["sketch"]


def test_nothing_is_left_running_where_the_events_are_closed(monkeypatch):
    ended = describing_without_end(monkeypatch)
    running = events(seven(), seven())
    while not (isinstance(event := next(running), Progress) and event.phase is Phase.DESCRIBE):
        pass
    running.close()
    assert ended == ["sketch"]


class Odd(Searcher):
    """A searcher that does what it is told to."""

    name = "odd"
    summary = "Does what it is told to."
    behaviour = "nothing"

    def search(self, problem, rng):  # noqa: ARG002
        if self.behaviour == "raise":
            raise ZeroDivisionError("lost")
        if self.behaviour == "outside":
            yield SearchProgress(Fmap(np.array([99] * problem.table.template_pairs)), 0.5, 1, 1)
        if self.behaviour == "short":
            yield SearchProgress(Fmap(np.array([0])), 0.5, 1, 1)
        if self.behaviour in ("twice", "dual"):
            entries = np.arange(21)
            entries[1] = 21 if self.behaviour == "dual" else 0
            yield SearchProgress(Fmap(entries), 0.5, 1, 1)
        if self.behaviour == "another":
            # A ζ that was checked for one FMAP says nothing of the next.
            for partners in (np.arange(7), np.arange(7)[::-1]):
                yield SearchProgress(Fmap.from_object_map(partners, 7), 1.0, 1, 1)
        if self.behaviour == "bound":
            fmap = Fmap.from_object_map(np.arange(7), 7)
            yield SearchProgress(fmap, 1.0, 1, 1, upper_bound=1.0)
            return Outcome.OPTIMAL
        return None


def with_odd(monkeypatch, behaviour):
    monkeypatch.setattr(Odd, "behaviour", behaviour)
    offered = Registered(Kind.SEARCHER, Odd, "acme-odd", "1.0")
    return Registry([*default_registry().algorithms, offered])


@pytest.mark.parametrize(
    ("behaviour", "words"),
    [
        ("nothing", "ended without any answer"),
        ("raise", "ZeroDivisionError: lost"),
        ("outside", "an entry outside 0 … 41"),
        ("short", r"shape \(1,\), not \(21,\)"),
        ("twice", "takes a pair of objects twice, or a pair and its dual"),
        ("dual", "takes a pair of objects twice, or a pair and its dual"),
        ("another", "says that its FMAP has ζ 1, but that has 0."),
    ],
)
def test_a_searcher_that_breaks_its_contract_is_named(monkeypatch, behaviour, words):
    registry = with_odd(monkeypatch, behaviour)
    with pytest.raises(PluginError, match=f"searcher odd of acme-odd 1.0 failed .*{words}"):
        matched(seven(), seven(), registry, selection={"searcher": Choice("odd")})


def test_a_searchers_bound_and_outcome_reach_the_result(monkeypatch):
    registry = with_odd(monkeypatch, "bound")
    result = matched(seven(), seven(), registry, selection={"searcher": Choice("odd")})
    assert (result.outcome, result.upper_bound) == (Outcome.OPTIMAL, 1.0)
    assert result.object_map == {k: k for k in range(7)}


def test_the_reported_confidence_is_that_of_the_definition():
    scene = seven()
    sketch = simulate_sketch(scene, np.random.default_rng(8)).scene
    result = matched(sketch, scene)
    mapped = [entry.map_pair for entry in result.fmap]
    assert oracle.is_object_legal(mapped, 7)
    levels = [1.5 / math.log(2) * math.log(entry.dilation) for entry in result.fmap]
    gaps = [abs(x - y) for k, x in enumerate(levels) for y in levels[:k]]
    assert result.confidence.dilation == pytest.approx(2 ** -np.mean(gaps), rel=1e-9)
