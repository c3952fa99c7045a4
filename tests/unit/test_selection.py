"""Choosing the algorithms of a match: defaults, names, parameters, and every wrong choice."""

import numpy as np
import pytest

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import Image, LabelledPolygon, OccupancyGrid, PolygonSet, Stroke, StrokeSet
from sketchmatch.pipeline.selection import STAGES, Choice, resolve, resolve_segmenter
from sketchmatch.registry import default_registry

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
SOURCES = {
    "strokes": StrokeSet((Stroke(SQUARE),)),
    "polygons": PolygonSet((LabelledPolygon((SQUARE,)),)),
    "occupancy-grid": OccupancyGrid(np.zeros((2, 2)), 0.05),
    "image": Image(np.zeros((2, 2), np.uint8)),
}


def refused(selection, sketch=None, map_=None):
    with pytest.raises(InvalidInputError) as caught:
        resolve(default_registry(), selection, sketch, map_)
    return caught.value


@pytest.mark.parametrize("name", SOURCES)
def test_every_kind_of_source_has_its_segmenter(name):
    pipeline = resolve(default_registry(), {}, SOURCES[name], SOURCES["polygons"])
    assert {stage: algorithm.name for stage, algorithm in pipeline.stages().items()} == {
        "sketch_segmenter": name,
        "map_segmenter": "polygons",
        "histogram": "constant",
        "similarity": "cross-correlation",
        "searcher": "auto",
    }
    assert list(pipeline.stages()) == list(STAGES)


def test_scenes_need_no_segmenter():
    pipeline = resolve(default_registry(), {})
    assert list(pipeline.stages()) == ["histogram", "similarity", "searcher"]


def test_parameters_reach_their_stage_alone():
    selection = {
        "searcher": Choice("easm", {"population": 7}),
        "map_segmenter": Choice("occupancy-grid", {"min_size": 0.5}),
    }
    pipeline = resolve(default_registry(), selection, SOURCES["strokes"], SOURCES["occupancy-grid"])
    assert pipeline.searcher.params.population == 7
    assert pipeline.searcher.params.patience == 400
    assert pipeline.map_segmenter.params.min_size == 0.5
    assert pipeline.histogram.params.directions == 180


def test_an_unknown_stage_is_refused_with_the_choices():
    error = refused({"finder": Choice("easm")})
    assert (error.reason, error.field) == (Reason.INVALID_PARAMETER, "finder")
    assert "sketch_segmenter, map_segmenter, histogram, similarity, searcher" in error.problem


@pytest.mark.parametrize("stage", ["histogram", "similarity", "searcher"])
def test_an_unknown_algorithm_is_refused_with_the_choices(stage):
    error = refused({stage: Choice("best")})
    assert (error.reason, error.field) == (Reason.UNKNOWN_ALGORITHM, f"{stage}.name")
    assert f"is 'best', which is no {stage}; choose one of: " in error.problem


def test_an_algorithm_of_another_kind_is_unknown():
    assert refused({"histogram": Choice("easm")}).reason is Reason.UNKNOWN_ALGORITHM


def test_a_segmenter_that_cannot_read_the_source_is_refused_with_those_that_can():
    error = refused({"sketch_segmenter": Choice("polygons")}, SOURCES["strokes"], None)
    assert (error.reason, error.field) == (Reason.WRONG_ALGORITHM, "sketch_segmenter.name")
    assert "stroke_set; choose one of: strokes" in error.problem


@pytest.mark.parametrize("choice", [Choice("polygons"), Choice("", {"min_size": 1.0})])
def test_a_segmenter_for_a_scene_is_refused(choice):
    error = refused({"map_segmenter": choice})
    assert (error.reason, error.field) == (Reason.WRONG_ALGORITHM, "map_segmenter")


def test_an_empty_choice_leaves_a_scene_alone():
    assert resolve(default_registry(), {"map_segmenter": Choice()}).map_segmenter is None


@pytest.mark.parametrize(
    ("parameters", "field", "words"),
    [
        ({"min_size": -1}, "min_size", "is -1; it should be greater than or equal to 0"),
        ({"min_size": "wide"}, "min_size", "is 'wide'; it should be a valid number"),
        ({"colour": 1}, "colour", "is no parameter of occupancy-grid; it has: free_threshold"),
    ],
)
def test_a_wrong_parameter_of_a_segmenter_is_refused_by_its_path(parameters, field, words):
    choice = Choice("occupancy-grid", parameters)
    error = refused({"map_segmenter": choice}, None, SOURCES["occupancy-grid"])
    assert error.reason is Reason.INVALID_PARAMETER
    assert error.field == f"map_segmenter.parameters.{field}"
    assert words in error.problem


def test_a_segmenter_alone_is_chosen_under_its_own_path():
    with pytest.raises(InvalidInputError) as caught:
        resolve_segmenter(default_registry(), Choice("best"), SOURCES["image"])
    assert caught.value.field == "segmenter.name"


def test_the_first_of_several_faults_is_told_in_one_sentence():
    error = refused({"searcher": Choice("easm", {"population": 1, "patience": 0})})
    assert error.field == "searcher.parameters.population"
    assert "\n" not in str(error)
