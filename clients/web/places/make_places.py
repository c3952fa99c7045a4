"""Make the five places of the gallery again: ``python clients/web/places/make_places.py``.

The living room is the engine's bundled example. The others are drawn as a careful robot maps them:
ragged walls, what is solid unknown inside. The sketches are a simulated person's.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from sketchmatch.examples.make_living_room import living_room, map_living_room
from sketchmatch.model import OccupancyGrid, Scene, SceneObject
from sketchmatch.testing import simulate_sketch
from sketchmatch.testing.drawing import draw_strokes
from sketchmatch.testing.lidar import World

_PAGE = (760.0, 520.0)
_MARGIN = 60.0
_RESOLUTION = 0.05


def _box(x, y, width, depth, degrees=0.0):
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [width / 2, depth / 2]
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return corners @ np.array([[c, s], [-s, c]]) + [x, y]


def _round(x, y, width, depth=None, corners=28):
    angles = np.arange(corners) * (2.0 * np.pi / corners)
    outline = np.stack([np.cos(angles) * width / 2, np.sin(angles) * (depth or width) / 2], axis=1)
    return outline + np.array([x, y])


def _bent(x, y, width, depth, arm, degrees=0.0):
    corners = np.array(
        [[0, 0], [width, 0], [width, arm], [arm, arm], [arm, depth], [0, depth]], dtype=float
    ) - [width / 2, depth / 2]
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return corners @ np.array([[c, s], [-s, c]]) + [x, y]


def _room(width, depth, door):
    """Return walls with a door in the lower one, which is shut."""
    return (
        np.array(
            [[door, 0], [0, 0], [0, depth], [width, depth], [width, 0], [door + 0.9, 0], [door, 0]],
            dtype=float,
        ),
    )


_PLACES = {
    "kitchen": (
        _room(6.4, 5.0, 4.6),
        {
            "kitchen island": _box(3.3, 2.75, 2.1, 0.9),
            "fridge": _box(0.95, 4.05, 0.75, 0.8),
            "stove": _box(3.0, 4.25, 0.7, 0.6),
            "dining table": _round(5.15, 3.55, 1.25),
            "bench": _box(1.0, 1.9, 0.45, 1.9),
            "bin": _round(2.4, 0.85, 0.5),
        },
    ),
    "office": (
        _room(8.0, 6.0, 0.8),
        {
            "desk": _box(1.9, 4.6, 1.7, 0.85, 8),
            "corner desk": _bent(6.4, 4.6, 1.9, 1.7, 0.75, 180),
            "meeting table": _round(4.6, 2.3, 2.2, 1.2),
            "printer": _box(7.0, 1.0, 0.7, 0.7),
            "cabinet": _box(1.0, 2.4, 0.55, 1.3),
            "plant": _round(4.1, 5.1, 0.5),
            "sofa": _box(2.9, 0.95, 1.7, 0.75, -3),
        },
    ),
    "workshop": (
        _room(9.0, 6.4, 6.6),
        {
            "workbench": _box(2.3, 5.4, 2.8, 0.8),
            "lathe": _box(5.6, 5.2, 1.7, 0.7, 14),
            "saw": _box(7.6, 4.0, 1.0, 1.4, -10),
            "pallet": _box(4.2, 3.1, 1.2, 0.95, 24),
            "shelf": _box(0.9, 2.6, 0.5, 2.2),
            "drum": _round(2.7, 1.2, 0.7),
            "crate": _box(5.4, 1.1, 0.8, 0.8, 40),
            "charging dock": _box(8.1, 1.6, 0.5, 0.6),
        },
    ),
    "playground": (
        _room(9.0, 6.6, 6.8),
        {
            "sandpit": _round(2.2, 4.7, 2.2, 1.8),
            "slide": _box(5.2, 5.3, 2.2, 0.6, 22),
            "climbing frame": _bent(7.1, 3.3, 1.7, 1.7, 0.7, 90),
            "seesaw": _box(4.1, 3.1, 1.9, 0.4, -32),
            "tree": _round(1.4, 1.7, 0.8),
            "bench": _box(3.6, 1.1, 1.5, 0.45),
            "fountain": _round(5.6, 1.5, 1.1),
        },
    ),
}


def main() -> None:
    """Write the places into the folder of pages."""
    folder = Path(__file__).resolve().parents[1] / "public" / "places"
    chosen = set(sys.argv[1:])
    places = {
        name: World(
            walls, tuple(SceneObject.from_rings([ring], label) for label, ring in things.items())
        )
        for name, (walls, things) in _PLACES.items()
    }
    for number, (name, world) in enumerate({"living-room": living_room(), **places}.items()):
        if chosen and name not in chosen:
            continue
        rng = np.random.default_rng(20 + number)
        grid = map_living_room(world) if number == 0 else _mapped(world, rng)
        here = folder / name
        here.mkdir(parents=True, exist_ok=True)
        _write_map(here, grid, world)
        _write_sketch(here, world, rng)


def _mapped(world: World, rng: np.random.Generator) -> OccupancyGrid:
    margin = 0.6
    room = np.concatenate(world.walls)
    low = room.min(axis=0) - margin
    columns, rows = np.ceil((room.max(axis=0) + margin - low) / _RESOLUTION).astype(int).tolist()
    picture = Image.new("L", (columns, rows), 255)  # −1 as a byte: unknown
    pen = ImageDraw.Draw(picture)

    def cells(points):
        return [tuple(each) for each in ((points - low) / _RESOLUTION).tolist()]

    for wall in world.walls:
        pen.polygon(cells(wall), fill=0)
    for wall in world.walls:
        pen.line(cells(wall), fill=100, width=3)
    for item in world.furniture:
        ring = cells(item.rings[0])
        pen.polygon(ring, fill=255)
        pen.line([*ring, ring[0], ring[1]], fill=100, width=2, joint="curve")
    found = np.array(picture).astype(np.int8)
    # What an echo missed or put one cell too near.
    solid = found == 100
    near = np.zeros_like(solid)
    near[1:-1, 1:-1] = (solid[:-2, 1:-1] | solid[2:, 1:-1] | solid[1:-1, :-2] | solid[1:-1, 2:]) & (
        found[1:-1, 1:-1] == 0
    )
    found[near & (rng.random(found.shape) < 0.16)] = 100
    return OccupancyGrid(found, _RESOLUTION, (float(low[0]), float(low[1]), 0.0))


def _write_map(folder: Path, grid: OccupancyGrid, world: World) -> None:
    shades = np.select([grid.cells == 100, grid.cells == 0], [0, 254], default=205)
    picture = Image.fromarray(np.flipud(shades).astype(np.uint8))
    picture.save(folder / "map.png", optimize=True)
    x, y, yaw = grid.origin
    lines = [
        "image: map.png",
        "mode: trinary",
        f"resolution: {grid.resolution:g}",
        f"origin: [{x:.3f}, {y:.3f}, {yaw:g}]",
        "negate: 0",
        "occupied_thresh: 0.65",
        "free_thresh: 0.196",
        *(
            f"{item.label}: {{type: furniture, pose: [{x:.2f}, {y:.2f}, 0]}}"
            for item in world.furniture
            for x, y in [item.centroid]
        ),
    ]
    (folder / "map.yaml").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _write_sketch(folder: Path, world: World, rng: np.random.Generator) -> None:
    remembered = Scene(
        tuple(
            SceneObject.from_rings([np.array(item.polygon.simplify(0.025).exterior.coords)[:-1]])
            for item in world.furniture
        )
    )
    sketch = simulate_sketch(
        remembered, rng, rotation=rng.uniform(-0.12, 0.12), scale=1.0, displacement=0.07, turn=0.06
    )
    drawn = draw_strokes(sketch.scene, rng, rate=45.0)
    points = np.concatenate([stroke.points for stroke in drawn.strokes])
    low, high = points.min(axis=0), points.max(axis=0)
    factor = min((np.array(_PAGE) - 2 * _MARGIN) / (high - low))
    shift = (np.array(_PAGE) - factor * (high - low)) / 2
    strokes = [
        {"points": np.round((stroke.points - low) * factor + shift, 1).tolist()}
        for stroke in drawn.strokes
    ]
    for stroke in strokes:
        for point in stroke["points"]:
            point[1] = round(_PAGE[1] - point[1], 1)
    text = json.dumps({"y_axis": "down", "strokes": strokes}, separators=(",", ":"))
    (folder / "sketch.json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
