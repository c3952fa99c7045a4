"""The thesis's tables, its printed numbers beside ours."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from statistics import mean, median
from typing import TypeVar

from tests.experiments import thesis
from tests.experiments.cases import Record
from tests.experiments.document import Table
from tests.experiments.protocol import LETTERS, MAPS, SMALL_TITLES, UNEQUAL
from tests.experiments.records import (
    Results,
    as_row,
    chosen,
    drawn_as_usual,
    given_probabilities,
    grouped,
    interval_by_sketch,
    right,
    share,
)
from tests.experiments.reliability import reliability
from tests.experiments.scenes import PLACES
from tests.experiments.thesis import Row, Summary

_Key = TypeVar("_Key")

__all__ = [
    "NINE",
    "appendix",
    "both_ways",
    "calibration",
    "equal",
    "equal_summary",
    "one_missing",
    "protocol_of_418",
    "several_missing",
    "small_objects",
    "studies_of_nine",
    "summary_418",
    "times",
    "unequal",
]

NINE = len(LETTERS)
"""Sketches of the thesis's study that show all objects; our first nine have their letters."""

_EQUAL_TABLES = {
    ("A", "map"): ("4.1", "4.3"),
    ("B", "map"): ("4.2", "4.4"),
    ("A", "grid"): (None, "4.6"),
    ("B", "grid"): (None, "4.7"),
}
_UNEQUAL_TABLES = {
    ("A", "map"): "4.8",
    ("B", "map"): "4.9",
    ("A", "grid"): "4.14",
    ("B", "grid"): "4.15",
}
_APPENDICES = {("A", "map"): "A", ("B", "map"): "B", ("A", "grid"): "C", ("B", "grid"): "D"}

_OTHERS = (
    "Our sketches are others than the thesis's of the same letters: compare columns, not rows."
)
_INTERVAL = "Shares are in per cent, with Wilson's 95 % interval."


def equal(results: Results, place: str, map_: str) -> Table:
    """Return tables 4.1 and 4.3, 4.2 and 4.4, 4.6, or 4.7: each sketch with all objects."""
    fsnn, easm = _EQUAL_TABLES[place, map_]
    objects = len(PLACES[place].furniture)
    columns: dict[str, Mapping[str, Row | None]] = {}
    if fsnn is not None:
        columns["thesis FSNN"] = thesis.EQUAL[fsnn]
    columns["thesis EASM"] = thesis.EQUAL[easm]
    own, drawn = results[f"case (a), {map_}"], results[f"all objects, {map_}"]
    for method in results.methods:
        first = chosen(own, place=place, method=method)[:1]
        nine = chosen(drawn, place=place, method=method, below=NINE)
        rows = {"a": as_row(first)}
        rows |= {LETTERS[record.case.number]: as_row([record]) for record in nine}
        columns[method] = rows
    letters = ("a", *LETTERS)
    numbers = f"tables {fsnn} and {easm}" if fsnn else f"table {easm}"
    return Table(
        f"{numbers.capitalize()}: scene {place}, {map_}, all {objects} objects",
        _header("sketch", columns),
        (*_lines(letters, columns), _means(letters, columns, objects)),
        note=f"right: objects matched correctly, of {objects}. {_OTHERS}",
    )


def equal_summary(results: Results, maps: Sequence[str]) -> Table:
    """Return all sketches with all objects, one line a scene, map and method."""
    rows = []
    for place in PLACES:
        for map_ in maps:
            fsnn, easm = _EQUAL_TABLES[place, map_]
            for name, number in (("thesis FSNN", fsnn), ("thesis EASM", easm)):
                if number is not None:
                    printed = [thesis.EQUAL[number][letter] for letter in LETTERS]
                    rows.append(
                        (place, map_, name, *_printed(printed, len(PLACES[place].furniture)))
                    )
            for method in results.methods:
                own = chosen(results[f"all objects, {map_}"], place=place, method=method)
                rows.append((place, map_, method, *_figures(own)))
    sketches = {
        (record.case.place, record.case.number): record.faults
        for map_ in maps
        for record in results[f"all objects, {map_}"]
    }
    faulty = sum(faults > 0 for faults in sketches.values())
    return Table(
        "All objects drawn: all sketches",
        ("scene", "map", "method", *_FIGURES),
        tuple(rows),
        left=3,
        note=f"{_FIGURES_NOTE} The thesis's nine sketches are (b) to (j), without case (a). In "
        f"{faulty} of our {len(sketches)} sketches segmentation lost or invented an object, which "
        "counts as wrong here and everywhere below.",
    )


def small_objects(results: Results) -> Table:
    """Return tables 4.1 to 4.4 beside people who draw things small, upright and turned anyhow."""
    rows = []
    for place in PLACES:
        objects = len(PLACES[place].furniture)
        fsnn, easm = _EQUAL_TABLES[place, "map"]
        for name, number in (("thesis FSNN", fsnn), ("thesis EASM", easm)):
            printed = [thesis.EQUAL[str(number)][letter] for letter in LETTERS]
            rows.append((place, "–", name, *_printed(printed, objects)))
        for title in SMALL_TITLES:
            heading = title.partition(", ")[2]
            drawn = grouped(chosen(results[title], place=place), lambda record: record.method)
            rows += [(place, heading, method, *_figures(own)) for method, own in drawn.items()]
    return Table(
        "Tables 4.1 to 4.4: people who draw things small, map, all objects",
        ("scene", "paper", "method", *_FIGURES),
        tuple(rows),
        left=3,
        note="These people give the parts of ζ that the thesis's tables of EASM tell of. "
        "fsnn-folded takes R̂ as the thesis prints it, fsnn-pso takes it as circular. turned: the "
        f"same sketches, each turned by another angle. {_FIGURES_NOTE}",
    )


def unequal(results: Results, place: str, map_: str) -> Table:
    """Return table 4.8, 4.9, 4.14 or 4.15: sketches drawn with missing or extra objects."""
    number = _UNEQUAL_TABLES[place, map_]
    rows = []
    for letter, style in UNEQUAL[place].items():
        printed = thesis.UNEQUAL[number][letter]
        records = chosen(results[f"sketches like ({letter}), {map_}"], place=place)
        objects = records[0].objects
        wrong = ", ".join(f"{a}→{b}" for a, b in printed.wrong)
        what = f"{style.missing} missing" if style.missing else f"{style.extra} extra"
        row = printed.row
        line = (f"{letter}: {what}", "thesis EASM", "1", *_cells(row, objects), wrong or "–", "–")
        rows.append(line)
        for method in results.methods:
            own = chosen(records, method=method)
            rows.append(
                (
                    "",
                    method,
                    f"{len(own)}",
                    *_mean_cells(own, objects),
                    "",
                    share(right(own), len(own)),
                )
            )
    return Table(
        f"Table {number}: scene {place}, {map_}, sketches with missing or extra objects",
        ("sketch", "method", "sketches", "ζ", "Ω", "right", "wrong", "wholly right, %"),
        tuple(rows),
        left=2,
        note="Ours are means over sketches drawn as the thesis's must have been, as far as its "
        f"numbers of matched objects tell. wrong: sketch → map, as printed. {_INTERVAL}",
    )


def one_missing(results: Results, number: str) -> Table:
    """Return table 4.10, 4.11, 4.16 or 4.17: one sketch, each object removed in turn."""
    place, grid, letter = thesis.ONE_MISSING_TABLES[number]
    map_ = _name(grid)
    printed = thesis.ONE_MISSING[place, grid][letter]
    keys = range(len(printed))
    records = chosen(results[f"one missing, {map_}"], place=place)
    sketch = LETTERS.index(letter)
    columns: dict[str, Mapping[int, Row | None]] = {"thesis EASM": dict(enumerate(printed))}
    shares = {}
    for method in results.methods:
        own = chosen(records, method=method)
        columns[method] = {
            k: as_row([r for r in chosen(own, removed=k) if r.case.number == sketch]) for k in keys
        }
        shares[method] = [chosen(own, removed=k) for k in keys]
    labels = [f"{k + 1} {PLACES[place].furniture.labels[k]}" for k in keys]
    rows = [
        (label, *line[1:], *(share(right(each[k]), len(each[k])) for each in shares.values()))
        for k, (label, line) in enumerate(zip(labels, _lines(keys, columns), strict=True))
    ]
    means = _means(keys, columns, len(printed) - 1)
    all_shares = [share(right(own), len(own)) for own in map(_flat, shares.values())]
    return Table(
        f"Table {number}: scene {place}, {map_}, sketch ({letter}), one object missing",
        (*_header("missing", columns), *(f"{method}, all sketches, %" for method in shares)),
        (*rows, (*means, *all_shares)),
        note=f"right: of {len(printed) - 1}. The last columns: share of all our sketches of the "
        f"scene that are wholly right without this object. {_INTERVAL} The objects are ours, not "
        f"the thesis's of the same numbers.",
    )


def several_missing(results: Results, number: str, place: str) -> Table:
    """Return table 4.12 or 4.13: more and more objects missing."""
    rows = []
    objects = len(PLACES[place].furniture)
    for missing, printed in enumerate(thesis.SEVERAL_MISSING[number], 1):
        records = [
            record
            for record in chosen(results["several missing"], place=place)
            if len(record.case.removed.sketch) == missing
        ]
        left = objects - missing
        rows.append((f"{missing}", "thesis EASM", "1", *_cells(printed, left), "–"))
        for method in results.methods:
            own = chosen(records, method=method)
            figures = (*_mean_cells(own, left), share(right(own), len(own)))
            rows.append(("", method, f"{len(own)}", *figures))
    return Table(
        f"Table {number}: scene {place}, map, several objects missing",
        ("missing", "method", "sketches", "ζ", "Ω", "right", "wholly right, %"),
        tuple(rows),
        left=2,
        note="The thesis removes objects from one good sketch, (e); ours are all sketches, objects "
        f"removed in an order by chance. {_INTERVAL}",
    )


def protocol_of_418(results: Results) -> Table:
    """Return table 4.18 by the thesis's own protocol: nine sketches a scene, 270 cases."""
    return _table_418(results, NINE, "Table 4.18: the thesis's 270 cases, nine sketches a scene")


def summary_418(results: Results) -> Table:
    """Return table 4.18 on all sketches."""
    return _table_418(results, math.inf, "Table 4.18 on all sketches")


def studies_of_nine(results: Results) -> Table:
    """Return how much the 270 cases differ from one set of nine sketches a scene to the next."""
    studies = results.sketches // NINE
    cases = thesis.TOTAL.tests
    rows = []
    for method in results.methods:
        own = [record for title in _sweeps(results) for record in chosen(title, method=method)]
        counts = sorted(
            right(each)
            for each in grouped(own, lambda record: record.case.number // NINE).values()
            if len(each) == cases
        )
        if len(counts) < 2:
            continue
        at_least = sum(count >= thesis.TOTAL.perfect for count in counts)
        figures = (f"{counts[0]}", f"{median(counts):g}", f"{counts[-1]}")
        rows.append((method, f"{len(counts)}", *figures, f"{at_least} of {len(counts)}"))
    return Table(
        "The thesis's protocol again and again, each time with nine other sketches a scene",
        ("method", "studies", "fewest right", "median", "most", "239 or more"),
        tuple(rows),
        note=f"Wholly right of {cases} cases; the thesis prints {thesis.TOTAL.perfect}. "
        f"{results.sketches} sketches a scene make {studies} studies; a slow method has fewer.",
    )


def both_ways(results: Results) -> Table:
    """Return sketches that lack one object and show one that is not there."""
    rows = []
    for place in PLACES:
        drawn = chosen(results["missing and extra"], place=place)
        for method, own in grouped(drawn, lambda record: record.method).items():
            correct = sum(record.right for record in own) / sum(record.objects for record in own)
            figures = (share(right(own), len(own)), f"{100 * correct:.1f}")
            rows.append((place, method, f"{len(own)}", *figures))
    return Table(
        "One object missing and one that is not there, map",
        ("scene", "method", "sketches", "wholly right, %", "objects, %"),
        tuple(rows),
        left=2,
        note="Only default may leave an object of either side without partner: no other can be "
        f"wholly right. {_INTERVAL}",
    )


def calibration(results: Results) -> Table:
    """Return how the probabilities of answers compare with what came true."""
    rows = []
    for title, records in results.experiments.items():
        if not drawn_as_usual(title) and title != "missing and extra":
            continue
        for method, own in grouped(records, lambda record: record.method).items():
            answers = given_probabilities(own)
            if answers:
                said, came_true = zip(*answers, strict=True)
                figures = (f"{100 * mean(said):.1f}", f"{100 * mean(came_true):.1f}")
                error = f"{reliability(answers).error:.3f}"
                rows.append((title, method, f"{len(answers)}", *figures, error))
    return Table(
        "Probabilities against what came true",
        ("experiment", "method", "cases", "mean probability, %", "wholly right, %", "error"),
        tuple(rows),
        left=2,
        note="error: expected calibration error in ten bins.",
    )


def appendix(results: Results, place: str, map_: str) -> Table:
    """Return appendix A, B, C or D: nine sketches, each object removed in turn."""
    printed = thesis.ONE_MISSING[place, MAPS[map_]]
    objects = len(PLACES[place].furniture)
    keys = [(letter, k) for letter in LETTERS for k in range(objects)]
    columns: dict[str, Mapping[tuple[str, int], Row | None]] = {
        "thesis EASM": {(letter, k): printed[letter][k] for letter, k in keys}
    }
    for method in results.methods:
        nine = chosen(results[f"one missing, {map_}"], place=place, method=method, below=NINE)
        columns[method] = {
            (LETTERS[record.case.number], record.case.removed.sketch[0]): as_row([record])
            for record in nine
        }
    lines = [
        (letter if k == 0 else "", f"{k + 1}", *line[1:])
        for (letter, k), line in zip(keys, _lines(keys, columns), strict=True)
    ]
    means = _means(keys, columns, objects - 1)
    return Table(
        f"Appendix {_APPENDICES[place, map_]}: scene {place}, {map_}, each object removed in turn",
        ("sketch", "missing", *_header("", columns)[1:]),
        (*lines, (means[0], "", *means[1:])),
        left=2,
        note=f"right: of {objects - 1}. {_OTHERS}",
    )


def times(results: Results) -> Table:
    """Return table 4.5 and what lies beyond: time of the search against the number of objects."""
    records = [*results["times, 3 to 8 objects"], *results["times, 10 to 30 objects"]]
    methods = list(dict.fromkeys(record.method for record in records))
    rows = []
    for objects, own in sorted(grouped(records, lambda record: record.objects).items()):
        seconds = {
            method: median(record.seconds for record in each)
            for method, each in grouped(own, lambda record: record.method).items()
        }
        easm, fsnn = thesis.SECONDS.get(objects, (None, None))
        ours = [f"{1e3 * seconds[m]:,.1f}" if m in seconds else "–" for m in methods]
        rows.append(
            (
                f"{objects}",
                f"{easm}" if easm is not None else "–",
                f"{fsnn}" if fsnn is not None else "–",
                f"{fsnn / easm:.1f}" if easm and fsnn else "–",
                *ours,
                f"{seconds['fsnn-pso'] / seconds['easm']:.1f}" if "fsnn-pso" in seconds else "–",
            )
        )
    return Table(
        "Table 4.5: time for convergence",
        (
            "objects",
            "thesis EASM, s",
            "thesis FSNN, s",
            "FSNN/EASM",
            *(f"{method}, ms" for method in methods),
            "fsnn-pso/easm",
        ),
        tuple(rows),
        left=0,
        note="Ours are medians of the search alone, one process on one core, kernels compiled. 3 "
        "to 8 objects: scene A without some of them, on both sides; more: hexagons by chance. The "
        "thesis says neither on what machine nor in what language it ran.",
    )


_FIGURES = ("cases", "wholly right, %", "objects, %", "misled, %", "ζ found", "ζ of the truth", "Ω")
_FIGURES_NOTE = (
    "objects: share matched correctly. misled: share of cases in which a wrong object map has a "
    f"higher ζ than the true one, so that no search for ζ can be right. {_INTERVAL}"
)


def _figures(records: Sequence[Record]) -> tuple[str, ...]:
    return (
        f"{len(records)}",
        share(right(records), len(records)),
        f"{100 * sum(r.right for r in records) / sum(r.objects for r in records):.1f}",
        f"{100 * mean(record.misled for record in records):.1f}",
        f"{mean(record.zeta for record in records):.3f}",
        f"{mean(record.true_zeta for record in records):.3f}",
        f"{mean(record.omega for record in records):.3f}",
    )


def _printed(rows: Sequence[Row], objects: int) -> tuple[str, ...]:
    """Return the figures of cases that the thesis prints."""
    return (
        f"{len(rows)}",
        share(sum(row.right == objects for row in rows), len(rows)),
        f"{100 * sum(row.right for row in rows) / (objects * len(rows)):.1f}",
        "–",
        f"{mean(row.zeta for row in rows):.3f}",
        "–",
        f"{mean(row.omega for row in rows):.3f}",
    )


def _table_418(results: Results, below: float, title: str) -> Table:
    rows: list[tuple[str, ...]] = []
    for place in PLACES:
        for map_, grid in MAPS.items():
            rows.append((place, map_, "thesis EASM", *_summary(thesis.SUMMARY[place, grid])))
            sweep = chosen(results[f"one missing, {map_}"], place=place, below=below)
            rows += [
                (place, map_, method, *_counted(chosen(sweep, method=method)))
                for method in results.methods
            ]
    rows.append(("A+B", "both", "thesis EASM", *_summary(thesis.TOTAL)))
    for method in results.methods:
        own = [
            record
            for sweep in _sweeps(results)
            for record in chosen(sweep, method=method, below=below)
        ]
        rows.append(("A+B", "both", method, *_counted(own)))
    return Table(
        title,
        (
            "scene",
            "map",
            "method",
            "tests",
            "perfect",
            "perfect, %",
            "by sketch, %",
            "objects",
            "correct",
            "ζ",
            "Ω",
        ),
        tuple(rows),
        left=3,
        note="by sketch: a 95 % interval by drawing sketches again, as cases of one sketch fail "
        f"together; Wilson's takes them for independent. {_INTERVAL}",
    )


def _sweeps(results: Results) -> list[list[Record]]:
    return [results[f"one missing, {map_}"] for map_ in MAPS]


def _summary(line: Summary) -> tuple[str, ...]:
    return (
        f"{line.tests}",
        f"{line.perfect}",
        share(line.perfect, line.tests),
        "–",
        f"{line.objects}",
        f"{line.right}",
        f"{line.zeta:.3f}",
        f"{line.omega:.3f}",
    )


def _counted(records: Sequence[Record]) -> tuple[str, ...]:
    low, high = interval_by_sketch(records)
    return (
        f"{len(records)}",
        f"{right(records)}",
        share(right(records), len(records)),
        f"[{100 * low:.1f}, {100 * high:.1f}]",
        f"{sum(record.objects for record in records)}",
        f"{sum(record.right for record in records)}",
        f"{mean(record.zeta for record in records):.3f}",
        f"{mean(record.omega for record in records):.3f}",
    )


def _header(first: str, columns: Iterable[str]) -> tuple[str, ...]:
    return (first, *(cell for name in columns for cell in (f"{name} ζ", "Ω", "right")))


def _lines(
    keys: Iterable[_Key], columns: Mapping[str, Mapping[_Key, Row | None]]
) -> list[tuple[str, ...]]:
    return [
        (f"{key}", *(cell for rows in columns.values() for cell in _three(rows.get(key))))
        for key in keys
    ]


def _means(
    keys: Iterable[_Key], columns: Mapping[str, Mapping[_Key, Row | None]], objects: int
) -> tuple[str, ...]:
    """Return the last line: mean ζ and Ω, and how many objects are right of how many."""
    wanted, cells = list(keys), ["mean"]
    for rows in columns.values():
        known = [row for key in wanted if (row := rows.get(key)) is not None]
        if known:
            counted = f"{sum(row.right for row in known)}/{objects * len(known)}"
            zeta, omega = mean(row.zeta for row in known), mean(row.omega for row in known)
            cells += [f"{zeta:.3f}", f"{omega:.3f}", counted]
        else:
            cells += ["–"] * 3
    return tuple(cells)


def _three(row: Row | None) -> tuple[str, str, str]:
    if row is None:
        return "–", "–", "–"
    return f"{row.zeta:.3f}", f"{row.omega:.3f}", f"{row.right}"


def _cells(row: Row, objects: int) -> tuple[str, str, str]:
    return f"{row.zeta:.3f}", f"{row.omega:.3f}", f"{row.right} of {objects}"


def _mean_cells(records: Sequence[Record], objects: int) -> tuple[str, str, str]:
    row = as_row(records)
    if row is None:
        return "–", "–", "–"
    return f"{row.zeta:.3f}", f"{row.omega:.3f}", f"{row.right / len(records):.2f} of {objects}"


def _flat(groups: Iterable[Sequence[Record]]) -> list[Record]:
    return [record for group in groups for record in group]


def _name(grid: bool) -> str:
    return "grid" if grid else "map"
