"""Sketches of real maps set by hand, and ones that people drew: all of each is matched right.

Nothing was or will be learned from any of them.
"""

import json

import pytest
import shapely

from sketchmatch import read_scene
from tests.tools import ROOT, require

SKETCHES = ROOT.parent / "shared" / "data" / "sketches"
BY_HAND = SKETCHES / "objects-on-real-maps"
BY_PEOPLE = SKETCHES / "objects-taurob"


def truth_of(folder, name):
    require(folder.exists(), f"shared/data/sketches/{folder.name}")
    return json.loads((folder / "truth.json").read_text(encoding="utf-8"))[name]


def object_at(point, scene):
    (found,) = (k for k, item in enumerate(scene.objects) if item.polygon.covers(point))
    return found


def object_map(done):
    assert done.returncode == 0, done.stderr
    lines = json.loads(done.stdout)["objectMatches"]
    return {line.get("sketchObject", 0): line.get("mapObject", 0) for line in lines}


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "small-house-8",
        "small-house-plus-1",
        "tb4-warehouse-9",
        "montreal-5",
        "ros-map12-6",
    ],
)
def test_a_sketch_set_by_hand_is_matched_wholly_right_with_its_map(name, command_line):
    truth = truth_of(BY_HAND, name)
    map_ = BY_HAND / truth["map"]
    require(map_.exists(), f"the map of shared/data/sketches/{BY_HAND.name}/{name}.json")
    mapped = read_scene(map_)
    expected = {
        k: object_at(shapely.Point(point), mapped)
        for k, point in enumerate(truth["points"])
        if point is not None
    }
    done = command_line("match", BY_HAND / f"{name}.json", map_, "--json")
    assert object_map(done) == expected


@pytest.mark.slow
@pytest.mark.parametrize("name", ["00", "01", "02", "03"])
def test_a_sketch_that_a_person_drew_is_matched_wholly_right_with_its_map(name, command_line):
    truth = truth_of(BY_PEOPLE, name)
    pictures = [BY_PEOPLE / f"taurob_inv_{which}.png" for which in (name, "model")]
    done = command_line("match", *pictures, "--json")
    assert object_map(done) == {int(drawn): mapped for drawn, mapped in truth.items()}
