"""Pictures of sketches: formats, transparency, depth, orientation, broken files."""

import io

import numpy as np
import PIL.Image
import pytest

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io import read_source
from sketchmatch.io.images import decode_image
from sketchmatch.model import Image
from sketchmatch_builtin.segmenters.image import ImageSegmenter

GREY = np.array([[0, 64, 128], [192, 254, 255]], np.uint8)


def saved(picture, kind, **options):
    file = io.BytesIO()
    picture.save(file, kind, **options)
    return file.getvalue()


@pytest.mark.parametrize("kind", ["PNG", "BMP", "TIFF", "PPM"])
@pytest.mark.parametrize("mode", ["L", "RGB"])
def test_lossless_formats_keep_every_grey(kind, mode):
    data = saved(PIL.Image.fromarray(GREY).convert(mode), kind)
    assert (decode_image(data).pixels == GREY).all()


@pytest.mark.parametrize("name", ["sketch.webp", "sketch.GIF", "sketch.jpg", "sketch.png"])
@pytest.mark.parametrize("kind", ["WEBP", "GIF"])
def test_pictures_of_browsers_are_read_whatever_they_are_called(tmp_path, kind, name):
    options = {"lossless": True} if kind == "WEBP" else {}
    others = {"save_all": True, "append_images": [PIL.Image.new("L", (3, 2), 255)]}
    path = tmp_path / name
    path.write_bytes(saved(PIL.Image.fromarray(GREY), kind, **others, **options))
    assert (read_source(path).pixels == GREY).all()


@pytest.mark.parametrize("kind", ["PNG", "WEBP", "GIF", "TIFF"])
@pytest.mark.parametrize("mode", ["L", "RGB"])
def test_of_several_pages_or_frames_the_first_is_read_and_this_is_said(kind, mode):
    first, second = (PIL.Image.new(mode, (30, 20), colour) for colour in ("white", "black"))
    alone = decode_image(saved(first, kind))
    several = decode_image(saved(first, kind, save_all=True, append_images=[second]))
    assert (several.pixels == alone.pixels).all()
    assert alone.notes == ()
    assert several.notes == (
        "The file has several pages or frames, of which only the first was read: save another "
        "one as a file of its own to use it.",
    )


COLOURS = np.zeros((40, 60, 3), np.uint8) + np.array([255, 250, 240], np.uint8)
COLOURS[5:15, 5:25], COLOURS[20:35, 30:50] = [250, 220, 0], [200, 30, 40]


@pytest.mark.parametrize("kind", ["PNG", "BMP", "TIFF", "PPM"])
def test_colours_are_kept(kind):
    assert (decode_image(saved(PIL.Image.fromarray(COLOURS), kind)).pixels == COLOURS).all()


def test_colours_of_a_palette_are_kept_and_its_transparent_parts_are_white():
    picture = PIL.Image.fromarray(COLOURS).quantize(3)
    paper = picture.getpixel((0, 0))
    pixels = decode_image(saved(picture, "PNG", transparency=paper)).pixels
    assert pixels[0, 0].tolist() == [255, 255, 255]
    assert abs(pixels[10, 10].astype(int) - [250, 220, 0]).max() <= 4


def drawn(ink, under, kind="outlines"):
    """Two boxes on transparent paper, which has a colour under it."""
    shape = np.zeros((100, 160), np.uint8)
    for x in (10, 90):
        shape[20:80, x : x + 60] = 255
        if kind == "outlines":
            shape[23:77, x + 3 : x + 57] = 0
    shape[20:80, 10] = 100  # an edge as programs smooth it
    colours = np.where(shape[:, :, None] > 0, ink, under).astype(np.uint8)
    return np.dstack([colours, shape])


@pytest.mark.parametrize("under", [(0, 0, 0), (255, 255, 255), (90, 200, 30)])
@pytest.mark.parametrize("ink", [(0, 0, 0), (255, 255, 255), (255, 255, 120), (200, 200, 210)])
@pytest.mark.parametrize("kind", ["outlines", "filled"])
def test_ink_on_transparent_paper_is_seen_whatever_its_colour_and_what_lies_under(ink, under, kind):
    pixels = decode_image(saved(PIL.Image.fromarray(drawn(ink, under, kind)), "PNG")).pixels
    darkest = pixels if pixels.ndim == 2 else pixels.min(axis=2)
    alpha = drawn(ink, under, kind)[:, :, 3]
    assert (darkest[alpha == 0] == 255).all()
    assert (darkest[alpha == 255] <= 135).all()
    found = ImageSegmenter(ImageSegmenter.Params()).segment(Image(pixels))
    bounds = [item.polygon.bounds for item in found.scene.objects]
    assert bounds == [pytest.approx(box, abs=2) for box in ((10, 20, 70, 80), (90, 20, 150, 80))]
    assert found.warnings == ()


def test_grey_ink_with_transparency_is_seen():
    grey = drawn((255, 255, 255), (0, 0, 0))[:, :, [0, 3]]
    picture = PIL.Image.merge("LA", [PIL.Image.fromarray(part) for part in np.moveaxis(grey, 2, 0)])
    pixels = decode_image(saved(picture, "PNG")).pixels
    assert pixels[21, 40] == 0
    assert pixels[50, 40] == 255


def test_black_and_white_ink_on_transparent_paper_are_both_seen():
    pixels = drawn((255, 255, 255), (0, 0, 0))
    pixels[:, 80:, :3] = 0
    decoded = decode_image(saved(PIL.Image.fromarray(pixels), "PNG")).pixels
    assert decoded[21, [40, 120]].tolist() == [0, 0]


def test_what_is_white_with_dark_on_it_stays_white():
    """A room on nothing: white ground within a thin black line."""
    pixels = np.zeros((100, 160, 4), np.uint8)
    pixels[10:90, 10:150] = [0, 0, 0, 255]
    pixels[11:89, 11:149] = 255
    decoded = decode_image(saved(PIL.Image.fromarray(pixels), "PNG")).pixels
    assert decoded[[10, 50, 5], [80, 80, 5]].tolist() == [0, 255, 255]


def test_pictures_with_an_opaque_alpha_channel_are_as_they_are():
    picture = PIL.Image.fromarray(COLOURS).convert("RGBA")
    assert (decode_image(saved(picture, "PNG")).pixels == COLOURS).all()


def test_a_picture_that_is_wholly_transparent_is_white():
    pixels = decode_image(saved(PIL.Image.new("RGBA", (30, 20), (9, 9, 9, 0)), "PNG")).pixels
    assert (pixels == 255).all()


def test_a_faint_tint_and_a_few_coloured_pixels_are_grey():
    tinted = np.array(COLOURS[:1, :1].repeat(300, axis=0).repeat(300, axis=1))
    tinted[:3, :3] = [255, 0, 0]
    picture = PIL.Image.fromarray(tinted)
    pixels = decode_image(saved(picture, "PNG")).pixels
    assert (pixels == np.asarray(picture.convert("L"))).all()


def test_colours_after_the_first_strip_are_found(monkeypatch):
    monkeypatch.setattr("sketchmatch.io.images._STRIP", 60)
    data = saved(PIL.Image.fromarray(COLOURS), "PNG")
    assert (decode_image(data).pixels == COLOURS).all()


def test_lab_colours_are_refused():
    with pytest.raises(InvalidInputError, match="save it with RGB colours"):
        decode_image(saved(PIL.Image.new("LAB", (3, 3)), "TIFF"))


def test_jpeg_is_read():
    data = saved(PIL.Image.fromarray(np.full((8, 8), 128, np.uint8)), "JPEG")
    assert abs(decode_image(data).pixels.astype(int) - 128).max() <= 2


def test_16_bits_are_scaled_to_8():
    deep = PIL.Image.fromarray(GREY.astype(np.uint16) * 257)
    assert (decode_image(saved(deep, "PNG")).pixels == GREY).all()


def test_transparent_parts_are_white_paper():
    pixels = np.zeros((1, 3, 4), np.uint8)
    pixels[0, :, 3] = [255, 0, 128]
    data = saved(PIL.Image.fromarray(pixels), "PNG")
    assert decode_image(data).pixels.tolist() == [[0, 255, 127]]


def test_a_photograph_is_turned_the_way_the_camera_was_held():
    exif = PIL.Image.Exif()
    exif[0x0112] = 6  # the camera was turned to the left: rotate by 90° clockwise
    data = saved(PIL.Image.fromarray(GREY), "PNG", exif=exif)
    assert (decode_image(data).pixels == np.rot90(GREY, -1)).all()


@pytest.mark.parametrize("cut", [0, 1, 9, 40, -30])
def test_every_broken_picture_is_refused(cut):
    noise = np.random.default_rng(0).integers(0, 255, (32, 32), dtype=np.uint8)
    data = saved(PIL.Image.fromarray(noise), "PNG")[:cut]
    with pytest.raises(InvalidInputError) as caught:
        decode_image(data)
    assert (caught.value.field, caught.value.reason) == ("data", Reason.INVALID_IMAGE)
    assert "; " in caught.value.problem


def test_floating_point_pixels_are_refused():
    data = saved(PIL.Image.fromarray(GREY.astype(np.float32)), "TIFF")
    with pytest.raises(InvalidInputError, match="save it with 8 or 16 bits a channel"):
        decode_image(data)


def test_a_file_is_read_by_its_suffix(tmp_path):
    path = tmp_path / "Sketch.PNG"
    path.write_bytes(saved(PIL.Image.fromarray(GREY), "PNG"))
    source = read_source(str(path))
    assert isinstance(source, Image)
    assert (source.pixels == GREY).all()
