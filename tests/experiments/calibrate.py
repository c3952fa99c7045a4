"""The strength at which ζ of the right map is the thesis's.

``python -m tests.experiments.calibrate`` takes about three minutes and writes ``calibrated.json``
beside this file, from which the report tells what each strength gives. Its people draw nothing
else.

The thesis prints a mean ζ of 0.911 and 0.913 with all objects (tables 4.3 and 4.4), and of 0.897
with one missing (table 4.18). One dial cannot give both, as taking an object away hardly changes ζ
of the right map. Nor need it: the former means count case (a), the map with itself, as 1.000;
sketches (b) to (j) alone have 0.901 and 0.903. :data:`~tests.experiments.study.STRENGTH` gives the
former, :data:`~tests.experiments.protocol.STRONGER` the latter.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import mean, stdev

from tests.experiments.cases import NOTHING, Record, Removal
from tests.experiments.people import Person, Shapes
from tests.experiments.protocol import one_missing
from tests.experiments.records import chosen, grouped
from tests.experiments.runs import Work, run
from tests.experiments.scenes import PLACES
from tests.experiments.study import STRENGTH, Style

__all__ = ["Calibrated", "Legal", "Line", "calibrated"]

SEED = 1
"""Of the calibration's people, who draw nothing else."""

STRENGTHS = (0.7, 0.8, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2)

LEGAL = ("easm", "easm-pairwise")
"""Methods whose FMAPs one object map induces, and whose FMAPs are legal pair by pair alone."""

_SKETCHES = 200
_FILE = Path(__file__).with_name("calibrated.json")


@dataclass(frozen=True)
class Line:
    """What comes of one way to draw, on the map, with ``auto``.

    Attributes
    ----------
    drawn
        The strength, or what is drawn for a thing.
    place
        The scene.
    zeta, spread
        Mean and standard deviation of ζ of the right map, with all objects.
    zeta_missing, spread_missing
        Mean of ζ of the right map with one object missing, and how much it differs among the
        objects taken from one sketch.
    right, right_missing
        Shares wholly right.
    """

    drawn: str
    place: str
    zeta: float
    spread: float
    zeta_missing: float
    spread_missing: float
    right: float
    right_missing: float


@dataclass(frozen=True)
class Legal:
    """What EASM finds, all objects drawn, by what makes an FMAP legal.

    Attributes
    ----------
    place, method
        The scene, and one of :data:`LEGAL`.
    zeta, omega
        Means of what it finds.
    omega_right
        Mean Ω where the answer is right.
    right
        Share wholly right.
    """

    place: str
    method: str
    zeta: float
    omega: float
    omega_right: float
    right: float


@dataclass(frozen=True)
class Calibrated:
    """What was found: by strength, by shapes at the strength of the study, and by legality."""

    sketches: int
    strengths: tuple[Line, ...]
    shapes: tuple[Line, ...]
    legal: tuple[Legal, ...]


def calibrated() -> Calibrated:
    """Return what was found when it was done last."""
    found = json.loads(_FILE.read_text(encoding="utf-8"))
    return Calibrated(
        found["sketches"],
        tuple(Line(**line) for line in found["strengths"]),
        tuple(Line(**line) for line in found["shapes"]),
        tuple(Legal(**line) for line in found["legal"]),
    )


def main() -> None:
    """Find out, and write it down."""
    by_strength = {f"{strength:g}": Person(strength) for strength in STRENGTHS}
    by_shape = {str(shape): Person(STRENGTH, shapes=shape) for shape in Shapes}
    found = Calibrated(
        _SKETCHES, _lines("strength", by_strength), _lines("shapes", by_shape), _legal()
    )
    text = json.dumps(asdict(found), indent=1, ensure_ascii=False)
    _FILE.write_text(text + "\n", encoding="utf-8")
    print(f"wrote {_FILE}")


def _lines(title: str, people: Mapping[str, Person]) -> tuple[Line, ...]:
    works = [
        work
        for person in people.values()
        for place in PLACES
        for work in _works(place, person, (NOTHING, *one_missing(place)), ("auto",))
    ]
    records = run(works, title)
    drawn = grouped(records, lambda record: (record.case.style.person, record.case.place))
    return tuple(
        _line(name, place, drawn[person, place])
        for name, person in people.items()
        for place in PLACES
    )


def _works(
    place: str, person: Person, removals: tuple[Removal, ...], methods: tuple[str, ...]
) -> list[Work]:
    style = Style(person, seed=SEED)
    return [Work(place, k, style, removals, methods=methods) for k in range(_SKETCHES)]


def _line(name: str, place: str, records: Sequence[Record]) -> Line:
    whole = [record for record in records if not record.case.removed.sketch]
    missing = [record for record in records if record.case.removed.sketch]
    sketches = grouped(missing, lambda record: record.case.number).values()
    return Line(
        name,
        place,
        _rounded(mean(record.true_zeta for record in whole)),
        _rounded(stdev(record.true_zeta for record in whole)),
        _rounded(mean(record.true_zeta for record in missing)),
        _rounded(mean(stdev(record.true_zeta for record in each) for each in sketches)),
        _rounded(mean(record.perfect for record in whole)),
        _rounded(mean(record.perfect for record in missing)),
    )


def _legal() -> tuple[Legal, ...]:
    works = [
        work for place in PLACES for work in _works(place, Person(STRENGTH), (NOTHING,), LEGAL)
    ]
    records = run(works, "legal FMAPs")
    lines = []
    for place in PLACES:
        for method in LEGAL:
            own = chosen(records, place=place, method=method)
            lines.append(
                Legal(
                    place,
                    method,
                    _rounded(mean(record.zeta for record in own)),
                    _rounded(mean(record.omega for record in own)),
                    _rounded(mean(record.omega for record in own if record.perfect)),
                    _rounded(mean(record.perfect for record in own)),
                )
            )
    return tuple(lines)


def _rounded(number: float) -> float:
    return round(float(number), 4)


if __name__ == "__main__":
    main()
