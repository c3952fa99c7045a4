"""A server whose event loop hangs ends itself; one that was frozen goes on."""

import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest
from grpc import insecure_channel
from grpc_health.v1 import health_pb2, health_pb2_grpc

from sketchmatch.server.watchdog import HUNG

pytestmark = pytest.mark.slow

A_SERVER = """
import asyncio, re, sys, threading
from sketchmatch.app.setup import Setup
from sketchmatch.pipeline.engine import Engine
from sketchmatch.registry import default_registry
from sketchmatch.server import watchdog
from sketchmatch.server.serve import ServerSettings, serve

def say(sentence):
    print(sentence, flush=True)
    if sentence == sys.argv[1]:
        threading.Event().wait()
    if sentence.startswith(sys.argv[2]):
        threading.Thread(target=re.match, args=("(a+)+$", 99 * "a" + "b"), daemon=True).start()

watchdog._TURN_SECONDS = 0.5

settings = ServerSettings("127.0.0.1:0", grace=0.0, patience=1.0)
asyncio.run(serve(lambda: Setup(Engine(default_registry())), settings, say))
"""


@contextmanager
def server(hangs_when_it_says="", locks_up_when_it_says="never"):
    with subprocess.Popen(
        [sys.executable, "-c", A_SERVER, hangs_when_it_says, locks_up_when_it_says],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            yield process, process.stdout.readline().rpartition(" ")[2].strip()
        finally:
            process.kill()


def test_a_server_that_hangs_ends_itself_and_says_where_its_threads_are():
    with server("serving") as (process, _):
        while process.stdout.readline() != "serving\n":
            pass
        process.send_signal(signal.SIGTERM)  # which it cannot heed any more
        _, errors = process.communicate(timeout=60)
        assert process.returncode == HUNG
    said, *where = errors.splitlines()
    assert said.startswith("sketchmatch: the server has been stuck for 1 s and ends itself")
    assert any("in say" in line for line in where)


@pytest.mark.parametrize("said", ["listening", "serving"])
def test_a_server_in_which_nothing_can_run_for_one_thread_is_ended(said):
    with server(locks_up_when_it_says=said) as (process, _):
        _, errors = process.communicate(timeout=60)
        assert process.returncode == -signal.SIGPROF
    assert 'File "' in errors
    assert "in match" in errors


def test_a_server_that_was_frozen_for_longer_goes_on():
    with server() as (process, address), insecure_channel(address) as channel:
        stub = health_pb2_grpc.HealthStub(channel)
        stub.Check(health_pb2.HealthCheckRequest(), timeout=60)
        process.send_signal(signal.SIGSTOP)
        time.sleep(2.5)
        process.send_signal(signal.SIGCONT)
        time.sleep(1.0)
        stub.Check(health_pb2.HealthCheckRequest(), timeout=60)
        assert process.poll() is None
