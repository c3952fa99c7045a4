"""The sketch pad as built, a browser for it, and hands to draw with."""

import fcntl
import json
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from tests import processes
from tests.tools import ROOT, require

CLIENTS = ROOT / "clients"
PAD = ROOT / "engine" / "sketchmatch" / "server" / "pad"
_FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


@cache
def built() -> Path:
    """Return the folder of the built pad; it is built where it is not, or not any more."""
    require(shutil.which("npm"), "npm of Node.js, which builds the sketch pad,")
    # Several processes run tests, and one of them builds.
    with (ROOT / "clients" / "package-lock.json").open(encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = subprocess.run(
            ["make", "web"], cwd=ROOT, capture_output=True, text=True, check=False, timeout=500
        )
    assert done.returncode == 0, done.stdout + done.stderr
    return PAD


@contextmanager
def chromium() -> Iterator[Any]:
    """Start Debian's Chromium, as Playwright drives it."""
    program = shutil.which("chromium")
    require(program, "chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=_FLAGS)
        try:
            yield browser
        finally:
            browser.close()


def checked(check: str, *arguments: str, told: Any = None) -> Any:
    """Run a program of ``clients/web/checks`` with its input as JSON, and return what it prints."""
    built()
    done = subprocess.run(
        ["node", str(CLIENTS / "web" / "checks" / f"{check}.mjs"), *arguments],
        input=json.dumps(told),
        capture_output=True,
        text=True,
        check=False,
        timeout=240,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout)


@contextmanager
def serving_pad(*arguments: str) -> Iterator[tuple[processes.Server, str]]:
    """Run a server process that shows the pad, and yield it with the pad's address."""
    built()
    options = ("--web-address", "127.0.0.1:0", "--workers", "0", *arguments)
    with processes.server(*options) as server:
        yield server, server.wait_for(r"the sketch pad is at (\S+)")


def corners(x: float, y: float, width: float, height: float) -> list[tuple[float, float]]:
    """Return the corners of a box around its middle."""
    w, h = width / 2, height / 2
    return [(x - w, y - h), (x + w, y - h), (x + w, y + h), (x - w, y + h)]


class Hand:
    """Draws on the paper of a page, in pixels from the middle of the paper."""

    def __init__(self, page: Any) -> None:
        self.page = page

    @property
    def middle(self) -> tuple[float, float]:
        box = self.page.get_by_test_id("paper").bounding_box()
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def draw(self, points: list[tuple[float, float]], *, closed: bool = True) -> None:
        """Draw a line with the mouse, as fast as it goes."""
        x, y = self.middle
        first, *rest = [*points, points[0]] if closed else points
        self.page.mouse.move(x + first[0], y + first[1])
        self.page.mouse.down()
        for px, py in rest:
            self.page.mouse.move(x + px, y + py, steps=6)
        self.page.mouse.up()

    def box(self, x: float, y: float, width: float, height: float) -> None:
        self.draw(corners(x, y, width, height))

    def tap(self, x: float, y: float) -> None:
        mx, my = self.middle
        self.page.mouse.click(mx + x, my + y)


KITCHEN = {
    "fridge": (-160, -105, 55, 60),
    "stove": (-15, -112, 52, 45),
    "dining table": (138, -68, 92, 88),
    "kitchen island": (12, -12, 155, 66),
    "bench": (-158, 48, 34, 130),
    "bin": (-62, 120, 38, 36),
}
"""The bundled kitchen as somebody draws it: name, then middle and size."""


def draw_kitchen(hand: Hand) -> None:
    for place in KITCHEN.values():
        hand.box(*place)


def answer(page: Any) -> dict[int, str]:
    """Return what the page says: the name on the map, by number of the sketched thing."""
    read = """() => [...document.querySelectorAll('[data-testid=pairs] .line')].map((line) =>
      ['.dot', '.partner'].map((part) => line.querySelector(part).textContent))"""
    return {int(number): name for number, name in page.evaluate(read)}
