"""Real ``sketchmatch`` processes."""

import os
import pty
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from tests.pace import wait_until

_ESCAPE = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
COMMAND = [sys.executable, "-m", "sketchmatch"]


def sketchmatch(*arguments, timeout=200, **options) -> subprocess.CompletedProcess[str]:
    """Run a command to its end, as a shell with pipes would."""
    return subprocess.run(
        [*COMMAND, *map(str, arguments)],
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=timeout,
        check=False,
        **options,
    )


def let_children_be_interrupted() -> None:
    """See that processes which are started from now on heed SIGINT.

    A shell starts what runs in the background with SIGINT ignored, and so would be all that the
    tests start. A handler of this process is none of its children's.
    """
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, lambda *_: None)


def free_port() -> int:
    """Return a port of this machine at which nobody listens yet."""
    with socket.socket() as link:
        link.bind(("127.0.0.1", 0))
        return link.getsockname()[1]


def children_of(pid: int) -> list[int]:
    """Return the processes that a process has started, or one of these, and that still run."""
    if not Path("/proc/self/task").is_dir():
        pytest.skip("this system does not tell which processes a process has started")
    found = []
    with suppress(FileNotFoundError):  # it has ended meanwhile
        for thread in Path(f"/proc/{pid}/task").iterdir():
            for child in (thread / "children").read_text(encoding="ascii").split():
                found += [int(child), *children_of(int(child))]
    return found


def status_of(pid: int) -> dict[str, str]:
    """Return what the kernel tells of a process, by name.

    Raises
    ------
    OSError
        If there is none.
    """
    told = Path(f"/proc/{pid}/status").read_text(encoding="utf-8", errors="replace")
    return dict(line.split(":\t", 1) for line in told.splitlines())


def memory_of(pid: int, of: str = "VmRSS") -> int:
    """Return the bytes of memory that a process occupies, or that ``VmHWM`` says it did at most."""
    return 1024 * int(status_of(pid).get(of, "0 kB").split()[0])


def is_alive(pid: int) -> bool:
    """Whether a process runs; one that has ended and nobody asks about does not."""
    try:
        return not status_of(pid).get("State", "").startswith("Z")
    except OSError:
        return False


def assert_all_end(pids: list[int]) -> None:
    """See that processes end without being told again."""
    wait_until(lambda: not any(map(is_alive, pids)), "a process outlives the one that started it")


class Server:
    """A ``sketchmatch serve`` process and what it says on standard error.

    It keeps things in a folder of its own, unless the arguments name one.
    """

    def __init__(self, *arguments: str, **options: Any) -> None:
        self.said: list[str] = []
        state = tempfile.mkdtemp(prefix="server-", dir=os.environ.get("XDG_STATE_HOME"))
        own = {"XDG_STATE_HOME": state}
        options["env"] = {**(options.get("env") or os.environ), **own}
        self.process = subprocess.Popen(
            [*COMMAND, "serve", "--address", "127.0.0.1:0", *arguments],
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            **options,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def address(self) -> str:
        return self.wait_for(r"listening on (\S+)")

    def wait_for(self, pattern: str, seconds: float = 120.0) -> str:
        """Wait until the server says something, and return the pattern's last group."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            for line in list(self.said):
                if found := re.search(pattern, line):
                    return found[found.re.groups]
            assert self.process.poll() is None, f"the server ended: {self.said}"
            time.sleep(0.005)
        raise AssertionError(f"the server said no {pattern!r}: {self.said}")

    def end(self, seconds: float = 120.0) -> int:
        """Wait until the process ends and return its exit code."""
        code = self.process.wait(seconds)
        self._reader.join()
        return code

    def _read(self) -> None:
        assert self.process.stderr is not None
        with self.process.stderr as lines:
            self.said.extend(line.rstrip() for line in iter(lines.readline, ""))


class Terminal:
    """A command whose standard error, and standard output if asked, are a terminal."""

    def __init__(
        self, *arguments, stdout: bool = True, columns: int = 140, **environment: str
    ) -> None:
        self._screen, terminal = pty.openpty()
        self.process = subprocess.Popen(
            [*COMMAND, *map(str, arguments)],
            stdin=subprocess.DEVNULL,
            stdout=terminal if stdout else subprocess.PIPE,
            stderr=terminal,
            env={
                **os.environ,
                "TERM": "xterm-256color",
                "COLUMNS": str(columns),
                **environment,
            },
        )
        os.close(terminal)
        self._shown = bytearray()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def shown(self) -> str:
        """All that was written to the screen so far, without colours and cursor movements."""
        return _ESCAPE.sub("", self._shown.decode("utf-8", "replace"))

    def wait_for(self, text: str, seconds: float = 120.0) -> None:
        deadline = time.monotonic() + seconds
        while text not in self.shown:
            assert time.monotonic() < deadline, f"no {text!r} on the screen: {self.shown}"
            assert self.process.poll() is None, f"the command ended: {self.shown}"
            time.sleep(0.005)

    def end(self, seconds: float = 120.0) -> tuple[int, str]:
        """Wait until the process ends and return its exit code and what it piped."""
        piped, _ = self.process.communicate(timeout=seconds)
        self._reader.join(10)
        os.close(self._screen)
        return self.process.returncode, (piped or b"").decode()

    def _read(self) -> None:
        # Reading fails where nobody holds the terminal any more.
        with suppress(OSError):
            while chunk := os.read(self._screen, 65_536):
                self._shown += chunk


@contextmanager
def server(*arguments: str, **options: Any) -> Iterator[Server]:
    """Run a server process until the end of the block; it serves when the block begins."""
    running = Server(*arguments, **options)
    try:
        running.wait_for("serving$")
        yield running
    finally:
        running.process.terminate()
        running.end()
