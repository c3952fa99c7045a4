"""How much of what the judge gets wrong could be right at all.

``python -m tests.experiments.ceilings`` prints, for each arm of the study and each generator, in
per cent of its sketches:

- how often the right map is among those that the judge weighs, which no judge of these exceeds;
- how often the judge answers it, and how often one that knows the generator does: the same networks
  with the same numbers of each map, gone on with from other sketches of all arms of that generator;
  where that one fails, too, other sketches to learn from would hardly help, but other evidence;
- how often one answers it that knows the other generator in the same way;
- how often the first two take the right place for another one, or another one for this;
- the expected calibration error of what these say of the map, and what chance alone makes of it
  with so many sketches, were each probability what the one that knows says;
- all that of the arms together. How many things are invented nobody tells a judge: its
  probabilities can hold of sketches with none, one and two together, as often as each comes, not of
  each by itself, unless these can be told apart.

A judge that knows has seen ``--learned`` sketches of each arm; with more it gets a little better.
Nothing of it is kept: what the engine has is learned from none of these sketches. ``--out`` writes
the table into a file, as ``ceilings.md`` beside this one was.
"""

from __future__ import annotations

import argparse
import operator
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial, reduce
from pathlib import Path

from sketchmatch_builtin.judges._evidence import weighed
from sketchmatch_builtin.judges.calibration import POSTERIOR, Posterior
from tests.experiments.arms import ARMS, Arm
from tests.experiments.document import Heading, Paragraph, Table, markdown
from tests.experiments.generators import KINDS
from tests.experiments.judging import drawing_of
from tests.experiments.people import Shapes
from tests.experiments.posterior import Known, knowing, known_sketches
from tests.experiments.reliability import by_chance, reliability
from tests.experiments.runs import each_of

__all__ = ["Tally", "ceilings", "table", "together"]

_FIRST, _LEARNED_FROM = 9000, 100_000
_SKETCHES, _LEARNED = 120, 150
_LIKELY, _SURE = 0.5, 0.95
_WANTED = {
    "8 of 8": 99,
    **{f"7 of 8, {shapes}": 99 for shapes in Shapes},
    "7 of 8 and 1 extra": 95,
    "7 of 20 and 1 extra": 90,
    "8 of 36": 95,
}
_ARMS = (*ARMS["parts"], *ARMS["places"])


@dataclass(frozen=True, eq=False)
class Tally:
    """What a judge says of the sketches of an arm.

    Attributes
    ----------
    sketches
        How many there are; of some nothing fits at all.
    among, right
        Of how many the right map is weighed, and is the answer.
    maps
        How likely each answer is right, and whether it is.
    places
        How likely each shows the place.
    """

    sketches: int
    among: int
    right: int
    maps: tuple[tuple[float, bool], ...]
    places: tuple[float, ...]

    def __add__(self, other: Tally) -> Tally:
        return Tally(
            *(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True))
        )

    @classmethod
    def of(cls, cases: Sequence[Known], judge: Posterior, sketches: int) -> Tally:
        """Count what a judge says of sketches."""
        maps, places = [], []
        for case in cases:
            found = weighed(case.described, judge)
            best, here = int(found.shares.argmax()), 1.0 - found.elsewhere
            likely = here * (1.0 - found.lost) * float(found.shares[best])
            maps.append((likely, best == case.right))
            places.append(here)
        return cls(
            sketches,
            sum(case.right >= 0 for case in cases),
            sum(right for _, right in maps),
            tuple(maps),
            tuple(places),
        )


def ceilings(
    kinds: Sequence[str],
    sketches: range,
    learned: range,
    kept: Path | None = None,
) -> dict[tuple[Arm, str], tuple[Tally, ...]]:
    """Return what the judge says of each arm of each generator, and what those say that know.

    First the one that knows the generator, then those that know another one.

    Parameters
    ----------
    kinds
        Of generators.
    sketches, learned
        Numbers of sketches to judge, and of those that the judge that knows has seen.
    kept
        A folder for sketches in numbers.
    """
    judges = {}
    for kind in kinds:
        seen = _of_arms(kind, learned, kept).values()
        judges[kind] = knowing(POSTERIOR, [case for cases in seen for case in cases])
    found = {}
    for kind in kinds:
        others = [judge for other, judge in judges.items() if other != kind]
        for arm, cases in _of_arms(kind, sketches, kept).items():
            found[arm, kind] = tuple(
                Tally.of(cases, each, len(sketches)) for each in (POSTERIOR, judges[kind], *others)
            )
    return found


def _of_arms(kind: str, numbers: range, kept: Path | None) -> dict[Arm, list[Known]]:
    """Return sketches of each arm in numbers, showing progress."""
    every = each_of(partial(_known, kind, numbers, kept), _ARMS, f"{kind}, {len(numbers)} at once")
    return dict(zip(_ARMS, every, strict=True))


def _known(kind: str, numbers: range, kept: Path | None, arm: Arm) -> list[Known]:
    name = f"{kind}, {arm.name}"
    return known_sketches(name, partial(drawing_of, arm, kind), numbers, kept)


def table(found: dict[tuple[Arm, str], tuple[Tally, ...]]) -> Table:
    """Return a line for each arm and generator."""
    rows = []
    for arm in _ARMS:
        for kind in KINDS:
            if (arm, kind) in found:
                now, judge, *others = found[arm, kind]
                cells = _cells(arm, (now, judge), others)
                rows.append((arm.name, kind, f"{now.sketches}", *cells))
    return Table(
        "What is right, and what could be",
        (
            "drawn",
            "sketches by",
            "sketches",
            "wanted, %",
            "weighed, %",
            "right, %",
            "who knows",
            "another",
            "place, %",
            "who knows",
            f"above {_SURE:g}, %",
            "who knows",
            "error",
            "who knows",
            "chance",
        ),
        tuple(rows),
        left=2,
        note="wanted: what is to be right at least. weighed: the right map is among those that "
        "are weighed. right: the answer of the judge, then of one that knows the generator, and of "
        "one that knows the other generator. place: "
        f"the right one has a probability below {_LIKELY:g}, or a wrong one above it, and then how "
        f"many wrong ones are above {_SURE:g}; wanted are below 2, 1 and .1 %. error: expected "
        "calibration error of the map, wanted below .02, and what chance makes of it where all "
        "probabilities of the one that knows are true. Where that judge fails, too, the evidence "
        "is alike for several maps, or it has seen too few sketches. Where one that knows another "
        "generator fails more often than the judge, it takes these people for others: who draws, "
        "and how, is what would have to be known.",
    )


def together(found: dict[tuple[Arm, str], tuple[Tally, ...]]) -> Table:
    """Return what holds of all sketches of each generator, of the judge and of the one that knows.

    All arms are to have sketches of the place and sketches of others.
    """
    kinds = [*dict.fromkeys(kind for _, kind in found)]
    columns = [_of_all(found, kind, judge) for kind in kinds for judge in (0, 1)]
    names = (
        "weighed, %",
        "right, %",
        "this place refused, %",
        "another accepted, %",
        f"another above {_SURE:g}, %",
        "error",
        "error by chance",
    )
    return Table(
        "All arms together",
        ("", *(name for kind in kinds for name in (kind, "who knows"))),
        tuple(zip(names, *columns, strict=True)),
    )


def _of_all(
    found: dict[tuple[Arm, str], tuple[Tally, ...]], kind: str, judge: int
) -> tuple[str, ...]:
    """Return a column: what a judge says of all sketches of a generator."""
    here, there = (
        reduce(
            operator.add,
            (every[judge] for (arm, of), every in found.items() if (arm.wrong_place, of) == side),
        )
        for side in ((False, kind), (True, kind))
    )
    shares = (
        here.among / here.sketches,
        here.right / here.sketches,
        sum(place < _LIKELY for place in here.places) / here.sketches,
        sum(place > _LIKELY for place in there.places) / there.sketches,
        sum(place > _SURE for place in there.places) / there.sketches,
    )
    maps = here.maps + there.maps
    errors = reliability(maps).error, by_chance([said for said, _ in maps])
    return (*(f"{100 * share:.1f}" for share in shares), *(f"{error:.3f}" for error in errors))


def _cells(arm: Arm, both: tuple[Tally, Tally], others: Sequence[Tally]) -> list[str]:
    wanted, sketches = _WANTED.get(arm.name), both[0].sketches
    parts = [f"{wanted}" if wanted else "–"]
    if arm.wrong_place:
        parts += ["–"] * 4
    else:
        rights = [both[0].among, *(each.right for each in (*both, *others[:1]))]
        parts += [f"{100 * right / sketches:.1f}" for right in rights]
        parts += ["–"] * (not others)
    for each in both:
        wrong = [(place > _LIKELY) == arm.wrong_place for place in each.places]
        parts.append(f"{100 * sum(wrong) / each.sketches:.1f}")
    for each in both:
        sure = sum(place > _SURE for place in each.places)
        parts.append(f"{100 * sure / each.sketches:.1f}" if arm.wrong_place else "–")
    parts += [f"{reliability(each.maps).error:.3f}" for each in both]
    return [*parts, f"{by_chance([said for said, _ in both[1].maps]):.3f}"]


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser("python -m tests.experiments.ceilings")
    parser.add_argument("--sketches", type=int, default=_SKETCHES, help="of each arm")
    parser.add_argument("--first", type=int, default=_FIRST, help="number of the first of them")
    parser.add_argument("--learned", type=int, default=_LEARNED, help="of each arm, others")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--kept", type=Path, help="a folder for sketches in numbers")
    parser.add_argument("--out", type=Path, help="a file for the table, beside printing it")
    given = parser.parse_args(arguments)
    sketches = range(given.first, given.first + given.sketches)
    learned = range(_LEARNED_FROM, _LEARNED_FROM + given.learned)
    tallies = ceilings(given.kinds, sketches, learned, given.kept)
    found = markdown(
        Heading("Ceilings", 1),
        Paragraph(
            f"By `python -m tests.experiments.ceilings`: {given.sketches} sketches of each arm, "
            f"the first with number {given.first}. The judge that knows has seen {given.learned} "
            "others of each arm of the generator."
        ),
        table(tallies),
        together(tallies),
    )
    print(found, end="")
    if given.out:
        given.out.write_text(found, encoding="utf-8")


if __name__ == "__main__":
    main()
