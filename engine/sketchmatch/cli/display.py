"""What people and pipes see of a match: live progress, then the answer."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from itertools import zip_longest
from typing import TYPE_CHECKING, Any, TypeVar

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.spinner import Spinner
from rich.table import Table
from rich.text import Text

from sketchmatch.cli import interrupts, output
from sketchmatch.cli.options import say
from sketchmatch.cli.tables import Column, Rows, plain
from sketchmatch.errors import counted
from sketchmatch_client import Match, MatchCollector
from sketchmatch_proto.v1 import match_pb2
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse
from sketchmatch_proto.v1.scene_service_pb2 import SegmentResponse

if TYPE_CHECKING:
    from sketchmatch.api import Algorithm

__all__ = [
    "chosen",
    "doubt",
    "facts",
    "follow",
    "likely",
    "named",
    "numbered",
    "say_doubt",
    "say_match_notes",
    "say_notes",
    "show_match",
    "show_scene",
    "summary_of",
    "watch",
]

_PHASES = {
    match_pb2.PHASE_COMPILE: "loading the kernels",
    match_pb2.PHASE_SEGMENT: "finding the objects",
    match_pb2.PHASE_DESCRIBE: "describing relations",
    match_pb2.PHASE_RELATE: "comparing relations",
    match_pb2.PHASE_SEARCH: "searching",
}
_Value = TypeVar("_Value")
# A margin in ζ below this is within what a wobbling outline changes.
_AMBIGUOUS = 0.005
_MOST_NOTES = 5
# What differs between notes of one kind: numbers, and what is quoted.
_VARYING = re.compile(r"\d[\d.,]*|'[^']*'|\"[^\"]*\"")
_OUTCOMES = {
    match_pb2.OUTCOME_CONVERGED: "converged",
    match_pb2.OUTCOME_OPTIMAL: "proved optimal",
    match_pb2.OUTCOME_TIME_BUDGET: "stopped by the time budget",
    match_pb2.OUTCOME_ITERATION_LIMIT: "stopped by the iteration limit",
    match_pb2.OUTCOME_SERVER_STOPPING: "stopped because the server was stopping",
}


def watch(events: Generator[MatchResponse, None, None]) -> Match:
    """Follow a match to its end, showing progress where standard error is a terminal.

    Whoever interrupts it on a terminal is shown the best object map until then.
    """
    screen = output.console(error=True)
    if not (screen.is_terminal or output.for_people()):
        return _collected(events, None)
    best = _BestSoFar()
    try:
        with _moving(screen, _busy(screen, "starting")) as live:

            def shown(progress: match_pb2.MatchProgress) -> None:
                best.take(progress)
                live.update(_progress(screen, progress))

            return _collected(best.looking_at(events), shown)
    except KeyboardInterrupt:
        if best.progress is not None:
            seen = screen if screen.is_terminal else output.console()
            seen.print(_interrupted(best.progress, best.scenes))
        raise


@contextmanager
def _moving(screen: Console, what: RenderableType) -> Iterator[Live]:
    """Show what is being done, if there is a terminal for it.

    It is gone afterwards, even where somebody interrupts it while it begins.
    """
    live = Live(what, console=screen, transient=True)
    try:
        if screen.is_terminal:
            live.start()
        yield live
    finally:
        live.stop()


class _BestSoFar:
    """The latest progress with an object map, and the objects that it is about."""

    def __init__(self) -> None:
        self.scenes = match_pb2.MatchScenes()
        self.progress: match_pb2.MatchProgress | None = None

    def looking_at(
        self, events: Generator[MatchResponse, None, None]
    ) -> Generator[MatchResponse, None, None]:
        """Pass events on and keep the scenes."""
        with closing(events):
            for event in events:
                if event.HasField("scenes"):
                    self.scenes = event.scenes
                yield event

    def take(self, progress: match_pb2.MatchProgress) -> None:
        """Keep a progress that has an object map."""
        if progress.object_matches:
            self.progress = progress


def follow(work: Generator[float, None, _Value], what: str) -> _Value:
    """Run a generator of shares done to its end, showing it where standard error is a terminal."""
    from sketchmatch.pipeline.slices import finish, retold  # what asks a server does without

    screen = output.console(error=True)
    if not screen.is_terminal:
        return finish(retold(work, interrupts.check))
    bar = _bar()

    def shown(share: float) -> Iterable[None]:
        bar.update(share)
        return interrupts.check()

    with _moving(screen, _busy(screen, what, bar)):
        return finish(retold(work, shown))


def _collected(
    events: Generator[MatchResponse, None, None],
    on_progress: Callable[[match_pb2.MatchProgress], object] | None,
) -> Match:
    collector = MatchCollector(on_progress)
    with closing(events):
        for event in events:
            interrupts.check()
            collector.add(event)
    return collector.match()


def show_match(match: Match, metres: bool, verbose: bool) -> None:
    """Write the object map: a table on a terminal, tab-separated lines elsewhere.

    Parameters
    ----------
    match
        What was found.
    metres
        Whether the map is in metres.
    verbose
        Whether to tell all that the segmenters noted.
    """
    say_match_notes(match, verbose)
    if output.for_people():
        output.show(_answer(match, metres))
        return
    say_doubt(match)
    columns = ("sketch_object", "map_object", "confidence", "sketch_label", "map_label")
    output.write_line(*columns, "probability")
    for line in match.result.object_matches:
        output.write_line(
            line.sketch_object,
            line.map_object,
            f"{line.confidence:.4f}",
            line.sketch_label,
            line.map_label,
            f"{line.probability:.4g}" if line.HasField("probability") else "",
        )


def show_scene(response: SegmentResponse, verbose: bool) -> None:
    """Write the objects of a scene: a table on a terminal, tab-separated lines elsewhere."""
    say_notes("", response.warnings, verbose)
    rows = [
        (
            item.label,
            str(sum(len(ring.points) for ring in item.rings)),
            f"{item.area:.6g}",
            f"{item.centroid.x:.6g}",
            f"{item.centroid.y:.6g}",
            f"{item.certainty:.2g}" if item.HasField("certainty") else "1",
        )
        for item in response.scene.objects
    ]
    names = ("label", "vertices", "area", "centroid_x", "centroid_y", "certainty")
    if not output.for_people():
        output.write_line("object", *names)
        for k, row in enumerate(rows):
            output.write_line(k, *row)
        return
    columns = [
        Column("object", least=12),
        *(Column(name.replace("_", " "), right=True) for name in names[1:]),
    ]
    labels = [row[0] for row in rows]
    title = f"{len(rows)} objects, by {response.segmenter.name}"
    cells = [[numbered(k, labels), *map(plain, row[1:])] for k, row in enumerate(rows)]
    output.show(Rows(title, columns, cells))


def say_match_notes(match: Match, verbose: bool) -> None:
    """Tell what segmentation left out or decided on both sides."""
    say_notes("sketch", match.scenes.sketch_warnings, verbose)
    say_notes("map", match.scenes.map_warnings, verbose)


def say_doubt(match: Match) -> None:
    """Tell what is to be known before an answer is used, where people do not see it."""
    if said := doubt(match):
        say(said)


def say_notes(side: str, notes: Sequence[str], verbose: bool) -> None:
    """Tell what segmentation left out or decided: of many notes one of each kind."""
    for note in notes if verbose else summary_of(notes):
        say(f"{side}: {note}" if side else note)


def summary_of(notes: Sequence[str]) -> list[str]:
    """Return some notes, or of many one of each kind and how many more there are.

    Examples
    --------
    >>> summary_of([f"stroke {k} is a mark" for k in range(1, 209)])
    ['stroke 1 is a mark (and 207 more like it)', '-v shows all 208 notes']
    """
    if len(notes) <= _MOST_NOTES:
        return list(notes)
    kinds: dict[str, list[str]] = {}
    for note in notes:
        kinds.setdefault(_VARYING.sub("", note), []).append(note)
    told = [
        f"{alike[0].rstrip('.')} (and {len(alike) - 1} more like it)"
        if len(alike) > 1
        else alike[0]
        for alike in list(kinds.values())[:_MOST_NOTES]
    ]
    untold = len(notes) - sum(map(len, list(kinds.values())[:_MOST_NOTES]))
    others = f"{counted(untold, 'other note')}; " if untold else ""
    return [*told, f"{others}-v shows all {len(notes)} notes"]


def chosen(algorithm: Algorithm) -> dict[str, Any]:
    """Return an algorithm for a JSON document: its name and all its parameters."""
    return {"name": algorithm.name, "parameters": algorithm.params.model_dump(mode="json")}


def named(index: int, labels: Sequence[str]) -> str:
    """Return what a person calls an object: its label, its number, or both where labels repeat.

    Examples
    --------
    >>> [named(k, ["desk", "chair", "chair", ""]) for k in range(4)]
    ['desk', 'chair (2)', 'chair (3)', 'No. 4']
    """
    label = labels[index].strip()
    if not label:
        return f"No. {index + 1}"
    return f"{label} ({index + 1})" if labels.count(labels[index]) > 1 else label


def numbered(index: int, labels: Sequence[str]) -> Text:
    """Return an object for a table: its number, counted from 1, and its label."""
    width = len(str(len(labels)))
    return plain(f"{index + 1:>{width}} {labels[index]}".rstrip())


def likely(probability: float) -> str:
    """Return a probability for people; what is not certain never looks so.

    Examples
    --------
    >>> [likely(each) for each in (0.99996, 0.9986, 0.5, 0.004, 0.0)]
    ['> 99.9 %', '99.9 %', '50 %', '0.4 %', '< 0.1 %']
    """
    percent = 100.0 * probability
    if percent >= 99.95:
        return "> 99.9 %"
    if percent < 0.05:
        return "< 0.1 %"
    return f"{percent:.0f} %" if 1.0 <= percent < 99.0 else f"{percent:.1f} %"


def doubt(match: Match) -> str:
    """Return what is to be known before an answer is used; empty where nothing is.

    That it is probably another place, or, where it is this one, that several maps are about as
    likely, and what would decide between them.
    """
    result = match.result
    if result.HasField("place_probability") and result.place_probability < 0.5:
        return f"Probably not this place (this place: {likely(result.place_probability)})"
    if not result.ambiguity.deciding_sketch_objects:
        return ""
    first = result.ambiguity.deciding_sketch_objects[0]
    labels = [item.label for item in match.scenes.sketch.objects]
    return (
        f"{result.ambiguity.maps} object maps fit about equally well; state which mapped object "
        f"{named(first, labels)} is (--pin {_pinned(first, labels)}=…)"
    )


def facts(result: match_pb2.MatchResult, metres: bool) -> list[tuple[str, str]]:
    """Return the figures that sum a result up, by name; ``metres``, whether the map is in them."""
    degrees = round(math.degrees(result.rotation_radians))
    sense = (
        "" if degrees in (0, 180, -180) else " clockwise" if degrees < 0 else " counter-clockwise"
    )
    known = [
        (name, likely(getattr(result, field)))
        for name, field in (("Probability", "probability"), ("This place", "place_probability"))
        if result.HasField(field)  # type: ignore[arg-type]
    ]
    return [
        *known,
        ("Rotation", f"{abs(degrees)}°{sense}"),
        ("Scale", f"{result.scale:.3g} {'m' if metres else 'map units'} per sketch unit"),
        ("FMAP confidence", f"{result.fmap_confidence.total:.3f}"),
        ("OMAP confidence", f"{result.omap_confidence:.3f}"),
    ]


def _answer(match: Match, metres: bool) -> RenderableType:
    result = match.result
    sketched = [item.label for item in match.scenes.sketch.objects]
    mapped = [item.label for item in match.scenes.map.objects]
    unclear = any(_is_ambiguous(line) for line in result.object_matches)
    counted = result.HasField("probability")
    columns = [
        Column("in the sketch", least=13),
        Column("on the map", least=10),
        Column("likely", right=True),
        Column("confidence", right=True, dispensable=2 if counted else 1),
        Column("margin", right=True, dispensable=0 if unclear else 2),
        Column("position in the sketch", least=24, dispensable=1),
    ]
    rows = [
        [
            numbered(line.sketch_object, sketched),
            numbered(line.map_object, mapped),
            plain(likely(line.probability) if line.HasField("probability") else ""),
            plain(f"{line.confidence:.3f}"),
            _margin(line),
            _relation(line, sketched),
        ]
        for line in result.object_matches
    ]
    unmatched = zip_longest(
        result.unmatched_sketch_objects, map(likely, result.unmatched_sketch_probabilities)
    )
    rows += [
        [
            *(numbered(k, sketched), Text("no partner"), plain(probability or "")),
            *(Text(""), Text(""), Text("")),
        ]
        for k, probability in unmatched
        if not any(k in group.sketch_objects for group in result.object_groups)
    ]
    parts = result.fmap_confidence
    detail = (
        f"ζ {parts.total:.3f}: similarity {parts.similarity:.3f}, "
        f"rotation {parts.rotation:.3f}, dilation {parts.dilation:.3f}"
    )
    if parts.HasField("shape"):
        detail += f", shape {parts.shape:.3f}, size {parts.size:.3f}"
    said = [f"{name} {value}" for name, value in facts(result, metres)]
    figures = (said[:-4], said[-4:-2], said[-2:])
    lines = ["  ".join(some) for some in figures if some]
    lines += filter(None, [detail, _effort(result), result.search_note])
    doubted = doubt(match)
    return Group(
        *([plain(doubted, "bold red")] if doubted else []),
        Rows(_headline(match), columns, rows),
        "",
        *map(plain, lines),
        *(plain(_as_one(group, sketched, mapped)) for group in result.object_groups),
        *_alternatives(result, sketched, mapped),
    )


def _interrupted(
    progress: match_pb2.MatchProgress, scenes: match_pb2.MatchScenes
) -> RenderableType:
    """Return the best object map of a match that was not waited for."""
    sketched = [item.label for item in scenes.sketch.objects]
    mapped = [item.label for item in scenes.map.objects]
    columns = [
        Column("in the sketch", least=13),
        Column("on the map", least=10),
        Column("confidence", right=True),
    ]
    rows = [
        [
            numbered(line.sketch_object, sketched),
            numbered(line.map_object, mapped),
            plain(f"{line.confidence:.3f}"),
        ]
        for line in progress.object_matches
    ]
    title = f"The best map so far, after {_seconds(progress.elapsed):.1f} s"
    if progress.HasField("confidence"):
        title += f", with ζ {progress.confidence:.3f}"
    return Rows(title, columns, rows)


def _is_ambiguous(line: match_pb2.ObjectMatch) -> bool:
    """Whether another partner is as good."""
    return line.HasField("margin") and line.margin < _AMBIGUOUS


def _margin(line: match_pb2.ObjectMatch) -> Text:
    """Return by how much ζ falls with another partner, loud where the two are as good."""
    if not line.HasField("margin"):
        return Text("")
    return Text(f"{line.margin:.3f}", style="bold red" if _is_ambiguous(line) else "")


def _relation(line: match_pb2.ObjectMatch, labels: Sequence[str]) -> Text:
    """Return how the sketched object lies to the nearest other."""
    if not line.HasField("relation"):
        return Text("")
    return plain(f"{line.relation.phrase} {named(line.relation.reference_object, labels)}")


def _as_one(group: match_pb2.ObjectGroup, sketched: Sequence[str], mapped: Sequence[str]) -> str:
    """Say which objects of one side are, together, which of the other."""
    drawn = " and ".join(named(k, sketched) for k in group.sketch_objects)
    there = " and ".join(named(k, mapped) for k in group.map_objects)
    verb = "is" if len(group.sketch_objects) == 1 else "are"
    how = f", {likely(group.probability)}" if group.HasField("probability") else ""
    return f"As one{how}: {drawn} {verb} {there} on the map"


def _alternatives(
    result: match_pb2.MatchResult, sketched: Sequence[str], mapped: Sequence[str]
) -> list[Text]:
    """Say what else it could be: only the objects that another map maps otherwise."""
    best = _partners(result.object_matches)
    lines = []
    for k, other in enumerate(result.alternatives):
        others = _partners(other.object_matches)
        changes = [
            f"{named(k, sketched)} is {named(others[k], mapped)}"
            if k in others
            else f"{named(k, sketched)} has no partner"
            for k in sorted({*best, *others})
            if best.get(k) != others.get(k)
        ]
        as_good = _is_as_good(result, k)
        how = ["Just as good" if as_good else "Next best"]
        how += [likely(other.probability)] if other.HasField("probability") else []
        how += [f"ζ {other.fmap_confidence.total:.3f}"]
        said = f"{', '.join(how)}: on the map {', '.join(changes)}"
        lines.append(plain(said, "" if as_good else "dim"))
    return lines


def _is_as_good(result: match_pb2.MatchResult, k: int) -> bool:
    """Whether an alternative may as well be the answer, by probability or, without, by ζ."""
    if result.HasField("probability"):
        return k in result.ambiguity.alternatives
    lost = result.fmap_confidence.total - result.alternatives[k].fmap_confidence.total
    return lost < _AMBIGUOUS


def _pinned(index: int, labels: Sequence[str]) -> str:
    """Return what an option names an object by: a label that is one word, or its number."""
    label = labels[index]
    named_so = label.isidentifier() and labels.count(label) == 1
    return label if named_so else str(index + 1)


def _partners(lines: Iterable[match_pb2.ObjectMatch]) -> dict[int, int]:
    return {line.sketch_object: line.map_object for line in lines}


def _headline(match: Match) -> str:
    result, total = match.result, len(match.scenes.sketch.objects)
    groups = result.object_groups
    drawn, there = (
        len(set(alone).difference(*members))
        for alone, members in (
            (result.unmatched_sketch_objects, [group.sketch_objects for group in groups]),
            (result.unmatched_map_objects, [group.map_objects for group in groups]),
        )
    )
    left = [f"{drawn} in the sketch"] * (drawn > 0) + [f"{there} on the map"] * (there > 0)
    without = f", {' and '.join(left)} without partner" if left else ""
    return f"{total - drawn} of {total} sketched objects matched{without}"


def _effort(result: match_pb2.MatchResult) -> str:
    statistics = result.statistics
    return (
        f"{_OUTCOMES.get(result.outcome, 'ended')} after "
        f"{counted(statistics.iterations, 'iteration')}, "
        f"{counted(statistics.evaluations, 'evaluation')}, "
        f"{_seconds(statistics.total_elapsed):.2f} s"
    )


def _progress(screen: Console, progress: match_pb2.MatchProgress) -> RenderableType:
    said = [_PHASES.get(progress.phase, "working"), f"{_seconds(progress.elapsed):.1f} s"]
    if progress.HasField("confidence"):
        said.append(f"ζ {progress.confidence:.4f}")
        if progress.HasField("upper_bound") and progress.upper_bound < 1.0:
            said.append(f"≤ {progress.upper_bound:.4f}")
        said += [f"iteration {progress.iteration}", counted(progress.evaluations, "evaluation")]
    bar = None
    if progress.HasField("fraction"):
        bar = _bar(progress.fraction)
    busy = _busy(screen, "  ".join(said), bar)
    if not progress.object_matches:
        return busy
    pairs = "  ".join(
        f"{line.sketch_object + 1}→{line.map_object + 1}" for line in progress.object_matches
    )
    return Group(
        busy, Text(f"best so far: {pairs}", style="dim", overflow="ellipsis", no_wrap=True)
    )


def _busy(screen: Console, text: str, bar: ProgressBar | None = None) -> RenderableType:
    """Return one line that moves while something is done."""
    line = Table.grid(padding=(0, 1))
    spinner = Spinner("line" if screen.options.ascii_only else "dots")
    said = Text(text, overflow="ellipsis", no_wrap=True)
    line.add_row(spinner, said, *filter(None, [bar]))
    return line


def _bar(share: float = 0.0) -> ProgressBar:
    return ProgressBar(total=1.0, completed=share, width=24)


def _seconds(duration: Any) -> float:
    return float(duration.ToTimedelta().total_seconds())
