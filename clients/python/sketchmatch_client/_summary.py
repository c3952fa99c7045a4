"""What servers answer, in a line or a small table.

All but what they say themselves is ASCII, which every terminal and pipe can take.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from typing import Any

from google.protobuf.message import Message

from sketchmatch_proto.v1.catalog_service_pb2 import AlgorithmKind, ListAlgorithmsResponse
from sketchmatch_proto.v1.match_pb2 import MatchProgress, MatchResult, Outcome, Phase
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse
from sketchmatch_proto.v1.scene_pb2 import Scene
from sketchmatch_proto.v1.scene_service_pb2 import SegmentResponse

__all__ = ["enum_name", "match_headline", "match_table", "progress_line", "summary"]

_ROWS = 20
_LONGEST = 60
_UNKNOWN = Scene()


def summary(answer: Message) -> str:
    """Return what a server answered in a line or a small table; messages print at length.

    Parameters
    ----------
    answer
        A result, an event of a match, the objects of a source or a catalogue; any other message
        becomes what it prints.

    Examples
    --------
    >>> found = SegmentResponse(warnings=["one stroke is left out"])
    >>> found.scene.objects.add(label="desk", area=2.5).centroid.x = 4.0
    >>> found.segmenter.name = "strokes"
    >>> print(summary(found))
    1 object, by strokes
    object  area  x  y
    0 desk   2.5  4  0
    one stroke is left out
    """
    match answer:
        case MatchResult():
            return match_table(answer)
        case MatchResponse() if kind := answer.WhichOneof("event"):
            return _event(kind, answer)
        case MatchProgress():
            return progress_line(answer)
        case SegmentResponse():
            return _scene(answer)
        case ListAlgorithmsResponse():
            return _catalogue(answer)
    return str(answer)


def match_headline(result: MatchResult, sketch: Scene = _UNKNOWN) -> str:
    """Return what came out of a match as a whole; the sketch has the labels of its objects."""
    drawn = len(result.object_matches) + len(result.unmatched_sketch_objects)
    alone = [k for k in result.unmatched_sketch_objects if k not in _grouped(result)]
    facts = [
        f"{drawn - len(alone)} of {drawn} sketched objects matched",
        f"FMAP confidence {result.fmap_confidence.total:.3f}",
        f"OMAP confidence {result.omap_confidence:.3f}",
        enum_name(Outcome, "OUTCOME_", result.outcome),
    ]
    if result.HasField("probability"):
        facts.insert(-1, f"probability {_likelihood(result.probability)}")
    if result.HasField("place_probability"):
        likely = _likelihood(result.place_probability)
        if result.place_probability < 0.5:
            facts[0] = f"probably not this place (this place: {likely}): {facts[0]}"
        else:
            facts.insert(-1, f"this place {likely}")
    if result.ambiguity.deciding_sketch_objects:
        asked = _object(result.ambiguity.deciding_sketch_objects[0], sketch)
        facts.insert(-1, f"{result.ambiguity.maps} maps about as likely, ask what {asked} is")
    return ", ".join(facts)


def match_table(result: MatchResult, sketch: Scene = _UNKNOWN, map_: Scene = _UNKNOWN) -> str:
    """Return which sketched object is which mapped object, counted from 0."""
    heads = ("in the sketch", "on the map", "confidence", "probability", "margin")
    rows = [
        (
            _name(line.sketch_object, line.sketch_label),
            _name(line.map_object, line.map_label),
            f"{line.confidence:.3f}",
            _likelihood(line.probability) if line.HasField("probability") else "",
            f"{line.margin:.3f}" if line.HasField("margin") else "",
        )
        for line in result.object_matches
    ]
    unmatched = zip_longest(
        result.unmatched_sketch_objects, map(_likelihood, result.unmatched_sketch_probabilities)
    )
    grouped = _grouped(result)
    rows += [
        (_object(k, sketch), "no partner", "", likely or "", "")
        for k, likely in unmatched
        if k not in grouped
    ]
    rows += [
        (
            " + ".join(_object(k, sketch) for k in group.sketch_objects),
            " + ".join(_object(k, map_) for k in group.map_objects),
            "as one",
            _likelihood(group.probability) if group.HasField("probability") else "",
            "",
        )
        for group in result.object_groups
    ]
    return _table(match_headline(result, sketch), heads, rows, names=2)


def _grouped(result: MatchResult) -> set[int]:
    """Return the sketched objects that are something together with others, or several things."""
    return {k for group in result.object_groups for k in group.sketch_objects}


def progress_line(progress: MatchProgress) -> str:
    """Return how far a match is, with what is known by now."""
    facts = [
        enum_name(Phase, "PHASE_", progress.phase),
        f"{progress.elapsed.ToTimedelta().total_seconds():.2f} s",
    ]
    if progress.HasField("fraction"):
        facts.append(f"{progress.fraction:.0%}")
    if progress.HasField("confidence"):
        count = progress.evaluations
        facts += [
            f"confidence {progress.confidence:.3f}",
            f"{count} evaluation{'s' * (count != 1)}",
        ]
    if progress.HasField("upper_bound"):
        facts.append(f"at most {progress.upper_bound:.3f}")
    return ", ".join(facts)


def enum_name(kind: Any, prefix: str, value: int) -> str:
    """Return what a value is called, or its number where only newer servers know it."""
    try:
        return str(kind.Name(value)).removeprefix(prefix)
    except ValueError:
        return str(value)


def _event(kind: str, event: MatchResponse) -> str:
    match kind:
        case "accepted":
            return f"accepted as {event.accepted.match_id}, seed {event.accepted.seed}"
        case "scenes":
            sides = len(event.scenes.sketch.objects), len(event.scenes.map.objects)
            warned = [*event.scenes.sketch_warnings, *event.scenes.map_warnings]
            return "\n".join(["{} sketched objects, {} mapped ones".format(*sides), *warned])
    return summary(getattr(event, kind))


def _scene(found: SegmentResponse) -> str:
    count = len(found.scene.objects)
    title = f"{count} object{'s' * (count != 1)}, by {found.segmenter.name}"
    rows = [
        (
            _name(k, item.label),
            f"{item.area:.4g}",
            f"{item.centroid.x:.4g}",
            f"{item.centroid.y:.4g}",
        )
        for k, item in enumerate(found.scene.objects)
    ]
    table = _table(title, ("object", "area", "x", "y"), rows, names=1)
    return "\n".join([table, *found.warnings])


def _catalogue(listed: ListAlgorithmsResponse) -> str:
    rows = [
        (
            enum_name(AlgorithmKind, "ALGORITHM_KIND_", each.kind).lower(),
            f"{each.name}{' *' * each.is_default}",
            _cut(each.summary),
        )
        for each in listed.algorithms
    ]
    title = f"{len(rows)} algorithms; * are the defaults"
    return _table(title, ("kind", "name", "what it does"), rows, names=3, most=len(rows))


def _table(
    title: str,
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    names: int,
    most: int = _ROWS,
) -> str:
    """Return a table whose first columns are names, which stand at the left."""
    shown = [heads, *rows[:most]]
    widths = [max(map(len, column)) for column in zip(*shown, strict=True)]
    lines = [
        "  ".join(
            cell.ljust(width) if k < names else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in shown
    ]
    rest = [f"... and {len(rows) - most} more"] if len(rows) > most else []
    return "\n".join([title, *lines, *rest])


def _object(index: int, scene: Scene) -> str:
    return _name(index, scene.objects[index].label if index < len(scene.objects) else "")


def _name(index: int, label: str) -> str:
    return f"{index} {_cut(label, _LONGEST // 2)}".rstrip()


def _cut(text: str, longest: int = _LONGEST) -> str:
    """Return what fits into a cell, whatever is in it."""
    line = "".join(char if char.isprintable() else "?" for char in " ".join(text.split()))
    return line if len(line) <= longest else f"{line[: longest - 3]}..."


def _likelihood(probability: float) -> str:
    """Return a probability that rounds to 1 only if it is."""
    return ">0.999" if 0.9995 <= probability < 1.0 else f"{probability:.3f}"
