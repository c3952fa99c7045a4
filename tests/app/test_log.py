import asyncio
import threading
from contextlib import aclosing

import pytest

from sketchmatch.app.following import followed
from sketchmatch.app.tasks import Log


def told(log, *items):
    for item in items:
        log.add(item, news=item.startswith("news"))


def left(log, seen=0):
    """Return all that a reader gets who has seen so much."""
    items = []
    while (found := log.next(seen)) is not None:
        seen, item = found
        items.append(item)
    return items


async def read(log):
    async with aclosing(followed(log)) as items:
        return [item async for _, item in items]


@pytest.mark.parametrize(
    ("put", "got"),
    [
        ([], []),
        (["accepted", "scenes", "result"], ["accepted", "scenes", "result"]),
        (["news 1", "news 2", "news 3"], ["news 3"]),
        (
            ["accepted", "news 1", "scenes", "news 2", "news 3", "result"],
            ["accepted", "scenes", "news 3", "result"],
        ),
        (["accepted", "accepted"], ["accepted", "accepted"]),
    ],
)
def test_news_alone_give_way_to_the_next_and_all_else_stays_in_order(put, got):
    log = Log()
    told(log, *put)
    assert left(log) == got
    log.end()
    assert asyncio.run(read(log)) == got


def test_any_number_of_readers_get_the_same_whenever_they_come():
    log = Log()
    told(log, "accepted", "news 1")
    assert left(log) == left(log) == ["accepted", "news 1"]
    told(log, "result")
    assert left(log) == ["accepted", "news 1", "result"]


def test_a_reader_goes_on_after_what_it_has_seen():
    log = Log()
    told(log, "accepted", "news 1", "scenes")
    assert left(log, seen=1) == ["news 1", "scenes"]
    assert left(log, seen=2) == ["scenes"]
    told(log, "news 2", "result")
    assert left(log, seen=3) == ["news 2", "result"]


def test_a_reader_is_told_the_error_that_a_log_ends_with_after_all_else():
    log, items = Log(), []
    told(log, "accepted")
    log.end(ZeroDivisionError("lost"))

    async def follow():
        async with aclosing(followed(log)) as told_so_far:
            async for _, item in told_so_far:
                items.append(item)

    with pytest.raises(ZeroDivisionError, match="lost"):
        asyncio.run(follow())
    assert items == ["accepted"]


def test_what_a_thread_tells_reaches_a_reader_that_waits():
    async def reading():
        log = Log()

        def write():
            for k in range(1000):
                log.add(f"item {k}")
            log.end()

        writer = threading.Thread(target=write)
        waiting = asyncio.create_task(read(log))
        await asyncio.sleep(0.02)
        assert not waiting.done()
        writer.start()
        items = await asyncio.wait_for(waiting, 60)
        writer.join()
        return items

    assert asyncio.run(reading()) == [f"item {k}" for k in range(1000)]


def test_nobody_is_woken_who_no_longer_reads():
    log, woken = Log(), []
    with log.waking(lambda: woken.append("first")), log.waking(lambda: woken.append("second")):
        log.add("accepted")
    assert sorted(woken) == ["first", "second"]
    log.add("result")
    assert len(woken) == 2
