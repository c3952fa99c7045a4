"""What people in a notebook use."""

import inspect
import json
import math
import pickle
import shutil
import subprocess
import sys
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

import sketchmatch
from sketchmatch import (
    Feature,
    InvalidInputError,
    Scene,
    SketchmatchError,
    carry,
    force_histogram,
    match,
    read_scene,
    transfer,
)
from sketchmatch.api import Outcome
from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH, LIVING_ROOM_TRUTH
from sketchmatch.io import read_source
from sketchmatch.model import Stroke, StrokeSet
from sketchmatch.model.text import likelihood
from sketchmatch.pipeline.events import Phase, Progress
from sketchmatch.pipeline.result import Ambiguity, ObjectMatch
from sketchmatch.pipeline.selection import STAGES
from sketchmatch.pipeline.warmup import warm_up_others
from sketchmatch.registry import default_registry
from sketchmatch.testing import random_scene
from tests.oracle.forces import force_histogram as by_definition
from tests.strategies import FRAME

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])

THREE = Scene.from_polygons([SQUARE, 20.0 + SQUARE, SQUARE * 2.0 + 9.0])


def test_every_public_name_is_there():
    for name in sketchmatch.__all__:
        assert getattr(sketchmatch, name).__name__ == name
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        sketchmatch.nothing  # noqa: B018


def test_every_public_name_is_completed_at_a_prompt():
    assert set(sketchmatch.__all__) <= set(dir(sketchmatch))


def test_importing_it_loads_nothing_heavy():
    heavy = ("numba", "cv2", "grpc", "shapely")
    code = f"import sys, sketchmatch; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.fixture(scope="module")
def living_room():
    return match(LIVING_ROOM_SKETCH, str(LIVING_ROOM_MAP), seed=1)


@pytest.mark.parametrize("copied", [lambda each: pickle.loads(pickle.dumps(each)), deepcopy])
def test_results_go_to_other_processes(living_room, copied):
    again = copied(living_room)
    assert again.object_map == living_room.object_map
    assert again.statistics == living_room.statistics
    assert hash(again.statistics) == hash(living_room.statistics)
    with pytest.raises(TypeError):
        again.statistics.seconds["total"] = 0.0
    feature = sketchmatch.Feature("route", [[(10, 10), (20, 20)]], "way", speeds=[1, 2])
    moved = sketchmatch.transfer(THREE, THREE, [feature], object_map={0: 0, 1: 1})
    assert copied(moved).features[0].points.tolist() == moved.features[0].points.tolist()


def test_what_match_says_of_its_defaults_is_so():
    pipeline = sketchmatch.Engine().resolve({})
    chosen = (pipeline.histogram, pipeline.similarity, pipeline.searcher, pipeline.judge)
    names = ", ".join(f'``"{each.name}"``' for each in chosen[:3])
    said = " ".join((inspect.getdoc(match) or "").split())
    assert f'{names} and ``"{chosen[3].name}"``' in said


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
    assert living_room.outcome is Outcome.CONVERGED
    assert living_room.upper_bound is None
    assert living_room.place_probability > 0.99
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


def test_segmenters_and_their_parameters_are_chosen_by_side():
    usual = match(LIVING_ROOM_SKETCH, LIVING_ROOM_MAP)
    large = {"map_segmenter": {"min_size": 0.5}}
    chosen = match(
        LIVING_ROOM_SKETCH,
        LIVING_ROOM_MAP,
        sketch_segmenter="strokes",
        map_segmenter="occupancy-grid",
        params=large,
    )
    assert len(chosen.sketch) == len(usual.sketch)
    assert len(chosen.map) < len(usual.map)
    unnamed = match(LIVING_ROOM_SKETCH, LIVING_ROOM_MAP, params=large)
    assert unnamed.map.identity == chosen.map.identity
    scene = read_scene(LIVING_ROOM_MAP, segmenter="occupancy-grid", params={"min_size": 0.5})
    assert scene.identity == chosen.map.identity
    compared = sketchmatch.compare(LIVING_ROOM_SKETCH, LIVING_ROOM_MAP, params=large)
    assert compared.map.identity == chosen.map.identity


@pytest.mark.parametrize("function", [match, sketchmatch.compare])
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            {"map_segmenter": "room"},
            r"map_segmenter\.name is 'room', which is not a segmenter; choose",
        ),
        (
            {"map_segmenter": "strokes"},
            r"is 'strokes', which cannot read a source of type occupancy_grid",
        ),
        (
            {"sketch_segmenter": "image"},
            r"is 'image', which cannot read a source of type stroke_set",
        ),
        (
            {"params": {"map_segmenter": {"size": 1}}},
            r"map_segmenter\.parameters\.size is not a p",
        ),
        (
            {"params": {"segmenter_map": {}}},
            r"params\.segmenter_map is not a stage; choose .*map_segm",
        ),
        ({"params": {"map_segmenter": 3}}, r"params\.map_segmenter is 3; give a dict"),
        ({"params": [1]}, r"params is \[1\]; give a dict"),
        ({"map_segmenter": ["rooms"]}, r"map_segmenter is \['rooms'\]; give the name"),
    ],
)
def test_a_segmenter_of_no_use_is_refused_in_one_sentence(function, arguments, words):
    with pytest.raises(InvalidInputError, match=words):
        function(LIVING_ROOM_SKETCH, LIVING_ROOM_MAP, **arguments)


def test_a_scene_is_read_as_its_profile_and_configuration_say(tmp_path):
    file = tmp_path / "sketchmatch.toml"
    file.write_text(
        '[profiles.large.map_segmenter]\nname = "occupancy-grid"\nparameters = { min_size = 0.5 }\n'
    )
    large = read_scene(LIVING_ROOM_MAP, profile="large", config=file)
    assert large.identity == read_scene(LIVING_ROOM_MAP, params={"min_size": 0.5}).identity
    assert len(read_scene(LIVING_ROOM_MAP, config=file)) == 8
    with pytest.raises(InvalidInputError, match="profile is 'large', which is not a profile"):
        read_scene(LIVING_ROOM_MAP, profile="large")


def test_a_scene_is_refused_a_segmenter_of_no_use():
    with pytest.raises(InvalidInputError, match=r"segmenter\.name is 'strokes', which cannot"):
        read_scene(LIVING_ROOM_MAP, segmenter="strokes")


def test_a_stage_has_one_name_everywhere():
    from typer.main import get_command

    from sketchmatch.cli.app import app
    from sketchmatch_client import MatchOptions
    from sketchmatch_proto.v1.pipeline_pb2 import AlgorithmSelection, Pipeline

    chosen = AlgorithmSelection.DESCRIPTOR
    contract = [each.name for each in Pipeline.DESCRIPTOR.fields if each.message_type is chosen]
    assert list(STAGES) == contract
    assert set(STAGES) <= set(MatchOptions.__annotations__)
    assert set(STAGES) <= set(inspect.signature(match).parameters)
    assert set(STAGES[:-2]) <= set(inspect.signature(sketchmatch.compare).parameters)
    for command, stages in (("match", STAGES), ("relate", STAGES[:-2])):
        options = {
            option: parameter.name
            for parameter in get_command(app).commands[command].params
            for option in parameter.opts
            if not getattr(parameter, "hidden", False)
        }
        for stage in stages:
            assert options[f"--{stage.replace('_', '-')}"] == stage
        assert not [option for option in options if option.startswith("--segmenter")]


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
        ({"params": {"finder": {}}}, r"params\.finder is not a stage"),
        ({"params": {"searcher": {"speed": 1}}}, r"speed is not a parameter of align"),
        ({"params": {"map_segmenter": {"min_size": 1}}}, r"map_segmenter is set for a scene"),
        ({"seed": -1}, "seed is -1"),
        ({"time_budget": -1}, "time_budget is -1 s"),
        ({"weights": (0, 0, 0)}, "weights are all zero"),
        ({"seed": "one"}, "seed is 'one'; give an integer"),
        ({"time_budget": "1"}, "time_budget is '1'; give a number"),
        ({"weights": 1}, "weights are 1; give three, five or six numbers"),
        ({"weights": ("much", 1, 1)}, r"weights\.similarity is 'much'; give a number"),
        ({"alternatives": 0.5}, r"alternatives is 0\.5; give a whole number"),
        ({"allow_unmatched": "yes"}, "allow_unmatched is 'yes'; give True or False"),
        ({"allow_unmatched": True, "unmatched_price": "x"}, "unmatched_price is 'x'; give a numb"),
        ({"profile": 5}, "profile is 5; give the name of a profile, or leave it out"),
        ({"profile": []}, r"profile is \[\]; give the name of a profile, or leave it out"),
        ({"profile": ""}, "profile is ''; give the name of a profile, or leave it out"),
        ({"searcher": ""}, "searcher is ''; give the name of an algorithm, or leave it out"),
        ({"params": ""}, "params is ''; give a dict of parameters"),
        ({"config": ""}, "config is ''; give the path of a file, or leave it out"),
        ({"config": []}, r"config is \[\]; give the path of a file, or leave it out"),
        ({"config": 0}, "config is 0; give the path of a file, or leave it out"),
    ],
)
def test_a_wrong_argument_is_refused_in_one_sentence(arguments, words):
    scene = random_scene(np.random.default_rng(0), 3)
    with pytest.raises(InvalidInputError, match=words) as caught:
        match(scene, scene, **arguments)
    assert "\n" not in str(caught.value)


def test_numbers_of_numpy_are_numbers():
    scene = random_scene(np.random.default_rng(0), 3)
    result = match(
        *(scene, scene),
        seed=np.uint64(2**64 - 1),
        time_budget=np.float32(60.0),
        weights=np.array([1.0, 1.0, 0.5]),
        alternatives=np.int64(1),
        allow_unmatched=np.True_,
        unmatched_price=np.float64(0.5),
    )
    assert type(result.seed) is int
    assert result.seed == 2**64 - 1
    assert len(result.alternatives) == 1


@pytest.mark.parametrize("given", ["zones.geojson", Feature("point", ([[1, 2]],)), [(1, 2)], 3])
def test_what_are_no_features_are_refused(given):
    for refused in (lambda: transfer(THREE, THREE, given), lambda: carry(given, THREE, THREE)):
        with pytest.raises(InvalidInputError, match=r"^features is .*; give a list of Feature$"):
            refused()


@pytest.mark.parametrize("given", [None, 5, [SQUARE, SQUARE + 3.0], b"sketch.svg"])
def test_what_is_no_scene_is_refused_with_its_side(given):
    scene = random_scene(np.random.default_rng(0), 3)
    with pytest.raises(
        InvalidInputError, match=r"^sketch is .*; give a Scene, .* or the path"
    ) as caught:
        match(given, scene)
    assert "\n" not in str(caught.value)
    with pytest.raises(InvalidInputError, match=r"^map is "):
        sketchmatch.compare(scene, given)


def test_a_result_shows_itself_in_a_line_and_prints_a_table(living_room):
    living_room = replace(living_room, place_probability=None, ambiguity=None)
    line = repr(living_room)
    assert line == (
        f"<MatchResult: 8 of 8 sketched objects matched, "
        f"FMAP confidence {living_room.fmap_confidence:.3f}, "
        f"OMAP confidence {living_room.omap_confidence:.3f}, "
        f"probability {likelihood(living_room.probability)}, CONVERGED>"
    )
    assert str(living_room).isascii(), "any terminal can take it"
    headline, _, *rows = str(living_room).splitlines()
    assert headline == line.removeprefix("<MatchResult: ").removesuffix(">")
    assert len(rows) == 8
    for row, found in zip(rows, living_room.matches, strict=True):
        label = living_room.sketch.labels[found.sketch_object]
        assert row.split() == [
            *(str(found.sketch_object), *label.split(), str(found.map_object)),
            *(f"{found.confidence:.3f}", likelihood(found.probability), f"{found.margin:.3f}"),
        ]


def test_a_result_is_a_table_in_a_notebook(living_room):
    scene = living_room.sketch
    named = Scene.from_polygons(
        [item.rings for item in scene.objects], [f"<{k}>" for k in range(len(scene))]
    )
    table = replace(living_room, sketch=named)._repr_html_()
    assert table.count("<tr>") == 9
    assert "<td>3 &lt;3&gt;</td>" in table


def test_a_result_shows_no_probability_where_none_is_known(living_room):
    unknown = replace(
        living_room,
        probability=None,
        place_probability=None,
        ambiguity=None,
        matches=tuple(replace(m, probability=None, margin=None) for m in living_room.matches),
    )
    assert "probability" not in repr(unknown)
    first = str(unknown).splitlines()[2]
    assert first.endswith(f"{unknown.matches[0].confidence:.3f}")


def test_a_result_says_whether_it_is_the_place(living_room):
    living_room = replace(living_room, ambiguity=None)
    other = replace(living_room, place_probability=0.499)
    counted = "8 of 8 sketched objects matched, FMAP"
    assert repr(other).startswith(
        f"<MatchResult: probably not this place (this place: 0.499): {counted}"
    )
    assert "this place 0" not in repr(other)
    here = replace(living_room, place_probability=0.5)
    assert repr(here).startswith(f"<MatchResult: {counted}")
    assert repr(here).endswith(", this place 0.500, CONVERGED>")


def test_a_result_says_what_to_ask_where_maps_are_as_likely(living_room):
    shared = replace(living_room, ambiguity=Ambiguity(4, (0, 2), (1, 0)))
    label = living_room.sketch.labels[1]
    assert repr(shared).endswith(f", 4 maps about as likely, ask what 1 {label} is, CONVERGED>")


def test_a_result_lists_the_sketched_objects_without_partner_after_the_others(living_room):
    kept = [line for line in living_room.matches if line.sketch_object not in (2, 5)]
    part = replace(living_room, matches=tuple(kept))
    names = [f"{k} {living_room.sketch.labels[k]}".split() for k in (2, 5)]
    assert [row.split() for row in str(part).splitlines()[-2:]] == [
        [*name, "no", "partner"] for name in names
    ]
    told = replace(part, unmatched_sketch_probabilities=(0.25, 0.99999))
    assert [row.split() for row in str(told).splitlines()[-2:]] == [
        [*names[0], "no", "partner", "0.250"],
        [*names[1], "no", "partner", ">0.999"],
    ]


def test_other_maps_show_themselves_in_a_line(living_room):
    other = replace(living_room.alternatives[0], probability=None)
    assert repr(other) == (
        f"<AlternativeMap: FMAP confidence {other.confidence.total:.3f}, "
        f"OMAP confidence {other.omap_confidence:.3f}, "
        f"{other.object_map}>"
    )
    assert ", probability 0.250, {" in repr(replace(other, probability=0.25))


def test_a_comparison_shows_itself_in_a_line_and_prints_the_most_similar():
    found = sketchmatch.compare(LIVING_ROOM_SKETCH, LIVING_ROOM_MAP)
    best = found.most_similar(limit=10)
    most = f"{best[0].similarity:.3f}"
    line = f"784 pairs of relations, 8 sketched objects with 8 mapped ones, similarity up to {most}"
    assert repr(found) == f"<Comparison: {line}>"
    assert (str(found) + repr(found.table) + repr(found.sketch)).isascii()
    headline, _, *rows = str(found).splitlines()
    assert headline == f"{line}; the most similar:"
    assert len(rows) == 10
    (a, b), (c, d) = best[0].sketch_pair, best[0].map_pair
    names = f"{a} {found.sketch.labels[a]}, {b} {found.sketch.labels[b]}"
    assert rows[0].split() == [
        *names.split(),
        *(f"{c},", f"{d}", f"{best[0].similarity:.3f}"),
        *(f"{math.degrees(best[0].rotation):.1f}", f"{best[0].dilation:.3g}"),
    ]
    assert found._repr_html_().count("<tr>") == 11
    assert repr(found.table) == (
        f"<RelationTable: 28 x 28 relations of 8 x 8 objects, "
        f"similarity {found.table.similarity.min():.3f} to {most}>"
    )
    assert repr(found.sketch_descriptor) == (
        "<SceneDescriptor: 28 histograms in 180 directions of 8 objects, by constant>"
    )


def test_progress_shows_itself_in_a_line_with_what_is_known():
    begun = Progress(Phase.DESCRIBE, 1.0, 0.25)
    assert (begun.confidence, begun.upper_bound) == (None, None)
    assert repr(begun) == "<Progress: DESCRIBE, 1.00 s, 25%>"
    first = Progress(Phase.SEARCH, 2.0, confidence=0.5, evaluations=1)
    assert repr(first) == "<Progress: SEARCH, 2.00 s, confidence 0.500, 1 evaluation>"
    searching = Progress(Phase.SEARCH, 2.0, None, 3, 40, 0.5, 0.75, (ObjectMatch(0, 1, 0.5),) * 50)
    assert (
        repr(searching)
        == "<Progress: SEARCH, 2.00 s, confidence 0.500, 40 evaluations, at most 0.750>"
    )


@pytest.mark.parametrize("side", ["sketch", "map"])
def test_a_file_that_is_not_there_is_refused_with_its_side(tmp_path, side):
    paths = {"sketch": LIVING_ROOM_SKETCH, "map": LIVING_ROOM_MAP, side: tmp_path / "lost.svg"}
    with pytest.raises(InvalidInputError, match="does not exist") as caught:
        match(**paths)
    assert caught.value.field.startswith(side)
    assert "lost.svg" in str(caught.value)
    assert isinstance(caught.value, SketchmatchError)


def test_an_empty_path_is_not_the_folder_that_we_are_in(tmp_path, monkeypatch):
    for file in (LIVING_ROOM_MAP, LIVING_ROOM_MAP.with_suffix(".pgm")):
        shutil.copy(file, tmp_path)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(
        InvalidInputError, match=r"^sketch: path is empty; give the path of a file$"
    ):
        match("", LIVING_ROOM_MAP)
    for call in (read_scene, read_source):
        with pytest.raises(InvalidInputError, match=r"^path is empty; give the path of a file$"):
            call("")
        with pytest.raises(InvalidInputError, match=r"^path is None; give the path of a file$"):
            call(None)
    assert len(read_scene(".")) > 2, "who means the folder says so"


def test_a_file_that_is_not_there_is_told_from_the_side_that_it_is_for():
    with pytest.raises(InvalidInputError, match=r"^sketch: lost\.svg does not exist; check the"):
        match("lost.svg", LIVING_ROOM_MAP)


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
