"""A check that never ends is named, and ended by its time limit, whatever keeps it."""

import os
import re
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from sketchmatch.api import Similarity
from sketchmatch.testing import (
    CheckState,
    ContractViolationError,
    check_plugin,
    parametrize_plugins,
    plugin_checks,
)
from sketchmatch.testing.conformance.time_limit import _Worker
from tests.pace import wait_until

FIRST = "similarity-is-within-0-and-1"
"""The first check in which an algorithm compares."""


class Looping(Similarity):
    """Compares two histograms for ever, and never comes to a decision about them."""

    name = "looping"
    summary = "Never ends."

    def compare(self, *_):
        while True:
            pass


class Swallowing(Looping):
    """Compares two histograms for ever, and does not hear that it is to end."""

    over = False

    def compare(self, aligned, _):
        while not Swallowing.over:
            try:
                time.sleep(0.01)
            except BaseException:
                continue
        return np.ones(len(aligned))


class Waiting(Looping):
    """Waits for ever where several threads compare at once with the same object."""

    def __init__(self, params=None):
        super().__init__(params)
        self.busy = threading.Lock()
        self.never = threading.Event()
        type(self).latest = self

    def compare(self, aligned, argument):
        if not self.busy.acquire(blocking=False):
            self.never.wait()
        time.sleep(0.005)
        self.busy.release()
        return np.exp(-np.abs(aligned - argument).mean(axis=1))


class Reading(Looping):
    """Waits in the operating system, where no exception reaches it, for what never comes."""

    def compare(self, *_):
        os.read(self.pipe, 1)


def workers():
    return [thread for thread in threading.enumerate() if isinstance(thread, _Worker)]


def all_end():
    wait_until(lambda: not workers(), "a thread is left")


def the_check(algorithm, name=FIRST, time_limit=0.3):
    return next(check for check in plugin_checks(algorithm, time_limit) if check.name == name)


def test_a_loop_is_ended_and_named_with_its_place():
    with pytest.raises(ContractViolationError) as raised:
        check_plugin(Looping, time_limit=0.3)
    place = r"test_check_time_limit\.py, line \d+, in compare"
    sentence = rf"\S+\.Looping breaks {FIRST}: it did not end within 0\.3 s at {place}; expected: "
    assert re.match(sentence, str(raised.value))
    assert raised.value.overdue
    assert not workers()


def test_a_result_says_that_its_time_was_over():
    result = the_check(Looping).result()
    assert (result.name, result.state, result.overdue) == (FIRST, CheckState.FAILED, True)
    assert result.seen.startswith("it did not end within 0.3 s at ")
    assert result.seconds >= 0.3


@pytest.mark.slow
def test_a_loop_that_swallows_everything_is_left_behind():
    try:
        result = the_check(Swallowing).result()
        assert result.seen.endswith(", and goes on in a thread that cannot be ended")
        assert all(worker.daemon for worker in workers())
    finally:
        Swallowing.over = True
        all_end()


@pytest.mark.slow
def test_what_waits_where_no_exception_reaches_it_is_left_behind():
    Reading.pipe, writing = os.pipe()
    try:
        result = the_check(Reading).result()
        assert "in compare, and goes on in a thread that cannot be ended" in result.seen
    finally:
        os.write(writing, b"x")
        all_end()


@pytest.mark.slow
def test_threads_that_wait_for_each_other_are_seen():
    try:
        result = the_check(Waiting, "threads-agree", 1.0).result()
        assert "it did not end within 1 s at test_check" in result.seen
        assert "in compare, and goes on in a thread" in result.seen
    finally:
        Waiting.latest.never.set()
        all_end()
    assert the_check(Waiting, time_limit=60.0).result().state is CheckState.PASSED


def test_an_expected_failure_may_be_that_a_check_never_ends():
    expected = dict.fromkeys(
        (
            FIRST,
            "equal-rows-have-similarity-1",
            "rows-are-compared-alone",
            "answers-repeat",
            "threads-agree",
            "inputs-stay-untouched",
        ),
        "it never ends",
    )
    check_plugin(Looping, expected, time_limit=0.1)


def test_a_warm_up_may_take_five_times_as_long():
    class Compiling(Looping):
        """Takes its time to compile what it needs, which is no reason to call it broken."""

        @classmethod
        def warm_up(cls):
            time.sleep(0.12)

    assert the_check(Compiling, "warm-up-can-be-repeated", 0.1).result().state is CheckState.PASSED
    slow = the_check(Compiling, "warm-up-can-be-repeated", 0.02).result()
    assert slow.seen.startswith("it did not end within 0.1 s")


def test_without_a_limit_a_check_runs_in_the_thread_that_calls_it():
    threads = set()

    class Asking(Looping):
        """Remembers where it was called from, and finds everything alike."""

        def compare(self, aligned, _):
            threads.add(threading.current_thread())
            return np.ones(len(aligned))

    the_check(Asking, time_limit=None)()
    assert threads == {threading.current_thread()}


def test_an_interrupt_ends_the_check_too():
    class Interrupting(Looping):
        """Presses Ctrl-C after a while, and goes on as if nothing had happened."""

        def compare(self, *_):
            os.kill(os.getpid(), signal.SIGINT)
            while True:
                pass

    with pytest.raises(KeyboardInterrupt):
        the_check(Interrupting, time_limit=60.0)()
    all_end()


def test_every_check_that_is_made_for_pytest_has_the_limit():
    mark = parametrize_plugins([Looping], time_limit=7.0).mark
    limits = {case.values[0].name: case.values[0].time_limit for case in mark.args[1]}
    assert set(limits.values()) == {7.0, 35.0}
    assert limits["warm-up-can-be-repeated"] == 35.0


HELD_UP = """
import re
import sketchmatch.testing.conformance.time_limit as time_limit
from sketchmatch.api import Similarity
from sketchmatch.testing import parametrize_plugins

time_limit.HELD_UP = 1.0

class Matching(Similarity):
    '''Matches a regular expression that takes longer than the universe is old.'''

    name = "matching"
    summary = "Never ends."

    def compare(self, aligned, argument):
        return re.match("(a+)+$", 64 * "a" + "b")

@parametrize_plugins([Matching], time_limit=0.5)
def test_it_keeps_the_contract(check):
    check()
"""


@pytest.mark.slow
def test_what_holds_up_the_interpreter_ends_pytest_and_is_shown(tmp_path):
    (tmp_path / "test_matching.py").write_text(HELD_UP)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "."]
    ran = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=200
    )
    assert ran.returncode not in (0, 1, 2)
    assert re.search(r"test_matching\.py\", line \d+ in compare", ran.stderr)
    assert "in similarity_is_within_0_and_1" in ran.stderr


COUNTED = """
import faulthandler, signal, time
import sketchmatch.testing.conformance.time_limit as time_limit

faulthandler.enable()
signals = []
signal.signal(signal.SIGABRT, lambda *_: signals.append(time.monotonic()))
begun = time.monotonic()
with time_limit._ended_when_held_up(0.3):
    while time.monotonic() < begun + 1.0:
        time.sleep(0.05)
with time_limit._ended_when_held_up(0.3):
    pass
time.sleep(0.5)
assert len(signals) == 1, signals
assert 0.3 <= signals[0] - begun < 0.9, signals[0] - begun
"""


@pytest.mark.skipif(sys.platform != "linux", reason="a timer of Linux")
def test_one_signal_alone_ends_what_is_held_up_since_a_second_would_hide_the_stacks():
    subprocess.run([sys.executable, "-c", COUNTED], check=True, timeout=60)
