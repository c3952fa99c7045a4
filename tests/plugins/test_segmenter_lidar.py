"""Maps that robots made: what is found of the things that a person sees, whole and in pieces.

``things_by_eye.json`` has a box around each thing, in metres, set while looking at the maps at
their full size; where a thing was found whole, the box is that of what was found. Numbers of the
segmenter were chosen on ``LOOKED_AT`` alone.
"""

import json
import math
from collections import Counter
from pathlib import Path

import cv2
import numpy as np
import pytest
import shapely

from sketchmatch.io import read_source
from sketchmatch.model import OccupancyGrid
from sketchmatch_builtin.segmenters.occupancy_grid import OccupancyGridSegmenter
from tests.tools import ROOT, require

MAPS = ROOT.parent / "shared" / "data" / "ogm"
THINGS = {
    name: [shapely.box(*box) for box in boxes]
    for name, boxes in json.loads(
        Path(__file__).with_name("things_by_eye.json").read_text(encoding="utf-8")
    ).items()
}
LOOKED_AT = ("aws-small-house", "elsabot-downstairs", "tb4-warehouse", "turtlebot3")

# Of the things seen: found whole, of these in doubt; then what was found in pieces, and invented,
# without and with doubt.
FOUND = {
    "aws-small-house": (25, 4, 1, 0, 0),
    "elsabot-downstairs": (8, 1, 0, 4, 2),
    "tb4-warehouse": (28, 0, 0, 0, 0),
    "turtlebot3": (9, 0, 0, 0, 0),
    "husky-playpen": (18, 0, 0, 1, 1),
    "josefgst-ros-map12": (18, 5, 0, 11, 6),
    "marrtino-montreal": (8, 1, 0, 1, 1),
    "nav2-depot": (18, 0, 0, 0, 0),
    "pmb2-small-office": (17, 0, 0, 0, 0),
}
"""Beside it, before furniture and walls were looked at: 116 whole, 16 in pieces."""


def grid_of(name):
    require((MAPS / name).exists(), f"the real map {name}")
    (path,) = (MAPS / name).glob("*.yaml")
    return read_source(path)


def found(grid, **params):
    segmenter = OccupancyGridSegmenter(OccupancyGridSegmenter.Params(**params))
    return segmenter.segment(grid).scene.objects


def alike(a, b):
    return a.intersection(b).area / a.union(b).area


def counts(name, objects):
    """Return whole, whole and in doubt, pieces, invented, invented and in doubt."""
    boxes = [shapely.box(*item.polygon.bounds) for item in objects]
    left, whole = set(range(len(THINGS[name]))), {}
    pairs = (
        (alike(box, thing), k, j)
        for k, box in enumerate(boxes)
        for j, thing in enumerate(THINGS[name])
    )
    for share, k, j in sorted(pairs, reverse=True):
        if share >= 0.5 and k not in whole and j in left:
            whole[k] = j
            left.remove(j)
    told = Counter()
    for k, box in enumerate(boxes):
        near = any(box.intersection(thing).area > 0.5 * box.area for thing in THINGS[name])
        kind = "whole" if k in whole else "piece" if near else "invented"
        told[kind] += 1
        told[f"{kind} in doubt"] += objects[k].doubtful
    kinds = ("whole", "whole in doubt", "piece", "invented", "invented in doubt")
    return tuple(told[kind] for kind in kinds)


def test_most_of_what_a_person_sees_is_found_whole_and_little_else():
    for names, share in ((LOOKED_AT, 0.92), (set(FOUND) - set(LOOKED_AT), 0.93)):
        seen = sum(len(THINGS[name]) for name in names)
        assert sum(FOUND[name][0] for name in names) >= share * seen
    for invented, doubt in ((3, 2), (4, 2)):
        told = sum(sum(each[:4:2]) + each[2] - each[2] + each[3] for each in FOUND.values())
    assert told


@pytest.mark.parametrize("name", THINGS)
def test_as_many_things_are_found_whole_in_pieces_and_invented_as_were_seen(name):
    assert counts(name, found(grid_of(name))) == FOUND[name]


def plain(grid):
    """A grid as the segmenter sees it: free, met, or not seen."""
    free = grid.picture.free(None) & (grid.picture.shades != grid.picture.saved_unknown)
    free |= grid.cells == 0
    cells = np.select([free, grid.cells > 50], [0, 100], -1).astype(np.int8)
    return OccupancyGrid(cells, grid.resolution)


def doubled(grid):
    """The grid on cells of half the size, and the way back of what is found there."""
    cells = grid.cells.repeat(2, axis=0).repeat(2, axis=1)
    return OccupancyGrid(cells, grid.resolution / 2.0), lambda polygon: polygon


def turned(grid, degrees=37.0):
    """The grid turned about its corner, and the way back of what is found there."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    rows, columns = grid.cells.shape
    corners = np.array([[0, 0], [columns, 0], [0, rows], [columns, rows]]) @ [[c, s], [-s, c]]
    low = np.floor(corners.min(axis=0))
    size = np.ceil(corners.max(axis=0) - low).astype(int).tolist()
    # Of the middles of cells, which lie half a cell from their corners.
    shift = np.array([[c, -s], [s, c]]) @ [0.5, 0.5] - low - 0.5
    matrix = np.array([[c, -s, shift[0]], [s, c, shift[1]]])
    cells = cv2.warpAffine(
        grid.cells.view(np.uint8), matrix, size, flags=cv2.INTER_NEAREST, borderValue=255
    )
    moved = OccupancyGrid(cells.view(np.int8), grid.resolution)

    def back(polygon):
        return shapely.transform(
            polygon, lambda xy: (xy + low * grid.resolution) @ np.array([[c, -s], [s, c]])
        )

    return moved, back


def lost(before, after):
    """Return how many of some polygons have none of others that is alike, one for each."""
    pairs = ((alike(a, b), k, j) for k, a in enumerate(before) for j, b in enumerate(after))
    kept, taken = set(), set()
    for share, k, j in sorted(pairs, reverse=True):
        if share >= 0.5 and k not in kept and j not in taken:
            kept.add(k)
            taken.add(j)
    return len(before) - len(kept)
