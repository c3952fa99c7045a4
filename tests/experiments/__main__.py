"""The thesis's experiments: ``python -m tests.experiments`` runs them and writes a report."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from tests.experiments.arms import ARMS
from tests.experiments.cases import Record
from tests.experiments.document import save
from tests.experiments.judging import arm_works
from tests.experiments.methods import METHODS
from tests.experiments.protocol import PARTS, SKETCHES, experiments, times
from tests.experiments.records import Results
from tests.experiments.report import report
from tests.experiments.runs import PROCESSES, run_all

METHODS_COMPARED = ("fsnn-pso", "easm", "auto", "default")

_TIMES = "times"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the experiments and write the report."""
    options = _options(arguments)
    started = time.perf_counter()
    parts = options.only or (*PARTS, *ARMS, _TIMES)
    records, arms = _records(options, parts), [part for part in parts if part in ARMS]
    judged = run_all(
        arm_works(options.methods, options.sketches, arms), processes=options.processes
    )
    results = Results(records, options.methods, options.sketches, judged)
    save(options.out, report(results))
    seconds = time.perf_counter() - started
    print(f"{options.out / 'report.html'} and {options.out / 'report.md'}: {seconds:.0f} s")


def _records(options: argparse.Namespace, parts: Sequence[str]) -> dict[str, list[Record]]:
    wanted = [part for part in parts if part in PARTS]
    records: dict[str, list[Record]] = {}
    if wanted:
        works = experiments(options.methods, options.sketches, wanted)
        records |= run_all(works, processes=options.processes)
    if _TIMES in parts:
        records |= run_all(times(options.sketches), processes=1)
    return records


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tests.experiments", description=(__doc__ or "").partition(": ")[0]
    )
    known = (*PARTS, *ARMS, _TIMES)
    parser.add_argument("--sketches", type=int, default=SKETCHES, help="of each scene and arm")
    parser.add_argument("--only", type=_listed, default=(), help=f"some of {','.join(known)}")
    parser.add_argument(
        "--methods",
        type=_listed,
        default=METHODS_COMPARED,
        help=f"some of {','.join(METHODS)}",
    )
    parser.add_argument("--out", type=Path, default=Path("experiments-report"), help="a folder")
    parser.add_argument("--processes", type=int, default=PROCESSES)
    options = parser.parse_args(arguments)
    for given, names, what in (
        (options.methods, METHODS, "method"),
        (options.only, known, "experiment"),
    ):
        if unknown := [name for name in given if name not in names]:
            parser.error(f"no {what} is called {', '.join(unknown)}; there are {', '.join(names)}")
    if options.sketches < 1 or options.processes < 1:
        parser.error("--sketches and --processes must be 1 or more")
    try:
        options.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        parser.error(
            f"--out {options.out} cannot be made ({error.strerror}); choose another folder"
        )
    return options


def _listed(text: str) -> tuple[str, ...]:
    return tuple(text.split(","))


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit("stopped; there is no report")
