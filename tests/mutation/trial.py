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
_LEAST_SECONDS = {True: 30.0, False: 300.0}
_PATIENCE = 5.0


class Copy:
    """A copy of the repository where one file at a time is changed."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._limits: dict[Module, float] = {}
        ignored = shutil.ignore_patterns("__pycache__", ".hypothesis", "found", "node_modules")
        for name in _COPIED:
            source, target = ROOT / name, folder / name
            if source.is_dir():
                shutil.copytree(source, target, ignore=ignored)
            elif source.exists():
                shutil.copy2(source, target)

    def kills(self, module: Module, text: str) -> bool:
        """Return whether a test fails, or hangs, where a module has another text.

        Raises
        ------
        RuntimeError
            If a test fails without any change.
        """
        if module not in self._limits:
            began = time.monotonic()
            if self._fails(module, None, writes_bytecode=True):
                raise RuntimeError(f"a test of {module.path} fails without any change")
            self._limits[module] = max(
                _LEAST_SECONDS[module.interpreted], _PATIENCE * (time.monotonic() - began)
            )
        file = self.folder / module.path
        original, times = file.read_bytes(), file.stat()
        try:
            file.write_text(text, encoding="utf-8")
            return self._fails(module, self._limits[module])
        finally:
            # With its old time its bytecode, which the first run wrote, is valid again.
            file.write_bytes(original)
            os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))

    def _fails(self, module: Module, limit: float | None, writes_bytecode: bool = False) -> bool:
        paths = os.pathsep.join(str(self.folder / source) for source in _SOURCES)
        environment = {
            **os.environ,
            "PYTHONPATH": paths,
            "NUMBA_DISABLE_JIT": "1" if module.interpreted else "0",
            "NUMBA_CACHE_DIR": str(self.folder / "compiled"),
        }
        options = ["-x", "-q", "-p", "no:cacheprovider", "-p", "tests.mutation.quick"]
        bytecode = [] if writes_bytecode else ["-B"]
        process = subprocess.Popen(
            [sys.executable, *bytecode, "-m", "pytest", *options, *module.tests],
            cwd=self.folder,
            env=environment,
            start_new_session=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            return process.wait(limit) != 0
        except subprocess.TimeoutExpired:
            return True
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
