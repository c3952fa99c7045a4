"""A contact sheet: every map, floor and drawing at hand as it is segmented by default.

``python -m tests.look [sheet.png]`` draws it. What a person counts there is in ``BY_EYE``, what is
found in the title of each picture; hollow is what is in doubt;
``tests/plugins/test_look.py`` holds both, so that no change of a count goes by unseen.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from sketchmatch.errors import InvalidInputError
from sketchmatch.io import read_source
from sketchmatch.model import Image, OccupancyGrid, PolygonSet, Scene, Source, StrokeSet
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.selection import Choice
from sketchmatch.registry import default_registry
from tests.tools import ROOT

__all__ = ["BY_EYE", "found", "pictures", "sheet"]

DATA = ROOT.parent / "shared" / "data"
EXAMPLES = ROOT / "engine" / "sketchmatch" / "examples"

BY_EYE: dict[str, tuple[int, int]] = {
    "ogm/aws-small-house/map.yaml": (28, 27),
    "ogm/elsabot-downstairs/downstairs.yaml": (11, 12),
    "ogm/husky-playpen/playpen_map.yaml": (18, 19),
    "ogm/josefgst-ros-map12/ros_map12.yaml": (18, 25),
    "ogm/marrtino-montreal/montreal.yaml": (9, 9),
    "ogm/nav2-depot/depot.yaml": (21, 18),
    "ogm/pmb2-small-office/map.yaml": (17, 17),
    "ogm/tb4-warehouse/warehouse.yaml": (28, 28),
    "ogm/turtlebot3/map.yaml": (9, 9),
    "floors-ipa/Freiburg101_scan.png": (12, 10),
    "floors-ipa/Freiburg52_scan.png": (10, 9),
    "floors-ipa/lab_a_scan.png": (46, 60),
    "floors-ipa/lab_c_scan.png": (17, 20),
    "floors-ipa/lab_intel.png": (26, 28),
    "floors-ipa/office_a.png": (27, 30),
    "floors-ipa/office_c.png": (34, 34),
    "floors-ipa/office_e.png": (32, 37),
    "floors-ipa/office_g.png": (36, 36),
    "floors-ipa/office_i.png": (27, 27),
    "sketches/rooms-rsi/sketches/01.png": (5, 4),
    "sketches/rooms-rsi/sketches/02.png": (5, 6),
    "sketches/rooms-rsi/sketches/06.png": (4, 5),
    "sketches/rooms-rsi/sketches/07.png": (4, 5),
    "sketches/rooms-rsi/sketches/11.png": (4, 4),
    "sketches/rooms-rsi/robot-maps-hih/layout.png": (5, 5),
}
"""What a person counts, things of robots' maps and rooms of others, and what is found."""

_WIDE, _HIGH, _TITLE, _COLUMNS = 300, 280, 20, 8


def pictures() -> list[Path]:
    """Return the files of all maps, floors and drawings, of those that are there."""
    patterns = (
        "ogm/*/*.yaml",
        "floors-ipa/*.png",
        "sketches/*/*.png",
        "sketches/*/*/*.png",
        "sketches/objects-on-real-maps/*.json",
    )
    shared = [path for pattern in patterns for path in sorted(DATA.glob(pattern))]
    examples = [
        path
        for suffix in ("yaml", "svg", "geojson")
        for path in sorted(EXAMPLES.rglob(f"*.{suffix}"))
    ]
    return [
        path
        for path in (*shared, *examples)
        if "_gt_" not in path.name and path.name != "truth.json"
    ]


def found(path: Path) -> tuple[Source, Scene | None, str]:
    """Return a source, its scene or None, and what was found in words."""
    source, name = read_source(path), ""
    if path.parent.name == "floors-ipa":
        assert isinstance(source, Image)
        grey = source.pixels if source.pixels.ndim == 2 else source.pixels[:, :, 0]
        cells = np.where(grey > 250, 0, 100).astype(np.int8)[::-1]
        source = OccupancyGrid(cells, 0.05)
    if "floors-ipa" in path.parts or "rooms-rsi" in path.parts:
        name = "rooms"
    engine = Engine(default_registry())
    try:
        segmenter = engine.resolve_segmenter(Choice(name), source)
        scene = engine.segment(source, segmenter, source.field).scene
    except InvalidInputError as error:
        return source, None, f"refused: {error.problem}"
    return source, scene, f"{len(scene)} by {segmenter.name}"


def sheet(paths: list[Path]) -> NDArray[np.uint8]:
    """Return one picture of them all."""
    tiles = [_tile(path) for path in paths]
    tiles += [np.zeros_like(tiles[0])] * (-len(tiles) % _COLUMNS)
    rows = [np.hstack(tiles[k : k + _COLUMNS]) for k in range(0, len(tiles), _COLUMNS)]
    return np.asarray(np.vstack(rows), dtype=np.uint8)


def _tile(path: Path) -> NDArray[np.uint8]:
    source, scene, words = found(path)
    tile = np.full((_HIGH + _TITLE, _WIDE, 3), 40, np.uint8)
    low, high = _extent(source)
    scale = float(min((_WIDE - 4) / (high[0] - low[0]), (_HIGH - 4) / (high[1] - low[1])))

    def placed(points: NDArray[np.float64]) -> NDArray[np.int32]:
        x, y = ((points - low) * scale).T
        return np.stack([x + 2, _TITLE + _HIGH - 2 - y], axis=1).astype(np.int32)

    _ground(tile, source, placed)
    colours = np.random.default_rng(3).integers(90, 256, (2000, 3)).tolist()
    for colour, item in zip(colours, scene.objects if scene else (), strict=False):
        rings = [placed(np.asarray(ring, dtype=np.float64)) for ring in item.rings]
        if not item.doubtful:
            cv2.fillPoly(tile, rings, colour)
        cv2.polylines(tile, rings, True, colour if item.doubtful else (0, 0, 0), 1)
    eye = BY_EYE.get(_key(path))
    title = (
        f"{path.parent.name[:14]}/{path.stem[:16]}: {words[:24]}{f' eye {eye[0]}' if eye else ''}"
    )
    cv2.putText(tile, title, (3, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.34, (255, 255, 255), 1)
    return tile


def _key(path: Path) -> str:
    return str(path.relative_to(DATA)) if path.is_relative_to(DATA) else path.name


def _extent(source: Source) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    match source:
        case OccupancyGrid():
            rows, columns = source.cells.shape
            low = np.array(source.origin[:2])
            return low, low + source.resolution * np.array([columns, rows])
        case Image():
            rows, columns = source.pixels.shape[:2]
            return np.zeros(2), np.array([columns, rows], dtype=float)
        case _:
            points = np.concatenate(_lines(source))
            return points.min(axis=0), points.max(axis=0) + 1e-9


def _lines(source: StrokeSet | PolygonSet) -> list[NDArray[np.float64]]:
    if isinstance(source, StrokeSet):
        return [stroke.points for stroke in source.strokes]
    return [np.asarray(ring) for polygon in source.polygons for ring in polygon.rings]


def _ground(tile: NDArray[np.uint8], source: Source, placed: object) -> None:
    """Draw what was given, dark, under what was found."""
    assert callable(placed)
    if isinstance(source, (OccupancyGrid, Image)):
        low, high = _extent(source)
        (left, bottom), (right, top) = placed(np.array([low, high]))
        if isinstance(source, OccupancyGrid):
            grey = np.where(source.cells[::-1] == 0, 110, 60).astype(np.uint8)
        else:
            grey = source.pixels if source.pixels.ndim == 2 else source.pixels[:, :, 0]
            grey = grey // 3 + 20
        shown = cv2.resize(
            grey, (int(right - left), int(bottom - top)), interpolation=cv2.INTER_AREA
        )
        tile[top:bottom, left:right] = shown[:, :, None]
    else:
        for line in _lines(source):
            cv2.polylines(tile, [placed(line)], False, (120, 120, 120), 1)


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "look.png")
    cv2.imwrite(str(target), sheet(pictures()))
    print(f"wrote {target}")
