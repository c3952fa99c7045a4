"""Ctrl-C that gets lost, in processes of their own."""

import subprocess
import sys
from textwrap import dedent

import pytest


def run(program):
    command = [sys.executable, "-c", dedent(program)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def test_an_interrupt_that_python_ignores_is_found_later():
    done = run(
        """
        import os, signal, weakref
        from sketchmatch.cli import interrupts

        signal.signal(signal.SIGINT, signal.default_int_handler)
        interrupts.listen()
        assert interrupts.check() == ()
        thing = set()
        weak = weakref.ref(thing, lambda _: os.kill(os.getpid(), signal.SIGINT))
        del thing
        print("went on")
        try:
            interrupts.check()
        except KeyboardInterrupt:
            print("was interrupted")
        interrupts.listen()
        print(interrupts.check(), "for the next command")
        """
    )
    assert done.stdout.splitlines() == [
        "went on",
        "was interrupted",
        "() for the next command",
    ]


def test_who_ignores_interrupts_goes_on_ignoring_them():
    done = run(
        """
        import os, signal
        from sketchmatch.cli import interrupts

        signal.signal(signal.SIGINT, signal.SIG_IGN)
        interrupts.listen()
        os.kill(os.getpid(), signal.SIGINT)
        print(interrupts.check())
        """
    )
    assert done.stdout == "()\n"


@pytest.mark.parametrize(("settle", "code"), [("pass", -2), ("interrupts.settle()", 3)])
def test_an_interrupt_caught_long_ago_does_not_change_the_exit_code(settle, code, tmp_path):
    (tmp_path / "program.py").write_text(
        "import signal, sys\n"
        "from sketchmatch.cli import interrupts\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "try:\n"
        "    exec('raise KeyboardInterrupt')\n"
        "except KeyboardInterrupt:\n"
        f"    {settle}\n"
        "sys.exit(3)\n"
    )
    command = [sys.executable, "-m", "program"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, timeout=60, check=False)
    assert done.returncode == code
