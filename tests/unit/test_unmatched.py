"""Objects without partner on both sides, against trying every map of every part."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch import InvalidInputError, Scene, match
from sketchmatch.api import MatchProblem, Outcome, Searcher, SearchProgress
from sketchmatch.config import builtin
from sketchmatch.model import Fmap, object_pairs
from sketchmatch.pipeline import unmatched
from sketchmatch.pipeline.correspond import fmap_confidence
from sketchmatch.pipeline.events import Finished, Progress
from sketchmatch.pipeline.match import run_match
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch.pipeline.selection import Choice
from sketchmatch.pipeline.slices import finish
from sketchmatch.pipeline.unmatched import (
    FEWEST,
    Part,
    PartSearch,
    omission_confidences,
    part_of,
    trials,
)
from sketchmatch.pipeline.warmup import warm_up, warm_up_others
from sketchmatch.registry import Kind, Registered, Registry, default_registry
from sketchmatch.testing import random_scene, simulate_sketch
from sketchmatch_builtin.searchers.exact import Exact
from tests.interpreted import examples
from tests.strategies import random_table, with_evidence, with_rotation_weights

WEIGHTS = (1.0, 2.0, 0.5)
SEARCHERS = ["auto", "exact", "direct", "easm"]


@pytest.fixture(scope="module", autouse=True)
def _warm():
    # On a new machine the kernels compile here, and not while a test measures time.
    warm_up(default_registry())
    warm_up_others(default_registry())


def zeta(partners, table):
    fmap = Fmap.from_object_map(np.array(partners), table.argument_objects)
    return fmap_confidence(fmap, table, WEIGHTS).total


def every_part(table):
    """Yield all parts of a table with at least three objects."""
    whole = Part.whole(table)
    for count in range(FEWEST, table.template_objects + 1):
        for kept in itertools.combinations(range(table.template_objects), count):
            yield finish(part_of(whole, kept))


def best_values(table, price):
    """Return the highest ζ − price·u/N for each number u of objects left out."""
    others = range(table.argument_objects)
    values = {}
    for part in every_part(table):
        best = max(
            zeta(partners, part.table)
            for partners in itertools.permutations(others, len(part.kept))
        )
        worth = best - price * part.left_out / part.objects
        values[part.left_out] = max(worth, values.get(part.left_out, worth))
    return values


def searched(table, price):
    """Return all that is found where exact searches each part, in order."""
    whole, found = Part.whole(table), []
    plan = trials([tuple(range(table.template_objects))], WEIGHTS, price)
    trial = next(plan)
    while True:
        part = finish(part_of(whole, trial.kept))
        *_, last = Exact().search(MatchProblem(part.table, WEIGHTS), np.random.default_rng(0))
        found.append(PartSearch(part, last, Outcome.OPTIMAL))
        try:
            trial = plan.send(found[-1])
        except StopIteration:
            return found


def place_with_extra(seed=0):
    """Return a sketch of seven of eight objects and one that is not there, the map, the truth."""
    rng = np.random.default_rng(seed)
    everything = random_scene(rng, 9)
    drawn = simulate_sketch(everything, rng, objects=range(1, 9), displacement=0.05)
    truth = {k: int(p) for k, p in enumerate(drawn.partners) if p != 8}
    return drawn.scene, Scene(everything.objects[:8]), truth


BY_ZETA = {"searcher": Choice("auto"), "judge": Choice("confidence")}
"""Neither finds partial maps by itself, so that parts are searched."""


def matched(sketch, map_, *, selection=BY_ZETA, **settings):
    request = MatchRequest(sketch, map_, BY_ZETA | selection, **settings)
    *_, last = run_match(request, default_registry(), builtin().defaults)
    assert isinstance(last, Finished)
    return last.result


@examples(25)
@given(
    seed=st.integers(0, 2**32 - 1),
    few=st.integers(3, 5),
    more=st.integers(0, 1),
    price=st.floats(0.01, 1.5),
)
def test_what_is_found_is_the_best_of_all_parts(seed, few, more, price):
    table = random_table(np.random.default_rng(seed), few, few + more)
    found = searched(table, price)
    values = best_values(table, price)
    best = max(found, key=lambda each: each.value(price))
    assert found[0].part.left_out == 0
    assert best.value(price) <= max(values.values()) + 1e-9
    assert best.value(price) >= max(values[u] for u in values if u <= 1) - 1e-9
    # An object more is left out for as long as that makes something better.
    deepest = max(each.part.left_out for each in found)
    assert deepest in (best.part.left_out, best.part.left_out + 1)


@examples(25)
@given(seed=st.integers(0, 2**32 - 1), few=st.integers(4, 7), evidence=st.booleans())
def test_an_omission_has_the_confidence_of_the_map_that_it_leaves(seed, few, evidence):
    rng = np.random.default_rng(seed)
    table = random_table(rng, few, few + 1)
    if evidence:
        table = with_rotation_weights(rng, with_evidence(rng, table))
    partners = rng.permutation(few + 1)[:few]
    fmap = Fmap.from_object_map(partners, few + 1)
    computed = omission_confidences(fmap, table, WEIGHTS)
    for g in range(few):
        kept = [k for k in range(few) if k != g]
        part = finish(part_of(Part.whole(table), kept))
        assert computed[g] == pytest.approx(zeta(partners[kept], part.table), abs=1e-12)


def test_omissions_are_not_weighed_where_they_would_take_too_long(monkeypatch):
    table = random_table(np.random.default_rng(0), 5, 6)
    fmap = Fmap.from_object_map(np.arange(5), 6)
    monkeypatch.setattr(unmatched, "_MOST_ENTRIES", 50)
    assert omission_confidences(fmap, table, WEIGHTS) is not None
    monkeypatch.setattr(unmatched, "_MOST_ENTRIES", 49)
    assert omission_confidences(fmap, table, WEIGHTS) is None


def test_zeta_of_two_objects_means_nothing():
    table = random_table(np.random.default_rng(0), 3, 4)
    assert omission_confidences(Fmap.from_object_map(np.arange(3), 4), table, WEIGHTS) is None


@pytest.mark.parametrize(
    ("objects", "price", "share"), [(4, 0.5, 0.5), (3, 0.5, 1.0), (4, math.inf, 1.0)]
)
def test_all_the_time_is_for_the_whole_where_nothing_can_be_left_out(objects, price, share):
    first = next(trials([tuple(range(objects))], WEIGHTS, price))
    assert (first.kept, first.share) == (tuple(range(objects)), share)


def test_a_part_has_the_relations_of_its_objects():
    rng = np.random.default_rng(1)
    table = with_rotation_weights(rng, with_evidence(rng, random_table(rng, 5, 6)))
    kept = (0, 2, 3)
    part = finish(part_of(Part.whole(table), kept))
    rows = [k for k, pair in enumerate(object_pairs(5).tolist()) if set(pair) <= set(kept)]
    assert (part.table.template_objects, part.table.argument_objects) == (3, 6)
    for name in ("similarity", "rotation", "dilation", "evidence"):
        assert (getattr(part.table, name) == getattr(table, name)[rows]).all()
    counts = table.rotation_weights[rows]
    assert part.table.rotation_weights == pytest.approx(counts / counts.mean(), rel=1e-12)
    assert part.left_out == 2


def test_three_objects_are_matched_however_little_it_costs_to_leave_them_out():
    assert len(omission_confidences(*four_mapped())) == 4
    sketch, map_, _ = place_with_extra()
    result = matched(sketch, map_, allow_unmatched=True, unmatched_price=1e-9)
    assert len(result.matches) == FEWEST
    assert len(result.unmatched_sketch_objects) == len(result.unmatched_map_objects) == 5


def four_mapped():
    table = random_table(np.random.default_rng(2), 4, 4)
    return Fmap.from_object_map(np.arange(4), 4), table, WEIGHTS


@pytest.mark.slow
@pytest.mark.parametrize("searcher", SEARCHERS)
@pytest.mark.parametrize("turned", [False, True])
def test_what_the_map_lacks_stays_without_partner(searcher, turned):
    sketch, map_, truth = place_with_extra()
    if turned:
        sketch, map_, truth = map_, sketch, {b: a for a, b in truth.items()}
    selection = {"searcher": Choice(searcher)}
    forced = matched(sketch, map_, selection=selection)
    assert not forced.unmatched_sketch_objects
    result = matched(sketch, map_, selection=selection, allow_unmatched=True)
    assert result.object_map == truth
    assert len(result.unmatched_sketch_objects) == len(result.unmatched_map_objects) == 1
    for entry in result.fmap:
        a, b = entry.sketch_pair
        assert entry.map_pair == (truth[a], truth[b])
    for line in result.matches:
        assert line.relation.reference_object in truth
    assert forced.object_map in [other.object_map for other in result.alternatives]


@pytest.mark.parametrize("few", [7, 8])
def test_more_objects_on_one_side_may_still_leave_some_out_on_the_other(few):
    sketch, map_, truth = place_with_extra(3)
    kept = [k for k in range(8) if k in truth][: few - 1]
    extra = next(k for k in range(8) if k not in truth)
    drawn = Scene(tuple(sketch.objects[k] for k in (*kept, extra)))
    weights = (1.0, 3.8, 0.05, 2.9, 0.58, 1.0)
    result = matched(drawn, map_, weights=weights, allow_unmatched=True, unmatched_price=0.1)
    assert result.object_map == {k: truth[each] for k, each in enumerate(kept)}
    assert result.unmatched_sketch_objects == (len(kept),)


def test_a_complete_sketch_is_matched_completely():
    scene = random_scene(np.random.default_rng(7), 7)
    drawn = simulate_sketch(scene, np.random.default_rng(8), displacement=0.1)
    for price in (None, 1.0):
        result = matched(drawn.scene, scene, allow_unmatched=True, unmatched_price=price)
        assert result.object_map == dict(enumerate(drawn.partners.tolist()))
        assert result.outcome is Outcome.OPTIMAL
        assert result.upper_bound == pytest.approx(result.fmap_confidence)


def test_nothing_changes_where_it_is_not_allowed():
    sketch, map_, _ = place_with_extra()
    plain, dear = (
        matched(sketch, map_),
        matched(sketch, map_, allow_unmatched=True, unmatched_price=1000.0),
    )
    assert plain.object_map == dear.object_map
    assert plain.confidence == dear.confidence
    assert plain.fmap == dear.fmap


def test_the_same_seed_gives_the_same_parts():
    sketch, map_, _ = place_with_extra()
    settings = {"selection": {"searcher": Choice("direct")}, "seed": 5, "allow_unmatched": True}
    one, two = matched(sketch, map_, **settings), matched(sketch, map_, **settings)
    assert one.matches == two.matches
    assert one.statistics.evaluations == two.statistics.evaluations


def test_progress_never_falls_and_the_time_budget_holds():
    sketch, map_, _ = place_with_extra()
    endless = {"searcher": Choice("easm", {"patience": 10_000_000, "generations": 10_000_000})}
    endless = {**endless, "judge": Choice("confidence")}
    request = MatchRequest(sketch, map_, endless, time_budget=0.6, allow_unmatched=True)
    seen = list(run_match(request, default_registry()))
    confidences = [
        event.confidence
        for event in seen
        if isinstance(event, Progress) and event.confidence is not None
    ]
    assert confidences == sorted(confidences)
    result = seen[-1].result
    assert result.outcome is Outcome.TIME_BUDGET
    assert 0.5 < result.statistics.seconds["total"] < 1.5
    assert len(result.matches) >= 7


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        (
            {"unmatched_price": 0.1, "profile": "thesis"},
            "unmatched_price is 0.1, but no object may stay unmatched",
        ),
        ({"allow_unmatched": True, "unmatched_price": 0.0}, "unmatched_price is 0; give a number"),
        ({"allow_unmatched": True, "unmatched_price": math.nan}, "unmatched_price is nan; give"),
        (
            {"allow_unmatched": True, "searcher": "nn"},
            "allow_unmatched needs a searcher that finds",
        ),
    ],
)
def test_what_makes_no_sense_is_refused(settings, sentence):
    scene = random_scene(np.random.default_rng(0), 4)
    with pytest.raises(InvalidInputError, match=sentence):
        match(scene, scene, **settings)


def test_each_search_gets_its_share_of_the_time_that_is_left():
    given = []

    class Frugal(Searcher):
        name = "frugal"
        summary = "Ends at once, and keeps what time it was given."

        def search(self, problem, rng):  # noqa: ARG002
            given.append(problem.time_budget)
            table = problem.table
            fmap = Fmap.from_object_map(np.arange(table.template_objects), table.argument_objects)
            confidence = fmap_confidence(fmap, table, problem.weights).total
            yield SearchProgress(fmap, confidence, 1, 1)
            return Outcome.CONVERGED

    scene = random_scene(np.random.default_rng(5), 5)
    registry = Registry(
        [*default_registry().algorithms, Registered(Kind.SEARCHER, Frugal, "acme", "1.0")]
    )
    request = MatchRequest(
        scene,
        scene,
        selection={"searcher": Choice("frugal"), "judge": Choice("confidence")},
        time_budget=1000.0,
        allow_unmatched=True,
        unmatched_price=0.5,
    )
    *_, last = run_match(request, registry)
    assert isinstance(last, Finished)
    # Half of it for all objects, then equal shares for the five that leave one of them out.
    whole, *parts = given[:6]
    assert whole == pytest.approx(500.0, rel=0.02)
    shares = [1 / 6, 1 / 5, 1 / 4, 1 / 3, 1 / 2]
    assert parts == pytest.approx([1000.0 * share for share in shares], rel=0.05)
