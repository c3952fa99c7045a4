"""What the engine knows of right and wrong maps, learned from sketches that no table is made of.

Run it with ``python -m tests.experiments.learn``; it takes an hour or more and
16 GB of memory, and writes ``learned.json`` beside this file, from which the numbers of
:mod:`sketchmatch_builtin.judges.calibration` are copied and the report tells how they were chosen,
and ``posterior.json`` beside that module:

- ``odds``: price, and what makes probabilities of the thesis's ζ, which the judge ``confidence``
  has;
- ``posterior``: what evidence counts for with the judge ``posterior``, by
  :mod:`tests.experiments.posterior`, from sketches of many kinds of places and people;
- and how well the probabilities of both hold on yet other sketches.

``--sketches 50`` learns from so many of each kind, to try it, and ``--into`` writes into another
folder. ``--only posterior`` leaves what is known of the other as it is. ``--kept`` names a folder
for the sketches in numbers: who was interrupted goes on there.
"""

from __future__ import annotations

import argparse
import itertools
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from sketchmatch_builtin.judges import calibration
from tests.experiments.anyones import anyones_drawing
from tests.experiments.drawings import Drawing
from tests.experiments.floors import floor_drawing
from tests.experiments.odds import considered_by, errors, learned_odds
from tests.experiments.posterior import (
    Known,
    judged_errors,
    known_sketches,
    learned_posterior,
    posterior_text,
)
from tests.experiments.runs import each_of
from tests.experiments.strangers import stranger_drawing
from tests.experiments.training import hall_drawing, inventive_drawing, training_drawing

__all__ = ["LEARNED", "SKETCHES", "THESIS"]

LEARNED = Path(__file__).with_name("learned.json")
"""What came of it."""

JUDGE = Path(calibration.__file__).with_name("posterior.json")
"""What the judge goes by."""

SKETCHES = {
    "odds": 600,
    "check": 600,
    "training": 13000,
    "many": 300,
    "halls": 2300,
    "floors": 5000,
    "inventive": 1500,
    "anything": 1500,
    "anyones": 16000,
    "exchanged": 5600,
    "strangers": 1600,
    "checked": 1200,
}
"""How many there are. ``checked`` are further ``strangers``, by which were chosen the networks'
width and decay, the number of ``exchanged``, what other places count for, and how many maps are
learned from."""

_KINDS: dict[str, Callable[[int], Drawing]] = {
    "training": training_drawing,
    "many": partial(training_drawing, many=True),
    "halls": hall_drawing,
    "floors": floor_drawing,
    "inventive": inventive_drawing,
    "anything": partial(inventive_drawing, anything=True),
    "anyones": anyones_drawing,
    "exchanged": partial(anyones_drawing, exchanged=True),
    "strangers": stranger_drawing,
}

_OF_ODDS = {"odds", "check"}
"""What the odds are learned from, and checked with."""

_AT_ONCE = 200

THESIS = (1.0, 1.0, 1.0)
"""The weights of the thesis."""

# With which maps are looked for that leave objects out, before it is learned; near it.
_FIRST_PRICE = 0.35

_Case = TypeVar("_Case")


def main(arguments: Sequence[str] | None = None) -> None:
    """Learn, print and write."""
    parser = argparse.ArgumentParser("python -m tests.experiments.learn")
    parser.add_argument("--sketches", type=int, help="at most so many of each kind")
    parser.add_argument("--into", type=Path, help="a folder for both files")
    parser.add_argument("--only", choices=("odds", "posterior"), help="one of the two")
    parser.add_argument("--kept", type=Path, help="a folder for sketches in numbers")
    given = parser.parse_args(arguments)
    counts = {part: min(most, given.sketches or most) for part, most in SKETCHES.items()}
    learned, judge = (given.into / path.name if given.into else path for path in (LEARNED, JUDGE))
    every = json.loads(LEARNED.read_text(encoding="utf-8"))
    known = every["sketches"]
    every["sketches"] = {
        part: known[part] if given.only and (part in _OF_ODDS) != (given.only == "odds") else count
        for part, count in counts.items()
    }
    if given.only != "posterior":
        every["odds"] = _odds(counts)
    if given.only != "odds":
        text, found = _posterior(counts, given.kept)
        judge.write_text(text, encoding="utf-8")
        every["posterior"] = {"errors": found}
    learned.write_text(json.dumps(every, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _odds(counts: dict[str, int]) -> dict[str, Any]:
    known, others = (
        _all_of(partial(considered_by, THESIS, _FIRST_PRICE, part), part, counts[part])
        for part in ("odds", "check")
    )
    learned = learned_odds(known)
    found = asdict(learned) | {"errors": errors(others, learned)}
    print(found)
    return found


def _posterior(counts: dict[str, int], kept: Path | None) -> tuple[str, dict[str, float]]:
    """Return what was learned, and its errors."""
    of = {kind: _known(kind, range(counts[kind]), kept) for kind in _KINDS}
    strangers, others = of.pop("strangers"), counts["strangers"]
    learned = learned_posterior([each for known in of.values() for each in known], strangers)
    checked = _known("strangers", range(others, others + counts["checked"]), kept)
    found = judged_errors(checked, learned)
    print(found)
    return posterior_text(learned), found


def _known(kind: str, numbers: range, kept: Path | None) -> list[Known]:
    """Return sketches in numbers, showing progress."""
    parts = [numbers[k : k + _AT_ONCE] for k in range(0, len(numbers), _AT_ONCE)]
    title = f"{kind}, {_AT_ONCE} at once"
    return list(itertools.chain.from_iterable(each_of(partial(_some, kind, kept), parts, title)))


def _some(kind: str, kept: Path | None, numbers: range) -> list[Known]:
    return known_sketches(kind, _KINDS[kind], numbers, kept)


def _all_of(do: Callable[[int], list[_Case]], part: str, count: int) -> list[_Case]:
    """Return what is done with each sketch of a part, showing progress."""
    every = each_of(do, range(count), f"sketches for {part}")
    return list(itertools.chain.from_iterable(every))


if __name__ == "__main__":
    main()
