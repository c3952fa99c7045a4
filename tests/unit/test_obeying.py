"""Every searcher obeys what the caller knows, and searchers need to know nothing of it."""

import itertools

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from sketchmatch import Pin, Scene, compare, match
from sketchmatch.api import MatchProblem, Outcome, Searcher, SearchProgress
from sketchmatch.errors import InvalidInputError
from sketchmatch.model import ConfidenceWeights, Fmap, RelationTable, object_pairs
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.events import Finished, Progress
from sketchmatch.pipeline.knowledge import knowledge
from sketchmatch.pipeline.match import run_match
from sketchmatch.pipeline.obeying import first_parts, obedience
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch.pipeline.search import Goal
from sketchmatch.pipeline.selection import Choice
from sketchmatch.pipeline.slices import finish
from sketchmatch.pipeline.unmatched import Part, part_of
from sketchmatch.pipeline.warmup import warm_up, warm_up_others
from sketchmatch.registry import Kind, Registered, Registry, default_registry
from sketchmatch.testing import random_scene, simulate_sketch
from tests.interpreted import examples
from tests.oracle import maps as oracle
from tests.oracle.enumeration import every_confidence
from tests.strategies import random_table, with_evidence, with_rotation_weights

SEARCHERS = {
    "auto": {},
    "exact": {},
    "direct": {"offspring": 200},
    "easm": {"population": 30, "patience": 60},
    "stubborn": {},
}


class Stubborn(Searcher):
    """Tells one map and nothing else, as a search may that has to end."""

    name = "stubborn"
    summary = "Tells the same map each time."
    partners: tuple[int, ...] = ()
    outcome = Outcome.OPTIMAL
    maps: tuple[np.ndarray, ...] = ()
    problems: list[MatchProblem]

    def search(self, problem, rng):
        """Tell one map."""
        table = problem.table
        Stubborn.problems = [*Stubborn.problems, problem]
        partners = self.partners or rng.permutation(table.argument_objects).tolist()
        partners = np.array(partners[: table.template_objects])
        fmap = Fmap.from_object_map(partners, table.argument_objects)
        zeta = oracle.confidence(table, oracle.induced(partners.tolist()), problem.weights)[0]
        yield SearchProgress(fmap, zeta, 1, 1, upper_bound=1.0, maps=self.maps)
        return self.outcome


REGISTRY = Registry(
    [*default_registry().algorithms, Registered(Kind.SEARCHER, Stubborn, "acme", "1.0")]
)


@pytest.fixture(autouse=True)
def _fresh(monkeypatch):
    monkeypatch.setattr(Stubborn, "problems", [], raising=False)


@pytest.fixture(scope="module", autouse=True)
def _warm():
    warm_up(default_registry())
    warm_up_others(default_registry())


def drawn(seed, few, many):
    """Return a sketch of some of a place's objects, the place, and which they are."""
    rng = np.random.default_rng(seed)
    place = random_scene(rng, many)
    sketch = simulate_sketch(place, rng, objects=rng.permutation(many)[:few])
    return sketch.scene, place, sketch.partners.tolist()


def events(sketch, map_, searcher="auto", **settings):
    # By ζ alone, which the oracle knows.
    judge = Choice(settings.pop("judge", "confidence"))
    choices = {"searcher": Choice(searcher, SEARCHERS[searcher]), "judge": judge}
    return list(run_match(MatchRequest(sketch, map_, choices, **settings), REGISTRY))


def answered(*scenes, **settings):
    *_, last = events(*scenes, **settings)
    assert isinstance(last, Finished)
    return last.result


def obeys(object_map, pins):
    """Whether a map from sketch to map keeps to pins of indices."""
    return all((object_map.get(pin.sketch) == pin.map) != pin.excluded for pin in pins)


def obeying_values(sketch, map_, pins):
    """Return ζ of every map of all sketched objects that keeps to pins, by the slow oracle."""
    values = every_confidence(compare(sketch, map_).table)
    return {p: value for p, value in values.items() if obeys(dict(enumerate(p)), pins)}


def random_pins(rng, few, many):
    """Return pins that leave a map, right or wrong."""
    right, other = rng.permutation(few), rng.permutation(many)
    pins = [Pin(int(a), int(c)) for a, c in zip(right, other, strict=False)][: rng.integers(3)]
    taken = {(pin.sketch, pin.map) for pin in pins}
    for _ in range(rng.integers(4)):
        a, c = int(rng.integers(few)), int(rng.integers(many))
        if (a, c) not in taken:
            pins.append(Pin(a, c, excluded=True))
    return pins


@settings(max_examples=8)
@pytest.mark.parametrize("searcher", SEARCHERS)
@given(seed=st.integers(0, 2**32 - 1), more=st.integers(0, 2))
def test_every_answer_obeys_and_has_the_true_confidence(searcher, seed, more):
    sketch, place, _ = drawn(seed, 4, 4 + more)
    pins = random_pins(np.random.default_rng(seed), 4, 4 + more)
    values = obeying_values(sketch, place, pins)
    if not values:
        with pytest.raises(InvalidInputError, match=r"^pins leave no map"):
            events(sketch, place, searcher, pins=pins)
        return
    *seen, last = events(sketch, place, searcher, pins=pins, alternatives=3)
    result, best = last.result, max(values.values())
    partners = tuple(result.object_map[a] for a in range(4))
    assert result.fmap_confidence == pytest.approx(values[partners], abs=1e-9)
    if searcher in ("auto", "exact"):
        assert result.outcome is Outcome.OPTIMAL
        assert result.upper_bound == pytest.approx(best, abs=1e-8)
    if searcher != "stubborn":
        assert result.fmap_confidence == pytest.approx(best, abs=1e-8)
    for other in result.alternatives:
        assert obeys(other.object_map, pins)
        assert other.confidence.total == pytest.approx(
            values[tuple(other.object_map[a] for a in range(4))], abs=1e-9
        )
    for progress in seen:
        if isinstance(progress, Progress) and progress.matches:
            shown = tuple(progress.object_map[a] for a in range(4))
            assert progress.confidence == pytest.approx(values[shown], abs=1e-9)
            assert progress.upper_bound is None or progress.upper_bound >= best - 1e-8


@examples(40)
@given(
    seed=st.integers(0, 2**32 - 1),
    few=st.integers(2, 4),
    more=st.integers(0, 1),
    weights=st.sampled_from([(1, 1, 1), (0, 1, 1), (1, 0, 0), (1e-6, 1e6, 1), (3, 0, 2)]),
    evidence=st.booleans(),
)
@example(seed=0, few=2, more=0, weights=(0, 1, 1), evidence=False)
def test_a_searcher_is_given_maps_in_an_order_in_which_all_that_obey_come_first(
    seed, few, more, weights, evidence
):
    rng = np.random.default_rng(seed)
    table = with_rotation_weights(rng, random_table(rng, few, few + more))
    table = with_evidence(rng, table) if evidence else table
    allowed = rng.random((few, few + more)) < 0.7
    weights = tuple(map(float, weights))
    given_ = finish(obedience(Part.whole(table), weights, allowed))
    told, true = every_confidence(given_.table, given_.searched), every_confidence(table, weights)
    assert given_.table.evidence.min() >= 0.0
    assert given_.table.evidence.max() <= 1.0
    ranked = sorted(told, key=told.get, reverse=True)
    breaking = [not allowed[np.arange(few), p].all() for p in ranked]
    assert breaking == sorted(breaking)
    kept = [p for p, breaks in zip(ranked, breaking, strict=True) if not breaks]
    for p in kept:
        fmap = Fmap.from_object_map(np.array(p), few + more)
        read = given_.read(SearchProgress(fmap, told[p], 1, 1, upper_bound=told[p]), None)
        assert read.obeys
        assert read.best.confidence == pytest.approx(true[p], abs=1e-9)
        assert read.best.upper_bound == pytest.approx(true[p], abs=1e-8)
    for p in ranked[len(kept) :]:
        fmap = Fmap.from_object_map(np.array(p), few + more)
        assert not given_.read(SearchProgress(fmap, told[p], 1, 1), None).obeys


def reading(fmap, similarity=0.0):
    """Return what a progress with an FMAP of three objects in four means, where nothing is out."""
    table = RelationTable(np.full((3, 6), similarity), np.zeros((3, 6)), np.ones((3, 6)), 3, 4)
    allowed = np.ones((3, 4), dtype=bool)
    given_ = finish(obedience(Part.whole(table), (1.0, 1.0, 1.0), allowed))
    return given_.read(SearchProgress(fmap, 0.5, 1, 1), None)


@pytest.mark.parametrize("partners", [*itertools.permutations(range(4), 3)])
def test_a_map_is_known_where_no_evidence_speaks_for_it(partners):
    read = reading(Fmap.from_object_map(np.array(partners), 4))
    assert read.mapped.partners.tolist() == list(partners)
    assert read.best.upper_bound is None


@pytest.mark.parametrize("pairs", [[(0, 1), (2, 3), (0, 2)], [(0, 1), (2, 3), (1, 3)]])
def test_an_fmap_of_no_object_map_is_read_by_its_evidence(pairs):
    columns = object_pairs(4).tolist()
    fmap = Fmap(np.array([columns.index(list(pair)) for pair in pairs]))
    read = reading(fmap, 0.5)
    assert read.partners is None
    assert sorted(read.mapped.partners.tolist()) == sorted(set(read.mapped.partners.tolist()))
    assert read.obeys


def test_a_searcher_sees_what_is_known_and_no_value_that_it_does_not_expect():
    sketch, place, _ = drawn(3, 4, 5)
    answered(sketch, place, searcher="stubborn", pins=[Pin(1, 2), Pin(0, 4, excluded=True)])
    (problem,) = Stubborn.problems
    assert problem.pinned.tolist() == [-1, 2, -1, -1]
    assert problem.allowed[1].tolist() == [False, False, True, False, False]
    assert not problem.allowed[0, 4]
    assert problem.names is None
    answered(sketch, place, searcher="stubborn")
    assert Stubborn.problems[-1].allowed is None
    assert Stubborn.problems[-1].table.evidence is None


def test_a_map_that_breaks_a_pin_in_the_end_is_mended_where_it_must_and_proves_nothing(monkeypatch):
    sketch, place, _ = drawn(3, 4, 6)
    monkeypatch.setattr(Stubborn, "partners", (5, 1, 2, 0))
    *seen, last = events(sketch, place, "stubborn", pins=[Pin(1, 2), Pin(3, 0, excluded=True)])
    found = last.result.object_map
    assert (found[0], found[1]) == (5, 2)
    assert obeys(found, [Pin(1, 2), Pin(3, 0, excluded=True)])
    assert last.result.outcome is Outcome.CONVERGED
    assert last.result.upper_bound == 1.0
    assert not any(isinstance(event, Progress) and event.matches for event in seen)


def test_a_pin_that_is_wrong_is_obeyed_too():
    sketch, place, truth = drawn(5, 6, 8)
    wrong = next(c for c in range(8) if c not in truth)
    assert answered(sketch, place).object_map == dict(enumerate(truth))
    found = answered(sketch, place, pins=[Pin(0, wrong)]).object_map
    assert found[0] == wrong


@pytest.mark.parametrize("searcher", ["auto", "direct", "easm"])
def test_a_pin_decides_between_maps_that_are_equally_good(searcher):
    corners = [(0, 0), (9, 0), (0, 5), (9, 5)]
    room = Scene.from_polygons(
        [[(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)] for x, y in corners]
    )
    for partner, whole in ((0, [0, 1, 2, 3]), (3, [3, 2, 1, 0])):
        found = answered(room, room, searcher=searcher, pins=[Pin(0, partner)])
        assert found.object_map == dict(enumerate(whole))
        assert found.matches[0].margin is None


def test_what_is_on_no_map_is_left_out_and_what_is_known_never_is():
    sketch, place, truth = drawn(1, 6, 7)
    pins = [Pin(0, None), Pin(1, truth[2])]
    for searcher in ("auto", "direct"):
        found = answered(sketch, place, searcher=searcher, pins=pins, allow_unmatched=True)
        assert 0 not in found.object_map
        assert found.object_map[1] == truth[2]
        assert all(0 not in other.object_map for other in found.alternatives)
        assert all(other.object_map[1] == truth[2] for other in found.alternatives)
    cheap = {"pins": pins, "allow_unmatched": True, "unmatched_price": 1e-3}
    assert answered(sketch, place, **cheap).object_map[1] == truth[2]


def test_a_sketch_that_is_larger_leaves_out_what_is_on_no_map():
    place, sketch, truth = drawn(2, 5, 7)  # the map shows five of the sketched seven
    extra = next(c for c in range(7) if c not in truth)
    pins = [Pin(extra, None), Pin(truth[0], 0)]
    found = answered(sketch, place, pins=pins).object_map
    assert found == {a: c for c, a in enumerate(truth)}
    wrong = answered(sketch, place, pins=[Pin(truth[1], None), Pin(truth[0], 0)]).object_map
    assert truth[1] not in wrong
    assert len(wrong) == 5
    assert wrong[truth[0]] == 0


def test_the_best_part_is_found_where_not_all_can_find_a_partner():
    place, sketch, truth = drawn(4, 5, 6)  # the map shows five of the sketched six
    extra = next(c for c in range(6) if c not in truth)
    pins = [Pin(extra, None), Pin(truth[2], None)]
    found = answered(sketch, place, pins=pins, allow_unmatched=True, unmatched_price=5)
    whole, values = Part.whole(compare(sketch, place).table), []
    for kept in itertools.combinations(range(5), 4):
        part = finish(part_of(whole, kept)).table
        every = every_confidence(part)
        values += [value for p, value in every.items() if not {extra, truth[2]} & set(p)]
    assert len(found.object_map) == 4
    assert found.fmap_confidence == pytest.approx(max(values), abs=1e-8)


def test_what_is_known_is_certain():
    sketch, place, truth = drawn(1, 6, 7)
    pins = [Pin(0, None), Pin(1, truth[2])]
    found = answered(sketch, place, pins=pins, allow_unmatched=True)
    likely = {line.sketch_object: line.probability for line in found.matches}
    assert likely.pop(1) == 1.0
    assert max(likely.values()) < 1.0
    assert found.probability < 1.0
    comparison, engine = compare(sketch, place), Engine(REGISTRY)
    known = knowledge(pins, (), (sketch, place), swapped=False, partial=True)
    goal = Goal(ConfidenceWeights(), 0.4, allowed=known.allowed, pinned=known.pinned)
    pipeline = engine.resolve({"searcher": Choice("auto")})
    search = finish(engine.search(comparison, pipeline.searcher, goal))
    lines = finish(engine.judge(comparison, search, goal, pipeline.judge)).judgement.lines
    assert lines[0].tolist() == [*[0.0] * 7, 1.0]
    assert lines[1].tolist() == [float(c == truth[2]) for c in range(8)]


def test_maps_that_a_searcher_tells_of_a_part_are_maps_of_all(monkeypatch):
    sketch, place, truth = drawn(8, 5, 6)
    right = np.array(truth[1:])
    monkeypatch.setattr(Stubborn, "partial", True)
    monkeypatch.setattr(Stubborn, "partners", tuple(np.roll(right, 1).tolist()))
    monkeypatch.setattr(Stubborn, "maps", (right,))
    found = answered(sketch, place, searcher="stubborn", pins=[Pin(0, None)])
    assert Stubborn.problems[0].partial
    assert Stubborn.problems[0].table.template_objects == 4
    assert found.object_map == {a: truth[a] for a in range(1, 5)}


def test_parts_to_begin_with_are_all_that_can_find_partners_in_several_ways():
    allowed = np.ones((4, 5), dtype=bool)
    assert first_parts(allowed, ()) == [(0, 1, 2, 3)]
    allowed[0] = False
    assert first_parts(allowed, ()) == [(1, 2, 3)]
    allowed[:3, 1:] = False  # 1 and 2 may be the first alone
    assert sorted(first_parts(allowed, ())) == [(1, 3), (2, 3)]
    assert first_parts(allowed, {2}) in ([(2, 3)], [(1, 3), (2, 3)])
    many = np.zeros((12, 12), dtype=bool)
    many[:, :6] = True
    parts = first_parts(many, {11})
    assert len(parts) == len(set(parts)) == 10
    assert {len(kept) for kept in parts} == {6}


def test_names_are_told_with_and_without_pins():
    sketch = Scene.from_polygons([item.rings for item in drawn(6, 3, 3)[0].objects], ["a", "b", ""])
    place = Scene.from_polygons(
        [item.rings for item in random_scene(np.random.default_rng(0), 4).objects], list("BxyA")
    )
    answered(sketch, place, searcher="stubborn", synonyms=[("b", "x")])
    names = [[-1, -1, -1, 1], [1, 1, -1, -1], [0, 0, 0, 0]]
    assert Stubborn.problems[-1].names.tolist() == names


def test_pins_come_as_a_dict_or_one_by_one():
    sketch, place, truth = drawn(7, 4, 6)
    wrong = next(c for c in range(6) if c not in truth)
    assert match(sketch, place, pins={0: wrong}).object_map[0] == wrong
    without = match(sketch, place, pins=[Pin(0, truth[0], excluded=True)]).object_map
    assert match(sketch, place).object_map[0] == truth[0] != without.get(0)
    with pytest.raises(InvalidInputError, match=r"^pins is 5; give pins"):
        match(sketch, place, pins=5)
    for p in itertools.permutations(range(4)):
        assert match(sketch, place, pins=dict(enumerate(p))).object_map == dict(enumerate(p))
