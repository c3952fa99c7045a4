"""The simulated user study: numbered sketches of a scene, and the truth about them.

A sketch is drawn, goes as pen strokes through the segmenter, and is matched as it comes out. What
segmentation loses or invents is counted: it makes the answer wrong.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from sketchmatch.model import IntArray, Scene, StrokeSet
from sketchmatch_builtin.segmenters.strokes import StrokeSegmenter
from tests.experiments.people import EXTRA, Person, draw, with_extras
from tests.experiments.scenes import Place, charted

__all__ = ["SMALL", "STRENGTH", "Sketch", "Style", "sketch", "traced"]

STRENGTH = 0.95
"""Gives the thesis's mean ζ of the right map with all objects, 0.911; see ``calibrate``."""

SMALL = Person(0.3, small=0.39, upright=True)
"""Gives the parts of ζ that the thesis's tables of EASM tell of; see ``calibrate``."""


@dataclass(frozen=True)
class Style:
    """How the sketches of a study are drawn.

    Attributes
    ----------
    person
        How far from the truth.
    missing, extra
        How many objects are forgotten, and how many are drawn that are not there.
    seed
        Of the study: other seeds give other people.
    paper
        By how many degrees the paper is turned, counter-clockwise.
    traced
        Whether the sketch is the map itself: the thesis's case (a).
    """

    person: Person = field(default_factory=lambda: Person(STRENGTH))
    missing: int = 0
    extra: int = 0
    seed: int = 0
    paper: float = 0.0
    traced: bool = False


@dataclass(frozen=True, eq=False)
class Sketch:
    """A sketch as it was segmented.

    Attributes
    ----------
    scene
        Its objects.
    furniture
        Shape (N,): for each object the index of the piece of furniture it stands for, −1 for one
        that is not there.
    lost, invented
        How many drawn objects the segmenter did not find, and how many it found that nobody drew.
    """

    scene: Scene
    furniture: IntArray
    lost: int
    invented: int


def sketch(place: Place, number: int, style: Style) -> Sketch:
    """Return sketch ``number`` of a study; the same numbers give the same sketch."""
    rng = np.random.default_rng((style.seed, int.from_bytes(place.name.encode()), number))
    room = with_extras(place.furniture, style.extra, rng)
    forgotten = rng.permutation(len(place.furniture))[: style.missing]
    drawn = [k for k in range(len(room)) if k not in forgotten]
    strokes = draw(room, style.person, rng, drawn)
    scene = StrokeSegmenter().segment(_turned(strokes, style.paper)).scene
    index = {label: k for k, label in enumerate(place.furniture.labels)}
    furniture = np.array([index.get(label, -1) for label in scene.labels])
    return Sketch(
        scene,
        furniture,
        len({room.labels[k] for k in drawn} - set(scene.labels)),
        sum(label not in index and not label.startswith(EXTRA) for label in scene.labels),
    )


def traced(place: Place, drive: int | None = None) -> Sketch:
    """Return the thesis's case (a): the map, or the objects of a grid, as the sketch."""
    own = charted(place, drive)
    return Sketch(own.scene, own.furniture, 0, 0)


def _turned(strokes: StrokeSet, degrees: float) -> StrokeSet:
    if not degrees:
        return strokes
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    turn = np.array([[c, s], [-s, c]])
    return StrokeSet(tuple(replace(one, points=one.points @ turn) for one in strokes.strokes))
