"""From the pen that leaves the paper to the answer on the screen: ``make bench-web``.

Eight things are drawn, then one of them is moved again and again; the page tells when the pointer
went up, when the change was sent, when the last of its answer came, and when the frame with it was
painted, in Debian's Chromium on this machine. Waiting for a busy machine counts in these times, not
in what the server spends of its processors.
"""

from __future__ import annotations

import argparse
import os
import time
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from tests.benchmarks.server import processor_seconds
from tests.pace import wait_until
from tests.web import Hand, chromium, serving_pad

_RESTS = {"at once": 0.0, "after a rest": 0.5}
"""Seconds between an answer and the next change."""

_PARTS = "page", "server", "paint"
"""Until a change is sent, until the last of its answer has come, until that is painted."""

_WATCHED = """
  window.marks = { up: 0, sent: 0, heard: [] };
  addEventListener('pointerup', (event) => (marks.up = event.timeStamp), true);
  const fetched = window.fetch;
  window.fetch = async (input, init) => {
    const name = String(input.url ?? input).split('/').pop();
    if (name === 'UpdateSketch') marks.sent = performance.now();
    const answer = await fetched(input, init);
    if (name !== 'WatchSketch') return answer;
    const [ours, theirs] = answer.body.tee();
    (async () => {
      const reader = ours.getReader();
      while (!(await reader.read()).done) marks.heard.push(performance.now());
    })();
    return new Response(theirs, { status: answer.status, headers: answer.headers });
  };
"""


def main() -> None:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--strokes", type=int, default=60, help="how often a thing is moved")
    parser.add_argument("--workers", default="1")
    chosen = parser.parse_args()
    table = Table("next change", "p50 ms", "p95 ms", "most ms", *_PARTS, "server ms")
    with serving_pad("--workers", chosen.workers) as (server, url), chromium() as browser:
        page = browser.new_page(viewport={"width": 1440, "height": 900}, reduced_motion="reduce")
        page.add_init_script(_WATCHED)
        page.goto(url)
        page.get_by_test_id("show-me").click()
        page.get_by_test_id("pair-7").wait_for()
        page.get_by_test_id("tool-move").click()
        for name, rest in _RESTS.items():
            spent = processor_seconds(server.process.pid)
            parts = _moved(page, chosen.strokes, rest)
            spent = processor_seconds(server.process.pid) - spent
            taken = parts.sum(axis=1)
            table.add_row(
                name,
                *(f"{each:.0f}" for each in (*np.percentile(taken, [50, 95]), taken.max())),
                *(f"{share:.0%}" for share in parts.sum(axis=0) / parts.sum()),
                f"{1000 * spent / chosen.strokes:.0f}",
            )
        frames = _frames(page)
    table.title = f"pen up to the answer on the screen, 8 things, load {os.getloadavg()[0]:.1f}"
    Console().print(table)
    print(f"a stroke of 2000 points: {frames}")


def _moved(page: Any, times: int, rest: float) -> Any:
    """Move a thing to and fro; return milliseconds until sent, answered and painted, (times, 3)."""
    hand = Hand(page)
    box = page.get_by_test_id("sketch-thing-3").locator("path").bounding_box()
    mx, my = hand.middle
    here = box["x"] + box["width"] / 2 - mx, box["y"] + box["height"] / 2 - my
    there = here[0] + 6, here[1] + 4
    page.evaluate("void (window.sketchmatchShown.length = 0)")
    parts = []
    for k in range(times):
        page.evaluate("void (marks.heard.length = 0)")
        hand.draw([here, there] if k % 2 == 0 else [there, here], closed=False)
        wait_until(lambda k=k: _count(page) > k, "the page gives no answer")
        marks = page.evaluate("marks")
        shown = page.evaluate("window.sketchmatchShown")[k]
        heard = max(each for each in marks["heard"] if each < shown)
        parts.append(np.diff([marks["up"], marks["sent"], heard, shown]))
        time.sleep(rest)
    return np.array(parts)


def _count(page: Any) -> int:
    return page.evaluate("window.sketchmatchShown.length")


def _frames(page: Any) -> str:
    """Return how long the frames last while a long stroke is drawn."""
    page.get_by_test_id("tool-pen").click()
    draw = """() => new Promise((done) => {
      const paper = document.querySelector('[data-testid=paper]');
      const { left, top, width, height } = paper.getBoundingClientRect();
      const send = (kind, k) => paper.dispatchEvent(new PointerEvent(kind, {
        pointerId: 1, pointerType: 'mouse', bubbles: true, cancelable: true, button: 0,
        clientX: left + width / 2 + 150 * Math.cos(k / 50) * (1 + k / 4000),
        clientY: top + height / 2 + 150 * Math.sin(k / 50) }));
      let k = 0, before = performance.now();
      const frames = [];
      send('pointerdown', k);
      const step = (now) => {
        frames.push(now - before);
        before = now;
        for (let i = 0; i < 10; i++) send('pointermove', ++k);
        if (k < 2000) requestAnimationFrame(step);
        else { send('pointerup', k); done(frames.slice(2)); }
      };
      requestAnimationFrame(step);
    })"""
    lasted = np.array(page.evaluate(draw))
    return (
        f"median {1000 / np.median(lasted):.0f} frames a second, "
        f"p95 of a frame {np.percentile(lasted, 95):.1f} ms"
    )


if __name__ == "__main__":
    main()
