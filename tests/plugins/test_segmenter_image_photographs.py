"""The segmenter of pictures on photographs with known truth, and what must not change anything."""

import cv2
import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.errors import InvalidInputError
from sketchmatch.model import Image
from sketchmatch.testing import random_scene
from sketchmatch.testing.photographs import photograph
from sketchmatch_builtin.segmenters.image import ImageSegmenter
from tests.interpreted import examples

pytestmark = pytest.mark.slow

DISTURBANCES = {
    "clean": {"texture": 0.0},
    "filled": {"fill": 0.9, "darkness": 0.9, "texture": 0.0},
    "gradient": {"gradient": 0.55},
    "vignette": {"vignette": 0.7},
    "shadow": {"shadow": 0.4},
    "filled in shadow": {"shadow": 0.4, "fill": 0.7, "darkness": 0.8},
    "light crayon": {"fill": 0.3, "darkness": 0.35, "gradient": 0.3},
    "texture": {"texture": 0.03, "noise": 8.0},
    "jpeg": {"quality": 30, "noise": 4.0},
    "blurred": {"blur": 2.5, "noise": 3.0},
    "pencil": {"darkness": 0.28, "pen": 0.003, "noise": 4.0, "gradient": 0.2},
    "ruled": {"ruling": "lines", "noise": 3.0, "gradient": 0.3},
    "squared": {"ruling": "squares", "noise": 3.0, "gradient": 0.3},
    "gaps": {"gap": 0.1},
    "table": {"table": 0.25, "perspective": 0.008, "noise": 3.0, "shadow": 0.2},
    "all": {
        "gradient": 0.3,
        "vignette": 0.3,
        "shadow": 0.25,
        "ruling": "squares",
        "ruling_darkness": 0.15,
        "noise": 5.0,
        "blur": 1.2,
        "quality": 60,
        "texture": 0.02,
        "perspective": 0.01,
        "gap": 0.04,
        "scribbles": 2,
    },
}


INVERTED = (
    "The picture is light on dark and was read as its negative: set ink to 'dark' if the dark is "
    "what is drawn."
)


def found_in(pixels, **params):
    return ImageSegmenter(ImageSegmenter.Params(**params)).segment(Image(pixels))


def taken(seed, **how):
    rng = np.random.default_rng([seed, 11])
    return photograph(random_scene(rng, 6 + seed % 3), rng, **how)


def overlaps(truth, scene):
    """Return the intersection over union of each true outline and each object."""
    shapes = [shapely.Polygon(outline).buffer(0.0) for outline in truth]
    return np.array(
        [
            [
                shape.intersection(item.polygon).area / shape.union(item.polygon).area
                for item in scene.objects
            ]
            for shape in shapes
        ]
    )


def test_nearly_all_objects_of_photographs_are_found_and_hardly_anything_is_invented():
    recovered, clear = [], []
    for how in DISTURBANCES.values():
        for seed in range(3):
            picture = taken(seed, **how)
            shares = overlaps(picture.outlines, found_in(picture.image.pixels).scene)
            recovered.extend(shares.max(axis=1) > 0.8)
            clear.append((shares.max(axis=0) > 0.5).all())
    assert len(clear) == 48
    assert np.mean(recovered) >= 0.95
    assert np.mean(clear) >= 0.95


def test_a_photograph_is_the_same_for_the_same_seed():
    first, again = taken(3, **DISTURBANCES["all"]), taken(3, **DISTURBANCES["all"])
    assert (first.image.pixels == again.image.pixels).all()
    assert all(map(np.array_equal, first.outlines, again.outlines))


PLAIN = taken(1, size=(450, 600), pen=0.008, texture=0.005).image.pixels


def same(scene, outlines, least=0.85):
    shares = overlaps([item.rings[0] for item in outlines.objects], scene)
    return shares.shape[0] == shares.shape[1] and (shares.max(axis=1) > least).all()


@given(
    contrast=st.floats(0.3, 1.0),
    brightness=st.floats(0.0, 1.0),
)
@examples(15)
def test_brightness_and_contrast_change_nothing(contrast, brightness):
    lowest = brightness * (1.0 - contrast) * 255.0
    pixels = np.rint(PLAIN * contrast + lowest).astype(np.uint8)
    assert same(found_in(pixels).scene, found_in(PLAIN).scene)


@given(margins=st.tuples(*[st.integers(0, 80)] * 4))
@examples(15)
def test_a_margin_changes_nothing_but_where_things_are(margins):
    top, bottom, left, right = margins
    wider = cv2.copyMakeBorder(
        PLAIN, top, bottom, left, right, cv2.BORDER_CONSTANT, value=int(np.median(PLAIN))
    )
    scene = found_in(wider).scene
    moved = [item.rings[0] - [left, bottom] for item in scene.objects]
    shares = overlaps(moved, found_in(PLAIN).scene)
    assert shares.shape[0] == shares.shape[1]
    assert (shares.max(axis=1) > 0.85).all()


@pytest.mark.parametrize("turns", [1, 2, 3])
@pytest.mark.parametrize("how", ["clean", "all", "table"])
def test_turning_by_90_degrees_changes_nothing_but_the_direction(turns, how):
    pixels = taken(2, **DISTURBANCES[how]).image.pixels
    rows, columns = pixels.shape
    scene = found_in(np.rot90(pixels, turns)).scene
    size = np.array([columns, rows] if turns == 2 else [rows, columns]) / 2.0
    angle = -turns * np.pi / 2.0
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    back = [(item.rings[0] - size) @ turn.T + [columns / 2.0, rows / 2.0] for item in scene.objects]
    shares = overlaps(back, found_in(pixels).scene)
    assert shares.shape[0] == shares.shape[1]
    assert (shares.max(axis=1) > 0.85).all()


@pytest.mark.parametrize("how", sorted(DISTURBANCES))
def test_the_negative_has_the_same_objects(how):
    pixels = taken(0, **DISTURBANCES[how]).image.pixels
    found, negative = found_in(pixels), found_in(255 - pixels)
    assert [o.rings[0].tolist() for o in negative.scene.objects] == [
        o.rings[0].tolist() for o in found.scene.objects
    ]
    assert negative.warnings == (INVERTED, *found.warnings)


def paper(shape=(600, 800)):
    return np.full(shape, 240, np.uint8)


def test_lines_that_enclose_nothing_are_left_out_and_said():
    pixels = paper()
    cv2.rectangle(pixels, (100, 100), (250, 200), 30, 5)
    cv2.circle(pixels, (500, 200), 70, 30, 5)
    cv2.polylines(pixels, [np.array([[100, 400], [300, 500], [600, 420]])], False, 30, 5)
    cv2.putText(pixels, "sofa", (130, 250), cv2.FONT_HERSHEY_SIMPLEX, 0.6, 30, 2)
    found = found_in(pixels)
    assert len(found.scene) == 2
    assert found.warnings == (
        "1 line that encloses nothing was left out: close an outline, or raise max_gap, to have "
        "an object.",
    )


def test_gaps_are_closed_as_far_as_allowed():
    pixels = paper()
    cv2.circle(pixels, (550, 300), 80, 30, 5)
    cv2.circle(pixels, (150, 300), 40, 30, 5)
    cv2.ellipse(pixels, (350, 300), (70, 70), 0, 15, 345, 30, 5)
    found = found_in(pixels, max_gap=0.3)
    assert len(found.scene) == 3
    assert found.warnings == (
        "1 outline with gaps was closed: lower max_gap if it is not an object.",
    )
    assert len(found_in(pixels, max_gap=0.05).scene) == 2


@pytest.mark.parametrize("apart", [200, 150, 120])
def test_outlines_that_touch_or_overlap_are_parted(apart):
    pixels = paper()
    cv2.rectangle(pixels, (100, 100), (250, 200), 30, 4)
    cv2.rectangle(pixels, (100 + apart, 140), (250 + apart, 300), 30, 4)
    cv2.circle(pixels, (600, 450), 60, 30, 4)
    found = found_in(pixels)
    assert len(found.scene) == 3
    assert len(found.warnings) == (apart < 200)
    assert all("touching or overlapping" in warning for warning in found.warnings)
    widths = sorted(np.ptp(item.rings[0][:, 0]) for item in found.scene.objects)
    assert widths == pytest.approx([124, 154, 154], abs=9)


def test_a_line_across_a_convex_outline_parts_nothing():
    pixels = paper()
    cv2.rectangle(pixels, (100, 100), (300, 200), 30, 4)
    cv2.line(pixels, (200, 100), (200, 200), 30, 4)
    cv2.circle(pixels, (600, 450), 60, 30, 4)
    assert len(found_in(pixels).scene) == 2


def coloured():
    pixels = np.full((400, 600), 255, np.uint8)
    cv2.rectangle(pixels, (100, 100), (200, 250), 60, cv2.FILLED)
    cv2.rectangle(pixels, (201, 100), (320, 250), 150, cv2.FILLED)
    cv2.rectangle(pixels, (321, 100), (400, 250), 200, cv2.FILLED)
    cv2.circle(pixels, (500, 330), 40, 60, cv2.FILLED, cv2.LINE_AA)
    return cv2.GaussianBlur(pixels, (0, 0), 0.8)


def test_areas_of_different_shades_are_one_object_or_each_its_own():
    assert len(found_in(coloured()).scene) == 2
    found = found_in(coloured(), colours="separate").scene
    assert len(found) == 4
    widths = sorted(np.ptp(item.rings[0][:, 0]) for item in found.objects)
    assert widths == pytest.approx([80, 81, 101, 120], abs=4)


def test_a_large_photograph_is_traced_to_the_pen_s_width():
    picture = taken(0, size=(3000, 4000), gradient=0.4, noise=4.0)
    shares = overlaps(picture.outlines, found_in(picture.image.pixels).scene)
    assert (shares.max(axis=1) > 0.9).all()
    assert shares.shape[0] == shares.shape[1]


def test_paper_without_ink_is_refused():
    rng = np.random.default_rng(0)
    pixels = np.clip(rng.normal(150, 5, (600, 800)) + np.linspace(0, 80, 800), 0, 255)
    with pytest.raises(InvalidInputError, match="has no shape of at least 16 pixels' side"):
        found_in(pixels.astype(np.uint8))


def room():
    pixels = paper()
    cv2.rectangle(pixels, (60, 60), (740, 540), 30, 5)
    cv2.rectangle(pixels, (350, 250), (450, 330), 30, 5)
    cv2.circle(pixels, (600, 200), 50, 30, 5)
    return pixels


FRAMED = (
    "The line around everything was taken as a frame and left out: set frame to 'keep' if it is "
    "an object."
)


def test_what_is_drawn_against_the_frame_is_an_object():
    pixels = room()
    cv2.rectangle(pixels, (60, 60), (200, 140), 30, 5)
    found = found_in(pixels)
    assert len(found.scene) == 3
    assert found.warnings == (
        FRAMED,
        "1 shape drawn against the frame was taken as an object.",
    )


def test_a_room_with_a_door_is_a_frame():
    pixels = room()
    cv2.rectangle(pixels, (300, 530), (380, 550), 240, cv2.FILLED)
    found = found_in(pixels)
    assert len(found.scene) == 2
    assert found.warnings == (FRAMED,)


def test_an_outline_with_a_gap_in_walls_with_one_as_wide_is_an_object():
    pixels = room()
    cv2.rectangle(pixels, (50, 55), (70, 65), 240, cv2.FILLED)
    cv2.rectangle(pixels, (150, 400), (260, 480), 30, 5)
    cv2.rectangle(pixels, (140, 395), (160, 405), 240, cv2.FILLED)
    found = found_in(pixels)
    assert len(found.scene) == 3
    assert found.warnings == (
        FRAMED,
        "1 outline with gaps was closed: lower max_gap if it is not an object.",
    )


def test_a_mark_with_a_gap_in_an_outline_with_one_is_no_object():
    pixels = paper()
    cv2.circle(pixels, (600, 200), 50, 30, 5)
    for low, high, gap in (((100, 100), (400, 400), 12), ((200, 200), (260, 260), 12)):
        cv2.rectangle(pixels, low, high, 30, 5)
        cv2.rectangle(pixels, (low[0] - 5, low[1] + 20), (low[0] + 5, low[1] + 20 + gap), 240, -1)
    found = found_in(pixels)
    assert len(found.scene) == 2
    assert found.warnings == (
        "1 outline with gaps was closed: lower max_gap if it is not an object.",
    )
