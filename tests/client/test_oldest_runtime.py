import re
import subprocess
import tomllib
from pathlib import Path

import grpc

from tests.client.fake_server import EVENTS, reason, violation
from tests.tools import ROOT, tool

CLIENT = ROOT / "clients" / "python"


def test_the_versions_are_the_oldest_that_the_client_claims(server):
    versions, *_ = run_script(server.address)
    assert [re.match(r"\d+\.\d+", version)[0] for version in versions.split()] == [
        claimed("grpcio"),
        claimed("protobuf"),
    ]


def test_both_clients_match(server):
    assert run_script(server.address)[1:] == ["{0: 2, 1: 0}", "{0: 2, 1: 0}"]


def test_both_clients_translate_errors(server):
    server.fail(grpc.StatusCode.INVALID_ARGUMENT, "no", reason("INVALID_IMAGE"), violation("map"))
    assert run_script(server.address)[1:] == ["map", "map"]


def test_another_thread_cancels(server):
    server.events, server.endless = EVENTS[:3], True
    assert run_script(server.address, "cancel")[1:] == ["cancelled after accepted"]
    assert server.cancelled.wait(5)


def test_no_proxy_stands_between_programs_of_one_machine(server):
    assert run_script(server.address, http_proxy="http://127.0.0.1:9")[1:] == 2 * ["{0: 2, 1: 0}"]


def run_script(address: str, *what: str, **environment: str) -> list[str]:
    done = subprocess.run(
        [
            tool("python"),
            "-W",
            "error",
            Path(__file__).with_name("oldest_runtime.py"),
            address,
            *what,
        ],
        env={"PYTHONPATH": str(CLIENT), **environment},
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def claimed(distribution: str) -> str:
    project = tomllib.loads((CLIENT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (requirement,) = [line for line in project["dependencies"] if line.startswith(distribution)]
    return re.fullmatch(r"\w+>=([\d.]+)", requirement)[1]
