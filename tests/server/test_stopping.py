import asyncio
import logging
import queue
import statistics
import time
from contextlib import aclosing

import pytest

from sketchmatch_client import (
    AsyncClient,
    CallCancelledError,
    Client,
    DeadlineExceededError,
    features,
)
from tests.pace import slowness, within
from tests.server import probes
from tests.server.harness import ENDLESS, in_loop, kinds, scene, serving, when_there_is_room

TARGET = 0.1
"""Seconds after which a search must have stopped; the median must keep to it."""
LENIENT = 0.5
"""What a machine that is busy otherwise may need once."""
OPTIONS = {**ENDLESS, "searcher": "recorded-easm"}


@pytest.fixture(scope="module")
def recorded():
    """Yield the address of a server with algorithms that say when they are stopped."""
    with serving(probes.RecordedEasm, probes.RecordedHistogram) as host:
        yield host.address


@pytest.fixture(autouse=True)
def blank():
    for record in (probes.started, probes.ended):
        while not record.empty():
            record.get()
    probes.described.clear()


def assert_prompt(latencies):
    print(f"median {1e3 * statistics.median(latencies):.0f} ms, max {1e3 * max(latencies):.0f} ms")
    slower = slowness()
    assert statistics.median(latencies) < TARGET * slower
    assert max(latencies) < LENIENT * slower


@pytest.mark.slow
def test_closing_the_stream_stops_the_search_within_100_ms(recorded):
    def latency(client):
        events = client.events(scene(30), scene(30, 1), **OPTIONS)
        while not next(events).progress.HasField("confidence"):
            pass
        time.sleep(0.03)  # not in step with the reports
        left = time.monotonic()
        events.close()
        return probes.ended.get(timeout=60) - left

    with Client(recorded) as client:
        assert_prompt([latency(client) for _ in range(10)])


@pytest.mark.slow
def test_cancelling_an_asyncio_task_stops_the_search_within_100_ms(recorded):
    async def latency(client):
        task = asyncio.create_task(client.match(scene(30), scene(30, 1), **OPTIONS))
        await asyncio.to_thread(probes.started.get, timeout=60)
        await asyncio.sleep(0.13)
        left = time.monotonic()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        return await asyncio.to_thread(probes.ended.get, timeout=60) - left

    async def latencies():
        async with AsyncClient(recorded) as client:
            return [await latency(client) for _ in range(10)]

    assert_prompt(in_loop(latencies()).result(60))


@pytest.mark.slow
def test_a_deadline_stops_the_search_within_100_ms(recorded):
    def latency(client):
        began = time.monotonic()
        with pytest.raises(DeadlineExceededError, match="allow more time"):
            client.match(scene(30), scene(30, 1), timeout=0.4, **OPTIONS)
        return probes.ended.get(timeout=60) - began - 0.4

    with Client(recorded) as client:
        assert_prompt([latency(client) for _ in range(5)])


@pytest.mark.parametrize("leaves", ["deadline", "cancel"])
def test_a_transfer_that_is_left_stops_its_search(recorded, leaves):
    given = (scene(30), scene(30, 1), [features.point(1, 1)])

    async def left():
        async with AsyncClient(recorded) as client:
            limit = 1.0 if leaves == "deadline" else None
            task = asyncio.create_task(client.transfer(*given, timeout=limit, **OPTIONS))
            await asyncio.to_thread(probes.started.get, timeout=60)
            if leaves == "cancel":
                task.cancel()
            expected = DeadlineExceededError if limit else asyncio.CancelledError
            with pytest.raises(expected):
                await task
        return await asyncio.to_thread(probes.ended.get, timeout=5 * slowness())

    in_loop(left()).result(60)


def test_a_client_that_vanishes_stops_its_search(recorded):
    client = Client(recorded)
    events = client.events(scene(30), scene(30, 1), **OPTIONS)
    while not next(events).progress.HasField("confidence"):
        pass
    with within(LENIENT):
        client.close()
        probes.ended.get(timeout=60)
    with pytest.raises(CallCancelledError):
        list(events)


@pytest.mark.slow
def test_cancel_stops_the_description_of_many_objects_within_100_ms(recorded):
    def latency(client):
        probes.described.clear()
        events = client.events(
            scene(100),
            scene(100, 1),
            histogram="recorded-constant",
            params={"histogram": {"directions": 3600}},
        )
        while next(events).WhichOneof("event") != "scenes":
            pass
        probes.started.get(timeout=60)
        time.sleep(0.13)
        left = time.monotonic()
        events.close()
        time.sleep(LENIENT)
        return max(probes.described) - left

    with Client(recorded) as client:
        assert_prompt([latency(client) for _ in range(5)])


@pytest.mark.slow
def test_a_search_that_is_stopped_frees_its_place_and_leaves_no_error_in_the_log(caplog):
    full = {"max_concurrent_matches": 1, "max_waiting": 0}
    with serving(**full) as host, Client(host.address) as client:

        def start_and_leave():
            events = client.events(scene(30), scene(30, 1), **ENDLESS)
            assert next(events).WhichOneof("event") == "accepted"
            events.close()

        for _ in range(5):
            when_there_is_room(start_and_leave)
        match = when_there_is_room(lambda: client.match(scene(4), scene(4)))
    assert match.object_map == {k: k for k in range(4)}
    assert not [record for record in caplog.records if record.levelno > logging.INFO]


def test_many_matches_at_once_stop_when_their_callers_leave(recorded):
    async def one(client):
        async with aclosing(client.events(scene(30), scene(30, 1), **OPTIONS)) as events:
            async for event in events:
                if event.progress.HasField("confidence"):
                    return

    async def all_of_them():
        async with AsyncClient(recorded) as client:
            await asyncio.gather(*(one(client) for _ in range(6)))

    in_loop(all_of_them()).result(30)
    for _ in range(6):
        probes.ended.get(timeout=60)
    with pytest.raises(queue.Empty):
        probes.ended.get(timeout=0.05)


def test_a_time_budget_ends_a_search_with_its_best_answer(recorded):
    with Client(recorded) as client, within(1.5):
        options = {**OPTIONS, "judge": "confidence"}  # which leaves no object out
        events = list(client.events(scene(30), scene(30, 1), time_budget=0.5, **options))
    assert kinds(events)[-1] == "result"
    assert len(events[-1].result.object_matches) == 30


def test_a_time_budget_that_ends_before_any_answer_says_so(recorded):
    with (
        Client(recorded) as client,
        pytest.raises(DeadlineExceededError, match=r"time budget of 0\.001 s .* allow") as raised,
    ):
        client.match(scene(60), scene(60, 1), time_budget=0.001)
    assert raised.value.reason == "TIME_BUDGET_EXHAUSTED"
