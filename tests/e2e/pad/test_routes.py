"""Routes and zones that are drawn on the pad, and where they lead on the map."""

import json
import math

import numpy as np
import pytest
import yaml

from tests.pace import wait_until
from tests.pad import kitchen_drawn, names, saved_text, wait_for_answer
from tests.rosbridge import rosbridge
from tests.web import answer, serving_pad

pytestmark = [pytest.mark.timeout(300), pytest.mark.slow]


def test_a_route_is_carried_out_of_walls_with_its_deviation_and_saved_in_metres(pad, visit):
    page = visit(pad)
    hand = kitchen_drawn(page)
    page.get_by_test_id("tool-route").click()
    hand.draw([(-100, -20), (-90, 90), (60, 90)], closed=False)
    route = page.get_by_test_id("route")
    route.wait_for(state="attached")
    assert route.locator(".band line").count() > 2
    assert float(route.locator(".band line").first.get_attribute("stroke-width")) > 0
    assert answer(page) == names(), "a route is no thing"
    feature = json.loads(saved_text(page, "save-carried"))["features"][0]
    line = feature["geometry"]["coordinates"]
    # It goes down past the left of the island at (3.3, 2.75) and then to its right.
    (x0, y0), (x1, y1) = line[0], line[-1]
    assert 1.0 < x0 < 2.7
    assert x1 > x0 + 1.0
    assert y1 < y0 - 0.5
    assert len(feature["properties"]["deviations"][0]) == len(line)
    waypoints = yaml.safe_load(saved_text(page, "save-waypoints"))["waypoints"]
    assert len(waypoints) == len(line)
    assert waypoints["waypoint0"]["pose"][:2] == pytest.approx(line[0], abs=1e-5)
    w, _, _, z = waypoints["waypoint0"]["orientation"]
    yaw = math.atan2(line[1][1] - line[0][1], line[1][0] - line[0][0])
    assert math.remainder(2 * math.atan2(z, w) - yaw, 2 * math.pi) == pytest.approx(0, abs=1e-3)


def test_a_route_through_a_thing_is_led_around_it_and_the_page_says_so(pad, visit):
    page = visit(pad)
    hand = kitchen_drawn(page)
    page.get_by_test_id("tool-route").click()
    hand.draw([(-90, -100), (40, 90)], closed=False)  # right through the island
    said = page.get_by_test_id("carried")
    said.get_by_text("It goes around what is in the way.").wait_for()
    told = json.loads(saved_text(page, "save-carried"))["features"][0]["properties"]
    assert told["changes"][0]["reason"] == "obstacle"  # as the command line saves it
    assert told["deviation"] == pytest.approx(np.median(told["deviations"][0]), abs=1e-6)
    before = page.get_by_test_id("route").locator("polyline").get_attribute("points")
    page.get_by_test_id("radius").fill("0.35")
    page.get_by_test_id("radius").press("Enter")
    route = page.get_by_test_id("route").locator("polyline")
    wait_until(
        lambda: route.count() and route.get_attribute("points") != before,
        "a wider robot takes the same way",
    )


def test_a_route_is_sent_to_a_robot_that_was_named_as_a_path_in_metres(visit):
    with rosbridge() as robot, serving_pad("--web-robots", robot.url) as (_, url):
        page = visit(url)
        hand = kitchen_drawn(page)
        page.get_by_test_id("tool-route").click()
        hand.draw([(-100, -20), (-90, 90), (60, 90)], closed=False)
        page.get_by_test_id("route").wait_for(state="attached")
        page.get_by_label("Topic").fill("/kitchen_route")
        page.get_by_test_id("send").click()
        page.get_by_test_id("notice").get_by_text("sent to /kitchen_route").wait_for()
        line = json.loads(saved_text(page, "save-carried"))["features"][0]["geometry"]
        (advertised,) = [each for each in robot.told if each["op"] == "advertise"]
        assert (advertised["topic"], advertised["type"]) == ("/kitchen_route", "nav_msgs/Path")
        (published,) = robot.published()
        assert published["topic"] == "/kitchen_route"
        path = published["msg"]
        assert path["header"] == {"frame_id": "map"}
        poses = [each["pose"] for each in path["poses"]]
        at = [(each["position"]["x"], each["position"]["y"]) for each in poses]
        assert at == [pytest.approx(point, abs=1e-5) for point in line["coordinates"]]
        (ax, ay), (bx, by) = at[:2]
        turn = poses[0]["orientation"]
        yaw = 2 * math.atan2(turn["z"], turn["w"])
        assert math.remainder(yaw - math.atan2(by - ay, bx - ax), 2 * math.pi) == pytest.approx(0)


def test_what_a_robot_refuses_and_one_that_is_away_is_said(visit):
    with rosbridge("no such type") as robot:
        away = "ws://127.0.0.1:9"
        with serving_pad("--web-robots", f"{robot.url},{away}") as (_, url):
            page = visit(url)
            hand = kitchen_drawn(page)
            page.get_by_test_id("tool-route").click()
            hand.draw([(-100, -20), (-90, 90)], closed=False)
            page.get_by_test_id("send").click()
            notice = page.get_by_test_id("notice")
            notice.get_by_text("refuses the route: no such type").wait_for()
            page.locator(".sending select").select_option(away)
            page.get_by_test_id("send").click()
            notice.get_by_text(f"{away} does not answer").wait_for()
            assert robot.published() == []


def test_the_page_reaches_no_robot_that_nobody_named(pad, browser):
    page = browser.new_context().new_page()
    page.goto(pad)
    with rosbridge() as robot:
        reach = """(url) => new Promise((done) => {
          try {
            const socket = new WebSocket(url);
            socket.onopen = () => done('open');
            socket.onerror = () => done('refused');
          } catch { done('refused'); }
        })"""
        assert page.evaluate(reach, robot.url) == "refused"
    page.context.close()


def test_a_zone_is_carried_named_saved_and_opened_again(pad, visit, tmp_path):
    page = visit(pad)
    hand = kitchen_drawn(page)
    page.get_by_test_id("tool-zone").click()
    hand.box(-60, 40, 70, 50)
    zone = page.get_by_test_id("zone")
    zone.wait_for(state="attached")
    page.get_by_test_id("tool-name").click()
    x, y = hand.middle
    page.mouse.click(x - 95, y + 40)
    page.get_by_role("dialog").locator("input").fill("no go")
    page.keyboard.press("Enter")
    page.get_by_test_id("carried").get_by_text("no go").wait_for()
    feature = json.loads(saved_text(page, "save-carried"))["features"][0]
    assert feature["properties"]["name"] == "no go"
    (ring,) = feature["geometry"]["coordinates"]
    assert feature["geometry"]["type"] == "Polygon"
    assert ring[0] == ring[-1]
    # Below the left half of the island, whose middle is at (3.3, 2.75).
    xs, ys = zip(*ring, strict=True)
    assert 1.0 < sum(xs) / len(xs) < 3.3
    assert sum(ys) / len(ys) < 2.75
    assert answer(page) == names(), "a zone is no thing"
    file = tmp_path / "sketch.json"
    file.write_text(saved_text(page, "save-strokes"))
    page.get_by_test_id("clear").click()
    zone.wait_for(state="detached")
    page.get_by_test_id("sketch-file").set_input_files(file)
    wait_for_answer(page, 6)
    page.get_by_test_id("carried").get_by_text("no go").wait_for()
