"""The pad on tablets and small screens, in another browser and language, and for everyone."""

import shutil
from itertools import pairwise

import pytest

from tests import processes
from tests.pad import names, open_floor_as_rooms, strokes, wait_for_answer
from tests.tools import require
from tests.web import CLIENTS, KITCHEN, Hand, checked, corners, serving_pad

pytestmark = [pytest.mark.timeout(300), pytest.mark.slow]


def touch(session, kind, points):
    session.send(
        "Input.dispatchTouchEvent",
        {
            "type": kind,
            "touchPoints": [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(points)],
        },
    )


def test_on_a_tablet_a_finger_draws_and_two_fingers_move_the_paper(pad, visit):
    page = visit(pad, viewport={"width": 1024, "height": 768}, has_touch=True)
    mx, my = Hand(page).middle
    session = page.context.new_cdp_session(page)
    for x, y, width, height in list(KITCHEN.values())[:3]:
        w, h = width / 2, height / 2
        corners = [(-w, -h), (w, -h), (w, h), (-w, h), (-w, -h)]
        touch(session, "touchStart", [(mx + x - w, my + y - h)])
        for (ax, ay), (bx, by) in pairwise(corners):
            for k in range(1, 7):
                at = mx + x + ax + (bx - ax) * k / 6, my + y + ay + (by - ay) * k / 6
                touch(session, "touchMove", [at])
        touch(session, "touchEnd", [])
    wait_for_answer(page, 3)
    before = page.get_by_test_id("sketch-thing-0").locator("path").bounding_box()
    touch(session, "touchStart", [(mx - 40, my)])
    touch(session, "touchStart", [(mx - 40, my), (mx + 40, my)])
    for k in range(1, 11):
        touch(session, "touchMove", [(mx - 40 - 4 * k, my), (mx + 40 + 4 * k, my)])
    touch(session, "touchEnd", [])
    after = page.get_by_test_id("sketch-thing-0").locator("path").bounding_box()
    assert after["width"] > 1.5 * before["width"]
    assert strokes(page) == 3


@pytest.mark.parametrize("size", [(390, 844), (844, 390), (1024, 768)])
@pytest.mark.parametrize("locale", ["en-GB", "de-DE"])
def test_there_is_room_to_draw_and_no_tool_hides_another(pad, visit, size, locale):
    width, height = size
    options = {"viewport": {"width": width, "height": height}, "has_touch": True}
    page = visit(pad, place=None, locale=locale, **options)
    assert page.get_by_test_id("paper").bounding_box()["height"] > 120
    assert page.get_by_test_id("map").bounding_box()["height"] > 120
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    boxes = [
        [tool.bounding_box() for tool in page.locator(within).all()]
        for within in (".toolbar .tool", ".toolbar .tool-name")
    ]
    for row in boxes:
        for left, right in pairwise(row):
            assert left["x"] + left["width"] <= right["x"] + 0.5
        assert row[-1]["x"] + row[-1]["width"] <= width


def test_once_a_pen_has_drawn_a_palm_does_nothing_and_fingers_move_the_paper(pad, visit):
    page = visit(pad, viewport={"width": 1024, "height": 768}, has_touch=True)
    pen = """([kind, id, type, x, y]) => {
      const paper = document.querySelector('[data-testid=paper]');
      const { left, top } = paper.getBoundingClientRect();
      paper.dispatchEvent(new PointerEvent(kind, {
        pointerId: id, pointerType: type, clientX: left + x, clientY: top + y,
        bubbles: true, cancelable: true, pressure: kind === 'pointerup' ? 0 : 0.7 }));
    }"""

    def send(*event):
        page.evaluate(pen, list(event))

    send("pointerdown", 7, "pen", 60, 60)
    send("pointermove", 7, "pen", 160, 60)
    send("pointerdown", 9, "touch", 200, 260)  # the palm
    send("pointermove", 9, "touch", 210, 270)
    send("pointermove", 7, "pen", 160, 160)
    send("pointerup", 9, "touch", 210, 270)
    send("pointermove", 7, "pen", 60, 160)
    send("pointerup", 7, "pen", 60, 60)
    assert strokes(page) == 1
    send("pointerdown", 9, "touch", 200, 160)
    send("pointermove", 9, "touch", 260, 200)
    send("pointerup", 9, "touch", 260, 200)
    assert strokes(page) == 1
    switch = page.get_by_test_id("finger-draws")
    assert switch.get_attribute("aria-pressed") == "false"


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("size", [(1440, 900), (390, 844)])
def test_axe_finds_nothing_that_keeps_anybody_out(pad, visit, tmp_path, scheme, size):
    axe = CLIENTS / "node_modules" / "axe-core" / "axe.min.js"
    require(axe.exists(), "axe-core (npm ci in clients)")
    width, height = size
    page = visit(pad, viewport={"width": width, "height": height}, color_scheme=scheme)
    look = "async () => (await axe.run()).violations.map(v => [v.id, v.nodes.map(n => n.html)])"
    page.evaluate(axe.read_text(encoding="utf-8"))
    assert page.evaluate(look) == []
    page.get_by_test_id("show-me").click()
    wait_for_answer(page, 6)
    page.get_by_test_id("pair-0").click()
    assert page.evaluate(look) == []
    for menu in ("places", "file", "settings"):
        page.get_by_test_id(f"open-{menu}").click()
        assert page.evaluate(look) == [], menu
        page.keyboard.press("Escape")
    page.get_by_test_id("mend").click()
    page.get_by_test_id("mend-0").click()
    assert page.evaluate(look) == [], "mending"
    open_floor_as_rooms(page, tmp_path)
    assert page.evaluate(look) == [], "tuning"


def test_it_speaks_german_to_who_asks_for_it(pad, visit):
    page = visit(pad, place=None, locale="de-DE")
    assert page.locator("html").get_attribute("lang") == "de"
    assert page.get_by_role("heading", name="Karte des Roboters").is_visible()
    page.get_by_test_id("open-settings").click()
    page.get_by_label("English").check()
    page.get_by_role("heading", name="Robot's map").wait_for()


def test_a_server_that_wants_a_token_is_given_it(tmp_path, browser):
    tokens = tmp_path / "tokens"
    token = processes.sketchmatch("tokens", "add", "pad", "--file", tokens).stdout.strip()
    with serving_pad("--tokens", str(tokens)) as (_, url):
        context = browser.new_context(locale="en-GB")
        page = context.new_page()
        page.goto(url)
        dialog = page.get_by_role("dialog")
        dialog.locator("input").fill("not this one")
        dialog.get_by_role("button").click()
        dialog.get_by_text("This server requires a token.").wait_for()
        page.keyboard.press("Escape")
        dialog.wait_for(state="hidden")
        page.get_by_test_id("headline").get_by_role("button", name="Connect").click()
        dialog.locator("input").fill(token)
        dialog.get_by_role("button").click()
        page.get_by_test_id("map-thing-0").wait_for()
        context.close()


def test_it_loads_quickly_and_asks_nobody_else(pad, browser):
    context = browser.new_context()
    page = context.new_page()
    asked, weight = [], []

    def received(answer):
        asked.append(answer.url)
        weight.append(int(answer.headers.get("content-length", 0)))

    page.on("response", received)
    page.goto(pad)
    page.get_by_test_id("map-thing-0").wait_for()
    context.close()
    assert all(url.startswith((pad, "blob:")) for url in asked)
    assert 20_000 < sum(weight) < 200_000


def test_firefox_too_finds_the_right_things_and_keeps_what_was_drawn(pad):
    firefox = shutil.which("firefox-esr") or shutil.which("firefox")
    require(firefox, "Firefox")
    lines = [[*corners(*box), corners(*box)[0]] for box in KITCHEN.values()]
    found = checked("firefox", firefox, pad, "kitchen", told=lines)
    expected = {str(number): name for number, name in names().items()}
    assert found == {"drawn": expected, "reloaded": expected, "faults": []}


@pytest.mark.parametrize("preset", ["mobile", "desktop"])
def test_lighthouse_gives_it_95_for_speed_and_accessibility(pad, preset):
    """On a desktop, and on what Lighthouse takes for a phone, four times slower."""
    program = shutil.which("chromium")
    require(program, "chromium")
    tries = []
    # A machine that does other things too makes a page look slow, never fast.
    for _ in range(4):
        tries.append(checked("lighthouse", program, pad, preset))
        if tries[-1]["performance"] >= 95:
            break
    best = max(tries, key=lambda found: found["performance"])
    assert best["performance"] >= 95, best
    assert best["accessibility"] >= 95, best
