"""How long the segmenters of grids take on 4000 × 4000 cells, by the kind of the map.

Run it with ``make bench-grids``. Seconds are of the processor, as median, minimum and maximum of
runs in turns; ``ARGS=rings`` measures those maps alone whose name begins so.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from statistics import median

import cv2
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from sketchmatch.api import Segmenter
from sketchmatch.errors import InvalidInputError
from sketchmatch.model import OccupancyGrid
from sketchmatch_builtin.segmenters.occupancy_grid import OccupancyGridSegmenter
from sketchmatch_builtin.segmenters.rooms import RoomSegmenter

__all__ = ["MAPS"]

_Cells = NDArray[np.int8]

_SIDE = 4000
_CELL = 0.05
_REPEATS = 5
# Cells: how thick walls and how wide doors are.
_WALL, _DOOR = 4, 18


def _walled() -> _Cells:
    cells = np.zeros((_SIDE, _SIDE), np.int8)
    cells[:_WALL] = cells[-_WALL:] = cells[:, :_WALL] = cells[:, -_WALL:] = 100
    return cells


def offices(depth: int, width: int, corridor: int = 44, seed: int = 0) -> _Cells:
    """Offices on both sides of corridors, each with a door and things that stand in it."""
    rng = np.random.default_rng(seed)
    cells = np.full((_SIDE, _SIDE), 100, np.int8)
    cells[_WALL:-_WALL, _WALL : _WALL + corridor] = 0
    for y in range(
        _WALL, _SIDE - _WALL - 2 * (depth + _WALL) - corridor, 2 * (depth + _WALL) + corridor
    ):
        middle = y + depth + _WALL
        cells[middle : middle + corridor, _WALL:-_WALL] = 0
        for x in range(2 * _WALL + corridor, _SIDE - _WALL - width, width + _WALL):
            for low, door in ((y, middle - _WALL), (middle + corridor + _WALL, middle + corridor)):
                cells[low : low + depth, x : x + width] = 0
                at = x + int(rng.integers(4, width - _DOOR - 4))
                cells[door : door + _WALL, at : at + _DOOR] = 0
                for _ in range(3):
                    row, column = low + rng.integers(2, depth - 12), x + rng.integers(2, width - 12)
                    cells[row : row + 10, column : column + 8] = 100
    return cells


def rings(width: int, *, round_: bool = False, crossed: bool = True) -> _Cells:
    """Corridors around each other, with doors from each to the next."""
    cells = np.full((_SIDE, _SIDE), 100, np.int8)
    middle = _SIDE // 2
    for k, radius in enumerate(range(middle - _WALL, width, -(width + _WALL))):
        for size, shade in ((radius, 0), (radius - width, 100)):
            if round_:
                cv2.circle(cells.view(np.uint8), (middle, middle), size, (shade,), cv2.FILLED)
            else:
                cells[middle - size : middle + size, middle - size : middle + size] = shade
        inner = radius - width
        if inner > 2 * width and crossed:
            at = middle + (inner // 3 if k % 2 else -inner // 3)
            beyond = int(np.sqrt(inner**2 - (inner // 3) ** 2)) if round_ else inner
            cells[middle - beyond - 3 : middle - beyond + 2 * _WALL, at : at + _DOOR] = 0
    return cells


def spiral(width: int) -> _Cells:
    """One corridor that winds inwards, with a door across it now and then."""
    cells = np.full((_SIDE, _SIDE), 100, np.int8)
    step = width + _WALL
    low, high = _WALL, _SIDE - _WALL
    while high - low > 4 * step:
        cells[low : low + width, low - (step if low > _WALL else 0) : high] = 0
        cells[low:high, high - width : high] = 0
        cells[high - width : high, low:high] = 0
        cells[low + step : high, low : low + width] = 0
        cells[low : low + width, low + width + 200 : low + width + 204] = 100
        cells[low + 4 : low + 4 + _DOOR, low + width + 200 : low + width + 204] = 0
        low, high = low + step, high - step
    return cells


def labyrinth(rooms: int, seed: int = 0) -> _Cells:
    """Rooms of one size side by side, with doors that join all of them in one way."""
    rng = np.random.default_rng(seed)
    cells, pitch = np.full((_SIDE, _SIDE), 100, np.int8), (_SIDE - _WALL) // rooms
    for y in range(rooms):
        for x in range(rooms):
            row, column = y * pitch + _WALL, x * pitch + _WALL
            cells[row : row + pitch - _WALL, column : column + pitch - _WALL] = 0
            at = int(rng.integers(4, pitch - _WALL - _DOOR - 4))
            if x and (not y or rng.random() < 0.5):
                cells[row + at : row + at + _DOOR, column - _WALL : column] = 0
            elif y:
                cells[row - _WALL : row, column + at : column + at + _DOOR] = 0
    return cells


def turned(cells: _Cells, degrees: float = 37.0) -> _Cells:
    """The same turned about its middle, at 0.7 times its size."""
    matrix = cv2.getRotationMatrix2D((_SIDE / 2.0, _SIDE / 2.0), degrees, 0.72)
    return np.asarray(
        cv2.warpAffine(
            cells.view(np.uint8), matrix, (_SIDE, _SIDE), flags=cv2.INTER_NEAREST, borderValue=255
        )
    ).view(np.int8)


def pillars() -> _Cells:
    """A hall with what stands free in it."""
    cells = _walled()
    for row in range(100, _SIDE - 100, 200):
        for column in range(100, _SIDE - 100, 200):
            cells[row : row + 40, column : column + 30] = 100
    return cells


def halls(seed: int = 0) -> _Cells:
    """Few large halls, with specks of a laser in them and rays beyond their walls."""
    rng = np.random.default_rng(seed)
    cells = _walled()
    for at in (1300, 2650):
        cells[at : at + _WALL] = cells[:, at : at + _WALL] = 100
        for door in (600, 1900, 3300):
            cells[at : at + _WALL, door : door + 40] = 0
            cells[door : door + 40, at : at + _WALL] = 0
    cells[tuple(rng.integers(3, _SIDE - 3, (2, 20_000)))] = 100
    return cells


MAPS: dict[str, Callable[[], _Cells]] = {
    "halls with speckle": halls,
    "pillars in a hall": pillars,
    "offices, 600": partial(offices, 150, 120),
    "offices, 950": partial(offices, 100, 100),
    "offices turned": lambda: turned(offices(100, 100)),
    "labyrinth of 900 rooms": partial(labyrinth, 30),
    "labyrinth of 300 rooms": partial(labyrinth, 17),
    "rings, square": partial(rings, 46),
    "rings, square, wide": partial(rings, 120),
    "rings, narrow": partial(rings, 30),
    "rings, round": partial(rings, 60, round_=True),
    "rings, round, narrow": partial(rings, 34, round_=True),
    "rings turned": lambda: turned(rings(60)),
    "spiral": partial(spiral, 50),
}
"""What is measured."""


def main(chosen: str = "") -> None:
    """Measure and print."""
    table = Table(title=f"{_SIDE} x {_SIDE} cells, seconds of the processor", title_justify="left")
    for column in ("map", "segmenter", "found"):
        table.add_column(column)
    for column in ("median", "min", "max"):
        table.add_column(column, justify="right")
    for name, build in MAPS.items():
        if name.startswith(chosen):
            grid = OccupancyGrid(build(), _CELL)
            for segmenter, found, seconds in _measured(grid):
                values = (f"{value:.2f}" for value in (median(seconds), min(seconds), max(seconds)))
                table.add_row(name, segmenter, found, *values)
    Console().print(table)


def _measured(grid: OccupancyGrid) -> Iterator[tuple[str, str, list[float]]]:
    segmenters: tuple[Segmenter, ...] = (RoomSegmenter(), OccupancyGridSegmenter())
    seconds: dict[str, list[float]] = {}
    found = {}
    for _ in range(_REPEATS):
        for segmenter in segmenters:
            started = time.process_time()
            found[segmenter.name] = _found(segmenter, grid)
            seconds.setdefault(segmenter.name, []).append(time.process_time() - started)
    for name, times in seconds.items():
        yield name, found[name], times


def _found(segmenter: Segmenter, grid: OccupancyGrid) -> str:
    try:
        return str(len(segmenter.segment(grid).scene))
    except InvalidInputError as error:
        return error.reason.name.lower()


if __name__ == "__main__":
    main(*sys.argv[1:])
