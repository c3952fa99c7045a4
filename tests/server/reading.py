# ruff: noqa: ARG002 (what misbehaves does not look at its arguments)
"""A plugin of a third party that brings files of its own kind: their readers and a segmenter."""

import os
from dataclasses import dataclass

import numpy as np

from sketchmatch.api import (
    InvalidInputError,
    Reader,
    Reason,
    Segmentation,
    Segmenter,
    hookimpl,
)
from sketchmatch.api.documents import decode_text, load_json
from sketchmatch.model import LabelledPolygon, PolygonSet, Scene, SceneObject

sketchmatch_api_version = 1


@dataclass(frozen=True, eq=False)
class Shelves(PolygonSet):
    """Outlines with a height each: more than polygons alone say."""

    heights: tuple[float, ...] = ()


def _polygons(boxes):
    return tuple(
        LabelledPolygon((np.array([(x, y), (x + 1, y), (x + 1, y + 2), (x, y + 2)]),), name)
        for name, x, y, _ in boxes
    )


class ShelfReader(Reader):
    """Shelves as [name, x, y, height]."""

    name = "shelves"
    summary = "Shelves with heights."
    suffixes = (".shelves",)
    keys = ("shelves",)
    source = Shelves

    def read(self, data, part=""):
        boxes = load_json(decode_text(data))["shelves"]
        boxes = [box for box in boxes if not part or box[0] in part.split(",")]
        if not boxes:
            raise InvalidInputError(Reason.INVALID_FILE, "shelves", "is empty; give some")
        note = f"Read by process {os.getpid()}."
        return Shelves(_polygons(boxes), (note,), tuple(height for *_, height in boxes))


class HighShelves(Segmenter):
    """Takes the high ones."""

    name = "high-shelves"
    summary = "Shelves of at least 1 m."
    sources = (Shelves,)

    def segment(self, source):
        high = [k for k, height in enumerate(source.heights) if height >= 1.0]
        chosen = [source.polygons[k] for k in high]
        return Segmentation(
            Scene(tuple(SceneObject.from_rings(each.rings, each.label) for each in chosen)),
            (f"Found by process {os.getpid()}.",),
        )


class RaisingReader(Reader):
    """Fails."""

    name = "raising"
    summary = "Fails."
    suffixes = (".raising",)
    source = PolygonSet

    def read(self, data, part=""):
        raise ZeroDivisionError("by\nzero")


class LyingReader(RaisingReader):
    """Returns something else than it says."""

    name = "lying"
    suffixes = (".lying",)

    def read(self, data, part=""):
        return "rubbish"


class ExitingReader(RaisingReader):
    """Ends its process."""

    name = "exiting"
    suffixes = (".exiting",)

    def read(self, data, part=""):
        os._exit(3)


@hookimpl
def sketchmatch_register_readers():
    return [ShelfReader, RaisingReader, LyingReader, ExitingReader]


@hookimpl
def sketchmatch_register_segmenters():
    return [HighShelves]
