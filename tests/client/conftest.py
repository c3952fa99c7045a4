import asyncio

import pytest

from sketchmatch_client import AsyncClient, Client
from tests.client.fake_server import running


@pytest.fixture
def server():
    with running() as fake:
        yield fake


STREAMS = ("events", "watch", "matches")


def call_sync(address, method, *arguments, retries=0, **options):
    with Client(address, timeout=60, retries=retries) as client:
        answer = getattr(client, method)(*arguments, **options)
        return list(answer) if method in STREAMS else answer


def call_async(address, method, *arguments, retries=0, **options):
    async def answer():
        async with AsyncClient(address, timeout=60, retries=retries) as client:
            answer = getattr(client, method)(*arguments, **options)
            return [event async for event in answer] if method in STREAMS else await answer

    return asyncio.run(answer())


@pytest.fixture(params=[call_sync, call_async], ids=["sync", "asyncio"])
def call(request):
    """``call(address, method, …)`` with either client."""
    return request.param
