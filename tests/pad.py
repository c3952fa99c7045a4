"""What a person sees and does on the page of the sketch pad."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from PIL import Image

from tests.pace import wait_until
from tests.web import KITCHEN, Hand, draw_kitchen

ROOMS = [(0, 0, 90, 30), (0, 32, 40, 90), (42, 32, 64, 60), (42, 62, 64, 90), (66, 32, 90, 90)]
DOORS = [(10, 30, 19, 32), (48, 30, 57, 32), (48, 60, 57, 62), (74, 30, 83, 32)]
"""A floor, each by two corners in cells: the third and the fourth room open into each other."""


def wait_for_answer(page: Any, things: int) -> None:
    """Wait until the page tells of so many things."""
    headline = page.get_by_test_id("headline")
    headline.get_by_text(re.compile(rf"(All|of) {things} things found")).wait_for()


def kitchen_drawn(page: Any) -> Hand:
    """Draw the kitchen, wait for the answer, and return the hand that drew it."""
    hand = Hand(page)
    draw_kitchen(hand)
    wait_for_answer(page, 6)
    return hand


def name_the_stove_my_oven(page: Any, hand: Hand) -> None:
    """Give the drawn stove a name of one's own."""
    page.get_by_test_id("tool-name").click()
    hand.tap(*KITCHEN["stove"][:2])
    page.get_by_role("dialog").locator("input").fill("my oven")
    page.keyboard.press("Enter")


def keep_map_as(page: Any, name: str) -> None:
    """Have the server keep the map under a name."""
    page.get_by_test_id("open-places").click()
    page.get_by_label("Store it as").fill(name)
    page.get_by_test_id("keep-map").click()
    page.get_by_test_id("notice").get_by_text(name).wait_for()


def said(page: Any) -> Any:
    """Return the pairs that the person has said themselves."""
    return page.locator("[data-testid=pairs] .line", has_text="you said so")


def say_the_bin_is_the_bench(page: Any) -> None:
    """Say so by two taps, of a kitchen that is drawn and answered."""
    Hand(page).tap(*KITCHEN["bin"][:2])
    page.get_by_test_id("asking").wait_for()
    page.locator(".floor .thing", has_text="bench").click()
    said(page).wait_for()


def names() -> dict[int, str]:
    """Return what the things of the kitchen are, as a right answer says it."""
    return dict(enumerate(KITCHEN, start=1))


def saved_text(page: Any, item: str) -> str:
    """Save by an item of the menu, and return what was saved."""
    page.get_by_test_id("open-file").click()
    with page.expect_download() as saved:
        page.get_by_test_id(item).click()
    text: str = saved.value.path().read_text()
    return text


def copied_link(page: Any) -> str:
    """Return the link that the page copies."""
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.get_by_test_id("open-file").click()
    page.get_by_test_id("copy-link").click()
    page.get_by_test_id("notice").get_by_text("The link is copied.").wait_for()
    link: str = page.evaluate("navigator.clipboard.readText()")
    return link


def labels(page: Any) -> list[str]:
    """Return the names on the map, sorted."""
    return sorted(page.locator(".floor .thing .label").all_text_contents())


def strokes(page: Any) -> int:
    """Return how many strokes there are, by what would be saved."""
    undo = page.get_by_test_id("undo")
    page.get_by_test_id("open-file").click()
    if page.get_by_test_id("save-strokes").is_disabled():
        page.keyboard.press("Escape")
        return 0
    page.wait_for_timeout(120)  # Chromium drops what is more than ten downloads in a second
    with page.expect_download() as saved:
        page.get_by_test_id("save-strokes").click()
    undo.wait_for()
    return len(json.loads(saved.value.path().read_text())["strokes"])


def floor_plan(folder: Path) -> tuple[Path, Path]:
    """Write the floor as an occupancy grid without a thing in it, and return yaml and picture."""
    cells = np.zeros((94, 94), np.uint8)
    for x, y, u, v in (*ROOMS, *DOORS):
        cells[2 + y : 2 + v, 2 + x : 2 + u] = 254
    picture, yaml_file = folder / "floor.png", folder / "floor.yaml"
    Image.fromarray(cells[::-1]).save(picture)
    head = {"image": picture.name, "resolution": 0.1, "origin": [0, 0, 0], "negate": 0}
    thresholds = {"occupied_thresh": 0.65, "free_thresh": 0.196}
    yaml_file.write_text(yaml.safe_dump(head | thresholds), encoding="utf-8")
    return yaml_file, picture


def open_floor_as_rooms(page: Any, folder: Path) -> None:
    """Open the floor as a map of things, of which it has none, and then of rooms."""
    page.get_by_test_id("map-file").set_input_files(floor_plan(folder))
    page.locator(".map-pane .title", has_text="floor.yaml").wait_for()
    page.get_by_test_id("notice").get_by_text("choose the segmenter rooms").wait_for()
    page.get_by_test_id("headline").get_by_text("Nothing was found on this map").wait_for()
    page.locator("image.grid").wait_for(state="attached")
    page.get_by_test_id("open-tuning").click()
    page.get_by_role("radio", name="occupancy-grid").wait_for()
    assert page.get_by_role("radio", name="occupancy-grid").is_checked()
    slider = page.locator("#tuning input[name=min_size]")
    assert slider.count() == 1
    page.get_by_role("radio", name="occupancy-grid").press("ArrowDown")
    things = page.locator(".floor .thing")
    wait_until(lambda: things.count() == len(ROOMS), "not all rooms are found")
    assert slider.count() == 0
