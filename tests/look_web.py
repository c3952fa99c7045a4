"""Pictures of the sketch pad for its documentation: ``make look-web``, and then look at them.

Somebody has drawn the living room, a way through it and an area to keep out of; each size is taken
in light and in dark, in Debian's Chromium.
"""

from __future__ import annotations

import argparse
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from scipy.interpolate import CubicSpline

from tests.tools import ROOT
from tests.web import PAD, Hand, chromium, serving_pad

Points = list[tuple[float, float]]
SIZES = ((1440, 900), (1024, 768), (390, 844))
_QUALITY = 88


def main() -> None:
    """Take all pictures into a folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=ROOT / "clients" / "web" / "docs")
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    with serving_pad("--no-store") as (_, url), chromium() as browser:
        for width, height in SIZES:
            for scheme in ("light", "dark"):
                page = browser.new_page(
                    viewport={"width": width, "height": height},
                    color_scheme=scheme,
                    locale="en-GB",
                    reduced_motion="reduce",
                    device_scale_factor=2 if width < 500 else 1,
                    has_touch=width < 1200,
                )
                page.goto(url)
                _draw(page)
                with Image.open(io.BytesIO(page.screenshot())) as picture:
                    picture.save(folder / f"{width}-{scheme}.webp", quality=_QUALITY, method=6)
                page.close()
                print(folder / f"{width}-{scheme}.webp")


def _draw(page: Any) -> None:
    page.get_by_test_id("show-me").click()
    page.get_by_test_id("pair-7").wait_for()
    on_screen = _placing(page)
    hand = Hand(page)
    page.get_by_test_id("tool-zone").click()
    hand.draw(on_screen(ZONE))
    page.get_by_test_id("tool-route").click()
    hand.draw(on_screen(ROUTE), closed=False)
    page.locator(".floor .route polyline").wait_for(state="attached")
    page.locator(".floor .zone polygon").wait_for(state="attached")
    page.get_by_test_id("tool-zone").click()
    page.mouse.move(2, 2)


def _placing(page: Any) -> Callable[[Points], Points]:
    """Return what takes points of the bundled drawing to pixels from the middle of the paper."""
    strokes = json.loads((PAD / "places" / "living-room" / "sketch.json").read_text())["strokes"]
    drawn = [np.array(strokes[k]["points"])[:, :2] for k in (2, 4)]
    boxes = [
        page.get_by_test_id(f"sketch-thing-{k}").locator("path").bounding_box() for k in (2, 4)
    ]
    there = [np.array([box["x"] + box["width"] / 2, box["y"] + box["height"] / 2]) for box in boxes]
    here = [(points.min(axis=0) + points.max(axis=0)) / 2 for points in drawn]
    scale = np.linalg.norm(there[1] - there[0]) / np.linalg.norm(here[1] - here[0])
    middle = np.array(Hand(page).middle)

    def on_screen(points: Points) -> Points:
        placed = there[0] - middle + scale * (np.array(points) - here[0])
        return [(float(x), float(y)) for x, y in placed]

    return on_screen


def _smooth(corners: Points, closed: bool = False) -> Points:
    """Return points of a curve through corners, as a hand draws it."""
    ring = [*corners, corners[0]] if closed else corners
    ways = CubicSpline(
        np.arange(len(ring)), np.array(ring), bc_type="periodic" if closed else "natural"
    )
    return [(float(x), float(y)) for x, y in ways(np.linspace(0, len(ring) - 1, 8 * len(ring)))]


ROUTE = _smooth([(352, 96), (346, 190), (372, 262), (370, 330), (392, 366)])
ZONE = _smooth(
    [
        (541, 268),
        (598, 262),
        (654, 272),
        (658, 330),
        (650, 388),
        (592, 392),
        (538, 386),
        (532, 326),
    ],
    closed=True,
)


if __name__ == "__main__":
    main()
