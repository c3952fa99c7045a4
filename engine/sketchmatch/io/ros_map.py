"""Robots' maps as ROS ``map_server`` saves them: a YAML file beside a picture.

All keys but ``mode`` are required, as map_server requires them; others are ignored::

    image: office.pgm             # relative to the YAML file
    resolution: 0.05              # metres a cell
    origin: [-10.0, -10.0, 0.0]   # x, y, yaw of the lower left corner, metres and radians
    negate: 0                     # 1: white is occupied
    occupied_thresh: 0.65
    free_thresh: 0.196
    mode: trinary                 # or scale, or raw, in capitals or not

A pixel of value v is occupied with p = (255 − v)/255, or v/255 where negated; v is the mean of
its colours. In mode ``trinary`` p > occupied_thresh is occupied (100), p < free_thresh free (0)
and the rest unknown (−1); ``scale`` spreads the rest from 0 to 100; ``raw`` takes v itself, and
unknown where it is above 100. Pictures of 16 bits a channel are read with 8.

There is a trap: map_saver writes unknown cells as the grey 205 (p = 0.19608), and most of nav2's
configurations say free_thresh 0.25 beside it, by which a robot takes them for free. Here they are
unknown where they are many, and lighter cells are free, in mode ``trinary``; the grid's notes say
it, and its picture keeps what the thresholds alone would say.

Other tools name things of the place in the same file, as in
``table: {type: furniture, pose: [4.0, -4.7, 0, 0]}``; the grid has them as its landmarks.

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
``mode``               in small letters           also Trinary and TRINARY   as nav2
``negate``             a whole number             that, or true and false    0, 1, true, false
a key that is twice    the first                  the first                  that, and a note
yaw of nan             no pose                    no pose                    0, and a note
=====================  =========================  =========================  ====================

Map savers write a yaw of nan where the map came without an orientation.

References
----------
.. [1] https://wiki.ros.org/map_server and ``image_loader.cpp`` of ros-planning/navigation.
.. [2] ``nav2_map_server/src/map_io.cpp`` of ros-navigation/navigation2.
"""

from __future__ import annotations

import io
import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import PIL.Image
from numpy.typing import NDArray

from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.io.images import load_picture, scaled_to_8_bits
from sketchmatch.io.map_objects import with_objects
from sketchmatch.model import GridPicture, Landmark, OccupancyGrid
from sketchmatch.model.sources import check_placement
from sketchmatch_map_files import MapFileError, content_of, parse

__all__ = [
    "MapServerHeader",
    "decode_map_server",
    "encode_map_server",
    "header_for",
    "in_yaml",
    "parse_header",
]

_EXAMPLES = {
    "image": "office.pgm",
    "resolution": "0.05",
    "origin": "[-10.0, -10.0, 0.0]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.196",
}
_KEYS = (*_EXAMPLES, "mode")
_VALUES = _KEYS[1:]
"""Those that are not about files."""
_MODES = ("trinary", "scale", "raw")
_MANY = 0.01
"""As a share of all cells."""
_MOST_LANDMARKS = 1000
_NUMBER = re.compile(r"[+-]?(\d++\.?+\d*+|\.\d++)([eE][+-]?\d++)?+", re.ASCII)
_TRUE, _FALSE = ("true", "yes", "on", "y"), ("false", "no", "off", "n")
_SAVED_PGM = re.compile(rb"P5\s+(?:#[^\n]*\n\s*)*\d+\s+\d+\s+255\s")
_SAVED_GREYS = bytes((0, 205, 254, 255))
_CREATOR = re.compile(rb"^# CREATOR: [^\n]* (\d+\.\d+) m/pix", re.MULTILINE)
_PLACES = ("pose", "position", "location", "centroid")
_NAMES = ("name", "label")


@dataclass(frozen=True)
class MapServerHeader:
    """What the YAML file says.

    Attributes
    ----------
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
    landmarks
        Things of the place that it names.
    """

    resolution: float
    origin: tuple[float, float, float]
    negate: bool
    occupied_thresh: float
    free_thresh: float
    mode: str
    notes: tuple[str, ...] = ()
    landmarks: tuple[Landmark, ...] = ()

    def text(self, picture: str) -> str:
        """Return what the YAML file of a picture says, which is read as this again.

        Examples
        --------
        >>> header = MapServerHeader(0.05, (-1.0, 2.0, 0.0), False, 0.65, 0.25, "trinary")
        >>> print(header.text("floor #2.pgm"), end="")
        image: "floor #2.pgm"
        mode: trinary
        resolution: 0.05
        origin: [-1.0, 2.0, 0.0]
        negate: 0
        occupied_thresh: 0.65
        free_thresh: 0.25
        """
        x, y, yaw = map(float, self.origin)
        return (
            f"image: {in_yaml(picture)}\nmode: {self.mode}\n"
            f"resolution: {float(self.resolution)!r}\norigin: [{x!r}, {y!r}, {yaw!r}]\n"
            f"negate: {self.negate:d}\noccupied_thresh: {self.occupied_thresh!r}\n"
            f"free_thresh: {self.free_thresh!r}\n"
        )

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
        notes, picture = self.notes, None
        if self.mode == "trinary":
            picture = self._picture(values, opaque)
            notes = (*notes, *self._restore_unknown(cells[::-1], picture))
        return OccupancyGrid(
            cells[::-1], self.resolution, self.origin, notes, picture, self.landmarks
        )

    def _picture(self, values: NDArray[np.uint8], opaque: NDArray[np.bool_] | None) -> GridPicture:
        shades = values.copy() if self.negate else 255 - values
        if opaque is not None:
            shades[~opaque] = 255
        return GridPicture(shades[::-1], self.free_thresh)

    def _restore_unknown(self, cells: NDArray[np.int8], picture: GridPicture) -> tuple[str, ...]:
        """Make cells unknown that were saved so and read as free; return what there is to say."""
        saved = (picture.shades == picture.saved_unknown) & (cells == 0)
        share = np.count_nonzero(saved) / cells.size
        # Without lighter cells they are all that is free, and nobody's unknown.
        if share < _MANY or np.count_nonzero(cells == 0) / cells.size - share < _MANY:
            return ()
        cells[saved] = -1
        return (
            f"{share:.0%} of the map has the grey {picture.saved_unknown if self.negate else 205}, "
            "with which map_server saves unknown cells; they stay unknown, although free_thresh "
            f"{self.free_thresh:g} makes them free; set keep_unknown to false to have them free",
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


def decode_map_server(
    yaml_text: str, image: bytes, objects: str = "", own_objects: bool = False
) -> OccupancyGrid:
    """Decode a map from the contents of its files.

    Parameters
    ----------
    yaml_text
        The YAML file. Its ``image`` is not looked at: no path of a caller's is ever opened.
    image
        The picture's file.
    objects
        The file that says what its objects are, if there is one.
    own_objects
        Whether these are of this map though they do not say so.

    Raises
    ------
    InvalidInputError
        With a path within ``yaml`` or ``objects``, or the path ``image``, if one cannot be used.
    """
    try:
        header = parse_header(yaml_text)
    except InvalidInputError as error:
        raise error.within("yaml") from None
    grid = header.grid(image)
    if not objects:
        return grid
    return with_objects(grid, objects, None if own_objects else content_of(parse(yaml_text), image))


def encode_map_server(grid: OccupancyGrid, picture: str = "map.png") -> tuple[str, bytes]:
    """Return a grid's cells as the contents of a map's two files.

    Parameters
    ----------
    grid
        What to save; what its file named, and what people say its objects are, is left out.
    picture
        What the YAML file calls the picture.

    Returns
    -------
    yaml_text, image
        In mode ``scale`` with unknown cells transparent, so that each occupancy is read again as it
        was, and browsers show walls dark on light floors. The picture is a PNG.

    Examples
    --------
    >>> cells = np.array([[-1, 0], [63, 100]])
    >>> decode_map_server(*encode_map_server(OccupancyGrid(cells, 0.05))).cells.tolist()
    [[-1, 0], [63, 100]]
    """
    shades = np.zeros((256, 2), np.uint8)
    shades[:101, 0] = np.rint(255.0 - 2.55 * np.arange(101))
    shades[:101, 1] = 255
    # ROS 1 takes what is transparent for unknown where its grey is between the thresholds.
    shades[255, 0] = 128
    file = io.BytesIO()
    pixels = shades[grid.cells[::-1].view(np.uint8)]
    PIL.Image.fromarray(pixels, "LA").save(file, "PNG", compress_level=1)
    header = MapServerHeader(grid.resolution, grid.origin, False, 1.0, 0.0, "scale")
    return header.text(picture), file.getvalue()


def in_yaml(text: str) -> str:
    """Return a text as YAML writes it, whatever is in it: quoted, as JSON is, which it contains."""
    # Not in ASCII: of JSON's pairs of escapes for one character YAML makes two, or nothing.
    return json.dumps(text, ensure_ascii=False)


def parse_header(yaml_text: str) -> MapServerHeader:
    """Read and check the YAML file's text.

    Raises
    ------
    InvalidInputError
        With the key at fault as its path, if it is not YAML, a key is missing or its value is
        of no use.
    """
    try:
        document = parse(yaml_text)
    except MapFileError as error:
        raise InvalidInputError(Reason(error.reason), "", error.problem) from None
    values = document.values
    for key, example in _EXAMPLES.items():
        if values.get(key) is None:
            raise _invalid(key, f"is missing; add it, for instance '{key}: {example}'")
    if not document.images:
        raise _invalid("image", "is not a file name; give the picture's path")
    origin, notes = _origin(values["origin"])
    landmarks = tuple(dict.fromkeys(_landmarks(values)))
    if len(landmarks) > _MOST_LANDMARKS:
        landmarks = landmarks[:_MOST_LANDMARKS]
        notes = (*notes, f"only the first {_MOST_LANDMARKS} named places of the map's YAML count")
    header = MapServerHeader(
        resolution=_number(values["resolution"], "resolution"),
        origin=origin,
        negate=_negate(values["negate"]),
        occupied_thresh=_number(values["occupied_thresh"], "occupied_thresh"),
        free_thresh=_number(values["free_thresh"], "free_thresh"),
        mode=_mode(values.get("mode")),
        notes=(
            *notes,
            *(_repeated(key, values[key]) for key in document.repeated if key in _VALUES),
        ),
        landmarks=landmarks,
    )
    _check_ranges(header)
    return header


def header_for(name: str, picture: bytes) -> tuple[str, str] | None:
    """Return a YAML text for a map whose own is lost, and a sentence that says what was assumed.

    Parameters
    ----------
    name
        The picture's.
    picture
        A PGM file, which ROS 1 gives a comment with its resolution.

    Returns
    -------
    tuple or None
        None if it does not look as map_server saves maps: binary, with many cells of the greys
        205 and 254, and with no others but black, and the white with which people clean maps.
    """
    start = _SAVED_PGM.match(picture)
    if start is None:
        return None
    cells = picture[start.end() :]
    if cells.translate(None, _SAVED_GREYS):
        return None
    if min(cells.count(b"\xcd"), cells.count(b"\xfe")) < _MANY * len(cells):
        return None
    said = _CREATOR.search(start[0])
    resolution = float(said[1]) if said else 0.0
    known = 0.0 < resolution < 1e3
    header = MapServerHeader(
        resolution if known else 0.05, (0.0, 0.0, 0.0), False, 0.65, 0.196, "trinary"
    )
    cell = f"{resolution:g} m, as it says" if known else "0.05 m"
    return header.text(name), (
        f"{name} looks like a map that map_server saved, but no YAML beside it names it; it was "
        f"read with cells of {cell}, and its lower left corner as the origin; give its YAML if "
        "that is wrong"
    )


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


def _repeated(key: str, value: object) -> str:
    return f"the map's YAML has {key} twice, and the first, {quoted(value)}, was used"


def _origin(value: object) -> tuple[tuple[float, float, float], tuple[str, ...]]:
    if not isinstance(value, list) or len(value) != 3:
        raise _invalid("origin", "is not a list of three numbers; give [x, y, yaw]")
    x, y = (_number(part, f"origin[{k}]") for k, part in enumerate(value[:2]))
    # ROS 1 writes nan or -nan, nav2 .nan.
    if isinstance(value[2], str) and value[2].strip().lower().lstrip("+-.") == "nan":
        return (x, y, 0.0), ("the yaw of the map's origin is nan and was read as 0",)
    return (x, y, _number(value[2], "origin[2]")), ()


def _negate(value: object) -> bool:
    if isinstance(value, str):
        if (number := _float(value)) in (0.0, 1.0):
            return bool(number)
        if value.strip().lower() in (*_TRUE, *_FALSE):
            return value.strip().lower() in _TRUE
    raise _invalid("negate", f"is {_as_written(value)}; give 0, or 1 where white is occupied")


def _mode(value: object) -> str:
    mode = "trinary" if value is None else value
    if not isinstance(mode, str) or mode.strip().lower() not in _MODES:
        raise _invalid("mode", f"is {quoted(value)}; give trinary, scale or raw")
    return mode.strip().lower()


def _number(value: object, key: str) -> float:
    number = _float(value)
    if number is None or not math.isfinite(number):
        raise _invalid(key, f"is {_as_written(value)}; give a finite number")
    return number


def _float(value: object) -> float | None:
    """Return the number that a text is to map_server, which reads decimal ones alone."""
    if not isinstance(value, str) or not _NUMBER.fullmatch(value.strip()):
        return None
    return float(value)


def _as_written(value: object) -> str:
    """Return a value as a sentence may quote it: numbers, those of YAML too, without quotes."""
    number = value.strip().lower().replace(".nan", "nan") if isinstance(value, str) else ""
    number = number.replace(".inf", "inf")
    try:
        return f"{float(number):g}"
    except ValueError:
        return quoted(value)


def _landmarks(values: Mapping[str, Any]) -> Iterator[Landmark]:
    for key, value in values.items():
        if key not in _KEYS:
            yield from _named_within(key, value)


def _named_within(key: str, value: object) -> Iterator[Landmark]:
    """Yield the thing that a value describes, or those that are listed in it."""
    if isinstance(value, list):
        for item in value:
            yield from _named_within(key, item)
    elif isinstance(value, dict):
        name = next((value[each] for each in _NAMES if isinstance(value.get(each), str)), "")
        place = next((value[each] for each in _PLACES if each in value), value if name else None)
        point = _point(place)
        if point is not None:
            kind = value.get("type")
            yield Landmark(name or key, point, kind if isinstance(kind, str) else "")
            return
        for inner, item in value.items():
            yield from _named_within(inner, item)


def _point(place: object) -> tuple[float, float] | None:
    if isinstance(place, dict) and "position" in place:
        place = place["position"]
    if isinstance(place, dict):
        place = [place.get("x"), place.get("y")]
    if not isinstance(place, list) or len(place) < 2:
        return None
    x, y = (_float(each) for each in place[:2])
    return (x, y) if x is not None and y is not None and math.isfinite(x + y) else None


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
