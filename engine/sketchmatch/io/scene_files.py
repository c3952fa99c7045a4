"""Scenes as files, so that what was found in a source can be kept and read again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from sketchmatch.io._targets import check_target, writing
from sketchmatch.model import FloatArray, Scene, SceneObject
from sketchmatch_map_files import OBJECTS_SUFFIX

__all__ = ["check_scene_path", "encode_geojson", "is_of_a_map", "save_scene"]


def encode_geojson(scene: Scene, content: str = "") -> str:
    """Return a scene as a GeoJSON ``FeatureCollection`` that reads back as the very same scene.

    Each object is a ``Polygon`` with its holes and the property ``label``, and ``certainty`` where
    that is below 1, in the scene's order and coordinates. With the ``content`` of a robot's map
    each has it as the property ``map``, so that the file is known as that of the map's objects.

    Examples
    --------
    >>> scene = Scene.from_polygons([[[0, 0], [1, 0], [0, 1]], [[3, 0], [4, 0], [3, 1]]])
    >>> encode_geojson(scene).splitlines()[0]
    '{"type": "FeatureCollection", "crs": null, "features": ['
    """
    features = ",\n".join(
        json.dumps(_feature(item, content), ensure_ascii=False, allow_nan=False)
        for item in scene.objects
    )
    return f'{{"type": "FeatureCollection", "crs": null, "features": [\n{features}\n]}}\n'


def check_scene_path(path: str | Path, field: str = "out") -> None:
    """Refuse a path that no scene can be saved under, before any work is done.

    Parameters
    ----------
    path
        Where it shall be.
    field
        What an error calls it.

    Raises
    ------
    InvalidInputError
        If the name's ending is not .geojson, or its folder does not exist.
    """
    check_target(path, field, (".geojson",), ".geojson")


def is_of_a_map(path: str | Path) -> bool:
    """Whether a file of this name beside a robot's map holds that map's objects."""
    return Path(path).name.endswith(OBJECTS_SUFFIX)


def save_scene(path: str | Path, scene: Scene, field: str = "out", content: str = "") -> None:
    """Save a scene as GeoJSON, as :func:`encode_geojson` writes it.

    Raises
    ------
    InvalidInputError
        If the name's ending is not .geojson, or the file cannot be written.
    """
    check_scene_path(path, field)
    with writing(path, field):
        # What UTF-8 cannot hold is escaped as JSON escapes it.
        Path(path).write_bytes(encode_geojson(scene, content).encode("utf-8", "backslashreplace"))


def _feature(item: SceneObject, content: str) -> dict[str, Any]:
    return {
        "type": "Feature",
        "properties": {
            "label": item.label,
            **({"certainty": item.certainty} if item.certainty < 1.0 else {}),
            **({"map": content} if content else {}),
        },
        "geometry": {"type": "Polygon", "coordinates": [_closed(ring) for ring in item.rings]},
    }


def _closed(ring: FloatArray) -> list[list[float]]:
    # Of the two equal ends readers drop the first, so the last point is the one to repeat.
    points: list[list[float]] = ring.tolist()
    return [points[-1], *points]
