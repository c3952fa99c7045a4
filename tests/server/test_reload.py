"""SIGHUP reads the configuration again, and no request under way notices."""

import asyncio
import signal
import time
from types import SimpleNamespace

import pytest

from sketchmatch.server.serve import _Warming
from sketchmatch_client import Client, InvalidRequestError
from tests.processes import server
from tests.server.harness import ENDLESS, scene

EASM = '[pipeline.searcher]\nname = "easm"\n'
DIRECT = """
[pipeline.searcher]
name = "direct"
parameters = { population = 30 }

[profiles.careful]
summary = "With a proof."
searcher.name = "exact"

[server]
max_time_budget_seconds = 3.0
max_matches = 2

[limits]
max_objects = 5
"""


@pytest.fixture
def running(tmp_path):
    """Yield a server that reads a file, and what rewrites the file and has it read again."""
    file = tmp_path / "sketchmatch.toml"
    file.write_text(EASM, encoding="utf-8")
    with server("--config", str(file)) as process, Client(process.address) as client:
        client.wait_until_serving(60)

        def reload(text: str, answer: str) -> str:
            file.write_text(text, encoding="utf-8")
            process.process.send_signal(signal.SIGHUP)
            return process.wait_for(answer)

        yield client, reload


def searcher_of(match) -> str:
    return match.accepted.pipeline.searcher.name


@pytest.mark.slow
def test_new_requests_get_the_new_configuration_and_a_running_search_its_own(running):
    client, reload = running
    events = client.events(scene(8), scene(8, 1), params=ENDLESS["params"], time_budget=5.0)
    accepted = next(events).accepted
    assert accepted.pipeline.searcher.name == "easm"
    with pytest.raises(InvalidRequestError, match="'careful', which is not a profile"):
        client.match(scene(4), scene(4), profile="careful")

    reload(DIRECT, "the configuration is reloaded$")

    after = client.match(scene(4), scene(4))
    assert searcher_of(after) == "direct"
    assert after.accepted.pipeline.searcher.parameters["population"] == 30
    assert searcher_of(client.match(scene(4), scene(4), profile="careful")) == "exact"
    limits = client.server_info().limits
    assert (limits.max_objects, limits.max_concurrent_matches) == (5, 2)
    with pytest.raises(InvalidRequestError, match="more than the limit of 5 objects"):
        client.match(scene(6), scene(6))
    default = {a.name for a in client.algorithms().algorithms if a.is_default}
    assert "direct" in default
    assert "easm" not in default
    last = list(events)[-1]
    assert last.HasField("result"), "the search that was under way went on to its own end"
    assert last.result.statistics.search_elapsed.ToTimedelta().total_seconds() > 4.0


@pytest.mark.slow
def test_a_configuration_that_is_wrong_changes_nothing_and_the_server_says_why(running):
    client, reload = running
    for text, words in [
        ("[pipeline]\nsearcher = = 3\n", "is not TOML at line 2"),
        ('[pipeline.searcher]\nname = "eezm"\n', "'eezm', which is not a searcher"),
        ("[pipeline.searcher]\nparameters = { tempo = 0 }\n", "tempo is not a parameter of align"),
    ]:
        reload(text, f"the configuration was not reloaded: .*{words}")
        assert searcher_of(client.match(scene(4), scene(4))) == "easm"


class Busy:
    """An application that is never quiet."""

    idle = False

    async def warm_up(self, unwanted, warm):
        pass

    async def warm_up_others(self, unwanted, warm):  # noqa: ARG002
        assert await asyncio.to_thread(unwanted)


def test_a_busy_server_may_be_reloaded_any_number_of_times():
    async def run():
        stopping = asyncio.Event()
        warming = _Warming(Busy(), SimpleNamespace(ready=None), stopping)
        reloads = [asyncio.create_task(warming.again()) for _ in range(50)]
        try:
            await asyncio.wait_for(asyncio.gather(*reloads[:-1]), 60)
            # There is a thread for others.
            await asyncio.wait_for(asyncio.to_thread(time.sleep, 0), 60)
            assert not reloads[-1].done()
        finally:
            stopping.set()
        await asyncio.wait_for(reloads[-1], 60)

    asyncio.run(run())
