"""Choosing the algorithms of a match: defaults, names, parameters, and every wrong choice."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import Image, LabelledPolygon, OccupancyGrid, PolygonSet, Stroke, StrokeSet
from sketchmatch.pipeline.selection import (
    STAGES,
    Choice,
    Defaults,
    Profile,
    chosen_algorithms,
    default_names,
    default_parameters,
    profile_faults,
    resolve,
    resolve_segmenter,
)
from sketchmatch.registry import Kind, default_registry

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
        "searcher": "align",
        "judge": "posterior",
    }
    assert list(pipeline.stages()) == list(STAGES)


def test_scenes_need_no_segmenter():
    pipeline = resolve(default_registry(), {})
    assert list(pipeline.stages()) == ["histogram", "similarity", "searcher", "judge"]


def test_parameters_reach_their_stage_alone():
    selection = {
        "searcher": Choice("easm", {"population": 7}),
        "map_segmenter": Choice("occupancy-grid", {"min_size": 0.5}),
    }
    pipeline = resolve(default_registry(), selection, SOURCES["strokes"], SOURCES["occupancy-grid"])
    assert pipeline.searcher.params.population == 7
    assert pipeline.searcher.params.patience == 400
    assert pipeline.map_segmenter.params.min_size == 0.5
    assert pipeline.histogram.params.directions is None


def test_an_unknown_stage_is_refused_with_the_choices():
    error = refused({"finder": Choice("easm")})
    assert (error.reason, error.field) == (Reason.INVALID_PARAMETER, "finder")
    assert "sketch_segmenter, map_segmenter, histogram, similarity, searcher" in error.problem


@pytest.mark.parametrize("stage", ["histogram", "similarity", "searcher"])
def test_an_unknown_algorithm_is_refused_with_the_choices(stage):
    error = refused({stage: Choice("best")})
    assert (error.reason, error.field) == (Reason.UNKNOWN_ALGORITHM, f"{stage}.name")
    assert f"is 'best', which is not a {stage}; choose one of: " in error.problem


def test_an_algorithm_of_another_kind_is_unknown():
    assert refused({"histogram": Choice("easm")}).reason is Reason.UNKNOWN_ALGORITHM


def test_a_segmenter_that_cannot_read_the_source_is_refused_with_those_that_can():
    error = refused({"sketch_segmenter": Choice("polygons")}, SOURCES["strokes"], None)
    assert (error.reason, error.field) == (Reason.WRONG_ALGORITHM, "sketch_segmenter.name")
    assert "stroke_set; choose one of: rooms, strokes" in error.problem


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
        ({"colour": 1}, "colour", "is not a parameter of occupancy-grid; it has: free_threshold"),
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


# What configuration and profiles say ------------------------------------------------------------

# Searchers with parameters in common, so that those of another could be taken over by mistake.
_SETTABLE = {
    "easm": ("patience", "population", "exchange_rate"),
    "direct": ("patience", "population", "exchange_rate"),
    "nn-pso": ("patience", "particles"),
    "align": ("poses", "maps"),
}
_VALUES = {"exchange_rate": st.floats(0, 1)}


def _parameters(name):
    values = {key: _VALUES.get(key, st.integers(2, 50)) for key in _SETTABLE[name]}
    return st.fixed_dictionaries({}, optional=values)


@st.composite
def levels(draw):
    """Return three levels that choose searchers, each sound upon those below."""
    found, current = [], "align"
    for _ in range(3):
        name = draw(st.sampled_from(["", *_SETTABLE]))
        current = name or current
        found.append(Choice(name, draw(_parameters(current))))
    return found


def oracle(chosen, parameters):
    """Return name and parameters: a level counts if all names from its own upwards agree."""
    name = next((level.name for level in reversed(chosen) if level.name), "align")
    counted = dict(parameters.get(name, {}))
    for k, level in enumerate(chosen):
        names = [upper.name for upper in chosen[k + 1 :] if upper.name]
        own = next((lower.name for lower in reversed(chosen[: k + 1]) if lower.name), "align")
        if own == name and all(upper == name for upper in names):
            counted.update(level.parameters)
    return name, counted


@given(levels(), st.fixed_dictionaries({name: _parameters(name) for name in _SETTABLE}))
def test_levels_are_laid_over_each_other_as_the_oracle_does(chosen, parameters):
    pipeline, profile, request = chosen
    defaults = Defaults(
        {"searcher": pipeline},
        {Kind.SEARCHER: parameters},
        (Profile("mine", "", {"searcher": profile}),),
        "mine",
    )
    found = resolve(default_registry(), {"searcher": request}, defaults=defaults)
    name, expected = oracle(chosen, parameters)
    assert found.profile == "mine"
    assert found.searcher.name == name
    assert found.searcher.params.model_dump(exclude_unset=True) == expected


MAPS = Defaults({"map_segmenter": Choice("occupancy-grid", {"region_share": 0.5})})
ROOMS = {"map_segmenter": Choice("rooms", {"min_area": 2.0})}


def test_a_configured_segmenter_is_used_for_the_sources_that_it_reads():
    registry, grid = default_registry(), SOURCES["occupancy-grid"]
    pipeline = resolve(registry, {}, SOURCES["strokes"], grid, MAPS)
    assert pipeline.map_segmenter.name == "occupancy-grid"
    assert pipeline.map_segmenter.params.region_share == 0.5
    assert resolve(registry, {}, None, SOURCES["polygons"], MAPS).map_segmenter.name == "polygons"
    assert resolve(registry, {}, None, None, MAPS).map_segmenter is None
    assert resolve(registry, {}, grid, None, MAPS).sketch_segmenter.name == "occupancy-grid"
    named = {"map_segmenter": Choice("rooms")}
    assert resolve(registry, named, None, grid, MAPS).map_segmenter.name == "rooms"


def test_a_segmenter_in_the_request_stays_strict():
    with pytest.raises(InvalidInputError, match="cannot read a source of type polygon_set"):
        resolve(
            default_registry(), {"map_segmenter": Choice("image")}, None, SOURCES["polygons"], MAPS
        )


def test_a_source_alone_takes_what_holds_for_its_side_of_a_match():
    registry = default_registry()
    for name in ("image", "strokes"):
        assert resolve_segmenter(registry, Choice(), SOURCES[name], MAPS).name == name
    found = resolve_segmenter(registry, Choice(), SOURCES["occupancy-grid"], MAPS)
    assert found.params.region_share == 0.5
    mine = Defaults(profiles=(Profile("mine", "", MAPS.pipeline),))
    found = resolve_segmenter(registry, Choice(), SOURCES["occupancy-grid"], mine, "mine")
    assert found.params.region_share == 0.5


def test_an_unknown_profile_is_refused_with_the_choices():
    defaults = Defaults(profiles=(Profile("fast"), Profile("mine")))
    for call in (
        lambda: resolve(default_registry(), {}, defaults=defaults, profile="best"),
        lambda: chosen_algorithms(default_registry(), {}, {}, defaults, "best"),
    ):
        with pytest.raises(InvalidInputError) as caught:
            call()
        assert caught.value.reason is Reason.UNKNOWN_PROFILE
        assert str(caught.value) == (
            "profile is 'best', which is not a profile; choose one of: fast, mine"
        )


def test_a_profile_of_no_use_is_refused_and_says_why():
    stages = {"searcher": Choice("annealing"), "histogram": Choice("", {"directions": 3})}
    defaults = Defaults(profiles=(Profile("mine", "", stages),))
    registry = default_registry()
    assert [fault.field for fault in profile_faults(registry, defaults, "mine")] == [
        "searcher.name",
        "histogram.parameters.directions",
    ]
    words = "profile is 'mine', whose searcher.name is 'annealing', which is not a searcher"
    with pytest.raises(InvalidInputError, match=words):
        resolve(registry, {"searcher": Choice("easm")}, defaults=defaults, profile="mine")
    with pytest.raises(InvalidInputError, match=words):
        chosen_algorithms(registry, {"searcher": Choice()}, {}, defaults, "mine")
    resolve(registry, {}, defaults=defaults)


def test_the_algorithms_of_a_request_are_told_without_setting_them_up():
    defaults = Defaults({"searcher": Choice("easm", {"no": "such parameter"}), **ROOMS})
    found = chosen_algorithms(
        default_registry(),
        {"map_segmenter": Choice(), "searcher": Choice(), "histogram": Choice("hybrid")},
        {"map_segmenter": OccupancyGrid},
        defaults,
    )
    assert [item.name for item in found] == ["rooms", "easm", "hybrid"]


def test_the_catalogue_knows_what_holds_where_a_request_says_nothing():
    registry = default_registry()
    defaults = Defaults(
        {"searcher": Choice("easm", {"patience": 9}), **ROOMS},
        {Kind.SEARCHER: {"easm": {"population": 7}, "nn": {"seed_points": 5}}},
    )
    names = default_names(registry, defaults)
    assert names[Kind.SEARCHER] == ("easm",)
    assert names[Kind.HISTOGRAM] == ("constant",)
    assert "rooms" in names[Kind.SEGMENTER]

    def parameters(kind, name):
        return default_parameters(registry, defaults, registry.find(kind, name))

    assert parameters(Kind.SEARCHER, "easm") == {"population": 7, "patience": 9}
    assert parameters(Kind.SEARCHER, "nn") == {"seed_points": 5}
    assert parameters(Kind.SEGMENTER, "rooms") == {"min_area": 2.0}
    assert parameters(Kind.SEGMENTER, "occupancy-grid") == {}
