"""How much each caller may ask for, and what a match may cost."""

import asyncio
import pickle

import pytest

from sketchmatch.app.jobs import Job, answers
from sketchmatch.app.quotas import Rates
from sketchmatch.errors import InvalidInputError, PluginError, Reason, TooBusyError
from sketchmatch.model import Scene
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch_client import features, match_request, transfer_request
from sketchmatch_proto.v1.sketch_service_pb2 import CreateSketchRequest
from tests.app.test_application import SCENE, Held, held, setup, until  # noqa: F401
from tests.app.test_matches import ALICE, BOB, endless, matched, named, serving

BOXES = Scene.from_polygons([[(k, 0), (k + 1, 0), (k, 1 + k)] for k in (0, 3, 9)])


def test_a_caller_may_send_so_many_requests_in_a_minute_at_once_or_one_by_one():
    now = [1000.0]
    rates = Rates(lambda: now[0])
    for _ in range(3):
        rates.take("alice", 3)
    with pytest.raises(TooBusyError, match="3 requests in a minute") as refused:
        rates.take("alice", 3)
    assert refused.value.retry_seconds == 20
    rates.take("bob", 3)
    now[0] += 19.0
    with pytest.raises(TooBusyError) as refused:
        rates.take("alice", 3)
    assert refused.value.retry_seconds == 1
    now[0] += 1.0
    rates.take("alice", 3)
    with pytest.raises(TooBusyError):
        rates.take("alice", 3)
    now[0] += 3600.0
    for _ in range(3):
        rates.take("alice", 3)
    with pytest.raises(TooBusyError):
        rates.take("alice", 3)
    for _ in range(10):
        rates.take("alice", None)


def test_a_match_asked_for_again_counts_once():
    async def run():
        async with serving(max_per_minute=2) as app:
            for _ in range(4):
                await matched(app, named("n1"))
            await matched(app, named("n2"))
            with pytest.raises(TooBusyError, match="2 requests in a minute"):
                await matched(app, named("n3"))
            await matched(app, named("n3"), BOB)

    asyncio.run(run())


@pytest.mark.usefixtures("held")
def test_a_caller_has_no_more_places_than_its_own_and_others_find_room():
    async def run():
        async with (
            serving(max_concurrent_matches=4, max_per_caller=1) as app,
            app.matching(endless("n0"), ALICE),
            app.matching(named("n1"), ALICE) as own,
        ):
            await until(Held.began.is_set, "it does not begin")
            await matched(app, named("n1"), BOB)
            assert not own.log.begun
            Held.go.set()
            await until(lambda: own.log.ended, "it never has its turn")
            own.log.check()

    asyncio.run(run())


def asked(request, **limits):
    return list(answers(Job("", request), setup(**limits)))


def test_a_match_of_too_many_comparisons_is_refused_before_it_makes_them():
    request = match_request(SCENE, SCENE, params={"histogram": {"directions": 40}})
    assert asked(request, max_comparisons=3 * 3 * 40)
    with pytest.raises(InvalidInputError, match="makes 360 comparisons in 40 directions") as no:
        asked(request, max_comparisons=3 * 3 * 40 - 1)
    assert (no.value.reason, no.value.field) == (Reason.LIMIT_EXCEEDED, "sketch")


def test_a_match_that_is_made_to_carry_something_may_cost_no_more():
    options = {"params": {"histogram": {"directions": 40}, "searcher": {"generations": 30}}}
    request = transfer_request(SCENE, SCENE, [features.point(0, 0)], searcher="easm", **options)
    for name, limit in {"max_comparisons": 3 * 3 * 40, "max_candidates": 10**9}.items():
        assert asked(request, **{name: limit})
        with pytest.raises(InvalidInputError, match="more than this server's limit of 8"):
            asked(request, **{name: 8})


def test_a_search_of_too_many_maps_is_refused_by_its_parameters():
    params = {"searcher": {"population": 20, "generations": 30}}
    request = match_request(SCENE, SCENE, searcher="easm", params=params)
    assert asked(request, max_candidates=600)
    with pytest.raises(InvalidInputError, match="let 'easm' evaluate 600 object maps") as no:
        asked(request, max_candidates=599)
    assert no.value.reason is Reason.LIMIT_EXCEEDED
    assert no.value.field == "pipeline.searcher.parameters"
    assert asked(match_request(SCENE, SCENE), max_candidates=1)  # no parameter says how many


@pytest.mark.parametrize(
    ("searcher", "parameters"),
    [
        ("easm", {"generations": 2}),
        ("nn", {"seed_points": 1001}),
        ("nn-pso", {"particles": 7, "iterations": 143}),
        ("fsnn-pso", {"particles": 143, "iterations": 7}),
        ("direct", {"population": 2, "offspring": 1001}),
    ],
)
def test_all_searchers_whose_parameters_say_how_much_they_weigh_are_held_to_it(
    searcher, parameters
):
    request = match_request(SCENE, SCENE, searcher=searcher, params={"searcher": parameters})
    with pytest.raises(
        InvalidInputError, match=r"evaluate 1[02]0[01] object maps, .* limit of 1000"
    ):
        asked(request, max_candidates=1000)
    assert asked(request, max_candidates=1200)


def test_a_sketch_whose_matches_would_weigh_too_much_is_not_begun():
    match = match_request(SCENE, SCENE, searcher="nn", params={"searcher": {"seed_points": 9}})
    match.ClearField("sketch")
    request = CreateSketchRequest(match=match)
    assert asked(request, max_candidates=9)
    with pytest.raises(InvalidInputError, match="let 'nn' evaluate 9 object maps") as no:
        asked(request, max_candidates=8)
    assert no.value.field == "match.pipeline.searcher.parameters"


def test_an_engine_that_checks_nothing_goes_to_other_processes():
    engine = pickle.loads(pickle.dumps(Engine()))
    assert len(list(engine.match(MatchRequest(BOXES, BOXES)))) > 2


@pytest.mark.parametrize("said", ["many", 0, 1.5])
def test_a_searcher_that_does_not_say_a_number_is_blamed(monkeypatch, said):
    monkeypatch.setattr("sketchmatch_builtin.searchers.align.Align.most_maps", said)
    with pytest.raises(PluginError, match=f"its most_maps is .*{said}"):
        asked(match_request(SCENE, SCENE), max_candidates=1)
