"""The searcher ``align``: it lays the sketch upon the map, wholly or in part."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.api import MatchProblem, Outcome
from sketchmatch.model import Fmap, Scene, SceneObject
from sketchmatch.testing import matching_problem
from sketchmatch_builtin.alignment import _candidates
from sketchmatch_builtin.searchers import align as module
from sketchmatch_builtin.searchers.align import Align
from sketchmatch_builtin.searchers.auto import Auto
from tests.interpreted import compiled_only, examples
from tests.oracle import maps as oracle
from tests.oracle.enumeration import best_of_all
from tests.searching import drain
from tests.strategies import FRAME, random_table

BOX = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def at(x, y):
    """Return a box there."""
    return BOX + np.array([x, y])


def strewn(rng, count, alike=False):
    """Return boxes that lie apart, all different unless they are alike."""
    rings = []
    for k in range(count):
        width, height = (1.0, 1.0) if alike else rng.uniform(0.4, 1.6, 2)
        angle = 0.0 if alike else rng.uniform(0.0, 3.0)
        c, s = math.cos(angle), math.sin(angle)
        centre = 4.0 * np.array([k % 4, k // 4]) + rng.uniform(0.0, 1.0, 2)
        rings.append((BOX - 0.5) * (width, height) @ np.array([[c, -s], [s, c]]) + centre)
    return Scene.from_polygons(rings)


def seen_as(scene, order, turn=0.0, scale=1.0, shift=(0.0, 0.0), mirrored=False):
    """Return some objects of a scene in another order and frame."""
    c, s = math.cos(turn), math.sin(turn)
    matrix = scale * np.array([[c, s], [-s, c]])
    if mirrored:
        matrix = np.diag([-1.0, 1.0]) @ matrix
    return Scene(
        tuple(
            SceneObject.from_rings(
                [np.asarray(ring) @ matrix + shift for ring in scene.objects[k].rings]
            )
            for k in order
        )
    )


def problem(template, argument, seed=0, table=None, **options):
    if table is None:
        table = random_table(np.random.default_rng(seed), len(template), len(argument))
    return MatchProblem(table, scenes=lambda: (template, argument), **options)


def run(posed, **params):
    return drain(Align(Align.Params(**params)).search(posed, np.random.default_rng(0)))


def offered(posed, **params):
    seen, _ = run(posed, **params)
    return [tuple(each.tolist()) for each in seen[-1].maps]


def sloppy(seed, drawn, objects):
    """Return a sketch of some of a map's objects, displaced, and which they are."""
    rng = np.random.default_rng(seed)
    map_ = strewn(rng, objects)
    order = rng.permutation(objects)[:drawn]
    scene = Scene.from_polygons([map_.objects[k].rings[0] + rng.normal(0.0, 0.2, 2) for k in order])
    return seen_as(scene, range(drawn), 0.7, 2.5, (3.0, -8.0)), map_, order


@given(
    st.integers(0, 2**32),
    st.integers(3, 6),
    st.integers(0, 5),
    st.floats(0.0, 6.3),
    st.sampled_from([1e-6, 0.2, 1.0, 30.0, 1e6]),
    st.booleans(),
)
@examples(25)
def test_a_copy_is_matched_wholly_however_it_is_turned_and_scaled(
    seed, count, more, turn, scale, partial
):
    rng = np.random.default_rng(seed)
    map_ = strewn(rng, count + more)
    order = rng.permutation(count + more)[:count]
    sketch = seen_as(map_, order, turn, scale, (7.0 * scale, -2.0 * scale))
    seen, outcome = run(problem(sketch, map_, partial=partial))
    assert outcome is Outcome.CONVERGED
    if partial:
        np.testing.assert_array_equal(seen[-1].maps[0], order)
    else:
        assert seen[-1].maps == ()
    entries = Fmap.from_object_map(order, count + more).entries
    found = [seen[-1].fmap, *run(problem(sketch, map_, alternatives=100))[0][-1].alternatives]
    assert any((each.entries == entries).all() for each in found)


@given(st.integers(0, 2**32), st.integers(2, 5), st.integers(0, 3))
@examples(25)
def test_every_progress_is_a_legal_map_with_its_zeta_and_the_last_is_the_best(seed, n, more):
    sketch, map_, _ = sloppy(seed, n, n + more)
    posed = problem(sketch, map_, alternatives=4, partial=True)
    seen, _ = run(posed)
    assert seen[0].maps == ()
    for progress in seen:
        met = [progress.fmap, *progress.alternatives]
        values = []
        for fmap in met:
            mapped = oracle.read(fmap.entries, n + more)
            assert oracle.is_object_legal(mapped, n)
            values.append(oracle.confidence(posed.table, mapped, posed.weights)[0])
        assert progress.confidence == pytest.approx(values[0], abs=1e-12)
        assert values == sorted(values, reverse=True)
        assert len({fmap.entries.tobytes() for fmap in met}) == len(met)
    for before, after in itertools.pairwise(seen):
        assert after.confidence >= before.confidence
        assert after.iteration >= before.iteration
        assert after.evaluations >= before.evaluations
    assert seen[-1].confidence <= best_of_all(posed.table, posed.weights)[0] + 1e-12


def assert_valid(maps, n, m):
    assert len(set(maps)) == len(maps)
    for partners in maps:
        used = [j for j in partners if j >= 0]
        assert len(used) == len(set(used))
        assert max(partners) < m
        assert len(partners) == n
        assert len(used) >= min(3, n)


@given(st.integers(0, 2**32), st.integers(3, 5), st.integers(0, 4), st.floats(0.0, 6.3))
@examples(20)
def test_a_common_frame_changes_nothing(seed, n, more, turn):
    sketch, map_, _ = sloppy(seed, n, n + more)
    known = offered(problem(sketch, map_, partial=True))
    assert_valid(known, n, n + more)
    for scale, mirrored in ((1.0, False), (1e-6, False), (1e6, False), (2.0, True)):
        frame = {"turn": turn, "scale": scale, "shift": (scale, 0.0), "mirrored": mirrored}
        seen = (seen_as(each, range(len(each)), **frame) for each in (sketch, map_))
        found = offered(problem(*seen, partial=True))
        assert found[:3] == known[:3]
        assert len(set(found) & set(known)) >= 0.9 * len(known)


@given(st.integers(0, 2**32), st.integers(3, 5), st.integers(0, 4))
@examples(20)
def test_the_order_of_objects_changes_nothing_but_the_order(seed, n, more):
    sketch, map_, _ = sloppy(seed, n, n + more)
    rng = np.random.default_rng(seed)
    one, two = rng.permutation(n), rng.permutation(n + more)
    known = offered(problem(sketch, map_, partial=True))
    other = problem(seen_as(sketch, one), seen_as(map_, two), partial=True)
    back = []
    for partners in offered(other):
        read = [-1] * n
        for k, j in enumerate(partners):
            read[one[k]] = int(two[j]) if j >= 0 else -1
        back.append(tuple(read))
    assert back[:3] == known[:3]
    assert len(set(back) & set(known)) >= 0.9 * len(known)


@given(st.integers(0, 2**32), st.integers(3, 6))
@examples(20)
def test_a_map_as_the_template_gives_the_inverse_maps(seed, n):
    sketch, map_, _ = sloppy(seed, n, n)
    straight = offered(problem(sketch, map_, partial=True))
    swapped = offered(problem(map_, sketch, partial=True, swapped=True))
    turned = [
        tuple(partners.index(k) if k in partners else -1 for k in range(n)) for partners in swapped
    ]
    assert turned == straight


def test_a_sketch_of_more_objects_than_the_map_has_leaves_some_out():
    rng = np.random.default_rng(8)
    sketch = strewn(rng, 8)
    order = rng.permutation(8)[:5]
    map_ = seen_as(sketch, order, 1.0, 0.3)
    # The map has fewer objects, so it is the template.
    seen, _ = run(problem(map_, sketch, partial=True, swapped=True))
    np.testing.assert_array_equal(seen[-1].maps[0], order)


def test_the_same_search_gives_the_same_whatever_the_generator():
    sketch, map_, _ = sloppy(3, 5, 8)
    posed = problem(sketch, map_, partial=True, alternatives=3)
    runs = [drain(Align().search(posed, np.random.default_rng(seed)))[0] for seed in (0, 0, 5)]
    traces = [
        [
            (each.confidence, each.iteration, each.evaluations, each.fmap.entries.tolist())
            for each in seen
        ]
        for seen in runs
    ]
    maps = [[each.tolist() for each in seen[-1].maps] for seen in runs]
    assert traces[0] == traces[1] == traces[2]
    assert maps[0] == maps[1] == maps[2]


def ruled_by(pins, n, m, none=()):
    """Return what pins allow, and pins, as a problem has them."""
    allowed, known = np.ones((n, m), dtype=bool), np.full(n, -1)
    for g, h in pins.items():
        allowed[g], allowed[:, h] = False, False
        allowed[g, h], known[g] = True, h
    allowed[list(none)] = False
    return {"allowed": allowed, "pinned": known}


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("partial", [False, True])
@given(st.integers(0, 2**32), st.integers(3, 4), st.integers(0, 2))
@examples(8)
def test_pins_are_obeyed_by_every_map(swapped, partial, seed, n, more):
    sketch, map_, order = sloppy(seed, n, n + more)
    rng = np.random.default_rng(seed)
    first, second = rng.permutation(n)[:2]
    wrong = int(rng.permutation(np.setdiff1d(np.arange(n + more), order[first]))[0])
    right = bool(rng.random() < 0.5)
    pins = {int(first): int(order[first]) if right else wrong}
    if right or wrong != order[second]:
        pins[int(second)] = int(order[second])
    m = n + more
    if swapped:
        if more:
            return
        sketch, map_ = map_, sketch
        pins = {h: g for g, h in pins.items()}
    posed = problem(
        sketch, map_, partial=partial, swapped=swapped, alternatives=50, **ruled_by(pins, n, m)
    )
    seen, _ = run(posed)
    for progress in seen:
        for fmap in (progress.fmap, *progress.alternatives):
            partners = _partners(fmap, n, m)
            assert all(partners[g] == h for g, h in pins.items())
    assert partial or not seen[-1].maps
    assert seen[-1].maps or not (partial and right)
    for partners in seen[-1].maps:
        assert all(partners[g] == h for g, h in pins.items())


def _partners(fmap, n, m):
    """Return the object map of a histogram map, by trying all."""
    return next(
        way
        for way in itertools.permutations(range(m), n)
        if (Fmap.from_object_map(np.array(way), m).entries == fmap.entries).all()
    )


def test_what_is_pinned_to_nothing_stays_without_partner_in_every_partial_map():
    sketch, map_, order = sloppy(1, 5, 7)
    maps = offered(problem(sketch, map_, partial=True, **ruled_by({}, 5, 7, none=[2])))
    assert maps
    assert all(partners[2] == -1 for partners in maps)
    expected = order.copy()
    expected[2] = -1
    assert maps[0] == tuple(expected.tolist())


def test_labels_tell_alike_objects_apart():
    square = Scene.from_polygons([BOX, at(4, 0), at(4, 4), at(0, 4)])
    other = seen_as(square, [0, 1, 2, 3], 0.2)
    names = np.where(np.roll(np.eye(4, dtype=int), 1, axis=1) > 0, 1, -1)
    maps = offered(problem(square, other, partial=True, names=names))
    assert maps[0] == (1, 2, 3, 0)
    assert set(offered(problem(square, other, partial=True))[:4]) == {
        tuple((k + np.arange(4)) % 4) for k in range(4)
    }


TURNS = np.linspace(0.0, 2.0 * np.pi, 20_000, endpoint=False)
ROUND = Scene.from_polygons(
    [
        np.stack([np.cos(TURNS), (k + 1) * np.sin(TURNS)], axis=1) + np.array([5 * k, k * k])
        for k in range(3)
    ]
)
SPECIAL = {
    "two of two": (Scene.from_polygons([BOX, at(3, 0)]),) * 2,
    "two of three": (
        Scene.from_polygons([BOX, at(3, 0)]),
        Scene.from_polygons([BOX, at(3, 0), at(0, 7)]),
    ),
    "three alike on a line": (Scene.from_polygons([at(3 * k, 0) for k in range(3)]),) * 2,
    "five alike on a line": (
        Scene.from_polygons([at(3 * k, 0) for k in range(3)]),
        Scene.from_polygons([at(0, 3 * k) for k in range(5)]),
    ),
    "one inside another": (
        Scene(
            (
                SceneObject.from_rings([np.array(ring, float) for ring in FRAME]),
                SceneObject.from_rings([0.5 * BOX + np.array([1.25, 1.25])]),
            )
        ),
    )
    * 2,
    "one inside another of three": (
        Scene(
            (
                SceneObject.from_rings([np.array(ring, float) for ring in FRAME]),
                SceneObject.from_rings([0.5 * BOX + np.array([1.25, 1.25])]),
                SceneObject.from_rings([at(9.0, 0.0)]),
            )
        ),
    )
    * 2,
    "scales apart": (
        Scene.from_polygons([1e-6 * BOX, 1e-6 * at(3, 0), 1e-6 * at(0, 5)]),
        Scene.from_polygons([1e6 * BOX, 1e6 * at(3, 0), 1e6 * at(0, 5)]),
    ),
    "sizes apart": (
        Scene.from_polygons([1e-3 * BOX, 1e3 * BOX + np.array([10, 0]), at(-20, 0)]),
        Scene.from_polygons([1e-3 * BOX, 1e3 * BOX + np.array([10, 0]), at(-20, 0)]),
    ),
    "very many vertices": (ROUND, ROUND),
}


@pytest.mark.parametrize("partial", [False, True])
@pytest.mark.parametrize("name", SPECIAL)
def test_awkward_scenes_are_matched_validly(name, partial):
    sketch, map_ = SPECIAL[name]
    seen, outcome = run(problem(sketch, map_, partial=partial, alternatives=3))
    assert outcome is Outcome.CONVERGED
    assert_valid([tuple(each.tolist()) for each in seen[-1].maps], len(sketch), len(map_))
    if partial and name in ("scales apart", "sizes apart", "very many vertices"):
        assert seen[-1].maps[0].tolist() == [0, 1, 2]
    assert np.isfinite(seen[-1].confidence)


def test_parameters_bound_how_many_maps_there_are():
    sketch, map_, order = sloppy(2, 9, 12)
    posed = problem(sketch, map_, partial=True)
    assert 10 < len(offered(posed)) <= 120
    assert len(offered(posed, maps=7)) == 7
    assert offered(posed, maps=7) == offered(posed)[:7]
    assert offered(posed, poses=1, maps=1) == [tuple(order.tolist())]


def test_near_a_map_it_starts_with_a_judge_is_told_of_as_many():
    sketch, map_, order = sloppy(2, 9, 12)
    posed = problem(sketch, map_, partial=True, start=(order,))
    assert offered(posed)[0] == tuple(order.tolist())
    assert len(offered(posed)) == 20
    assert offered(posed, maps=7) == offered(posed)[:7]


def test_relations_without_scenes_are_searched_as_auto_does():
    posed, _ = matching_problem(np.random.default_rng(0), 4)
    bare = MatchProblem(posed.table, alternatives=2)
    seen, outcome = run(bare)
    known, expected = drain(Auto().search(bare, np.random.default_rng(0)))
    assert outcome is expected
    assert seen[-1].confidence == known[-1].confidence
    np.testing.assert_array_equal(seen[-1].fmap.entries, known[-1].fmap.entries)


def test_it_is_the_default_and_finds_partial_maps():
    assert Align.default
    assert Align().partial
    assert Align().object_consistent


@pytest.mark.slow
@compiled_only
@pytest.mark.parametrize("partial", [False, True])
def test_work_between_pauses_is_bounded_for_many_objects(monkeypatch, partial):
    work = [0]

    def counting(function, cost):
        def counted(*arguments):
            work[0] += cost(*arguments)
            return function(*arguments)

        return counted

    monkeypatch.setattr(
        _candidates,
        "refine_guesses",
        counting(_candidates.refine_guesses, lambda *a: len(a[0]) * a[3].size),
    )
    monkeypatch.setattr(module, "completed", counting(module.completed, lambda *a: a[1].bonus.size))
    rng = np.random.default_rng(0)
    map_ = Scene.from_polygons(
        [
            (BOX - 0.5) * rng.uniform(0.4, 1.6, 2) + (3.0 * (k % 10), 3.0 * (k // 10))
            for k in range(100)
        ]
    )
    order = rng.permutation(100)
    sketch = seen_as(map_, order, 0.4)
    posed = problem(sketch, map_, partial=partial)
    most = 0
    for progress in Align().search(posed, rng):
        most, work[0] = max(most, work[0]), 0
        last = progress
    assert most <= max(_candidates._PAIRINGS, module._OFFERED * 10_000) + 10_000
    if partial:
        np.testing.assert_array_equal(last.maps[0], order)


@pytest.mark.slow
@compiled_only
def test_three_objects_are_found_among_very_many():
    rng = np.random.default_rng(1)
    map_ = Scene.from_polygons(
        [
            (BOX - 0.5) * np.exp(rng.normal(0.0, 0.4, 2))
            + (3.0 * (k % 40) + rng.uniform(0.0, 1.0), 3.0 * (k // 40) + rng.uniform(0.0, 1.0))
            for k in range(1500)
        ]
    )
    centres = np.array([item.centroid for item in map_.objects])
    order = np.argsort(np.hypot(*(centres - centres[777]).T))[:3]
    maps = offered(problem(seen_as(map_, order, 1.0, 0.2), map_, partial=True))
    assert maps[0] == tuple(order.tolist())
