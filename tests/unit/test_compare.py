"""A sketch compared with a map, without a search."""

import math

import numpy as np
import pytest

from sketchmatch import InvalidInputError, Scene, compare
from sketchmatch.errors import Reason
from sketchmatch.model import ConfidenceWeights, SceneDescriptor
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.search import Goal
from sketchmatch.pipeline.slices import finish
from sketchmatch.registry import default_registry
from sketchmatch_builtin.histograms.constant import ConstantForce
from sketchmatch_builtin.histograms.force import Force
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation

BOX, BAR, DOT = [[0, 0], [2, 0], [2, 2], [0, 2]], [[5, 0], [9, 0], [9, 1]], [[1, 6], [2, 6], [2, 7]]
FAR = [[20, 20], [26, 20], [26, 23]]


def quarter(polygon, factor=2.0):
    """Return a polygon turned by a quarter and grown."""
    return [[-factor * y, factor * x] for x, y in polygon]


SKETCH = Scene.from_polygons([BOX, BAR, DOT])
MAP = Scene.from_polygons([quarter(each) for each in (DOT, FAR, BOX, BAR)])
SAME = {0: 2, 1: 3, 2: 0}


@pytest.mark.parametrize("swapped", [False, True])
def test_relations_read_from_sketch_to_map_whichever_has_more_objects(swapped):
    scenes = (MAP, SKETCH) if swapped else (SKETCH, MAP)
    found = compare(*scenes)
    assert found.swapped is swapped
    assert (found.sketch, found.map) == scenes
    partners = {b: a for a, b in SAME.items()} if swapped else SAME
    pairs = [(b, a) for a in partners for b in partners if a != b]
    for a, b in pairs:
        (entry,) = found.most_similar([(a, b)], [(partners[a], partners[b])])
        assert (entry.sketch_pair, entry.map_pair) == ((a, b), (partners[a], partners[b]))
        assert entry.similarity == pytest.approx(1.0, abs=1e-9)
        assert entry.rotation == pytest.approx(-math.pi / 2 if swapped else math.pi / 2, abs=1e-9)
        assert entry.dilation == pytest.approx(0.5 if swapped else 2.0, rel=1e-9)
        (dual,) = found.most_similar([(b, a)], [(partners[a], partners[b])])
        assert (dual.similarity, dual.dilation) == (entry.similarity, entry.dilation)
        assert dual.rotation == pytest.approx(-entry.rotation, abs=1e-9)


def test_the_most_similar_come_first_and_only_so_many():
    found = compare(SKETCH, MAP)
    every = found.most_similar()
    assert len(every) == 3 * 6
    assert [entry.similarity for entry in every] == sorted(
        (entry.similarity for entry in every), reverse=True
    )
    assert found.most_similar(limit=5) == every[:5]


def test_a_search_can_go_on_from_a_comparison():
    engine = Engine(default_registry())
    pipeline, goal = engine.resolve({}), Goal(ConfidenceWeights())
    found = finish(engine.search(compare(SKETCH, MAP), pipeline.searcher, goal))
    assert dict(enumerate(found.best.mapped.partners.tolist())) == SAME


@pytest.mark.parametrize(
    ("other", "words"),
    [
        (ConstantForce(ConstantForce.Params(directions=90)), "constant .*90.* in 90 directions"),
        (Force(Force.Params(r=0.0)), "force .*in 180 directions"),
        (Force(Force.Params(r=1.0)), "force .*in 180 directions"),
    ],
    ids=["directions", "algorithm", "exponent"],
)
def test_histograms_of_two_kinds_are_not_compared(other, words):
    template, argument = finish(describe(SKETCH, ConstantForce())), finish(describe(MAP, other))
    with pytest.raises(InvalidInputError, match=words) as refused:
        finish(relate(template, argument, CrossCorrelation()))
    assert refused.value.reason is Reason.INVALID_PARAMETER


def test_histograms_made_by_hand_are_compared_where_they_have_the_same_directions():
    rows = np.eye(3, 4)
    ours, theirs = SceneDescriptor(rows, 3, 0.0), SceneDescriptor(np.eye(3, 6), 3, 0.0)
    assert finish(relate(ours, ours, CrossCorrelation())).similarity[0, 0] == pytest.approx(1.0)
    with pytest.raises(InvalidInputError, match=r"in 6 directions, but .* in 4"):
        finish(relate(ours, theirs, CrossCorrelation()))
    with pytest.raises(InvalidInputError, match=r"exponent 1 .* exponent 0"):
        finish(relate(ours, SceneDescriptor(rows, 3, 1.0), CrossCorrelation()))


def test_a_descriptor_knows_what_it_describes_and_how():
    found = finish(describe(SKETCH, ConstantForce()))
    assert found.scene == SKETCH.identity
    assert found.described_by == 'constant {"directions":180}'


def test_scenes_are_the_same_where_their_outlines_are_whatever_their_names():
    named = Scene.from_polygons([BOX, BAR, DOT], labels=["desk", "shelf", "plant"])
    assert named.identity == SKETCH.identity
    moved = [[x, y + (1e-12 if x == 9 else 0)] for x, y in BAR]
    others = [[BAR, BOX, DOT], [BOX, BAR], [BOX, moved, DOT], [BOX, BAR[1:] + BAR[:1], DOT]]
    identities = {Scene.from_polygons(each).identity for each in others}
    assert len(identities) == 4
    assert SKETCH.identity not in identities


def test_a_hole_is_no_object_of_its_own():
    ring = [[0.5, 0.5], [1.5, 0.5], [1.5, 1.5]]
    with_hole = Scene.from_polygons([[BOX, ring], BAR])
    assert with_hole.identity != Scene.from_polygons([BOX, ring, BAR]).identity
