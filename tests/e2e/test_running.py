"""The page for operators, followed line by line."""

import importlib.util
import os
import re
import sys

import pytest

from tests.shell import Shell, steps
from tests.tools import ROOT, require

PAGE = (ROOT / "engine" / "RUNNING.md").read_text(encoding="utf-8")
SECTIONS = re.findall(r"^## (.*?)\n(.*?)(?=^## |\Z)", PAGE, re.S | re.M)


def commands_of(*titles):
    """Return the console blocks of sections, in their order."""
    return "".join(
        block
        for title, text in SECTIONS
        if title in titles
        for block in re.findall(r"^```console\n(.*?)^```", text, re.S | re.M)
    )


@pytest.fixture(scope="module")
def operator(tmp_path_factory):
    """Yield the shell of somebody who follows the page, with this program as installed."""
    folder = tmp_path_factory.mktemp("operator")
    command = folder / "bin" / "sketchmatch"
    command.parent.mkdir()
    paths = os.environ.get("PYTHONPATH", "")
    command.write_text(
        f"#!/bin/sh\nPYTHONPATH='{paths}' exec '{sys.executable}' -m sketchmatch \"$@\"\n"
    )
    command.chmod(0o755)
    shell = Shell(folder)
    try:
        shell.run(f"export PATH='{command.parent}':$PATH")
        yield shell
    finally:
        shell.close()


def follow(shell, text):
    for step in steps(text):
        shell.follow(step)


@pytest.mark.slow
def test_each_line_does_what_the_page_says(operator):
    titles = [title for title, _ in SECTIONS]
    followed = titles[: titles.index("Metrics")]
    text = commands_of(*followed)
    for word in ("openssl", "tokens add", "serve &", "health", "status", "match", "kill -HUP"):
        assert word in text
    follow(operator, text)


@pytest.mark.slow
def test_metrics_are_told_as_the_page_says(operator):
    require(importlib.util.find_spec("prometheus_client"), "the package prometheus-client")
    follow(operator, commands_of("Metrics"))


def test_every_metric_is_on_the_page():
    source = (ROOT / "engine" / "sketchmatch" / "server").glob("*.py")
    text = "".join(path.read_text(encoding="utf-8") for path in source)
    names = set(re.findall(r'"(sketchmatch_[a-z_]+)"', text))
    assert names
    assert names <= set(re.findall(r"`(sketchmatch_[a-z_]+)`", PAGE))
