"""Pictures of maps and sketches: PNG, JPEG, BMP, TIFF and netpbm (PGM, PPM, PBM)."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np
import PIL.Image
import PIL.ImageOps
from numpy.typing import NDArray

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import Image

__all__ = ["MAX_PIXELS", "decode_image", "load_picture", "scaled_to_8_bits"]

MAX_PIXELS = 64_000_000
"""A picture that announces more pixels is refused before any of them is decoded."""

_FORMATS = ("PNG", "JPEG", "BMP", "TIFF", "PPM")


def decode_image(data: bytes) -> Image:
    """Decode a picture of a map or of a sketch as grey.

    Colours become their luminance, transparent parts white paper, and a photograph is turned the
    way its camera was held (EXIF orientation).

    Parameters
    ----------
    data
        A whole PNG, JPEG, BMP, TIFF, PGM, PPM or PBM file.

    Raises
    ------
    InvalidInputError
        With the path ``data``, if it is no such file, is damaged or cut short, or has more than
        :data:`MAX_PIXELS` pixels.
    """
    picture = PIL.ImageOps.exif_transpose(scaled_to_8_bits(load_picture(data, "data"), "data"))
    if picture.has_transparency_data:
        paper = PIL.Image.new("RGBA", picture.size, "white")
        paper.alpha_composite(picture.convert("RGBA"))
        picture = paper
    return Image(np.asarray(picture.convert("L")))


def load_picture(data: bytes, field: str) -> PIL.Image.Image:
    """Decode a picture as it is; ``field`` is the path that an error names.

    Raises
    ------
    InvalidInputError
        As :func:`decode_image` does.
    """
    # Pillow's decoders raise whatever a broken file makes them stumble over.
    try:
        picture = PIL.Image.open(BytesIO(data), formats=_FORMATS)
        width, height = picture.size
        if width * height <= MAX_PIXELS:
            picture.load()
            return picture
    except PIL.UnidentifiedImageError:
        raise _invalid(field, "is not a picture; give a PNG, JPEG, BMP, TIFF or PGM file") from None
    except (PIL.Image.DecompressionBombError, PIL.Image.DecompressionBombWarning):
        raise _too_large(field, "has") from None
    except Exception as error:
        raise _invalid(
            field, f"is damaged or cut short ({error}); save the picture again"
        ) from None
    raise _too_large(field, f"has {width} × {height} pixels,")


def scaled_to_8_bits(picture: PIL.Image.Image, field: str) -> PIL.Image.Image:
    """Return the picture with 8 bits a channel; ``field`` is the path that an error names."""
    if picture.mode == "F":
        raise _invalid(field, "has floating-point pixels; save it with 8 or 16 bits a channel")
    if not picture.mode.startswith("I"):
        return picture
    deep: NDArray[Any] = np.clip(np.asarray(picture), 0, 65535).astype(np.uint32)
    return PIL.Image.fromarray(((deep + 128) // 257).astype(np.uint8))


def _too_large(field: str, size: str) -> InvalidInputError:
    limit = MAX_PIXELS // 1_000_000
    return InvalidInputError(
        Reason.LIMIT_EXCEEDED,
        field,
        f"{size} more than the limit of {limit} million pixels; scale it down",
    )


def _invalid(field: str, problem: str) -> InvalidInputError:
    return InvalidInputError(Reason.INVALID_IMAGE, field, problem)
