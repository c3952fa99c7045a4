"""Records of the experiments, and what is read out of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import mean
from typing import TypeVar

import numpy as np

from tests.experiments.arms import Judged
from tests.experiments.cases import Record
from tests.experiments.intervals import wilson
from tests.experiments.thesis import Row

__all__ = [
    "Results",
    "as_row",
    "chosen",
    "drawn_as_usual",
    "given_probabilities",
    "grouped",
    "interval_by_sketch",
    "right",
    "share",
]

_RESAMPLES = 2000
_Key = TypeVar("_Key")


@dataclass(frozen=True)
class Results:
    """What came of the experiments.

    Attributes
    ----------
    experiments
        Records by title, in the order of the work.
    methods
        The methods compared, in the order of the tables.
    sketches
        How many there were of each scene.
    judged
        Those of the arms, by title.
    """

    experiments: dict[str, list[Record]]
    methods: tuple[str, ...]
    sketches: int
    judged: Mapping[str, list[Judged]] = field(default_factory=dict)

    def __contains__(self, title: str) -> bool:
        return title in self.experiments

    def __getitem__(self, title: str) -> list[Record]:
        return self.experiments[title]


def chosen(
    records: Iterable[Record],
    *,
    place: str | None = None,
    method: str | None = None,
    below: float = math.inf,
    removed: int | None = None,
) -> list[Record]:
    """Return the records of a scene, a method, sketches below a number, an object removed."""
    return [
        record
        for record in records
        if place in (None, record.case.place)
        and method in (None, record.method)
        and record.case.number < below
        and removed in (None, *record.case.removed.sketch)
    ]


def grouped(records: Iterable[Record], key: Callable[[Record], _Key]) -> dict[_Key, list[Record]]:
    """Return the records by key, in the order in which keys come up."""
    groups: dict[_Key, list[Record]] = {}
    for record in records:
        groups.setdefault(key(record), []).append(record)
    return groups


def right(records: Sequence[Record]) -> int:
    """Return how many cases are wholly right."""
    return sum(record.perfect for record in records)


def share(successes: int, tests: int) -> str:
    """Return a share in words with Wilson's 95 % interval, in per cent; a dash for no test.

    Examples
    --------
    >>> share(239, 270)
    '88.5 [84.2, 91.8]'
    """
    if not tests:
        return "–"
    low, high = wilson(successes, tests)
    return f"{100 * successes / tests:.1f} [{100 * low:.1f}, {100 * high:.1f}]"


def drawn_as_usual(title: str) -> bool:
    """Whether an experiment's sketches are those of the study, none of a sweep or traced."""
    return title.startswith(("all objects", "one missing", "several missing", "sketches like"))


def given_probabilities(records: Iterable[Record]) -> list[tuple[float, bool]]:
    """Return the probabilities of answers, where there are any, and whether they were right."""
    return [(r.probability, r.perfect) for r in records if r.probability is not None]


def as_row(records: Sequence[Record]) -> Row | None:
    """Return what the thesis's tables print of cases: mean ζ, mean Ω, objects right; or None."""
    if not records:
        return None
    return Row(
        mean(record.zeta for record in records),
        mean(record.omega for record in records),
        sum(record.right for record in records),
    )


def interval_by_sketch(records: Sequence[Record]) -> tuple[float, float]:
    """Return a 95 % interval of the share wholly right that counts sketches, not cases.

    Cases of one sketch fail together; so sketches are what is drawn again and again (a cluster
    bootstrap with a fixed seed).
    """
    sketches = grouped(records, lambda record: (record.case.place, record.case.number))
    counts = np.array([(right(each), len(each)) for each in sketches.values()])
    rng = np.random.default_rng(0)
    drawn = counts[rng.integers(0, len(counts), (_RESAMPLES, len(counts)))].sum(axis=1)
    low, high = np.percentile(drawn[:, 0] / drawn[:, 1], [2.5, 97.5])
    return float(low), float(high)
