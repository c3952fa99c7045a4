"""The plots of the report, as PNG pictures."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from statistics import mean, median
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tests.experiments import thesis
from tests.experiments.cases import Record
from tests.experiments.document import Picture
from tests.experiments.intervals import wilson
from tests.experiments.methods import THESIS
from tests.experiments.protocol import MAPS
from tests.experiments.records import Results, chosen, grouped, right
from tests.experiments.reliability import Reliability
from tests.experiments.scenes import PLACES

__all__ = [
    "against_the_thesis",
    "missing",
    "one_missing",
    "reliability",
    "rotation",
    "strength",
    "times",
    "zeta",
]

_THESIS = "#444444"
_COLOURS = {
    "auto": "#1f77b4",
    "easm": "#d95f02",
    "fsnn-pso": "#1b9e77",
    "exact": "#7b3294",
    "direct": "#c2a000",
    "default": "#e7298a",
}
_OTHER = "#888888"
_WIDTHS = {"easm": 4.5}  # to be seen beneath auto, which mostly agrees
_RIGHT, _WRONG = "#1f77b4", "#d95f02"
_DOTS_PER_INCH = 110
_STYLE: dict[Any, Any] = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "font.size": 10,
    "grid.alpha": 0.3,
    "legend.frameon": False,
}


def against_the_thesis(results: Results) -> Picture:
    """Return the picture of the README: time, and what missing objects do, in two panels."""
    with _figure((10.0, 3.9), columns=2) as (figure, (left, right_)):
        _draw_times(left, results)
        _draw_missing(right_, results, [name for name in results.methods if name not in THESIS])
    return _picture(
        figure,
        "against-the-thesis.png",
        "Left: time of a search against the number of objects. Right: sketches wholly right "
        "against the number of missing objects, with 95 % intervals.",
    )


def times(results: Results) -> Picture:
    """Return time against the number of objects, on a log scale."""
    with _figure((7.5, 4.6)) as (figure, (axes,)):
        _draw_times(axes, results)
    return _picture(figure, "times.png", "Time of a search against the number of objects.")


def missing(results: Results) -> Picture:
    """Return the share wholly right against the number of missing objects."""
    with _figure((7.5, 4.6)) as (figure, (axes,)):
        _draw_missing(axes, results, results.methods)
    return _picture(
        figure,
        "missing.png",
        "Share of sketches wholly right against the number of missing objects, on the map.",
    )


def zeta(results: Results, method: str) -> Picture:
    """Return ζ of the true map against ζ found, of cases with an object missing."""
    own = chosen(results["one missing, map"], method=method)
    with _figure((6.0, 5.6)) as (figure, (axes,)):
        for perfect, colour, label in ((True, _RIGHT, "right"), (False, _WRONG, "wrong")):
            those = [record for record in own if record.perfect is perfect]
            axes.scatter(
                [record.true_zeta for record in those],
                [record.zeta for record in those],
                s=7,
                alpha=0.5,
                linewidths=0,
                color=colour,
                label=f"{label} ({len(those)})",
            )
        low = min(min(record.true_zeta, record.zeta) for record in own)
        axes.plot([low, 1.0], [low, 1.0], color=_THESIS, linewidth=0.8)
        axes.set(xlabel="ζ of the true object map", ylabel="ζ of the map found")
        axes.legend(loc="lower right")
    return _picture(
        figure,
        "zeta.png",
        f"ζ of the truth against ζ found by {method}, one object missing. Above the line a wrong "
        "map has the higher ζ.",
    )


def one_missing(results: Results) -> Picture:
    """Return table 4.18 as a picture: shares with intervals."""
    with _figure((7.5, 3.8)) as (figure, (axes,)):
        lines: list[str] = []
        for place in PLACES:
            for map_, grid in MAPS.items():
                printed = thesis.SUMMARY[place, grid]
                height = -float(len(lines))
                lines.append(f"{place}, {map_}")
                _bar(axes, printed.perfect, printed.tests, height + 0.27, "thesis EASM", _THESIS)
                sweep = chosen(results[f"one missing, {map_}"], place=place)
                for k, method in enumerate(results.methods):
                    own = chosen(sweep, method=method)
                    offset = 0.27 - 0.6 * (k + 1) / len(results.methods)
                    _bar(axes, right(own), len(own), height + offset, method, _colour(method))
        axes.set_yticks([-float(k) for k in range(len(lines))], lines)
        axes.set(xlabel="wholly right, %", xlim=(-3, 103))
        handles, labels = axes.get_legend_handles_labels()
        unique = dict(zip(labels, handles, strict=True))
        axes.legend(unique.values(), unique.keys(), loc="center")
    return _picture(
        figure,
        "one-missing.png",
        "One object missing: share of cases wholly right, 95 % intervals.",
    )


def strength(results: Results) -> Picture:
    """Return the share wholly right against how far drawings leave the truth."""

    def dial(record: Record) -> float:
        return record.case.style.person.strength

    everything, one = _by_missing(results["strength"])
    with _figure((10.0, 3.9), columns=2) as (figure, (left, middle)):
        for method in results.methods:
            _curve(left, chosen(everything, method=method), dial, method)
            _curve(middle, chosen(one, method=method), dial, method)
        left.set(title="all objects drawn", xlabel="strength", ylabel="wholly right, %")
        middle.set(title="one missing", xlabel="strength")
        for axes in (left, middle):
            axes.set_ylim(-3, 103)
        left.legend(loc="lower left")
    return _picture(
        figure,
        "strength.png",
        "Share wholly right against jitter: how far people's drawings leave the truth. The tables "
        "are at strength 0.95.",
    )


def rotation(results: Results) -> Picture:
    """Return the share wholly right against how the paper is turned."""

    def turned(record: Record) -> float:
        return record.case.style.paper

    everything, one = _by_missing(results["rotation"])
    with _figure((7.5, 3.9)) as (figure, (axes,)):
        for method in dict.fromkeys(record.method for record in everything):
            _curve(axes, chosen(everything, method=method), turned, f"{method}, all objects")
            _curve(axes, chosen(one, method=method), turned, f"{method}, one missing", "--")
        axes.set(xlabel="paper turned by, °", ylabel="wholly right, %", ylim=(-3, 103))
        axes.legend(loc="lower left")
    return _picture(figure, "rotation.png", "Share wholly right against the turn of the paper.")


def reliability(method: str, found: Reliability) -> Picture:
    """Return the reliability diagram of a method's probabilities."""
    with _figure((5.2, 4.8)) as (figure, (axes,)):
        axes.plot([0.0, 1.0], [0.0, 1.0], color=_THESIS, linewidth=0.8)
        said, true, counts = zip(*found.bins, strict=True)
        largest = max(counts)
        axes.plot(said, true, color=_RIGHT, linewidth=1.0)
        axes.scatter(said, true, s=[12 + 120 * count / largest for count in counts], color=_RIGHT)
        axes.set(xlabel="probability given", ylabel="share right", xlim=(0, 1), ylim=(0, 1.02))
    return _picture(
        figure,
        f"reliability-{method}.png",
        f"{method}: share of answers that are right against the probability given; expected "
        f"calibration error {found.error:.3f}. Larger dots have more cases.",
    )


def _draw_times(axes: Axes, results: Results) -> None:
    objects = list(thesis.SECONDS)
    for k, (name, style) in enumerate((("thesis EASM", "-"), ("thesis FSNN", ":"))):
        printed = [seconds[k] for seconds in thesis.SECONDS.values()]
        axes.plot(objects, printed, style, marker="s", markersize=4, color=_THESIS, label=name)
    records = [*results["times, 3 to 8 objects"], *results["times, 10 to 30 objects"]]
    for method, own in grouped(records, lambda record: record.method).items():
        by_objects = sorted(grouped(own, lambda record: record.objects).items())
        numbers = [number for number, _ in by_objects]
        seconds = [median(record.seconds for record in each) for _, each in by_objects]
        axes.plot(numbers, seconds, marker="o", markersize=4, color=_colour(method), label=method)
    axes.set_yscale("log")
    axes.set(xlabel="objects", ylabel="seconds")
    axes.legend(fontsize=8)


def _draw_missing(axes: Axes, results: Results, methods: Iterable[str]) -> None:
    for method in methods:
        for place, line in zip(PLACES, ("-", "--"), strict=True):
            own = [
                record
                for title in ("all objects, map", "several missing")
                for record in chosen(results[title], place=place, method=method)
            ]
            label = f"{method}, scene {place}"
            _curve(axes, own, lambda record: len(record.case.removed.sketch), label, line)
    axes.set(xlabel="missing objects", ylabel="wholly right, %", ylim=(-3, 103))
    for number, place, marker in (("4.12", "A", "s"), ("4.13", "B", "D")):
        objects = len(PLACES[place].furniture)
        rows = thesis.SEVERAL_MISSING[number]
        shares = [100.0 * (row.right == objects - k) for k, row in enumerate(rows, 1)]
        axes.plot(
            range(1, len(rows) + 1),
            shares,
            marker,
            markersize=5,
            fillstyle="none",
            color=_THESIS,
            label=f"thesis EASM, scene {place}, one sketch",
        )
    axes.legend(fontsize=8)


def _curve(
    axes: Axes,
    records: Sequence[Record],
    key: Callable[[Record], float],
    label: str,
    line: str = "-",
) -> None:
    """Draw the share wholly right with its 95 % interval as an area."""
    groups = sorted(grouped(records, key).items())
    if not groups:
        return
    at = [value for value, _ in groups]
    limits = [wilson(right(each), len(each)) for _, each in groups]
    method = label.partition(",")[0]
    colour, width = _colour(method), _WIDTHS.get(method, 1.5)
    shares = [100.0 * mean(record.perfect for record in each) for _, each in groups]
    axes.plot(at, shares, line, marker="o", markersize=4, lw=width, color=colour, label=label)
    low, high = [100.0 * limit[0] for limit in limits], [100.0 * limit[1] for limit in limits]
    axes.fill_between(at, low, high, color=colour, alpha=0.1, linewidth=0)


def _bar(axes: Axes, successes: int, tests: int, height: float, label: str, colour: str) -> None:
    if not tests:
        return
    low, high = wilson(successes, tests)
    axes.plot([100 * low, 100 * high], [height, height], color=colour, linewidth=2)
    axes.plot(100 * successes / tests, height, "o", markersize=5, color=colour, label=label)


def _by_missing(records: Sequence[Record]) -> tuple[list[Record], list[Record]]:
    """Return the cases with all objects, and those with some missing."""
    whole = [record for record in records if not record.case.removed.sketch]
    return whole, [record for record in records if record.case.removed.sketch]


def _colour(method: str) -> str:
    return _COLOURS.get(method, _OTHER)


@contextmanager
def _figure(
    inches: tuple[float, float], columns: int = 1
) -> Iterator[tuple[Figure, tuple[Axes, ...]]]:
    """Yield a figure and its axes."""
    with _settings():
        figure = Figure(inches, layout="constrained")
        yield figure, tuple(figure.subplots(1, columns, squeeze=False)[0])


def _picture(figure: Figure, name: str, caption: str) -> Picture:
    stream = io.BytesIO()
    with _settings():
        figure.savefig(stream, format="png", dpi=_DOTS_PER_INCH)
    return Picture(name, stream.getvalue(), caption)


@contextmanager
def _settings() -> Iterator[None]:
    """Draw alike whatever settings of its own a machine has."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        yield
