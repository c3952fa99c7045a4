"""The segmenter of pictures on colours: pens of all colours, areas of equal lightness."""

import cv2
import numpy as np
import pytest

from sketchmatch.errors import InvalidInputError
from sketchmatch.model import Image
from sketchmatch_builtin.segmenters.image import ImageSegmenter
from tests.plugins.test_segmenter_image_photographs import coloured, found_in, overlaps, taken

WHITE, BLACK, YELLOW = (255, 255, 255), (0, 0, 0), (255, 255, 0)
# Of the same luminance, 110, as OpenCV and Pillow have it.
RED, GREEN, BLUE = (255, 50, 39), (20, 170, 38), (60, 110, 243)


def paper(colour=WHITE, shape=(400, 600)):
    return np.full((*shape, 3), colour, np.uint8)


def filled():
    """Three areas side by side that touch, and a disc."""
    pixels = paper()
    for left, right, colour in ((100, 199, RED), (200, 319, GREEN), (320, 400, BLUE)):
        cv2.rectangle(pixels, (left, 100), (right, 250), colour, cv2.FILLED)
    cv2.circle(pixels, (500, 330), 40, BLUE, cv2.FILLED, cv2.LINE_AA)
    return pixels


def jpeg(pixels, quality):
    _, data = cv2.imencode(".jpg", pixels[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.ascontiguousarray(cv2.imdecode(data, cv2.IMREAD_COLOR)[:, :, ::-1])


def noisy(pixels, sigma=6.0):
    rng = np.random.default_rng(5)
    return np.clip(pixels + rng.normal(0.0, sigma, pixels.shape), 0, 255).astype(np.uint8)


def lit(pixels):
    """The picture in the light of a lamp, that is red and comes from the left."""
    light = np.linspace(1.0, 0.6, pixels.shape[1])[None, :, None] * np.array([1.0, 0.9, 0.75])
    return np.rint(pixels * light).astype(np.uint8)


DISTURBED = {
    "clean": lambda pixels: pixels,
    "blurred": lambda pixels: cv2.GaussianBlur(pixels, (0, 0), 1.0),
    "jpeg": lambda pixels: jpeg(pixels, 60),
    "noise": noisy,
    "lamp": lit,
    "all": lambda pixels: jpeg(noisy(lit(cv2.GaussianBlur(pixels, (0, 0), 0.8))), 75),
}


@pytest.mark.parametrize("how", DISTURBED)
def test_areas_of_equal_lightness_are_one_object_or_each_its_own(how):
    luminance = cv2.cvtColor(filled(), cv2.COLOR_RGB2GRAY)[150, 100:401]
    assert np.ptp(luminance) <= 6
    pixels = DISTURBED[how](filled())
    assert len(found_in(pixels).scene) == 2
    found = found_in(pixels, colours="separate").scene
    assert len(found) == 4
    widths = sorted(np.ptp(item.rings[0][:, 0]) for item in found.objects)
    assert widths == pytest.approx([81, 81, 100, 120], abs=5)


@pytest.mark.slow
@pytest.mark.parametrize("how", ["clean", "blurred", "jpeg"])
@pytest.mark.parametrize("pale", [(200, 200, 200), (255, 200, 210), (170, 210, 255)])
@pytest.mark.parametrize("dark", [BLACK, YELLOW, GREEN])
def test_pale_areas_that_touch_dark_ones_belong_to_them(dark, pale, how):
    pixels = paper()
    cv2.rectangle(pixels, (100, 100), (199, 250), dark, cv2.FILLED)
    cv2.rectangle(pixels, (200, 100), (320, 250), pale, cv2.FILLED)
    cv2.circle(pixels, (500, 330), 40, dark, cv2.FILLED, cv2.LINE_AA)
    pixels = DISTURBED[how](pixels)
    assert len(found_in(pixels).scene) == 2
    assert len(found_in(pixels, colours="separate").scene) == 3


def outlined(pen, sheet=WHITE):
    pixels = paper(sheet)
    cv2.rectangle(pixels, (50, 60), (200, 180), pen, 4)
    cv2.circle(pixels, (420, 250), 70, pen, 4)
    return pixels


@pytest.mark.slow
@pytest.mark.parametrize("how", DISTURBED)
@pytest.mark.parametrize("pen", [YELLOW, (0, 255, 255), (255, 160, 190), (150, 255, 120)])
def test_light_pens_are_seen(pen, how):
    found = found_in(DISTURBED[how](outlined(pen)))
    assert len(found.scene) == 2
    assert found.warnings == ()
    box, disc = found.scene.objects
    assert box.polygon.bounds == pytest.approx((48, 217, 203, 342), abs=3)
    assert disc.area == pytest.approx(np.pi * 72**2, rel=0.05)


@pytest.mark.parametrize(
    ("pen", "sheet"), [(BLACK, BLUE), (BLACK, YELLOW), (RED, GREEN), (BLUE, YELLOW), (YELLOW, BLUE)]
)
def test_paper_may_be_coloured(pen, sheet):
    assert len(found_in(noisy(outlined(pen, sheet))).scene) == 2


def test_a_yellow_pen_beside_a_black_one():
    pixels = outlined(YELLOW)
    cv2.circle(pixels, (300, 330), 40, BLACK, 4)
    assert len(found_in(pixels).scene) == 3


def test_grey_in_three_channels_is_grey():
    grey = coloured()
    for colours in ("merge", "separate"):
        one = found_in(grey, colours=colours)
        three = found_in(np.dstack([grey] * 3), colours=colours)
        assert [item.rings[0].tolist() for item in one.scene.objects] == [
            item.rings[0].tolist() for item in three.scene.objects
        ]


def test_the_negative_has_the_same_objects():
    found, negative = (found_in(p, colours="separate") for p in (filled(), 255 - filled()))
    assert [item.rings[0].tolist() for item in negative.scene.objects] == [
        item.rings[0].tolist() for item in found.scene.objects
    ]
    assert len(negative.warnings) == 1


def test_a_photograph_in_the_light_of_a_lamp_has_the_same_objects():
    grey = taken(2, noise=4.0, gradient=0.3, shadow=0.3, ruling="lines")
    pixels = jpeg(noisy(lit(np.dstack([grey.image.pixels] * 3)), 4.0), 70)
    shares = overlaps(grey.outlines, found_in(pixels).scene)
    assert shares.shape[0] == shares.shape[1]
    assert (shares.max(axis=1) > 0.8).all()


def test_coloured_paper_alone_is_blank():
    with pytest.raises(InvalidInputError, match=r"is blank: .* by 0 of 255 grey levels"):
        ImageSegmenter(ImageSegmenter.Params()).segment(Image(paper(YELLOW)))
