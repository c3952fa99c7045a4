"""Examples of successes and failures: sketch and map side by side, partners in one colour."""

from __future__ import annotations

import io
from collections.abc import Iterator

from sketchmatch.pictures.overlay import OverlayMatch, draw_overlay
from tests.experiments.cases import Case, Record, answer, cases
from tests.experiments.document import Picture
from tests.experiments.records import Results, chosen
from tests.experiments.scenes import DRIVES, PLACES, drive_through

__all__ = ["examples"]

_WIDTH = 1000


def examples(results: Results, method: str) -> Iterator[Picture]:
    """Yield for each experiment a typical success and a typical failure of a method.

    The success is the one in the middle by ζ; the failure the one in the middle by how far its ζ
    is above the truth's.
    """
    for title, name in _KINDS.items():
        if title not in results:
            continue
        own = chosen(results[title], method=method)
        successes = sorted((r for r in own if r.perfect), key=lambda record: record.zeta)
        failures = sorted((r for r in own if r.wrong), key=lambda r: r.map_zeta - r.true_zeta)
        for records, outcome in ((successes, "right"), (failures, "wrong")):
            if records:
                record = records[len(records) // 2]
                yield _picture(record, f"example-{name}-{outcome}.png", title)


_KINDS = {
    "all objects, map": "all-objects",
    "one missing, map": "one-missing",
    "one missing, grid": "one-missing-grid",
    "sketches like (k), map": "unequal",
}


def _picture(record: Record, name: str, title: str) -> Picture:
    case = _case(record)
    result = answer(case, record.method)
    matches = [OverlayMatch(m.sketch_object, m.map_object, m.confidence) for m in result.matches]
    grid = None
    if record.case.grid:
        grid = drive_through(PLACES[record.case.place], record.case.number % DRIVES)
    facts = [("ζ", f"{record.zeta:.3f}"), ("ζ of the truth", f"{record.true_zeta:.3f}")]
    headline = f"{record.right} of {record.objects} objects right"
    image = draw_overlay(
        case.sketch,
        case.map,
        matches,
        title=headline,
        caption=_what(record),
        facts=facts,
        underlay=grid,
        metres=True,
        width=_WIDTH,
    )
    stream = io.BytesIO()
    image.quantize(128).save(stream, format="PNG", optimize=True)
    caption = f"{title}, scene {record.case.place}, {record.method}: {headline}. {_what(record)}"
    return Picture(name, stream.getvalue(), caption)


def _what(record: Record) -> str:
    labels = PLACES[record.case.place].furniture.labels
    removed = ", ".join(labels[k] for k in record.case.removed.sketch)
    wrong = ", ".join(labels[k] if k >= 0 else "what is not there" for k in record.wrong)
    parts = [f"Removed: {removed}."] * bool(removed) + [f"Wrong: {wrong}."] * bool(wrong)
    return " ".join(parts)


def _case(record: Record) -> Case:
    name = record.case
    (case,) = cases(name.place, name.number, name.style, (name.removed,), grids=(name.grid,))
    return case
