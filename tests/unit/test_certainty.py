"""How certain an object is: checked, kept by files, drawn hollow, weighed by the judge."""

import numpy as np
import pytest

from sketchmatch import Scene, match
from sketchmatch.errors import InvalidInputError
from sketchmatch.io.geojson import decode_geojson
from sketchmatch.io.scene_files import encode_geojson
from sketchmatch.model import LabelledPolygon, PolygonSet, SceneObject
from sketchmatch.pictures._canvas import Canvas
from sketchmatch.pictures._panel import draw_object
from sketchmatch_builtin.judges.posterior import _as_certain
from sketchmatch_builtin.segmenters.polygons import PolygonSegmenter

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def scene(*certainties):
    return Scene(
        tuple(
            SceneObject.from_rings([SQUARE + np.array([3.0 * k, 0.0])], certainty=certainty)
            for k, certainty in enumerate(certainties)
        )
    )


@pytest.mark.parametrize("certainty", [0.0, -0.1, 1.5, float("nan"), True, "0.5", None])
def test_a_certainty_is_a_number_above_0_and_up_to_1(certainty):
    with pytest.raises(InvalidInputError, match="give a number above 0 and up to 1") as caught:
        SceneObject.from_rings([SQUARE], certainty=certainty)
    assert caught.value.field == "certainty"


def test_an_object_is_certain_unless_said_and_in_doubt_below_one_half():
    assert SceneObject.from_rings([SQUARE]).certainty == 1.0
    assert [item.doubtful for item in scene(1.0, 0.5, 0.49).objects] == [False, False, True]
    assert repr(scene(0.25, 1.0).objects[0]).endswith("around (0.5, 0.5), certainty 0.25>")


def test_scenes_that_differ_in_certainty_alone_are_others():
    assert scene(1.0, 0.5).identity != scene(1.0, 1.0).identity != scene(0.5, 1.0).identity
    assert scene(1.0, 0.5).identity == scene(1.0, 0.5).identity


def test_geojson_keeps_certainties():
    text = encode_geojson(scene(1.0, 0.3))
    assert text.count("certainty") == 1
    read = PolygonSegmenter().segment(decode_geojson(text)).scene
    assert [item.certainty for item in read.objects] == [1.0, 0.3]


@pytest.mark.parametrize("said", ['"high"', "0", "2", "true", "null", "[0.5]"])
def test_what_others_call_certainty_is_no_matter(said):
    text = encode_geojson(scene(1.0, 0.3)).replace('"certainty": 0.3', f'"certainty": {said}')
    assert [each.certainty for each in decode_geojson(text).polygons] == [1.0, 1.0]


def test_polygons_hand_their_certainty_on():
    polygons = PolygonSet(
        (LabelledPolygon((SQUARE,), certainty=0.75), LabelledPolygon((SQUARE + 3.0,)))
    )
    found = PolygonSegmenter().segment(polygons).scene
    assert [item.certainty for item in found.objects] == [0.75, 1.0]


def test_what_is_in_doubt_is_drawn_hollow():
    def inside(**options):
        canvas = Canvas((100.0, 100.0), 100, (255, 255, 255))
        draw_object(canvas, [SQUARE * 80.0 + 10.0], (200, 30, 30), **options)
        picture = np.asarray(canvas.finished())
        return picture[50, 50].tolist(), len(np.unique(picture.reshape(-1, 3), axis=0))

    (middle, colours) = inside(hollow=True)
    assert middle == [255, 255, 255]
    assert colours > 1
    assert inside()[0] != middle


def test_maps_onto_what_is_in_doubt_lose_and_what_is_left_keeps_the_sum():
    maps = np.array([[0, 1], [0, 2], [-1, 2]])
    shares = _as_certain(np.array([0.5, 0.3, 0.1]), maps, scene(1.0, 0.2, 0.5))
    assert shares.sum() == pytest.approx(0.9)
    assert shares / shares[0] == pytest.approx([1.0, 1.5, 0.5])
    same = np.array([0.5, 0.3, 0.1])
    assert _as_certain(same, maps, scene(1.0, 1.0, 1.0)) == pytest.approx(same)


def test_maps_of_many_objects_of_which_hardly_any_is_sure_are_told_apart():
    scene = Scene(
        tuple(
            SceneObject.from_rings([[(3 * k, 0), (3 * k + 1, 0), (3 * k, 1)]], "", c)
            for k, c in enumerate([1e-200, 1e-200, 1e-201])
        )
    )
    shares = _as_certain(np.array([0.3, 0.3, 0.0]), np.array([[0, 1], [0, 2], [2, -1]]), scene)
    assert shares == pytest.approx([0.6 * 10 / 11, 0.6 / 11, 0.0])


def test_the_less_certain_partner_is_the_less_likely():
    rng = np.random.default_rng(0)
    boxes = [SQUARE * rng.uniform(0.5, 2.0, 2) + rng.uniform(0, 20, 2) for _ in range(5)]
    sketch = Scene.from_polygons(boxes)

    def likely(certainty):
        items = [SceneObject.from_rings([box]) for box in boxes[1:]]
        map_ = Scene((SceneObject.from_rings([boxes[0]], certainty=certainty), *items))
        found = match(sketch, map_, seed=0)
        assert found.object_map[1] == 1
        return next((each.probability for each in found.matches if each.sketch_object == 0), 0.0)

    assert likely(0.05) < likely(1.0)
