"""Break files for minutes: ``python -m tests.fuzz --minutes 10``, or ``make fuzz MINUTES=10``.

Each kind of file has a process of its own in turn, so that one that dies or hangs is a finding and
not the end. What breaks a rule is saved under ``tests/fuzz/found`` with what happened; the seed of
each run is printed.
"""

import argparse
import hashlib
import itertools
import multiprocessing
import os
import random
import re
import signal
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from tests.fuzz.mutations import mutated
from tests.fuzz.property import KINDS, BrokenError, check, seeds

FOUND = Path(__file__).parent / "found"
_TURN = 10.0
_HANG = 60.0
_MOST_ALIKE = 3


def _work(kind, seed, seconds, segmenting, folder, results):
    """Break files of one kind for some time; report (runs, read, finding)."""

    def hang(*_):
        raise TimeoutError("it took more than 20 s")

    signal.signal(signal.SIGALRM, hang)
    # Decoders in C complain there about every other file.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    rng, originals = random.Random(seed), seeds(kind)
    runs = read = 0
    told = end = time.monotonic()
    end += seconds
    while time.monotonic() < end:
        data = mutated(rng, originals, kind)
        runs += 1
        try:
            read += check(kind, data, folder, segmenting=segmenting)
        except BrokenError as error:
            results.put((runs, read, (data, str(error))))
            runs = read = 0
        if time.monotonic() - told > 1.0:
            results.put((runs, read, None))
            runs, read, told = 0, 0, time.monotonic()
    results.put((runs, read, None))


def _turn(kind, seed, seconds, segmenting, counts, findings):
    """Run one process to its end, or until it hangs."""
    results = multiprocessing.get_context("fork").Queue()
    with tempfile.TemporaryDirectory() as folder:
        arguments = (kind, seed, seconds, segmenting, Path(folder), results)
        process = multiprocessing.get_context("fork").Process(target=_work, args=arguments)
        process.start()
        heard = time.monotonic()
        while process.is_alive() or not results.empty():
            if not results.empty():
                runs, read, finding = results.get()
                counts[kind][0] += runs
                counts[kind][1] += read
                heard = time.monotonic()
                if finding:
                    _save(kind, *finding, findings)
            elif time.monotonic() - heard > _HANG:
                process.kill()
                _save(kind, (Path(folder) / f"input.{kind}").read_bytes(), "it hangs", findings)
                break
            else:
                time.sleep(0.02)
        process.join()
        if process.exitcode not in (0, -signal.SIGKILL):
            died = f"the process ended with {process.exitcode}"
            _save(kind, (Path(folder) / f"input.{kind}").read_bytes(), died, findings)


def _save(kind, data, what, findings):
    same = re.sub(r"\d+", "", what)[:100]
    findings[kind][same] += 1
    if findings[kind][same] > _MOST_ALIKE:
        return
    FOUND.mkdir(exist_ok=True)
    path = FOUND / f"{hashlib.sha256(data).hexdigest()[:12]}.{kind}"
    path.write_bytes(data)
    path.with_name(f"{path.name}.txt").write_text(f"{what}\n", "utf-8")
    print(f"\n{path}: {what}", flush=True)


def main() -> int:
    """Fuzz all kinds in turn, or those named, and return 1 if anything was found."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz")
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=time.time_ns() % 10**9)
    parser.add_argument("--reading-only", action="store_true", help="find no objects")
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=" ".join(KINDS))
    chosen = parser.parse_args()
    kinds = chosen.kinds or list(KINDS)
    print(f"{chosen.minutes:g} minutes, seed {chosen.seed}", flush=True)
    counts, findings = {kind: [0, 0] for kind in kinds}, {kind: Counter() for kind in kinds}
    began = time.monotonic()
    end = began + 60.0 * chosen.minutes
    for turn in itertools.count():
        left = end - time.monotonic()
        if left <= 0:
            break
        kind = kinds[turn % len(kinds)]
        seconds, segmenting = min(_TURN, left), not chosen.reading_only
        _turn(kind, f"{chosen.seed}-{turn}", seconds, segmenting, counts, findings)
        runs = sum(count for count, _ in counts.values())
        spent = time.monotonic() - began
        print(
            f"{spent / 60:5.1f} min  {runs} files, {runs / spent:.0f} a second, "
            f"{sum(found.total() for found in findings.values())} findings",
            flush=True,
        )
    for kind, (runs, read) in counts.items():
        print(f"{kind:8} {runs:8} files, {read} of them of use, {findings[kind].total()} findings")
    return 1 if any(findings.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
