"""The page of what a plugin may import says what the docstrings say."""

import importlib
import re
from importlib.util import find_spec

import pytest

from tests.tools import ROOT, require

WRITTEN = (ROOT / "plugins" / "API.md").read_text(encoding="utf-8")
MODULES = re.findall(r"^## `(.*)`$", WRITTEN, re.MULTILINE)


@pytest.mark.slow
def test_the_page_is_fresh():
    require(find_spec("griffe2md"), "griffe2md (`pip install --editable '.[dev]'`)")
    from plugins.api_page import page

    assert page() == WRITTEN, "run `make api`"


@pytest.mark.parametrize("module", MODULES)
def test_the_page_has_all_that_a_module_offers(module):
    section = WRITTEN.split(f"\n## `{module}`\n")[1].split("\n## ")[0]
    shown = set(re.findall(r"^### `(.*)`$", section, re.MULTILINE))
    assert shown == set(importlib.import_module(module).__all__)


def test_the_page_is_markdown_alone():
    assert {"sketchmatch.api", "sketchmatch.api.documents"} <= set(MODULES)
    for markup in (r":\w+:`", r"(?<!`)``(?!`)", r"::$", r"\]\(#sketchmatch\."):
        assert not re.search(markup, WRITTEN, re.MULTILINE), markup
