"""One door for every kind of file: from a path to a source."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io.geojson import decode_geojson
from sketchmatch.io.map_files import MapFiles, map_files
from sketchmatch.io.ros_bag import SUFFIXES, bag_and_topic, is_bag, read_bag
from sketchmatch.io.stroke_json import decode_strokes
from sketchmatch.model import Source
from sketchmatch.model.limits import check_bytes, check_source, source_limits
from sketchmatch_map_files import PICTURE_SUFFIXES, YAML_SUFFIXES

__all__ = ["PICTURE_SUFFIXES", "read_bytes", "read_map_files", "read_source"]


def read_source(path: str | Path) -> Source:
    """Read a sketch or a map; the file's suffix tells what it is.

    Parameters
    ----------
    path
        ``.svg`` or ``.json`` strokes, ``.geojson`` polygons, ``.yaml`` of a ROS map with its
        picture beside it, that picture or the folder of both, another picture (``.png``, ``.jpg``,
        ``.bmp``, ``.tif``, ``.pgm`` …), or a ROS bag (``.bag``, ``.mcap``, ``.db3`` or a folder),
        as :mod:`sketchmatch.io.ros_bag` tells.

    Returns
    -------
    StrokeSet, PolygonSet, OccupancyGrid or Image
        What it holds.

    Raises
    ------
    InvalidInputError
        In one sentence that begins with the path, if the file is missing, of no known kind,
        too large, or its contents cannot be used.
    """
    path = Path(path)
    with _placed_in(path):
        source = _decoded(path)
        check_source(source)
        return source


def read_bytes(path: Path) -> bytes:
    """Read a plain file as it is.

    Raises
    ------
    InvalidInputError
        In one sentence that begins with the path, if it is missing or too large.
    """
    return _read(path, str(path))


def read_map_files(path: Path) -> MapFiles | None:
    """Read the two files of a robot's map, if a path leads to one.

    Parameters
    ----------
    path
        Of the YAML file; or of the picture that a YAML beside it names; or of a picture that
        looks as map_server saves them, which gets a YAML; or of the folder of a map.

    Returns
    -------
    MapFiles or None
        None for every other kind of file.

    Raises
    ------
    InvalidInputError
        As :func:`read_source` does, but for what is wrong with the picture.
    """
    with _placed_in(path):
        return map_files(path, _read)


def _decoded(path: Path) -> Source:
    bag, topic = bag_and_topic(path)
    if is_bag(bag):
        return read_bag(bag, topic)
    if (files := map_files(path, _read)) is not None:
        return files.grid()
    decode = _DECODERS.get(path.suffix.lower())
    if decode is None:
        kinds = " ".join(sorted((*_DECODERS, *YAML_SUFFIXES, *SUFFIXES)))
        raise _invalid(str(path), f"is of no known kind; give a file that ends in one of {kinds}")
    return decode(path, _read(path, str(path)))


@contextmanager
def _placed_in(path: Path) -> Iterator[None]:
    """Let what is said of a file's contents begin with the file's path."""
    try:
        yield
    except InvalidInputError as error:
        if error.field.startswith(str(path)):
            raise
        # A picture is all data: there is no place in it to name.
        place = f"{path}: {error.field}" if error.field not in ("", "data") else str(path)
        raise InvalidInputError(error.reason, place, error.problem) from None


def _read(path: Path, field: str) -> bytes:
    """Return a file's bytes; ``field`` is what an error begins with."""
    try:
        # Devices and pipes would be endless, or wait for a writer.
        if stat.S_IFMT(path.stat().st_mode) not in (stat.S_IFREG, stat.S_IFDIR):
            raise _invalid(field, "is no plain file; give one")
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            check_bytes(size, field)
            data = file.read(source_limits().max_bytes + 1)
    except FileNotFoundError:
        raise _invalid(field, "does not exist; check the path") from None
    except IsADirectoryError:
        raise _invalid(field, "is a directory; give a file in it") from None
    except InvalidInputError:
        raise
    except (OSError, ValueError) as error:
        cause = getattr(error, "strerror", None) or str(error)
        raise _invalid(field, f"cannot be read ({cause.lower()}); check the path") from None
    check_bytes(len(data), field)
    return data


def _text(data: bytes) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise _invalid("", "is not UTF-8 text; save it as UTF-8") from None


# The libraries behind some kinds are slow to import, so they wait until such a file is read.


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
    **dict.fromkeys(PICTURE_SUFFIXES, _picture),
}
