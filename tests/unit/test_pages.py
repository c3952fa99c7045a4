"""Every block of code on the first page and those of the clients is run."""

import importlib
import re

from tests.pages import NOT_RUN, TAKEN, Block, blocks_of, page_names
from tests.tools import ROOT


def test_every_block_is_run_by_a_test():
    for file in sorted(ROOT.glob("tests/*/test_*.py")):
        if "from tests.pages import Page\n" in file.read_text(encoding="utf-8"):
            importlib.import_module(".".join(file.relative_to(ROOT).with_suffix("").parts))
    shown = [block for name in page_names() for block in blocks_of(name)]
    forgotten = [
        f"{block.page}:{block.line}: {block.text.partition(chr(10))[0]}"
        for block in shown
        if block not in TAKEN and not (block.commands == [] and _is_of_a_shell(block))
    ]
    assert forgotten == [], "take them in a test that runs them, or say in NOT_RUN why not"


def _is_of_a_shell(block):
    return block.language in ("console", "sh")


def test_no_fence_is_overlooked():
    pages = page_names()
    assert {"README.md", "clients/cpp/README.md", "proto/examples/README.md"} < set(pages)
    for name in pages:
        fences = re.findall(r"^\s*(?:```|~~~)", (ROOT / name).read_text(encoding="utf-8"), re.M)
        assert len(fences) == 2 * len(blocks_of(name)), name


def test_what_cannot_be_run_is_shown_somewhere():
    text = "".join((ROOT / name).read_text(encoding="utf-8") for name in page_names())
    for command in NOT_RUN:
        assert re.search(rf"^(\$ )?{re.escape(command)}", text, re.M), command


def test_commands_are_told_from_what_they_print_and_from_comments():
    console = Block("", 1, "console", "$ one \\\n  two   # why\nprinted\n$ make test\n$ three\n")
    assert console.commands == ["one    two", "three"]
    shell = Block("", 1, "sh", "# a comment\none 'a#b'\ntwo # why\n")
    assert shell.commands == ["one 'a#b'", "two"]
    assert Block("", 1, "cpp", "$ one\n").commands == []
