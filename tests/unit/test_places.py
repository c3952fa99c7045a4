"""The example places of the sketch pad, as files for whoever reads a robot's map."""

import numpy as np
import pytest
import yaml
from PIL import Image
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from sketchmatch import match, read_scene
from tests.tools import ROOT

PLACES = sorted((ROOT / "clients" / "web" / "public" / "places").iterdir())


def things(place):
    """Return the names of what is in a place, in the order in which it was drawn."""
    entries = yaml.safe_load((place / "map.yaml").read_text(encoding="utf-8"))
    return [name for name, entry in entries.items() if isinstance(entry, dict)]


@pytest.mark.parametrize("place", PLACES, ids=lambda place: place.name)
def test_a_map_has_free_unknown_and_occupied_cells_as_map_server_saves_them(place):
    with Image.open(place / "map.png") as picture:
        assert np.unique(np.asarray(picture)).tolist() == [0, 205, 254]


@pytest.mark.parametrize("place", PLACES, ids=lambda place: place.name)
def test_what_is_found_on_a_map_is_its_furniture(place):
    found = read_scene(place / "map.yaml").objects
    assert sorted(each.label for each in found) == sorted(things(place))
    assert {each.certainty for each in found} == {1.0}


def centred(scene):
    """Return the middles of objects from their common middle, in units of their spread."""
    middles = np.array([each.centroid for each in scene.objects])
    middles -= middles.mean(axis=0)
    return middles / middles.std()


@pytest.mark.parametrize("place", PLACES, ids=lambda place: place.name)
def test_the_sketch_of_a_place_is_matched_wholly(place):
    sketch, found = (read_scene(place / name) for name in ("sketch.json", "map.yaml"))
    result = match(sketch, found)
    # Sketch and map are hardly turned against each other.
    truth = linear_sum_assignment(cdist(centred(sketch), centred(found)))[1]
    assert result.object_map == dict(enumerate(truth.tolist()))
    assert result.probability > 0.95
