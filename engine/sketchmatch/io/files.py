"""One door for every kind of file: from a path to a source."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from sketchmatch.api.documents import decode_text, listed, no_parts
from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.io.geojson import is_geojson, load_sequence, polygons_of
from sketchmatch.io.map_files import MapFiles, map_files
from sketchmatch.io.ros_bag import SUFFIXES, bag_and_topic, decode_bag, is_bag, read_bag
from sketchmatch.io.stroke_json import strokes_of
from sketchmatch.model import Image, OccupancyGrid, PolygonSet, Source, StrokeSet
from sketchmatch.model.limits import check_bytes, check_source, source_limits
from sketchmatch.registry import (
    RegisteredReader,
    default_registry,
    reader_by_keys,
    reader_by_name,
)
from sketchmatch_map_files import PICTURE_SUFFIXES, YAML_SUFFIXES

__all__ = [
    "JSON_SUFFIXES",
    "FileKind",
    "decode_file",
    "file_and_part",
    "kind_of_file",
    "read_bytes",
    "read_here",
    "read_map_files",
    "read_source",
]

JSON_SUFFIXES = (".geojson", ".geojsonl", ".json", ".ndjson")
_Readers = Sequence[RegisteredReader]


def read_source(path: str | Path, readers: _Readers | None = None) -> Source:
    """Read a sketch or a map; the file's suffix, and of JSON its content, tells what it is.

    Parameters
    ----------
    path
        ``.svg`` or ``.json`` strokes, ``.geojson`` polygons, ``.yaml`` of a ROS map with its
        picture beside it, that picture or the folder of both, another picture (``.png``, ``.jpg``,
        ``.bmp``, ``.tif``, ``.pgm`` …), a ROS bag (``.bag``, ``.mcap``, ``.db3`` or a folder), as
        :mod:`sketchmatch.io.ros_bag` tells, or what a plugin reads. After ``#`` it may say which
        part of the file: ``plan.dxf#walls``.
    readers
        Those of plugins; of all that are installed when left out.

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
    path = _as_path(path)
    with _placed_in(path):
        source = _decoded(path, readers)
        check_source(source)
        return source


def _as_path(given: Any) -> Path:
    """Return what is given as a path; an empty one would be the folder that we are in."""
    if not isinstance(given, str | os.PathLike):
        raise _invalid("path", f"is {quoted(given)}; give the path of a file")
    if not os.fspath(given):
        raise _invalid("path", "is empty; give the path of a file")
    return Path(given)


class FileKind(NamedTuple):
    """What a file is, before any of it is decoded.

    Attributes
    ----------
    source
        The type of source in it.
    reader
        The reader of a plugin that reads it, or None for what we read ourselves.
    document
        What is in it, if it is JSON.
    """

    source: type[Any]
    reader: RegisteredReader | None = None
    document: Any = None


def kind_of_file(name: str, data: bytes, readers: _Readers | None = None) -> FileKind:
    """Say what a file is by its name and, if it is JSON, by what is in it.

    Parameters
    ----------
    name
        Its name, of which the suffix counts.
    data
        The file.
    readers
        As in :func:`read_source`.

    Raises
    ------
    InvalidInputError
        If it is of no known kind: then it says what was seen, and what is known.
    """
    suffix = Path(name).suffix.lower()
    if suffix in _KINDS:
        return FileKind(_KINDS[suffix][0])
    if suffix in SUFFIXES:
        return FileKind(OccupancyGrid)
    if readers is None:
        readers = default_registry().readers
    named = reader_by_name(readers, name)
    if named is not None:
        return FileKind(named.reader.source, named)
    if suffix in JSON_SUFFIXES:
        return _kind_of_document(load_sequence(decode_text(data)), readers)
    if suffix in YAML_SUFFIXES:
        raise _invalid(
            "",
            "is the YAML of a map or a bag, which has more files than this one; give its path, or "
            "send a map as map_server_map, and of a bag its .mcap or .db3",
        )
    raise _invalid(
        "", f"is of an unknown kind; give a file whose name ends in one of {_suffixes(readers)}"
    )


def read_here(path: Path) -> Source | None:
    """Read a sketch or a map as :func:`read_source` does, if that needs no plugin's reader.

    Returns
    -------
    Source or None
        None for every other kind of file; of JSON, what is in it decides.

    Raises
    ------
    InvalidInputError
        As :func:`read_source` does.
    """
    file, part = file_and_part(path)
    suffix = file.suffix.lower()
    if suffix not in JSON_SUFFIXES:
        known = suffix in (*_KINDS, *YAML_SUFFIXES) or is_bag(bag_and_topic(file)[0])
        return read_source(path) if known else None
    with _placed_in(path):
        data = _read(file, str(file))
        try:
            kind = kind_of_file(file.name, data, ())
        except InvalidInputError:
            return None
        return _of_kind(kind, file.name, data, part)


def decode_file(name: str, data: bytes, part: str = "", readers: _Readers | None = None) -> Source:
    """Return what is in a file; of what stands in its error, the path is one within the file.

    Parameters
    ----------
    name, data, readers
        As in :func:`kind_of_file`.
    part
        Which part of it, for kinds that have some, such as the topic of a bag; empty for all.

    Raises
    ------
    InvalidInputError
        If it is of no known kind, too large, or cannot be used.
    PluginError
        If a plugin's reader fails.
    """
    check_bytes(len(data), "data")
    return _of_kind(kind_of_file(name, data, readers), name, data, part)


def _of_kind(kind: FileKind, name: str, data: bytes, part: str) -> Source:
    """Return what is in a file of a known kind."""
    if kind.reader is not None:
        source: Source = kind.reader.read(data, part)
    elif kind.source is OccupancyGrid:
        source = decode_bag(Path(name).suffix.lower(), data, part)
    elif kind.source is PolygonSet:
        source = polygons_of(kind.document, part)
    else:
        no_parts(part)
        if kind.document is None:
            source = _KINDS[Path(name).suffix.lower()][1](data)
        else:
            source = strokes_of(kind.document)
    check_source(source)
    return source


def file_and_part(path: Path) -> tuple[Path, str]:
    """Split ``plan.dxf#walls`` into the file's path and the part, empty if none is named.

    A file that has such a name as a whole is that file.
    """
    text = str(path)
    if "#" not in text or path.exists():
        return path, ""
    for k in (k for k, c in enumerate(text) if c == "#"):
        if os.path.isfile(text[:k]):  # noqa: PTH113 (no error)
            return Path(text[:k]), text[k + 1 :]
    return path, ""


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
        return None if file_and_part(path)[1] else map_files(path, _read)


def _decoded(path: Path, readers: _Readers | None) -> Source:
    bag, topic = bag_and_topic(path)
    if is_bag(bag):
        return read_bag(bag, topic)
    file, part = file_and_part(path)
    if not part and (files := map_files(path, _read)) is not None:
        return files.grid()
    if file.suffix.lower() in YAML_SUFFIXES:
        no_parts(part)
    return decode_file(file.name, _read(file, str(file)), part, readers)


def _kind_of_document(document: Any, readers: _Readers) -> FileKind:
    """Say what a JSON document is by its keys."""
    if is_geojson(document):
        return FileKind(PolygonSet, document=document)
    if isinstance(document, dict):
        if "strokes" in document:
            return FileKind(StrokeSet, document=document)
        reader = reader_by_keys(readers, document)
        if reader is not None:
            return FileKind(reader.reader.source, reader, document)
    known = "; ".join(
        [
            'strokes as {"y_axis": …, "strokes": […]}',
            "GeoJSON with its type",
            *(
                f"{each.name} with {listed(each.reader.keys)}"
                for each in readers
                if each.reader.keys
            ),
        ]
    )
    raise _invalid("", f"is JSON of an unknown kind ({_seen(document)}); known are {known}")


def _seen(document: Any) -> str:
    """Say in a few words what a JSON document is."""
    if isinstance(document, dict):
        kind = document.get("type")
        typed = f" and type {quoted(kind)}" if isinstance(kind, str) else ""
        return f"an object with {listed(document)}{typed}" if document else "an empty object"
    if isinstance(document, list) and document and isinstance(document[0], dict):
        return f"a list of {len(document)}, the first an object with {listed(document[0])}"
    return f"a list of {len(document)}" if isinstance(document, list) else quoted(document)


def _suffixes(readers: _Readers) -> str:
    others = (suffix for each in readers for suffix in each.reader.suffixes)
    return " ".join(sorted({*_KINDS, *JSON_SUFFIXES, *YAML_SUFFIXES, *SUFFIXES, *others}))


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
            raise _invalid(field, "is not a regular file; give one")
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


# The libraries behind some kinds are slow to import, so they wait until such a file is read.


def _picture(data: bytes) -> Source:
    from sketchmatch.io.images import decode_image

    return decode_image(data)


def _svg(data: bytes) -> Source:
    from sketchmatch.io.svg import decode_svg

    return decode_svg(data)


def _invalid(field: str, problem: str) -> InvalidInputError:
    return InvalidInputError(Reason.INVALID_FILE, field, problem)


_KINDS: dict[str, tuple[type[Source], Callable[[bytes], Source]]] = {
    ".svg": (StrokeSet, _svg),
    **dict.fromkeys(PICTURE_SUFFIXES, (Image, _picture)),
}
