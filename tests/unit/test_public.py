"""What people in a notebook use."""

import json
import math
import subprocess
import sys

import numpy as np
import pytest

import sketchmatch
from sketchmatch import (
    InvalidInputError,
    Scene,
    SketchmatchError,
    force_histogram,
    match,
    read_scene,
)
from sketchmatch.api import Outcome
from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH, LIVING_ROOM_TRUTH
from sketchmatch.model import Stroke, StrokeSet
from sketchmatch.pipeline.events import Progress
from sketchmatch.pipeline.warmup import warm_up_others
from sketchmatch.registry import default_registry
from sketchmatch.testing import random_scene
from tests.oracle.forces import force_histogram as by_definition
from tests.strategies import FRAME

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def test_every_public_name_is_there():
    for name in sketchmatch.__all__:
        assert getattr(sketchmatch, name).__name__ == name
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        sketchmatch.nothing  # noqa: B018


def test_importing_it_loads_nothing_heavy():
    heavy = ("numba", "cv2", "grpc", "shapely")
    code = f"import sys, sketchmatch; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.fixture(scope="module")
def living_room():
    return match(LIVING_ROOM_SKETCH, str(LIVING_ROOM_MAP), seed=1)


def test_the_bundled_example_is_matched_as_its_truth_says(living_room):
    truth = json.loads(LIVING_ROOM_TRUTH.read_text(encoding="utf-8"))
    centres = np.array([item.centroid for item in living_room.map.objects])
    assert len(centres) == len(truth["objects"]) == 8
    expected = {}
    for k, item in enumerate(truth["objects"]):
        assert living_room.sketch.labels[k] == item["label"]
        distances = np.hypot(*(centres - item["map_centroid"]).T)
        assert distances.min() < 0.1
        expected[k] = int(distances.argmin())
    assert living_room.object_map == expected
    # The truth tells the turn from map to sketch.
    off = living_room.rotation + math.radians(truth["rotation_degrees"])
    assert math.degrees(math.remainder(off, math.tau)) == pytest.approx(0.0, abs=10.0)


def test_a_result_has_what_was_promised(living_room):
    assert living_room.seed == 1
    assert 0.8 < living_room.fmap_confidence < 1.0
    assert 0.7 < living_room.omap_confidence < 1.0
    assert living_room.outcome is Outcome.OPTIMAL
    assert living_room.upper_bound == pytest.approx(living_room.fmap_confidence, abs=1e-12)
    assert living_room.statistics.evaluations > 0


def test_a_scene_read_from_a_file_is_the_scene_matched(living_room):
    for path, used in (
        (LIVING_ROOM_SKETCH, living_room.sketch),
        (str(LIVING_ROOM_MAP), living_room.map),
    ):
        scene = read_scene(path)
        assert isinstance(scene, Scene)
        assert [item.area for item in scene.objects] == [item.area for item in used.objects]
        assert scene.labels == used.labels


def test_arguments_reach_the_match():
    scene, seen = random_scene(np.random.default_rng(0), 5), []
    result = match(
        scene,
        scene,
        searcher="easm",
        params={"searcher": {"generations": 5}, "histogram": {"directions": 36}},
        seed=3,
        weights=(1, 0, 0),
        on_progress=seen.append,
    )
    assert (result.seed, result.statistics.iterations) == (3, 5)
    assert result.outcome is Outcome.ITERATION_LIMIT
    assert result.fmap_confidence == result.confidence.similarity
    assert seen
    assert all(isinstance(progress, Progress) for progress in seen)


def test_a_time_budget_reaches_the_match():
    warm_up_others(default_registry())
    scene = random_scene(np.random.default_rng(0), 5)
    endless = {"searcher": {"patience": 10_000_000, "generations": 10_000_000}}
    result = match(scene, scene, searcher="easm", params=endless, time_budget=0.3)
    assert result.outcome is Outcome.TIME_BUDGET


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"searcher": "best"}, r"searcher\.name is 'best'.*choose one of: .*easm"),
        ({"histogram": "best"}, r"histogram\.name is 'best'"),
        ({"similarity": "best"}, r"similarity\.name is 'best'"),
        ({"params": {"finder": {}}}, r"params\.finder is no stage"),
        ({"params": {"searcher": {"speed": 1}}}, r"speed is no parameter of auto"),
        ({"params": {"map_segmenter": {"min_size": 1}}}, r"map_segmenter is set for a scene"),
        ({"seed": -1}, "seed is -1"),
        ({"time_budget": -1}, "time_budget is -1 s"),
        ({"weights": (0, 0, 0)}, "weights are all zero"),
    ],
)
def test_a_wrong_argument_is_refused_in_one_sentence(arguments, words):
    scene = random_scene(np.random.default_rng(0), 3)
    with pytest.raises(InvalidInputError, match=words) as caught:
        match(scene, scene, **arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("side", ["sketch", "map"])
def test_a_file_that_is_not_there_is_refused_with_its_side(tmp_path, side):
    paths = {"sketch": LIVING_ROOM_SKETCH, "map": LIVING_ROOM_MAP, side: tmp_path / "lost.svg"}
    with pytest.raises(InvalidInputError, match="does not exist") as caught:
        match(**paths)
    assert caught.value.field.startswith(side)
    assert "lost.svg" in str(caught.value)
    assert isinstance(caught.value, SketchmatchError)


@pytest.mark.parametrize("directions", [4, 36, 180])
def test_force_histograms_take_arrays_lists_and_objects(directions):
    expected = by_definition(FRAME, [SQUARE + 2.5], directions)
    item = Scene.from_polygons([SQUARE + 2.5, SQUARE]).objects[0]
    for other in (SQUARE + 2.5, (SQUARE + 2.5).tolist(), [SQUARE + 2.5], item):
        found = force_histogram(FRAME, other, directions=directions)
        assert found.shape == (directions,)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * expected.max())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"r": 10.5}, r"r is 10\.5; it should be less than or equal to 10"),
        ({"directions": 5}, r"directions is 5; it should be a multiple of 2"),
        ({"a": SQUARE[:2]}, r"a\.rings\[0\] has 2 distinct points"),
        ({"b": SQUARE * np.nan}, r"b\.rings\[0\]\.points\[0\] is not finite"),
    ],
)
def test_force_histograms_refuse_what_cannot_be(arguments, words):
    with pytest.raises(InvalidInputError, match=words):
        force_histogram(**{"a": SQUARE, "b": SQUARE + 2.0, **arguments})


def test_a_route_drawn_through_the_sketch_comes_with_the_result():
    boxes = [SQUARE, 2.0 * SQUARE + np.array([5.0, 0.0]), SQUARE + np.array([0.0, 6.0])]
    way = np.array([(-1.0, -1.0), (3.0, 3.0), (9.0, 9.0)])
    strokes = [Stroke(np.vstack([box, box[:1]])) for box in boxes]
    sketch = StrokeSet((*strokes, Stroke(way, label="route")))
    result = sketchmatch.match(sketch, Scene.from_polygons(boxes))
    assert result.object_map == {0: 0, 1: 1, 2: 2}
    np.testing.assert_array_equal(result.sketch_route, way)
    assert sketchmatch.match(Scene.from_polygons(boxes), sketch).sketch_route is None
