"""Pictures of maps and sketches: PNG, JPEG, WebP, GIF, BMP, TIFF, netpbm (PGM, PPM, PBM)."""

from __future__ import annotations

import struct
from contextlib import suppress
from io import BytesIO
from typing import Any

import numpy as np
import PIL.BmpImagePlugin
import PIL.GifImagePlugin
import PIL.Image
import PIL.ImageChops
import PIL.ImageOps
import PIL.JpegImagePlugin
import PIL.PngImagePlugin
import PIL.PpmImagePlugin
import PIL.TiffImagePlugin
import PIL.WebPImagePlugin
from numpy.typing import NDArray

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import Image
from sketchmatch.model.limits import check_bytes, check_pixels

__all__ = ["decode_image", "load_picture", "scaled_to_8_bits"]

_FORMATS = ("PNG", "JPEG", "WEBP", "GIF", "BMP", "TIFF", "PPM")
_GREY = ("1", "L", "LA", "La")

# Pixels whose channels differ by this much are in colour; fewer than this share are blemishes.
_COLOURED = 24
_LEAST_COLOUR = 2e-4
# Ink shows on white paper if it is darker by so much in a channel.
_VISIBLE = 64
# Pixels that are looked at together.
_STRIP = 1 << 20

_SEVERAL = (
    "The file has several pages or frames, of which only the first was read: save another one as "
    "a file of its own to use it."
)


def decode_image(data: bytes) -> Image:
    """Decode a picture of a map or of a sketch, in grey unless it has colours.

    Faint tints become their luminance, and a photograph is turned the way its camera was held (EXIF
    orientation). What is transparent is white paper, whatever colour lies under it, and ink that
    could not be seen on that, as white chalk on nothing, becomes its negative.

    Parameters
    ----------
    data
        A whole PNG, JPEG, WebP, GIF, BMP, TIFF, PGM, PPM or PBM file; of several pictures the
        first, which the picture's notes say.

    Raises
    ------
    InvalidInputError
        With the path ``data``, if it is no such file, is damaged or cut short, or announces more
        pixels than :func:`sketchmatch.model.limits.source_limits` allows.
    """
    loaded = load_picture(data, "data")
    notes = (_SEVERAL,) if getattr(loaded, "is_animated", False) else ()
    picture = _upright(scaled_to_8_bits(loaded, "data"))
    if picture.has_transparency_data:
        picture = _on_paper(np.array(picture.convert("RGBA")))
    if picture.mode in _GREY:
        return Image(np.asarray(picture.convert("L")), notes)
    if picture.mode != "RGB":
        picture = picture.convert("RGB")
    return Image(np.asarray(picture if _has_colour(picture) else picture.convert("L")), notes)


def _on_paper(pixels: NDArray[np.uint8]) -> PIL.Image.Image:
    """Return a picture, shape (rows, columns, 4), on white paper, mode RGBA.

    Each connected piece that is white or nearly so everywhere is drawn in its negative: it has
    fewer pixels that show on the paper than the outline of a white shape would have.
    """
    opacity = pixels[:, :, 3]
    inked = opacity >= max(1, int(opacity.max()) // 2)
    if not inked.all():
        import cv2  # which pictures without transparency do without

        count, pieces = cv2.connectedComponents(inked.astype(np.uint8), connectivity=8)
        shown = inked & (pixels[:, :, :3].min(axis=2) <= 255 - _VISIBLE)
        sizes = np.bincount(pieces.ravel(), minlength=count)
        pale = np.bincount(pieces[shown], minlength=count) < np.sqrt(sizes)
        pale[0] = False
        pixels[:, :, :3][pale[pieces]] ^= 255
    paper = PIL.Image.new("RGBA", pixels.shape[1::-1], "white")
    paper.alpha_composite(PIL.Image.fromarray(pixels))
    return paper


def _has_colour(picture: PIL.Image.Image) -> bool:
    """Return whether enough of a picture, mode RGB, is neither grey nor nearly so."""
    width, height = picture.size
    least, coloured, rows = _LEAST_COLOUR * width * height, 0, max(1, _STRIP // width)
    for top in range(0, height, rows):
        red, green, blue = picture.crop((0, top, width, min(height, top + rows))).split()
        light = PIL.ImageChops.lighter(PIL.ImageChops.lighter(red, green), blue)
        dark = PIL.ImageChops.darker(PIL.ImageChops.darker(red, green), blue)
        coloured += sum(PIL.ImageChops.subtract(light, dark).histogram()[_COLOURED:])
        if coloured > least:
            return True
    return False


def load_picture(data: bytes, field: str) -> PIL.Image.Image:
    """Decode a picture as it is; ``field`` is the path that an error names.

    Raises
    ------
    InvalidInputError
        As :func:`decode_image` does.
    """
    check_bytes(len(data), field)
    # Pillow's decoders raise whatever a broken file makes them stumble over.
    try:
        picture = _announced(data)
        if picture is not None:
            check_pixels(*picture.size, field)
            picture.load()
            if picture.mode == "LAB":
                raise _invalid(field, "has Lab colours; save it with RGB colours or in grey")
            return picture
    except InvalidInputError:
        raise
    except Exception as error:
        cause = " ".join(str(error).split()) or type(error).__name__
        raise _invalid(
            field, f"is damaged or cut short ({cause}); save the picture again"
        ) from None
    raise _invalid(field, "is not a picture; give a PNG, JPEG, WebP, GIF, BMP, TIFF or PGM file")


def _announced(data: bytes) -> PIL.Image.Image | None:
    """Return a picture of which the header alone is read, or None if it is of no known format.

    ``PIL.Image.open`` does the same, but refuses pictures above a limit of its own.
    """
    for name in _FORMATS:
        factory, accept = PIL.Image.OPEN[name]
        if accept is None or accept(data[:16]) is True:
            with suppress(SyntaxError, IndexError, TypeError, struct.error):
                return factory(BytesIO(data), "")
    return None


def _upright(picture: PIL.Image.Image) -> PIL.Image.Image:
    """Return a photograph turned the way its camera was held, if it says so legibly."""
    try:
        return PIL.ImageOps.exif_transpose(picture)
    except Exception:  # as in load_picture; the pixels are whole
        return picture


def scaled_to_8_bits(picture: PIL.Image.Image, field: str) -> PIL.Image.Image:
    """Return the picture with 8 bits a channel; ``field`` is the path that an error names."""
    if picture.mode == "F":
        raise _invalid(field, "has floating-point pixels; save it with 8 or 16 bits a channel")
    if not picture.mode.startswith("I"):
        return picture
    deep: NDArray[Any] = np.clip(np.asarray(picture), 0, 65535).astype(np.uint32)
    return PIL.Image.fromarray(((deep + 128) // 257).astype(np.uint8))


def _invalid(field: str, problem: str) -> InvalidInputError:
    return InvalidInputError(Reason.INVALID_IMAGE, field, problem)
