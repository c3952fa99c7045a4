"""How people must draw for ζ of the right map, or its parts, to be the thesis's.

``python -m tests.experiments.calibrate`` takes about five minutes and writes ``calibrated.json``
beside this file, from which the report tells what each strength gives. Its people draw nothing
else.

The thesis prints a mean ζ of 0.911 and 0.913 with all objects (tables 4.3 and 4.4), and of 0.897
with one missing (table 4.18). One dial cannot give both, as taking an object away hardly changes ζ
of the right map. Nor need it: the former means count case (a), the map with itself, as 1.000;
sketches (b) to (j) alone have 0.901 and 0.903. :data:`~tests.experiments.study.STRENGTH` gives the
former, :data:`~tests.experiments.protocol.STRONGER` the latter.

For FMAPs that one object map induces, as EASM's, Ω is ζσ. So the same tables tell two parts of ζ:
ζσ is Ω, and ζR + ζL is 3ζ − Ω. With one dial both come out otherwise: ours are more alike in shape,
and worse in direction and size. Two dials, how large things are drawn and the strength, give them;
:data:`~tests.experiments.study.SMALL` comes nearest to those of sketches (b) to (j).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import mean, stdev

from tests.experiments import thesis
from tests.experiments.cases import NOTHING, Record, Removal, cases
from tests.experiments.people import Person, Shapes
from tests.experiments.protocol import LETTERS, one_missing
from tests.experiments.records import chosen, grouped
from tests.experiments.runs import Work, each_of, run
from tests.experiments.scenes import PLACES
from tests.experiments.study import STRENGTH, Style

__all__ = ["Calibrated", "Legal", "Line", "Parts", "calibrated"]

SEED = 1
"""Of the calibration's people, who draw nothing else."""

STRENGTHS = (0.7, 0.8, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2)

SIZES = (0.36, 0.39, 0.42, 0.5)
"""How large things are drawn, and at what strengths, to find the parts of ζ."""

SIZED_STRENGTHS = (0.2, 0.3, 0.4)

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
class Parts:
    """Parts of ζ, of the thesis or of one way to draw.

    Attributes
    ----------
    drawn
        Whose, or how large and at which strength.
    similarity, others, zeta
        Means of ζσ, of ζR and ζL together, and of ζ, of the right map.
    """

    drawn: str
    similarity: float
    others: float
    zeta: float


@dataclass(frozen=True)
class Calibrated:
    """What was found: by strength, by shapes at the strength of the study, by legality, by size."""

    sketches: int
    strengths: tuple[Line, ...]
    shapes: tuple[Line, ...]
    legal: tuple[Legal, ...]
    parts: tuple[Parts, ...]


def calibrated() -> Calibrated:
    """Return what was found when it was done last."""
    found = json.loads(_FILE.read_text(encoding="utf-8"))
    return Calibrated(
        found["sketches"],
        tuple(Line(**line) for line in found["strengths"]),
        tuple(Line(**line) for line in found["shapes"]),
        tuple(Legal(**line) for line in found["legal"]),
        tuple(Parts(**line) for line in found["parts"]),
    )


def main() -> None:
    """Find out, and write it down."""
    by_strength = {f"{strength:g}": Person(strength) for strength in STRENGTHS}
    by_shape = {str(shape): Person(STRENGTH, shapes=shape) for shape in Shapes}
    found = Calibrated(
        _SKETCHES,
        _lines("strength", by_strength),
        _lines("shapes", by_shape),
        _legal(),
        (*_printed_parts(), *_parts()),
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


def _printed_parts() -> Iterator[Parts]:
    for letters, name in ((LETTERS, "thesis, (b) to (j)"), (f"a{LETTERS}", "thesis, with (a)")):
        rows = [thesis.EQUAL[table][letter] for table in ("4.3", "4.4") for letter in letters]
        yield _of_parts(name, [(row.omega, 3.0 * row.zeta - row.omega) for row in rows])


def _parts() -> list[Parts]:
    """Return the parts of ζ of people who draw things small and upright."""
    people = [
        Person(strength, small=size, upright=True) for size in SIZES for strength in SIZED_STRENGTHS
    ]
    found = list(each_of(_parts_of_sketches, people, "parts of ζ"))
    return [
        _of_parts(f"{person.small:g} times as large, strength {person.strength:g}", each)
        for person, each in zip(people, found, strict=True)
    ]


def _parts_of_sketches(person: Person) -> list[tuple[float, float]]:
    """Return ζσ and ζR + ζL of the right map of every sketch that segmentation leaves whole."""
    style = Style(person, seed=SEED)
    found = [
        case.confidence(case.true_map)
        for place in PLACES
        for k in range(_SKETCHES)
        for case in cases(place, k, style)
        if not case.faults
    ]
    return [(one.similarity, one.rotation + one.dilation) for one in found if one is not None]


def _of_parts(drawn: str, found: Sequence[tuple[float, float]]) -> Parts:
    similarity, others = (mean(column) for column in zip(*found, strict=True))
    rounded = (_rounded(similarity), _rounded(others / 2.0), _rounded((similarity + others) / 3.0))
    return Parts(drawn, *rounded)


def _rounded(number: float) -> float:
    return round(float(number), 4)


if __name__ == "__main__":
    main()
