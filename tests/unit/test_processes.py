"""The tests' own processes are as a reader's are."""

import signal
import subprocess
import sys

import pytest

from tests.processes import let_children_be_interrupted


@pytest.fixture
def in_the_background():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("in_the_background")
def test_children_heed_ctrl_c_and_the_tests_in_the_background_still_do_not():
    let_children_be_interrupted()
    signal.raise_signal(signal.SIGINT)
    code = "import signal; signal.raise_signal(signal.SIGINT)"
    child = subprocess.run([sys.executable, "-c", code], stderr=subprocess.DEVNULL, check=False)
    assert child.returncode == -signal.SIGINT
