"""What a judge is given, and that the answer is what it says."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch import InvalidInputError, Scene
from sketchmatch.api import (
    Judge,
    JudgedMap,
    Judgement,
    Outcome,
    Searcher,
    SearchProgress,
)
from sketchmatch.errors import AnswerUnavailableError, PluginError
from sketchmatch.kernels.evidence import SelfRelations
from sketchmatch.model import ConfidenceWeights, Fmap
from sketchmatch.pipeline.clock import Clock
from sketchmatch.pipeline.correspond import fmap_confidence, induced_map, map_confidence
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.events import Finished
from sketchmatch.pipeline.guard import check_map
from sketchmatch.pipeline.judge import considered, problem_of
from sketchmatch.pipeline.match import run_match
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch.pipeline.search import Goal
from sketchmatch.pipeline.selection import Choice, Defaults, Profile
from sketchmatch.pipeline.slices import finish
from sketchmatch.pipeline.unmatched import Part, part_of
from sketchmatch.registry import Kind, Registered, Registry, default_registry
from sketchmatch.testing import judging_problem, matching_problem, random_scene, simulate_sketch
from sketchmatch_builtin.judges.confidence import HighestConfidence
from tests.interpreted import examples
from tests.oracle import maps
from tests.strategies import random_table, with_evidence, with_rotation_weights

WEIGHTS = (1.0, 1.0, 1.0)


class Told(Judge):
    """Says what it is told to, and keeps what it is given."""

    name = "told"
    summary = "Says what it is told."

    def __init__(self, params=None):
        super().__init__(params)
        Told.problems = []

    def judge(self, problem):
        Told.problems.append(problem)
        says = Told.says(problem)
        return says if isinstance(says, Judgement) else Judgement(tuple(map(JudgedMap, says)))


class ToldPartial(Told):
    name = "told-partial"
    partial = True


class Partial(Searcher):
    """Yields the map of each object to itself, and others beside."""

    name = "partial"
    summary = "Maps of some objects."
    partial = True

    def search(self, problem, rng):  # noqa: ARG002
        Partial.problems.append(problem)
        table = problem.table
        fmap = Fmap.from_object_map(np.arange(table.template_objects), table.argument_objects)
        confidence = fmap_confidence(fmap, table, problem.weights).total
        beside = tuple(np.array(each) for each in Partial.beside)
        yield SearchProgress(fmap, confidence, 1, 1, upper_bound=1.0, maps=beside)
        return Outcome.OPTIMAL


class Whole(Partial):
    name = "whole"
    partial = False


REGISTRY = Registry(
    [
        *default_registry().algorithms,
        *(Registered(Kind.JUDGE, judge, "acme", "1.0") for judge in (Told, ToldPartial)),
        *(Registered(Kind.SEARCHER, each, "acme", "1.0") for each in (Partial, Whole)),
    ]
)


@pytest.fixture(autouse=True)
def _forgotten():
    Told.says = lambda problem: [each.partners for each in problem.candidates]
    Told.problems, Partial.problems, Partial.beside = [], [], ()


def drawn(few, many, seed=3, **how):
    rng = np.random.default_rng(seed)
    scene = random_scene(rng, many)
    return simulate_sketch(scene, rng, objects=range(few), **how).scene, scene


def matched(sketch, map_, *, defaults=Defaults(), judge="told", searcher="auto", **options):  # noqa: B008
    selection = {"judge": Choice(judge), "searcher": Choice(searcher)}
    request = MatchRequest(sketch, map_, selection, **options)
    *_, last = run_match(request, REGISTRY, defaults)
    assert isinstance(last, Finished)
    return last.result


def map_of(result):
    """Return a result's map as the judge sees it: from template to argument."""
    swapped = len(result.sketch) > len(result.map)
    found = result.object_map
    template = result.map if swapped else result.sketch
    pairs = {b: a for a, b in found.items()} if swapped else found
    return [pairs.get(g, -1) for g in range(len(template))]


class Standing(Clock):
    """A clock by which the time that is left is as told."""

    def left(self):
        return Standing.seconds


@pytest.mark.parametrize(("seconds", "told"), [(math.inf, None), (2.5, 2.5), (0.0, 0.0)])
def test_a_judge_is_told_how_much_time_is_left(monkeypatch, seconds, told):
    monkeypatch.setattr(Standing, "seconds", 9.0, raising=False)
    clock = Standing()
    searched = Partial.search

    def search(self, problem, rng):
        yield from searched(self, problem, rng)
        Standing.seconds = seconds

    monkeypatch.setattr(Partial, "search", search)
    sketch, map_ = drawn(4, 6)
    selection = {"judge": Choice("told-partial"), "searcher": Choice("partial")}
    list(run_match(MatchRequest(sketch, map_, selection), REGISTRY, clock=clock))
    assert Told.problems[0].time_budget == told


# What it is given --------------------------------------------------------------------------------


def test_a_judge_sees_the_scenes_the_relations_and_the_maps_met_the_best_first():
    sketch, map_ = drawn(4, 6, displacement=0.3)
    result = matched(sketch, map_, alternatives=4, weights=(2, 1, 1))
    (problem,) = Told.problems
    assert (problem.template, problem.argument, problem.swapped) == (sketch, map_, False)
    assert problem.weights == ConfidenceWeights(2, 1, 1)
    assert (problem.price, problem.alternatives, problem.usual) == (math.inf, 4, True)
    values = [each.confidence.total for each in problem.candidates]
    assert values == sorted(values, reverse=True)
    assert len({each.partners.tobytes() for each in problem.candidates}) == len(values) >= 3
    for each in problem.candidates:
        expected = maps.confidence(problem.table, maps.induced(each.partners), problem.weights[:3])
        assert each.confidence.total == pytest.approx(expected[0], abs=1e-9)
    assert problem.exchanges.shape == (4, 6)
    assert problem.exchanges.max() == pytest.approx(values[1], abs=1e-9)
    assert problem.omissions.shape == (4,)
    assert not problem.exchanges.flags.writeable
    assert result.object_map == dict(enumerate(problem.candidates[0].partners.tolist()))


def test_where_the_map_has_fewer_objects_it_is_the_template():
    map_, sketch = drawn(4, 6)
    result = matched(sketch, map_)
    (problem,) = Told.problems
    assert (problem.template, problem.argument, problem.swapped) == (map_, sketch, True)
    assert map_of(result) == problem.candidates[0].partners.tolist()


@pytest.mark.parametrize(
    ("usual", "selection"),
    [
        (False, {"histogram": Choice("gravitational")}),
        (False, {"similarity": Choice("pappis")}),
        (False, {"searcher": Choice("nn")}),
        (True, {"searcher": Choice("easm")}),
        (True, {"histogram": Choice("constant", {"directions": 36})}),
    ],
)
def test_a_judge_knows_whether_relations_are_those_that_were_learned_from(usual, selection):
    sketch, map_ = drawn(4, 4)
    request = MatchRequest(sketch, map_, {**selection, "judge": Choice("told")})
    list(run_match(request, REGISTRY))
    assert Told.problems[0].usual is usual


# What it says ------------------------------------------------------------------------------------


@pytest.mark.parametrize("swapped", [False, True])
def test_what_a_judge_puts_first_is_the_answer_and_all_is_computed_for_it(swapped):
    scenes = drawn(5, 6)[:: -1 if swapped else 1]
    usual = matched(*scenes, judge="confidence")
    best = map_of(usual)
    other = [best[1], best[0], *best[2:]]
    Told.says = lambda _: [other, best]
    result = matched(*scenes)
    (problem,) = Told.problems
    table, entries = problem.table, maps.induced(other)
    zeta, similarity, rotation, dilation = maps.confidence(table, entries, WEIGHTS)
    assert map_of(result) == other
    assert vars(result.confidence) == pytest.approx(
        {
            "total": zeta,
            "similarity": similarity,
            "rotation": rotation,
            "dilation": dilation,
            "shape": None,
            "size": None,
        }
    )
    assert result.omap_confidence == pytest.approx(similarity, abs=1e-9)
    pairs = [(e.map_pair if swapped else e.sketch_pair) for e in result.fmap]
    images = [(e.sketch_pair if swapped else e.map_pair) for e in result.fmap]
    assert images == [(other[a], other[b]) for a, b in pairs]
    turns = np.array([np.exp(1j * each.rotation) for each in result.fmap])
    assert np.exp(1j * result.rotation) == pytest.approx(turns.sum() / abs(turns.sum()))
    growth = [e.dilation ** (-1 if swapped else 1) for e in result.fmap]
    assert result.scale == pytest.approx(np.median(growth) ** (-1 if swapped else 1))
    # Its best other partner is that of the map with the highest ζ of all, for the two exchanged.
    margins = [line.margin for line in result.matches]
    assert min(margins) == pytest.approx(zeta - usual.fmap_confidence, abs=1e-9)
    (alternative,) = result.alternatives
    assert alternative.object_map == usual.object_map
    assert alternative.confidence.total == pytest.approx(usual.fmap_confidence)


def test_a_proof_speaks_of_the_answer_only_where_the_judge_takes_what_was_proved():
    sketch, map_ = drawn(5, 5)
    usual = matched(sketch, map_, judge="confidence", searcher="exact")
    assert (usual.outcome, matched(sketch, map_, searcher="exact").outcome) == ("OPTIMAL",) * 2
    best = map_of(usual)
    Told.says = lambda _: [[best[1], best[0], *best[2:]]]
    other = matched(sketch, map_, searcher="exact")
    assert (other.outcome, other.upper_bound) == ("CONVERGED", usual.upper_bound)
    assert other.fmap_confidence < other.upper_bound
    Told.says = lambda _: [[-1, *best[1:]]]
    part = matched(sketch, map_, searcher="exact", allow_unmatched=True)
    assert (part.outcome, part.upper_bound) == ("CONVERGED", None)
    assert part.unmatched_sketch_objects == (0,)
    assert [entry.sketch_pair for entry in part.fmap] == [
        (a, b) for a in range(1, 5) for b in range(a + 1, 5)
    ]


def test_a_judge_may_answer_a_map_that_nobody_met():
    sketch, map_ = drawn(6, 8)
    Told.says = lambda _: [[7, 6, 5, 4, 3, 2], [2, 3, 4, 5, 6, -1]]
    result = matched(sketch, map_, allow_unmatched=True, alternatives=1)
    assert map_of(result) == [7, 6, 5, 4, 3, 2]
    assert result.alternatives[0].object_map == {0: 2, 1: 3, 2: 4, 3: 5, 4: 6}
    table = Told.problems[0].table
    kept = finish(part_of(Part.whole(table), range(5))).table
    expected = maps.confidence(kept, maps.induced([2, 3, 4, 5, 6]), WEIGHTS)[0]
    assert result.alternatives[0].confidence.total == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("swapped", [False, True])
def test_probabilities_of_lines_are_read_from_sketch_to_map(swapped):
    rng, best = np.random.default_rng(1), [3, 0, 4, 1]
    lines = np.round(rng.uniform(0.0, 0.05, (4, 6)), 3)
    lines[np.arange(4), best] = np.round(rng.uniform(0.5, 0.75, 4), 3)
    Told.says = lambda _: Judgement((JudgedMap(best, 0.5),), lines, 0.25)
    result = matched(*drawn(4, 5)[:: -1 if swapped else 1])
    assert result.probability == 0.5
    assert [line.probability for line in result.matches] == [
        lines[(line.map_object, line.sketch_object)[:: 1 if swapped else -1]]
        for line in result.matches
    ]


def test_without_probabilities_nothing_is_said_of_them():
    result = matched(*drawn(4, 5))
    assert result.probability is None
    assert {line.probability for line in result.matches} == {None}


# Objects without partner -------------------------------------------------------------------------


def test_a_partial_searcher_is_asked_once_and_what_it_tells_beside_may_be_the_answer():
    scene = random_scene(np.random.default_rng(1), 6)
    drawn_ = Scene((*scene.objects[:4], *random_scene(np.random.default_rng(7), 2).objects))
    Partial.beside = ([0, 1, 2, 3, -1, -1], [3, 2, 1, 0, -1, 5])
    result = matched(drawn_, scene, searcher="partial", judge="confidence")
    (problem,) = Partial.problems
    assert problem.partial
    assert problem.scenes() == (drawn_, scene)
    assert problem.scenes() is problem.scenes(), "they are made once"
    assert result.object_map == {0: 0, 1: 1, 2: 2, 3: 3}
    assert result.fmap_confidence == pytest.approx(1.0)
    assert (result.outcome, result.upper_bound) == ("CONVERGED", None)
    matched(drawn_, scene, searcher="partial")
    values = [
        each.confidence.total - 0.4 * (each.partners < 0).mean()
        for each in Told.problems[0].candidates
    ]
    assert values == sorted(values, reverse=True)
    assert Told.problems[0].exchanges.shape == (4, 6), "of the objects of the first"
    met = [each.partners.tolist() for each in Told.problems[0].candidates]
    assert met[0] == Partial.beside[0]
    assert Partial.beside[1] in met
    assert list(range(6)) in met


def test_a_searcher_that_is_not_partial_is_asked_again_for_parts_and_given_their_scenes():
    sketch, map_ = drawn(5, 5)
    matched(sketch, map_, searcher="whole", allow_unmatched=True, unmatched_price=1e-3)
    whole, *parts = Partial.problems
    assert not whole.partial
    assert whole.scenes() == (sketch, map_)
    assert len(parts) >= 5
    for problem in parts:
        template, argument = problem.scenes()
        assert len(template) == problem.table.template_objects < 5
        assert set(map(id, template.objects)) <= set(map(id, sketch.objects))
        assert argument is map_
        assert not problem.partial
    Partial.problems = []
    matched(sketch, map_, searcher="whole", judge="told-partial", unmatched_price=1e-3)
    assert [problem.partial for problem in Partial.problems] == [True]


@pytest.mark.parametrize(
    ("settings", "price"),
    [
        ({}, math.inf),
        ({"judge": "told-partial"}, 0.4),
        ({"searcher": "partial"}, 0.4),
        ({"searcher": "partial", "allow_unmatched": False}, math.inf),
        ({"searcher": "partial", "profile": "strict"}, math.inf),
        ({"searcher": "partial", "profile": "strict", "allow_unmatched": True}, 0.4),
        ({"searcher": "partial", "unmatched_price": 0.7}, 0.7),
        ({"searcher": "nn", "judge": "told-partial"}, math.inf),
        ({"allow_unmatched": True}, 0.4),
    ],
)
def test_objects_may_stay_unmatched_where_searcher_or_judge_are_partial(settings, price):
    defaults = Defaults(profiles=(Profile("strict", allow_unmatched=False),))
    matched(*drawn(4, 4), defaults=defaults, **settings)
    assert Told.problems[0].price == price


@pytest.mark.parametrize("price", [0.0, -1.0, math.nan, math.inf, "dear"])
def test_a_price_that_is_none_is_put_down_to_the_judge(monkeypatch, price):
    monkeypatch.setattr(Told, "price", lambda *_: price)
    with pytest.raises(PluginError, match=r"judge told of acme 1\.0 failed .*its price is "):
        matched(*drawn(4, 4), allow_unmatched=True)
    matched(*drawn(4, 4), allow_unmatched=True, unmatched_price=0.5)


def test_the_weights_have_a_say_in_the_price(monkeypatch):
    monkeypatch.setattr(Told, "price", lambda _, weights: weights.dilation / 8)
    matched(*drawn(4, 4), allow_unmatched=True, weights=(1, 1, 3))
    assert Told.problems[0].price == 0.375


# What the caller knows ---------------------------------------------------------------------------


def told(scenes, **known):
    """Return what a judge makes of an exact search, and what it was given."""
    engine = Engine(REGISTRY)
    pipeline = engine.resolve({"searcher": Choice("exact")})
    goal = Goal(ConfidenceWeights(), alternatives=5, **known)
    work = engine.compare(scenes, pipeline.histogram, pipeline.similarity)
    comparison = finish(work)
    found = finish(engine.search(comparison, pipeline.searcher, goal))
    verdict = finish(engine.judge(comparison, found, goal, Told()))
    first, others = finish(considered(comparison, found, goal))
    return verdict, problem_of(comparison, first, others, goal)


def test_no_candidate_breaks_what_is_known():
    scenes = drawn(4, 5)
    free, _ = told(scenes)
    best = free.answer.partners.tolist()
    allowed = np.ones((4, 5), dtype=bool)
    allowed[0, best[0]] = False
    verdict, problem = told(scenes, allowed=allowed)
    assert problem.allowed is allowed
    assert verdict.answer.partners[0] != best[0]
    assert all(each.partners[0] != best[0] for each in problem.candidates)
    for h in range(5):
        holder = np.flatnonzero(verdict.answer.partners == h)
        takes = verdict.answer.partners[0]
        for g in range(4):
            gone = (g == 0 and h == best[0]) or (takes == best[0])
            gone = gone or (0 in holder and verdict.answer.partners[g] == best[0])
            assert not gone or problem.exchanges[g, h] == -np.inf
    pinned = np.array([-1, best[2], -1, -1])
    verdict, problem = told(scenes, pinned=pinned)
    assert all(each.partners[1] == best[2] for each in problem.candidates)
    assert np.isneginf(problem.omissions).tolist() == [False, True, False, False]
    with pytest.raises(AnswerUnavailableError, match="no object map agrees with all pins"):
        told(scenes, allowed=np.zeros((4, 5), dtype=bool))


@pytest.mark.parametrize(
    ("known", "words"),
    [
        ({"allowed": np.arange(20).reshape(4, 5) != 4}, "has a pairing that is ruled out"),
        ({"pinned": np.array([3, -1, -1, -1])}, "leaves out a pairing that is known"),
    ],
)
def test_a_judge_that_breaks_what_is_known_is_blamed(known, words):
    Told.says = lambda _: [[4, 0, 1, 2]]
    with pytest.raises(PluginError, match=f"judge told of acme 1.0 failed .*{words}"):
        told(drawn(4, 5), **known)


@pytest.mark.parametrize(
    ("partners", "words"),
    [
        ([0, 1, 2, 3], ""),
        ([0, 1, -1, 3], ""),
        ([0, -1, -1, 3], "matches 2 objects, fewer than 3"),
        ([0, 1, -2, 3], "a partner outside −1 … 4"),
        ([0, 1, 5, 3], "a partner outside −1 … 4"),
        ([0, 1, 1, -1], "takes an object of the argument twice"),
    ],
)
def test_a_map_has_three_lines_all_different(partners, words):
    problem, _ = matching_problem(np.random.default_rng(0), 5, missing=1)
    problem = replace(problem, partial=True)
    if not words:
        check_map(np.array(partners), problem)
        return
    with pytest.raises(ValueError, match=words):
        check_map(np.array(partners), problem)


@pytest.mark.parametrize(
    ("probability", "lines", "elsewhere", "words"),
    [
        (0.5, None, 0.5, ""),
        (0.5, 0.5, 0.5, ""),
        (0.0, 1.0, 1.0, ""),
        (1.5, None, None, "probability of a map is 1.5, not a number within 0 … 1"),
        ("half", None, None, "probability of a map is 'half', not a number"),
        (math.nan, None, None, "probability of a map is nan, not a number"),
        (None, None, -0.5, "elsewhere is -0.5, not a number within 0 … 1"),
        (None, 1.5, None, "it returned 1.5, which is more than 1"),
        (0.6, 0.5, None, "right with probability 0.6, but one of its lines only with 0.5"),
        (0.6, None, 0.5, "right with probability 0.6, but the place is another one with 0.5"),
    ],
)
def test_probabilities_that_contradict_each_other_are_put_down_to_the_judge(
    probability, lines, elsewhere, words
):
    maps_ = (JudgedMap([3, 0, 4, 1], probability), JudgedMap([0, 1, 2, 3]))
    table = None
    if lines is not None:
        table = max(0.0, 1.0 - lines) * np.eye(4, 6)
        table[2, 4] = table[0, 3] = table[1, 0] = table[3, 1] = lines
    Told.says = lambda _: Judgement(maps_, table, elsewhere)
    if not words:
        assert matched(*drawn(4, 5)).probability == probability
        return
    with pytest.raises(PluginError, match=f"judge told of acme 1.0 failed .*{words}"):
        matched(*drawn(4, 5))


def test_of_several_maps_and_of_several_partners_one_is_right_at_most():
    def told(probabilities, row):
        table = np.zeros((4, 6))
        table[1] = row
        maps_ = ([3, 0, 4, 1], [0, 1, 2, 3], [1, 0, 2, 3])
        judged = tuple(map(JudgedMap, maps_, probabilities))
        Told.says = lambda _: Judgement(judged, table if row else None)
        return matched(*drawn(4, 5))

    assert told((0.5, 0.3, 0.2), None).probability == 0.5
    assert told((None, None, None), [0.5, 0.2, 0.1, 0.1, 0.0, 0.1]).probability is None
    with pytest.raises(PluginError, match=r"its 3 maps sum to 1\.1, which is more than 1"):
        told((0.5, 0.3, 0.3), None)
    with pytest.raises(PluginError, match=r"object 1 sum to 1\.1, which is more than 1"):
        told((None, None, None), [0.5, 0.2, 0.1, 0.1, 0.0, 0.2])


# ζ of a map of some objects ----------------------------------------------------------------------


@examples(30)
@given(
    seed=st.integers(0, 2**32 - 1),
    few=st.integers(3, 6),
    more=st.integers(0, 2),
    left_out=st.integers(0, 3),
    evidence=st.booleans(),
)
def test_zeta_of_a_map_of_some_objects_is_that_of_their_relations(
    seed, few, more, left_out, evidence
):
    rng = np.random.default_rng(seed)
    table, own = random_table(rng, few, few + more), None
    if evidence:
        table = with_rotation_weights(rng, with_evidence(rng, table))
        products = rng.uniform(0.0, 1.0, (few, few + more, 6))
        own = SelfRelations(products, rng.uniform(0, 1, few), rng.normal(size=(few, few + more)))
    partners = rng.permutation(few + more)[:few]
    partners[rng.permutation(few)[: min(left_out, few - 2)]] = -1
    kept = np.flatnonzero(partners >= 0)
    part = finish(part_of(Part.whole(table, own), kept.tolist()))
    fmap = Fmap.from_object_map(partners[kept], few + more)
    expected = fmap_confidence(fmap, part.table, WEIGHTS, part.own)
    computed = map_confidence(partners, table, WEIGHTS, own)
    assert vars(computed) == pytest.approx(vars(expected), abs=1e-12)
    mapped = induced_map(partners, table)
    assert mapped.partners.tolist() == partners[kept].tolist()
    oracle = maps.occm(part.table, maps.induced(partners[kept].tolist()))[0]
    assert mapped.confidences == pytest.approx(
        [oracle[g][h] / (len(kept) - 1) for g, h in enumerate(partners[kept])]
    )
    assert mapped.confidence == pytest.approx(mapped.confidences.mean())


# The judge of the thesis -------------------------------------------------------------------------


def test_the_judge_confidence_keeps_the_order_of_what_maps_are_worth():
    problem, _ = judging_problem(np.random.default_rng(5), 7, missing=2, extra=1, price=0.2)
    judgement = HighestConfidence().judge(problem)
    assert judgement.maps[0].partners.tolist() == problem.candidates[0].partners.tolist()
    ranked = [each.partners.tolist() for each in judgement.maps]
    known = [each.partners.tolist() for each in problem.candidates]
    assert ranked == [each for each in known if each in ranked]
    assert len(ranked) >= 4
    assert sum(each.probability for each in judgement.maps) <= 1.0
    assert judgement.lines.sum(axis=1).max() <= 1.0 + 1e-9
    assert judgement.elsewhere is None


def test_a_problem_for_judges_has_what_was_asked_for():
    drawn_ = {"objects": 6, "missing": 2, "swapped": True, "distortion": 0.0}
    free, truth = judging_problem(np.random.default_rng(2), **drawn_)
    assert free.swapped
    assert (len(free.template), len(free.argument), free.price) == (4, 6, math.inf)
    assert (free.pinned, free.allowed) == (None, None)
    assert free.candidates[0].partners.tolist() == truth.tolist()
    problem, _ = judging_problem(np.random.default_rng(2), **drawn_, pinned={1: truth[1]})
    assert problem.pinned.tolist() == [-1, truth[1], -1, -1]
    assert problem.allowed.sum() == 1 + 3 * 5
    assert all(each.partners[1] == truth[1] for each in problem.candidates)
    with pytest.raises(ValueError, match="as many objects are not swapped"):
        judging_problem(np.random.default_rng(2), 5, swapped=True)


def test_a_setting_of_a_judge_is_refused_by_its_name():
    with pytest.raises(InvalidInputError, match=r"pipeline\.judge\.name is 'nobody', which is no"):
        matched(*drawn(4, 4), judge="nobody")
