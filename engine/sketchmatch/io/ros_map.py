"""Robots' maps as ROS ``map_server`` saves them: a YAML file beside a picture.

All keys but ``mode`` are required, as map_server requires them; others are ignored::

    image: office.pgm             # relative to the YAML file
    resolution: 0.05              # metres a cell
    origin: [-10.0, -10.0, 0.0]   # x, y, yaw of the lower left corner, metres and radians
    negate: 0                     # 1: white is occupied
    occupied_thresh: 0.65
    free_thresh: 0.196
    mode: trinary                 # or scale, or raw

A pixel of value v is occupied with p = (255 − v)/255, or v/255 where negated; v is the mean of
its colours. In mode ``trinary`` p > occupied_thresh is occupied (100), p < free_thresh free (0)
and the rest unknown (−1); ``scale`` spreads the rest from 0 to 100; ``raw`` takes v itself, and
unknown where it is above 100. Pictures of 16 bits a channel are read with 8.

The thresholds decide alone, but there is a trap: nav2's map_saver writes unknown cells as the grey
205 (p = 0.19608) and free_thresh 0.25 beside it, by which they come back as free, for the robot as
here. Where many cells are read so, the grid's notes say it; ``free_thresh: 0.196`` keeps them
unknown.

ROS 1's map_server [1]_ and nav2's [2]_ agree that all keys but ``mode`` are required, and the
origin's three numbers; so do we, and assume nothing. In details they differ:

=====================  =========================  =========================  ====================
what                   ROS 1                      nav2                       here
=====================  =========================  =========================  ====================
``negate`` in ``raw``  255 − v                    no effect                  no effect
``raw`` above 100      as it is                   unknown                    unknown
``scale`` between      1 to 99, rounded down      0 to 100, rounded          0 to 100, rounded
not opaque, scale      v as if it were opaque,    unknown                    unknown
                       but transparent between
                       the thresholds: unknown
not opaque, trinary    alpha counts as a colour   alpha counts as a colour   unknown
palette                the index counts as grey   the colour                 the colour
``negate``             a whole number             that, or true and false    0, 1, true, false
yaw of nan             no pose                    no pose                    0, and a note
=====================  =========================  =========================  ====================

Map savers write a yaw of nan where the map came without an orientation.

References
----------
.. [1] https://wiki.ros.org/map_server and ``image_loader.cpp`` of ros-planning/navigation.
.. [2] ``nav2_map_server/src/map_io.cpp`` of ros-navigation/navigation2.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import PIL.Image
import yaml
from numpy.typing import NDArray

from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.io._yaml import LOADER, check_header
from sketchmatch.io.images import load_picture, scaled_to_8_bits
from sketchmatch.model import OccupancyGrid
from sketchmatch.model.sources import check_placement

__all__ = ["MapServerHeader", "decode_map_server", "parse_header"]

_EXAMPLES = {
    "image": "office.pgm",
    "resolution": "0.05",
    "origin": "[-10.0, -10.0, 0.0]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.196",
}
_MODES = ("trinary", "scale", "raw")
_SAVED_UNKNOWN = 205
"""The grey with which map_server saves unknown cells."""
_MANY = 0.01
"""As a share of all cells."""


@dataclass(frozen=True)
class MapServerHeader:
    """What the YAML file says.

    Attributes
    ----------
    image
        Path of the picture, relative to the YAML file or absolute.
    resolution
        Metres a cell.
    origin
        Pose (x, y, yaw) of the lower left corner, in metres and radians.
    negate
        Whether white is occupied.
    occupied_thresh, free_thresh
        Shares of occupancy, 0 ≤ free < occupied ≤ 1.
    mode
        ``"trinary"``, ``"scale"`` or ``"raw"``.
    notes
        What was assumed in reading it, each one sentence.
    """

    image: str
    resolution: float
    origin: tuple[float, float, float]
    negate: bool
    occupied_thresh: float
    free_thresh: float
    mode: str
    notes: tuple[str, ...] = ()

    def grid(self, image: bytes) -> OccupancyGrid:
        """Return the occupancy grid that the picture's bytes hold.

        Raises
        ------
        InvalidInputError
            With the path ``image``, if the picture cannot be read.
        """
        values, opaque = _values(scaled_to_8_bits(load_picture(image, "image"), "image"))
        cells = self._occupancy()[values]
        if opaque is not None and self.mode != "raw":
            cells[~opaque] = -1
        notes = (*self.notes, *self._trap(values, cells))
        return OccupancyGrid(cells[::-1], self.resolution, self.origin, notes)

    def _trap(self, values: NDArray[np.uint8], cells: NDArray[np.int8]) -> tuple[str, ...]:
        """Return a warning if many cells that were saved as unknown seem to be read as free."""
        if self.mode != "trinary" or self._occupancy()[_SAVED_UNKNOWN] != 0:
            return ()
        share = np.count_nonzero((values == _SAVED_UNKNOWN) & (cells == 0)) / values.size
        if share < _MANY:
            return ()
        return (
            f"free_thresh {self.free_thresh:g} makes {share:.0%} of the map free that have the "
            f"grey {_SAVED_UNKNOWN} with which map_server saves unknown cells; if they were never "
            "seen, set free_thresh to 0.196",
        )

    def _occupancy(self) -> NDArray[np.int8]:
        """Return the occupancy that each of the 256 pixel values stands for."""
        value = np.arange(256)
        if self.mode == "raw":
            return np.where(value <= 100, value, -1).astype(np.int8)
        p = (value if self.negate else 255 - value) / 255.0
        between = np.full(256, -1.0)
        if self.mode == "scale":
            span = self.occupied_thresh - self.free_thresh
            between = np.rint((p - self.free_thresh) / span * 100.0)
        return np.select(
            [p > self.occupied_thresh, p < self.free_thresh], [100, 0], between
        ).astype(np.int8)


def decode_map_server(yaml_text: str, image: bytes) -> OccupancyGrid:
    """Decode a map from the contents of its two files.

    Parameters
    ----------
    yaml_text
        The YAML file. Its ``image`` is not looked at: no path of a caller's is ever opened.
    image
        The picture's file.

    Raises
    ------
    InvalidInputError
        With a path within ``yaml`` or the path ``image``, if either cannot be used.
    """
    try:
        header = parse_header(yaml_text)
    except InvalidInputError as error:
        raise error.within("yaml") from None
    return header.grid(image)


def parse_header(yaml_text: str) -> MapServerHeader:
    """Read and check the YAML file's text.

    Raises
    ------
    InvalidInputError
        With the key at fault as its path, if it is not YAML, a key is missing or its value is
        of no use.
    """
    document = _document(yaml_text)
    for key, example in _EXAMPLES.items():
        if document.get(key) is None:
            raise _invalid(key, f"is missing; add it, for instance '{key}: {example}'")
    origin, notes = _origin(document["origin"])
    header = MapServerHeader(
        image=_image(document["image"]),
        resolution=_number(document["resolution"], "resolution"),
        origin=origin,
        negate=_negate(document["negate"]),
        occupied_thresh=_number(document["occupied_thresh"], "occupied_thresh"),
        free_thresh=_number(document["free_thresh"], "free_thresh"),
        mode=_mode(document.get("mode", "trinary")),
        notes=notes,
    )
    _check_ranges(header)
    return header


def _document(text: str) -> Mapping[Any, Any]:
    check_header(text)
    try:
        document = yaml.load(text, LOADER)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        where = f" (line {min(mark.line, text.count(chr(10))) + 1})" if mark else ""
        raise _invalid("", f"is not YAML{where}; give the file that map_server saved") from None
    if not isinstance(document, Mapping):
        raise _invalid("", "is not a list of keys and values; give the file that map_server saved")
    return document


def _check_ranges(header: MapServerHeader) -> None:
    if header.resolution <= 0.0:
        raise _invalid(
            "resolution",
            f"is {header.resolution:g}; give the metres per cell as a positive number",
        )
    check_placement(header.resolution, header.origin)
    for key in ("occupied_thresh", "free_thresh"):
        value = getattr(header, key)
        if not 0.0 <= value <= 1.0:
            raise _invalid(key, f"is {value:g}; give a share from 0 to 1")
    if header.free_thresh >= header.occupied_thresh:
        raise _invalid(
            "free_thresh",
            f"is {header.free_thresh:g}, not below occupied_thresh {header.occupied_thresh:g}; "
            "give map_server's 0.196 and 0.65 or the map's own",
        )


def _image(value: object) -> str:
    if not isinstance(value, str) or not value.strip() or "\0" in value:
        raise _invalid("image", "is not a file name; give the picture's path")
    return value


def _origin(value: object) -> tuple[tuple[float, float, float], tuple[str, ...]]:
    if not isinstance(value, list) or len(value) != 3:
        raise _invalid("origin", "is not a list of three numbers; give [x, y, yaw]")
    x, y = (_number(part, f"origin[{k}]") for k, part in enumerate(value[:2]))
    if _is_nan(value[2]):
        return (x, y, 0.0), ("the yaw of the map's origin is nan and was read as 0",)
    return (x, y, _number(value[2], "origin[2]")), ()


def _is_nan(value: object) -> bool:
    # ROS 1 writes nan or -nan, which YAML reads as a string; nav2 .nan.
    if isinstance(value, str):
        return value.strip().lower().lstrip("+-.") == "nan"
    return isinstance(value, float) and math.isnan(value)


def _negate(value: object) -> bool:
    if value not in (0, 1):
        raise _invalid("negate", f"is {quoted(value)}; give 0, or 1 where white is occupied")
    return bool(value)


def _mode(value: object) -> str:
    if value not in _MODES:
        raise _invalid("mode", f"is {quoted(value)}; give trinary, scale or raw")
    return str(value)


def _number(value: object, key: str) -> float:
    # YAML 1.1 reads 5e-2 as a string, and map_server as the number it is.
    try:
        number = float(value) if isinstance(value, int | float | str) else math.nan
    except (ValueError, OverflowError):
        number = math.nan
    if isinstance(value, bool) or not math.isfinite(number):
        raise _invalid(key, f"is {quoted(value)}; give a finite number")
    return number


def _values(picture: PIL.Image.Image) -> tuple[NDArray[np.uint8], NDArray[np.bool_] | None]:
    """Return the mean of the colours, and what is opaque where the picture knows alpha."""
    if picture.mode in ("1", "L") and not picture.has_transparency_data:
        return np.asarray(picture.convert("L")), None
    channels = np.asarray(picture.convert("RGBA"))
    mean = (channels[..., :3].sum(axis=2, dtype=np.uint16) + 1) // 3
    opaque = channels[..., 3] == 255 if picture.has_transparency_data else None
    return mean.astype(np.uint8), opaque


def _invalid(field: str, problem: str) -> InvalidInputError:
    return InvalidInputError(Reason.INVALID_GRID, field, problem)
