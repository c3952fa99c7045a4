"""Running the tests of a module against one mutant of it, in a copy of the repository."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

from tests.mutation.modules import Module
from tests.tools import ROOT

_COPIED = ("engine", "plugins", "clients", "proto", "tests", "pyproject.toml", "README.md")
_SOURCES = ("engine", "plugins", "plugins/sketchmatch-example-searcher/src", "clients/python", ".")
_LEAST_SECONDS = 900.0  # by the clock, as nothing that waits uses the processor
_PATIENCE = 10.0
LATE = " (out of time)"
"""What follows the name of a test that a mutant did not fail, but held up."""


class Copy:
    """A copy of the repository where one file at a time is changed."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._limits: dict[Path, float] = {}
        ignored = shutil.ignore_patterns("__pycache__", ".hypothesis", "found", "node_modules")
        for name in _COPIED:
            source, target = ROOT / name, folder / name
            if source.is_dir():
                shutil.copytree(source, target, ignore=ignored)
            elif source.exists():
                shutil.copy2(source, target)

    def killer(
        self, module: Module, text: str, rounds: tuple[bool, ...] | None = None
    ) -> str | None:
        """Return the test that fails where a module has another text; None if all pass.

        One that goes on for far longer than it did has ``LATE`` after its name.

        Parameters
        ----------
        module, text
            What is changed, and into what.
        rounds
            Of each round whether kernels are interpreted; all of the module's where it is left out.

        Raises
        ------
        RuntimeError
            If a test fails without any change.
        """
        before: list[Path] = []
        for interpreted in rounds or module.interpreted:
            name = "-".join((str(interpreted), *(Path(path).stem for path in module.tests)))
            times = [self.folder / f"{name}.json", *before]
            self._measure(module, interpreted, times)
            last = times[0].with_suffix(".last")
            last.unlink(missing_ok=True)
            if status := self._fails_with(module, text, interpreted, times):
                which = last.read_text(encoding="utf-8") if last.exists() else "at import"
                return f"{which}{LATE if status in _LATE else ''}"
            before.append(times[0])
        return None

    def _measure(self, module: Module, interpreted: bool, times: list[Path]) -> None:
        """Find out how long each test of a module takes without any change, unless it is known."""
        if times[0] in self._limits:
            return
        began = time.monotonic()
        failed = self._fails(module, interpreted, times, None, writes_bytecode=True)
        self._limits[times[0]] = max(_LEAST_SECONDS, _PATIENCE * (time.monotonic() - began))
        # Interpreted, a test may fail that is about time, and does not take part then. In another
        # order all must pass as well.
        if (failed and not interpreted) or self._fails(module, interpreted, times, None):
            last = times[0].with_suffix(".last")
            which = last.read_text(encoding="utf-8") if last.exists() else "a test"
            raise RuntimeError(f"{which} of {module.path} fails without any change")

    def _fails_with(self, module: Module, text: str, interpreted: bool, times: list[Path]) -> int:
        file = self.folder / module.path
        original, status = file.read_bytes(), file.stat()
        try:
            file.write_text(text, encoding="utf-8")
            return self._fails(module, interpreted, times, self._limits[times[0]])
        finally:
            # With its old time its bytecode, which the first run wrote, is valid again.
            file.write_bytes(original)
            os.utime(file, ns=(status.st_atime_ns, status.st_mtime_ns))

    def _fails(
        self,
        module: Module,
        interpreted: bool,
        times: list[Path],
        limit: float | None,
        writes_bytecode: bool = False,
    ) -> int:
        """Return what pytest ends with; 0 where all tests passed, or none was left to run."""
        paths = os.pathsep.join(str(self.folder / source) for source in _SOURCES)
        environment = {
            **os.environ,
            "PYTHONPATH": paths,
            "NUMBA_DISABLE_JIT": "1" if interpreted else "0",
            "NUMBA_CACHE_DIR": str(self.folder / "compiled"),
            "MUTATION_TIMES": os.pathsep.join(map(str, times)),
        }
        options = ["-q", "-p", "no:cacheprovider", "-p", "tests.mutation.quick"]
        bytecode = [] if writes_bytecode else ["-B", "-x"]
        process = subprocess.Popen(
            [sys.executable, *bytecode[:1], "-m", "pytest", *bytecode[1:], *options, *module.tests],
            cwd=self.folder,
            env=environment,
            start_new_session=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            status = process.wait(limit)
        except subprocess.TimeoutExpired:
            return -signal.SIGKILL
        else:
            return 0 if status == _NONE_LEFT else status
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


_NONE_LEFT = 5
_LATE = (-signal.SIGKILL, -signal.SIGPROF)
