"""Numbers and names on the sketch pad's map lie beside each other, never upon each other."""

from itertools import combinations

import numpy as np
import pytest

from tests.tools import require
from tests.web import CLIENTS, checked

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def place():
    require((CLIENTS / "node_modules").is_dir(), "the packages of `npm --prefix clients ci`")
    return lambda scenes: checked("signs", told=scenes)


def thing(x, y, width, height, numbered=True, name_width=0.0):
    corners = [[x, y], [x + width, y], [x + width, y + height], [x, y + height]]
    return {
        "outline": corners,
        "centre": [x + width / 2, y + height / 2],
        "numbered": numbered,
        "nameWidth": name_width,
    }


def random_scene(rng):
    """Return things at random: crowded or not, of all sizes, some without number or name."""
    room = rng.uniform(40, 1200)
    return [
        thing(
            *rng.uniform(0, room, 2),
            *rng.uniform(1, room / 3, 2),
            bool(rng.random() < 0.8),
            float(rng.choice([0.0, rng.uniform(5, 160)])),
        )
        for _ in range(rng.integers(1, 60))
    ]


def overlap(a, b):
    return a["x0"] < b["x1"] and b["x0"] < a["x1"] and a["y0"] < b["y1"] and b["y0"] < a["y1"]


def test_no_sign_lies_upon_another_and_every_number_is_shown(place):
    scenes = [random_scene(np.random.default_rng(seed)) for seed in range(300)]
    for scene, signs in zip(scenes, place(scenes), strict=True):
        assert [bool(sign["badge"]) for sign in signs] == [each["numbered"] for each in scene]
        assert not any(
            sign["label"] and not each["nameWidth"] for each, sign in zip(scene, signs, strict=True)
        )
        boxes = [box for sign in signs for box in sign.values() if box]
        assert not [both for both in combinations(boxes, 2) if overlap(*both)]
        for each, sign in zip(scene, signs, strict=True):
            if sign["label"]:
                (x0, y0), _, (x1, y1), _ = each["outline"]
                near = {"x0": x0 - 60, "y0": y0 - 60, "x1": x1 + 60, "y1": y1 + 60}
                assert overlap(sign["label"], near)


def test_where_there_is_room_a_number_is_within_its_thing_and_the_name_below_it(place):
    ((sofa, lamp),) = place([[thing(0, 0, 100, 80, name_width=40), thing(300, 0, 10, 10)]])
    assert sofa["badge"] == {"x0": 38, "y0": 28, "x1": 62, "y1": 52}
    assert sofa["label"] == {"x0": 30, "y0": 56, "x1": 70, "y1": 71}
    assert lamp["badge"] == {"x0": 301, "y0": -15, "x1": 325, "y1": 9}


def test_a_name_gives_way_to_the_number_of_a_neighbour(place):
    """A table whose name, below it, would lie under the number of the chair there."""
    table, chair = thing(0, 0, 60, 20, name_width=70), thing(20, 22, 10, 10)
    ((first, second),) = place([[table, chair]])
    assert first["label"]
    assert not overlap(first["label"], second["badge"])
