"""The reference page of the algorithms, written from what the catalogue says of them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from sketchmatch.cli.catalogue import KINDS, Parameter, kind, parameters, prose, reads, references
from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch_proto.v1.catalog_service_pb2 import Algorithm, ListAlgorithmsResponse

__all__ = ["markdown", "page"]

_HEADINGS = {
    "segmenter": "Segmenters",
    "histogram": "Histograms",
    "similarity": "Similarity measures",
    "searcher": "Searchers",
    "judge": "Judges",
}
_PREAMBLE = (
    "A request, a configuration file, `--set STAGE.PARAMETER=VALUE` and `params` in Python set the "
    "parameters; `null` leaves one to the algorithm."
)
_COLUMNS = ("parameter", "type", "default", "bounds", "unit", "what it does")


def page(catalogue: ListAlgorithmsResponse, distribution: str) -> str:
    """Return the reference page of what a distribution offers, in Markdown.

    It depends on the classes alone: not on versions, and not on what else is installed.

    Raises
    ------
    InvalidInputError
        If the distribution offers nothing.
    """
    own = [item for item in catalogue.algorithms if item.distribution == distribution]
    if not own:
        known = ", ".join(sorted({item.distribution for item in catalogue.algorithms}))
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            "--distribution",
            f"is {quoted(distribution)}, which offers no algorithm; choose one of: {known}",
        )
    return "\n".join(_lines(own, distribution))


def _lines(items: list[Algorithm], distribution: str) -> Iterator[str]:
    yield f"# Algorithms of {distribution}"
    yield ""
    yield f"<!-- Written by `sketchmatch plugins reference --distribution {distribution}`. -->"
    yield ""
    yield _PREAMBLE
    for each in KINDS:
        own = [item for item in items if kind(item) == each]
        if own:
            yield from ("", f"## {_HEADINGS[each]}")
            for item in own:
                yield from _section(item)
    yield ""


def _section(item: Algorithm) -> Iterator[str]:
    yield from ("", f"### `{item.name}`", "", item.summary)
    for paragraph in prose(item):
        yield from ("", markdown(paragraph))
    if item.is_default:
        yield from ("", "It is the default" + (" for what it reads." if reads(item) else "."))
    if item.source_kinds:
        yield from ("", f"Reads: {', '.join(f'`{form}`' for form in reads(item))}")
    if item.source:
        yield from ("", "Source:", "", *(f"- {line}" for line in references(item)))
    if named := parameters(item):
        yield from ("", *_table(named))


def _table(named: Iterable[Parameter]) -> Iterator[str]:
    yield _row(_COLUMNS)
    yield _row("---" for _ in _COLUMNS)
    for each in named:
        default = f"`{each.default}`" if each.default else ""
        type_ = " or ".join(f"`{part}`" for part in each.type.split(" | "))
        yield _row((f"`{each.name}`", type_, default, each.bounds, each.unit, markdown(each.text)))


def _row(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"


def markdown(text: str) -> str:
    """Return a docstring's reStructuredText as Markdown.

    Examples
    --------
    >>> markdown("Of ``near`` and :class:`~a.Scene`, after [1]_.")
    'Of `near` and `Scene`, after [1].'
    """
    text = re.sub(r":\w+:`~?(?:[\w.]*\.)?(\w+)`", r"`\1`", text)
    return re.sub(r"(\[\d+\])_", r"\1", re.sub(r"(?<!`)``(?!`)", "`", text))
