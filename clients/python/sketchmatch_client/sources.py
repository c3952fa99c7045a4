"""Functions that make the sketches and maps that a client sends.

These functions check the form of what they are given. Whether a stroke makes an object, or a map
shows anything, is the server's to say.
"""

from __future__ import annotations

import os
import reprlib
import warnings
from array import array
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from numbers import Number, Real
from pathlib import Path
from typing import Any, Literal

from sketchmatch_client.errors import InvalidRequestError, refused_as
from sketchmatch_map_files import (
    PICTURE_SUFFIXES,
    MapFileError,
    find_objects,
    find_picture,
    find_yaml,
    parse,
    text_of,
)
from sketchmatch_proto.v1 import source_pb2

__all__ = [
    "YAxis",
    "file",
    "image",
    "map_server_map",
    "occupancy_grid",
    "polygons",
    "stored_scene",
    "strokes",
]

YAxis = Literal["up", "down"]
"""Which way y grows: screens, tablets and pictures deliver ``"down"``."""

Content = bytes | bytearray | memoryview
"""What is in a file."""

_Y_AXES = {"up": source_pb2.Y_AXIS_UP, "down": source_pb2.Y_AXIS_DOWN}


def strokes(
    strokes: Iterable[Iterable[Sequence[float]]],
    labels: Sequence[Any] | None = None,
    *,
    y_axis: YAxis = "up",
) -> source_pb2.Source:
    """Return a sketch of pen strokes.

    Parameters
    ----------
    strokes
        For each stroke its points, (x, y) or (x, y, seconds); lists or arrays.
    labels
        A name for each stroke, text or a number; None and nan are no name.
    y_axis
        ``"down"`` for points from a screen, tablet or browser. A sketch that is read with the
        wrong axis is its own mirror image, and cannot match.

    Raises
    ------
    InvalidRequestError
        If the points are not of this form.

    Examples
    --------
    >>> table = [(10, 10), (60, 10), (60, 40), (10, 40), (10, 11)]
    >>> sketch = strokes([table, [(100, 80, 0.0), (120, 80, 0.1), (110, 95, 0.2)]], y_axis="down")
    >>> sketch.stroke_set.strokes[1].points[2].time_seconds
    0.2
    """
    with refused_as("INVALID_STROKE", "stroke_set.strokes", "is not a list of strokes"):
        strokes = list(strokes)
    drawn = [
        source_pb2.Stroke(points=_stroke_points(points, f"stroke_set.strokes[{k}].points"))
        for k, points in enumerate(strokes)
    ]
    for stroke, label in zip(drawn, _labels(labels, len(drawn), "strokes"), strict=True):
        stroke.label = label
    return source_pb2.Source(stroke_set=source_pb2.StrokeSet(strokes=drawn, y_axis=_y_axis(y_axis)))


def polygons(
    polygons: Iterable[Sequence[Any]],
    labels: Sequence[Any] | None = None,
    *,
    y_axis: YAxis = "up",
    certainties: Sequence[float | None] | None = None,
) -> source_pb2.Source:
    """Return a sketch or map of polygons.

    Parameters
    ----------
    polygons
        For each object the (x, y) corners of its outline, or a list of such rings: the outline,
        then its holes.
    labels
        A name for each polygon, text or a number; None and nan are no name.
    y_axis
        Which way y grows; see :func:`strokes`.
    certainties
        How certain it is, above 0 and up to 1, that each polygon is one thing; None for 1.

    Raises
    ------
    InvalidRequestError
        If the corners are not of this form, or there are not as many certainties.

    Examples
    --------
    >>> room = polygons([[(0, 0), (2, 0), (2, 1)], [(4, 0), (5, 0), (5, 3)]], ["bed", "desk"])
    >>> [polygon.label for polygon in room.polygon_set.polygons]
    ['bed', 'desk']
    """
    with refused_as("INVALID_POLYGON", "polygon_set.polygons", "is not a list of polygons"):
        polygons = list(polygons)
    drawn = [
        source_pb2.LabelledPolygon(rings=_rings(polygon, f"polygon_set.polygons[{k}]"))
        for k, polygon in enumerate(polygons)
    ]
    for polygon, label in zip(drawn, _labels(labels, len(drawn), "polygons"), strict=True):
        polygon.label = label
    field = "polygon_set.polygons"
    with refused_as("INVALID_FIELD", field, "need certainties that are a number for each"):
        for polygon, certainty in zip(drawn, certainties or [None] * len(drawn), strict=True):
            if certainty is not None:
                polygon.certainty = certainty
    return source_pb2.Source(
        polygon_set=source_pb2.PolygonSet(polygons=drawn, y_axis=_y_axis(y_axis))
    )


def stored_scene(name: str) -> source_pb2.Source:
    """Return a scene that is stored on the server, by its name.

    Raises
    ------
    InvalidRequestError
        If that is no text.

    Examples
    --------
    >>> stored_scene("9f86d081").stored_scene
    '9f86d081'
    """
    with refused_as(
        "INVALID_FIELD", "stored_scene", f"is {reprlib.repr(name)}; give the name of a scene"
    ):
        return source_pb2.Source(stored_scene=name)


def occupancy_grid(
    cells: Any,
    resolution: float,
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    *,
    columns: int | None = None,
) -> source_pb2.Source:
    r"""Return a robot's occupancy grid as a map.

    Parameters
    ----------
    cells
        −1 unknown, 0 free … 100 occupied, row 0 the lowest: a two-dimensional array, a list of
        rows, or one flat row such as bytes or the ``data`` of a ROS ``nav_msgs/OccupancyGrid``.
    resolution
        Metres a cell.
    origin
        Pose (x, y, yaw) of the grid's lower left corner, in metres and radians.
    columns
        Cells in a row, for flat cells (``info.width`` in ROS).

    Raises
    ------
    InvalidRequestError
        If the cells are no rectangle of signed bytes.

    Examples
    --------
    >>> grid = occupancy_grid([[0, 0, 100], [0, -1, 100]], resolution=0.05).occupancy_grid
    >>> grid.rows, grid.columns, grid.cells
    (2, 3, b'\x00\x00d\x00\xffd')
    """
    with refused_as("INVALID_GRID", "occupancy_grid", "needs numbers for resolution and origin"):
        x, y, yaw = origin
        grid = source_pb2.OccupancyGrid(
            resolution_meters=resolution,
            origin=source_pb2.Pose(x_meters=x, y_meters=y, yaw_radians=yaw),
        )
    problem = "is not a rectangle of whole numbers from −1 to 100"
    with refused_as("INVALID_GRID", "occupancy_grid.cells", problem):
        grid.cells, width = _flat_cells(cells)
    width = columns or width
    if not width or len(grid.cells) % width:
        raise InvalidRequestError(
            f"occupancy_grid.columns is {width or 'not given'} for {len(grid.cells)} cells; "
            "give the number of cells in a row",
            "INVALID_GRID",
            "occupancy_grid.columns",
        )
    grid.rows, grid.columns = len(grid.cells) // width, width
    return source_pb2.Source(occupancy_grid=grid)


def map_server_map(path: str | os.PathLike[str]) -> source_pb2.Source:
    """Return a map as ROS map_server saved it.

    Parameters
    ----------
    path
        The .yaml file. The picture that its ``image`` names is read as well; if that is a path of
        another machine, the picture of that name beside the file is used, with a warning. Or the
        picture, if a .yaml beside it names it, or the folder with one map. A file with the map's
        objects beside it, as saved by ``sketchmatch segment --out``, is read as well, with a
        warning.

    Raises
    ------
    InvalidRequestError
        If the file or its picture cannot be read, or it names none.
    """
    field = "map_server_map.yaml"
    with refused_as("INVALID_FILE", field, f"is {reprlib.repr(path)}; give the path of a file"):
        path = Path(path)
    try:
        file = _map_yaml(path)
        text = text_of(_bytes(file, field))
        document = parse(text)
    except MapFileError as error:
        problem = f"{field} ({path}) {error.problem}"
        raise InvalidRequestError(problem, error.reason, field) from None
    if not document.images:
        problem = f"{field} ({file}) names no picture; add a line `image: FILE`"
        raise InvalidRequestError(problem, "INVALID_FILE", field)
    picture, notes = find_picture(file, document)
    data = _bytes(picture, "map_server_map.image", f", as {file} names it")
    objects, more = find_objects(file, document, data)
    for note in (*notes, *more):
        warnings.warn(note, stacklevel=2)
    return source_pb2.Source(
        map_server_map=source_pb2.MapServerMap(yaml=text, image=data, objects=objects or "")
    )


def image(file: str | os.PathLike[str] | Content) -> source_pb2.Source:
    """Return a picture of a map or of a sketch: dark shapes or outlines on light paper.

    Parameters
    ----------
    file
        A PNG, JPEG, WebP, GIF, BMP, TIFF or PGM file, or its bytes.

    Raises
    ------
    InvalidRequestError
        If the file cannot be read.
    """
    data, _ = _content(file, "image.data")
    return source_pb2.Source(image=source_pb2.EncodedImage(data=data))


def file(
    file: str | os.PathLike[str] | Content, *, name: str = "", part: str = ""
) -> source_pb2.Source:
    r"""Return a file that the server reads, such as a drawing of another tool.

    Parameters
    ----------
    file
        The file, such as a ROS bag, or its bytes. :meth:`Client.algorithms` lists other kinds under
        ``readers``.
    name
        Its name, whose ending gives the kind; for bytes, or instead of the file's own.
    part
        Which part of it to read, such as layers of a drawing, one picture of many or the topic
        of a bag.

    Raises
    ------
    InvalidRequestError
        If bytes have no name.
        Or if the file cannot be read.

    Examples
    --------
    >>> file(b'{"shapes": []}', name="room.json").file.name
    'room.json'
    """
    data, own = _content(file, "file")
    name = name or own
    if not name:
        raise InvalidRequestError(
            "file.name is empty; give bytes a name whose ending tells what they are",
            "INVALID_FILE",
            "file.name",
        )
    return source_pb2.Source(file=source_pb2.EncodedFile(name=name, data=data, part=part))


def _map_yaml(path: Path) -> Path:
    """Return the YAML file of a map: a path itself, or beside it, or in it."""
    found = find_yaml(path)
    if found is None and path.suffix.lower() in PICTURE_SUFFIXES:
        raise MapFileError("is a picture that no .yaml beside it names; give the map's .yaml")
    return path if found is None else found[0]


def _content(file: str | os.PathLike[str] | Content, field: str) -> tuple[bytes, str]:
    """Return what is in a file, given by its path or as bytes, and its name."""
    if isinstance(file, Content):
        return bytes(file), ""
    problem = f"is {reprlib.repr(file)}; give the path of a file, or its bytes"
    with refused_as("INVALID_FILE", field, problem):
        path = Path(file)
    return _bytes(path, field), path.name


def _bytes(path: Path, field: str, origin: str = "") -> bytes:
    try:
        return path.read_bytes()
    except (OSError, ValueError) as error:
        cause = getattr(error, "strerror", None) or str(error)
        problem = f"{field} ({path}{origin}) cannot be read: {cause}; check the path"
        raise InvalidRequestError(problem, "INVALID_FILE", field) from error


def _stroke_points(points: Iterable[Sequence[float]], field: str) -> list[source_pb2.StrokePoint]:
    made = []
    with refused_as("INVALID_STROKE", field, "is not a list of points"):
        points = list(points)
    for k, point in enumerate(points):
        with refused_as("INVALID_STROKE", f"{field}[{k}]", "is not (x, y) or (x, y, seconds)"):
            x, y, *time = point
            (seconds,) = time or (None,)
            made.append(source_pb2.StrokePoint(x=x, y=y, time_seconds=seconds))
    return made


def _rings(polygon: Sequence[Any], field: str) -> list[source_pb2.Ring]:
    with refused_as("INVALID_POLYGON", field, "is not a list of (x, y) corners, or of rings"):
        rings = [polygon] if isinstance(polygon[0][0], Real) else polygon
        return [
            source_pb2.Ring(points=[source_pb2.Point(x=x, y=y) for x, y in ring]) for ring in rings
        ]


def _flat_cells(cells: Any) -> tuple[bytes, int]:
    """Return cells as signed bytes, and the cells in a row, 0 if they are flat already."""
    try:
        view = memoryview(cells)
    except TypeError:
        view = None
    if view is not None and view.shape and view.itemsize == 1:
        return view.tobytes(), view.shape[1] if view.ndim == 2 else 0
    rows = list(cells)
    if not rows or isinstance(rows[0], Real):
        return array("b", rows).tobytes(), 0
    widths = {len(row) for row in rows}
    if len(widths) > 1:
        raise ValueError("rows of different lengths")
    return array("b", chain.from_iterable(rows)).tobytes(), widths.pop()


def _labels(labels: Sequence[Any] | None, count: int, what: str) -> Sequence[str]:
    if labels is None:
        return [""] * count
    if isinstance(labels, str | bytes | Mapping):
        raise _refused_label("labels", labels, "give a list of names")
    names = [_name(label, f"labels[{k}]") for k, label in enumerate(labels)]
    if len(names) != count:
        raise InvalidRequestError(
            f"labels has {len(names)} names for {count} {what}; give one for each, or none",
            "INVALID_FIELD",
            "labels",
        )
    return names


def _name(given: Any, field: str) -> str:
    """Return a label as text: people number their objects, from 0 or as ``True``."""
    if given is None or isinstance(given, str):
        # Half a pair of surrogates, as broken files have them, has no place in a message.
        return str(given or "").encode("utf-16-le", "surrogatepass").decode("utf-16-le", "replace")
    if isinstance(given, Number) or type(given).__name__ in ("bool", "bool_"):  # NumPy's own
        return str(given) if given == given else ""  # noqa: PLR0124 (nan, as in tables with gaps)
    raise _refused_label(field, given, "give text")


def _refused_label(field: str, given: Any, remedy: str) -> InvalidRequestError:
    problem = f"{field} is {reprlib.repr(given)}; {remedy}"
    return InvalidRequestError(problem, "INVALID_FIELD", field)


def _y_axis(name: str) -> source_pb2.YAxis.ValueType:
    if name not in _Y_AXES:
        raise InvalidRequestError(
            f"y_axis is {name!r}; give 'up', or 'down' for points from a screen",
            "INVALID_FIELD",
            "y_axis",
        )
    return _Y_AXES[name]
