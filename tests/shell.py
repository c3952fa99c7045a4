"""A clean environment in which the documents' commands run as a reader would type them."""

import os
import re
import shutil
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

from tests.tools import ROOT, require

_END = "\x1eended with "
_CHECKOUT = (
    "engine",
    "plugins",
    "clients",
    "proto",
    "Makefile",
    "constraints.txt",
    "pyproject.toml",
    "README.md",
    "CHANGELOG.md",
    "LICENSE",
    "CONTRIBUTING.md",
)
_BUILT = shutil.ignore_patterns("__pycache__", "node_modules", "target")
NO_INDEX = re.compile("No matching distribution|Could not find a version|connection error", re.I)


@dataclass(frozen=True)
class Step:
    """One command of a document and the lines that it shows; … stands for anything."""

    command: str
    shown: tuple[str, ...]

    def missing_in(self, lines: list[str]) -> str | None:
        """Return a line that is shown in the document and not among these."""
        for line in self.shown:
            pattern = ".*".join(re.escape(part) for part in line.split("…"))
            if not any(re.fullmatch(pattern, said) for said in lines):
                return line
        return None


def steps(console: str) -> list[Step]:
    """Return the steps of a console block."""
    parts = re.split(r"^\$ ", console, flags=re.M)[1:]
    return [Step(first, tuple(rest)) for first, *rest in map(str.splitlines, parts)]


class Shell:
    """One bash that lives from command to command, beside a copy of the checkout."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        _copy_checkout(folder / "sketchmatch")
        self.said: list[str] = []
        self._process = subprocess.Popen(
            ["bash", "--norc"],
            cwd=folder,
            env=_environment(folder),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            encoding="utf-8",
            bufsize=1,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def run(self, command: str, seconds: float = 200.0) -> list[str]:
        """Run a command that must succeed, and return the lines that it says."""
        began = len(self.said)
        self._process.stdin.write(
            f"{{ {command}\n}} </dev/null\nprintf '\\n{_END}%s\\n' $?\n",
        )
        last = self._wait(began, lambda line: line.startswith(_END), seconds, command)
        lines = [line for line in self.said[began:last] if line]
        assert self.said[last] == f"{_END}0", f"{command}\n" + "\n".join(lines)
        return lines

    def follow(self, step: Step, seconds: float = 200.0) -> list[str]:
        """Run a step of a document, and see that it shows what the document shows.

        What runs in the background may say its part a while later.
        """
        began = len(self.said)
        lines = self.run(step.command, seconds)
        deadline = time.monotonic() + 100.0
        while missing := step.missing_in(self.said[began:]):
            said = "\n".join(self.said[began:])
            assert time.monotonic() < deadline, f"{step.command}\ndid not show {missing}\n{said}"
            time.sleep(0.01)
        return lines

    def close(self) -> None:
        self._process.stdin.write("kill $(jobs -p) 2>/dev/null; wait; exit\n")
        self._process.stdin.close()
        self._process.wait(30)
        self._reader.join()
        self._process.stdout.close()

    def _wait(self, began: int, wanted, seconds: float, command: str) -> int:
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            for k in range(began, len(self.said)):
                if wanted(self.said[k]):
                    return k
            assert self._process.poll() is None, f"{command}\nended the shell"
            time.sleep(0.01)
        raise AssertionError(f"{command}\nis not done: {self.said[began:]}")

    def _read(self) -> None:
        self.said.extend(line.rstrip("\n") for line in self._process.stdout)


def install(shell: Shell, block: str) -> None:
    """Follow the block that makes the environment, or do without where there is no index."""
    for step in steps(block):
        try:
            shell.follow(step, 600.0)  # pip builds wheels
        except AssertionError as error:
            require(not NO_INDEX.search(str(error)), "a package index that pip reaches")
            raise


def _copy_checkout(folder: Path) -> None:
    folder.mkdir()
    for name in _CHECKOUT:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=_BUILT)
        else:
            shutil.copy(source, folder / name)


def _environment(folder: Path) -> dict[str, str]:
    """Return the variables that a reader has, with nothing of ours among them."""
    ours = ("PYTHON", "VIRTUAL_ENV", "SKETCHMATCH_", "PYTEST")
    kept = {name: value for name, value in os.environ.items() if not name.startswith(ours)}
    python = Path(getattr(sys, "_base_executable", sys.executable)).parent
    return {
        **kept,
        "PATH": f"{python}{os.pathsep}{os.environ['PATH']}",
        "PIP_CONSTRAINT": str(ROOT / "constraints.txt"),
        "PIP_DISABLE_PIP_VERSION_CHECK": "1",
        "PIP_NO_COMPILE": "1",
        "XDG_CONFIG_HOME": str(folder / "config"),
        "XDG_STATE_HOME": str(folder / "state"),
    }
