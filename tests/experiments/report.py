"""The report, put together from the records of the experiments."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from statistics import mean, median

from tests.experiments import arm_tables, plots, tables, thesis
from tests.experiments.calibrate import calibrated
from tests.experiments.cases import Record
from tests.experiments.claims import claims
from tests.experiments.document import Block, Bullets, Heading, Paragraph, Table
from tests.experiments.examples import examples
from tests.experiments.learn import LEARNED
from tests.experiments.methods import THESIS
from tests.experiments.protocol import MAPS, SMALL_TITLES, STRONGER
from tests.experiments.records import (
    Results,
    chosen,
    drawn_as_usual,
    given_probabilities,
    grouped,
    right,
    share,
)
from tests.experiments.reliability import reliability
from tests.experiments.scenes import PLACES
from tests.experiments.study import SMALL, STRENGTH

__all__ = ["report"]

_TITLE = "The thesis's experiments, on scenes and sketches of our own"

_WHAT_IS_WHOSE = (
    "The thesis is “Scene Matching Between a Quantitative Map and a Qualitative Hand Drawn "
    "Sketch”. Its are the method (force histograms, ζ, Ω, FSNN with a swarm, EASM), the five "
    "experiments, and every number in a column or line called “thesis”, copied from its tables.",
    "Its figures are not available, and with them its scenes and its sketches, which people drew "
    "in a user study. Ours are two furnished rooms, A with 8 objects and B with 7 as there, as "
    "maps to scale and as occupancy grids that a simulated robot makes with its lidar.",
    "Our sketches are simulated: a model of how people draw (tests/experiments/people.py) turns, "
    "stretches and displaces what is there and lets a trembling pen draw it; the strokes go "
    "through the real segmenter. No person drew any of them, so no number here says how well "
    "anything does with people; it says how methods compare on the same sketches.",
    "fsnn-pso and easm are our programs of the thesis's text; its own are not available. auto, "
    "exact and direct are ours and maximise the same ζ. default is what a match is that chooses "
    "nothing: it may leave objects without partner and judges maps by more than ζ. What makes "
    "probabilities was learned from other sketches by the same model of how people "
    "draw, of these two rooms and of others (tests/experiments/learn.py).",
)

_EQUAL_CASES = 36
"""Sketches (b) to (j) of two scenes, each with the map and the grid: all right with EASM."""

_CONTRADICTIONS = (
    "Table 4.18 exchanges ζ and Ω of two of its rows, scene A with the grid and scene B with the "
    "map, as the appendices tell.",
    "It counts 62 perfect results and 493 right objects of scene A with the map; appendix A has 61 "
    "and 492.",
    "Table 4.11's average is that of all of appendix B; its own rows have ζ 0.922.",
    "Table 4.15 has 6 right objects for sketch (l), appendix D has 5.",
)


def report(results: Results) -> list[Block]:
    """Return the report: what the experiments that were done allow."""
    blocks: list[Block] = [Heading(_TITLE, 1), *_introduction(results)]
    for section in _SECTIONS:
        blocks += section(results)
    return blocks


def _introduction(results: Results) -> Iterator[Block]:
    done = (*results.experiments.values(), *results.judged.values())
    cases = sum(len(records) for records in done)
    yield Paragraph(
        f"{results.sketches} sketches of each scene and arm, {cases:,} matches, methods "
        f"{', '.join(results.methods)}. The same seeds give the same numbers again, times apart. "
        "Written by `make experiments`."
    )
    yield Heading("What is whose")
    yield Bullets(_WHAT_IS_WHOSE)


def _headline(results: Results) -> Iterator[Block]:
    """Yield the numbers and the picture of the README."""
    equal = [f"all objects, {map_}" for map_ in MAPS]
    missing = [f"one missing, {map_}" for map_ in MAPS]
    needed = (*equal, *missing, "several missing", "times, 3 to 8 objects")
    ours = [method for method in results.methods if method not in THESIS]
    if not ours or not all(title in results for title in needed):
        return
    total, (easm, fsnn) = thesis.TOTAL, thesis.SECONDS[8]
    yield Heading("In short")
    yield Table(
        "Against the thesis",
        ("", "thesis", *(f"{method}, on our data" for method in ours)),
        (
            (
                "all objects drawn: wholly right, %",
                share(_EQUAL_CASES, _EQUAL_CASES),
                *(_share_of(results, equal, method) for method in ours),
            ),
            (
                "one object missing: wholly right, %",
                share(total.perfect, total.tests),
                *(_share_of(results, missing, method) for method in ours),
            ),
            (
                "time of a search at 8 objects",
                f"{easm} s (EASM), {fsnn} s (FSNN)",
                *(_time_at_eight(results, method) for method in ours),
            ),
        ),
        note="With Wilson's 95 % interval; the thesis's shares are of its EASM, map and grid.",
    )
    yield plots.against_the_thesis(results)


def _share_of(results: Results, titles: Iterable[str], method: str) -> str:
    own = [record for title in titles for record in chosen(results[title], method=method)]
    return share(right(own), len(own))


def _time_at_eight(results: Results, method: str) -> str:
    own = chosen(results["times, 3 to 8 objects"], method=method)
    seconds = [record.seconds for record in own if record.objects == 8]
    return f"{1e3 * median(seconds):.1f} ms" if seconds else "–"


def _claims(results: Results) -> Iterator[Block]:
    found = claims(results)
    if not found:
        return
    yield Heading("The thesis's claims")
    yield Paragraph("Each is put to the test on our data, with the thesis's own method.")
    rows = tuple((claim.text, claim.source, claim.verdict) for claim in found)
    yield Table("Claims", ("claim", "where", "on our data"), rows, left=3)
    yield Bullets(
        tuple(f"{claim.text} {claim.verdict.capitalize()}. {claim.finding}" for claim in found)
    )


def _equal(results: Results) -> Iterator[Block]:
    maps = [map_ for map_ in MAPS if f"all objects, {map_}" in results]
    if not maps:
        return
    yield Heading("Experiments 1 to 3: all objects drawn")
    yield tables.equal_summary(results, maps)
    for map_ in maps:
        for place in PLACES:
            yield tables.equal(results, place, map_)


def _small(results: Results) -> Iterator[Block]:
    if SMALL_TITLES[0] in results:
        yield Heading("Another world: things drawn small")
        yield Paragraph(
            "ζ alone does not say how the thesis's people drew. Its tables of EASM print Ω, which "
            "for maps of objects is ζσ, and with ζ that tells ζR + ζL: less alike in shape than "
            "ours above, better in direction and size. So these people draw everything "
            f"{SMALL.small:g} times as large as it is, between places that are right, and their "
            "paper is upright."
        )
        yield tables.small_objects(results)


def _missing(results: Results) -> Iterator[Block]:
    maps = [map_ for map_ in MAPS if f"one missing, {map_}" in results]
    if not maps:
        return
    yield Heading("Experiments 4 and 5: missing and extra objects")
    if len(maps) == len(MAPS):
        yield tables.protocol_of_418(results)
        yield tables.summary_418(results)
        yield plots.one_missing(results)
        studies = tables.studies_of_nine(results)
        if studies.rows:
            yield studies
    if "one missing, map" in results and "auto" in results.methods:
        yield plots.zeta(results, "auto")
    for map_ in maps:
        for number, (_, grid, _) in thesis.ONE_MISSING_TABLES.items():
            if grid == MAPS[map_]:
                yield tables.one_missing(results, number)
        for place in PLACES:
            yield tables.unequal(results, place, map_)
    if "several missing" in results:
        for number, place in (("4.12", "A"), ("4.13", "B")):
            yield tables.several_missing(results, number, place)
        if "all objects, map" in results:
            yield plots.missing(results)


def _times(results: Results) -> Iterator[Block]:
    if "times, 3 to 8 objects" in results:
        yield Heading("Time")
        yield tables.times(results)
        yield plots.times(results)


def _sweeps(results: Results) -> Iterator[Block]:
    if "strength" in results:
        yield Heading("Jitter")
        yield plots.strength(results)
        yield _stronger(results)
    if "rotation" in results:
        yield Heading("Rotation")
        yield plots.rotation(results)
    if "shapes" in results:
        yield Heading("Simplified shapes")
        yield Paragraph(
            "People simplify. Here they draw a box, or an ellipse, for everything, and keep of "
            "each thing its place, its size and its direction."
        )
        yield _by_shapes(results)
    if "missing and extra" in results:
        yield Heading("Missing and extra at once")
        yield tables.both_ways(results)


def _parts(results: Results) -> Iterator[Block]:
    judged = [each for records in results.judged.values() for each in records]
    if not judged:
        return
    yield Heading("Parts of maps, and other places")
    yield Paragraph(
        "People draw a few things of a map of many, forget some and draw one that is not there; "
        "and the map may be of another place. These sketches are by two generators that differ in "
        "kind from each other and from the people above, and from which nothing was learned: "
        "plain strews things over a floor, displaces each by 0.22 of the spacing along x and y "
        "and stretches it by up to 25 %; memory draws furnished rooms along a corridor as people "
        "remember them, who straighten, know three sizes, keep order better than distance, and "
        "move what belongs together as one."
    )
    if any(not each.arm.wrong_place for each in judged):
        yield arm_tables.parts(judged)
    if any(each.arm.wrong_place for each in judged):
        yield arm_tables.places(judged)
    yield arm_tables.together(judged)
    yield Paragraph(_CEILING)


def _stronger(results: Results) -> Table:
    records = results[f"strength {STRONGER:g}"]
    return _whole_and_missing(
        f"The same at strength {STRONGER:g}, map", "strength", {f"{STRONGER:g}": records}
    )


def _by_shapes(results: Results) -> Table:
    drawn = grouped(results["shapes"], lambda record: str(record.case.style.person.shapes))
    return _whole_and_missing("What people draw for a thing, map", "drawn", drawn)


def _whole_and_missing(title: str, what: str, groups: Mapping[str, Sequence[Record]]) -> Table:
    """Return for each group, scene and method what comes of all objects, and of one missing."""
    rows = []
    for name, records in groups.items():
        for place, method in product(PLACES, dict.fromkeys(record.method for record in records)):
            own = chosen(records, place=place, method=method)
            whole = [record for record in own if not record.case.removed.sketch]
            one = [record for record in own if record.case.removed.sketch]
            figures = [share(right(each), len(each)) for each in (whole, one)]
            zeta = f"{mean(record.true_zeta for record in whole):.3f}"
            rows.append((name, place, method, f"{len(whole)}", zeta, *figures))
    return Table(
        title,
        (what, "scene", "method", "sketches", "ζ of the truth", "all objects, %", "one missing, %"),
        tuple(rows),
        left=3,
        note="Wholly right, with Wilson's 95 % interval.",
    )


def _calibration(_results: Results) -> Iterator[Block]:
    found = calibrated()
    yield Heading("Calibration of the simulated people")
    yield Paragraph(
        f"One dial, the strength, says how far drawings leave the truth. It is {STRENGTH:g}, found "
        "once on other sketches than any above, so that ζ of the right map is what the thesis "
        "prints as its mean with all objects, 0.911 and 0.913 (tables 4.3 and 4.4). These means "
        "count case (a), the map with itself, as 1.000; sketches (b) to (j) alone have 0.901 and "
        f"0.903, as at strength {STRONGER:g}. One dial cannot also give the thesis's 0.897 with "
        "one missing, as taking an object away hardly changes ζ of the right map."
    )
    for first, lines in (("strength", found.strengths), ("drawn", found.shapes)):
        yield Table(
            f"ζ of the right map and the share wholly right with auto, by {first}",
            (
                first,
                "scene",
                "ζ, all",
                "sd",
                "ζ, one missing",
                "sd",
                "right, all, %",
                "one missing",
            ),
            tuple(
                (
                    line.drawn,
                    line.place,
                    f"{line.zeta:.3f}",
                    f"{line.spread:.3f}",
                    f"{line.zeta_missing:.3f}",
                    f"{line.spread_missing:.3f}",
                    f"{100 * line.right:.1f}",
                    f"{100 * line.right_missing:.1f}",
                )
                for line in lines
            ),
            left=2,
            note=f"{found.sketches} sketches of each scene, on the map. sd: among sketches, and "
            "among the objects taken from one sketch. The thesis's appendices have 0.018 and 0.012 "
            "among sketches, 0.009 and 0.010 among objects.",
        )
    yield Paragraph(
        "The thesis's Ω of 0.81 beside a ζ of 0.91 is not what these people give: for FMAPs that "
        "one object map induces Ω is ζσ, and ours have a higher one. FMAPs that are legal pair by "
        "pair alone have a lower Ω, but a ζ above the right map's, and lead to few right object "
        "maps. People who draw things small have both: the table below has what ways to draw give "
        "beside what the thesis prints, and the one chosen comes nearest to sketches (b) to (j)."
    )
    yield Table(
        "Parts of ζ of the right map, by how large things are drawn and by strength",
        ("drawn", "ζσ", "(ζR + ζL) / 2", "ζ"),
        tuple(
            (line.drawn, f"{line.similarity:.3f}", f"{line.others:.3f}", f"{line.zeta:.3f}")
            for line in found.parts
        ),
        note=f"{found.sketches} upright sketches of each scene, on the map. Thesis: tables 4.3 and "
        "4.4, where ζσ is Ω and ζR + ζL is 3ζ − Ω.",
    )
    yield Table(
        "EASM by what makes an FMAP legal, all objects drawn",
        ("scene", "method", "ζ found", "Ω", "Ω where right", "right, %"),
        tuple(
            (
                line.place,
                line.method,
                f"{line.zeta:.3f}",
                f"{line.omega:.3f}",
                f"{line.omega_right:.3f}",
                f"{100 * line.right:.1f}",
            )
            for line in found.legal
        ),
        left=2,
    )


def _learning(_results: Results) -> Iterator[Block]:
    found = json.loads(LEARNED.read_text(encoding="utf-8"))
    yield Heading("How the probabilities of ζ were learned")
    errors = found["odds"]["errors"]
    yield Paragraph(
        "What makes probabilities of the thesis's ζ, which the judge confidence gives, was learned "
        f"from {found['sketches']['odds']} sketches of these rooms and random ones, with people "
        "who draw better and worse, outlines, boxes and ellipses; none of them is used above. On "
        f"{found['sketches']['check']} others the expected calibration error is "
        f"{errors['maps']:g} for maps and {errors['objects']:g} for single objects."
    )


def _probabilities(results: Results) -> Iterator[Block]:
    records = [
        record
        for title, each in results.experiments.items()
        if drawn_as_usual(title)
        for record in each
    ]
    found = {
        method: reliability(answers)
        for method, own in grouped(records, lambda record: record.method).items()
        if method not in THESIS and (answers := given_probabilities(own))
    }
    if found:
        yield Heading("Whether probabilities are what they say")
        yield tables.calibration(results)
        for method, each in found.items():
            yield plots.reliability(method, each)


def _examples(results: Results) -> Iterator[Block]:
    pictures = list(examples(results, "auto")) if "auto" in results.methods else []
    if pictures:
        yield Heading("Examples")
        yield from pictures


def _appendices(results: Results) -> Iterator[Block]:
    maps = [map_ for map_ in MAPS if f"one missing, {map_}" in results]
    if maps:
        yield Heading("Appendices A to D")
        for map_ in maps:
            for place in PLACES:
                yield tables.appendix(results, place, map_)


def _print(_results: Results) -> Iterable[Block]:
    return Heading("Where the thesis's print does not agree with itself"), Bullets(_CONTRADICTIONS)


_CEILING = (
    "What keeps sketches with something extra from being right is the judge, and what it learned "
    "from: of 120 with seven things and one extra the right map was among those weighed in 100 % "
    "on maps of 8 and in 97.5 (memory) and 98.3 % (plain) on maps of 20. A judge that went on "
    "learning from 496 further sketches of plain, by the same numbers of lines and maps, had 95 % "
    "of 60 right on 8 and 93 % on 20, where one that knows none of them had 80 %; of memory it "
    "had fewer right than before. So what would help most is to know how people draw."
)

_SECTIONS = (
    _headline,
    _claims,
    _equal,
    _small,
    _missing,
    _times,
    _sweeps,
    _parts,
    _probabilities,
    _examples,
    _learning,
    _calibration,
    _print,
    _appendices,
)
