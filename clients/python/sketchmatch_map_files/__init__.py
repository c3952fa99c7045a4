"""The files of a robot's map: finding them, and reading its YAML and its corrected objects.

Client and engine read them here alike, and as ROS does. Its reader, yaml-cpp, keeps every value as
the text that is written, and who asks for a number gets one; so nothing depends on whether YAML
1.1 or 1.2 would take ``on``, ``010`` or ``1:30`` for something else. Of a key that stands twice the
first counts, and of several documents the first. Unlike there, ``~`` is no name of a file, and
``<<`` brings in the keys of another.
"""

from __future__ import annotations

import codecs
import os
import stat
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path, PureWindowsPath
from typing import Any

__all__ = [
    "OBJECTS_SUFFIX",
    "PICTURE_SUFFIXES",
    "YAML_SUFFIXES",
    "Document",
    "MapFileError",
    "content_of",
    "find_objects",
    "find_picture",
    "find_yaml",
    "is_of",
    "parse",
    "text_of",
]

YAML_SUFFIXES = (".yaml", ".yml")
"""Of the file that map_server is given."""
PICTURE_SUFFIXES = (
    *(".bmp", ".gif", ".jpeg", ".jpg", ".pbm", ".pgm"),
    *(".png", ".pnm", ".ppm", ".tif", ".tiff", ".webp"),
)
"""Of pictures that may be a map's."""

MOST_BYTES = 64 * 1024
"""Of a YAML file; a map's has some hundred, and PyYAML alone takes half a minute for a megabyte."""

# A folder of more is no map's.
_MOST_FILES = 200
_MOST_NAMED = 5


class MapFileError(Exception):
    """A map's files cannot be used as they are.

    Parameters
    ----------
    problem
        What is wrong and what would help, to be read after the file's or the key's name.
    reason
        A name of ``sketchmatch.v1.ErrorReason`` without its prefix.
    """

    def __init__(self, problem: str, reason: str = "INVALID_FILE") -> None:
        super().__init__(problem)
        self.problem = problem
        self.reason = reason


@dataclass(frozen=True, eq=False)
class Document:
    """What stands in a map's YAML.

    Attributes
    ----------
    values
        By key: texts, lists and dicts of them, and None for a key without a value.
    repeated
        By key the values with which it stands there again, where they are others.
    """

    values: Mapping[str, Any]
    repeated: Mapping[str, tuple[Any, ...]]

    @property
    def images(self) -> tuple[str, ...]:
        """Names of the picture; the first is what counts."""
        names = (self.values.get("image"), *self.repeated.get("image", ()))
        return tuple(name for name in names if _is_name(name)) if _is_name(names[0]) else ()


def text_of(data: bytes) -> str:
    """Decode a YAML file, with a byte order mark or without.

    Raises
    ------
    MapFileError
        If it is no text.
    """
    wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        return data.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError:
        raise MapFileError("is not UTF-8 text; save it as UTF-8") from None


@lru_cache(maxsize=1)
def parse(text: str) -> Document:
    """Read the text of a map's YAML; who reads the same text next is given what was found.

    Raises
    ------
    MapFileError
        If it is no YAML, has types of its own, or is too large, too deep or repeats itself
        without end.
    """
    from sketchmatch_map_files._reader import read_document

    return read_document(text.removeprefix("\ufeff"))


def find_yaml(path: Path) -> tuple[Path, tuple[str, ...]] | None:
    """Return the YAML file of a map, and what there is to say of how it was found.

    Parameters
    ----------
    path
        Of that file, of the picture that one beside it names, or of the folder that holds one map.

    Returns
    -------
    tuple or None
        None where a path leads to no map.

    Raises
    ------
    MapFileError
        If a folder holds no map, or if it could be one of several.
    """
    if os.path.isdir(path):  # noqa: PTH112 (no error)
        file = _yaml_in(path)
        return file, (f"{path} is a folder, and its map {file.name} was read",)
    suffix = path.suffix.lower()
    if suffix in YAML_SUFFIXES:
        return path, ()
    if suffix in PICTURE_SUFFIXES and (named := _yaml_of(path)) is not None:
        return named, (f"{path.name} is the picture of a map, and {named.name} beside it was read",)
    return None


def find_picture(file: Path, document: Document) -> tuple[Path, tuple[str, ...]]:
    """Return the picture of a map, and what there is to say of how it was found.

    Where none is at the place that is named, as on another machine than the one that saved it, one
    of that name beside the YAML file is taken.

    Parameters
    ----------
    file
        The YAML file.
    document
        What stands in it; at least one image.
    """
    named = file.parent / document.images[0]
    if _is_file(named):
        if len(document.images) == 1:
            return named, ()
        return named, (f"{file.name} has image twice, and the first, {named.name}, was used",)
    for image in document.images:
        # A name from Windows has backslashes, which are letters elsewhere; this knows both.
        beside = file.parent / (PureWindowsPath(image.strip()).name or image)
        if _is_file(beside):
            return beside, (
                f"the map's image {_shown(document.images[0])} does not exist, and {beside.name} "
                f"beside {file.name} was used",
            )
    return named, ()


def _yaml_in(folder: Path) -> Path:
    """Return the one YAML file in a folder that describes a map."""
    try:
        found = [file for file in _yamls(folder) if _document_of(file) is not None]
    except OSError as error:
        problem = f"cannot be read ({str(error.strerror).lower()})"
        raise MapFileError(f"{problem}; check the folder's permissions") from None
    if not found:
        raise MapFileError("is a folder without a map; give the .yaml that map_server saved")
    if len(found) > 1:
        raise MapFileError(f"is a folder with several maps; give one of them: {_named(found)}")
    return found[0]


def _yaml_of(picture: Path) -> Path | None:
    """Return the YAML file beside a picture that names it; None if there is none.

    Of several the one that is called as the picture is counts.
    """
    try:
        found = [file for file in _yamls(picture.parent) if _names(file, picture)]
    except (OSError, ValueError):
        return None
    own = [file for file in found if file.stem == picture.stem]
    if len(found) > 1 and not own:
        raise MapFileError(f"is the picture of several maps; give one of them: {_named(found)}")
    return next(iter(own or found), None)


def _yamls(folder: Path) -> list[Path]:
    files = sorted(file for file in folder.iterdir() if file.suffix.lower() in YAML_SUFFIXES)
    return files[:_MOST_FILES]


def _names(file: Path, picture: Path) -> bool:
    """Whether a YAML file is a map's, and the picture the one that it names."""
    document = _document_of(file)
    if document is None:
        return False
    try:
        return find_picture(file, document)[0].samefile(picture)
    except (OSError, ValueError):
        return False


def _document_of(file: Path) -> Document | None:
    """Return what stands in a map's YAML; None where the file is something else."""
    try:
        if not _is_file(file) or file.stat().st_size > MOST_BYTES:
            return None
        data = file.read_bytes()
        # Most others are told from it before they are parsed; UTF-16 has zeros between.
        if b"image" not in data.replace(b"\0", b""):
            return None
        document = parse(text_of(data))
    except (MapFileError, OSError):
        return None
    return document if document.images and "resolution" in document.values else None


def _is_name(value: object) -> bool:
    return isinstance(value, str) and bool(value.strip()) and "\0" not in value


def _is_file(path: Path) -> bool:
    try:
        return stat.S_ISREG(path.stat().st_mode)
    except (OSError, ValueError):
        return False


def _named(files: list[Path]) -> str:
    more = ", …" if len(files) > _MOST_NAMED else ""
    return ", ".join(file.name for file in files[:_MOST_NAMED]) + more


def _shown(name: str) -> str:
    return name if name.isprintable() and len(name) <= 200 else repr(name[:200])


# It needs what is defined above.
from sketchmatch_map_files._objects import (  # noqa: E402
    OBJECTS_SUFFIX,
    content_of,
    find_objects,
    is_of,
)
