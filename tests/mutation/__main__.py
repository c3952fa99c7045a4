"""Which small changes no test notices: ``python -m tests.mutation``, or ``make mutation``.

Of each group of modules a sample is tried, the same each time: ``--sample 60``. Once tests are
written for its survivors, its share says little, and another sample more: ``--seed 2``. What came
of each mutant is kept in ``mutation-results.jsonl``, so that a run that was stopped goes on; a
mutant is tried again once its module or a test of it has changed. Searchers are first put to their
quick tests, with nothing compiled, and to whole searches only where those find nothing: ``--quick``
leaves these out, a minute or more a mutant.
"""

from __future__ import annotations

import argparse
import hashlib
import itertools
import json
import queue
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from fnmatch import fnmatch
from pathlib import Path

from tests.mutation.modules import EQUIVALENT, Module, modules
from tests.mutation.mutants import Mutant, mutants
from tests.mutation.trial import LATE, Copy
from tests.tools import ROOT

RESULTS = ROOT / "mutation-results.jsonl"
_GOAL = 0.85

Case = tuple[Module, Mutant]


def sample(group: list[Module], size: int, equivalent: set[str], seed: str = "") -> list[Case]:
    """Return some mutants of modules, the same ones for each seed, and none of the equivalent."""
    cases = [(each, mutant) for each in group for mutant in mutants(each.path, each.source)]
    cases.sort(key=lambda case: case[1].rank(seed))
    tried = (
        (module, mutant)
        for module, mutant in cases
        if mutant.name not in equivalent and mutant.compiles(module.source)
    )
    return sorted(
        itertools.islice(tried, size),
        key=lambda case: (case[0].path, case[1].line, case[1].rank()),
    )


def read_equivalent() -> dict[str, str]:
    """Return the names of mutants that change no result, with the reason for each."""
    listed = tomllib.loads(EQUIVALENT.read_text(encoding="utf-8"))
    return {
        f"{path}: {mutant['change']}": mutant["why"]
        for path, entries in listed.items()
        for mutant in entries
    }


def _key(module: Module, mutant: Mutant) -> str:
    """Return what stays the same while neither a module nor its tests change."""
    texts = [(ROOT / path).read_text(encoding="utf-8") for path in (module.path, *module.tests)]
    return hashlib.sha256("\0".join([mutant.name, *texts]).encode()).hexdigest()


def _known(survivors_again: bool) -> Iterator[tuple[str, str | None]]:
    """Yield what killed earlier mutants, by key; by name too where only survivors count."""
    for line in RESULTS.read_text(encoding="utf-8").splitlines() if RESULTS.exists() else ():
        result = json.loads(line)
        if not survivors_again:
            yield result["key"], result["by"]
        elif result["by"]:
            yield result["name"], result["by"]


def _try_all(
    cases: list[Case], jobs: int, known: dict[str, str | None], quick: bool
) -> dict[str, str | None]:
    """Return of each mutant, by name, which test killed it."""
    keys = {mutant.name: _key(module, mutant) for module, mutant in cases}
    killers = {
        name: known[each] for name, key in keys.items() for each in (name, key) if each in known
    }
    left = [(module, mutant) for module, mutant in cases if mutant.name not in killers]
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(jobs) as pool:
        copies = queue.SimpleQueue[Copy]()
        for k in range(jobs if left else 0):
            copies.put(Copy(Path(folder) / str(k)))

        def attempt(module: Module, mutant: Mutant) -> str | None:
            copy = copies.get()
            try:
                rounds = module.interpreted[: 1 if quick else None]
                return copy.killer(module, mutant.applied(module.source), rounds)
            finally:
                copies.put(copy)

        futures = {pool.submit(attempt, *case): case for case in left}
        try:
            for count, future in enumerate(as_completed(futures), 1):
                name = futures[future][1].name
                killer = killers[name] = future.result()
                line = {"key": keys[name], "name": name, "by": killer}
                if killer or not quick:
                    with RESULTS.open("a", encoding="utf-8") as file:
                        print(json.dumps(line, ensure_ascii=False), file=file)
                word = f"killed by {killer}:" if killer else "SURVIVED"
                print(f"{count}/{len(left)} {word} {name}", flush=True)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return killers


def _report(group: str, cases: list[Case], killers: dict[str, str | None]) -> float:
    """Print the share that was killed, by file, and what survived; return the share."""
    shares = []
    for path, some in itertools.groupby(cases, key=lambda case: case[0].path):
        found = [killers[mutant.name] is not None for _, mutant in some]
        shares.append((path, sum(found), len(found)))
    total, size = sum(share[1] for share in shares), len(cases)
    late = sum((killers[mutant.name] or "").endswith(LATE) for _, mutant in cases)
    share = total / max(1, size)
    print(f"\n{group}: {total} of {size} killed, {share:.0%}, {late} of them out of time")
    for path, count, tried in shares:
        print(f"  {count:3} of {tried:3}  {path}")
    for module, mutant in cases:
        if not killers[mutant.name]:
            print(f"{module.path}:{mutant.line}: {mutant.before} → {mutant.after}")
    return share


def main() -> int:
    """Try mutants of the groups named, or of all, and return 1 if fewer than 85 % were killed."""
    chosen_modules = modules()
    groups = list(dict.fromkeys(module.group for module in chosen_modules))
    parser = argparse.ArgumentParser(prog="python -m tests.mutation")
    parser.add_argument("--sample", type=int, default=60, help="mutants of each group")
    parser.add_argument("--seed", default="", help="another sample for each")
    parser.add_argument("--only", default="*", help="of files like this, e.g. '*/alignment.py'")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--fresh", action="store_true", help="forget what came of earlier runs")
    parser.add_argument("--survivors", action="store_true", help="trust what was killed before")
    parser.add_argument(
        "--quick", action="store_true", help="one round; what survives it is not kept"
    )
    parser.add_argument("groups", nargs="*", metavar="GROUP", help=" ".join(groups))
    chosen = parser.parse_args()
    if chosen.fresh:
        RESULTS.unlink(missing_ok=True)
    equivalent = set(read_equivalent())
    shares = {}
    for group in chosen.groups or groups:
        some = [m for m in chosen_modules if m.group == group and fnmatch(m.path, chosen.only)]
        cases = sample(some, chosen.sample, equivalent, chosen.seed)
        killers = _try_all(cases, chosen.jobs, dict(_known(chosen.survivors)), chosen.quick)
        if cases:
            shares[group] = _report(group, cases, killers)
    return 1 if min(shares.values(), default=1.0) < _GOAL else 0


if __name__ == "__main__":
    sys.exit(main())
