import re
import subprocess
import sys

import pytest

from sketchmatch.cli import main
from tests import processes
from tests.shell import Shell, install
from tests.tools import ROOT


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


@pytest.fixture(scope="session")
def clean_shell(tmp_path_factory):
    """Yield a shell beside a copy of the checkout, with the tutorial's environment active."""
    tutorial = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    first = re.search(r"^```console\n(\$ python3 -m venv .*?)^```", tutorial, re.S | re.M)[1]
    shell = Shell(tmp_path_factory.mktemp("clean"))
    try:
        install(shell, first)
        yield shell
    finally:
        shell.close()
