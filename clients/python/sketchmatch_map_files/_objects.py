"""The file beside a robot's map that says what its objects are, known by the map's content."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sketchmatch_map_files import Document

__all__ = ["OBJECTS_SUFFIX", "content_of", "find_objects", "is_of"]

OBJECTS_SUFFIX = ".objects.geojson"
"""What the name of such a file ends in; before it stands that of the map."""

MOST_BYTES = 16 * 1024 * 1024
"""Of such a file."""

_KEYS = ("resolution", "origin", "negate", "occupied_thresh", "free_thresh", "mode")
# Enough that no two maps have the same by chance, and short enough for a table of a GIS.
_DIGITS = 16
_MOST_FILES = 50


def content_of(document: Document, picture: bytes) -> str:
    """Return a name for a map's content: the picture, and what the YAML says of its cells.

    Names of files, comments and places that are named do not count.
    """
    said = [[key, _plain(document.values[key])] for key in _KEYS if key in document.values]
    content = hashlib.sha256(json.dumps(said).encode())
    content.update(picture)
    return f"sha256:{content.hexdigest()[:_DIGITS]}"


def is_of(features: Any, content: str) -> bool:
    """Whether parsed GeoJSON says that it holds the objects of a map of this content.

    One feature that says so is enough: those that people add do not. Tools keep a feature's
    properties, and drop what else a file says.
    """
    return content in _contents(features)


def find_objects(
    file: Path, document: Document, picture: bytes
) -> tuple[str | None, tuple[str, ...]]:
    """Return the text of the file with a map's objects, and what there is to say of it.

    It is that with the map's name, or else another one beside it, of a map of the same content:
    map files get other names. Files that were made for an earlier state of the map are not read.

    Parameters
    ----------
    file
        The map's YAML, or its picture where it has none.
    document, picture
        What is in the map's files.
    """
    content = content_of(document, picture)
    own = file.with_name(f"{file.stem}{OBJECTS_SUFFIX}")
    stale: tuple[str, ...] = ()
    for path in _candidates(own):
        text = _text_of(path)
        if text is None:
            continue
        said: set[str] = set()
        try:
            said = _contents(json.loads(text))
            mine = content in said
        except (ValueError, RecursionError):
            # Whoever reads it says what is wrong with it.
            mine = path == own
        if mine:
            note = f"the objects are from {path.name} beside the map, unless a segmenter is chosen"
            return text, (note,)
        if path == own:
            stale = (_ignored(own.name, file.name, "" if said else content),)
    return None, stale


def _ignored(own: str, file: str, content: str) -> str:
    """Return what is said of a file that is not read; the content is one that it fails to name."""
    why, remedy = "was made for an earlier state of the map", ""
    if content:
        why = "does not say for which state of the map it was made"
        remedy = f"add map={content} to the properties of a feature, or "
    anew = f"`sketchmatch segment {file} --segmenter occupancy-grid --out {own}`"
    return f"{own} {why} and was ignored; {remedy}replace it and all that is in it with {anew}"


def _candidates(own: Path) -> Iterator[Path]:
    yield own
    try:
        beside = sorted(own.parent.glob(f"*{OBJECTS_SUFFIX}"))
    except OSError:
        return
    yield from (path for path in beside[:_MOST_FILES] if path != own)


def _text_of(path: Path) -> str | None:
    try:
        if not path.is_file() or path.stat().st_size > MOST_BYTES:
            return None
        return path.read_bytes().decode("utf-8-sig")
    except (OSError, ValueError):
        return None


def _contents(features: Any) -> set[str]:
    """Return of which maps parsed GeoJSON says that it is."""
    if not isinstance(features, dict):
        return set()
    listed = features.get("features")
    members = [features, *(listed if isinstance(listed, list) else [])]
    properties = (each.get("properties") for each in members if isinstance(each, dict))
    said = (each.get("map") for each in properties if isinstance(each, dict))
    return {each for each in said if isinstance(each, str)}


def _plain(value: Any) -> Any:
    """Return numbers that are written otherwise as the same."""
    if isinstance(value, list):
        return [_plain(each) for each in value]
    try:
        return float(value)
    except (TypeError, ValueError):
        return value
