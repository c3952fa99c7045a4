"""Where something is wrong, in the words of the person at the terminal: in which file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch_client import InvalidRequestError
from sketchmatch_map_files import OBJECTS_SUFFIX

__all__ = ["places_in"]

_KINDS = ("stroke_set", "polygon_set", "occupancy_grid", "map_server_map", "image", "file")
_WHOLE = ("", "cells", "pixels", "data", "yaml")
_ABOUT_PICTURES = ("INVALID_IMAGE", "LIMIT_EXCEEDED")


def _with_objects(map_: Path) -> Path:
    """Return the file with a map's objects: the one of its name, of which most faults are."""
    return map_.with_name(f"{map_.stem}{OBJECTS_SUFFIX}") if map_.suffix else map_


@contextmanager
def places_in(**files: Path) -> Iterator[None]:
    """Turn paths of errors into places in files.

    Parameters
    ----------
    **files
        The file of each source in the request, e.g. ``sketch=Path("sketch.json")``:
        ``sketch.stroke_set.strokes[3]`` becomes ``sketch.json: strokes[3]``.
    """
    try:
        yield
    except (InvalidInputError, InvalidRequestError) as error:
        side, _, path = error.field.partition(".")
        kind, _, place = path.partition(".")
        if side not in files or kind not in _KINDS:
            raise
        problem = str(error).removeprefix(error.field).lstrip()
        place = place.removeprefix("yaml.")
        # What is found in a map's picture, or is not, is found in the map.
        whole = place in _WHOLE or (place == "image" and error.reason not in _ABOUT_PICTURES)
        file = files[side]
        if kind == "map_server_map" and place.partition(".")[0] == "objects":
            file, place = _with_objects(file), place.partition(".")[2]
            whole = not place
        field = str(file) if whole else f"{file}: {place}"
        raise InvalidInputError(Reason(error.reason), field, problem) from None
