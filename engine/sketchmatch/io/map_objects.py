"""What people say a robot's map has for objects, in a file beside it."""

from __future__ import annotations

from dataclasses import replace

from sketchmatch.api.documents import load_json
from sketchmatch.errors import InvalidInputError
from sketchmatch.io.geojson import polygons_of
from sketchmatch.model import OccupancyGrid
from sketchmatch_map_files import is_of

__all__ = ["with_objects"]


def with_objects(grid: OccupancyGrid, objects: str, content: str) -> OccupancyGrid:
    """Return a grid with the objects that a file says it has, if it is one of this content.

    Parameters
    ----------
    grid
        A map of the content.
    objects
        The text of the file, GeoJSON; empty if there is none.
    content
        What it has to say that it is of.

    Raises
    ------
    InvalidInputError
        With the path ``objects``, if it cannot be read.
    """
    if not objects:
        return grid
    try:
        features = load_json(objects)
        if not is_of(features, content):
            note = "the file with objects is of another content of the map and was ignored"
            return replace(grid, notes=(*grid.notes, note))
        # Metres of the map's frame, whatever a tool says that they are.
        return replace(grid, objects=polygons_of({**features, "crs": None}))
    except InvalidInputError as error:
        raise error.within("objects") from None
