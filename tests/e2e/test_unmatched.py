"""Objects without partner, weights and probabilities, through every door."""

import json

import numpy as np
import pytest

from sketchmatch import Scene
from sketchmatch.model import ConfidenceWeights
from sketchmatch.testing import random_scene, simulate_sketch
from sketchmatch_client import Client, InvalidRequestError, sources

WEIGHTS = ConfidenceWeights(1.0, 3.8, 0.05, 2.9, 0.58, 1.0)


@pytest.fixture(scope="module")
def place():
    """Return a sketch of seven of a map's eight objects and another one, the map, the truth."""
    rng = np.random.default_rng(0)
    everything = random_scene(rng, 9)
    drawn = simulate_sketch(everything, rng, objects=range(1, 9), displacement=0.05)
    truth = {k: int(p) for k, p in enumerate(drawn.partners) if p != 8}
    return drawn.scene, Scene(everything.objects[:8]), truth


@pytest.fixture
def files(place, tmp_path):
    paths = tmp_path / "sketch.geojson", tmp_path / "map.geojson"
    for path, scene in zip(paths, place[:2], strict=True):
        rings = [[ring.tolist() for ring in item.rings] for item in scene.objects]
        shapes = [{"type": "Polygon", "coordinates": each} for each in rings]
        path.write_text(json.dumps({"type": "GeometryCollection", "geometries": shapes}))
    return paths


def message(scene):
    return sources.polygons([[ring.tolist() for ring in item.rings] for item in scene.objects])


@pytest.fixture(params=["in process", "server"])
def where(request):
    if request.param == "in process":
        return []
    return ["--server", request.getfixturevalue("address")]


def test_the_command_line_leaves_objects_out(command_line, files, place, where):
    options = ("--allow-unmatched", "--json", *where)
    done = command_line("match", *files, *options)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    found = {
        line.get("sketchObject", 0): line.get("mapObject", 0) for line in result["objectMatches"]
    }
    assert found == place[2]
    assert len(result["unmatchedSketchObjects"]) == len(result["unmatchedMapObjects"]) == 1
    assert 0.5 < result["probability"] <= 1
    assert all(result["probability"] <= line["probability"] for line in result["objectMatches"])
    price = ("--judge", "confidence", "--unmatched-price", 9)
    dear = json.loads(command_line("match", *files, *options, *price).stdout)
    assert len(dear["objectMatches"]) == 8
    without = ("--no-allow-unmatched", "--unmatched-price", "1")
    refused = command_line("match", *files, *without, *where)
    assert refused.returncode == 2
    assert "unmatched_price is 1, but no object may stay unmatched" in refused.stderr


def test_a_server_says_what_is_in_force(place, address):
    sketch, map_, truth = place
    with Client(address) as client:
        request = (message(sketch), message(map_))
        options = {"weights": WEIGHTS, "allow_unmatched": True, "unmatched_price": 0.25}
        first, *_, last = client.events(*request, **options)
        assert first.accepted.unmatched_price == 0.25
        weights = first.accepted.weights
        assert tuple(getattr(weights, name) for name in WEIGHTS._fields) == tuple(WEIGHTS)
        lines = last.result.object_matches
        assert {line.sketch_object: line.map_object for line in lines} == truth
        first, *_, last = client.events(*request)
        assert first.accepted.unmatched_price > 0.0, "by default objects may stay unmatched"
        assert first.accepted.weights.rotation == first.accepted.weights.dilation == 1.0
        lines = last.result.object_matches
        assert {line.sketch_object: line.map_object for line in lines} == truth
        for options in ({"allow_unmatched": False}, {"profile": "thesis"}):
            first, *_, last = client.events(*request, **options)
            assert not first.accepted.HasField("unmatched_price")
            assert len(last.result.object_matches) == 8
        profiles = {profile.name: profile for profile in client.algorithms().profiles}
        assert not profiles["proof"].allow_unmatched
        assert not profiles["proof"].HasField("weights")
        with pytest.raises(
            InvalidRequestError, match="allow_unmatched needs a searcher that finds"
        ):
            client.match(*request, searcher="nn", allow_unmatched=True)


def test_a_profile_may_allow_it(command_line, files, place, tmp_path):
    mine = tmp_path / "mine.toml"
    mine.write_text("[profiles.mine]\nweights = [2, 2, 2]\nallow_unmatched = true\n")
    options = ("--config", mine, "--profile", "mine", "--json")
    done = command_line("match", *files, *options)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert len(result["objectMatches"]) == len(place[2])
    result = json.loads(command_line("match", *files, *options, "--no-allow-unmatched").stdout)
    assert len(result["objectMatches"]) == 8
    shown = command_line("config", "show", "--config", mine).stdout
    assert "profiles.mine" in shown
    mine.write_text("[profiles.mine]\nweights = [1, 2]\n")
    checked = command_line("config", "check", mine)
    assert (
        "it should be three, five or six numbers, the first five not all 0"
        in checked.stdout + checked.stderr
    )


@pytest.mark.parametrize(
    ("weights", "problem"),
    [
        ("[1, 1, 1, 0, 0, 9]", "it should have an exponent of distance of at most 4"),
        ("[1, 1, 1, 0, 2e6]", "2000000"),
    ],
)
def test_weights_of_a_profile_have_the_bounds_of_a_request_s(
    command_line, tmp_path, weights, problem
):
    mine = tmp_path / "mine.toml"
    mine.write_text(f"[profiles.mine]\nweights = {weights}\n")
    checked = command_line("config", "check", mine)
    assert checked.returncode == 2
    assert problem in checked.stdout + checked.stderr
