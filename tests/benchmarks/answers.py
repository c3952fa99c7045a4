"""What comes of whole matches of sketches as people draw them: of parts, with extras, of elsewhere.

The judged answers, beside those of methods of others that align. ``make bench-searchers`` prints
them below its table of searches.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import mean
from typing import Any

import numpy as np
from rich.table import Table

from sketchmatch import match
from tests.benchmarks.aligners import ALIGNERS, Aligner
from tests.experiments.drawings import Drawing
from tests.experiments.generators import KINDS, sample

__all__ = ["CASES", "DEFAULT", "NOTES", "Answer", "Case", "answers", "answers_table"]

DEFAULT = "default"


@dataclass(frozen=True, eq=False)
class Case:
    """One kind of sketch: its name, and what the generators are asked for."""

    name: str
    options: Mapping[str, Any]


CASES = (
    Case("8 in 20", {"objects": 20}),
    Case("8 in 36", {"objects": 36}),
    Case("8 in 60", {"objects": 60}),
    Case("7 and an extra on 8", {"objects": 8, "missing": 1, "extra": 1}),
    Case("7 and an extra on 20", {"objects": 20, "missing": 1, "extra": 1}),
    Case("8 of another place, 20", {"objects": 20, "wrong_place": True}),
)

NOTES = "\n".join(
    (
        "Sketches of 8 neighbours on a map, by the generators of tests/experiments that nothing is "
        "learned from, in turn. Searchers: whole matches with all else at its default, judged; "
        f'"{DEFAULT}" chooses nothing at all.',
        "wholly right: share of sketches with every partner right, and nothing matched that the "
        "map lacks. objects right: share of sketched objects, likewise. p50, p95 ms: of whole "
        "matches of two scenes. this place: share of sketches that are more likely than not "
        "of this place, as far as the answer says so.",
        *(f"{aligner.name}: {aligner.given}" for aligner in ALIGNERS),
    )
)


@dataclass(frozen=True)
class Answer:
    """What a method made of one sketch.

    Attributes
    ----------
    seconds
        How long it took.
    right
        Which objects of the sketch have the partner that they should have, or none.
    here
        Whether it takes the sketch for one of this place; None where it does not say.
    """

    seconds: float
    right: tuple[bool, ...]
    here: bool | None = None


def answers(
    case: Case, number: int, searchers: Sequence[str], aligners: Sequence[Aligner], budget: float
) -> dict[str, Answer]:
    """Let every method answer one sketch."""
    kind = KINDS[number % len(KINDS)]
    drawing = sample(kind, number, drawn=8, **case.options)
    found = {
        name: _matched(drawing, {} if name == DEFAULT else {"searcher": name}, budget)
        for name in (DEFAULT, *searchers)
    }
    return found | {aligner.name: _aligned(drawing, aligner) for aligner in aligners}


def _matched(drawing: Drawing, choices: Mapping[str, str], budget: float) -> Answer:
    started = time.perf_counter()
    result = match(drawing.scene, drawing.map, time_budget=budget, **choices)
    seconds = time.perf_counter() - started
    found = [result.object_map.get(k, -1) for k in range(len(drawing.scene))]
    place = getattr(result, "place_probability", None)
    return Answer(seconds, _right(drawing, found), None if place is None else place > 0.5)


def _aligned(drawing: Drawing, aligner: Aligner) -> Answer:
    started = time.perf_counter()
    found = aligner.solve(drawing.scene, drawing.map)
    return Answer(time.perf_counter() - started, _right(drawing, found))


def _right(drawing: Drawing, found: Sequence[int] | np.ndarray[Any, Any]) -> tuple[bool, ...]:
    return tuple(bool(a == b) for a, b in zip(drawing.truth, found, strict=True))


def answers_table(results: Mapping[Case, Sequence[Mapping[str, Answer]]]) -> Table:
    """Return a row for each kind of sketch and method."""
    table = Table(title="judged answers on simulated sketches", title_justify="left")
    table.add_column("sketch", no_wrap=True)
    table.add_column("sketches", justify="right")
    table.add_column("method", no_wrap=True)
    for column in ("wholly right", "objects right", "p50 ms", "p95 ms", "this place"):
        table.add_column(column, justify="right")
    for case, found in results.items():
        head = (case.name, str(len(found)))
        for method in found[0]:
            table.add_row(*head, method, *_figures([each[method] for each in found]))
            head = ("", "")
        table.add_section()
    return table


def _figures(runs: Sequence[Answer]) -> list[str]:
    places = [run.here for run in runs if run.here is not None]
    seconds = [run.seconds for run in runs]
    return [
        f"{mean(all(run.right) for run in runs):.0%}",
        f"{mean(each for run in runs for each in run.right):.1%}",
        *(f"{1e3 * np.quantile(seconds, share):,.0f}" for share in (0.5, 0.95)),
        f"{mean(places):.0%}" if places else "–",
    ]
