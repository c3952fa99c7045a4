"""What a server tells its operator: a line a call, and of a plugin's fault the plugin's lines."""

import asyncio
import logging
import random
import re
import signal
import subprocess

import grpc
import pytest

from sketchmatch.app.faults import told
from sketchmatch.errors import PluginError
from sketchmatch.pipeline.guard import blaming
from sketchmatch.server.log import logging_to_standard_error
from sketchmatch_client import (
    AsyncClient,
    Client,
    InvalidRequestError,
    ServerBusyError,
    ServerFailedError,
    sources,
)
from sketchmatch_proto.v1.catalog_service_pb2 import ListAlgorithmsRequest
from sketchmatch_proto.v1.catalog_service_pb2_grpc import CatalogServiceStub
from tests.pace import wait_until
from tests.processes import COMMAND, server
from tests.server.harness import ENDLESS, registry_with, scene, serving
from tests.server.misbehaving import RaisingSegmenter

TIME = r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z"
CALLER = r"caller=ipv4:127\.0\.0\.1:\d+"


def test_a_caller_who_is_gone_before_the_answer_is_no_fault_of_the_server(capfd):
    with logging_to_standard_error():
        grpcs = logging.getLogger("grpc._cython.cygrpc")
        for what in ("ExecuteBatchError raised in core by", "Unexpected [KeyError] raised by"):
            grpcs.error("%s servicer method [/sketchmatch.v1.SceneService/PutScene]", what)
    (line,) = capfd.readouterr().err.splitlines()
    assert "Unexpected [KeyError]" in line


@pytest.mark.slow
def test_each_call_has_a_line_with_time_caller_match_and_how_it_ended():
    with server() as running, Client(running.address) as client:
        found = client.match(scene(4), scene(5, 1))
        line = running.wait_for("^(.* Match .*)$")
        assert re.fullmatch(
            rf"{TIME} INFO Match code=OK seconds=\d+\.\d{{3}} {CALLER} "
            rf"match={found.result.match_id} searcher=align objects=4x5 outcome=CONVERGED",
            line,
        )
        with pytest.raises(InvalidRequestError):
            client.match(scene(4), scene(4), searcher="x")
        running.wait_for("Match code=INVALID_ARGUMENT .* reason=UNKNOWN_ALGORITHM$")
        with pytest.raises(InvalidRequestError):
            client.segment(sources.polygons([[(0, 0), (1, 0), (0, 0)]]))
        running.wait_for("Segment code=INVALID_ARGUMENT .* reason=TOO_FEW_OBJECTS$")
        client.algorithms()
        running.wait_for(f"ListAlgorithms code=OK .* {CALLER}$")
        for _ in range(5):
            events = client.events(scene(20), scene(20, 1), **ENDLESS)
            next(events)
            events.close()
        wait_until(lambda: [*map(is_of_a_match, running.said)].count(True) == 7, "no line")
        codes = [line.split()[3] for line in running.said if is_of_a_match(line)]
        assert codes == ["code=OK", "code=INVALID_ARGUMENT", *["code=CANCELLED"] * 5]
        assert not any("Health" in line for line in running.said)


@pytest.mark.slow
def test_callers_who_leave_at_any_moment_leave_no_error_in_the_log():
    async def leaves(client, rng):
        for _ in range(25):
            match = asyncio.create_task(client.match(scene(12), scene(12, 1), **ENDLESS))
            await asyncio.sleep(rng.uniform(0.0, 0.15))
            match.cancel()
            with pytest.raises((asyncio.CancelledError, ServerBusyError)):
                await match

    async def all_of_them(address):
        async with AsyncClient(address, retries=0) as client:
            await asyncio.gather(*(leaves(client, random.Random(k)) for k in range(6)))

    with server() as running:
        asyncio.run(all_of_them(running.address))
        wait_until(lambda: [*map(is_of_a_match, running.said)].count(True) >= 75, "no lines")
    assert not [line for line in running.said if " ERROR " in line]


def is_of_a_match(line):
    return " INFO Match " in line


def test_of_a_plugins_fault_the_log_has_its_lines_and_none_of_ours(caplog):
    with (
        serving(RaisingSegmenter) as host,
        Client(host.address) as client,
        pytest.raises(ServerFailedError),
    ):
        client.match(scene(4), scene(4), map_segmenter=RaisingSegmenter.name)
    (record,) = (record for record in caplog.records if record.levelname == "ERROR")
    first, *lines = record.getMessage().splitlines()
    assert re.match(rf"{CALLER} match=\w+ searcher=align: segmenter raisingsegmenter of ", first)
    assert re.match(r'  File ".*/tests/server/misbehaving\.py", line \d+, in segment$', lines[0])
    assert not any("/sketchmatch/" in line for line in lines)
    assert not record.exc_info


def test_what_is_found_from_outside_has_no_traceback_and_what_nobody_foresaw_a_whole_one():
    registry = registry_with(RaisingSegmenter)
    with pytest.raises(PluginError) as raised, blaming(RaisingSegmenter, registry):
        raise_here()
    assert told(raised.value).splitlines()[-2].endswith("in raise_here")
    assert told(PluginError("it is silent")) == "it is silent"
    assert told(ValueError("odd")) == "ValueError: odd"
    noted = PluginError("it failed")
    noted.add_note("in a child")
    assert told(noted) == "it failed\nin a child"


def raise_here():
    raise ZeroDivisionError


@pytest.mark.slow
def test_a_server_whose_log_nobody_reads_goes_on():
    with subprocess.Popen(
        [*COMMAND, "serve", "--address", "127.0.0.1:0"], stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            address = process.stderr.readline().split()[-1]
            while process.stderr.readline() != "sketchmatch: serving\n":
                pass
            with grpc.insecure_channel(address) as channel:
                stub = CatalogServiceStub(channel)
                for _ in range(1_500):  # of about 90 bytes each; a pipe holds 64 KiB
                    stub.ListAlgorithms(ListAlgorithmsRequest(), timeout=20)
        finally:
            process.send_signal(signal.SIGKILL)


@pytest.mark.slow
def test_an_address_that_a_reload_cannot_change_is_said_to_stay(tmp_path):
    file = tmp_path / "sketchmatch.toml"
    file.write_text("[server]\nmax_matches = 3\n", encoding="utf-8")
    with server("--config", str(file)) as running:
        running.process.send_signal(signal.SIGHUP)
        running.wait_for("the configuration is reloaded$")
        assert not any("do not change" in line for line in running.said)
        file.write_text("[server]\ngrace_seconds = 7.5\n", encoding="utf-8")
        running.process.send_signal(signal.SIGHUP)
        running.wait_for("what is kept and the names of files do not change before the server is")
