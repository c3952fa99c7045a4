"""How values show themselves: a line in a terminal, a small table in print and in a notebook.

All but labels is ASCII, which every terminal and pipe can take.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

__all__ = ["Table", "Tabular", "likelihood", "listed", "name", "shortened"]

_ROWS = 20
_NAMES = 5
_LONGEST = 30


def shortened(label: str) -> str:
    """Return a label that leaves room for others in its line.

    Examples
    --------
    >>> shortened("sofa"), shortened("x" * 99) == 27 * "x" + "..."
    ('sofa', True)
    """
    return label if len(label) <= _LONGEST else f"{label[: _LONGEST - 3]}..."


def name(index: int, label: str) -> str:
    """Return what to call an object: its index, and its label where it has one.

    Examples
    --------
    >>> name(0, "sofa"), name(1, "")
    ('0 sofa', '1')
    """
    return f"{index} {shortened(label)}".rstrip()


def listed(names: Iterable[str]) -> str:
    """Return names, without the empty ones, in a line.

    Examples
    --------
    >>> listed(["a", "", "b"]), listed("abcdefg")
    ('a, b', 'a, b, c, d, e, ...')
    """
    shown = [shortened(each) for each in names if each.strip()]
    return ", ".join(shown if len(shown) <= _NAMES else [*shown[:_NAMES], "..."])


def likelihood(probability: float) -> str:
    """Return a probability that rounds to 1 only if it is.

    Examples
    --------
    >>> likelihood(0.9986), likelihood(0.99986), likelihood(1.0)
    ('0.999', '>0.999', '1.000')
    """
    return ">0.999" if 0.9995 <= probability < 1.0 else f"{probability:.3f}"


@dataclass(frozen=True)
class Table:
    """A small table; of a long one the first rows.

    Attributes
    ----------
    title
        The line above it.
    heads
        What is in each column.
    rows
        Its cells.
    names
        How many columns, from the first, hold names, which stand at the left.

    Examples
    --------
    >>> table = Table("two things", ("is", "size"), [("a sofa", "2.5"), ("a bed", "10")])
    >>> print(table)
    two things
    is      size
    a sofa   2.5
    a bed     10
    >>> table.html()[:54]
    '<p>two things</p><table><tr><th>is</th><th>size</th></'
    """

    title: str
    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    names: int = 1

    def __str__(self) -> str:
        """Return it for a terminal."""
        shown = [self.heads, *self.rows[:_ROWS]]
        widths = [max(map(len, column)) for column in zip(*shown, strict=True)]
        lines = [
            "  ".join(
                cell.ljust(width) if k < self.names else cell.rjust(width)
                for k, (cell, width) in enumerate(zip(row, widths, strict=True))
            ).rstrip()
            for row in shown
        ]
        return "\n".join([self.title, *lines, *self._rest()])

    def html(self) -> str:
        """Return it for a notebook."""
        head = "".join(f"<th>{escape(cell)}</th>" for cell in self.heads)
        body = "".join(
            "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>"
            for row in self.rows[:_ROWS]
        )
        rest = "".join(f"<p>{line}</p>" for line in self._rest())
        return f"<p>{escape(self.title)}</p><table><tr>{head}</tr>{body}</table>{rest}"

    def _rest(self) -> list[str]:
        left_out = len(self.rows) - _ROWS
        return [f"... and {left_out} more"] if left_out > 0 else []


class Tabular(ABC):
    """What shows itself in a line, and printed or in a notebook as a small table."""

    @abstractmethod
    def _headline(self) -> str:
        """Return what there is to say of it in a line."""

    @abstractmethod
    def _table(self) -> Table:
        """Return what is in it; objects count from 0."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self._headline()}>"

    def __str__(self) -> str:
        """Return the table for a terminal."""
        return str(self._table())

    def _repr_html_(self) -> str:
        """Return the same for a notebook."""
        return self._table().html()
