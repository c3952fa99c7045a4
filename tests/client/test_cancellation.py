"""A task or scope that is cancelled cancels its call on the server, and nothing else."""

import asyncio
import socket

import anyio
import grpc
import pytest

from sketchmatch_client import AsyncClient, sources
from tests.client.fake_server import EVENTS

IMAGE = sources.image(b"picture")


@pytest.fixture
def endless(server):
    """A server whose matches never end."""
    server.events, server.endless = EVENTS[:3], True
    return server


async def begun(server):
    while not server.requests:
        await asyncio.sleep(0.01)


def test_a_cancelled_task_cancels_its_match(endless):
    async def main():
        async with AsyncClient(endless.address) as client:
            task = asyncio.create_task(client.match(IMAGE, IMAGE))
            await begun(endless)
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task
            assert await asyncio.to_thread(endless.cancelled.wait, 5)
            assert (await client.server_info()).api_version == "sketchmatch.v1"

    asyncio.run(main())


def test_a_timeout_of_asyncio_cancels_the_match(endless):
    async def main():
        async with AsyncClient(endless.address) as client:
            with pytest.raises(TimeoutError):
                async with asyncio.timeout(0.3):
                    await client.match(IMAGE, IMAGE)
            assert await asyncio.to_thread(endless.cancelled.wait, 5)

    asyncio.run(main())


def test_a_cancelled_scope_cancels_its_match_and_ends_in_peace(endless):
    async def main():
        async with AsyncClient(endless.address) as client:
            with anyio.move_on_after(0.3) as scope:
                await client.match(IMAGE, IMAGE)
            assert scope.cancelled_caught
            assert await anyio.to_thread.run_sync(endless.cancelled.wait, 5)
            assert (await client.server_info()).api_version == "sketchmatch.v1"

    anyio.run(main)


def test_a_scope_cancels_those_who_go_through_events(endless):
    async def main():
        seen = []
        async with AsyncClient(endless.address) as client:
            async with anyio.create_task_group() as group:

                async def follow():
                    async for event in client.events(IMAGE, IMAGE):
                        seen.append(event.WhichOneof("event"))  # noqa: PERF401 (as they come)

                group.start_soon(follow)
                await begun(endless)
                while "progress" not in seen:
                    await anyio.sleep(0.01)
                group.cancel_scope.cancel()
            assert await anyio.to_thread.run_sync(endless.cancelled.wait, 5)
        return seen

    assert anyio.run(main)[:3] == ["accepted", "scenes", "progress"]


def test_the_failure_of_one_task_cancels_the_match_of_another(endless):
    async def fail():
        await begun(endless)
        raise ValueError("the robot has moved")

    async def main():
        async with AsyncClient(endless.address) as client, anyio.create_task_group() as group:
            group.start_soon(client.match, IMAGE, IMAGE)
            group.start_soon(fail)

    with pytest.raises(ExceptionGroup) as caught:
        anyio.run(main)
    assert [str(error) for error in caught.value.exceptions] == ["the robot has moved"]
    assert endless.cancelled.wait(5)


def test_a_scope_cancels_the_wait_between_attempts(server):
    server.fail(grpc.StatusCode.UNAVAILABLE, "away")

    async def main():
        async with AsyncClient(server.address, retries=1000) as client:
            with anyio.move_on_after(0.3) as scope:
                await client.segment(IMAGE)
            return scope.cancelled_caught

    assert anyio.run(main)


async def asked(client):
    await client.segment(IMAGE)


async def gone_through(client):
    async for _ in client.events(IMAGE, IMAGE):
        pass


@pytest.mark.parametrize("call", [asked, gone_through])
def test_a_scope_may_cancel_at_any_step_of_calls_that_fail(call):
    """gRPC answers some cancellations with its own, of which a scope knows nothing."""

    async def main():
        async with AsyncClient(nobody, retries=1000) as client:
            for steps in [*range(40)] * 20:
                with anyio.CancelScope() as scope:
                    async with anyio.create_task_group() as group:
                        group.start_soon(cancel_after, scope, steps)
                        await call(client)
                assert scope.cancelled_caught

    async def cancel_after(scope, steps):
        for _ in range(steps):
            await asyncio.sleep(0)
        scope.cancel()

    with socket.create_server(("127.0.0.1", 0)) as free:
        nobody = f"127.0.0.1:{free.getsockname()[1]}"
    anyio.run(main)
