"""Strokes drawn by a simulated hand, and the SVG made of them."""

from __future__ import annotations

import itertools
import math
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import shapely

from sketchmatch.model import Scene, Stroke, StrokeSet
from sketchmatch.testing.drawing import draw_strokes, strokes_to_svg

STEADY = {"drift": 0.0, "tremor": 0.0}
SVG = "{http://www.w3.org/2000/svg}"

SCENE = Scene.from_polygons(
    [
        [[0, 0], [4, 0], [4, 3], [0, 3]],
        [[6, 0], [9, 0], [9, 1], [7, 1], [7, 4], [6, 4]],
        [[2, 5], [5, 5], [3.5, 7.5]],
    ],
    labels=["table", "sofa & more", "plant"],
)
EXTENT = math.hypot(9.0, 7.5)


def drawn(seed=0, **settings):
    return draw_strokes(SCENE, np.random.default_rng(seed), **settings).strokes


def length(points):
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def test_one_stroke_an_object_in_order():
    assert [stroke.label for stroke in drawn()] == ["table", "sofa & more", "plant"]


@pytest.mark.parametrize("seed", range(5))
def test_strokes_stay_near_the_outline(seed):
    for stroke, item in zip(drawn(seed), SCENE.objects, strict=True):
        border = item.polygon.exterior
        away = [border.distance(shapely.Point(point)) for point in stroke.points]
        assert max(away) < 0.04 * EXTENT
        assert np.mean(away) < 0.012 * EXTENT
        closed = shapely.Polygon(stroke.points).buffer(0)
        shared = closed.intersection(item.polygon).area / closed.union(item.polygon).area
        assert shared > 0.85


@pytest.mark.parametrize("gap", [0.0, 0.05, 0.2])
def test_the_gap_is_as_asked(gap):
    for stroke, item in zip(drawn(gap=(gap, gap), **STEADY), SCENE.objects, strict=True):
        outline = item.polygon.exterior
        first, last = (outline.project(shapely.Point(stroke.points[k])) for k in (0, -1))
        apart = min((first - last) % outline.length, (last - first) % outline.length)
        assert apart / outline.length == pytest.approx(gap, abs=0.015)


def test_a_negative_gap_goes_on_past_the_beginning():
    closed = drawn(gap=(0.0, 0.0), **STEADY)
    further = drawn(gap=(-0.1, -0.1), **STEADY)
    for one, other in zip(closed, further, strict=True):
        np.testing.assert_allclose(one.points[0], one.points[-1], atol=1e-9)
        np.testing.assert_allclose(one.points[0], other.points[0], atol=1e-9)
        assert length(other.points) / length(one.points) == pytest.approx(1.1, abs=0.01)


def test_ends_drift_apart_as_asked():
    ends = np.array(
        [
            stroke.points[-1] - stroke.points[0]
            for seed in range(60)
            for stroke in drawn(seed, gap=(0.0, 0.0), drift=0.01, tremor=0.0)
        ]
    )
    np.testing.assert_allclose(ends.std(axis=0), 0.01 * EXTENT, rtol=0.2)


def test_times_increase_at_the_tablets_rate_and_the_pen_lifts_between_strokes():
    strokes = drawn(rate=100.0)
    assert strokes[0].times[0] == 0.0
    for stroke in strokes:
        steps = np.diff(stroke.times)
        assert (steps > 0.0).all()
        np.testing.assert_allclose(steps[:-1], 0.01, atol=1e-9)
        assert 0.5 < stroke.times[-1] - stroke.times[0] < 20.0
    for before, after in itertools.pairwise(strokes):
        assert 0.4 <= after.times[0] - before.times[-1] <= 1.2


def test_the_pen_is_slower_in_corners():
    stroke = drawn(**STEADY)[0]
    corners = np.array(SCENE.objects[0].rings[0])
    steps = np.hypot(*np.diff(stroke.points, axis=0).T)[12:-12]
    middles = (stroke.points[1:] + stroke.points[:-1])[12:-12] / 2.0
    away = np.hypot(*(middles[:, None] - corners).transpose(2, 0, 1)).min(axis=1)
    assert np.median(steps[away < 0.1]) < 0.7 * np.median(steps[away > 0.8])


def test_corners_are_rounded_and_swung_past():
    sharp = np.array([4.0, 3.0])
    plain = drawn(gap=(0.0, 0.0), overshoot=0.0, **STEADY)[0].points
    assert np.hypot(*(plain - sharp).T).min() > 0.02
    assert plain[:, 0].max() <= 4.0 + 1e-9
    swung = drawn(gap=(0.0, 0.0), overshoot=0.5, **STEADY)[0].points
    assert 4.0 + 1e-4 < swung[:, 0].max() < 4.2


def test_tremor_is_smooth_and_as_strong_as_asked():
    still, shaky = drawn(**STEADY)[1].points, drawn(drift=0.0, tremor=0.004)[1].points
    tremor = (shaky - still) / EXTENT
    assert tremor.std() == pytest.approx(0.004, rel=0.3)
    assert np.diff(tremor, axis=0).std() < 0.5 * tremor.std()


def test_strokes_begin_anywhere_and_go_both_ways():
    firsts, ways = [], set()
    for seed in range(20):
        points = drawn(seed, **STEADY)[0].points
        firsts.append(points[0])
        x, y = (points - points.mean(axis=0)).T
        ways.add(bool(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) > 0.0))
    assert ways == {True, False}
    assert (np.std(firsts, axis=0) > 0.5).all()


def test_one_seed_one_drawing():
    for one, same, other in zip(drawn(4), drawn(4), drawn(5), strict=True):
        np.testing.assert_array_equal(one.points, same.points)
        np.testing.assert_array_equal(one.times, same.times)
        assert one.points.shape != other.points.shape or (one.points != other.points).any()


def test_drawing_does_not_depend_on_the_units():
    small = Scene.from_polygons([0.01 * np.array(item.rings[0]) for item in SCENE.objects])
    for one, other in zip(
        drawn(3), draw_strokes(small, np.random.default_rng(3)).strokes, strict=True
    ):
        np.testing.assert_allclose(0.01 * one.points, other.points, atol=1e-9)


@pytest.mark.parametrize("scale", [0.01, 1.0, 500.0])
def test_svg_holds_the_strokes_with_y_down(scale):
    strokes = StrokeSet(
        tuple(Stroke(scale * stroke.points, stroke.times, stroke.label) for stroke in drawn())
    )
    root = ET.fromstring(strokes_to_svg(strokes))
    _, _, width, height = (float(value) for value in root.get("viewBox").split())
    paths = list(root.iter(f"{SVG}path"))
    assert [path.find(f"{SVG}title").text for path in paths] == ["table", "sofa & more", "plant"]
    shifts = []
    for path, stroke in zip(paths, strokes.strokes, strict=True):
        page = np.array([step.split(",") for step in path.get("d")[1:].split()], dtype=float)
        assert ((page > 0.0) & (page < [width, height])).all()
        shifts.append(page * [1.0, -1.0] - stroke.points)
    shifts = np.concatenate(shifts)
    assert np.ptp(shifts, axis=0).max() <= 1e-3 * max(width, height)


def test_svg_of_a_stroke_without_a_label_has_no_title():
    line = Stroke(np.array([[0.0, 0.0], [3.0, 3.0]]))
    root = ET.fromstring(strokes_to_svg(StrokeSet((line,))))
    assert root.find(f".//{SVG}title") is None
    assert root.find(f".//{SVG}g").get("stroke-linecap") == "round"
