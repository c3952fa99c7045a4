"""How long the program and the package take to start, in new processes, with warm file caches.

Run it with ``make bench-startup``. Every row is measured in the same run, as median, minimum and
maximum; it ends with an error if a median is above its limit. The last row is a first-ever demo,
whose kernels are compiled each time: it takes a few minutes.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.table import Table

_REPEATS = 9
_COMPILATIONS = 3
_PYTHON = [sys.executable, "-c"]
_PROGRAM = [sys.executable, "-m", "sketchmatch"]
_STARTS: dict[str, tuple[list[str], float | None]] = {
    "python -c pass": ([*_PYTHON, "pass"], None),
    "import sketchmatch": ([*_PYTHON, "import sketchmatch"], 0.7),
    "from sketchmatch import Scene": ([*_PYTHON, "from sketchmatch import Scene"], 0.7),
    "from sketchmatch import match": ([*_PYTHON, "from sketchmatch import match"], None),
    "sketchmatch --version": ([*_PROGRAM, "--version"], 0.5),
    "sketchmatch --help": ([*_PROGRAM, "--help"], 0.5),
    "sketchmatch match --help": ([*_PROGRAM, "match", "--help"], 0.5),
    "sketchmatch plugins list": ([*_PROGRAM, "plugins", "list"], None),
}
"""What is started, and within how many seconds, if that is promised."""
_DEMO = [*_PROGRAM, "demo", "--overlay"]
_DEMO_LIMIT, _FIRST_DEMO_LIMIT = 4.0, 40.0


def main() -> int:
    """Measure, print, and return 1 if a limit is exceeded."""
    table = Table(title="seconds to start", title_justify="left")
    table.add_column("start")
    for column in ("times", "median", "min", "max", "limit"):
        table.add_column(column, justify="right")
    exceeded = False
    rows = [(name, _times(command), limit) for name, (command, limit) in _STARTS.items()]
    with TemporaryDirectory() as folder:
        demo = [*_DEMO, str(Path(folder, "demo.png"))]
        rows.append(("sketchmatch demo", _times(demo), _DEMO_LIMIT))
        first = [_first(demo, Path(folder, str(k))) for k in range(_COMPILATIONS)]
        rows.append(("sketchmatch demo, nothing compiled", first, _FIRST_DEMO_LIMIT))
    for name, times, limit in rows:
        late = limit is not None and median(times) > limit
        exceeded = exceeded or late
        figures = (f"{value:.3f}" for value in (median(times), min(times), max(times)))
        table.add_row(
            name,
            str(len(times)),
            *figures,
            "" if limit is None else f"{limit:.1f}",
            style="bold red" if late else "",
        )
    Console().print(table)
    return int(exceeded)


def _times(command: list[str]) -> list[float]:
    """Return the seconds of each of several runs, after one that does not count."""
    return [_seconds(command, {}) for _ in range(_REPEATS + 1)][1:]


def _first(command: list[str], cache: Path) -> float:
    """Return the seconds of a run that finds no machine code."""
    return _seconds(command, {"NUMBA_CACHE_DIR": str(cache)})


def _seconds(command: list[str], environment: dict[str, str]) -> float:
    started = time.perf_counter()
    subprocess.run(
        command,
        check=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **environment},
    )
    return time.perf_counter() - started


if __name__ == "__main__":
    sys.exit(main())
