"""Maps that are opened on the pad, kept by the server, and mended by hand."""

import base64
import importlib.util
import sqlite3
from contextlib import closing

import numpy as np
import pytest

from sketchmatch.examples import LIVING_ROOM_MAP
from tests.bags import MCAP, ROS1, file_of, write
from tests.pace import wait_until
from tests.pad import (
    ROOMS,
    copied_link,
    keep_map_as,
    kitchen_drawn,
    labels,
    open_floor_as_rooms,
    said,
    say_the_bin_is_the_bench,
    wait_for_answer,
)
from tests.tools import require
from tests.web import KITCHEN, Hand, answer, serving_pad

pytestmark = [pytest.mark.timeout(300), pytest.mark.slow]


def test_a_map_is_kept_by_the_server_under_a_name_and_chosen_again(visit, tmp_path):
    with serving_pad("--store", str(tmp_path / "store")) as (_, url):
        page = visit(url)
        page.get_by_test_id("map-file").set_input_files(
            [LIVING_ROOM_MAP, LIVING_ROOM_MAP.with_suffix(".pgm")]
        )
        title = page.locator(".map-pane .title")
        title.get_by_text(LIVING_ROOM_MAP.name).wait_for()
        things = page.locator(".floor .thing").count()
        keep_map_as(page, "our flat")
        other = visit(url)
        other.get_by_test_id("open-places").click()
        other.get_by_test_id("stored-map").get_by_text("our flat").wait_for()
        page.get_by_test_id("open-places").click()
        page.get_by_test_id("place-kitchen").click()
        title.get_by_text("Kitchen").wait_for()
        page.get_by_test_id("open-places").click()
        page.get_by_test_id("stored-map").get_by_text("our flat").click()
        title.get_by_text("our flat").wait_for()
        page.locator("image.grid").wait_for(state="attached")
        assert page.locator(".floor .thing").count() == things
        hand = Hand(page)
        for x, y, width, height in ((-150, -80, 90, 50), (120, 60, 60, 80), (0, 90, 40, 40)):
            hand.box(x, y, width, height)
        page.get_by_test_id("pair-0").wait_for()
        linked = copied_link(page)
        page.get_by_test_id("tool-zone").click()
        hand.box(-20, 0, 60, 40)
        page.get_by_test_id("zone").wait_for(state="attached")
        another = visit(linked, place=None)
        another.locator(".map-pane .title", has_text="our flat").wait_for()
        another.get_by_test_id("pair-0").wait_for()


def test_a_server_that_keeps_nothing_is_not_asked_for_what_it_keeps(visit):
    with serving_pad("--no-store") as (_, url):
        page = visit(url)
        asked = []
        page.on("request", lambda request: asked.append(request.url.rpartition("/")[2]))
        with page.expect_request("**/GetServerInfo"):
            page.get_by_test_id("open-places").click()
        page.get_by_test_id("place-kitchen").click()
        page.get_by_test_id("place-kitchen").wait_for(state="hidden")
        assert "ListScenes" not in asked


def test_what_is_wrong_with_the_servers_store_is_said_where_its_maps_would_be(visit, tmp_path):
    store = tmp_path / "store"
    store.mkdir()
    with closing(sqlite3.connect(store / "scenes.sqlite")) as older:
        older.execute("PRAGMA user_version = 1")
    with serving_pad("--store", str(store)) as (_, url):
        page = visit(url)
        page.get_by_test_id("open-places").click()
        page.get_by_test_id("store-trouble").get_by_text("by another version").wait_for()
        page.get_by_test_id("place-kitchen").click()
        kitchen_drawn(page)


def test_things_of_the_map_are_merged_left_out_and_named_by_hand_and_that_is_taken_back(pad, visit):
    page = visit(pad)
    things = page.locator(".floor .thing")
    page.get_by_test_id("mend").click()
    mending = page.get_by_test_id("mending")

    def choose(*names):
        for name in names:
            mending.get_by_role("button", name=name, exact=True).click()

    fridge = things.filter(has_text="fridge").locator("path").bounding_box()
    stove = things.filter(has_text="stove").locator("path").bounding_box()
    things.filter(has_text="fridge").click()  # on the map, and by its name
    choose("stove")
    page.get_by_test_id("mend-merge").click()
    wait_until(lambda: things.count() == 5, "two things are not made one")
    # The stove comes first on the map.
    whole = things.filter(has_text="stove").locator("path").bounding_box()
    assert whole["x"] == pytest.approx(fridge["x"], abs=2)
    assert whole["x"] + whole["width"] == pytest.approx(stove["x"] + stove["width"], abs=2)
    choose("bin")
    page.get_by_test_id("mend-leave-out").click()
    wait_until(lambda: things.count() == 4, "a thing that is left out is still there")
    choose("bench")
    page.get_by_label("Name on the map").fill("sofa")
    page.keyboard.press("Enter")
    wait_until(lambda: "sofa" in labels(page), "a thing is not named")
    assert labels(page) == ["dining table", "kitchen island", "sofa", "stove"]
    for count in (4, 5, 6):
        page.get_by_test_id("mend-undo").click()
        wait_until(lambda count=count: things.count() == count, "what was mended stays so")
    assert labels(page) == sorted(KITCHEN)
    assert page.get_by_test_id("mend-undo").is_disabled()


def test_a_mended_map_keeps_its_walls_and_what_was_said_and_the_page_keeps_it(pad, visit):
    page = visit(pad)
    hand = kitchen_drawn(page)
    say_the_bin_is_the_bench(page)
    page.get_by_test_id("mend").click()
    mending = page.get_by_test_id("mending")
    mending.get_by_role("button", name="fridge", exact=True).click()
    page.get_by_test_id("mend-leave-out").click()
    wait_until(lambda: "fridge" not in labels(page), "a thing that is left out is still there")
    mending.get_by_role("button", name="bench", exact=True).click()
    page.get_by_label("Name on the map").fill("sofa")
    page.keyboard.press("Enter")
    wait_until(lambda: answer(page).get(6) == "sofa", "what was said is forgotten")
    assert said(page).count() == 1
    page.get_by_test_id("undo").click()  # what was said, so that there is an answer to carry by
    page.get_by_test_id("tool-route").click()
    hand.draw([(0, 60), (420, 60)], closed=False)  # through the wall on the right
    carried = page.get_by_test_id("carried")
    carried.get_by_text("It ends elsewhere, because something is in the way").wait_for()
    page.reload()
    page.get_by_test_id("map-thing-0").wait_for()
    assert labels(page) == sorted({*KITCHEN, "sofa"} - {"fridge", "bench"})


def test_a_file_that_no_request_can_hold_is_refused_by_its_size(visit, tmp_path):
    file = tmp_path / "large.png"
    with file.open("wb") as large:
        large.truncate(3 << 20)
    with serving_pad("--max-request-mib", "2") as (_, url):
        page = visit(url)
        page.get_by_test_id("map-file").set_input_files(file)
        notice = page.get_by_test_id("notice")
        notice.get_by_text("large.png has 3 MiB, but this server reads at most 2 MiB").wait_for()


@pytest.mark.parametrize(
    ("name", "data", "sentence"),
    [
        ("plan.dxf", b"no drawing", "plan.dxf"),
        ("map.yaml", b"image: office.pgm\n", "The map's picture office.pgm is missing"),
        ("photo.png", b"\x89PNG broken", "picture"),
        ("office.mcap", b"\x89MCAP0\r\n", "not a ROS bag, or is damaged"),
    ],
)
def test_a_broken_map_is_refused_in_words_and_the_map_stays(
    pad, visit, tmp_path, name, data, sentence
):
    page = visit(pad)
    file = tmp_path / name
    file.write_bytes(data)
    page.get_by_test_id("map-file").set_input_files(file)
    notice = page.get_by_test_id("notice")
    notice.wait_for()
    assert sentence in notice.inner_text()
    assert page.locator(".floor .thing").count() == 6


def test_a_map_of_ones_own_is_shown_and_its_things_are_found_otherwise_by_a_slider(pad, visit):
    page = visit(pad)
    page.get_by_test_id("map-file").set_input_files(
        [LIVING_ROOM_MAP, LIVING_ROOM_MAP.with_suffix(".pgm")]
    )
    page.locator(".map-pane .title", has_text=LIVING_ROOM_MAP.name).wait_for()
    page.locator("image.grid").wait_for(state="attached")  # no browser shows a PGM by itself
    before = page.locator(".floor .thing").count()
    page.get_by_test_id("open-tuning").click()
    slider = page.locator("#tuning input[name=min_size]")
    slider.wait_for()
    slider.fill("1.0")
    things = page.locator(".floor .thing")
    wait_until(lambda: 2 <= things.count() < before, "the slider changes nothing")


def draw_floor(page):
    """Draw the floor, the third and the fourth room as one."""
    hand = Hand(page)
    merged = (*ROOMS[2][:2], *ROOMS[3][2:])
    for x, y, u, v in (*ROOMS[:2], merged, ROOMS[4]):  # y up in the map, down on paper
        width, height = 3 * (u - x), 3 * (v - y)
        hand.box(3 * (x - 45) + width / 2, 3 * (45 - y) - height / 2, width, height)


def test_a_floor_is_opened_as_rooms_and_two_that_are_drawn_as_one_are_told_so(visit, tmp_path):
    with serving_pad("--store", str(tmp_path / "store")) as (_, url):
        page = visit(url)
        open_floor_as_rooms(page, tmp_path)
        page.keyboard.press("Escape")
        draw_floor(page)
        assert_two_rooms_are_one(page)
        page.reload()
        assert_two_rooms_are_one(page)
        page.get_by_test_id("open-tuning").click()
        radio = page.get_by_role("radio", name="rooms")
        radio.wait_for()
        assert radio.is_checked()
        page.keyboard.press("Escape")
        keep_map_as(page, "ground floor")
        other = visit(url)
        other.get_by_test_id("open-places").click()
        other.get_by_test_id("stored-map").get_by_text("ground floor").click()
        other.locator(".map-pane .title", has_text="ground floor").wait_for()
        other.get_by_test_id("open-tuning").click()
        other.get_by_role("radio", name="rooms").wait_for()
        assert other.get_by_role("radio", name="rooms").is_checked()
        other.keyboard.press("Escape")
        draw_floor(other)
        assert_two_rooms_are_one(other)


def assert_two_rooms_are_one(page):
    page.locator("[data-testid=pairs] .partner", has_text="as one").wait_for()
    wait_for_answer(page, 4)
    assert page.get_by_test_id("headline").get_by_text("All 4 things found").count()
    assert page.get_by_test_id("not-drawn").count() == 0
    rooms = page.evaluate(
        """() => [...document.querySelectorAll('.floor .thing')].map((thing) => {
          const path = thing.querySelector('path');
          const { width, height } = path.getBBox();
          const number = Number(thing.querySelector('.badge text').textContent);
          return [number, path.getAttribute('fill'), width * height];
        })"""
    )
    assert sorted(number for number, *_ in rooms) == [1, 2, 3, 3, 4]
    (one, size), (other, other_size) = [each[1:] for each in rooms if each[0] == 3]
    assert one == other
    assert len({colour for _, colour, _ in rooms}) == 4
    # The two that are drawn as one are the smallest.
    assert sorted(area for *_, area in rooms)[:2] == sorted([size, other_size])


@pytest.mark.parametrize("kind", [ROS1, MCAP])
def test_a_bag_that_is_dropped_is_shown_and_what_is_drawn_of_it_is_found(
    pad, visit, tmp_path, kind
):
    require(importlib.util.find_spec("rosbags"), "rosbags (`pip install 'sketchmatch[rosbag]'`)")
    boxes = {"bed": (20, 20, 40, 60), "desk": (120, 30, 50, 20), "sofa": (60, 140, 70, 30)}
    cells = np.zeros((200, 240), np.int8)
    for x, y, width, height in boxes.values():
        cells[y : y + height, x : x + width] = 100
    cells[:, :10] = -1
    bag = write(tmp_path, kind, ("/map", cells, 0.0), ("/talk", "hi", 0))
    file = file_of(bag)
    page = visit(pad)
    page.get_by_test_id("map-file").set_input_files(
        [bag / "metadata.yaml", file] if bag.is_dir() else file
    )
    page.locator(".map-pane .title", has_text=file.name).wait_for()
    things = page.locator(".floor .thing")
    wait_until(lambda: things.count() == 3, "not all things of the bag are shown")
    wait_until(
        lambda: shades_of_the_grid(page) == {"wall", "floor", "unknown"}, "the grid is not shown"
    )
    hand = Hand(page)
    for x, y, width, height in boxes.values():  # y up in the map, down on paper
        hand.box(x + width / 2 - 120, 100 - y - height / 2, width, height)
    wait_for_answer(page, 3)
    found = page.evaluate(
        """() => [...document.querySelectorAll('.floor .thing')].map((thing) => {
          const { width, height } = thing.querySelector('path').getBBox();
          return [Number(thing.querySelector('.badge text').textContent), width, height];
        })"""
    )
    (_, scale, _), *_ = sorted(found)
    for (_, *seen), (_, _, *size) in zip(sorted(found), boxes.values(), strict=True):
        assert seen == pytest.approx([scale / boxes["bed"][2] * cells for cells in size], rel=0.08)


def shades_of_the_grid(page):
    """Return what is painted under the things of the map; nothing while it is painted anew."""
    page.locator(".map-pane image.grid").wait_for()
    seen = page.evaluate(
        """async () => {
          const image = new Image();
          image.src = document.querySelector('.map-pane image.grid').getAttribute('href');
          try {
            await image.decode();
          } catch {
            return [];
          }
          const canvas = new OffscreenCanvas(image.width, image.height);
          const context = canvas.getContext('2d');
          context.drawImage(image, 0, 0);
          const { data } = context.getImageData(0, 0, image.width, image.height);
          const seen = new Set();
          for (let k = 0; k < data.length; k += 4) {
            seen.add(data[k + 3] === 0 ? 'unknown' : data[k] < 200 ? 'wall' : 'floor');
          }
          return [...seen];
        }"""
    )
    return set(seen)


def test_what_is_mended_of_a_bag_keeps_its_walls(pad, visit, tmp_path):
    require(importlib.util.find_spec("rosbags"), "rosbags (`pip install 'sketchmatch[rosbag]'`)")
    cells = np.zeros((100, 100), np.int8)
    cells[20:40, 20:40] = cells[60:80, 50:90] = 100
    page = visit(pad)
    bag = file_of(write(tmp_path, MCAP, ("/map", cells, 0.0)))
    page.get_by_test_id("map-file").set_input_files(bag)
    page.locator(".map-pane .title", has_text=bag.name).wait_for()
    page.get_by_test_id("mend").click()
    page.get_by_test_id("mend-0").click()
    with page.expect_request("**/*SceneService/Segment") as asked:
        page.get_by_label("Name on the map").fill("sofa")
        page.keyboard.press("Enter")
    sent = asked.value.post_data_buffer
    assert b"mode: scale" in sent
    assert b"MCAP" not in sent
    wait_until(lambda: labels(page) == ["sofa"], "it has no name")
    wait_until(lambda: shades_of_the_grid(page) == {"wall", "floor"}, "the grid is not shown")


def test_a_bags_folder_that_is_dropped_is_opened(pad, visit, tmp_path):
    """A script cannot drop a folder: here the browser is told that a file is one."""
    require(importlib.util.find_spec("rosbags"), "rosbags (`pip install 'sketchmatch[rosbag]'`)")
    cells = np.zeros((100, 100), np.int8)
    cells[20:40, 20:40] = cells[60:80, 50:90] = 100
    bag = write(tmp_path, MCAP, ("/map", cells, 0.0))
    contents = {file.name: base64.b64encode(file.read_bytes()).decode() for file in bag.iterdir()}
    page = visit(pad)
    carried = page.evaluate_handle(
        """(contents) => {
          const entries = Object.entries(contents).map(([name, text]) => {
            const data = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
            return { isFile: true, file: (done) => done(new File([data], name)) };
          });
          const folder = {
            isDirectory: true,
            name: 'office',
            createReader: () => ({ readEntries: (done) => done(entries.splice(0, 1)) }),
          };
          DataTransferItem.prototype.webkitGetAsEntry = () => folder;
          const carried = new DataTransfer();
          carried.items.add(new File([], 'office'));
          return carried;
        }""",
        contents,
    )
    page.get_by_test_id("map").dispatch_event("drop", {"dataTransfer": carried})
    page.locator(".map-pane .title", has_text="office.mcap").wait_for()
    wait_until(lambda: page.locator(".floor .thing").count() == 2, "its things are not shown")
    page.get_by_test_id("open-tuning").click()
    page.get_by_role("radio", name="rooms").wait_for()
    offered = page.locator("#tuning input[name=segmenter]")
    values = offered.evaluate_all("all => all.map(({ value }) => value)")
    assert values == ["occupancy-grid", "rooms"]


def test_several_bags_at_once_are_refused_in_words(pad, visit, tmp_path):
    files = [tmp_path / f"office_{k}.db3" for k in (0, 1)]
    for file in files:
        file.write_bytes(b"SQLite format 3")
    page = visit(pad)
    page.get_by_test_id("map-file").set_input_files(files)
    notice = page.get_by_test_id("notice")
    notice.get_by_text("These are several bags").wait_for()
    notice.get_by_role("button").click()
    page.get_by_test_id("map-file").set_input_files(files[0])
    notice.get_by_text("not a ROS bag, or is damaged").wait_for()
