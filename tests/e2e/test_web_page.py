"""The page of the sketch pad, command by command."""

import os
import re
import signal
import subprocess
import sys
import urllib.request
from contextlib import contextmanager
from pathlib import Path

import pytest
from PIL import Image

from tests.pace import wait_until
from tests.pages import Page
from tests.processes import free_port
from tests.tools import ROOT
from tests.web import CLIENTS, PAD, built, serving_pad

pytestmark = pytest.mark.slow

PAGE = Page("clients/web/README.md", __name__)
SERVE = PAGE.take_one("console", "--web-robots")
BUILD, LOOK, DEVELOP, BENCH = PAGE.take_one("console", "make web").commands


def test_the_server_lets_the_page_reach_the_robot_that_it_names():
    (command,) = SERVE.commands
    _, _, *options = command.split()
    with (
        serving_pad(*options) as (_, address),
        urllib.request.urlopen(address) as answer,
    ):
        policy = answer.headers["content-security-policy"]
    assert re.search(rf"connect-src [^;]*{re.escape(options[-1])}", policy)


def made(command, arguments=""):
    """Run a command of make with the environment of these tests, and return what it says."""
    built()
    where = f"--old-file=.venv/dev BIN={Path(sys.executable).parent} ARGS='{arguments}'"
    done = subprocess.run(
        ["bash", "-c", f"{command} {where}"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=550,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_pad_is_built_once():
    assert "Nothing to be done" in made(BUILD)
    assert (PAD / "index.html").exists()


def test_its_pictures_are_taken(tmp_path):
    made(LOOK, f"--folder {tmp_path}")
    named = re.findall(r"\(docs/([\w-]+\.webp)\)", PAGE.text)
    assert set(named) <= {file.name for file in tmp_path.iterdir()}
    for name in named:
        with Image.open(tmp_path / name) as taken, Image.open(CLIENTS / "web/docs" / name) as kept:
            assert taken.size == kept.size


def test_the_way_from_the_pen_to_the_answer_is_measured():
    said = made(BENCH, "--strokes 3")
    assert "at once" in said
    assert "after a rest" in said


@contextmanager
def developing(pad):
    """Serve the page as it is being worked on, before a server, and yield its address."""
    port = free_port()
    process = subprocess.Popen(
        ["bash", "-c", f"exec {DEVELOP} -- --port {port} --strictPort --host 127.0.0.1"],
        cwd=ROOT,
        env={**os.environ, "SKETCHMATCH_WEB": pad},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        yield f"http://127.0.0.1:{port}"
    finally:
        os.killpg(process.pid, signal.SIGTERM)
        process.communicate(timeout=30)


def test_the_page_is_worked_on_before_a_server():
    with serving_pad() as (_, pad), developing(pad) as url:
        wait_until(lambda: "/src/main.tsx" in read(f"{url}/"), "nobody serves the page's source")
        called = urllib.request.Request(
            f"{url}/sketchmatch.v1.CatalogService/GetServerInfo",
            data=b"{}",
            headers={"content-type": "application/json"},
        )
        assert '"apiVersion":"sketchmatch.v1"' in read(called).replace(" ", "")


def read(page):
    try:
        with urllib.request.urlopen(page) as answer:
            return answer.read().decode()
    except OSError:
        return ""
