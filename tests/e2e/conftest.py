import subprocess
import sys

import pytest

from sketchmatch.cli import main
from tests import processes


@pytest.fixture(scope="session")
def address():
    """Yield the address of a real server process."""
    with processes.server() as running:
        yield running.address


@pytest.fixture
def command_line(monkeypatch, capfd):
    """Return what runs a command in this process: many of them cost little."""

    def run(*arguments) -> subprocess.CompletedProcess[str]:
        command = ["sketchmatch", *map(str, arguments)]
        monkeypatch.setattr(sys, "argv", command)
        monkeypatch.setenv("GRPC_VERBOSITY", "NONE")
        capfd.readouterr()
        with pytest.raises(SystemExit) as left:
            main()
        return subprocess.CompletedProcess(command, left.value.code, *capfd.readouterr())

    return run
