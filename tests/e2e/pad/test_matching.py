"""Which thing of the map is which: drawn, asked, said, and told while the server comes and goes."""

import json
import re
from itertools import pairwise

import numpy as np
import pytest

from tests import processes
from tests.pace import wait_until
from tests.pad import kitchen_drawn, names, said, say_the_bin_is_the_bench, wait_for_answer
from tests.web import KITCHEN, Hand, answer, corners, draw_kitchen, serving_pad

pytestmark = [pytest.mark.timeout(300), pytest.mark.slow]


def test_six_things_drawn_by_pointer_are_the_right_things_of_the_map(pad, visit):
    page = visit(pad)
    kitchen_drawn(page)
    assert answer(page) == names()
    # The same number and colour on both sides.
    for number, name in names().items():
        badge = page.get_by_test_id(f"sketch-thing-{number - 1}").locator("circle")
        colour = badge.get_attribute("fill")
        thing = page.locator(".floor .thing", has_text=name)
        assert thing.locator("circle").get_attribute("fill") == colour
        assert thing.locator(".badge text").text_content() == str(number)


def test_what_is_pointed_at_or_focused_lights_up_on_both_sides(pad, visit):
    page = visit(pad)
    kitchen_drawn(page)
    for act in ("hover", "focus"):
        page.get_by_test_id("pair-3").__getattribute__(act)()
        lit = page.locator(".thing.lit")
        lit.nth(1).wait_for(state="attached")
        assert [item.locator(".badge text").text_content() for item in lit.all()] == ["4", "4"]


def test_a_tap_on_the_map_says_what_a_thing_is_and_can_be_taken_back(pad, visit):
    page = visit(pad)
    kitchen_drawn(page)
    say_the_bin_is_the_bench(page)
    assert answer(page)[6] == "bench"
    page.get_by_test_id("undo").click()
    wait_until(lambda: answer(page) == names(), "what was taken back still holds")


def test_a_thing_can_be_said_to_be_on_no_map_by_keyboard_alone(pad, visit):
    page = visit(pad)
    kitchen_drawn(page)
    page.get_by_test_id("pair-1").focus()
    page.keyboard.press("Enter")
    chooser = page.get_by_test_id("asking").locator("select")
    chooser.focus()
    chooser.select_option("none")
    page.get_by_test_id("not-found").get_by_text("thing 2").wait_for()
    assert 2 not in answer(page)


def test_two_equal_readings_are_one_question_that_a_tap_answers(pad, visit, tmp_path):
    square = [[[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]]
    names = ["north", "south", "east", "west"]
    places = [(0, 4), (0, -4), (9, 0), (-9, 0)]
    document = {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "properties": {"name": name},
                "geometry": {
                    "type": "Polygon",
                    "coordinates": [[[x + px, y + py] for px, py in ring] for ring in square],
                },
            }
            for name, (x, y) in zip(names, places, strict=True)
        ],
    }
    file = tmp_path / "crossing.geojson"
    file.write_text(json.dumps(document))
    page = visit(pad)
    page.get_by_test_id("map-file").set_input_files(file)
    page.locator(".map-pane .title", has_text="crossing").wait_for()
    hand = Hand(page)
    # Half a turn leaves a cross of equal squares as it is.
    for x, y in ((0, -70), (0, 70), (160, 0), (-160, 0)):
        hand.box(x, y, 40, 40)
    question = page.get_by_test_id("question")
    question.wait_for()
    candidates = page.locator(".floor .thing.candidate")
    assert candidates.count() >= 2
    label = candidates.first.locator(".label").text_content()
    candidates.first.click()
    said(page).wait_for()
    question.wait_for(state="detached")
    assert label in answer(page).values()


def test_each_change_is_one_update_of_what_changed_and_one_stream_tells_what_comes_of_it(
    pad, visit
):
    page = visit(pad)
    sent = []
    page.on("request", lambda request: sent.append(request.url.rpartition("/")[2]))
    hand = Hand(page)
    for count, place in enumerate(KITCHEN.values(), start=1):
        hand.box(*place)
        if count > 1:
            wait_for_answer(page, count)
    page.get_by_test_id("tool-eraser").click()
    x, y, width, _ = KITCHEN["stove"]
    hand.tap(x - width / 2, y)
    wait_for_answer(page, 5)
    page.keyboard.press("Control+z")
    wait_for_answer(page, 6)
    assert answer(page) == names(), "what comes back has its number again"
    assert sent.count("UpdateSketch") == 8
    assert [sent.count(name) for name in ("CreateSketch", "WatchSketch", "Match")] == [1, 1, 0]


def test_what_a_person_said_holds_when_the_numbers_of_things_change(pad, visit):
    page = visit(pad)
    hand = kitchen_drawn(page)
    say_the_bin_is_the_bench(page)
    page.get_by_test_id("tool-eraser").click()
    x, y, width, _ = KITCHEN["fridge"]
    hand.tap(x - width / 2, y)
    wait_for_answer(page, 5)
    assert answer(page)[5] == "bench"
    page.keyboard.press("Control+z")
    wait_for_answer(page, 6)
    assert answer(page)[6] == "bench"
    assert said(page).count() == 1


def test_other_readings_are_paged_through(pad, visit):
    page = visit(pad)
    kitchen_drawn(page)
    reading = page.get_by_test_id("reading")
    # The whole match, which comes a moment after the first answer, has readings of its own.
    page.get_by_test_id("cancel").wait_for(state="detached")
    reading.get_by_text(re.compile(r"^Reading 1 of ([2-9]|\d\d)$")).wait_for()
    best = answer(page)
    page.get_by_role("button", name="Next reading").click()
    reading.get_by_text(re.compile(r"^Reading 2 of ")).wait_for()
    assert answer(page) != best
    page.get_by_role("button", name="Previous reading").click()
    reading.get_by_text(re.compile(r"^Reading 1 of ")).wait_for()
    assert answer(page) == best


def test_long_strokes_are_matched_too(pad, visit, tmp_path):
    strokes = []
    for x, y, width, height in KITCHEN.values():
        ring = [*corners(x, y, width, height), corners(x, y, width, height)[0]]
        sides = [np.linspace(a, b, 2_000) for a, b in pairwise(ring)]
        strokes.append({"points": np.concatenate(sides).round(2).tolist()})
    file = tmp_path / "long.json"
    file.write_text(json.dumps({"y_axis": "down", "strokes": strokes}))
    page = visit(pad)
    page.get_by_test_id("sketch-file").set_input_files(file)
    wait_for_answer(page, 6)
    assert answer(page) == names()


def test_another_place_is_said_to_be_probably_another(pad, visit):
    page = visit(pad, place="playground")
    draw_kitchen(Hand(page))
    page.get_by_test_id("elsewhere").wait_for()
    assert "Probably not this place" in page.get_by_test_id("headline").inner_text()


def test_a_long_search_shows_how_it_goes_and_is_cancelled(visit, tmp_path):
    config = tmp_path / "endless.toml"
    config.write_text(
        '[pipeline.searcher]\nname = "easm"\n'
        "parameters = { patience = 10_000_000, generations = 10_000_000 }\n"
    )
    with serving_pad("--config", str(config)) as (_, url):
        page = visit(url)
        draw_kitchen(Hand(page))
        cancel = page.get_by_test_id("cancel")
        cancel.wait_for()
        page.locator(".curve").wait_for()
        cancel.click()
        page.get_by_test_id("again").wait_for()
        assert page.get_by_test_id("cancel").count() == 0
        page.get_by_test_id("again").click()
        cancel.wait_for()


def test_what_is_drawn_while_the_server_is_away_is_kept_and_matched_when_it_is_back(visit):
    with serving_pad() as (server, url):
        page = visit(url)
        hand = Hand(page)
        first, *rest = KITCHEN.values()
        hand.box(*first)
        server.process.kill()
        server.process.wait()
        for place in rest:
            hand.box(*place)
        page.get_by_text("The server does not answer.").wait_for()
    address = re.search(r"//(\S+)/", url)[1]
    with processes.server("--web-address", address, "--workers", "0"):
        wait_for_answer(page, 6)
        assert answer(page) == names()
        page.reload()
        wait_for_answer(page, 6)
        assert answer(page) == names()


def test_a_server_that_begins_anew_is_told_the_whole_sketch_and_what_was_said(visit):
    with serving_pad() as (server, url):
        page = visit(url)
        hand = kitchen_drawn(page)
        say_the_bin_is_the_bench(page)
        server.process.kill()
        server.process.wait()
        page.get_by_text("The server does not answer.").wait_for()
    address = re.search(r"//(\S+)/", url)[1]
    created = []
    page.on("request", lambda request: created.append(request.url))
    with processes.server("--web-address", address, "--workers", "0"):
        page.get_by_text("The server does not answer.").wait_for(state="detached")
        x, y, width, _ = KITCHEN["stove"]
        page.get_by_test_id("tool-eraser").click()
        hand.tap(x - width / 2, y)
        wait_for_answer(page, 5)
        assert answer(page)[5] == "bench"
        assert said(page).count() == 1
        assert any(each.endswith("CreateSketch") for each in created)
