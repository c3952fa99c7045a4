"""A client that is closed says so, by an error of this package as from every call."""

import asyncio
from threading import Thread

import pytest

from sketchmatch_client import AsyncClient, CallCancelledError, Client, Sketch, sources
from sketchmatch_client._sketch import AsyncSketch
from tests.client.conftest import STREAMS
from tests.client.fake_server import EVENTS
from tests.pace import wait_until

IMAGE = sources.image(b"picture")
CALLS = [
    ("match", IMAGE, IMAGE),
    ("events", IMAGE, IMAGE),
    ("watch", "m1"),
    ("matches",),
    ("segment", IMAGE),
    ("transfer", IMAGE, IMAGE),
    ("sketch", IMAGE),
    ("algorithms",),
    ("is_serving",),
    ("wait_until_serving",),
]


def closed_sync(address, method, arguments):
    client = Client(address)
    client.close()
    answer = getattr(client, method)(*arguments)
    return list(answer) if method in STREAMS else answer


def closed_async(address, method, arguments):
    async def answer():
        client = AsyncClient(address)
        await client.close()
        answer = getattr(client, method)(*arguments)
        return [event async for event in answer] if method in STREAMS else await answer

    return asyncio.run(answer())


@pytest.mark.parametrize("ask", [closed_sync, closed_async], ids=["sync", "asyncio"])
@pytest.mark.parametrize("call", CALLS, ids=[name for name, *_ in CALLS])
def test_a_closed_client_tells_to_open_a_new_one(server, ask, call):
    method, *arguments = call
    with pytest.raises(CallCancelledError) as refused:
        ask(server.address, method, arguments)
    said = f"the client of the server at {server.address} is closed; open a new one"
    assert str(refused.value) == said
    assert server.requests == []


def test_a_sketch_and_a_match_of_a_closed_client_tell_the_same(server):
    server.events, server.endless = EVENTS[:3], True
    client = Client(server.address)
    match = client.events(IMAGE, IMAGE, keep_running=True)
    next(match)
    client.close()
    for ask in (match.cancel, match.result, lambda: list(Sketch(client, "s1").watch())):
        with pytest.raises(CallCancelledError, match="is closed; open a new one"):
            ask()


def test_an_asynchronous_sketch_of_a_closed_client_tells_the_same(server):
    async def watch():
        client = AsyncClient(server.address)
        await client.close()
        return [event async for event in AsyncSketch(client, "s1").watch()]

    with pytest.raises(CallCancelledError, match="is closed; open a new one"):
        asyncio.run(watch())


def test_a_match_that_goes_on_while_its_client_is_closed_tells_the_same(server):
    server.events, server.endless = EVENTS[:3], True
    client, told = Client(server.address), []

    def wait():
        try:
            client.match(IMAGE, IMAGE)
        except CallCancelledError as error:
            told.append(str(error))

    waiting = Thread(target=wait)
    waiting.start()
    wait_until(lambda: server.requests, "no match begins")
    client.close()
    waiting.join(20)
    assert "is closed; open a new one" in told[0]
