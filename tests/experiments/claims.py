"""What the thesis claims, and whether it holds on our data."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from statistics import mean, median

from tests.experiments import thesis
from tests.experiments.cases import Record
from tests.experiments.intervals import wilson
from tests.experiments.protocol import LETTERS, SMALL_TITLES
from tests.experiments.records import Results, chosen, grouped, right, share
from tests.experiments.scenes import PLACES

__all__ = ["CONFIRMED", "IN_PART", "REFUTED", "Claim", "claims"]

CONFIRMED, IN_PART, REFUTED = "confirmed", "in part", "not confirmed"

_MAP, _SWEEP = "all objects, map", "one missing, map"
_BOTH = ("all objects, map", "all objects, grid")
_SWEEPS = ("one missing, map", "one missing, grid")


@dataclass(frozen=True)
class Claim:
    """A claim, where the thesis makes it, what became of it, and the numbers."""

    text: str
    source: str
    verdict: str
    finding: str


def claims(results: Results) -> list[Claim]:
    """Return the claims for which there are experiments, the thesis's methods and two sketches."""
    if results.sketches < 2 or not {"easm", "fsnn-pso"} <= set(results.methods):
        return []
    return [
        claim(results)
        for claim, needs in _CLAIMS.items()
        if all(title in results for title in needs)
    ]


def _always_right(results: Results) -> Claim:
    own = [record for title in _BOTH for record in chosen(results[title], method="easm")]
    wrong = len(own) - right(own)
    misled = sum(record.misled for record in own)
    return Claim(
        "With equal numbers of objects EASM always finds the right object map.",
        "4.2, 5; tables 4.3, 4.4, 4.6, 4.7",
        CONFIRMED if not wrong else IN_PART if wilson(right(own), len(own))[0] > 0.97 else REFUTED,
        f"{share(right(own), len(own))} % of {len(own)} cases are wholly right (thesis: 36 of 36)"
        + (f"; in {misled} of the {wrong} others a wrong map has the higher ζ." if wrong else "."),
    )


def _fsnn_good(results: Results) -> Claim:
    own = chosen(results[_MAP], method="fsnn-pso")
    failed = [record for record in own if not record.perfect]
    above = sum(record.zeta > record.true_zeta for record in failed)
    tables = (thesis.EQUAL["4.1"], thesis.EQUAL["4.2"])
    printed = sum(rows[letter].right == rows["a"].right for rows in tables for letter in LETTERS)
    thesis_low, thesis_high = wilson(printed, 2 * len(LETTERS))

    def agrees(records: Sequence[Record]) -> bool:
        low, high = wilson(right(records), len(records))
        return high >= thesis_low and low <= thesis_high

    worlds = [agrees(own)]
    finding = (
        f"Thesis: {share(printed, 2 * len(LETTERS))} %. Of people calibrated on ζ alone "
        f"{share(right(own), len(own))} % of {len(own)} sketches are wholly right, "
        f"which {'agrees' if worlds[0] else 'does not agree'} with it; the FMAPs that FSNN keeps "
        f"need not lead to a consistent object map, and in {share(above, len(failed))} % of its "
        "failures the one it found has a higher ζ than the right one."
    )
    if SMALL_TITLES[0] in results:
        upright, turned = (
            {
                method: chosen(results[title], method=method)
                for method in ("fsnn-pso", "fsnn-folded")
            }
            for title in SMALL_TITLES
        )
        worlds.append(agrees(upright["fsnn-pso"]))
        shares = [
            share(right(records), len(records)) for records in (*upright.values(), *turned.values())
        ]
        finding += (
            f" Of people calibrated on the parts of ζ, who draw things small and upright, "
            f"{shares[0]} % of {len(upright['fsnn-pso'])} are, which "
            f"{'agrees' if worlds[1] else 'does not agree'}, and {shares[1]} % with R̂ folded as "
            f"the thesis prints it; with the paper turned anyhow {shares[2]} % and {shares[3]} %."
        )
    return Claim(
        "FSNN gives good results on all but one sketch of each scene.",
        "4.1; tables 4.1, 4.2",
        CONFIRMED if all(worlds) else IN_PART if any(worlds) else REFUTED,
        f"{finding} Our fsnn-pso follows the thesis's text; its program is not available.",
    )


def _fsnn_failures(results: Results) -> Claim:
    failed = [r for r in chosen(results[_MAP], method="fsnn-pso") if not r.perfect]
    below = sum(record.zeta < record.true_zeta for record in failed)
    part = below / len(failed) if failed else 1.0
    return Claim(
        "Where FSNN fails, the right FMAP has a higher ζ than the swarm found: an exhaustive "
        "search would be right.",
        "4.1",
        CONFIRMED if part > 0.95 else IN_PART if part > 0.5 else REFUTED,
        f"So in {share(below, len(failed))} % of {len(failed)} failures.",
    )


def _higher_zeta(results: Results) -> Claim:
    ours = _paired(results[_MAP])
    higher = sum(easm.zeta > fsnn.zeta for easm, fsnn in ours)
    printed = [
        (thesis.EQUAL[easm][letter].zeta, thesis.EQUAL[fsnn][letter].zeta)
        for easm, fsnn in (("4.3", "4.1"), ("4.4", "4.2"))
        for letter in LETTERS
    ]
    theirs = sum(easm > fsnn for easm, fsnn in printed)
    return Claim(
        "EASM finds FMAPs with a higher ζ than FSNN, always.",
        "4.2; tables 4.1 to 4.4",
        _verdict(higher / len(ours)),
        f"EASM's ζ is the higher one in {share(higher, len(ours))} % of {len(ours)} sketches; in "
        f"the thesis's own tables in {theirs} of {len(printed)}. FSNN's FMAPs obey fewer "
        "conditions, so theirs can be higher.",
    )


def _confident_omap(results: Results) -> Claim:
    own = chosen(results[_MAP], method="easm")
    concordant, pairs = 0, 0
    for sketches in grouped(own, lambda record: record.case.place).values():
        agreeing, of = _concordance([(record.zeta, record.omega) for record in sketches])
        concordant, pairs = concordant + agreeing, pairs + of
    printed = [_printed_concordance(table) for table in ("4.3", "4.4")]
    theirs, their_pairs = sum(agreeing for agreeing, _ in printed), sum(of for _, of in printed)
    return Claim(
        "A more confident FMAP always translates into a more confident OMAP.",
        "4.2",
        _verdict(concordant / pairs),
        f"Of two sketches the one with the higher ζ has the higher Ω in "
        f"{100 * concordant / pairs:.0f} % of all pairs; in the thesis's tables 4.3 and 4.4 in "
        f"{theirs} of {their_pairs}.",
    )


def _faster(results: Results) -> Claim:
    own = [record for record in results["times, 3 to 8 objects"] if record.objects == 8]
    seconds = {
        method: median(record.seconds for record in each)
        for method, each in grouped(own, lambda record: record.method).items()
    }
    ratio = seconds["fsnn-pso"] / seconds["easm"]
    easm, fsnn = thesis.SECONDS[8]
    return Claim(
        f"EASM converges {fsnn / easm:.1f} times faster than FSNN at 8 objects.",
        "4.2; table 4.5",
        CONFIRMED if ratio > 100 else IN_PART if ratio > 1.5 else REFUTED,
        f"{ratio:.1f} times: {1e3 * seconds['fsnn-pso']:.0f} ms against "
        f"{1e3 * seconds['easm']:.0f} ms. Compiled FSNN is {fsnn / seconds['fsnn-pso']:,.0f} times "
        f"as fast as the thesis's, EASM {easm / seconds['easm']:,.0f} times; auto takes "
        f"{1e3 * seconds['auto']:.1f} ms and proves that no object map has a higher ζ.",
    )


def _grid_like_map(results: Results) -> Claim:
    found = {}
    for name, titles in (("map", (_MAP, _SWEEP)), ("grid", (_BOTH[1], _SWEEPS[1]))):
        found[name] = [record for t in titles for record in chosen(results[t], method="easm")]
    shares = {name: right(own) / len(own) for name, own in found.items()}
    zetas = {name: mean(record.zeta for record in own) for name, own in found.items()}
    return Claim(
        "An occupancy grid gives results not very different from the map's.",
        "4.3, 4.6; tables 4.6, 4.7, 4.18",
        CONFIRMED if abs(shares["map"] - shares["grid"]) < 0.03 else REFUTED,
        f"Wholly right with all objects or one missing: {100 * shares['map']:.1f} % with the map, "
        f"{100 * shares['grid']:.1f} % with the grid; mean ζ {zetas['map']:.3f} and "
        f"{zetas['grid']:.3f}.",
    )


def _share_with_one_missing(results: Results) -> Claim:
    own = [record for title in _SWEEPS for record in chosen(results[title], method="easm")]
    high = wilson(right(own), len(own))[1]
    target = thesis.TOTAL.perfect / thesis.TOTAL.tests
    finding = (
        f"{share(right(own), len(own))} % of {len(own)} cases (thesis: "
        f"{share(thesis.TOTAL.perfect, thesis.TOTAL.tests)} % of {thesis.TOTAL.tests})"
    )
    title = "strength 1.05"
    if title in results:
        stronger = [r for r in chosen(results[title], method="easm") if r.case.removed.sketch]
        finding += (
            f". At strength 1.05, which gives the thesis's ζ without case (a), it is "
            f"{share(right(stronger), len(stronger))} %"
        )
        below = wilson(right(stronger), len(stronger))[1] < target
        finding += ", less than the thesis's" if below else ""
    reached = right(own) / len(own) >= target
    verdict = CONFIRMED if reached else IN_PART if high >= target else REFUTED
    return Claim(
        "With one object missing EASM is wholly right in 88.5 % of cases.",
        "abstract, 4.6; table 4.18",
        verdict,
        f"{finding}. The strength was chosen by ζ, not by this share.",
    )


def _breaking_point(results: Results) -> Claim:
    parts, all_none = [], True
    for number, place, breaks in (("4.12", "A", 5), ("4.13", "B", 4)):
        own = [
            record
            for record in chosen(results["several missing"], place=place, method="easm")
            if len(record.case.removed.sketch) == breaks
        ]
        none = sum(record.right == 0 for record in own)
        all_none = all_none and none == len(own)
        parts.append(
            f"scene {place} without {breaks} (table {number}): {share(right(own), len(own))} % "
            f"wholly right, {100 * none / len(own):.0f} % without any right object"
        )
    return Claim(
        "EASM fails when 5 objects of scene A or 4 of scene B are missing.",
        "4.4; tables 4.12, 4.13",
        CONFIRMED if all_none else IN_PART,
        f"In most cases, but there is no sharp point: {'; '.join(parts)}.",
    )


def _quality_counts(results: Results) -> Claim:
    own = sorted(chosen(results[_SWEEP], method="easm"), key=lambda record: record.true_zeta)
    quarter = max(1, len(own) // 4)
    worst, best = own[:quarter], own[-quarter:]
    apart = wilson(right(worst), quarter)[1] < wilson(right(best), quarter)[0]
    return Claim(
        "With an object missing, the quality of the sketch matters much.",
        "4.4, 5",
        CONFIRMED if apart else REFUTED,
        f"Wholly right: {share(right(worst), quarter)} % in the quarter of cases with the lowest ζ "
        f"of the truth, {share(right(best), quarter)} % in the one with the highest.",
    )


def _place_counts(results: Results) -> Claim:
    parts, differ = [], False
    for place in PLACES:
        own = chosen(results[_SWEEP], place=place, method="easm")
        by_object = grouped(own, lambda record: record.case.removed.sketch[0])
        ordered = sorted(by_object.items(), key=lambda item: right(item[1]) / len(item[1]))
        (low, worst), (high, best) = ordered[0], ordered[-1]
        labels = PLACES[place].furniture.labels
        differ |= wilson(right(worst), len(worst))[1] < wilson(right(best), len(best))[0]
        parts.append(
            f"scene {place}: {share(right(worst), len(worst))} % without the {labels[low]}, "
            f"{share(right(best), len(best))} % without the {labels[high]}"
        )
    return Claim(
        "Which object is missing matters.",
        "4.4",
        CONFIRMED if differ else REFUTED,
        f"Wholly right, {'; '.join(parts)}.",
    )


def _any_heading(results: Results) -> Claim:
    own = [
        record
        for record in chosen(results["rotation"], method="easm")
        if not record.case.removed.sketch
    ]
    sketches = grouped(own, lambda record: (record.case.place, record.case.number))
    reach = max(
        max(record.true_zeta for record in each) - min(record.true_zeta for record in each)
        for each in sketches.values()
    )
    shares = [right(each) / len(each) for each in grouped(own, _paper).values()]
    return Claim(
        "How the sketch is turned does not matter.",
        "abstract, 3",
        CONFIRMED if max(shares) - min(shares) < 0.05 else REFUTED,
        f"Wholly right with all objects: {100 * min(shares):.1f} to {100 * max(shares):.1f} % by "
        f"heading; ζ of the truth of one sketch moves by {reach:.4f} at most.",
    )


_Needs = tuple[str, ...]
_CLAIMS: dict[Callable[[Results], Claim], _Needs] = {
    _always_right: _BOTH,
    _fsnn_good: (_MAP,),
    _fsnn_failures: (_MAP,),
    _higher_zeta: (_MAP,),
    _confident_omap: (_MAP,),
    _faster: ("times, 3 to 8 objects",),
    _grid_like_map: (*_BOTH, *_SWEEPS),
    _share_with_one_missing: _SWEEPS,
    _breaking_point: ("several missing",),
    _quality_counts: (_SWEEP,),
    _place_counts: (_SWEEP,),
    _any_heading: ("rotation",),
}


def _paper(record: Record) -> float:
    return record.case.style.paper


def _paired(records: Sequence[Record]) -> list[tuple[Record, Record]]:
    """Return what easm and fsnn-pso made of the same sketches."""
    by_case = grouped(records, lambda record: record.case)
    found = [{record.method: record for record in each} for each in by_case.values()]
    both = [each for each in found if {"easm", "fsnn-pso"} <= each.keys()]
    return [(each["easm"], each["fsnn-pso"]) for each in both]


def _concordance(points: Sequence[tuple[float, float]]) -> tuple[int, int]:
    """Return in how many pairs of points both coordinates order alike, and how many there are."""
    pairs = [
        (a[0] - b[0]) * (a[1] - b[1])
        for a, b in combinations(points, 2)
        if a[0] != b[0] and a[1] != b[1]
    ]
    return sum(product > 0 for product in pairs), len(pairs)


def _printed_concordance(table: str) -> tuple[int, int]:
    rows = thesis.EQUAL[table]
    return _concordance([(rows[letter].zeta, rows[letter].omega) for letter in LETTERS])


def _verdict(part: float) -> str:
    return CONFIRMED if part > 0.99 else IN_PART if part > 0.5 else REFUTED
