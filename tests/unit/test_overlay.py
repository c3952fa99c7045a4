"""Pictures of results: what is seen where, and what cannot be drawn is refused."""

import itertools
import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import OccupancyGrid, Scene
from sketchmatch.pictures._canvas import Canvas, printable
from sketchmatch.pictures._palette import mixed, pair_colour, readable_on
from sketchmatch.pictures._places import badge_places, label_places
from sketchmatch.pictures._underlay import known_area, painted_cells
from sketchmatch.pictures.overlay import (
    OverlayMatch,
    check_picture_path,
    draw_overlay,
    draw_scene,
    save_overlay,
)
from sketchmatch.testing import simulate_sketch
from tests.interpreted import examples

WHITE = (255, 255, 255)


def rectangle(x, y, width, height):
    return [[x, y], [x + width, y], [x + width, y + height], [x, y + height]]


def room():
    boxes = [(0, 0, 3, 2), (6, 1, 2, 2), (1, 5, 2, 2), (6, 6, 3, 2), (4, 3.5, 1.5, 1.5)]
    return Scene.from_polygons([rectangle(*box) for box in boxes])


def turned(scene, angle):
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    return Scene.from_polygons([[ring @ turn for ring in item.rings] for item in scene.objects])


def pairs(partners, confidence=0.8):
    return [OverlayMatch(k, int(m), confidence) for k, m in enumerate(partners)]


def pixels(image, half=None):
    array = np.asarray(image).astype(int)
    middle = array.shape[1] // 2
    return {None: array, "left": array[:, :middle], "right": array[:, middle:]}[half]


def fill_centre(image, half, number, tolerance=6):
    """Where, in pixels of that half, the translucent fill of a number lies on light ground."""
    tint = mixed(WHITE, pair_colour(number), 0.42)
    like = (np.abs(pixels(image, half) - tint) <= tolerance).all(axis=2)
    for axis in (0, 1):
        like = np.lib.stride_tricks.sliding_window_view(like, 5, axis=axis).all(axis=2)
    rows, columns = np.nonzero(like)
    assert rows.size > 300, f"number {number} is not seen in the {half} half"
    return np.array([columns.min() + columns.max(), rows.min() + rows.max()]) / 2.0 + 2.0


def fitted_frame(image, half, scene, numbers):
    """Scale and shift, from what is seen, that take box centres to pixels."""
    seen = np.array([fill_centre(image, half, number) for number in numbers.values()])
    boxes = [scene.objects[k].polygon.bounds for k in numbers]
    real = np.array([((b[0] + b[2]) / 2, -(b[1] + b[3]) / 2) for b in boxes])
    offsets, shifts = real - real.mean(axis=0), seen - seen.mean(axis=0)
    scale = (offsets * shifts).sum() / (offsets**2).sum()
    return scale, seen.mean(axis=0) - scale * real.mean(axis=0), shifts - scale * offsets


def pixel_at(image, half, frame, point):
    scale, shift = frame[:2]
    x, y = scale * np.array([point[0], -point[1]]) + shift
    return pixels(image, half)[round(y), round(x)]


def saturation(colour):
    return int(colour.max() - colour.min())


@pytest.mark.slow
def test_partners_have_one_colour_at_their_places():
    scene, partners = room(), [2, 0, 3, 1, 4]
    sketch = Scene(tuple(turned(scene, 0.5).objects[m] for m in partners))
    image = draw_overlay(sketch, scene, pairs(partners))
    sides = {
        "left": (sketch, {k: k + 1 for k in range(5)}),
        "right": (scene, {m: k + 1 for k, m in enumerate(partners)}),
    }
    for half, (side, numbers) in sides.items():
        scale, _, residuals = fitted_frame(image, half, side, numbers)
        assert scale > 10
        assert np.abs(residuals).max() < 3.0


@pytest.mark.slow
def test_objects_without_partner_are_grey():
    scene = room()
    image = draw_overlay(scene, scene, [OverlayMatch(k, k, 0.5) for k in (0, 1, 3)])
    for half in ("left", "right"):
        frame = fitted_frame(image, half, scene, {0: 1, 1: 2, 3: 4})
        for k in (2, 4):
            x, y = scene.objects[k].centroid
            around = [(x + dx, y + dy) for dx in (-0.5, 0, 0.5) for dy in (-0.5, 0, 0.5)]
            seen = [pixel_at(image, half, frame, point) for point in around]
            assert max(saturation(colour) for colour in seen) < 20
            assert min(colour.mean() for colour in seen) < 248


@pytest.fixture
def drawn(monkeypatch):
    """The polygons that are filled and the texts that are written, as they are drawn."""

    class Drawn:
        def __init__(self):
            self.polygons, self.texts = [], []

        def numbers(self, left, right):
            """By area rank, from 0: the numbers on the objects of the panel between two x."""
            shapes = [shape for shape in self.polygons if left < shape.centroid.x < right]
            return [
                [int(text) for text, point in self.texts if text.isdigit() and shape.covers(point)]
                for shape in sorted(shapes, key=lambda shape: shape.area)
            ]

        def legend(self):
            """The numbers below the panels, row by row."""
            rows = [(p.y, p.x, int(text)) for text, p in self.texts if text.isdigit()]
            bottom = max(shape.bounds[3] for shape in self.polygons)
            return [number for y, _, number in sorted(rows) if y > bottom + 20.0]

    recorded = Drawn()
    fill, text = Canvas.fill, Canvas.text

    def filled(canvas, rings, colour, alpha):  # an object, not one in the legend
        if alpha in (0.42, 0.12) and np.ptp(rings[0], axis=0).max() > 30.0:
            recorded.polygons.append(shapely.Polygon(rings[0]))
        fill(canvas, rings, colour, alpha)

    def written(canvas, at, words, *args, **options):
        recorded.texts.append((words, shapely.Point(at)))
        text(canvas, at, words, *args, **options)

    monkeypatch.setattr(Canvas, "fill", filled)
    monkeypatch.setattr(Canvas, "text", written)
    return recorded


def row(order):
    """Squares in a row, object k as large as rank ``order[k]`` says, all with room for a badge."""
    sides = [2.0 + 0.2 * rank for rank in order]
    return Scene.from_polygons([rectangle(4 * k, 0, side, side) for k, side in enumerate(sides)])


def test_every_number_is_that_of_the_object_in_its_own_scene(drawn):
    sketch, map_ = row([2, 0, 1]), row([1, 3, 0, 2])
    matches = [OverlayMatch(0, 3, 0.9), OverlayMatch(2, 1, 0.8)]
    draw_overlay(sketch, map_, matches)
    assert drawn.numbers(0, 800) == [[2], [3], [1]]
    assert drawn.numbers(800, 1600) == [[3], [1], [4], [2]]
    assert drawn.legend() == [1, 4, 3, 2]


def test_what_is_one_together_has_one_colour_and_is_not_alone(drawn):
    scene, map_ = row([0, 1]), row([0, 1, 2])
    matches = [OverlayMatch(0, 1, 0.9)]
    alone = draw_overlay(scene, map_, matches)
    drawn.texts.clear()
    image = draw_overlay(scene, map_, matches, groups=[([0], [1, 2])])
    texts = [text for text, _ in drawn.texts]
    assert "with mapped 3" in texts
    assert "no partner: 1 sketched and 1 mapped" in texts
    assert "1 of 2 objects matched" in texts
    tint = mixed(WHITE, pair_colour(1), 0.42)
    filled = [
        (np.abs(pixels(each, "right").astype(int) - tint).max(axis=2) < 7).sum()
        for each in (alone, image)
    ]
    assert 1.8 < filled[1] / filled[0] < 2.4  # squares of sides 2.2 and 2.4


@pytest.mark.parametrize("group", [([2], [0]), ([0], [5]), ([0], [])])
def test_a_group_of_what_is_not_there_is_refused(group):
    with pytest.raises(InvalidInputError, match=r"the (sketch|map) has objects") as caught:
        draw_overlay(row([0, 1]), row([0, 1]), pairs([0, 1]), groups=[group])
    side = "sketch" if group[0] == [2] else "map"
    assert caught.value.field == f"groups[0].{side}_objects"


def test_confidences_are_written_as_the_table_beside_writes_them(drawn):
    draw_overlay(row([0, 1]), row([0, 1]), [OverlayMatch(0, 0, 0.9954), OverlayMatch(1, 1, 0.8)])
    shares = [text for text, _ in drawn.texts if text.startswith("0.") or text.endswith("%")]
    assert shares == ["0.995", "0.800"]


def test_what_is_said_of_a_pair_stands_beside_its_bar(drawn):
    said = [OverlayMatch(0, 0, 0.9954, "> 99 %"), OverlayMatch(1, 1, 0.8)]
    draw_overlay(row([0, 1]), row([0, 1]), said)
    shares = [text for text, _ in drawn.texts if text.startswith("0.") or text.endswith("%")]
    assert shares == ["> 99 %", "0.800"]


def test_an_alert_stands_between_header_and_panels_and_a_footnote_below_all(drawn):
    plain = draw_overlay(row([0, 1]), row([0, 1]), pairs([0, 1]), facts=[("Scale", "2.5")])
    panel = next(p for text, p in drawn.texts if text == "Sketch")
    drawn.texts.clear()
    told = draw_overlay(
        *(row([0, 1]), row([0, 1]), pairs([0, 1])),
        facts=[("Scale", "2.5")],
        alert="another\nplace",
        footnote="what it means",
    )
    heights = {text: point.y for text, point in drawn.texts}
    moved = heights["Sketch"] - panel.y
    assert heights["2.5"] < heights["another place"] < heights["Sketch"]
    assert moved > 40
    assert heights["what it means"] > max(y for text, y in heights.items() if "means" not in text)
    assert heights["what it means"] < told.height
    assert told.height > plain.height + moved
    (x,) = {point.x for text, point in drawn.texts if text == "another place"}
    colour = pixels(told)[round(heights["another place"]), round(x) - 8]
    assert saturation(colour) > 40
    assert saturation(pixels(plain)[round(heights["another place"]), round(x) - 8]) < 20


def test_the_last_facts_give_way_to_the_headline(drawn):
    facts = [(f"fact {k}", "a value that is long") for k in range(6)]
    draw_overlay(row([0, 1]), row([0, 1]), pairs([0, 1]), facts=facts)
    texts = [text for text, _ in drawn.texts]
    assert "2 of 2 objects matched" in texts
    assert {"fact 0", "fact 1", "fact 2"} <= set(texts)
    assert "fact 5" not in texts
    drawn.texts.clear()
    draw_overlay(row([0, 1]), row([0, 1]), pairs([0, 1]), title="long " * 99, facts=facts[:3])
    texts = [text for text, _ in drawn.texts]
    assert {"fact 0", "fact 1", "fact 2"} <= set(texts), "a third of the page is enough"


def test_numbers_of_a_scene_by_itself_are_those_beside_its_partners(drawn):
    scene = row([1, 3, 0, 2])
    draw_scene(Scene.from_polygons([item.rings for item in scene.objects], ["a", "", "c", ""]))
    assert drawn.numbers(0, 1000) == [[3], [1], [4], [2]]
    assert drawn.legend() == [1, 3]


def test_nothing_matched_shows_no_colour():
    image = draw_overlay(room(), room(), [])
    array = pixels(image)
    assert (array.max(axis=2) - array.min(axis=2)).max() < 60


def test_holes_stay_open():
    ring = [rectangle(0, 0, 6, 6), rectangle(2, 2, 2, 2)]
    scene = Scene.from_polygons([ring, rectangle(8, 0, 3, 6)])
    image = draw_overlay(scene, scene, pairs([0, 1]))
    for half in ("left", "right"):
        frame = fitted_frame(image, half, scene, {0: 1, 1: 2})
        assert pixel_at(image, half, frame, (2.6, 2.7)).min() > 225
        tint = mixed(WHITE, pair_colour(1), 0.42)
        assert np.abs(pixel_at(image, half, frame, (5.0, 3.0)) - tint).max() < 8


def test_small_objects_are_drawn_over_large_ones():
    scene = Scene.from_polygons([rectangle(4, 4, 2, 2), rectangle(0, 0, 10, 10)])
    image = pixels(draw_overlay(scene, scene, pairs([0, 1])), "right")
    both = mixed(mixed(WHITE, pair_colour(2), 0.42), pair_colour(1), 0.42)
    assert (np.abs(image - both) <= 4).all(axis=2).sum() > 1000


@pytest.mark.slow
@pytest.mark.parametrize("width", [400, 1600, 3000])
def test_width_is_as_asked_and_shape_does_not_depend_on_it(width):
    image = draw_overlay(room(), room(), pairs(range(5)), width=width)
    usual = draw_overlay(room(), room(), pairs(range(5)))
    assert image.mode == "RGB"
    assert image.width == width
    assert image.height / width == pytest.approx(usual.height / usual.width, abs=0.003)
    assert draw_scene(room(), width=width).width == width


def test_order_of_pairs_does_not_matter_and_inputs_stay():
    scene, matches = room(), pairs([2, 0, 3, 1, 4])
    before = [ring.copy() for item in scene.objects for ring in item.rings]
    first = draw_overlay(scene, scene, matches)
    assert first.tobytes() == draw_overlay(scene, scene, matches[::-1]).tobytes()
    after = [ring for item in scene.objects for ring in item.rings]
    assert all((a == b).all() for a, b in zip(before, after, strict=True))


def test_confidence_is_the_length_of_its_bar():
    matches = [OverlayMatch(0, 0, 1.0), OverlayMatch(1, 1, 0.25)]
    legend = pixels(draw_overlay(room(), room(), matches))[-110:]
    lengths = []
    for number in (1, 2):
        solid = (np.abs(legend - pair_colour(number)) <= 3).all(axis=2)
        runs = solid[solid.sum(axis=1).argmax()]
        lengths.append(max(len(list(run)) for full, run in itertools.groupby(runs) if full))
    assert lengths[0] / lengths[1] == pytest.approx(4.0, rel=0.2)


@pytest.mark.slow
def test_hundred_objects_are_all_seen():
    rng = np.random.default_rng(7)
    spots = [(3.0 * (k % 10), 3.0 * (k // 10)) for k in range(100)]
    scene = Scene.from_polygons(
        [rectangle(x, y, *rng.uniform(1.2, 2.0, 2)) for x, y in spots],
        [f"object {k}" for k in range(100)],
    )
    sketch = simulate_sketch(scene, rng, rotation=0.0)
    image = pixels(draw_overlay(sketch.scene, scene, pairs(sketch.partners)))
    for half in (image[108:900, :800], image[108:900, 800:]):
        colours, counts = np.unique(half.reshape(-1, 3), axis=0, return_counts=True)
        for number in range(1, 101):
            like = (np.abs(colours - pair_colour(number)) <= 3).all(axis=1)
            assert counts[like].sum() > 10


def test_single_scene_numbers_every_object():
    scene = Scene.from_polygons([rectangle(0, 0, 4, 3), rectangle(6, 0, 3, 5)], ["sofa", ""])
    for options in ({}, {"pen": True, "metres": True, "caption": "room.svg"}):
        image = pixels(draw_scene(scene, **options))
        for number in (1, 2):
            tint = mixed(WHITE, pair_colour(number), 0.42)
            assert (np.abs(image - tint) <= 6).all(axis=2).sum() > 3000


@pytest.mark.slow
def test_a_route_is_a_light_arrow_and_all_of_it_is_seen():
    light = mixed((23, 32, 51), WHITE, 0.45)
    way = np.array([[-4.0, 4.0], [3.5, 3.0], [13.0, 4.0]])
    ends = []
    for route in (way, way[::-1]):
        image = pixels(draw_scene(room(), pen=True, route=route))
        like = (np.abs(image - light) <= 12).all(axis=2)[110:]
        columns = np.flatnonzero(like.any(axis=0))
        assert 75 < columns[0] < 90
        assert 910 < columns[-1] < 925
        ends.append((like[:, columns[0] :][:, :16].sum(), like[:, columns[-1] - 16 :].sum()))
    (tail, head), (other_head, other_tail) = ends
    assert head > 2 * tail
    assert other_head > 2 * other_tail
    sketched = [draw_overlay(room(), room(), pairs(range(5)), route=route) for route in (None, way)]
    near = [np.abs(pixels(image) - light).max(axis=2) <= 12 for image in sketched]
    before, after = ((like[:, :800].sum(), like[:, 800:].sum()) for like in near)
    assert after[0] > before[0] + 200
    assert after[1] < before[1] + 50
    for short in ([[1.0, 1.0], [1.0, 1.0]], [[1.0, 1.0], [1.001, 1.0]]):
        assert draw_scene(room(), route=np.array(short), width=400).width == 400


@pytest.mark.slow
@examples(25)
@given(
    offset=st.sampled_from([0.0, -3.0, 5e5, 5e6]),
    size=st.sampled_from([1e-3, 1.0, 1e3]),
    stretch=st.sampled_from([1e-3, 1.0, 1e3]),
    tiny=st.sampled_from([1e-6, 1e-2, 1.0]),
    count=st.integers(2, 6),
)
def test_any_scene_can_be_drawn(offset, size, stretch, tiny, count):
    boxes = [
        np.array(rectangle(3 * k, (k * k) % 5, *(2 * [tiny if k == 1 else 2.5])))
        for k in range(count)
    ]
    polygons = [offset + box * [size, size * stretch] for box in boxes]
    try:
        scene = Scene.from_polygons(polygons, ["a label that is far too long to fit"] * count)
    except InvalidInputError:
        return
    image = draw_overlay(scene, room(), pairs([0, 1]), metres=True, width=400)
    assert image.width == 400
    assert 150 < image.height < 500


def test_underlay_lies_where_the_map_lies():
    """Two objects of a turned grid give the frame; a third block of cells is where it says."""
    yaw, resolution = 0.4, 0.1
    cells = np.full((80, 80), -1, dtype=np.int8)
    cells[5:75, 5:75] = 0
    cells[20:30, 50:70] = 100
    origin = (-12.0, 31.0, yaw)
    c, s = math.cos(yaw), math.sin(yaw)

    def placed(column, row):
        x, y = column * resolution, row * resolution
        return (origin[0] + c * x - s * y, origin[1] + s * x + c * y)

    blocks = [(10, 10, 22, 20), (45, 50, 60, 70)]
    corners = [[(a, b), (u, b), (u, v), (a, v)] for a, b, u, v in blocks]
    scene = Scene.from_polygons([[placed(*corner) for corner in block] for block in corners])
    grid = OccupancyGrid(cells, resolution, origin)
    image = draw_overlay(room(), scene, pairs([0, 1]), underlay=grid)
    frame = fitted_frame(image, "right", scene, {0: 1, 1: 2})
    for column, row in [(51, 21), (69, 21), (69, 29), (51, 29), (60, 25)]:
        assert pixel_at(image, "right", frame, placed(column, row)).max() < 140
    for column, row in [(49, 25), (71, 25), (60, 19), (60, 31), (7, 70)]:
        assert pixel_at(image, "right", frame, placed(column, row)).min() > 245
    for column, row in [(3.5, 40), (76.5, 40), (40, 3.5)]:
        assert 225 <= pixel_at(image, "right", frame, placed(column, row)).min() < 240


@pytest.mark.parametrize("yaw", [0.0, math.pi / 2, -0.7])
@pytest.mark.parametrize("step", [0.01, 0.05, 0.12])
def test_painted_cells_agree_with_looking_each_pixel_up(yaw, step):
    rng = np.random.default_rng(3)
    cells = np.kron(rng.choice([-1, 0, 100], (6, 9)), np.ones((10, 10))).astype(np.int8)
    grid = OccupancyGrid(cells, 0.05, (2.0, -1.0, yaw))
    x0, y0, x1, y1 = known_area(grid)
    size = (math.ceil((x1 - x0) / step), math.ceil((y1 - y0) / step))
    picture = np.asarray(painted_cells(grid, size, (x0, y1), step))
    x = x0 + (np.arange(size[0]) + 0.5) * step - 2.0
    y = y1 - (np.arange(size[1])[:, None] + 0.5) * step + 1.0
    column = np.floor((math.cos(yaw) * x + math.sin(yaw) * y) / 0.05).astype(int)
    row = np.floor((math.cos(yaw) * y - math.sin(yaw) * x) / 0.05).astype(int)
    inside = (column >= 0) & (column < 90) & (row >= 0) & (row < 60)
    value = np.where(inside, cells[row.clip(0, 59), column.clip(0, 89)], -1)
    expected = np.select([value == 0, value == 100], [255, 84], 231)
    assert (picture[..., 0] == expected).mean() > (0.995 if step < 0.1 else 0.93)


def test_known_area_of_a_turned_grid():
    cells = np.full((10, 20), -1, dtype=np.int8)
    cells[2:5, 4:10] = 0
    grid = OccupancyGrid(cells, 0.5, (1.0, 2.0, math.pi / 2))
    assert known_area(grid) == pytest.approx((1.0 - 2.5, 2.0 + 2.0, 1.0 - 1.0, 2.0 + 5.0))
    assert known_area(OccupancyGrid(np.full((3, 3), -1), 0.5)) is None


def test_underlay_without_known_cells():
    grid = OccupancyGrid(np.full((3, 3), -1), 0.5)
    assert draw_scene(room(), underlay=grid, width=400).width == 400


def test_colours_are_apart():
    colours = np.array([pair_colour(number) for number in range(1, 129)], dtype=float)
    gaps = np.abs(colours[:, None] - colours[None]).sum(axis=2)
    assert gaps[np.triu_indices(128, 1)].min() > 15
    assert gaps[:12, :12][np.triu_indices(12, 1)].min() > 60
    assert (np.ptp(colours, axis=1) > 25).all()
    assert pair_colour(129) == pair_colour(1)


@pytest.mark.parametrize("number", range(1, 129))
def test_numbers_are_readable_on_their_colours(number):
    def luminance(colour):
        v = np.array(colour) / 255.0
        linear = np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    colour = pair_colour(number)
    low, high = sorted([luminance(colour), luminance(readable_on(colour))])
    assert (high + 0.05) / (low + 0.05) > 2.5


def test_badges_lie_inside_large_objects_and_beside_small_ones_apart():
    shapes = [shapely.box(100 * k, 100, 100 * k + (60 if k % 2 else 6), 160) for k in range(8)]
    shapes.append(shapely.box(0, 300, 200, 400).difference(shapely.box(20, 320, 180, 380)))
    places = badge_places(shapes, (14.0, 14.0), (-50, 0, 850, 500))
    badges = [shapely.Point(places[k].x, places[k].y).buffer(13.5) for k in range(9)]
    for k in (1, 3, 5, 7):
        assert shapes[k].contains(badges[k])
    for k in (0, 2, 4, 6, 8):
        assert not any(badges[k].intersects(shape) for shape in shapes)
        assert badges[k].distance(shapes[k]) < 15
    assert not any(a.intersects(b) for a, b in itertools.combinations(badges, 2))


def test_badge_of_a_covered_object_is_clear_of_what_covers_it():
    shapes = [shapely.box(0, 0, 300, 300), shapely.box(100, 100, 200, 200)]
    place = badge_places(shapes, (14.0, 14.0), (0, 0, 400, 400))[0]
    assert shapes[1].distance(shapely.Point(place.x, place.y)) > 14


def test_badge_of_a_wholly_covered_object_is_beside_it():
    rooms = [shapely.box(x, y, x + 100, y + 100) for x in (100, 200) for y in (100, 200)]
    floor = shapely.box(100, 100, 300, 300)
    for shapes in ([floor, *rooms], [floor, floor]):
        place = badge_places(shapes, (14.0, 14.0), (0, 0, 400, 400))[0]
        assert 14 < floor.distance(shapely.Point(place.x, place.y)) < 30


def test_badge_of_a_tiny_object_in_a_corner_stays_in_bounds():
    place = badge_places([shapely.box(0, 0, 1, 1)], (14.0, 14.0), (0, 0, 400, 400))[0]
    assert place.x >= 14
    assert place.y >= 14


def test_labels_keep_apart_or_are_left_out():
    shapes = [shapely.box(0, 0, 40, 40), shapely.box(44, 0, 84, 40)]
    sizes = {0: (70.0, 16.0), 1: (70.0, 16.0)}
    places = label_places(shapes, sizes, {}, (14.0, 14.0), (-60, -60, 160, 100))
    boxes = [shapely.box(x - 35, y - 8, x + 35, y + 8) for x, y in places.values()]
    assert len(boxes) == 2
    assert not boxes[0].intersects(boxes[1])
    assert not any(box.intersects(shape) for box in boxes for shape in shapes)
    assert not label_places(shapes, sizes, {}, (14.0, 14.0), (0, 0, 84, 40))


def test_text_is_printable_and_cut_to_fit():
    assert printable("Tür\n → 2,5 m²") == "Tur -> 2,5 m2"
    assert printable("机器人 — кухня, مطبخ") == "JiQiRen - kukhnya, mtbkh"
    assert printable("ζ × 2 ± 1°\u202e\x07") == "zeta x 2 ± 1°"
    canvas = Canvas((100.0, 100.0), 100, WHITE)
    text = canvas.truncated("a very long label", 15.0, 60.0)
    assert text.endswith("…")
    assert canvas.text_width(text, 15.0) <= 60.0
    assert canvas.truncated("short", 15.0, 60.0) == "short"
    assert canvas.truncated("none", 15.0, 0.0) == "…"


@pytest.mark.parametrize(
    ("matches", "field"),
    [
        ([OverlayMatch(5, 0, 0.5)], "matches[0].sketch_object"),
        ([OverlayMatch(0, 0, 0.5), OverlayMatch(1, -1, 0.5)], "matches[1].map_object"),
        ([OverlayMatch(0, 0, 0.5), OverlayMatch(0, 1, 0.5)], "matches[1].sketch_object"),
        ([OverlayMatch(0, 0, 0.5), OverlayMatch(1, 0, 0.5)], "matches[1].map_object"),
        ([OverlayMatch(0, 0, math.nan)], "matches[0].confidence"),
    ],
)
def test_impossible_pairs_are_refused(matches, field):
    with pytest.raises(InvalidInputError) as caught:
        draw_overlay(room(), room(), matches)
    assert caught.value.field == field


@pytest.mark.parametrize("width", [0, -5, 399, 6401])
def test_impossible_widths_are_refused(width):
    for draw in (
        lambda: draw_overlay(room(), room(), [], width=width),
        lambda: draw_scene(room(), width=width),
    ):
        with pytest.raises(InvalidInputError, match="400 … 6400"):
            draw()


@pytest.mark.parametrize(
    ("name", "kind"), [("a.png", "PNG"), ("a.JPG", "JPEG"), ("a.jpeg", "JPEG"), ("a.webp", "WEBP")]
)
def test_saved_as_the_name_says(tmp_path, name, kind):
    image = draw_scene(room(), width=400)
    save_overlay(tmp_path / name, image)
    with Image.open(tmp_path / name) as back:
        assert back.format == kind
        assert back.size == image.size


@pytest.mark.parametrize("name", ["a.gif", "a", "a.txt", "missing/a.png"])
def test_names_that_cannot_be_saved_are_refused_before_any_work(tmp_path, name):
    for refuse in (check_picture_path, lambda path: save_overlay(path, Image.new("RGB", (2, 2)))):
        with pytest.raises(InvalidInputError) as caught:
            refuse(tmp_path / name)
        assert caught.value.reason is Reason.INVALID_FILE
        assert caught.value.field == "overlay"


def test_a_file_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(InvalidInputError, match="cannot be written"):
        save_overlay(tmp_path / "folder.png", Image.new("RGB", (2, 2)))
