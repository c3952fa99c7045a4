"""What people say a robot's map has for objects, in a file beside it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import shapely

from sketchmatch.api.documents import load_json
from sketchmatch.errors import InvalidInputError
from sketchmatch.io.geojson import polygons_of
from sketchmatch.model import LabelledPolygon, OccupancyGrid, PolygonSet
from sketchmatch_map_files import is_of

__all__ = ["with_objects"]


def with_objects(grid: OccupancyGrid, objects: str, content: str | None) -> OccupancyGrid:
    """Return a grid with the objects that a file says it has, if it is one of this content.

    Coordinates are metres in the map's frame, whatever a tool says that they are. A feature of
    several polygons, which is what tools make of some that are merged, is one object with the
    outline around all.

    Parameters
    ----------
    grid
        A map of the content.
    objects
        The text of the file, GeoJSON; empty if there is none.
    content
        What it has to say that it is of; None: it is of this map, whatever it says.

    Raises
    ------
    InvalidInputError
        With the path ``objects``, if it cannot be read.
    """
    if not objects:
        return grid
    try:
        features = load_json(objects)
        if content is not None and not is_of(features, content):
            note = "the file with objects was made for an earlier state of the map and was ignored"
            return replace(grid, notes=(*grid.notes, note))
        return replace(grid, objects=_objects_of({**features, "crs": None}))
    except InvalidInputError as error:
        raise error.within("objects") from None


def _objects_of(collection: dict[str, Any]) -> PolygonSet:
    found = polygons_of(collection)  # which says what is wrong, and where
    members = collection.get("features")
    if not isinstance(members, list):
        return found
    each = (polygons_of({**collection, "features": [member]}).polygons for member in members)
    return replace(found, polygons=tuple(_merged(each)))


def _merged(features: Iterator[tuple[LabelledPolygon, ...]]) -> Iterator[LabelledPolygon]:
    """Yield one polygon for each feature that has any."""
    for polygons in features:
        if len(polygons) < 2:
            yield from polygons
            continue
        points = shapely.MultiPoint([point for each in polygons for point in each.rings[0]])
        hull = shapely.get_coordinates(points.convex_hull)
        yield replace(polygons[0], rings=(hull,))
