"""From a path to the two files of a robot's map: by either, or by the folder they are in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.io.ros_bag import is_bag
from sketchmatch.model import OccupancyGrid
from sketchmatch_map_files import (
    MapFileError,
    content_of,
    find_objects,
    find_picture,
    find_yaml,
    parse,
    text_of,
)

if TYPE_CHECKING:
    from sketchmatch.io.ros_map import MapServerHeader

__all__ = ["MapFiles", "map_files"]

_LONGEST_NAME = 500


class MapFiles(NamedTuple):
    """The files of a robot's map as they are.

    Attributes
    ----------
    yaml
        The text of the YAML file.
    picture
        The bytes of the picture.
    notes
        What there is to say of how they were found, each one sentence.
    objects
        The text of the file that says what the objects are; empty if there is none.
    """

    yaml: str
    picture: bytes
    notes: tuple[str, ...]
    objects: str = ""

    @property
    def content(self) -> str:
        """By what the file with its objects knows the map."""
        return content_of(parse(self.yaml), self.picture)

    def grid(self) -> OccupancyGrid:
        """Return the occupancy grid in them, with these notes before its own.

        Raises
        ------
        InvalidInputError
            With the path ``image`` or ``objects``, if the picture or the objects cannot be read.
        """
        from sketchmatch.io.map_objects import with_objects

        grid = with_objects(_header(self.yaml).grid(self.picture), self.objects, self.content)
        return replace(grid, notes=(*self.notes, *grid.notes))


def map_files(path: Path, read: Callable[[Path, str], bytes]) -> MapFiles | None:
    """Read the files of a robot's map, if a path leads to one.

    Parameters
    ----------
    path
        Of the YAML file; or of the picture that a YAML beside it names; or of a picture that
        looks as map_server saves them, which gets a YAML; or of the folder of a map.
    read
        Returns the bytes of a file, given also what an error begins with.

    Returns
    -------
    MapFiles or None
        None for every other kind of file.

    Raises
    ------
    InvalidInputError
        If there is a map, but several, or its YAML or its picture cannot be read or be used.
    """
    try:
        found = None if is_bag(path) else find_yaml(path)
        if found is None:
            return _bare_map(path, read) if path.suffix.lower() == ".pgm" else None
        file, notes = found
        text = text_of(read(file, str(path)))
        document = parse(text)
    except MapFileError as error:
        raise InvalidInputError(Reason(error.reason), "", error.problem) from None
    try:
        _header(text)
    except InvalidInputError as error:
        if file == path:
            raise
        raise InvalidInputError(
            error.reason, f"{file.name}: {error.field}".rstrip(": "), error.problem
        ) from None
    picture, more = find_picture(file, document)
    name = str(picture)
    shown = (
        name if name.isprintable() and len(name) <= _LONGEST_NAME else quoted(document.images[0])
    )
    data = read(picture, f"{path}: image {shown}")
    objects, said = find_objects(file, document, data)
    return MapFiles(text, data, (*notes, *more, *said), objects or "")


# NumPy, Pillow and PyYAML wait until there is a map.


def _bare_map(path: Path, read: Callable[[Path, str], bytes]) -> MapFiles | None:
    from sketchmatch.io.ros_map import header_for

    picture = read(path, str(path))
    made = header_for(path.name, picture)
    if made is None:
        return None
    objects, said = find_objects(path, parse(made[0]), picture)
    return MapFiles(made[0], picture, (made[1], *said), objects or "")


def _header(text: str) -> MapServerHeader:
    from sketchmatch.io.ros_map import parse_header

    return parse_header(text)
