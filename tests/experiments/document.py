"""A report of headings, paragraphs, tables and pictures, as Markdown and as one HTML file."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Block", "Bullets", "Heading", "Paragraph", "Picture", "Table", "markdown", "save"]


@dataclass(frozen=True)
class Heading:
    """A heading; level 1 is the title."""

    text: str
    level: int = 2


@dataclass(frozen=True)
class Paragraph:
    """Plain text."""

    text: str


@dataclass(frozen=True)
class Bullets:
    """Plain texts, one below the other."""

    items: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    """A table of texts; the first columns, as many as ``left``, are aligned left.

    Rows that begin with an empty text belong to the one above.
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    left: int = 1
    note: str = ""

    def __post_init__(self) -> None:
        if any(len(row) != len(self.header) for row in self.rows):
            raise ValueError(f"a row of {self.title!r} has not {len(self.header)} cells")


@dataclass(frozen=True)
class Picture:
    """A PNG picture; ``name`` is that of its file beside the Markdown."""

    name: str
    png: bytes
    caption: str


Block = Heading | Paragraph | Bullets | Table | Picture


def save(folder: Path, blocks: Sequence[Block]) -> None:
    """Write ``report.md`` with its pictures beside it, and ``report.html``, which holds them."""
    folder.mkdir(parents=True, exist_ok=True)
    for block in blocks:
        if isinstance(block, Picture):
            (folder / block.name).write_bytes(block.png)
    (folder / "report.md").write_text(markdown(*blocks), encoding="utf-8")
    (folder / "report.html").write_text(_html(blocks), encoding="utf-8")


def markdown(*blocks: Block) -> str:
    """Return blocks as Markdown."""
    return "\n\n".join(_markdown_of(block) for block in blocks) + "\n"


def _markdown_of(block: Block) -> str:
    match block:
        case Heading(text, level):
            return f"{'#' * level} {text}"
        case Paragraph(text):
            return text
        case Bullets(items):
            return "\n".join(f"- {item}" for item in items)
        case Table():
            return _markdown_table(block)
        case Picture(name, _, caption):
            return f"![{caption}]({name})\n\n*{caption}*"


def _markdown_table(table: Table) -> str:
    lines = [table.header, *table.rows]
    widths = [max(3, *(len(line[k]) for line in lines)) for k in range(len(table.header))]

    def line(cells: Sequence[str]) -> str:
        padded = [
            cell.ljust(width) if k < table.left else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(cells, widths, strict=True))
        ]
        return f"| {' | '.join(padded)} |"

    rule = [
        "-" * width if k < table.left else "-" * (width - 1) + ":" for k, width in enumerate(widths)
    ]
    text = [f"**{table.title}**", "", line(table.header), line(rule), *map(line, table.rows)]
    return "\n".join([*text, "", table.note] if table.note else text)


_STYLE = """\
:root { color-scheme: light dark; --line: #8885; --soft: #8881; }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 75rem; margin: 2rem auto; padding: 0 1rem; }
h1, h2, h3 { line-height: 1.2; margin: 2em 0 .6em; }
h1 { margin-top: 0; }
p, ul { max-width: 48rem; }
figure { margin: 1.5rem 0; }
figure img { max-width: 100%; background: #fff; }
figcaption, .note { font-size: 13px; opacity: .8; max-width: 48rem; }
.table { overflow-x: auto; margin: 1.5rem 0; }
table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding-bottom: .4em; }
th, td { padding: .15em .7em; text-align: right; white-space: nowrap; }
th { border-bottom: 1px solid var(--line); vertical-align: bottom; white-space: normal; }
.l { text-align: left; }
tbody tr:nth-child(even) { background: var(--soft); }
nav ul { columns: 2; list-style: none; padding: 0; }
"""


def _html(blocks: Sequence[Block]) -> str:
    title = next(block.text for block in blocks if isinstance(block, Heading))
    parts = [_html_of(block, k) for k, block in enumerate(blocks)]
    contents = "".join(
        f'<li><a href="#s{k}">{html.escape(block.text)}</a></li>'
        for k, block in enumerate(blocks)
        if isinstance(block, Heading) and block.level == 2
    )
    parts.insert(1, f"<nav><ul>{contents}</ul></nav>")
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{html.escape(title)}</title>\n<style>\n{_STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(parts)
        + "\n</body>\n</html>\n"
    )


def _html_of(block: Block, number: int) -> str:
    match block:
        case Heading(text, level):
            return f'<h{level} id="s{number}">{html.escape(text)}</h{level}>'
        case Paragraph(text):
            return f"<p>{html.escape(text)}</p>"
        case Bullets(items):
            return f"<ul>{''.join(f'<li>{html.escape(item)}</li>' for item in items)}</ul>"
        case Table():
            return _html_table(block)
        case Picture(_, png, caption):
            data = base64.b64encode(png).decode("ascii")
            text = html.escape(caption)
            return (
                f'<figure><img alt="{text}" src="data:image/png;base64,{data}">'
                f"<figcaption>{text}</figcaption></figure>"
            )


def _html_table(table: Table) -> str:
    left = ' class="l"'

    def line(cells: Sequence[str], tag: str) -> str:
        inner = "".join(
            f"<{tag}{left if k < table.left else ''}>{html.escape(cell)}</{tag}>"
            for k, cell in enumerate(cells)
        )
        return f"<tr>{inner}</tr>"

    rows = "\n".join(line(row, "td") for row in table.rows)
    note = f'<p class="note">{html.escape(table.note)}</p>' if table.note else ""
    return (
        f'<div class="table"><table><caption>{html.escape(table.title)}</caption>\n'
        f"<thead>{line(table.header, 'th')}</thead>\n<tbody>\n{rows}\n</tbody></table>{note}</div>"
    )
