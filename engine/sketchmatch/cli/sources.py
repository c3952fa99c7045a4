"""Files as sources of requests: as they are, where the contract has room for them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from sketchmatch.api.documents import decode_text, load_json
from sketchmatch.cli.display import say_notes
from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.io.files import (
    file_and_part,
    read_bytes,
    read_here,
    read_map_files,
)
from sketchmatch.io.scene_files import is_of_a_map
from sketchmatch.model import Image, OccupancyGrid, PolygonSet, StrokeSet
from sketchmatch_client import Client, sources
from sketchmatch_map_files import PICTURE_SUFFIXES, is_of
from sketchmatch_proto.v1.source_pb2 import MapServerMap, Source

if TYPE_CHECKING:
    from sketchmatch.cli.answering import Answerer

__all__ = [
    "check_objects_spared",
    "check_spared",
    "content_of",
    "in_metres",
    "is_drawn",
    "is_kept",
    "source_of",
    "source_or_stored",
    "whole_name",
]

_KEPT = "scene:"
_DIGITS = 64


def in_metres(source: Source) -> bool:
    """Whether a source says how long a metre is in it."""
    return source.HasField("map_server_map") or source.HasField("occupancy_grid")


def is_kept(path: Path) -> bool:
    """Whether what was typed for a file names a scene that a server keeps."""
    return str(path).startswith(_KEPT)


def source_or_stored(path: Path, side: str, asked: Answerer) -> Source:
    """Return a file as :func:`source_of` does, or the scene that was typed for it: scene:5f2b.

    Raises
    ------
    InvalidInputError
        If there is none of the name, or no server that could keep any.
    """
    if not is_kept(path):
        return source_of(path, side)
    if not isinstance(asked, Client):
        problem = "is a scene on a server, but no server is given; add --server"
        raise InvalidInputError(Reason.INVALID_FIELD, quoted(str(path)), problem)
    return sources.stored_scene(whole_name(str(path).removeprefix(_KEPT), asked))


def whole_name(name: str, client: Client) -> str:
    """Return the name of the one scene whose name begins so.

    Raises
    ------
    InvalidInputError
        If several do, or none.
    """
    if len(name) >= _DIGITS:
        return name
    if not name:
        problem = "is not the name of a scene; `sketchmatch scenes list` shows all names"
        raise InvalidInputError(Reason.INVALID_FIELD, quoted(name), problem)
    known = [each.name for each in client.list_scenes() if each.name.startswith(name)]
    if len(known) == 1:
        return known[0]
    which = f"is the beginning of the names of {len(known)} scenes; give more characters"
    if not known:
        which = "is not the beginning of a scene's name; `sketchmatch scenes list` shows all names"
    raise InvalidInputError(Reason.INVALID_FIELD, quoted(name), which)


def source_of(path: Path, side: str = "") -> Source:
    """Return a file as a source: pictures, maps and other tools' files as they are, others decoded.

    Parameters
    ----------
    path
        The file.
    side
        What it is to a person, to begin notes with.

    Raises
    ------
    InvalidInputError
        If it cannot be read; what is in files that stay as they are is looked at where they are
        decoded.
    """
    if (files := read_map_files(path)) is not None:
        say_notes(side, files.notes, verbose=True)
        return Source(
            map_server_map=MapServerMap(yaml=files.yaml, image=files.picture, objects=files.objects)
        )
    file, part = file_and_part(path)
    if not part and file.suffix.lower() in PICTURE_SUFFIXES:
        if file.suffix.lower() == ".pgm":
            note = f"{path.name} was read as a drawing; if it is a robot's map, give its .yaml"
            say_notes(side, [note], verbose=True)
        return sources.image(read_bytes(file))
    source = read_here(path)
    # Messages of strokes have no room for what is written beside them.
    if source is None or (isinstance(source, StrokeSet) and source.landmarks):
        return sources.file(read_bytes(file), name=file.name, part=part)
    # The messages of what is decoded already have no room for notes.
    say_notes(side, getattr(source, "notes", ()), verbose=True)
    match source:
        case OccupancyGrid(cells, resolution, origin):
            return sources.occupancy_grid(cells, resolution, origin)
        case StrokeSet(strokes):
            return sources.strokes(
                [_timed(stroke.points, stroke.times) for stroke in strokes],
                [stroke.label for stroke in strokes],
            )
        case PolygonSet(polygons):
            packed = sources.polygons(
                [[ring.tolist() for ring in polygon.rings] for polygon in polygons],
                [polygon.label for polygon in polygons],
            )
            for message, polygon in zip(packed.polygon_set.polygons, polygons, strict=True):
                if polygon.certainty < 1.0:
                    message.certainty = polygon.certainty
            return packed
        case Image():
            raise AssertionError("pictures pass as they are")


def check_spared(path: Path, field: str, *given: Path | None) -> None:
    """Refuse to save under the path of what is read, or of the picture of a map that is.

    Parameters
    ----------
    path, field
        Where something shall be saved, and what an error calls it.
    given
        The files that are read.

    Raises
    ------
    InvalidInputError
        If one of them would be lost.
    """
    for each in filter(None, given) if path.is_file() else ():
        file, _ = file_and_part(each)
        if not file.exists():
            continue
        files = read_map_files(file)
        if path.samefile(file) or (files and path.read_bytes() == files.picture):
            problem = f"is {str(path)!r}, which is read here and would be lost; give another name"
            raise InvalidInputError(Reason.INVALID_FILE, field, problem)


def check_objects_spared(out: Path, map_: Path) -> None:
    """Refuse to replace what people say a map's objects are, where it is not read for the map.

    Raises
    ------
    InvalidInputError
        If it would be lost.
    """
    content = content_of(map_) if is_of_a_map(out) and out.is_file() else ""
    if content and not is_of(load_json(decode_text(read_bytes(out))), content):
        problem = (
            f"is {str(out)!r}, which was made for another state of the map and would be lost; give "
            "another name, or add --segmenter occupancy-grid to start again from the map"
        )
        raise InvalidInputError(Reason.INVALID_FILE, "--out", problem)


def is_drawn(source: Source) -> bool:
    """Whether a source is of strokes."""
    return source.HasField("stroke_set") or source.file.name.lower().endswith(".svg")


def content_of(path: Path) -> str:
    """Return by what a file with objects knows a robot's map; empty for every other file."""
    files = read_map_files(path)
    return "" if files is None else files.content


def _timed(points: Any, times: Any) -> list[Any]:
    if times is None:
        return list(points.tolist())
    return [(*point, time) for point, time in zip(points.tolist(), times.tolist(), strict=True)]
