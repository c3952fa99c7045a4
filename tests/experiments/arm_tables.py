"""Tables of the arms: what is right, what could be, and whether probabilities say so."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np

from tests.experiments.arms import Judged
from tests.experiments.document import Table
from tests.experiments.generators import KINDS
from tests.experiments.records import grouped, share
from tests.experiments.reliability import reliability

__all__ = ["parts", "places", "together"]

_LIKELY, _SURE = 0.5, 0.95
_ERRORS = ("error of map", "of lines", "of place")
_ERRORS_NOTE = (
    "error: expected calibration error in ten bins of what is said of the map, of each of its "
    "lines, “no partner” too, and of the place."
)
_INTERVAL = "Shares are in per cent, with Wilson's 95 % interval."


def parts(records: Sequence[Judged]) -> Table:
    """Return the arms whose sketches show the place: one line an arm, generator and method."""
    return Table(
        "Sketches of parts of a map",
        (
            "drawn",
            "sketches by",
            "method",
            "sketches",
            "wholly right, %",
            "objects, %",
            "right map met, %",
            "place refused, %",
            *_ERRORS,
            "ms",
            "p95",
        ),
        tuple(
            (
                *keys,
                f"{len(own)}",
                share(sum(each.perfect for each in own), len(own)),
                f"{100 * sum(r.right for r in own) / sum(r.objects for r in own):.1f}",
                f"{100 * sum(each.among for each in own) / len(own):.1f}",
                _where(own, lambda place: place < _LIKELY),
                *_errors(own),
                *_times(own),
            )
            for keys, own in _lines([each for each in records if not each.arm.wrong_place])
        ),
        left=3,
        note="Eight neighbours are seen; “7 of 20” shows seven of them on a map of 20. objects: "
        "share of sketched objects with the right partner, or rightly with none. right map met: "
        "it is the answer or among the next hundred, so no judgement of these maps is right more "
        f"often. place refused: with a probability below {_LIKELY:g}. {_ERRORS_NOTE} ms: median "
        f"time of a match. {_INTERVAL}",
    )


def places(records: Sequence[Judged]) -> Table:
    """Return the arms whose sketches show another place."""
    return Table(
        "Sketches of other places",
        (
            "drawn",
            "sketches by",
            "method",
            "sketches",
            f"place above {_LIKELY:g}, %",
            f"place above {_SURE:g}, %",
            f"map above {_LIKELY:g}, %",
            *_ERRORS,
            "ms",
            "p95",
        ),
        tuple(
            (
                *keys,
                f"{len(own)}",
                _where(own, lambda place: place > _LIKELY),
                _where(own, lambda place: place > _SURE),
                _share_of([r.probability for r in own], lambda said: said > _LIKELY),
                *_errors(own),
                *_times(own),
            )
            for keys, own in _lines([each for each in records if each.arm.wrong_place])
        ),
        left=3,
        note="Each is a sketch of eight neighbours of another map of the same kind, with as many "
        f"objects. None should be believed. {_ERRORS_NOTE} {_INTERVAL}",
    )


def together(records: Sequence[Judged]) -> Table:
    """Return all arms together: what must hold of probabilities, right and wrong places mixed."""
    rows = []
    for kind, method in product((*KINDS, "both"), dict.fromkeys(each.method for each in records)):
        own = [r for r in records if kind in (r.kind, "both") and r.method == method]
        right, wrong = (
            [each for each in own if each.arm.wrong_place is elsewhere]
            for elsewhere in (False, True)
        )
        rows.append(
            (
                kind,
                method,
                f"{len(own)}",
                _where(right, lambda place: place < _LIKELY),
                _where(wrong, lambda place: place > _LIKELY),
                _where(wrong, lambda place: place > _SURE),
                *_errors(own),
            )
        )
    return Table(
        "All arms together",
        (
            "sketches by",
            "method",
            "sketches",
            "right place refused, %",
            f"wrong above {_LIKELY:g}, %",
            f"wrong above {_SURE:g}, %",
            *_ERRORS,
        ),
        tuple(rows),
        left=2,
        note=f"{_ERRORS_NOTE} {_INTERVAL}",
    )


def _lines(records: Sequence[Judged]) -> list[tuple[tuple[str, str, str], list[Judged]]]:
    """Return records by arm, generator and method, each arm's name at its first line alone."""
    arms = dict.fromkeys(each.arm for each in records)
    groups = grouped(records, lambda each: (each.arm, each.kind, each.method))
    keys = sorted(groups, key=lambda key: ([*arms].index(key[0]), KINDS.index(key[1])))
    seen: set[str] = set()
    lines = []
    for arm, kind, method in keys:
        name = "" if arm.name in seen else arm.name
        seen.add(arm.name)
        lines.append(((name, kind, method), groups[arm, kind, method]))
    return lines


def _where(records: Sequence[Judged], holds: Callable[[float], bool]) -> str:
    return _share_of([each.place for each in records], holds)


def _share_of(said: Sequence[float | None], holds: Callable[[float], bool]) -> str:
    """Return the share of the probabilities given for which something holds."""
    given = [each for each in said if each is not None]
    return share(sum(map(holds, given)), len(given))


def _errors(records: Sequence[Judged]) -> tuple[str, str, str]:
    """Return the calibration errors of map, lines and place; a dash where nothing is said."""
    maps = [(r.probability, r.perfect) for r in records if r.probability is not None]
    lines = [line for record in records for line in record.lines]
    place = [(r.place, not r.arm.wrong_place) for r in records if r.place is not None]
    first, second, third = (
        f"{reliability(each).error:.3f}" if each else "–" for each in (maps, lines, place)
    )
    return first, second, third


def _times(records: Sequence[Judged]) -> tuple[str, str]:
    """Return the median time of a match, and what 95 % stay below, in milliseconds."""
    middle, most = np.percentile([1e3 * each.seconds for each in records], [50, 95])
    return f"{middle:.0f}", f"{most:.0f}"
