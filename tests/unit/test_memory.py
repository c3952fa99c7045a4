"""What is remembered of scenes is what would be computed, to the last digit."""

import gc
import weakref

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.api import forces
from sketchmatch.model import Scene
from sketchmatch.pipeline.compare import compare
from sketchmatch.pipeline.describe import described, in_directions
from sketchmatch.pipeline.memory import Memory
from sketchmatch.pipeline.slices import finish
from sketchmatch.registry import Kind, default_registry
from sketchmatch_builtin.similarities.circular_peak import CircularPeak
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation
from sketchmatch_builtin.similarities.pappis import Pappis

REGISTRY = default_registry()
BOX = np.array([[0.0, 0.0], [1.0, 0.0], [1.3, 0.7], [0.0, 1.0]])
PLACES = [(3.1 * k, 2.7 * (k * k % 5)) for k in range(8)]


def scene(things):
    """Return a scene of boxes: each of a place and a size."""
    return Scene.from_polygons([size * BOX + PLACES[place] for place, size in things])


def histogram(name="constant"):
    algorithm = REGISTRY.find(Kind.HISTOGRAM, name).algorithm
    return in_directions(algorithm(), 36)


def describe(scene_, memory=None, name="constant"):
    return finish(described(scene_, histogram(name), REGISTRY, "sketch", memory))


THINGS = st.lists(
    st.tuples(st.integers(0, 7), st.sampled_from([0.7, 1.0, 1.2])),
    min_size=2,
    max_size=6,
    unique_by=lambda thing: thing[0],
)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["constant", "force", "hybrid", "raster"])
@given(steps=st.lists(THINGS, min_size=2, max_size=4))
def test_a_scene_that_changes_is_described_as_if_it_were_new(name, steps):
    memory = Memory()
    for things in steps:
        known = describe(scene(things), memory, name)
        assert (known.histograms == describe(scene(things), name=name).histograms).all()


def counted(monkeypatch):
    """Return a list that gets the pairs which are computed."""
    asked, algorithm = [], type(histogram())
    original = algorithm.describe

    def describe_pairs(self, scene_, pairs):
        asked.extend(map(tuple, pairs.tolist()))
        return original(self, scene_, pairs)

    monkeypatch.setattr(algorithm, "describe", describe_pairs)
    return asked


def test_only_pairs_of_what_changed_are_computed(monkeypatch):
    memory, asked = Memory(), counted(monkeypatch)
    first = [(0, 1.0), (7, 1.0), (4, 1.0), (2, 1.0)]
    describe(scene(first), memory)
    asked.clear()
    describe(scene([*first[:3], (2, 0.7)]), memory)
    assert asked == [(0, 3), (1, 3), (2, 3)]


def test_nothing_is_computed_twice_for_the_same_scene(monkeypatch):
    memory, asked = Memory(), counted(monkeypatch)
    things = scene([(0, 1.0), (7, 1.0)])
    kept = describe(things, memory)
    asked.clear()
    assert describe(scene([(0, 1.0), (7, 1.0)]), memory) is kept
    assert asked == []


def test_what_is_drawn_beyond_the_others_makes_its_own_pairs_new_alone(monkeypatch):
    memory, asked = Memory(), counted(monkeypatch)
    describe(scene([(0, 1.0), (7, 1.0)]), memory)
    asked.clear()
    beyond = scene([(0, 1.0), (7, 1.0), (2, 1.2), (3, 1.4)])
    assert beyond.bounds != scene([(0, 1.0), (7, 1.0)]).bounds
    describe(beyond, memory)
    assert asked == [(0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]


def test_another_middle_makes_all_pairs_new(monkeypatch):
    memory, asked = Memory(), counted(monkeypatch)
    near, far = scene([(6, 1.0), (7, 1.0)]), scene([(6, 1.0), (7, 1.0), (0, 1.0)])
    assert near.middle != far.middle
    describe(near, memory)
    asked.clear()
    describe(far, memory)
    assert len(asked) == 3


def test_objects_met_before_take_the_places_of_those_like_them(monkeypatch):
    memory, counts, compute = Memory(), [], forces.force_histograms
    first = memory.met(scene([(0, 1.0), (7, 1.0), (4, 1.0)]))
    later = memory.met(scene([(4, 1.0), (0, 1.0), (7, 0.7)]))
    assert later.objects[:2] == (first.objects[2], first.objects[0])
    assert later.objects[2] is not first.objects[1]
    assert memory.met(later) is later
    named = memory.met(Scene.from_polygons([BOX, 2 * BOX + 9], ["desk", ""]))
    assert named.labels == ("desk", "")
    forces.own_histograms(first.objects)

    def counting(edges, pairs, *rest):
        counts.append(len(pairs))
        return compute(edges, pairs, *rest)

    monkeypatch.setattr(forces, "force_histograms", counting)
    found = forces.own_histograms(later.objects)
    assert counts == [1]
    alone = [
        forces.own_histograms([each])[0] for each in scene([(4, 1.0), (0, 1.0), (7, 0.7)]).objects
    ]
    assert found.tobytes() == np.array(alone).tobytes()


def test_what_was_used_longest_ago_makes_room():
    made, told = histogram(), []
    memory = Memory(2 * 36 * 8, described=lambda *what: told.append(what))
    scenes = [scene([(0, 1.0), (k, 1.0)]) for k in (1, 2, 3)]
    first, second, third = (finish(described(each, made, REGISTRY, "map")) for each in scenes)
    memory.keep(scenes[0], first)
    memory.keep(scenes[1], second)
    assert memory.descriptor(scenes[0], made) is first
    memory.keep(scenes[2], third)
    assert [memory.descriptor(each, made) for each in scenes] == [first, None, third]
    assert [each for each, _ in told] == scenes


def test_what_made_room_or_is_too_large_is_held_nowhere():
    made, memory = histogram(), Memory(2 * 36 * 8)
    pairs = [scene([(0, 1.0), (k, 1.0)]) for k in (1, 2, 3)]
    larger = scene([(0, 1.0), (1, 1.0), (2, 1.0)])
    held = [weakref.ref(describe(each, memory)) for each in (*pairs, larger)]
    gc.collect()
    assert [each() is not None for each in held] == [False, True, True, False]
    assert [memory.pairs(each, made) is not None for each in pairs] == [False, True, True]


def test_what_is_kept_elsewhere_is_fetched_once_and_not_told():
    asked, told = [], []
    things = scene([(0, 1.0), (7, 1.0)])

    def fetch(scene_, histogram_):
        asked.append((scene_, histogram_.name))
        return np.full((1, 36), 0.5)

    memory = Memory(fetch=fetch, described=lambda *what: told.append(what))
    assert memory.descriptor(things, histogram()).histograms.tolist() == [[0.5] * 36]
    assert memory.descriptor(things, histogram()).scene == things.identity
    assert asked == [(things, "constant")]
    assert told == []


MAP = scene([(k, size) for k, size in enumerate((1.0, 0.7, 1.2, 1.1, 0.9, 0.8, 1.3, 0.6))])


def table(sketch, memory=None, measure=CrossCorrelation, map_=MAP):
    """Return the relations of a sketch with a map of at least as many objects."""
    described_ = (describe(sketch, memory), describe(map_))
    return finish(compare((sketch, map_), described_, measure(), REGISTRY, memory=memory)).table


def same(one, other):
    """Whether two tables are the same to the last digit."""
    return all(
        getattr(one, name).tobytes() == getattr(other, name).tobytes()
        for name in ("similarity", "rotation", "dilation")
    )


@st.composite
def revisions(draw):
    """Draw what a sketch is after each of some edits: something drawn, changed, erased, undone."""
    sizes = st.sampled_from([0.7, 1.0, 1.2, 1.4])
    drawn = [draw(THINGS)]
    for edit in draw(st.lists(st.sampled_from(["draw", "change", "erase", "undo"]), max_size=6)):
        now = dict(drawn[-1])
        if edit == "draw" and len(now) < len(PLACES):
            now[draw(st.sampled_from([k for k in range(len(PLACES)) if k not in now]))] = draw(
                sizes
            )
        elif edit == "change":
            now[draw(st.sampled_from(sorted(now)))] = draw(sizes)
        elif edit == "erase" and len(now) > 2:
            del now[draw(st.sampled_from(sorted(now)))]
        elif edit == "undo":
            now = dict(draw(st.sampled_from(drawn)))
        drawn.append(list(now.items()))
    return drawn


@pytest.mark.slow
@pytest.mark.parametrize("measure", [CrossCorrelation, CircularPeak, Pappis])
@given(revisions())
def test_a_sketch_in_progress_is_compared_as_if_it_were_new(measure, drawn):
    memory = Memory()
    for things in drawn:
        assert same(table(scene(things), memory, measure), table(scene(things), measure=measure))


class Counting(CrossCorrelation):
    """The cross-correlation, which counts the rows that it compares."""

    rows = 0

    def combine(self, product, template_square, argument_square):
        Counting.rows += len(product)
        return super().combine(product, template_square, argument_square)


def compared_rows(sketch, memory, map_=MAP):
    """Return how many rows of a table are computed."""
    Counting.rows = 0
    table(sketch, memory, Counting, map_)
    return Counting.rows


FOUR = [(0, 1.0), (7, 1.0), (4, 1.0), (2, 1.0)]


@pytest.mark.parametrize(
    ("later", "rows"),
    [
        (FOUR, 0),
        ([*FOUR[:3], (2, 0.7)], 3),
        ([*FOUR, (3, 1.0)], 4),
        ([(3, 1.0), *FOUR], 4),
        ([*FOUR[:2], (2, 1.0)], 0),
        ([FOUR[1], FOUR[0], *FOUR[2:]], 1),
    ],
    ids=["nothing", "changed", "drawn", "drawn first", "erased", "in another order"],
)
def test_only_rows_of_histograms_that_changed_are_computed(later, rows):
    memory = Memory()
    assert compared_rows(scene(FOUR), memory) == 6
    assert compared_rows(scene(later), memory) == rows
    assert compared_rows(scene(FOUR), memory) == 0  # undone


def test_rows_of_another_map_or_measure_are_not_taken():
    memory, sketch = Memory(), scene(FOUR)
    table(sketch, memory, Pappis)
    assert compared_rows(sketch, memory) == 6
    assert compared_rows(sketch, memory, scene([*FOUR, (3, 1.0)])) == 6


def test_tables_that_are_too_large_are_not_remembered(monkeypatch):
    monkeypatch.setattr("sketchmatch.pipeline.memory._TABLE_BYTES", 6 * (36 + 3 * 28) * 8 - 1)
    memory = Memory()
    assert [compared_rows(scene(FOUR), memory) for _ in range(2)] == [6, 6]
    assert [compared_rows(scene(FOUR[:3]), memory) for _ in range(2)] == [3, 0]
