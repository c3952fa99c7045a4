"""The client works beside every protobuf that it allows, though the oldest generated its code."""

import subprocess

import pytest

from tests.client import oldest_runtime
from tests.environment import environment
from tests.tools import ROOT

pytestmark = pytest.mark.slow

CLIENT = ROOT / "clients" / "python"


@pytest.fixture(scope="module", params=[4, 5, 6, 7])
def python(request, tmp_path_factory):
    """Return the Python of an environment that holds one protobuf and what goes with it."""
    folder = tmp_path_factory.mktemp(f"protobuf{request.param}")
    wanted = [f"protobuf=={request.param}.*", "googleapis-common-protos", "grpcio", "pyyaml"]
    programs = environment(folder, "--only-binary", ":all:", *wanted, PIP_CONSTRAINT="")
    return request.param, programs / "python"


def test_both_clients_match(python, server):
    major, program = python
    done = subprocess.run(
        [program, "-W", "error", oldest_runtime.__file__, server.address],
        env={"PYTHONPATH": str(CLIENT)},
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    versions, *maps = done.stdout.splitlines()
    assert versions.split()[1].startswith(f"{major}.")
    assert maps == ["{0: 2, 1: 0}", "{0: 2, 1: 0}"]
