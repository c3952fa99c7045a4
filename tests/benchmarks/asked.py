"""A process of its own that is measured from outside."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

__all__ = ["Asked"]


class Asked:
    """A process that is told lines, and answers each with one.

    Parameters
    ----------
    module
        Whose function ``answer`` it runs.
    first
        What it is told first.
    **variables
        Of its environment, beside those of this process.
    """

    def __init__(self, module: str, first: str, **variables: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", f"import {module} as it; it.answer()"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, **variables},
        )
        self.say(first)

    def __enter__(self) -> Asked:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.stdin.close()  # type: ignore[union-attr]
        self._process.wait()

    def say(self, line: str) -> str:
        """Tell it a line, and return what it answers."""
        pipe: Any = self._process
        pipe.stdin.write(f"{line}\n")
        pipe.stdin.flush()
        return str(pipe.stdout.readline())
