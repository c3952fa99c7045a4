"""Sketches to learn from: of the study's scenes and of random ones, by many kinds of people."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sketchmatch.model import IntArray, Scene
from sketchmatch.testing import random_scene
from tests.experiments.people import Person, Shapes
from tests.experiments.scenes import PLACES, Place
from tests.experiments.study import Style, sketch

__all__ = ["SEEDS", "SHARE_WITH_EXTRAS", "Drawing", "drawing"]

SEEDS = {"odds": 10, "check": 20}
"""Of what each part of the learning looks at; the study's sketches have seed 0."""

SHARE_WITH_EXTRAS = 2 / 26
"""How many sketches show something that the map has not: in the thesis two of 26."""

_MANY_WITH_EXTRAS = 0.4
_FEWEST = 5
_STRENGTHS = (0.7, 0.95, 1.05, 1.2)


@dataclass(frozen=True, eq=False)
class Drawing:
    """A sketch as it was segmented, its map, and the truth: map index or −1 by sketch index."""

    scene: Scene
    map: Scene
    truth: IntArray


def drawing(part: str, number: int, most: int, **kind: int) -> Drawing | None:
    """Return a sketch of a scene of the study, or of a random one of 5 to ``most`` objects.

    None where segmentation lost or invented something. Four in ten of those for odds show something
    that the map has not; these count for less there.
    """
    seed = SEEDS[part]
    rng = np.random.default_rng((seed, 77, number))
    place = (*PLACES.values(), None)[number % 3] or _random_place(rng, most)
    person = Person(
        float(rng.choice(_STRENGTHS)), shapes=Shapes(rng.choice([str(x) for x in Shapes]))
    )
    missing = int(rng.choice(3, p=[0.4, 0.4, 0.2]))
    share = _MANY_WITH_EXTRAS if part == "odds" else SHARE_WITH_EXTRAS
    extra = int(rng.choice(3, p=[1.0 - share, 0.75 * share, 0.25 * share]))
    style = Style(person, **{"missing": missing, "extra": extra, "seed": seed, **kind})
    drawn = sketch(place, number, style)
    if drawn.lost + drawn.invented:
        return None
    return Drawing(drawn.scene, place.furniture, drawn.furniture)


def _random_place(rng: np.random.Generator, most: int) -> Place:
    # Scenes of few objects are the more frequent ones.
    more = int((most - _FEWEST + 1) * rng.random() ** 2)
    scene = random_scene(rng, _FEWEST + more)
    labels = [f"thing {k}" for k in range(len(scene))]
    outlines = [item.rings[0] for item in scene.objects]
    return Place("R", np.zeros((4, 2)), Scene.from_polygons(outlines, labels))
