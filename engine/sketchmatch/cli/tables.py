"""Tables for people: a line for each row as long as the terminal is wide enough, else a list."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderResult
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from sketchmatch.cli.output import clean

__all__ = ["Column", "Rows", "plain"]

_NARROW = 60
_GAP = 2


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes
    ----------
    name
        Its heading.
    right
        Whether its cells end below each other, as figures do.
    least
        How narrow it may become; 0 for a column that must be whole.
    wraps
        Whether its cells take several lines then; otherwise they are cut short.
    dispensable
        0 for a column that stays, 1 for one that goes where cutting cells is not enough, 2 for one
        that goes before any cell is cut.
    """

    name: str
    right: bool = False
    least: int = 0
    wraps: bool = False
    dispensable: int = 0


@dataclass(frozen=True)
class _Laid:
    """A column as it is laid out: where its cells are in the rows, and how wide it is."""

    column: Column
    index: int
    width: int

    @property
    def spare(self) -> int:
        return max(self.width - self.column.least, 0) if self.column.least else 0

    def given(self, spare: int) -> _Laid:
        return replace(self, width=self.width - spare)


class Rows:
    """Rows that are shown as a table, or, where that has no room, as a list.

    Parameters
    ----------
    title
        What is above them.
    columns
        The first one says what a row is about.
    rows
        A cell for each column; empty ones are left out of the list.
    """

    def __init__(
        self, title: str, columns: Sequence[Column], rows: Iterable[Sequence[Text]]
    ) -> None:
        self._title = title
        self._columns = columns
        self._rows = list(rows)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Choose the form that has room."""
        del console
        if self._title:
            yield Text(self._title, style="bold")
        laid = self._laid(options.max_width) if options.max_width > _NARROW else None
        if laid is not None:
            yield self._table(laid)
        else:
            yield from self._list()

    def _laid(self, room: int) -> list[_Laid] | None:
        """Return the columns that there is room for, or None where a column has none."""
        laid = [
            _Laid(column, k, self._natural(column, k))
            for k, column in enumerate(self._columns)
            if k == 0 or any(row[k].plain for row in self._rows)
        ]
        _drop(laid, 2, lambda: _width(laid) > room)
        _drop(laid, 1, lambda: _width(laid) - sum(each.spare for each in laid) > room)
        for each in sorted(laid, key=lambda each: -each.spare):
            lacking = max(_width(laid) - room, 0)
            laid[laid.index(each)] = each.given(min(each.spare, lacking))
        return laid if _width(laid) <= room else None

    def _natural(self, column: Column, k: int) -> int:
        cells = "\n".join([column.name, *(row[k].plain for row in self._rows)])
        return max(map(cell_len, cells.split("\n")))

    def _table(self, laid: Sequence[_Laid]) -> Table:
        table = Table(
            box=box.SIMPLE_HEAD,
            show_edge=False,
            pad_edge=False,
            collapse_padding=True,
            padding=(0, 1, 0, 0),
        )
        for each in laid:
            table.add_column(
                each.column.name,
                justify="right" if each.column.right else "left",
                width=each.width,
                no_wrap=not each.column.wraps,
                overflow="fold" if each.column.wraps else "ellipsis",
            )
        for row in self._rows:
            table.add_row(*(row[each.index] for each in laid))
        return table

    def _list(self) -> Iterator[Text | Padding]:
        for head, *cells in self._rows:
            title = head.copy()
            title.stylize("bold")
            yield title
            said = [
                Text(f"{column.name}: ").append_text(cell)
                for column, cell in zip(self._columns[1:], cells, strict=True)
                if cell.plain
            ]
            if said:
                yield Padding(Text(", ").join(said), (0, 0, 0, 2))


def plain(text: str, style: str = "") -> Text:
    """Return a text of others: no markup, whatever it looks like, and nothing to be obeyed."""
    return Text(clean(text), style)


def _drop(laid: list[_Laid], dispensable: int, crowded: Callable[[], bool]) -> None:
    """Drop columns that are at least this dispensable, the last first, while it is crowded."""
    for each in [each for each in reversed(laid) if each.column.dispensable >= dispensable]:
        if crowded():
            laid.remove(each)


def _width(laid: Sequence[_Laid]) -> int:
    return sum(each.width for each in laid) + _GAP * (len(laid) - 1)
