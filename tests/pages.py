"""The blocks of code that pages show, and which test module runs each.

A test module takes what it runs while it is imported, and ``tests/unit/test_pages.py`` refuses a
block that no module takes, so that none can be forgotten. What cannot be run at all is in
``NOT_RUN``, with the reason.
"""

import re
import textwrap
from dataclasses import dataclass

from tests.tools import ROOT

NOT_RUN = {
    "sudo apt-get install": "needs root; a test compares the packages with those that CI installs",
    "make test": "is what runs the tests",
}
"""Commands that no test can run, by how they begin, and why."""


@dataclass(frozen=True)
class Block:
    """A fenced block of a page, which begins at a line, counted from 1."""

    page: str
    line: int
    language: str
    text: str

    @property
    def commands(self) -> list[str]:
        """Return its commands, if it is of a shell, but those that no test can run."""
        shown = self.text.replace("\\\n", " ")
        if self.language == "console":
            lines = re.findall(r"^\$ (.*?)(?:\s+# .*)?$", shown, re.M)
        elif self.language == "sh":
            lines = re.findall(r"^([^#\n].*?)(?:\s+# .*)?$", shown, re.M)
        else:
            return []
        return [line for line in lines if not line.startswith(tuple(NOT_RUN))]


_FENCED = re.compile(r"^( *)(```+|~~~+)(\w*)[^\n]*\n(.*?)^\1\2$", re.M | re.S)

TAKEN: dict[Block, set[str]] = {}
"""Which modules run a block."""


def page_names() -> list[str]:
    """Return the pages of which every block is run."""
    clients = "clients/README.md", "clients/*/README.md"
    patterns = "README.md", "engine/GUIDE.md", *clients, "proto/**/README.md"
    found = [page for pattern in patterns for page in sorted(ROOT.glob(pattern))]
    ours = [str(page.relative_to(ROOT)) for page in found]
    return [name for name in ours if "node_modules" not in name]


def blocks_of(page: str) -> list[Block]:
    """Return the fenced blocks of a page."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return [
        Block(page, text.count("\n", 0, found.start()) + 1, found[3], textwrap.dedent(found[4]))
        for found in _FENCED.finditer(text)
    ]


class Page:
    """A page, for a module that runs blocks of it."""

    def __init__(self, name: str, runner: str) -> None:
        self.text = (ROOT / name).read_text(encoding="utf-8")
        self._blocks = blocks_of(name)
        self._runner = runner

    def take(self, language: str, part: str = "") -> list[Block]:
        """Return the blocks in a language that contain a text: the module runs all of them."""
        found = [
            block for block in self._blocks if block.language == language and part in block.text
        ]
        for block in found:
            TAKEN.setdefault(block, set()).add(self._runner)
        return found

    def take_one(self, language: str, part: str = "") -> Block:
        """Return the only such block: the module runs it."""
        (block,) = self.take(language, part)
        return block
