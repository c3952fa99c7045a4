"""What a person draws on the pad, and how it is kept, saved and opened."""

import base64
import json
import re
import zlib
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
from PIL import Image, ImageColor

from tests.pace import wait_until
from tests.pad import (
    copied_link,
    kitchen_drawn,
    name_the_stove_my_oven,
    names,
    saved_text,
    strokes,
    wait_for_answer,
)
from tests.web import KITCHEN, Hand, answer

pytestmark = [pytest.mark.timeout(300), pytest.mark.slow]


SVG = "{http://www.w3.org/2000/svg}"


def test_the_picture_of_both_sides_has_the_colours_and_numbers_of_the_page(pad, visit):
    page = visit(pad)
    kitchen_drawn(page)
    svg = ElementTree.fromstring(saved_text(page, "save-picture-svg"))
    sides = svg.findall(f"{SVG}svg")
    shown = []
    for side, pane in zip(sides, (".paper", ".floor"), strict=True):
        badges = {
            badge.find(f"{SVG}text").text: badge.find(f"{SVG}circle").get("fill")
            for badge in side.iter(f"{SVG}g")
            if badge.find(f"{SVG}circle") is not None
        }
        on_page = {
            badge.locator("text").text_content(): badge.locator("circle").get_attribute("fill")
            for badge in page.locator(f"{pane} .badge").all()
        }
        assert badges == on_page
        shown.append(badges)
    assert shown[0] == shown[1]
    assert len(shown[0]) == 6
    labels = {text.text for text in sides[1].iter(f"{SVG}text")}
    assert set(KITCHEN) <= labels
    assert sides[1].find(f"{SVG}image").get("href").startswith("data:image/png")
    page.get_by_test_id("open-file").click()
    with page.expect_download() as saved:
        page.get_by_test_id("save-picture-png").click()
    with Image.open(saved.value.path()) as picture:
        pixels = picture.convert("RGB")
    # All six colours of pairs are in both halves.
    width, height = pixels.size
    for left in (0, width // 2):
        half = pixels.crop((left, 0, left + width // 2, height))
        seen = {colour for _, colour in half.getcolors(1 << 24)}
        assert {ImageColor.getrgb(each) for each in shown[0].values()} <= seen


def test_a_thing_is_made_as_large_as_somebody_types_and_stays_so(pad, visit):
    page = visit(pad)
    hand = kitchen_drawn(page)
    hand.tap(*KITCHEN["bin"][:2])
    width, height = page.get_by_test_id("width"), page.get_by_test_id("height")
    before, high = float(width.input_value()), float(height.input_value())
    box = page.get_by_test_id("sketch-thing-5").locator("path")
    drawn = box.bounding_box()
    width.fill(f"{2 * before}")
    width.press("Enter")
    wait_until(
        lambda: box.bounding_box()["width"] == pytest.approx(2 * drawn["width"], rel=0.05),
        "the thing is as wide as before",
    )
    assert box.bounding_box()["height"] == pytest.approx(drawn["height"], rel=0.05)
    hand.tap(*KITCHEN["bin"][:2])
    wait_for_answer(page, 6)
    assert float(width.input_value()) == pytest.approx(2 * before, rel=0.02)
    assert float(height.input_value()) == pytest.approx(high, rel=0.02)
    page.keyboard.press("Escape")
    page.get_by_test_id("undo").click()
    wait_until(
        lambda: box.bounding_box()["width"] == pytest.approx(drawn["width"], rel=0.02),
        "what was typed is not taken back",
    )


def test_undo_and_redo_go_all_the_way_and_nothing_is_lost_between_fast_strokes(pad, visit):
    page = visit(pad)
    hand = Hand(page)
    for k in range(20):
        hand.draw([(-200 + 20 * k, -60), (-200 + 20 * k, 60)], closed=False)
    assert strokes(page) == 20
    for left in range(19, -1, -1):
        page.keyboard.press("Control+z")
        assert strokes(page) == left
    for _ in range(20):
        page.keyboard.press("Control+Shift+Z")
    assert strokes(page) == 20


def test_a_thing_is_erased_moved_and_named(pad, visit):
    page = visit(pad)
    hand = kitchen_drawn(page)
    name_the_stove_my_oven(page, hand)
    page.get_by_test_id("pair-1").get_by_text("my oven").wait_for()
    page.get_by_test_id("tool-eraser").click()
    x, y, width, _ = KITCHEN["bin"]
    hand.tap(x - width / 2, y)
    wait_for_answer(page, 5)
    page.get_by_test_id("tool-move").click()
    x, y, *_ = KITCHEN["fridge"]
    before = page.get_by_test_id("sketch-thing-0").locator("path").get_attribute("d")
    hand.draw([(x, y), (x + 30, y + 10)], closed=False)
    wait_until(
        lambda: page.get_by_test_id("sketch-thing-0").locator("path").get_attribute("d") != before,
        "what was moved is where it was",
    )
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+z")
    wait_for_answer(page, 6)


SAVED = {"strokes": "json", "svg": "svg", "excalidraw": "excalidraw"}


def test_strokes_svg_and_excalidraw_are_saved_and_opened_again_with_route_and_name(
    pad, visit, tmp_path
):
    page = visit(pad)
    hand = kitchen_drawn(page)
    name_the_stove_my_oven(page, hand)
    page.get_by_test_id("tool-route").click()
    hand.draw([(-100, -20), (-90, 90), (60, 90)], closed=False)
    page.get_by_test_id("route").wait_for(state="attached")
    for item, ending in SAVED.items():
        (tmp_path / f"sketch.{ending}").write_text(saved_text(page, f"save-{item}"))
    for ending in SAVED.values():
        page.get_by_test_id("clear").click()
        page.get_by_test_id("pairs").wait_for(state="detached")
        page.get_by_test_id("sketch-file").set_input_files(tmp_path / f"sketch.{ending}")
        wait_for_answer(page, 6)
        assert answer(page) == names()
        page.get_by_test_id("pair-1").get_by_text("my oven").wait_for()
        page.get_by_test_id("route").wait_for(state="attached")


def test_ink_follows_what_was_drawn_elsewhere_with_few_points(pad, visit, tmp_path):
    page = visit(pad)
    corners = [[0, 0], [300, 0], [300, 200], [0, 200], [0, 0]]
    strokes = [{"points": [[x + 400 * k, y] for x, y in corners]} for k in range(2)]
    file = tmp_path / "boxes.json"
    file.write_text(json.dumps({"y_axis": "down", "strokes": strokes}), encoding="utf-8")
    page.get_by_test_id("sketch-file").set_input_files(file)
    page.get_by_test_id("sketch-thing-1").wait_for(state="attached")
    svg = ElementTree.fromstring(saved_text(page, "save-picture-svg"))
    inks = [path.get("d") for path in svg.find(f"{SVG}svg").iter(f"{SVG}path")]
    outlines = [each for each in inks if each.startswith("M") and "Q" in each]
    assert len(outlines) == 2
    for d in outlines:
        ink = shapely.MultiPoint(np.array(re.findall(r"[-\d.]+", d), float).reshape(-1, 2))
        assert ink.convex_hull.area > 0.98 * ink.envelope.area


def test_a_link_opens_the_sketch_and_its_match_in_another_browser(pad, visit):
    page = visit(pad)
    kitchen_drawn(page)
    link = copied_link(page)
    assert link.startswith(f"{pad}#")
    other = visit(link, place=None)
    wait_for_answer(other, 6)
    assert answer(other) == names()


def link_of(said):
    """Return what stands behind the # of a link that says this."""
    packing = zlib.compressobj(9, zlib.DEFLATED, -15)
    data = packing.compress(said.encode()) + packing.flush()
    return base64.urlsafe_b64encode(data).decode().rstrip("=")


SQUARE = [0, 0, 50, 0, 0, 50, -50, 0, 0, -50]


@pytest.mark.parametrize(
    "said",
    [
        "no JSON",
        json.dumps({"p": "kitchen", "s": [{"d": SQUARE, "i": "a"}]}),
        json.dumps({"p": "kitchen", "s": [{"d": SQUARE, "i": "a"}] * 2, "n": []}),
        json.dumps({"p": "kitchen", "s": [{"d": ["x", *SQUARE], "i": "a"}], "n": []}),
        json.dumps({"p": "kitchen", "s": [], "n": [{"strokes": 3, "thing": "1"}]}),
        '{"p": "kitchen", "s": [], "n": [], "x": "' + "a" * 100_000_000 + '"}',
    ],
    ids=["no JSON", "no pins", "one id for two", "no numbers", "broken pins", "a bomb"],
)
def test_a_broken_link_is_told_and_what_was_drawn_stays(pad, visit, said):
    page = visit(pad)
    kitchen_drawn(page)
    page.evaluate("(said) => { location.hash = said; location.reload(); }", link_of(said))
    page.get_by_test_id("notice").get_by_text("The link is broken").wait_for()
    wait_for_answer(page, 6)


@pytest.mark.parametrize("kept", [{"lines": 3}, {"strokes": [{"id": "a", "points": [[0, 0]]}]}])
def test_a_sheet_that_an_earlier_page_kept_otherwise_is_an_empty_one(pad, visit, kept):
    page = visit(pad)
    hand = Hand(page)
    hand.box(0, 0, 80, 60)
    put = """(kept) => new Promise((done) => {
      const opening = indexedDB.open('keyval-store');
      opening.onsuccess = () => {
        const work = opening.result.transaction('keyval', 'readwrite');
        work.objectStore('keyval').put(kept, sessionStorage.getItem('sheet'));
        work.oncomplete = () => done();
      };
    })"""
    wait_until(lambda: page.evaluate(IS_KEPT), "the sheet is not kept")
    page.evaluate(put, kept)
    page.reload()
    page.get_by_test_id("map-thing-0").wait_for()
    page.get_by_test_id("show-me").wait_for()


IS_KEPT = """() => new Promise((done) => {
  const opening = indexedDB.open('keyval-store');
  opening.onsuccess = () => {
    const store = opening.result.transaction('keyval').objectStore('keyval');
    store.get(sessionStorage.getItem('sheet')).onsuccess = ({ target }) =>
      done(Boolean(target.result && target.result.strokes.length));
  };
})"""


def test_a_browser_that_may_keep_nothing_shows_the_pad_all_the_same(pad, visit):
    page = visit(pad)
    refuse = """for (const store of ['localStorage', 'sessionStorage', 'indexedDB'])
      Object.defineProperty(window, store, {
        get() { throw new DOMException('not here', 'SecurityError'); } });"""
    page.add_init_script(refuse)
    page.reload()
    page.get_by_test_id("show-me").click()
    wait_for_answer(page, 8)


def test_what_another_page_of_the_address_has_set_spoils_nothing(pad, visit):
    page = visit(pad)
    for key, value in (("robot", "{"), ("language", "constructor"), ("theme", '"x"')):
        page.evaluate("([key, value]) => localStorage.setItem(key, value)", [key, value])
    page.reload()
    page.get_by_test_id("show-me").wait_for()


def test_a_file_that_falls_on_the_paper_is_opened(pad, visit):
    page = visit(pad)
    kitchen_drawn(page)
    saved = saved_text(page, "save-strokes")
    page.get_by_test_id("clear").click()
    page.get_by_test_id("show-me").wait_for()
    carry = """(text) => {
      const carried = new DataTransfer();
      carried.items.add(new File([text], 'sketch.json'));
      return carried;
    }"""
    carried = page.evaluate_handle(carry, saved)
    page.get_by_test_id("paper").dispatch_event("drop", {"dataTransfer": carried})
    wait_for_answer(page, 6)


def test_a_broken_sketch_is_refused_in_words_and_the_drawing_stays(pad, visit, tmp_path):
    page = visit(pad)
    Hand(page).box(0, 0, 80, 60)
    for name, text in (
        ("a.json", "{"),
        ("b.json", '{"strokes": [{"points": [[1, "x"]]}]}'),
        ("c.svg", "<svg"),
    ):
        file = tmp_path / name
        file.write_text(text)
        page.get_by_test_id("sketch-file").set_input_files(file)
        notice = page.get_by_test_id("notice")
        notice.wait_for()
        assert len(notice.inner_text()) > 20
        notice.get_by_role("button").click()
        notice.wait_for(state="detached")
    assert strokes(page) == 1


HOUSE = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 400 300">
<g fill="none" stroke="black"><rect width="90" height="60" x="9" y="9"/>
<rect width="60" height="90" x="300" y="90"/><path d="M150 20L200 24"/></g></svg>"""


def test_what_was_left_out_of_a_sketch_is_told_and_faults_are_in_the_persons_language(
    pad, visit, tmp_path
):
    page = visit(pad, place=None, locale="de-DE")
    notice = page.get_by_test_id("notice")
    for name, text, said in (
        ("a.svg", HOUSE, "Der Server sagt zu a.svg: strokes[2]"),
        ("b.json", "{", "sie ist kein JSON"),
        ("c.json", '{"strokes": [{"points": [[1]]}]}', "strokes[0].points[0] ist kein [x, y]"),
        ("d.svg", "<svg", "Die Datei lässt sich so nicht lesen. (d.svg"),
        ("e.svg", "<svg><path d='M1 1h9v9z'/></svg>", "Darin sind weniger als zwei Dinge"),
    ):
        file = tmp_path / name
        file.write_text(text)
        page.get_by_test_id("sketch-file").set_input_files(file)
        notice.get_by_text(said).wait_for()
    assert strokes(page) == 2


def test_each_tab_has_its_own_sheet_and_a_new_one_begins_with_the_latest(pad, visit):
    page = visit(pad)
    kitchen_drawn(page)
    other = visit(pad, place=None, context=page.context)
    wait_for_answer(other, 6)
    other.get_by_test_id("clear").click()
    other.get_by_test_id("pairs").wait_for(state="detached")
    page.reload()
    wait_for_answer(page, 6)


def test_a_tab_that_was_duplicated_has_a_sheet_of_its_own(pad, visit):
    page = visit(pad)
    kitchen_drawn(page)
    with page.expect_popup() as opened:  # which has the same session storage
        page.evaluate("void window.open(location.href)")
    other = opened.value
    wait_for_answer(other, 6)
    other.get_by_test_id("clear").click()
    other.get_by_test_id("show-me").wait_for()
    other.close()
    page.reload()
    wait_for_answer(page, 6)
