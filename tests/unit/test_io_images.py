"""Pictures of sketches: formats, transparency, depth, orientation, broken files."""

import io

import numpy as np
import PIL.Image
import pytest

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io import read_source
from sketchmatch.io.images import decode_image
from sketchmatch.model import Image

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
