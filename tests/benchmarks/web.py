"""From the pen that leaves the paper to the answer on the screen: ``make bench-web``.

Eight things are drawn, then one of them is moved again and again; the page counts milliseconds from
the pointer's going up to the frame that shows the answer, in Debian's Chromium on this machine.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from tests.pace import wait_until
from tests.web import Hand, chromium, serving_pad


def main() -> None:
    """Measure, and print a line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--strokes", type=int, default=60, help="how often a thing is moved")
    parser.add_argument("--workers", default="1")
    chosen = parser.parse_args()
    with serving_pad("--workers", chosen.workers) as (_, url), chromium() as browser:
        page = browser.new_page(viewport={"width": 1440, "height": 900}, reduced_motion="reduce")
        page.goto(url)
        page.get_by_test_id("show-me").click()
        page.get_by_test_id("pair-7").wait_for()
        page.get_by_test_id("tool-move").click()
        hand = Hand(page)
        circle = page.get_by_test_id("sketch-thing-3").locator("path").bounding_box()
        mx, my = hand.middle
        x, y = circle["x"] + circle["width"] / 2 - mx, circle["y"] + circle["height"] / 2 - my
        page.evaluate("void (window.sketchmatchLatencies.length = 0)")
        for k in range(chosen.strokes):
            to = (x + 6, y + 4) if k % 2 == 0 else (x, y)
            hand.draw([(x, y) if k % 2 == 0 else (x + 6, y + 4), to], closed=False)
            wait_until(lambda k=k: _count(page) > k, "the page gives no answer")
        taken = np.array(page.evaluate("window.sketchmatchLatencies"))
        frames = _frames(page)
    print(
        f"pen up to answer, 8 things, {len(taken)} times: median {np.median(taken):.0f} ms, "
        f"p95 {np.percentile(taken, 95):.0f} ms, longest {taken.max():.0f} ms"
    )
    print(f"a stroke of 2000 points: {frames}")


def _count(page: Any) -> int:
    return page.evaluate("window.sketchmatchLatencies.length")


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
