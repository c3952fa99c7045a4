"""Objects of a robot's occupancy grid: what stands free in the room the robot saw."""

from __future__ import annotations

import math
from collections.abc import Iterator

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field

from sketchmatch.api import InvalidInputError, Reason, Segmentation, Segmenter
from sketchmatch.model import IntArray, OccupancyGrid, Scene, SceneObject
from sketchmatch.model.limits import source_limits
from sketchmatch.model.scene import DOUBTFUL
from sketchmatch_builtin.segmenters._at_walls import Bounds
from sketchmatch_builtin.segmenters._cells import (
    TOLERANCE,
    FreeSpaceParams,
    Mask,
    closed,
    free_cells,
    holes,
    in_map,
    reading_order,
    refuse_more,
    simplified,
)
from sketchmatch_builtin.segmenters._landmarks import ROOM, labels_of, left_over
from sketchmatch_builtin.segmenters._standing import (
    Parts,
    Room,
    Thing,
    as_they_are,
    at_the_walls,
    furnished,
    merged_within,
)
from sketchmatch_builtin.segmenters.rooms import RoomSegmenter

__all__ = ["OccupancyGridSegmenter"]

# As a share of an object's size: a tolerance beyond it would change the shape, not the noise.
_COARSEST_TOLERANCE = 0.12
# In percent: from here on the laser met something.
_OCCUPIED = 50
# On a map of more cells nothing else is tried, which would take longer than what was asked.
_MANY = 4_000_000
# What the text of ``attached`` recommends, in metres.
_USUAL_ATTACHED = 2.0


class OccupancyGridSegmenter(Segmenter):
    """Takes as objects what stands in free regions, at their walls and on legs.

    A region is free cells joined by their sides; a hole is what it encloses, joined by sides or
    corners. A gap one cell wide continues across corners, so that what stands a cell off a wall is
    a hole however both lie on the cells. Taking holes fills an object's unseen interior, whatever
    its grey, and leaves out the walls and all that lies behind them. Regions that are small
    compared with the largest are not rooms but what was seen of an object's inside; a hole with a
    room in it is a building, not an object. Outlines run exactly along the cells' borders and are
    then simplified [1]_.

    What touches a wall, or was not seen from behind, is not a hole but a pocket of the region's
    outline: one that hangs on the wall by a neck, leans against it as a box does, or fills a corner
    of the room as a box does. Of a table, a scan shows only legs: four at the corners of a
    rectangle, two bars that face each other, or a crowd of small things are one object if so many
    are unlikely to stand like that by chance [2]_. So are a table and the outer legs of chairs that
    are pushed in.

    The certainty of an object is how likely it is one thing: 1 if the laser met it all around and
    it is not thin and ragged; 0.9 for four legs, 0.6 for feet and crowds; 0.8 for what hangs on a
    wall, 0.7 for what juts far out of it, and 0.4 for what leans against it, as the wall's own
    bumps do; 0.3 for what fills a corner, as corners of the building do, and for an outline that
    the laser did not meet. Edges of shadows, specks where the seen area ends, and thin specks that
    the laser hardly met are left out.

    Objects come in reading order: by their highest point from the top down, then from the left. A
    name in the map's file, other than a room's, is given to the object at its place.

    References
    ----------
    .. [1] D. H. Douglas, T. K. Peucker, "Algorithms for the reduction of the number of points
       required to represent a digitized line or its caricature", Cartographica 10(2), 1973.
    .. [2] A. Desolneux, L. Moisan, J.-M. Morel, "Meaningful alignments", International Journal of
       Computer Vision 40(1), 2000.

    Examples
    --------
    A walled room of 4 × 3 m with a box, and something whose inside was never seen.

    >>> import numpy as np
    >>> from sketchmatch.model import OccupancyGrid
    >>> cells = np.full((30, 40), 100, np.int8)
    >>> cells[1:-1, 1:-1] = 0
    >>> cells[5:9, 5:15] = 100
    >>> cells[15:25, 20:26] = -1
    >>> scene = OccupancyGridSegmenter().segment(OccupancyGrid(cells, 0.1)).scene
    >>> [round(item.area, 2) for item in scene.objects]
    [0.6, 0.4]
    """

    name = "occupancy-grid"
    summary = "Objects standing in the free space of a robot's occupancy grid."
    default = True
    sources = (OccupancyGrid,)

    class Params(FreeSpaceParams):
        """What is free, what is too small to count, and how outlines are cleaned."""

        min_size: float = Field(
            0.2,
            ge=0.0,
            le=1000.0,
            description=(
                "Objects smaller than a square with this side are left out. The default keeps "
                "posts and drops table legs and speckle."
            ),
            json_schema_extra={"unit": "m"},
        )
        close_gaps: float = Field(
            0.1,
            ge=0.0,
            le=1.0,
            description=(
                "Widest gap that is closed, in an outline or between objects, which then become "
                "one; 0 closes none."
            ),
            json_schema_extra={"unit": "m"},
        )
        merge_distance: float | None = Field(
            None,
            ge=0.0,
            le=100.0,
            description=(
                "Small things at most this far apart become one object with the outline around "
                "all; 0 merges none. By default those are merged that stand like legs of tables "
                "and chairs, and not by chance."
            ),
            json_schema_extra={"unit": "m"},
        )
        leg_size: float = Field(
            0.25,
            ge=0.0,
            le=100.0,
            description=(
                "Small things, which may be merged into furniture, are no larger than a square "
                "with this side."
            ),
            json_schema_extra={"unit": "m"},
        )
        attached: float = Field(
            3.0,
            ge=0.0,
            le=100.0,
            description=(
                "Objects that touch a wall, or whose back was not seen, count if their contact is "
                "no wider than this; 0 leaves all out."
            ),
            json_schema_extra={"unit": "m"},
        )
        wall_thickness: float = Field(
            0.35,
            ge=0.0,
            le=10.0,
            description=(
                "What touches a wall and is no thicker than this is a partition or a bump of the "
                "wall, not an object; used only with attached."
            ),
            json_schema_extra={"unit": "m"},
        )
        min_certainty: float = Field(
            0.25,
            ge=0.01,
            le=1.0,
            description=(
                "Objects with a lower certainty are left out; the default leaves out edges of "
                "shadows and specks at them, 0.5 all that is in doubt."
            ),
        )
        region_share: float = Field(
            0.1,
            ge=0.001,
            le=1.0,
            description=(
                "Smallest free region that counts, as rooms behind closed doors do, as a share of "
                "the largest one's area; 1 takes only the largest."
            ),
        )
        tolerance: float | None = Field(
            None,
            ge=0.0,
            le=10.0,
            description=(
                "Largest deviation of a simplified outline from the cells' borders, never more "
                "than 12 % of the object's size; three quarters of a cell by default."
            ),
            json_schema_extra={"unit": "m"},
        )
        label_reach: float = Field(
            0.5,
            ge=0.0,
            le=100.0,
            description=(
                "A name in the map's file is given to the object at its place, or else to the "
                "nearest within this distance."
            ),
            json_schema_extra={"unit": "m"},
        )

    params: Params

    def segment(self, source: OccupancyGrid) -> Segmentation:
        """Return what stands in the free regions, in metres in the map's frame."""
        free, corner = free_cells(source, self.params)
        free = _with_slanted_gaps(
            free, _occupied(source, free, corner), _cells(self.params.min_size, source.resolution)
        )
        rooms = list(_rooms(free, self.params.region_share))
        things = sorted(
            (
                thing
                for room, held, at in rooms
                for thing in self._things(
                    room, held, (at[0] + corner[0], at[1] + corner[1]), source
                )
            ),
            key=lambda thing: reading_order(thing.outline),
        )
        refuse_more(len(things), source_limits().max_objects, "raise min_size")
        if len(things) < 2:
            largest = max(int(np.count_nonzero(room)) for room, _, _ in rooms)
            raise _too_few(len(things), largest, source, self.params)
        rings = [in_map(shapely.get_coordinates(thing.outline), source) for thing in things]
        reach = self.params.label_reach
        labels, unplaced = labels_of(
            [shapely.Polygon(ring) for ring in rings],
            [item for item in source.landmarks if item.kind != ROOM],
            reach,
            [thing.certainty < DOUBTFUL for thing in things],
        )
        objects = [
            SceneObject.from_rings([ring], name, thing.certainty)
            for ring, name, thing in zip(rings, labels, things, strict=True)
        ]
        near = f"within {reach:g} m of" if reach else "around"
        return Segmentation(Scene(tuple(objects)), left_over(unplaced, near, "the map's file"))

    def _things(
        self, free: Mask, held: Mask, at: tuple[int, int], grid: OccupancyGrid
    ) -> list[Thing]:
        """Return what stands in a room, in cells from the grid's lower left corner."""
        params, cell = self.params, grid.resolution
        inside = closed(held, int(min(params.close_gaps / cell + 0.5, max(free.shape))))
        small = _cells(params.min_size, cell)
        room = Room(free, inside, _occupied(grid, free, at), cell, small)
        parts, least = Parts.of(room), (params.min_size / cell) ** 2
        leg, most = (params.leg_size / cell) ** 2, source_limits().max_objects
        if params.merge_distance is None:
            things = furnished(room, parts, least, leg, most)
        elif params.merge_distance > 0.0:
            things = merged_within(room, parts, least, params.merge_distance, leg)
        else:
            things = as_they_are(room, parts, least, most)
        if params.attached > 0.0:
            lengths = (params.attached, params.wall_thickness, params.min_size)
            bounds = Bounds(*(_cells(length, cell) for length in lengths))
            things = at_the_walls(room, things, bounds)
        return [
            Thing(self._simplified(shapely.transform(each.outline, lambda p: p + at), grid), sure)
            for each, sure in ((each, each.certainty) for each in things)
            if sure >= params.min_certainty
        ]

    def _simplified(self, polygon: shapely.Polygon, grid: OccupancyGrid) -> shapely.Polygon:
        if self.params.tolerance is None:
            tolerance = TOLERANCE
        else:
            tolerance = self.params.tolerance / grid.resolution
        coarsest = _COARSEST_TOLERANCE * math.sqrt(polygon.area)
        return simplified(polygon, min(tolerance, coarsest))


def _occupied(grid: OccupancyGrid, free: Mask, at: tuple[int, int]) -> Mask:
    """Return where the laser met something, of as many cells as a mask has, from (x, y) on."""
    (rows, columns), (x, y) = free.shape, at
    return (grid.cells[y : y + rows, x : x + columns] > _OCCUPIED).view(np.uint8)


def _cells(length: float, cell: float) -> float:
    """Return a length in cells, without what rounding adds: 0.3 / 0.1 is a little less than 3."""
    return round(length / cell, 9)


def _with_slanted_gaps(free: Mask, occupied: Mask, shortest: float) -> Mask:
    """Return free cells with gaps one cell wide joined by sides, however they lie on the cells.

    Of a slanted gap the cells meet in corners alone, as those of a slanted wall do. It is a gap
    where no two by two free cells hold either of them, and so many such cells follow each other;
    at its end, one of them alone, if the laser met something on both sides.
    One of the two cells between is made free, beyond which there is nothing free.
    """
    framed, met = np.pad(free, 2), np.pad(occupied, 2)
    square = np.ones((2, 2), np.uint8)
    wide = cv2.dilate(cv2.erode(framed, square, anchor=(1, 1)), square, anchor=(0, 0))
    thin = framed & (1 - np.asarray(wide, dtype=np.uint8))
    corners = [(*each, aside) for aside in (1, -1) for each in _meeting(thin, framed, met, aside)]
    if not corners:
        return free
    _, gaps, sizes, _ = cv2.connectedComponentsWithStats(thin, connectivity=8)
    sizes[0] = 0
    opened = framed.copy()
    for y, x, aside in corners:
        gap = max(gaps[y, x], gaps[y + 1, x + aside])
        if sizes[gap, cv2.CC_STAT_AREA] < shortest:
            continue
        if not framed[y - 1, x + aside] and not framed[y, x + 2 * aside]:
            opened[y, x + aside] = 1
        elif not framed[y + 2, x] and not framed[y + 1, x - aside]:
            opened[y + 1, x] = 1
    return np.ascontiguousarray(opened[2:-2, 2:-2])


def _meeting(thin: Mask, free: Mask, met: Mask, aside: int) -> Iterator[tuple[int, int]]:
    """Yield (row, column) of free cells that meet those below and aside in a corner alone.

    Both are thin, or one of them, where the laser met what lies on both sides.
    """
    columns, cells = free.shape[1], np.flatnonzero(thin.view(np.bool_))
    across = columns + aside
    upper = np.unique(np.concatenate([cells, cells - across]))
    is_thin, is_free, is_met = thin.ravel(), free.ravel(), met.ravel()
    left, right = upper + columns, upper + aside
    meeting = is_free[upper] & is_free[upper + across] & ~(is_free[left] | is_free[right])
    meeting &= (is_thin[upper] & is_thin[upper + across]) | (is_met[left] & is_met[right])
    yield from zip(*(each.tolist() for each in np.divmod(upper[meeting > 0], columns)), strict=True)


def _rooms(free: Mask, share: float) -> Iterator[tuple[Mask, Mask, tuple[int, int]]]:
    """Yield free regions and what stands in each, both cropped, and the (x, y) of the crop."""
    count, regions, statistics, _ = cv2.connectedComponentsWithStats(free, connectivity=4)
    areas = statistics[1:count, cv2.CC_STAT_AREA]
    labels, boxes = np.asarray(regions, dtype=np.int32), np.asarray(statistics, dtype=np.int64)
    large = 1 + np.flatnonzero(areas >= share * areas.max())
    for k in large.tolist():
        x, y, width, height, _ = statistics[k].tolist()
        crop = labels[y : y + height, x : x + width]
        room = np.asarray(crop == k, dtype=np.uint8)
        held = holes(room)
        within = _within(boxes[large], boxes[k])
        for other in large[within].tolist():
            _drop_around(held, crop, other)
        yield room, held, (x, y)


def _within(boxes: IntArray, box: IntArray) -> NDArray[np.bool_]:
    """Return which of the boxes (x, y, columns, rows, …) lie strictly inside one."""
    low, high = boxes[:, :2], boxes[:, :2] + boxes[:, 2:4]
    inside = (low > box[:2]) & (high < box[:2] + box[2:4])
    return np.asarray(inside.all(axis=1))


def _drop_around(held: Mask, labels: NDArray[np.int32], k: int) -> None:
    """Take out the hole that another room lies in."""
    inside = np.flatnonzero((labels == k) & (held > 0))
    if inside.size:
        y, x = divmod(int(inside[0]), held.shape[1])
        cv2.floodFill(held, None, (x, y), (0,), flags=8)


def _too_few(
    found: int, free: int, grid: OccupancyGrid, params: OccupancyGridSegmenter.Params
) -> InvalidInputError:
    cures = [*_cures(grid, params), "give a map with objects standing free of the walls"]
    return InvalidInputError(
        Reason.TOO_FEW_OBJECTS,
        "cells",
        f"has {'no object' if not found else 'only one object'} of at least {params.min_size:g} m "
        f"within its largest free region ({free * grid.resolution**2:.3g} m²), and a match needs "
        f"two; {', '.join(cures)}, or lower min_size",
    )


def _cures(grid: OccupancyGrid, params: OccupancyGridSegmenter.Params) -> Iterator[str]:
    """Yield which other options find objects enough, having tried them where that is soon done."""
    if params.attached == 0.0 and grid.cells.size > _MANY:
        yield f"set attached to {_USUAL_ATTACHED:g} for objects at the walls"
    elif params.attached == 0.0:
        wider = params.model_copy(update={"attached": _USUAL_ATTACHED})
        if found := _count(OccupancyGridSegmenter(wider), grid):
            yield f"set attached to {_USUAL_ATTACHED:g}, which finds {found} objects at the walls"
    same = {"free_threshold": params.free_threshold, "keep_unknown": params.keep_unknown}
    rooms = RoomSegmenter(RoomSegmenter.Params.model_validate(same))
    if grid.cells.size > _MANY:
        yield "try the segmenter rooms"
    elif found := _count(rooms, grid):
        yield f"choose the segmenter rooms, which finds {found} rooms"


def _count(segmenter: Segmenter, grid: OccupancyGrid) -> int:
    try:
        return len(segmenter.segment(grid).scene)
    except InvalidInputError:
        return 0
