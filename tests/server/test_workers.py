import asyncio
import threading
import time

import pytest

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.server.limits import Limits
from sketchmatch.server.services import TooBusyError, Workers
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest


async def until_free(workers):
    while True:
        try:
            return workers.admitted(MatchRequest()).__enter__()
        except TooBusyError:
            await asyncio.sleep(0.001)


@pytest.mark.parametrize("fails", [False, True])
def test_a_place_is_taken_until_the_work_has_ended_even_if_nobody_waits_for_it(fails):
    async def scenario():
        workers, may_end = Workers(Limits(max_concurrent_matches=1)), threading.Event()

        def work():
            may_end.wait(60)
            assert not fails

        with workers.admitted(MatchRequest()):
            running = workers.run(work)
        with pytest.raises(TooBusyError):
            workers.admitted(MatchRequest()).__enter__()
        may_end.set()
        await asyncio.gather(running, return_exceptions=True)
        await until_free(workers)

    asyncio.run(asyncio.wait_for(scenario(), 60))


def test_a_request_of_exactly_the_limit_passes_and_one_byte_more_does_not():
    request = MatchRequest(seed=1)
    with Workers(Limits(max_request_bytes=request.ByteSize())).admitted(request):
        pass
    small = Workers(Limits(max_request_bytes=request.ByteSize() - 1))
    with pytest.raises(InvalidInputError) as raised:
        small.admitted(request).__enter__()
    assert raised.value.reason is Reason.MESSAGE_TOO_LARGE


def test_work_is_told_to_stop_when_its_request_is_over():
    workers = Workers(Limits())
    with workers.admitted(MatchRequest()) as stop:
        assert not stop.is_set()
    assert stop.is_set()


def test_close_stops_what_runs_and_waits_for_its_threads():
    async def closed():
        workers = Workers(Limits(max_concurrent_matches=2))
        ended = []

        def work(stop):
            stop.wait(60)
            time.sleep(0.05)
            ended.append(threading.current_thread().name)

        with workers.admitted(MatchRequest()) as one, workers.admitted(MatchRequest()) as other:
            running = [workers.run(lambda stop=stop: work(stop)) for stop in (one, other)]
            await asyncio.sleep(0.02)
            await workers.close()
            assert len(ended) == 2
            await asyncio.gather(*running)

    asyncio.run(asyncio.wait_for(closed(), 60))
