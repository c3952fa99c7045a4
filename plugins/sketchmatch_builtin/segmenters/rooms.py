"""Rooms of a robot's occupancy grid: free space cut at its doorways."""

from __future__ import annotations

from typing import cast

import cv2
import numpy as np
import shapely
from pydantic import Field

from sketchmatch.api import InvalidInputError, Reason, Segmentation, Segmenter
from sketchmatch.model import FloatArray, OccupancyGrid, Scene, SceneObject
from sketchmatch.model.limits import source_limits
from sketchmatch_builtin.segmenters._cells import (
    TOLERANCE,
    FreeSpaceParams,
    Mask,
    components,
    free_cells,
    holes,
    in_map,
    outline,
    reading_order,
)
from sketchmatch_builtin.segmenters._doorways import divided, doorway
from sketchmatch_builtin.segmenters._landmarks import ROOM, labels_of

__all__ = ["RoomSegmenter"]

_MOST_HOLES = 1000

# In metres: no doorway is wider, unless a parameter says so.
_WIDEST = 2.1


class RoomSegmenter(Segmenter):
    """Takes as objects the rooms: free space, cut where it is narrow.

    Where a disc as wide as a door does not fit, free space is cut [1]_; what is left is a room or
    part of one, and what was cut away goes to the nearest, of several to the largest. How wide that
    is the map itself says: three times the mean distance of free cells to the nearest wall, which
    is half the width of a square room. Parts that are joined by a passage nearly as wide as the
    wider of them are one room, so that a corridor stays whole. Rays of a laser through glass and
    the insides of cupboards' outlines are no rooms. Things that stand free in a room and are no longer than ``furniture`` neither cut
    it nor are holes in it; longer ones are holes. Unknown and occupied cells otherwise belong to no
    room, and two rooms are always at least a cell apart. A turned map has the same rooms, turned.

    Rooms come in reading order: by their highest point from the top down, then from the left.
    One that the map's file names, with the type ``room`` and a place in it, has that name.

    Notes
    -----
    On ten of the twenty floors of [1]_, each empty and with furniture, 496 of 560 rooms marked by
    hand are found, and of the 532 from 0.3 m² on 93 %: a room shares more than half of what both
    cover. It was tuned on every second building by name, where 284 of 322 are found; on the others
    212 of 238. Recall and precision as [1]_ measures them, how much of a room and of a segment the
    largest overlap is, are 98.1 and 97.7 % empty, 91.8 and 97.8 % with furniture, without the rooms
    below 0.3 m². Of all twenty floors these figures are quoted from it: morphological 98.1 and
    88.5 %, 84.6 and 90.5 %; distance transform 96.9 and 88.4 %, 76.1 and 88.4 %; Voronoi 95.0 and
    94.8 %, 86.6 and 94.5 %; feature-based 89.2 and 90.4 %, 85.1 and 87.1 %. Neither its other ten
    floors nor its smallest rooms are in ours. MAORIS [2]_ reports 0.98 by Matthews' coefficient, on
    empty floors, which was not measured here.

    References
    ----------
    .. [1] R. Bormann, F. Jordan, W. Li, J. Hampp, M. Hägele, "Room segmentation: survey,
       implementation, and analysis", ICRA 2016: morphological and distance transform segmentation.
    .. [2] M. Mielle, M. Magnusson, A. J. Lilienthal, "A method to segment maps from different
       modalities using free space layout: MAORIS, map of ripples segmentation", ICRA 2018.

    Examples
    --------
    Two rooms with a door of 0.8 m between them, 3.6 × 3.2 m and 3.6 × 3.6 m.

    >>> import numpy as np
    >>> from sketchmatch.model import OccupancyGrid
    >>> cells = np.full((22, 40), 100, np.int8)
    >>> cells[2:20, 2:18] = cells[10:14, 18:20] = cells[2:20, 20:38] = 0
    >>> params = RoomSegmenter.Params(door_width=0.8)
    >>> scene = RoomSegmenter(params).segment(OccupancyGrid(cells, 0.2)).scene
    >>> [round(item.area, 2) for item in scene.objects]
    [11.52, 12.96]
    """

    name = "rooms"
    summary = "Rooms of a robot's occupancy grid, cut at the doorways."
    sources = (OccupancyGrid,)

    class Params(FreeSpaceParams):
        """What is free, how wide doorways are, and what is too small to be a room."""

        door_width: float | None = Field(
            None,
            gt=0.0,
            le=100.0,
            description=(
                "Passages up to this wide are doorways; when left out half the width of the map's "
                "typical room, but at most 2.1 m."
            ),
            json_schema_extra={"unit": "m"},
        )
        min_area: float = Field(
            2.0,
            ge=0.0,
            le=1e6,
            description="Rooms smaller than this are left out.",
            json_schema_extra={"unit": "m²"},
        )
        furniture: float = Field(
            2.0,
            ge=0.0,
            le=1000.0,
            description=(
                "Things that stand free and are at most this long are furniture and belong to "
                "the room around them; longer ones are walls that may part rooms."
            ),
            json_schema_extra={"unit": "m"},
        )
        tolerance: float | None = Field(
            None,
            ge=0.0,
            le=10.0,
            description=(
                "How far a simplified outline may leave the cells' borders; three quarters of a "
                "cell when left out."
            ),
            json_schema_extra={"unit": "m"},
        )

    params: Params

    def segment(self, source: OccupancyGrid) -> Segmentation:
        """Return the rooms, in metres in the map's frame."""
        params, cell = self.params, source.resolution
        free, (left, below) = free_cells(source, params)
        least = max(params.min_area / cell**2, 1.0)
        inside = _furnished(free, params.furniture / cell)
        width = params.door_width
        door = doorway(inside, _WIDEST / cell) if width is None else width / cell
        rooms = divided(inside, door, least)
        most = source_limits().max_objects
        outlines = [
            _polygon(mask, (x + left, y + below))
            for mask, (x, y) in components(rooms, least, most, "raise min_area")
        ]
        if len(outlines) < 2:
            raise _too_few(len(outlines), params, door * cell)
        tolerance = TOLERANCE if params.tolerance is None else params.tolerance / cell
        outlines = sorted(_simplified(outlines, tolerance), key=reading_order)
        rooms_in_map = [[in_map(ring, source) for ring in _rings(room)] for room in outlines]
        labels, unplaced = labels_of(
            [shapely.Polygon(outer, inner) for outer, *inner in rooms_in_map],
            [item for item in source.landmarks if item.kind == ROOM],
            0.0,
        )
        objects = map(SceneObject.from_rings, rooms_in_map, labels)
        return Segmentation(Scene(tuple(objects)), unplaced)


def _furnished(free: Mask, longest: float) -> Mask:
    """Return free cells together with the things, no longer than so many cells, among them."""
    # What an outline of a thing encloses is of the thing.
    things = (1 - free) | _small(free, longest, 4)
    framed = cv2.copyMakeBorder(things, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=(1,))
    return np.asarray(_small(framed, longest, 8)[1:-1, 1:-1] | free)


def _small(mask: Mask, longest: float, connectivity: int) -> Mask:
    """Return a mask's components whose sides are at most so long, without that at its corner."""
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(mask, connectivity=connectivity)
    small = statistics[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1) <= longest
    # What lies outside the map is no thing, however small the map is.
    small[[0, labels[0, 0]]] = False
    return np.asarray(small[labels], dtype=np.uint8)


def _polygon(mask: Mask, corner: tuple[int, int]) -> shapely.Polygon:
    """Return the outline of a room whose crop begins at a corner (x, y), its holes left out."""
    held = holes(mask)
    outer = shapely.Polygon(outline(mask | held) + corner)
    inner = [
        shapely.Polygon(outline(hole) + np.array([x, y]) + corner)
        for hole, (x, y) in components(held, 1, _MOST_HOLES, "raise furniture")
    ]
    parts = shapely.get_parts(outer.difference(shapely.union_all(inner))) if inner else [outer]
    return cast(shapely.Polygon, max(parts, key=lambda part: part.area))


def _simplified(outlines: list[shapely.Polygon], tolerance: float) -> list[shapely.Polygon]:
    """Return the outlines simplified, and those left as they are that would then overlap."""
    result = np.array([_begun(exact).simplify(tolerance) for exact in outlines], dtype=object)
    kept = np.zeros(len(result), dtype=bool)
    while True:
        a, b = shapely.STRtree(result).query(result, predicate="intersects")
        touching = np.unique(a[(a != b) & ~kept[a]])
        if not touching.size:
            return list(result)
        kept[touching] = True
        result[touching] = [outlines[k] for k in touching]


def _begun(room: shapely.Polygon) -> shapely.Polygon:
    """Return a room whose rings begin at their farthest corners, wherever they began.

    What is left of a ring depends on where it begins, and must not depend on how the map lies.
    """
    outer, *inner = (_from_farthest(ring) for ring in _rings(room))
    return shapely.Polygon(outer, inner)


def _from_farthest(ring: FloatArray) -> FloatArray:
    """Return a closed ring begun where it is farthest from the mean of its corners."""
    corners = ring[:-1]
    # As many times as there are corners: whole numbers and halves, and so without rounding.
    away = ((len(corners) * corners - corners.sum(axis=0)) ** 2).sum(axis=1)
    farthest = np.flatnonzero(away == away.max()).tolist()
    first = max(farthest, key=lambda k: np.roll(away, -k).tolist())
    return np.roll(corners, -first, axis=0)


def _rings(room: shapely.Polygon) -> list[FloatArray]:
    return [shapely.get_coordinates(ring) for ring in (room.exterior, *room.interiors)]


def _too_few(found: int, params: RoomSegmenter.Params, door: float) -> InvalidInputError:
    return InvalidInputError(
        Reason.TOO_FEW_OBJECTS,
        "cells",
        f"has {'no room' if not found else 'only one room'} of at least {params.min_area:g} m² "
        f"when cut at passages of up to {door:.2g} m, and a match needs two; give a "
        "map with several rooms, raise door_width or lower min_area",
    )
