"""What people and pipes see of a match: live progress, then the answer."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import closing
from typing import TYPE_CHECKING, Any, TypeVar

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.spinner import Spinner
from rich.table import Table
from rich.text import Text

from sketchmatch.cli.options import say
from sketchmatch_client import Match, MatchCollector
from sketchmatch_proto.v1 import match_pb2
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse
from sketchmatch_proto.v1.scene_service_pb2 import SegmentResponse

if TYPE_CHECKING:
    from sketchmatch.api import Algorithm

__all__ = [
    "JSON_STYLE",
    "chosen",
    "facts",
    "follow",
    "named",
    "print_document",
    "say_warnings",
    "show_match",
    "show_scene",
    "watch",
]

JSON_STYLE: dict[str, Any] = {"always_print_fields_with_no_presence": True, "ensure_ascii": False}
"""How messages become JSON: index 0 and empty lists are written out."""

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
_OUTCOMES = {
    match_pb2.OUTCOME_CONVERGED: "converged",
    match_pb2.OUTCOME_OPTIMAL: "proved optimal",
    match_pb2.OUTCOME_TIME_BUDGET: "stopped by the time budget",
    match_pb2.OUTCOME_ITERATION_LIMIT: "stopped by the iteration limit",
}


def watch(events: Generator[MatchResponse, None, None]) -> Match:
    """Follow a match to its end, showing progress where standard error is a terminal."""
    console = Console(stderr=True)
    if not console.is_terminal:
        return _collected(events, None)
    with Live(Spinner("dots", "starting"), console=console, transient=True) as live:
        return _collected(events, lambda progress: live.update(_progress(progress)))


def follow(work: Generator[float, None, _Value], what: str) -> _Value:
    """Run a generator of shares done to its end, showing it where standard error is a terminal."""
    from sketchmatch.pipeline.slices import finish, retold  # what asks a server does without

    console = Console(stderr=True)
    if not console.is_terminal:
        return finish(work)
    grid, bar = Table.grid(padding=(0, 2)), ProgressBar(total=1.0, width=24)
    grid.add_row(Spinner("dots", what), bar)

    def shown(share: float) -> Iterable[None]:
        bar.update(share)
        return ()

    with Live(grid, console=console, transient=True):
        return finish(retold(work, shown))


def _collected(
    events: Generator[MatchResponse, None, None],
    on_progress: Callable[[match_pb2.MatchProgress], object] | None,
) -> Match:
    collector = MatchCollector(on_progress)
    with closing(events):
        for event in events:
            collector.add(event)
    return collector.match()


def show_match(match: Match) -> None:
    """Print the object map: a table on a terminal, tab-separated lines elsewhere."""
    say_warnings("sketch", match.scenes.sketch_warnings)
    say_warnings("map", match.scenes.map_warnings)
    if sys.stdout.isatty():
        Console().print(_match_table(match))
        return
    print("sketch_object", "map_object", "confidence", "sketch_label", "map_label", sep="\t")
    for line in match.result.object_matches:
        confidence = f"{line.confidence:.4f}"
        print(
            line.sketch_object,
            line.map_object,
            confidence,
            line.sketch_label,
            line.map_label,
            sep="\t",
        )


def show_scene(response: SegmentResponse) -> None:
    """Print the objects of a scene: a table on a terminal, tab-separated lines elsewhere."""
    say_warnings("", response.warnings)
    rows = [
        (
            item.label,
            str(sum(len(ring.points) for ring in item.rings)),
            f"{item.area:.6g}",
            f"{item.centroid.x:.6g}",
            f"{item.centroid.y:.6g}",
        )
        for item in response.scene.objects
    ]
    names = ("label", "vertices", "area", "centroid_x", "centroid_y")
    if not sys.stdout.isatty():
        print("object", *names, sep="\t")
        for k, row in enumerate(rows):
            print(k, *row, sep="\t")
        return
    table = Table(title=f"{len(rows)} objects, by {response.segmenter.name}", title_justify="left")
    table.add_column("No.", justify="right")
    for name in names:
        table.add_column(name.replace("_", " "), justify="left" if name == "label" else "right")
    for k, row in enumerate(rows, start=1):
        table.add_row(str(k), *map(Text, row))  # a label may look like markup
    Console().print(table)


def say_warnings(side: str, warnings: Iterable[str]) -> None:
    """Tell what segmentation left out or decided."""
    for warning in warnings:
        say(f"{side}: {warning}" if side else warning)


def print_document(document: Mapping[str, Any]) -> None:
    """Print what no message of the contract holds as JSON, in the same style."""
    print(json.dumps(document, ensure_ascii=False, indent=2))


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


def facts(result: match_pb2.MatchResult) -> list[tuple[str, str]]:
    """Return the figures that sum a result up, by name."""
    return [
        ("FMAP confidence", f"{result.fmap_confidence.total:.3f}"),
        ("OMAP confidence", f"{result.omap_confidence:.3f}"),
        ("Rotation", f"{math.degrees(result.rotation_radians):.0f}°"),
        ("Scale", f"{result.scale:.3g}"),
        *([("Probability", f"{result.probability:.0%}")] if result.HasField("probability") else []),
    ]


def _match_table(match: Match) -> RenderableType:
    result = match.result
    table = Table(title=_headline(match), title_justify="left")
    table.add_column("No. in sketch", justify="right")
    table.add_column("label")
    table.add_column("No. on map", justify="right")
    table.add_column("label")
    table.add_column("confidence", justify="right")
    table.add_column("", width=12)
    table.add_column("margin", justify="right")
    table.add_column("likely", justify="right")
    table.add_column("in the sketch")
    labels = [item.label for item in match.scenes.sketch.objects]
    for line in result.object_matches:
        table.add_row(
            str(line.sketch_object + 1),
            Text(line.sketch_label),
            str(line.map_object + 1),
            Text(line.map_label),
            f"{line.confidence:.3f}",
            ProgressBar(total=1.0, completed=line.confidence, width=12),
            _margin(line),
            f"{line.probability:.0%}" if line.HasField("probability") else "",
            _relation(line, labels),
        )
    parts = result.fmap_confidence
    summary = "  ".join(f"{name} {value}" for name, value in facts(result))
    detail = (
        f"ζ {parts.total:.3f} of relations {parts.similarity:.3f}, "
        f"rotations {parts.rotation:.3f}, dilations {parts.dilation:.3f}"
    )
    if parts.HasField("shape"):
        detail += f", shapes {parts.shape:.3f}, sizes {parts.size:.3f}"
    lines = [summary, detail, _effort(result), *filter(None, [result.search_note])]
    return Group(table, *map(Text, lines), *_alternatives(result))


def _margin(line: match_pb2.ObjectMatch) -> Text:
    """Return by how much ζ falls with another partner, loud where the two are as good."""
    if not line.HasField("margin"):
        return Text("")
    return Text(f"{line.margin:.3f}", style="bold red" if line.margin < _AMBIGUOUS else "")


def _relation(line: match_pb2.ObjectMatch, labels: Sequence[str]) -> Text:
    """Return how the sketched object lies to the nearest other; no markup, whatever the label."""
    if not line.HasField("relation"):
        return Text("")
    return Text(f"{line.relation.phrase} {named(line.relation.reference_object, labels)}")


def _alternatives(result: match_pb2.MatchResult) -> list[Text]:
    """Say what else it could be: only the objects that another map maps otherwise."""
    best = {line.sketch_object: line.map_object for line in result.object_matches}
    lines = []
    for other in result.alternatives:
        changes = "  ".join(
            f"{line.sketch_object + 1}→{line.map_object + 1}"
            for line in other.object_matches
            if best.get(line.sketch_object) != line.map_object
        )
        lines.append(Text(f"else ζ {other.fmap_confidence.total:.3f}: {changes}", style="dim"))
    return lines


def _headline(match: Match) -> str:
    result, total = match.result, len(match.scenes.sketch.objects)
    left = []
    if result.unmatched_sketch_objects:
        left.append(f"{len(result.unmatched_sketch_objects)} in the sketch")
    if result.unmatched_map_objects:
        left.append(f"{len(result.unmatched_map_objects)} on the map")
    without = f", {' and '.join(left)} without partner" if left else ""
    return f"{len(result.object_matches)} of {total} sketched objects matched{without}"


def _effort(result: match_pb2.MatchResult) -> str:
    statistics = result.statistics
    return (
        f"{_OUTCOMES.get(result.outcome, 'ended')} after {statistics.iterations} iterations, "
        f"{statistics.evaluations} evaluations, {_seconds(statistics.total_elapsed):.2f} s"
    )


def _progress(progress: match_pb2.MatchProgress) -> RenderableType:
    grid = Table.grid(padding=(0, 2))
    cells: list[RenderableType] = [
        Spinner("dots", _PHASES.get(progress.phase, "working")),
        f"{_seconds(progress.elapsed):5.1f} s",
    ]
    if progress.HasField("fraction"):
        cells.append(ProgressBar(total=1.0, completed=progress.fraction, width=24))
    if progress.HasField("confidence"):
        cells.append(f"ζ {progress.confidence:.4f}")
        if progress.HasField("upper_bound"):
            cells.append(f"≤ {progress.upper_bound:.4f}")
        cells.append(f"iteration {progress.iteration}")
        cells.append(f"{progress.evaluations} evaluations")
    grid.add_row(*cells)
    if not progress.object_matches:
        return grid
    pairs = "  ".join(
        f"{line.sketch_object + 1}→{line.map_object + 1}" for line in progress.object_matches
    )
    return Group(
        grid, Text(f"best so far: {pairs}", style="dim", overflow="ellipsis", no_wrap=True)
    )


def _seconds(duration: Any) -> float:
    return float(duration.ToTimedelta().total_seconds())
