"""Scenes saved as GeoJSON, and read again."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch import Scene, read_scene
from sketchmatch.errors import InvalidInputError
from sketchmatch.io.geojson import decode_geojson
from sketchmatch.io.scene_files import check_scene_path, encode_geojson, save_scene
from sketchmatch.model import SceneObject
from tests.strategies import FRAME, cornered_rings, floats, star_rings

LABELS = st.one_of(st.just(""), st.text(max_size=8), st.sampled_from(["Stühl", "\ud800", '"', " "]))


@st.composite
def scenes(draw):
    """Return scenes anywhere, of any size, with holes, in either orientation."""
    objects = []
    for k in range(draw(st.integers(2, 5))):
        rings = draw(st.one_of(star_rings(), cornered_rings(), st.just(FRAME)))
        scale = draw(st.sampled_from([1.0, 0.1, 1e-7, 1e9]))
        offset = np.array([draw(floats(-1e3, 1e3)), draw(floats(-1e3, 1e3)) + 10 * k])
        moved = [(np.asarray(ring, np.float64) + offset) * scale for ring in rings]
        turned = [ring[::-1] if draw(st.booleans()) else ring for ring in moved]
        try:
            objects.append(SceneObject.from_rings(turned, draw(LABELS)))
        except InvalidInputError:
            objects.append(SceneObject.from_rings(FRAME, draw(LABELS)))
    return Scene(tuple(objects))


def assert_same(one, other):
    assert one.labels == other.labels
    assert [len(item.rings) for item in one.objects] == [len(item.rings) for item in other.objects]
    for a, b in zip(one.objects, other.objects, strict=True):
        for ring, again in zip(a.rings, b.rings, strict=True):
            assert np.array_equal(ring, again)


@pytest.mark.slow
@given(scenes())
def test_reading_what_was_saved_gives_the_same_scene(tmp_path_factory, scene):
    path = tmp_path_factory.mktemp("scene") / "scene.geojson"
    save_scene(path, scene)
    assert_same(scene, read_scene(path))
    again = path.with_name("again.geojson")
    save_scene(again, read_scene(path))
    assert again.read_bytes() == path.read_bytes()


def test_it_is_geojson_as_the_rfc_has_it():
    scene = Scene.from_polygons([FRAME, [[9, 9], [12, 9], [9, 12.25]]], ["Rahmen", ""])
    text = encode_geojson(scene)
    document = json.loads(text)
    assert document["type"] == "FeatureCollection"
    first, second = document["features"]
    assert (first["type"], first["properties"]) == ("Feature", {"label": "Rahmen"})
    assert second["properties"] == {"label": ""}
    outer, hole = first["geometry"]["coordinates"]
    assert outer[0] == outer[-1]
    assert hole[0] == hole[-1]
    assert len(decode_geojson(text).polygons) == 2


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("scene.json", "give a name that ends in .geojson"),
        ("scene.svg", "give a name that ends in .geojson"),
        ("none/scene.geojson", "there is no folder"),
    ],
)
def test_other_places_are_refused(tmp_path, name, words):
    with pytest.raises(InvalidInputError, match=words) as caught:
        check_scene_path(tmp_path / name, "--out")
    assert caught.value.field == "--out"


def test_what_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "scene.geojson").mkdir()
    scene = Scene.from_polygons([[[0, 0], [1, 0], [0, 1]], [[3, 0], [4, 0], [3, 1]]])
    with pytest.raises(InvalidInputError, match="cannot be written to"):
        save_scene(tmp_path / "scene.geojson", scene)
