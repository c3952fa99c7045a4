"""What people and robots hand in: strokes, polygons, occupancy grids and images.

A source is data as it came, checked for its form alone; a segmenter turns it into a
:class:`~sketchmatch.model.Scene`. Field names are those of the messages in
``proto/sketchmatch/v1/source.proto``, so that an error's path reads the same everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field as dataclass_field

import numpy as np
from numpy.typing import NDArray

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model.arrays import FloatArray, frozen, frozen_floats
from sketchmatch.model.labels import cleaned_label

__all__ = [
    "GridPicture",
    "Image",
    "LabelledPolygon",
    "Landmark",
    "OccupancyGrid",
    "PolygonSet",
    "Source",
    "Stroke",
    "StrokeSet",
]

# Metres. Beyond these a map is a mistake, and its squares would soon overflow.
_FINEST, _COARSEST, _FARTHEST = 1e-6, 1e6, 1e9


@dataclass(frozen=True, eq=False)
class Stroke:
    """One pen stroke, from pen down to pen up.

    Attributes
    ----------
    points
        Shape (k, 2), sketch units, x right, y up.
    times
        Shape (k,), seconds from any origin, or None where the pad gave none.
    label
        A name for people.
    dashed
        Whether it is drawn with gaps, as what is no wall of a floor plan.
    width
        How wide its line is drawn, in sketch units; 0 where nobody said.
    opaque
        Whether it is closed and filled, and hides what was drawn there before.
    """

    points: FloatArray
    times: FloatArray | None = None
    label: str = ""
    dashed: bool = False
    width: float = 0.0
    opaque: bool = False

    def __post_init__(self) -> None:
        points = frozen_floats(self.points)
        if points.ndim != 2 or points.shape[1] != 2:
            raise InvalidInputError(
                Reason.INVALID_STROKE, "points", "is not a list of [x, y] pairs of numbers"
            )
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "label", cleaned_label(self.label))
        if self.times is not None:
            times = frozen_floats(self.times)
            if times.shape != (len(points),):
                raise InvalidInputError(
                    Reason.INVALID_STROKE,
                    "times",
                    f"has {times.size} values for {len(points)} points; give one for each or none",
                )
            object.__setattr__(self, "times", times)


@dataclass(frozen=True)
class Landmark:
    """A thing to which the author of a map gave a name and a place.

    Attributes
    ----------
    name
        For people.
    point
        (x, y) in the map's frame, in metres.
    kind
        What kind of thing it is, such as ``"door"`` or ``"room"``; empty if unknown.
    size
        Height of its letters, in the map's or the drawing's unit; 0 if it is not written text.
    """

    name: str
    point: tuple[float, float]
    kind: str = ""
    size: float = 0.0


@dataclass(frozen=True, eq=False)
class StrokeSet:
    """The strokes of a sketch in the order they were drawn.

    Attributes
    ----------
    strokes
        The strokes.
    notes
        What the reader of the file left out or decided, as in :class:`StrokeSet`.
    landmarks
        Names that are written in the sketch, of kind ``"room"``, in sketch units.
    """

    strokes: tuple[Stroke, ...]
    notes: tuple[str, ...] = ()
    landmarks: tuple[Landmark, ...] = ()

    field = "stroke_set"


@dataclass(frozen=True, eq=False)
class LabelledPolygon:
    """One polygon as it came: outer ring, then holes, each of shape (k, 2), y up.

    ``certainty`` is how sure it is that it is one thing, above 0 and up to 1.
    """

    rings: tuple[FloatArray, ...]
    label: str = ""
    certainty: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "label", cleaned_label(self.label))


@dataclass(frozen=True, eq=False)
class PolygonSet:
    """Polygons drawn or exported by a tool, one for each object.

    Attributes
    ----------
    polygons
        The polygons.
    notes
        What the reader of the file left out or decided, as in :class:`StrokeSet`.
    lines
        Open lines, each of shape (k, 2), y up: walls, for finding rooms.
    landmarks
        Names that are written in the drawing, of kind ``"room"``.
    geographic_origin
        Longitude and latitude, in degrees, of (0, 0), if the file has such coordinates, which
        became metres east and north of it; otherwise None.
    """

    polygons: tuple[LabelledPolygon, ...]
    notes: tuple[str, ...] = ()
    # By name alone: classes that derive from this one have fields of their own in third place.
    lines: tuple[FloatArray, ...] = dataclass_field(default=(), kw_only=True)
    landmarks: tuple[Landmark, ...] = dataclass_field(default=(), kw_only=True)
    geographic_origin: tuple[float, float] | None = dataclass_field(default=None, kw_only=True)

    field = "polygon_set"


@dataclass(frozen=True, eq=False)
class GridPicture:
    """The picture from which thresholds made a grid, so that other thresholds can be applied.

    Attributes
    ----------
    shades
        uint8, shape (rows, columns), row 0 the lowest: 255 times the occupancy, so that 0 is free
        and 255 occupied; what is not opaque has 255.
    free_thresh
        The share of occupancy below which the map's own YAML calls cells free.
    """

    shades: NDArray[np.uint8]
    free_thresh: float

    saved_unknown = 50
    """The shade with which map_server saves what nobody saw; as a grey, 205."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "shades", frozen(np.asarray(self.shades, dtype=np.uint8)))

    def free(self, threshold: float | None = None) -> NDArray[np.bool_]:
        """Return which cells a threshold calls free; by default that of the map."""
        share = self.free_thresh if threshold is None else threshold
        return (np.arange(256) / 255.0 < share)[self.shades]


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """A robot's occupancy grid, as in ``nav_msgs/OccupancyGrid``.

    Attributes
    ----------
    cells
        int8, shape (rows, columns), row 0 the lowest; −1 unknown, 0 free … 100 occupied.
    resolution
        Metres a cell.
    origin
        Pose (x, y, yaw) of the lower left corner of cell (0, 0) in the map's frame, in metres
        and radians counter-clockwise.
    notes
        What the reader of the map's file decided, as in :class:`StrokeSet`.
    picture
        The picture from which thresholds made the cells; otherwise None.
    landmarks
        What the map's file names.
    objects
        The objects as corrected by people, in the map's frame and metres; they replace those found
        in the map, unless a segmenter is chosen. None if there are none.
    """

    cells: NDArray[np.int8]
    resolution: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    notes: tuple[str, ...] = ()
    picture: GridPicture | None = None
    landmarks: tuple[Landmark, ...] = ()
    objects: PolygonSet | None = None

    field = "occupancy_grid"

    def __post_init__(self) -> None:
        cells = np.asarray(self.cells)
        if cells.ndim != 2 or cells.size == 0:
            raise InvalidInputError(
                Reason.INVALID_GRID, "cells", "is empty; give rows × columns of cells"
            )
        if cells.min() < -1 or cells.max() > 100:
            raise InvalidInputError(
                Reason.INVALID_GRID,
                "cells",
                "has a value outside −1…100; use −1 for unknown and 0…100 for occupancy",
            )
        check_placement(self.resolution, self.origin)
        object.__setattr__(self, "cells", frozen(cells.astype(np.int8, copy=False)))


@dataclass(frozen=True, eq=False)
class Image:
    """A picture of a map or of a sketch.

    Attributes
    ----------
    pixels
        uint8, row 0 the highest; 0 is black. Shape (rows, columns) if grey, (rows, columns, 3)
        if in colour: red, green, blue.
    notes
        What the reader of the file left out or decided, as in :class:`StrokeSet`.
    """

    pixels: NDArray[np.uint8]
    notes: tuple[str, ...] = ()

    field = "image"

    def __post_init__(self) -> None:
        pixels = np.asarray(self.pixels)
        shaped = pixels.ndim == 2 or (pixels.ndim == 3 and pixels.shape[2] == 3)
        if not shaped or pixels.size == 0 or pixels.dtype != np.uint8:
            raise InvalidInputError(
                Reason.INVALID_IMAGE,
                "pixels",
                "is not an 8-bit picture; give rows × columns of grey or of red, green and blue",
            )
        object.__setattr__(self, "pixels", frozen(pixels))


def check_placement(resolution: float, origin: tuple[float, ...]) -> None:
    """Check where the cells of a grid lie.

    Raises
    ------
    InvalidInputError
        With the path ``resolution`` or ``origin``.
    """
    if not _FINEST <= resolution <= _COARSEST:
        raise InvalidInputError(
            Reason.INVALID_GRID,
            "resolution",
            f"is {resolution:g}; give the positive size of a cell in metres, as in 0.05",
        )
    if len(origin) != 3 or not all(abs(value) <= _FARTHEST for value in origin):
        raise InvalidInputError(
            Reason.INVALID_GRID,
            "origin",
            "is not finite or too far away; give x, y, yaw in metres and radians",
        )


Source = StrokeSet | PolygonSet | OccupancyGrid | Image
"""What a segmenter may be given."""
