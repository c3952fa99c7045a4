"""Pictures of relations: every plot points where its object lies."""

import itertools
import math

import numpy as np
import pytest

from sketchmatch import Scene
from sketchmatch.errors import InvalidInputError
from sketchmatch.model import OccupancyGrid
from sketchmatch.pictures._canvas import Canvas
from sketchmatch.pictures._palette import mixed, pair_colour
from sketchmatch.pictures.overlay import MOST_PLOTS, OverlayRelation, draw_relations

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
SCENE = Scene.from_polygons([SQUARE, SQUARE + 3], ["desk", ""])
GROUND = (246, 247, 249)


def relation(turn=0.0, a=0, b=1, directions=180):
    angles = 2 * np.pi * np.arange(directions) / directions
    lobe = np.maximum(0.0, np.cos(angles - turn)) ** 8
    return OverlayRelation(a, b, "to the right of", 0.9, 5e3 * lobe, turn)


def pixels(image):
    return np.asarray(image).astype(int)


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [0, 45, 90, 170, -60])
def test_the_histogram_and_its_arrow_point_where_the_object_lies(degrees):
    turn = math.radians(degrees)
    image = pixels(draw_relations(SCENE, [relation(turn)]))[:, 1070:]
    like = (np.abs(image - mixed(GROUND, pair_colour(1), 0.42)) <= 6).all(axis=2)
    centre = (np.abs(image - pair_colour(2)) <= 6).all(axis=2)
    assert like.sum() > 2000
    # The badge of b has its colour as well, far above.
    rows, columns = np.nonzero(centre[300:500])
    middle = np.array([columns.mean(), rows.mean() + 300])
    rows, columns = np.nonzero(like)
    x, y = np.array([columns.mean(), rows.mean()]) - middle
    assert math.remainder(math.atan2(-y, x) - turn, math.tau) == pytest.approx(0.0, abs=0.05)


def test_without_a_main_direction_no_arrow_is_drawn():
    plain, marked = (
        OverlayRelation(0, 1, "in no clear direction from", 0.1, np.ones(16), direction)
        for direction in (None, 0.5)
    )
    assert draw_relations(SCENE, [plain]).tobytes() != draw_relations(SCENE, [marked]).tobytes()


@pytest.mark.parametrize("count", [1, 3, 4, 5, 9, 10, MOST_PLOTS])
@pytest.mark.parametrize("directions", [4, 360])
def test_any_number_of_plots_fits(count, directions):
    relations = [relation(float(k), k % 2, 1 - k % 2, directions) for k in range(count)]
    image = draw_relations(SCENE, relations, left_out=[(0, 1)] * 7, width=400)
    assert image.width == 400
    assert 200 < image.height < 400


@pytest.mark.parametrize("count", [1, 12, 300])
def test_relations_that_are_not_drawn_are_counted_and_listed_as_far_as_they_fit(count, monkeypatch):
    written, text = [], Canvas.text

    def kept(canvas, at, words, size, *args, **options):
        written.append((at[0] + canvas.text_width(words, size), words))
        text(canvas, at, words, size, *args, **options)

    monkeypatch.setattr(Canvas, "text", kept)
    scene = Scene.from_polygons([SQUARE + 3 * k for k in range(25)])
    others = list(itertools.combinations(range(25), 2))[-count:]
    draw_relations(scene, [relation()], left_out=others, width=400)
    assert written[0][1].endswith(f"relations of 25 objects, {count} of them not drawn")
    right, line = written[-1]
    listed = line.removeprefix("not drawn: ").partition(" and ")[0].split("  ")
    assert listed == [f"{a + 1},{b + 1}" for a, b in others][: len(listed)]
    assert line.endswith(listed[-1] if count < 300 else f" and {count - len(listed)} more")
    assert len(listed) == count if count < 300 else len(listed) > 30
    assert right <= 1600 - 36


def test_a_histogram_of_zeros_and_a_map_below_are_drawn():
    grid = OccupancyGrid(np.zeros((40, 40)), 0.1)
    nothing = OverlayRelation(0, 1, "above", 0.0, np.zeros(36), None)
    assert draw_relations(SCENE, [nothing], underlay=grid, pen=True, width=400).width == 400


@pytest.mark.parametrize(
    ("relations", "field"),
    [
        ([], "relations"),
        ([relation()] * (MOST_PLOTS + 1), "relations"),
        ([relation(), relation(a=2)], "relations[1].a"),
        ([relation(b=-1)], "relations[0].b"),
    ],
)
def test_what_cannot_be_drawn_is_refused(relations, field):
    with pytest.raises(InvalidInputError) as caught:
        draw_relations(SCENE, relations)
    assert caught.value.field == field
