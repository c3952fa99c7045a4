"""One door for every kind of file: from a path to a source."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io.geojson import decode_geojson
from sketchmatch.io.stroke_json import decode_strokes
from sketchmatch.model import Source

__all__ = ["MAX_BYTES", "read_source"]

MAX_BYTES = 256 * 1024 * 1024
"""A larger file is refused unread."""


def read_source(path: str | Path) -> Source:
    """Read a sketch or a map; the file's suffix tells what it is.

    Parameters
    ----------
    path
        ``.svg`` or ``.json`` strokes, ``.geojson`` polygons, ``.yaml`` of a ROS map with its
        picture beside it, or a picture (``.png``, ``.jpg``, ``.bmp``, ``.tif``, ``.pgm`` …).

    Returns
    -------
    StrokeSet, PolygonSet, OccupancyGrid or Image
        What it holds.

    Raises
    ------
    InvalidInputError
        In one sentence that begins with the path, if the file is missing, of no known kind,
        or its contents cannot be used.
    """
    path = Path(path)
    decode = _DECODERS.get(path.suffix.lower())
    if decode is None:
        kinds = " ".join(sorted(_DECODERS))
        raise _invalid(str(path), f"is of no known kind; give a file that ends in one of {kinds}")
    try:
        return decode(path, _read(path, str(path)))
    except InvalidInputError as error:
        if error.field.startswith(str(path)):
            raise
        # A picture is all data: there is no place in it to name.
        place = f"{path}: {error.field}" if error.field not in ("", "data") else str(path)
        raise InvalidInputError(error.reason, place, error.problem) from None


def _read(path: Path, field: str) -> bytes:
    """Return a file's bytes; ``field`` is what an error begins with."""
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise _invalid(field, "does not exist; check the path") from None
    except IsADirectoryError:
        raise _invalid(field, "is a directory; give a file in it") from None
    except (OSError, ValueError) as error:
        cause = getattr(error, "strerror", None) or str(error)
        raise _invalid(field, f"cannot be read ({cause.lower()}); check the path") from None
    if len(data) > MAX_BYTES:
        limit = MAX_BYTES // 1024**2
        raise InvalidInputError(
            Reason.LIMIT_EXCEEDED, field, f"is larger than the limit of {limit} MiB; reduce it"
        )
    return data


def _text(data: bytes) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise _invalid("", "is not UTF-8 text; save it as UTF-8") from None


# The libraries behind some kinds are slow to import, so they wait until such a file is read.


def _map_server(path: Path, data: bytes) -> Source:
    from sketchmatch.io.ros_map import parse_header

    header = parse_header(_text(data))
    picture = path.parent / header.image
    return header.grid(_read(picture, f"{path}: image {picture}"))


def _picture(_: Path, data: bytes) -> Source:
    from sketchmatch.io.images import decode_image

    return decode_image(data)


def _svg(_: Path, data: bytes) -> Source:
    from sketchmatch.io.svg import decode_svg

    return decode_svg(data)


def _strokes(_: Path, data: bytes) -> Source:
    return decode_strokes(_text(data))


def _polygons(_: Path, data: bytes) -> Source:
    return decode_geojson(_text(data))


def _invalid(field: str, problem: str) -> InvalidInputError:
    return InvalidInputError(Reason.INVALID_FILE, field, problem)


_DECODERS: dict[str, Callable[[Path, bytes], Source]] = {
    ".svg": _svg,
    ".json": _strokes,
    ".geojson": _polygons,
    **dict.fromkeys((".yaml", ".yml"), _map_server),
    **dict.fromkeys(
        (".bmp", ".jpeg", ".jpg", ".pbm", ".pgm", ".png", ".pnm", ".ppm", ".tif", ".tiff"),
        _picture,
    ),
}
