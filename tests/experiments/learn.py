"""What the engine knows of right and wrong maps, learned from sketches that no table is made of.

Run it with ``python -m tests.experiments.learn``; it takes some minutes and writes
``learned.json`` beside this file, from which the numbers of
:mod:`sketchmatch_builtin.judges.calibration` are copied and the report tells how they were chosen,
and ``posterior.json`` beside that module:

- ``odds``: price, and what makes probabilities of the thesis's ζ, which the judge ``confidence``
  has;
- ``posterior``: what evidence counts for with the judge ``posterior``, by
  :mod:`tests.experiments.posterior`: first of places and maps, from few numbers of each line, then
  of maps alone, from more of them and from more sketches of other kinds;
- and how well the probabilities of both hold on yet other sketches.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from sketchmatch_builtin.judges import calibration
from tests.experiments.drawings import Drawing
from tests.experiments.odds import considered_by, errors, learned_odds
from tests.experiments.posterior import (
    Known,
    gone_on,
    judged_errors,
    known_of,
    learned_posterior,
    posterior_text,
)
from tests.experiments.runs import each_of
from tests.experiments.training import hall_drawing, inventive_drawing, training_drawing

__all__ = ["LEARNED", "SKETCHES", "THESIS"]

LEARNED = Path(__file__).with_name("learned.json")
"""What came of it."""

JUDGE = Path(calibration.__file__).with_name("posterior.json")
"""What the judge goes by."""

SKETCHES = {
    "odds": 600,
    "check": 600,
    "posterior": 13000,
    "many": 300,
    "again": 1200,
    "halls": 2300,
    "inventive": 1500,
    "anything": 1500,
}
"""How many there are; from ``again``, the first ones of ``posterior``, on it goes on with maps."""

_FEWEST = 4
"""How many objects a sketch has at least that is gone on with."""

CHECKED = 1000
"""Sketches beyond those for ``posterior`` that its probabilities are checked with."""

THESIS = (1.0, 1.0, 1.0)
"""The weights of the thesis."""

# With which maps are looked for that leave objects out, before it is learned; near it.
_FIRST_PRICE = 0.35

_Case = TypeVar("_Case")


def main() -> None:
    """Learn, print and write."""
    found = {"sketches": SKETCHES, "odds": _odds(), "posterior": _posterior()}
    text = json.dumps(found, indent=1, ensure_ascii=False)
    LEARNED.write_text(text + "\n", encoding="utf-8")


def _odds() -> dict[str, Any]:
    known, others = (
        _all_of(partial(considered_by, THESIS, _FIRST_PRICE, part), part)
        for part in ("odds", "check")
    )
    learned = learned_odds(known)
    found = asdict(learned) | {"errors": errors(others, learned)}
    print(found)
    return found


def _posterior() -> dict[str, Any]:
    few, many = SKETCHES["posterior"], SKETCHES["many"]
    lavish = partial(training_drawing, many=True)
    first = learned_posterior(_known(range(few)) + _known(range(many), lavish))
    learned = gone_on(first, further())
    JUDGE.write_text(posterior_text(learned), encoding="utf-8")
    found = judged_errors(_known(range(few, few + CHECKED)), learned)
    print(found)
    return {"errors": found}


def further() -> list[Known]:
    """Return the sketches that are gone on with: of this place, and of enough to tell something."""
    kinds: dict[str, Callable[[int], Drawing]] = {
        "again": training_drawing,
        "halls": hall_drawing,
        "inventive": inventive_drawing,
        "anything": partial(inventive_drawing, anything=True),
    }
    every = [each for kind, draw in kinds.items() for each in _known(range(SKETCHES[kind]), draw)]
    return [each for each in every if not each.elsewhere and len(each.truth) >= _FEWEST]


def _known(numbers: range, draw: Callable[[int], Drawing] = training_drawing) -> list[Known]:
    """Return sketches in numbers, showing progress."""
    every = each_of(partial(known_of, draw=draw), numbers, "sketches for posterior")
    return list(itertools.chain.from_iterable(every))


def _all_of(do: Callable[[int], list[_Case]], part: str) -> list[_Case]:
    """Return what is done with each sketch of a part, showing progress."""
    every = each_of(do, range(SKETCHES[part]), f"sketches for {part}")
    return list(itertools.chain.from_iterable(every))


if __name__ == "__main__":
    main()
