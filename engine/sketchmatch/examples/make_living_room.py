"""Make the bundled example again: ``python -m sketchmatch.examples.make_living_room [FOLDER]``.

Everything follows from two seeds, so the files come out the same each time.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import numpy as np
import shapely

from sketchmatch.model import FloatArray, OccupancyGrid, Scene, SceneObject, StrokeSet
from sketchmatch.testing.drawing import draw_strokes, strokes_to_svg
from sketchmatch.testing.driving import Odometry, plan_tour
from sketchmatch.testing.lidar import Lidar, World
from sketchmatch.testing.robot import survey
from sketchmatch.testing.sketches import SimulatedSketch, simulate_sketch

__all__ = ["living_room", "main", "make", "map_living_room", "sketch_living_room"]

MAP_SEED, SKETCH_SEED = 11, 2
SKETCH_ROTATION = math.radians(115.0)
# The map's frame is where the robot was switched on, not quite along the walls.
_ROOM_TURN = math.radians(-2.5)
# From the sketch's metres to the units of a page about 900 wide.
_PAGE_SCALE = 110.0


def living_room() -> World:
    """Return the room as it is: walls with a door to a corridor, and eight pieces of furniture."""
    furniture = tuple(
        SceneObject.from_rings([_in_map_frame(outline)], label) for label, outline in _FURNITURE
    )
    return World(tuple(_in_map_frame(wall) for wall in _WALLS), furniture)


def map_living_room(world: World) -> OccupancyGrid:
    """Return the map that a robot makes of the room."""
    rng = np.random.default_rng(MAP_SEED)
    stops = _in_map_frame(np.array(_STOPS))
    poses = plan_tour(world, rng, stops=stops, spacing=0.16)
    return survey(world, rng, poses=poses, lidar=_LIDAR, odometry=_ODOMETRY).grid


def sketch_living_room(world: World) -> tuple[StrokeSet, SimulatedSketch]:
    """Return the strokes of a sketch of the room, and the sketch with its truth."""
    rng = np.random.default_rng(SKETCH_SEED)
    remembered = Scene(tuple(_simplified(item) for item in world.furniture))
    sketch = simulate_sketch(
        remembered, rng, rotation=SKETCH_ROTATION, scale=_PAGE_SCALE, displacement=0.1, wobble=0.03
    )
    return draw_strokes(sketch.scene, rng), sketch


def make(folder: Path) -> None:
    """Write the map, the sketch and the truth into a folder."""
    world = living_room()
    grid = map_living_room(world)
    strokes, sketch = sketch_living_room(world)
    (folder / "living_room.pgm").write_bytes(_pgm(grid))
    _write(folder / "living_room.yaml", _yaml(grid, "living_room.pgm"))
    _write(folder / "living_room_sketch.svg", strokes_to_svg(strokes))
    _write(folder / "living_room_truth.json", _truth(world, sketch))


def main() -> None:
    """Make the example in the folder given, or beside this module."""
    make(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent)


def _simplified(item: SceneObject) -> SceneObject:
    """Return the object as somebody remembers it, without its finer corners."""
    outline = shapely.get_coordinates(item.polygon.simplify(0.025))
    return SceneObject.from_rings([outline], item.label)


def _pgm(grid: OccupancyGrid) -> bytes:
    """Return the picture that ROS map_saver writes: 0 occupied, 205 unknown, 254 free."""
    shades = np.select([grid.cells == 100, grid.cells == 0], [0, 254], default=205)
    rows, columns = shades.shape
    header = f"P5\n# {grid.resolution:g} m a cell\n{columns} {rows}\n255\n"
    return header.encode("ascii") + np.flipud(shades).astype(np.uint8).tobytes()


def _yaml(grid: OccupancyGrid, image: str) -> str:
    x, y, yaw = grid.origin
    return (
        f"image: {image}\nmode: trinary\nresolution: {grid.resolution:g}\n"
        f"origin: [{x:.3f}, {y:.3f}, {yaw:g}]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


def _truth(world: World, sketch: SimulatedSketch) -> str:
    objects = [
        {
            "label": world.furniture[partner].label,
            "map_centroid": [round(value, 3) for value in world.furniture[partner].centroid],
        }
        for partner in sketch.partners
    ]
    truth = {"rotation_degrees": round(math.degrees(SKETCH_ROTATION), 3), "objects": objects}
    return json.dumps(truth, indent=2) + "\n"


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")


def _in_map_frame(points: FloatArray) -> FloatArray:
    moved: FloatArray = _turned(points, _ROOM_TURN) - _SWITCHED_ON
    return moved


def _placed(outline: FloatArray, x: float, y: float, degrees: float) -> FloatArray:
    """Return an outline, drawn around (0, 0), turned and moved into the room."""
    placed: FloatArray = _turned(outline, math.radians(degrees)) + np.array([x, y])
    return placed


def _turned(points: FloatArray, angle: float) -> FloatArray:
    c, s = math.cos(angle), math.sin(angle)
    turned: FloatArray = points @ np.array([[c, s], [-s, c]])
    return turned


def _box(width: float, depth: float) -> FloatArray:
    return np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [width / 2, depth / 2]


def _ellipse(width: float, depth: float, corners: int = 32) -> FloatArray:
    angles = np.arange(corners) * (2.0 * np.pi / corners)
    return np.stack([np.cos(angles) * width / 2, np.sin(angles) * depth / 2], axis=1)


_LIDAR = Lidar(beams=720, max_range=6.0, noise=0.012, dropout=0.02, mixing=0.3)
_ODOMETRY = Odometry(position=0.02, heading=0.008, correction=0.35)
_SWITCHED_ON = np.array([3.4, 2.6])

_SOFA = np.array([[0, 0], [0.75, 0], [0.75, 0.95], [2.2, 0.95], [2.2, 1.7], [0, 1.7]]) - [1.1, 1.0]
_ARMCHAIR = np.array(
    [
        [-0.45, -0.45],
        [0.45, -0.45],
        [0.45, -0.2],
        [-0.1, -0.2],
        [-0.1, 0.2],
        [0.45, 0.2],
        [0.45, 0.45],
        [-0.45, 0.45],
    ]
)
_PIANO = np.array(
    [
        [-0.75, -0.8],
        [0.75, -0.8],
        [0.75, -0.35],
        [0.68, -0.1],
        [0.48, 0.08],
        [0.3, 0.25],
        [0.2, 0.5],
        [0.12, 0.75],
        [-0.08, 0.92],
        [-0.4, 0.95],
        [-0.66, 0.85],
        [-0.75, 0.6],
    ]
)

_FURNITURE = [
    ("sofa", _placed(_SOFA, 1.95, 4.3, 0)),
    ("coffee table", _placed(_box(1.0, 0.55), 2.75, 3.0, 12)),
    ("armchair", _placed(_ARMCHAIR, 1.35, 1.55, 40)),
    ("piano", _placed(_PIANO, 6.45, 4.35, -160)),
    ("bookshelf", _placed(_box(0.35, 1.7), 4.45, 4.35, 0)),
    ("round table", _placed(_ellipse(1.15, 1.15), 5.35, 1.9, 0)),
    ("sideboard", _placed(_box(1.5, 0.5), 3.6, 1.0, -8)),
    ("plant", _placed(_ellipse(0.42, 0.42, 16), 7.05, 1.05, 0)),
]

# Across a chimney breast in the upper wall; the door is in the right one, the corridor behind.
_WALLS = [
    np.array(
        [
            [8.0, 2.3],
            [8.0, 0.0],
            [0.0, 0.0],
            [0.0, 6.0],
            [5.0, 6.0],
            [5.0, 5.8],
            [6.0, 5.8],
            [6.0, 6.0],
            [8.0, 6.0],
            [8.0, 3.2],
        ]
    ),
    np.array([[8.12, 3.2], [8.12, 7.0], [9.4, 7.0], [9.4, -1.5], [8.12, -1.5], [8.12, 2.3]]),
    np.array([[8.0, 3.2], [8.12, 3.2]]),
    np.array([[8.0, 2.3], [8.12, 2.3]]),
]

_STOPS = [
    [3.4, 2.1],
    [2.3, 0.5],
    [0.5, 0.6],
    [0.5, 2.8],
    [2.0, 2.3],
    [3.7, 3.6],
    [3.7, 5.5],
    [0.5, 5.6],
    [5.2, 5.4],
    [7.5, 5.4],
    [7.5, 2.8],
    [7.6, 0.5],
    [5.4, 0.6],
    [6.4, 2.4],
    [5.2, 3.1],
]


if __name__ == "__main__":
    main()
