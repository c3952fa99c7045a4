"""What the engine knows of right and wrong maps, learned from sketches that no table is made of.

Run it with ``python -m tests.experiments.learn``; it takes about half an hour and writes
``learned.json`` beside this file, from which the numbers of
:mod:`sketchmatch_builtin.judges.calibration` are copied and the report tells how they were chosen:

- ``weights`` of ζ, and by cross-validation whether objects are compared and how much distance
  counts;
- ``odds``: price, and what makes probabilities of ζ;
- and how well these probabilities hold on yet other sketches.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TypeVar

from tests.experiments.odds import considered_by, errors, learned_odds
from tests.experiments.runs import each_of
from tests.experiments.weights import FOLDS, learned_weights, parts_of

__all__ = ["LEARNED", "SKETCHES", "THESIS"]

LEARNED = Path(__file__).with_name("learned.json")
"""What came of it."""

SKETCHES = {"weights": 1800, "odds": 600, "check": 600}

THESIS = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
"""The weights of the thesis, for which price and probabilities are learned as well."""

# With which maps are looked for that leave objects out, before prices are learned; near these.
_FIRST_PRICES = {"thesis": 0.35, "learned": 0.1}

_Case = TypeVar("_Case")


def main() -> None:
    """Learn, print and write."""
    held, weights = learned_weights(_all_of(parts_of, "weights"))
    for each in held:
        print(f"{each.compared}, distance^{each.distance:g}, penalty {each.penalty:g}: ", end="")
        print(f"loss {each.loss:.4f} ± {each.error:.4f}, right {each.right:.1%}")
    print("weights:", weights)
    odds = {}
    for name, each in (("thesis", THESIS), ("learned", weights)):
        known, others = (
            _all_of(partial(considered_by, each, _FIRST_PRICES[name], part), part)
            for part in ("odds", "check")
        )
        calibration = learned_odds(known)
        odds[name] = asdict(calibration) | {"errors": errors(others, calibration)}
        print(name, odds[name])
    found = {
        "sketches": SKETCHES,
        "folds": FOLDS,
        "held": [asdict(each) for each in held],
        "weights": weights,
        "odds": odds,
    }
    text = json.dumps(found, indent=1, ensure_ascii=False)
    LEARNED.write_text(text + "\n", encoding="utf-8")


def _all_of(do: Callable[[int], list[_Case]], part: str) -> list[_Case]:
    """Return what is done with each sketch of a part, showing progress."""
    every = each_of(do, range(SKETCHES[part]), f"sketches for {part}")
    return list(itertools.chain.from_iterable(every))


if __name__ == "__main__":
    main()
