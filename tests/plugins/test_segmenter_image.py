"""The segmenter of pictures: outlines and filled shapes, noise, frames, light on dark."""

import re

import cv2
import numpy as np
import pytest

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import Image
from sketchmatch_builtin.segmenters.image import ImageSegmenter

INVERTED = (
    "The picture is light on dark and was read as its negative: set ink to 'dark' if the dark is "
    "what is drawn."
)


def segmented(pixels, **params):
    """What is found in a picture: the same as in its negative, which every test looks at too."""
    segmenter = ImageSegmenter(ImageSegmenter.Params(**params))
    try:
        found = segmenter.segment(Image(pixels))
    except InvalidInputError as error:
        with pytest.raises(InvalidInputError, match=re.escape(str(error))):
            segmenter.segment(Image(255 - pixels))
        raise
    negative = segmenter.segment(Image(255 - pixels))
    assert [item.rings[0].tolist() for item in negative.scene.objects] == [
        item.rings[0].tolist() for item in found.scene.objects
    ]
    assert (INVERTED in negative.warnings) is not (INVERTED in found.warnings)
    return found


def paper(shape=(300, 400), grey=240):
    return np.full(shape, grey, np.uint8)


def drawing():
    """A filled box, an outlined box and an outlined disc with a face in it."""
    pixels = paper()
    cv2.rectangle(pixels, (50, 40), (129, 79), 20, cv2.FILLED)  # 80 × 40 pixels
    pixels[50:110, 200:300] = 20
    pixels[53:107, 203:297] = 240
    cv2.circle(pixels, (150, 220), 40, 20, 3)
    cv2.circle(pixels, (140, 210), 5, 20, cv2.FILLED)
    cv2.circle(pixels, (160, 210), 5, 20, cv2.FILLED)
    return pixels


def test_shapes_are_what_they_enclose_in_pixels_with_y_up():
    found = segmented(drawing(), blur=0.0)
    box, outlined, disc = found.scene.objects
    assert box.polygon.bounds == (50, 300 - 80, 130, 300 - 40)
    assert box.area == 3200.0
    assert outlined.polygon.bounds == (200, 300 - 110, 300, 300 - 50)
    assert outlined.area == 6000.0
    assert disc.centroid == pytest.approx((150.5, 300 - 220.5), abs=0.5)
    assert disc.area == pytest.approx(np.pi * 42**2, rel=0.04)
    assert found.warnings == ()


def test_noise_and_specks_change_little():
    rng = np.random.default_rng(1)
    noisy = np.clip(drawing() + rng.normal(0, 20, (300, 400)), 0, 255).astype(np.uint8)
    noisy[rng.random(noisy.shape) < 0.01] = 0
    clean, found = segmented(drawing()).scene, segmented(noisy).scene
    assert len(found) == 3
    for expected, item in zip(clean.objects, found.objects, strict=True):
        assert item.centroid == pytest.approx(expected.centroid, abs=1.0)
        assert item.area == pytest.approx(expected.area, rel=0.05)


def test_a_turned_picture_has_turned_objects():
    scene = segmented(drawing()).scene
    turned = segmented(np.rot90(drawing())).scene
    centres = {tuple(np.round(item.centroid)) for item in scene.objects}
    back = {tuple(np.round((y, 300 - x))) for x, y in (o.centroid for o in turned.objects)}
    assert all(min(np.hypot(a - c, b - d) for c, d in back) <= 2.0 for a, b in centres)


def test_light_on_dark_is_read_as_its_negative_and_said():
    found = segmented(255 - drawing())
    assert [item.area for item in found.scene.objects] == pytest.approx(
        [item.area for item in segmented(drawing()).scene.objects], rel=0.02
    )
    assert found.warnings == (INVERTED,)


@pytest.mark.parametrize("sides", ["all", "two", "tilted"])
@pytest.mark.parametrize("share", [0.01, 0.02, 0.04])
def test_a_narrow_strip_of_table_is_no_ink_and_does_not_turn_the_picture(share, sides):
    top, bottom, left, right = (
        round(share * 400) * k for k in {"two": (1, 0, 1, 0)}.get(sides, (1, 1, 1, 1))
    )
    pixels = cv2.copyMakeBorder(drawing(), top, bottom, left, right, cv2.BORDER_CONSTANT, value=70)
    if sides == "tilted":
        rows, columns = pixels.shape
        turn = cv2.getRotationMatrix2D((columns / 2, rows / 2), np.degrees(share) / 2, 1.0)
        pixels = cv2.warpAffine(pixels, turn, (columns, rows), borderValue=70)
    found = segmented(pixels)
    assert INVERTED not in found.warnings
    areas = [3200.0, np.pi * 42**2, 6000.0]
    assert sorted(item.area for item in found.scene.objects) == pytest.approx(areas, rel=0.05)


def framed():
    pixels = drawing()
    cv2.rectangle(pixels, (10, 10), (389, 289), 20, 4)
    return pixels


def test_a_line_around_everything_is_a_frame():
    found = segmented(framed())
    assert len(found.scene) == 3
    assert found.warnings == (
        "The line around everything was taken as a frame and left out: set frame to 'keep' if "
        "it is an object.",
    )


def test_walls_of_double_lines_are_a_frame():
    pixels = framed()
    cv2.rectangle(pixels, (25, 25), (374, 274), 20, 4)
    found = segmented(pixels)
    assert len(found.scene) == 3
    assert len(found.warnings) == 1


def test_a_frame_can_be_kept_as_the_one_object_that_it_is():
    with pytest.raises(InvalidInputError, match="has only one shape"):
        segmented(framed(), frame="keep")


def test_a_shape_around_one_other_is_no_frame():
    pixels = paper()
    cv2.circle(pixels, (200, 150), 90, 20, 3)
    cv2.circle(pixels, (200, 150), 30, 20, 3)
    with pytest.raises(InvalidInputError, match="has only one shape"):
        segmented(pixels)


def test_what_lies_in_an_object_is_not_looked_at():
    pixels = drawing()
    cv2.rectangle(pixels, (215, 60), (240, 100), 20, 2)
    cv2.rectangle(pixels, (250, 60), (280, 100), 20, 2)
    assert len(segmented(pixels).scene) == 3


def test_min_size_is_relative_to_the_picture():
    pixels = drawing()
    cv2.rectangle(pixels, (350, 250), (369, 269), 20, cv2.FILLED)  # 20 of 400 pixels: 5 %
    assert len(segmented(pixels, blur=0.0, min_size=0.05).scene) == 4
    assert len(segmented(pixels, blur=0.0, min_size=0.051).scene) == 3


@pytest.mark.slow
def test_simplify_is_relative_to_the_shape():
    small, large = paper((200, 400)), paper((2000, 4000))
    for pixels, scale in ((small, 1), (large, 10)):
        for x in (100, 300):
            cv2.circle(pixels, (x * scale, 100 * scale), 60 * scale, 0, cv2.FILLED)
    few, many = segmented(small).scene, segmented(large).scene
    assert abs(len(few.objects[0].rings[0]) - len(many.objects[0].rings[0])) <= 6
    assert len(many.objects[0].rings[0]) < 40
    assert len(segmented(large, simplify=0.0).scene.objects[0].rings[0]) > 400


@pytest.mark.parametrize("grey", [0, 128, 255])
def test_a_blank_picture_is_refused(grey):
    with pytest.raises(InvalidInputError) as caught:
        segmented(paper(grey=grey))
    assert (caught.value.field, caught.value.reason) == ("pixels", Reason.INVALID_IMAGE)
    assert "is blank: lightest and darkest differ by 0 of 255 grey levels; give" in str(
        caught.value
    )


def test_paper_texture_alone_is_blank():
    rng = np.random.default_rng(2)
    texture = np.clip(rng.normal(220, 6, (300, 400)), 0, 255).astype(np.uint8)
    with pytest.raises(InvalidInputError, match="is blank"):
        segmented(texture)


def test_a_picture_of_one_pixel_is_blank():
    with pytest.raises(InvalidInputError, match="is blank"):
        segmented(np.zeros((1, 1), np.uint8))


def test_too_few_shapes_say_how_large_they_would_have_to_be():
    pixels = paper()
    cv2.circle(pixels, (100, 100), 40, 20, cv2.FILLED)
    with pytest.raises(InvalidInputError) as caught:
        segmented(pixels)
    assert (caught.value.field, caught.value.reason) == ("pixels", Reason.TOO_FEW_OBJECTS)
    assert caught.value.problem == (
        "has only one shape of at least 8 pixels' side, and a match needs two; draw objects "
        "apart from each other, lower min_size, or choose the segmenter rooms if it is a floor plan"
    )


@pytest.mark.slow
def test_a_picture_of_noise_is_refused_before_it_takes_long():
    noise = np.where(np.random.default_rng(0).random((800, 800)) < 0.1, 0, 255).astype(np.uint8)
    with pytest.raises(InvalidInputError, match="more than the limit of 1000; raise blur or"):
        segmented(noise, blur=0.0, min_size=0.0)


@pytest.mark.slow
def test_nested_rings_by_the_hundred_are_no_problem():
    pixels = paper((2000, 2000), 255)
    for radius in range(4, 980, 4):
        cv2.circle(pixels, (1000, 1000), radius, 0, 1)
    with pytest.raises(InvalidInputError, match="has only one shape"):
        segmented(pixels, blur=0.0)


def things():
    pixels = paper((600, 900))
    for x, y in ((60, 60), (400, 80), (650, 300), (100, 330)):
        cv2.rectangle(pixels, (x, y), (x + 160, y + 110), 20, 3)
    return pixels


def test_names_beside_things_are_writing():
    pixels = things()
    for name, x, y in (("sofabed", 60, 210), ("board", 400, 230), ("desk", 650, 455)):
        cv2.putText(pixels, name, (x, y), cv2.FONT_HERSHEY_SIMPLEX, 1.3, 20, 3)
    found = segmented(pixels)
    assert len(found.scene.objects) == 4
    (said,) = found.warnings
    assert re.fullmatch(r"\d+ small shapes close to each other in rows were left out, .*", said)


@pytest.mark.parametrize(("count", "size", "objects"), [(4, 20, 8), (3, 50, 7), (2, 20, 6)])
def test_a_row_of_small_things_is_none(count, size, objects):
    pixels = things()
    for k in range(count):
        cv2.circle(pixels, (400 + 2 * size * k, 500), size // 2 + 4, 20, 3)
    assert len(segmented(pixels).scene.objects) == objects


def test_names_alone_are_what_there_is():
    pixels = paper()
    cv2.putText(pixels, "bood", (60, 200), cv2.FONT_HERSHEY_SIMPLEX, 3.0, 20, 4)
    assert len(segmented(pixels).scene.objects) == 4


@pytest.mark.parametrize(("start", "end"), [((353, 41), (562, 356)), ((413, 45), (589, 545))])
def test_a_shape_that_a_line_passes_through_is_one(start, end):
    pixels = paper((600, 900))
    for x, y in ((60, 60), (650, 300), (100, 330)):
        cv2.rectangle(pixels, (x, y), (x + 160, y + 110), 20, 3)
    cv2.polylines(pixels, [np.array([(400, 80), (560, 95), (545, 195), (390, 180)])], True, 20, 3)
    cv2.arrowedLine(pixels, start, end, 20, 3, cv2.LINE_AA, 0, 0.06)
    assert len(segmented(pixels).scene.objects) == 4


def test_walls_of_several_rooms_are_left_out_and_what_is_in_them_found():
    pixels = paper((600, 1000))
    for left in (40, 540):
        cv2.rectangle(pixels, (left, 60), (left + 420, 540), 20, 4)
        for x, y in ((40, 50), (250, 90), (130, 300)):
            cv2.rectangle(pixels, (left + x, 60 + y), (left + x + 110, 60 + y + 80), 20, 3)
        cv2.rectangle(pixels, (left + 290, 400), (left + 390, 500), 20, 3)
        cv2.rectangle(pixels, (left + 330, 390), (left + 345, 410), 240, cv2.FILLED)  # a gap
    found = segmented(pixels)
    assert len(found.scene.objects) == 8
    assert found.warnings[0].startswith("2 outlines around other shapes were taken as walls")
    assert len(segmented(pixels, frame="keep").scene.objects) == 2


def test_what_is_around_few_things_or_hardly_larger_ones_is_an_object():
    pixels = things()
    cv2.rectangle(pixels, (600, 260), (890, 450), 20, 3)  # around one
    for x in (620, 700, 780):
        cv2.rectangle(pixels, (x, 500), (x + 60, 550), 20, 3)
    cv2.rectangle(pixels, (600, 480), (860, 580), 20, 3)  # a tray with three cups
    found = segmented(pixels)
    assert len(found.scene.objects) == 5
    assert not any("walls" in sentence for sentence in found.warnings)


def beside_dark(pale, pen=cv2.FILLED):
    """Two outlines of a black pen, and three shapes in another shade, filled or outlined."""
    pixels = paper((600, 800), 250)
    cv2.rectangle(pixels, (60, 60), (240, 160), 30, 4)
    cv2.circle(pixels, (600, 130), 60, 30, 4)
    cv2.rectangle(pixels, (100, 330), (270, 470), pale, pen)
    cv2.circle(pixels, (460, 400), 70, pale, pen, cv2.LINE_AA)
    cv2.rectangle(pixels, (600, 360), (730, 500), pale, pen)
    return pixels


def test_filled_areas_are_no_ruled_lines():
    found = segmented(beside_dark(170))
    assert len(found.scene) == 5
    assert found.warnings == ()


def test_evenly_filled_areas_are_found_however_much_fainter_than_a_pen():
    found = segmented(beside_dark(225))
    assert len(found.scene) == 5
    assert found.scene.objects[3].area == pytest.approx(np.pi * 70.5**2, rel=0.02)


def test_a_faint_area_that_fades_out_or_that_others_are_drawn_on_is_none():
    pixels = beside_dark(250)
    shadow = np.zeros(pixels.shape, np.float32)
    cv2.circle(shadow, (300, 450), 90, 25.0, cv2.FILLED)
    pixels -= np.rint(cv2.GaussianBlur(shadow, (0, 0), 6.0)).astype(np.uint8)
    assert len(segmented(pixels).scene) == 2
    floor = np.where(beside_dark(250) < 200, np.uint8(30), np.uint8(225))
    floor[:20] = floor[-20:] = floor[:, :20] = floor[:, -20:] = 250
    assert len(segmented(floor).scene) == 2


def test_outlines_far_fainter_than_the_darkest_are_left_out_and_said():
    pixels = beside_dark(220, 5)
    found = segmented(pixels)
    assert len(found.scene) == 2
    assert found.warnings == (
        "3 shapes far fainter than the darkest were left out: draw with one pen, or lower faint, "
        "to have them.",
    )
    found = segmented(pixels, faint=0.05)
    assert len(found.scene) == 5
    assert found.warnings == ()
    pixels[:300, 400:] = 250
    with pytest.raises(InvalidInputError, match="3 others were left out as far fainter"):
        segmented(pixels)


def table(*chairs):
    """A table with chairs that touch it, beside a disc."""
    pixels = paper((450, 600))
    cv2.rectangle(pixels, (150, 150), (330, 300), 20, 3)
    cv2.circle(pixels, (500, 100), 50, 20, 3)
    for x, y in chairs:
        cv2.rectangle(pixels, (x, y), (x + 46, y + 46), 20, 3)
    return pixels


PARTED = (
    "1 drawing of touching or overlapping outlines was split into the likely objects: draw "
    "objects apart to be sure."
)
DIVIDED = (
    "1 outline divided by lines from side to side was taken as one object: leave a gap between "
    "objects that share a side."
)


@pytest.mark.parametrize("overlap", [0, 24])
def test_a_table_and_the_chairs_that_touch_it_are_objects_of_their_own(overlap):
    far, near = 46 - overlap, overlap
    around = [(217, 150 - far), (217, 300 - near), (150 - far, 200), (330 - near, 200)]
    found = segmented(table(*around))
    assert len(found.scene) == 6
    assert found.warnings == (PARTED,)
    areas = sorted(item.area for item in found.scene.objects)
    assert areas[:4] == pytest.approx([48 * 48] * 4, rel=0.15)
    assert areas[5] == pytest.approx(183 * 153, rel=0.1)


def test_two_chairs_at_one_side_of_a_table_are_parted_from_it():
    found = segmented(table((160, 104), (270, 104)))
    assert len(found.scene) == 4
    assert found.warnings == (PARTED,)


def test_an_outline_that_a_line_divides_is_one_object_and_this_is_said():
    pixels = table()
    cv2.line(pixels, (240, 150), (240, 300), 20, 3)
    found = segmented(pixels)
    assert len(found.scene) == 2
    assert found.warnings == (DIVIDED,)


def test_what_is_drawn_within_an_outline_is_no_division():
    pixels = table()
    cv2.circle(pixels, (240, 220), 30, 20, 3)
    found = segmented(pixels)
    assert len(found.scene) == 2
    assert found.warnings == ()


def test_a_chair_s_narrow_back_belongs_to_it():
    pixels = table()
    cv2.rectangle(pixels, (144, 138), (336, 150), 20, 3)
    found = segmented(pixels)
    assert len(found.scene) == 2
    assert found.warnings == (DIVIDED,)
