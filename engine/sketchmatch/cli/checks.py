"""``sketchmatch plugins check``: what came of each check, as soon as it is known."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib.metadata import version
from typing import Any

from rich.console import Group
from rich.padding import Padding
from rich.text import Text

from sketchmatch.cli import output
from sketchmatch.cli.options import say
from sketchmatch.cli.tables import plain
from sketchmatch.testing import CheckState
from sketchmatch.testing.conformance.apart import Checked

__all__ = ["show"]

_STYLES = {CheckState.PASSED: "green", CheckState.FAILED: "bold red", CheckState.SKIPPED: "yellow"}
_COLUMNS = ("kind", "algorithm", "check", "result", "seconds", "sentence")
_INDENT = 20


def show(distribution: str, results: Iterable[Checked], *, as_json: bool) -> bool:
    """Write what came of each check of a distribution, and return whether none failed."""
    if as_json:
        done = list(results)
        output.write_json(_document(distribution, done))
    else:
        done = list(_written(results))
    counts, seconds = _counts(done), sum(each.result.seconds for each in done)
    how_many = ", ".join(f"{count} {state}" for state, count in counts.items())
    say(f"{distribution} {version(distribution)}: {how_many} in {seconds:.1f} s")
    return not counts["failed"]


def _written(results: Iterable[Checked]) -> Iterator[Checked]:
    show_one = _on_a_terminal() if output.for_people() else _in_a_pipe()
    for each in results:
        show_one(each)
        yield each


def _on_a_terminal() -> Callable[[Checked], None]:
    shown = set[tuple[str, str]]()

    def show_one(each: Checked) -> None:
        result = each.result
        if (each.kind, each.algorithm) not in shown:
            shown.add((each.kind, each.algorithm))
            output.show(plain(f"{each.kind} {each.algorithm}".strip(), "bold"))
        state = (f"{result.state:8} {result.seconds:7.2f} s  ", _STYLES[result.state])
        said = plain(_sentence(each), "" if result.seen else "dim")
        output.show(Group(Text.assemble(state, result.name), Padding(said, (0, 0, 0, _INDENT))))

    return show_one


def _in_a_pipe() -> Callable[[Checked], None]:
    output.write_line(*_COLUMNS)

    def show_one(each: Checked) -> None:
        result = each.result
        cells = (each.kind, each.algorithm, result.name, result.state, f"{result.seconds:.2f}")
        output.write_line(*cells, _sentence(each))

    return show_one


def _sentence(each: Checked) -> str:
    """Return what was seen, or else what is demanded, in one line."""
    return " ".join((each.result.seen or each.result.demand).split())


def _document(distribution: str, done: Sequence[Checked]) -> dict[str, Any]:
    return {
        "distribution": distribution,
        "version": version(distribution),
        **_counts(done),
        "checks": [
            {
                "kind": each.kind,
                "algorithm": each.algorithm,
                "check": each.result.name,
                "result": str(each.result.state),
                "sentence": _sentence(each),
                "demand": each.result.demand,
                "overdue": each.result.overdue,
                "seconds": round(each.result.seconds, 3),
            }
            for each in done
        ],
    }


def _counts(results: Iterable[Checked]) -> dict[str, int]:
    found = Counter(each.result.state for each in results)
    return {str(state): found[state] for state in CheckState}
