"""How long the program and the package take to start, in new processes, with warm file caches.

Run it with ``make bench-startup``. Every row is measured in the same run, as median, minimum and
maximum; it ends with an error if a median is above its limit.
"""

from __future__ import annotations

import subprocess
import sys
import time
from statistics import median

from rich.console import Console
from rich.table import Table

_REPEATS = 9
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


def main() -> int:
    """Measure, print, and return 1 if a limit is exceeded."""
    table = Table(title=f"seconds to start, of {_REPEATS} times", title_justify="left")
    table.add_column("start")
    for column in ("median", "min", "max", "limit"):
        table.add_column(column, justify="right")
    exceeded = False
    for name, (command, limit) in _STARTS.items():
        times = _times(command)
        late = limit is not None and median(times) > limit
        exceeded = exceeded or late
        figures = (f"{value:.3f}" for value in (median(times), min(times), max(times)))
        table.add_row(
            name,
            *figures,
            "" if limit is None else f"{limit:.1f}",
            style="bold red" if late else "",
        )
    Console().print(table)
    return int(exceeded)


def _times(command: list[str]) -> list[float]:
    """Return the seconds of each of several runs, after one that does not count."""
    seconds = []
    for _ in range(_REPEATS + 1):
        started = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        seconds.append(time.perf_counter() - started)
    return seconds[1:]


if __name__ == "__main__":
    sys.exit(main())
