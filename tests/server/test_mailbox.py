import asyncio
import threading

import pytest

from sketchmatch.server.mailbox import Mailbox


def is_progress(item):
    return item.startswith("progress")


def received(*items):
    """Return what a reader gets who comes when everything is in the mailbox and it is closed."""

    async def read():
        mailbox = Mailbox(is_progress)
        for item in items:
            mailbox.put(item)
        mailbox.close()
        await asyncio.sleep(0)
        return [item async for item in mailbox]

    return asyncio.run(read())


@pytest.mark.parametrize(
    ("put", "got"),
    [
        ([], []),
        (["accepted", "scenes", "result"], ["accepted", "scenes", "result"]),
        (["progress 1", "progress 2", "progress 3"], ["progress 3"]),
        (
            ["accepted", "progress 1", "scenes", "progress 2", "progress 3", "result"],
            ["accepted", "progress 1", "scenes", "progress 3", "result"],
        ),
        (["accepted", "accepted"], ["accepted", "accepted"]),
    ],
)
def test_only_waiting_progress_gives_way_to_the_next_progress(put, got):
    assert received(*put) == got


def test_a_prompt_reader_gets_everything_in_order():
    async def read():
        mailbox = Mailbox(is_progress)

        async def write():
            for k in range(20):
                mailbox.put(f"progress {k}")
                await asyncio.sleep(0.001)
            mailbox.close()

        writer = asyncio.create_task(write())
        items = [item async for item in mailbox]
        await writer
        return items

    assert asyncio.run(read()) == [f"progress {k}" for k in range(20)]


def test_what_a_reader_has_taken_is_not_replaced_and_nothing_old_comes_after_it():
    async def read():
        mailbox = Mailbox(is_progress)
        items = []
        mailbox.put("progress 1")
        async for item in mailbox:
            items.append(item)
            if item == "progress 1":
                mailbox.put("progress 2")
                mailbox.put("progress 3")
                mailbox.close()
                await asyncio.sleep(0.01)
        return items

    assert asyncio.run(read()) == ["progress 1", "progress 3"]


def test_a_thread_may_write_and_close():
    async def read():
        mailbox = Mailbox(is_progress)

        def write():
            for k in range(1000):
                mailbox.put(f"item {k}")
            mailbox.close()

        writer = threading.Thread(target=write)
        writer.start()
        items = [item async for item in mailbox]
        writer.join()
        return items

    assert asyncio.run(read()) == [f"item {k}" for k in range(1000)]


def test_a_reader_waits_until_something_comes_or_the_mailbox_closes():
    async def read():
        mailbox = Mailbox(is_progress)
        reading = asyncio.create_task(anext(aiter(mailbox)))
        await asyncio.sleep(0.02)
        assert not reading.done()
        mailbox.put("result")
        return await asyncio.wait_for(reading, 60)

    assert asyncio.run(read()) == "result"
