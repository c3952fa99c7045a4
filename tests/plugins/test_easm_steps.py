"""The steps of ``easm`` on their own: each against a slow and obvious one."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.model import object_pairs
from sketchmatch_builtin.searchers import _evolution as steps

SEEDS = st.integers(1, 2**64 - 1)


# Where kernels are interpreted NumPy says that whole numbers wrap around.
pytestmark = pytest.mark.filterwarnings("ignore:overflow encountered:RuntimeWarning")


def seeded(seed):
    return np.array([seed], dtype=np.uint64)


@given(SEEDS)
def test_random_numbers_are_those_of_xorshift64_star(seed):
    state, whole = seed, 2**64 - 1
    here = seeded(seed)
    for _ in range(5):
        state ^= state >> 12
        state ^= state << 25 & whole
        state ^= state >> 27
        expected = (state * 0x2545F4914F6CDD1D & whole) >> 11
        assert steps._random(here) == expected / 2**53


def test_each_item_is_drawn_as_often_as_any_other():
    seed, drawn = seeded(7), Counter()
    for _ in range(3000):
        items = np.arange(5)
        steps._draw(items, 1, seed)
        assert items[0] == 0
        assert sorted(items) == [0, 1, 2, 3, 4]
        drawn[int(items[1])] += 1
    assert set(drawn) == {1, 2, 3, 4}
    assert all(650 < count < 850 for count in drawn.values())


def population(individuals, fitness, size):
    """Return a population with one offspring behind it, the rest of it being of no account."""
    count, genes = 3 * size, len(individuals[0])
    rows = np.full((count, genes), -7)
    rows[: len(individuals) - 1], rows[size] = individuals[:-1], individuals[-1]
    worth = np.full(count, -1.0)
    worth[: len(fitness) - 1], worth[size] = fitness[:-1], fitness[-1]
    status = np.zeros(7, dtype=np.int64)
    status[steps.MEMBERS], status[steps.STALE] = len(individuals) - 1, 3
    no, none, flat = np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros((0, 0))
    return steps.Evolution(
        by_object=True,
        rates=no,
        pairs=np.zeros((0, 2), dtype=np.int64),
        columns=np.zeros((0, 0), dtype=np.int64),
        evidence=flat,
        cosine=flat,
        sine=flat,
        dilation=flat,
        weights=no,
        individuals=rows,
        places=np.arange(count),
        fitness=worth,
        known=none,
        status=status,
        order=none,
        entries=none,
        holders=np.zeros((2, 0), dtype=np.int64),
        free=none,
        scratch=no,
        seed=seeded(1),
    )


@given(st.data(), st.integers(1, 5))
def test_an_offspring_takes_its_place_among_the_members(data, size):
    worths = st.sampled_from([0.1, 0.2, 0.3, 0.4, 0.5])
    members = sorted(data.draw(st.lists(worths, min_size=1, max_size=size)), reverse=True)
    value = data.draw(worths)
    rows = [(k, 0) for k in range(len(members))]
    child = data.draw(st.sampled_from([*rows, (9, 9)]))
    evolution = population([*rows, child], [*members, value], size)
    work = steps._compete(evolution, 0)
    full = len(members) == size
    stays_out = (full and value <= members[-1]) or (value, child) in zip(members, rows, strict=True)
    expected = list(zip(members, rows, strict=True))
    if not stays_out:
        place = sum(worth >= value for worth in members)
        expected.insert(place, (value, child))
    found = evolution.status[steps.MEMBERS]
    assert found == min(len(expected), size)
    assert [
        (float(evolution.fitness[k]), tuple(evolution.individuals[evolution.places[k]].tolist()))
        for k in range(found)
    ] == expected[:size]
    assert sorted(evolution.places) == list(range(3 * size))
    better = not stays_out and value > members[0]
    assert evolution.status[steps.STALE] == (-1 if better else 3)
    assert (work == 0) if full and value <= members[-1] else (0 < work <= size + 1)


@given(st.lists(st.lists(st.integers(0, 3), min_size=3, max_size=3), max_size=9))
def test_what_was_judged_is_known_and_nothing_else(individuals):
    known = np.zeros(2**12, dtype=np.int64)
    seen = set()
    for each in individuals:
        # What was judged between may have taken the place where it is remembered.
        assert not steps._is_known(known, np.array(each)) or tuple(each) in seen
        assert steps._is_known(known, np.array(each))
        seen.add(tuple(each))


@given(SEEDS, st.integers(2, 6), st.integers(0, 2), st.booleans())
def test_a_random_individual_uses_nothing_twice(seed, genes, more, with_duals):
    individual, free = np.empty(genes, dtype=np.int64), np.empty(genes + more, dtype=np.int64)
    steps._draw_individual(individual, free, with_duals, seeded(seed))
    assert len(set((individual % free.size).tolist())) == genes
    assert individual.min() >= 0
    assert individual.max() < free.size * (2 if with_duals else 1)


@st.composite
def object_maps(draw, count):
    """Return so many maps of the same objects, and the number of argument objects."""
    objects = draw(st.integers(2, 6))
    others = objects + draw(st.integers(0, 2))
    maps = [draw(st.permutations(range(others)))[:objects] for _ in range(count)]
    return [np.array(each) for each in maps], others


def crossed(one, other, others, seed, rate=0.5):
    """Return both children of two object maps."""
    pairs = object_pairs(len(one))
    child, sibling = np.empty_like(one), np.empty_like(one)
    order, free = np.arange(len(pairs)), np.empty(others, dtype=np.int64)
    holders = np.empty((2, others), dtype=np.int64)
    steps._cross_object_maps(
        one, other, child, sibling, pairs, rate, order, holders, free, seeded(seed)
    )
    return child, sibling


def test_each_two_different_members_are_crossed_as_often_as_any_others():
    members = [(0, 1, 2, 3, 4, 5), (3, 4, 5, 0, 1, 2), (5, 4, 3, 2, 1, 0)]
    evolution = population([*members, (0,) * 6], [0.5, 0.4, 0.3, 0.0], 3)._replace(
        by_object=False,
        rates=np.array([1.0, 1.0, 0.0]),  # all is exchanged
        known=np.zeros(2**12, dtype=np.int64),
        order=np.arange(6),
        holders=np.empty((2, 6), dtype=np.int64),
        free=np.empty(6, dtype=np.int64),
        seed=seeded(5),
    )
    for each in members:  # so that their children are not judged
        steps._is_known(evolution.known, np.array(each))
    parents = Counter()
    for _ in range(1200):
        evolution.status[steps.TRIAL] = 0
        steps._cross(evolution, 1, 100)
        parents[tuple(map(tuple, evolution.individuals[3:5].tolist()))] += 1
    assert set(parents) == {(a, b) for a in members for b in members if a != b}
    assert all(150 < count < 250 for count in parents.values())


@given(object_maps(1), SEEDS)
def test_a_map_crossed_with_itself_is_itself(case, seed):
    (one,), others = case
    for child in crossed(one, one, others, seed):
        assert child.tolist() == one.tolist()


@given(object_maps(2), SEEDS, st.sampled_from([0.0, 0.5, 1.0]))
def test_children_are_maps_that_keep_what_the_parents_share(case, seed, rate):
    (one, other), others = case
    children = crossed(one, other, others, seed, rate)
    for child in children:
        assert len(set(child.tolist())) == len(one)
        assert set(child.tolist()) <= set(range(others))
    if rate != 0.5:  # all entries of each child come from one parent
        assert [each.tolist() for each in children] == [
            each.tolist() for each in ((one, other) if rate == 0.0 else (other, one))
        ]


def test_objects_without_partner_get_each_unused_one_as_often():
    seed, given_to = seeded(11), Counter()
    for _ in range(2000):
        child, holder = np.array([-1, 2, -1]), np.array([-1, -1, 1, -1])
        steps._complete(child, holder, np.empty(4, dtype=np.int64), seed)
        assert child[1] == 2
        given_to[int(child[0]), int(child[2])] += 1
    assert set(given_to) == {(a, c) for a in (0, 1, 3) for c in (0, 1, 3) if a != c}
    assert all(260 < count < 410 for count in given_to.values())


@given(object_maps(1), SEEDS)
def test_a_changed_entry_leaves_a_map(case, seed):
    (child,), others = case
    before = child.copy()
    holder, free = np.empty(others, dtype=np.int64), np.empty(others, dtype=np.int64)
    steps._reassign(child, object_pairs(len(child)), holder, free, seeded(seed))
    assert len(set(child.tolist())) == len(child)
    assert set(child.tolist()) <= set(range(others))
    assert (child != before).sum() <= 4


@given(SEEDS, st.integers(2, 6), st.integers(0, 3), st.data())
def test_conflicts_are_changed_and_nothing_else(seed, genes, more, data):
    columns = genes + more
    child = np.array(
        data.draw(st.lists(st.integers(0, 2 * columns - 1), min_size=genes, max_size=genes))
    )
    before = child.copy()
    order, holder = np.arange(genes), np.empty(columns, dtype=np.int64)
    steps._legalize(child, order, holder, np.empty(columns, dtype=np.int64), seeded(seed))
    used = (child % columns).tolist()
    assert len(set(used)) == genes
    times = Counter((before % columns).tolist())
    for column, count in times.items():
        kept = [k for k in range(genes) if before[k] % columns == column and child[k] == before[k]]
        assert len(kept) >= 1
        assert len(kept) == 1 or count == 1


@given(SEEDS, st.integers(2, 6), st.integers(0, 3))
def test_a_replaced_entry_leaves_a_legal_fmap_and_changes_two_at_most(seed, genes, more):
    rng = np.random.default_rng(seed)
    columns = genes + more
    child = rng.permutation(columns)[:genes] + columns * rng.integers(0, 2, genes)
    before = child.copy()
    steps._replace(child, columns, seeded(seed))
    assert len(set((child % columns).tolist())) == genes
    assert (child != before).sum() <= 2
    assert child.min() >= 0
    assert child.max() < 2 * columns
