import json
import math
import os
import re
import socket
from dataclasses import dataclass
from pathlib import Path

import PIL.Image
import PIL.ImageChops
import pytest

from sketchmatch import read_scene
from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_TRUTH
from tests.processes import Terminal, sketchmatch

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def truth():
    """Return the mapped object of each sketched one, the nearest to where the truth has it."""
    known = json.loads(LIVING_ROOM_TRUTH.read_text())["objects"]
    mapped = [item.centroid for item in read_scene(LIVING_ROOM_MAP).objects]
    nearest = [
        min(range(len(mapped)), key=lambda k: math.dist(mapped[k], item["map_centroid"]))
        for item in known
    ]
    assert sorted(nearest) == list(range(8))
    return {g: (h, item["label"]) for g, (h, item) in enumerate(zip(nearest, known, strict=True))}


@dataclass(frozen=True)
class Demo:
    """A demo that has run.

    Attributes
    ----------
    code, stdout, stderr
        How it ended and what it said.
    overlay
        Where it drew.
    """

    code: int
    stdout: str
    stderr: str
    overlay: Path


def run_demo(folder: Path, **environment: str) -> Demo:
    overlay = folder / "demo.png"
    done = sketchmatch("demo", "--overlay", overlay, env={**os.environ, **environment})
    return Demo(done.returncode, done.stdout, done.stderr, overlay)


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    return run_demo(tmp_path_factory.mktemp("demo"))


def test_the_demo_finds_the_right_objects_and_ends_well(demo, truth):
    assert demo.code == 0, demo.stderr
    rows = [line.split("\t") for line in demo.stdout.splitlines()[1:]]
    assert {int(row[0]): (int(row[1]), row[3]) for row in rows} == truth
    assert all(float(row[2]) > 0.9 for row in rows)


def test_the_demo_draws_the_answer(demo):
    assert f"the picture is in {demo.overlay}" in demo.stderr
    with PIL.Image.open(demo.overlay) as picture:
        assert (picture.format, picture.width) == ("PNG", 1600)


def test_the_readme_shows_what_the_demo_draws(demo):
    kept = LIVING_ROOM_MAP.with_name("living_room_match.png")
    with PIL.Image.open(demo.overlay) as drawn, PIL.Image.open(kept) as shown:
        assert shown.size == drawn.size
        difference = PIL.ImageChops.difference(shown.convert("RGB"), drawn.convert("RGB"))
    assert max(most for _, most in difference.getextrema()) < 64  # of a palette, not of other words


def test_the_demo_asks_a_real_server_and_leaves_none_behind(demo):
    port = re.search(r"\[server\] sketchmatch: listening on 127\.0\.0\.1:(\d+)", demo.stderr)[1]
    assert "[server] sketchmatch: stopped" in demo.stderr
    with socket.socket() as link:
        assert link.connect_ex(("127.0.0.1", int(port))) != 0


def test_with_a_warm_cache_nothing_is_compiled(demo, tmp_path):
    del demo  # it saw to the cache
    assert "compiling" not in run_demo(tmp_path).stderr


def test_a_first_ever_run_says_that_it_compiles(tmp_path):
    # Kernels may be left in the usual temporary folder, by a run without a folder for them.
    empty = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "TMPDIR": str(tmp_path)}
    first = run_demo(tmp_path, **empty)
    assert first.code == 0
    assert "[server] sketchmatch: compiling the kernels: this happens once" in first.stderr
    assert len(first.stdout.splitlines()) == 9


def test_the_demo_shows_the_search_on_a_terminal(tmp_path):
    terminal = Terminal("demo", "--overlay", tmp_path / "demo.png")
    assert terminal.end()[0] == 0
    assert "8 of 8 sketched objects matched" in terminal.shown
    assert "FMAP confidence" in terminal.shown or "fmap confidence" in terminal.shown


def test_a_demo_that_cannot_draw_says_so_and_leaves_no_server_behind(tmp_path):
    done = sketchmatch("demo", "--overlay", tmp_path / "missing" / "demo.png")
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith("sketchmatch: ")
