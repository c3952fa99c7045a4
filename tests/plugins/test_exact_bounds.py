"""The parts of ``exact`` on their own: each bound and whatever is left out, against enumeration."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.api import MatchProblem, Outcome
from sketchmatch.pipeline.slices import finish
from sketchmatch_builtin.searchers import _backtrack, _branch, _cells, _fixed, _residual
from sketchmatch_builtin.searchers import exact as module
from sketchmatch_builtin.searchers._assignment import FORBIDDEN, reduce_by_assignment
from sketchmatch_builtin.searchers._ranking import Ranking
from sketchmatch_builtin.searchers.direct import Evolved
from sketchmatch_builtin.searchers.exact import Exact
from tests.interpreted import examples
from tests.oracle import maps as oracle
from tests.oracle.enumeration import every_confidence
from tests.searching import WEIGHTS
from tests.strategies import floats, random_table, with_rotation_weights

TRUE = _cells.TOLERANCE
SEEDS = st.integers(0, 2**32)
QUANTILES = len(_cells.QUANTILES)


@pytest.fixture(scope="module", autouse=True)
def _warm():
    # Kernels compile here, and not while hypothesis counts the time of an example.
    Exact.warm_up()


def relations_of(table, weights):
    """Return the relations as the kernels read them, and the spread of all L̂."""
    begin = Ranking(np.zeros((1, table.template_objects), dtype=np.int64), np.zeros(1))
    search = module._Search(
        MatchProblem(table, weights), Evolved(Outcome.CONVERGED, begin, 0, 0), Exact.Params()
    )
    finish(search.read())
    return search.relations, search.spread


def some_box(rng):
    """Return a cell that some maps belong to."""
    middles = np.sort(rng.uniform(-1.5, 1.5, QUANTILES))
    widths = rng.choice([0.05, 1.0]) * rng.uniform(0.0, 1.0, QUANTILES)
    ends = np.maximum.accumulate(np.stack([middles - widths, middles + widths], axis=1))
    return np.array([(rng.uniform(0, 6), rng.uniform(0, 1.5)), *ends])


def belongs(table, partners, box):
    """Return whether the direction and the quantiles of a map lie in a cell."""
    looked_up = [
        (*oracle.look_up(table, i, pair), weight)
        for i, (pair, weight) in enumerate(
            zip(oracle.induced(partners), table.rotation_weights, strict=True)
        )
    ]
    direction = np.angle(sum(weight * np.exp(1j * r) for _, r, _, weight in looked_up))
    levels = np.sort([1.5 / np.log(2) * np.log(d) for _, _, d, _ in looked_up])
    (middle, half), *ends = box
    within = [
        low <= levels[math.ceil(share * len(levels)) - 1] <= high
        for share, (low, high) in zip(_cells.QUANTILES, ends, strict=True)
    ]
    return abs(np.angle(np.exp(1j * (direction - middle)))) <= half and all(within)


@st.composite
def boxes(draw):
    """Return a cell, of any width, and how far cells are halved."""
    ends = np.sort(draw(st.lists(floats(-3.0, 3.0), min_size=4, max_size=4))).reshape(2, 2)
    if draw(st.booleans()):  # intervals that overlap
        ends[0, 1], ends[1, 0] = ends[1, 0], ends[0, 1]
    box = np.array([(draw(floats(0.0, 6.0)), draw(floats(0.0, np.pi))), *ends])
    smallest = draw(st.lists(st.sampled_from([0.1, 0.5, np.inf]), min_size=3, max_size=3))
    return box, np.array(smallest)


@given(boxes(), st.data())
@examples(200)
def test_the_halves_of_a_cell_cover_it(case, data):
    box, smallest = case
    allowed = np.array([[True, False, True]])
    cells = _cells.Cells(
        np.stack([box, np.zeros_like(box), np.zeros_like(box)]),
        np.array([0.7, -np.inf, -np.inf]),
        np.array([allowed[0], [False] * 3, [False] * 3])[:, None],
    )
    place = _cells.first_place(0)
    _cells.halve(cells, 0, smallest, place)
    widths = [box[0, 1], *(0.5 * (box[1:, 1] - box[1:, 0]))]
    if (np.array(widths) <= smallest).all():
        assert (place[_cells.END], cells.bounds[0]) == (1, 0.7)
        return
    assert (place[_cells.END], cells.bounds.tolist()) == (3, [-np.inf, 0.7, 0.7])
    assert (cells.allowed == allowed).all()
    angle = box[0, 0] + data.draw(st.sampled_from([-1.0, 1.0]) | floats(-1.0, 1.0)) * box[0, 1]
    shares = st.sampled_from([0.0, 0.5, 1.0]) | floats(0.0, 1.0)
    low = box[1, 0] + data.draw(shares) * (box[1, 1] - box[1, 0])
    high = max(low, box[2, 0]) + data.draw(shares) * (box[2, 1] - max(low, box[2, 0]))
    inside = [
        abs(angle - middle) <= half + 1e-12
        and all(
            least - 1e-12 <= level <= most + 1e-12
            for level, (least, most) in zip((low, high), ends, strict=True)
        )
        for (middle, half), *ends in cells.boxes[1:]
    ]
    assert any(inside)


@pytest.mark.parametrize("turned", [True, False])
def test_a_half_is_half_as_wide_and_no_wider_elsewhere(turned):
    box = np.array([(1.0, 0.8), (-1.0, 1.0), (0.0, 2.0)])
    cells = _cells.Cells(np.stack([box] * 3), np.ones(3), np.ones((3, 1, 1), dtype=np.bool_))
    smallest = np.array([0.1, np.inf, np.inf] if turned else [np.inf, np.inf, 0.1])
    _cells.halve(cells, 0, smallest, _cells.first_place(0))
    expected = (
        [[(0.6, 0.4), (-1.0, 1.0), (0.0, 2.0)], [(1.4, 0.4), (-1.0, 1.0), (0.0, 2.0)]]
        if turned
        else [[(1.0, 0.8), (-1.0, 1.0), (0.0, 1.0)], [(1.0, 0.8), (-1.0, 1.0), (1.0, 2.0)]]
    )
    assert cells.boxes[1:].tolist() == pytest.approx(np.array(expected))


@pytest.mark.slow
@pytest.mark.parametrize("weights", WEIGHTS)
def test_a_candidate_dropped_from_a_cell_is_on_no_better_map(weights):
    tried = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        objects = 2 + seed % 3
        table = random_table(rng, objects, objects + 1)
        relations, spread = relations_of(table, weights)
        every = every_confidence(table, weights)
        worst = np.array([min(every, key=every.get)])
        smallest = np.array([0.5, 0.8, 0.8])
        # A hair below each map that may be the best: nothing is left out too late.
        for value in sorted(every.values())[-3:]:
            found = Ranking(worst.copy(), np.array([value - 1e-6]))
            cells = _roomy_cell(relations, objects, objects + 1, spread)
            place = _cells.first_place(0)
            leaders = np.empty((objects, objects + 1))
            _cells.divide_cells(relations, found, spread, cells, leaders, smallest, place, 10**5)
            left = slice(0, place[_cells.END])
            for partners, zeta in every.items():
                if zeta <= found.values[0] + _cells.TOLERANCE:
                    continue
                tried += 1
                covering = [
                    allowed[np.arange(objects), partners].all()
                    for box, bound, allowed in zip(*(part[left] for part in cells), strict=True)
                    if bound > -np.inf and belongs(table, partners, box + _slack(box))
                ]
                assert any(covering)
    assert tried > 10


def _roomy_cell(relations, objects, others, spread):
    """Return the cell of all maps, with room for many more."""
    least = float(relations.dilation.min())
    first = _cells.first_cell((objects, others), least, least + spread)
    room = 1000
    return _cells.Cells(
        np.concatenate([first.boxes, np.zeros((room, *first.boxes.shape[1:]))]),
        np.concatenate([first.bounds, np.full(room, -np.inf)]),
        np.concatenate([first.allowed, np.zeros((room, objects, others), dtype=np.bool_)]),
    )


def _slack(box):
    """Return what makes a box wider by more than rounding."""
    slack = np.tile([-1e-9, 1e-9], (len(box), 1))
    slack[0, 0] = 0.0
    return slack


@given(SEEDS, st.integers(2, 4), st.integers(0, 2), st.sampled_from(WEIGHTS), st.integers(0, 3))
@examples(150)
def test_a_candidate_dropped_from_a_node_is_on_no_map_below_the_limit(
    seed, objects, more, weights, sweeps
):
    """What is left says of every map below the limit no more than its costs, and no less if it can.

    Only what maps leave over may take something away: the duals of partners that have no object.
    """
    rng = np.random.default_rng(seed)
    table = random_table(rng, objects, objects + more)
    relations, spread = relations_of(table, weights)
    terms = _cells.cell_terms(relations, 0.3, spread, some_box(rng))
    before = {
        partners: terms.base + sum(_costs(relations, terms, partners))
        for partners in itertools.permutations(range(objects + more), objects)
    }
    for target in sorted(before.values())[:6]:
        limit = target + 1e-9
        tree = _residual.empty_tree(objects, objects + more)
        everything = np.ones((objects, objects + more), dtype=np.bool_)
        assert _residual.plant(relations, tree, terms, everything)
        tree.bounds[0] = terms.base
        open_ = _residual.assign(tree, 0, limit)
        for _ in range(sweeps):
            if open_:
                _residual.sweep(tree, 0, limit)
                open_ = _residual.assign(tree, 0, limit)
        assert open_
        for partners, cost in before.items():
            if cost < limit:
                _assert_says(tree, 0, partners, cost)
        _assert_children_keep(tree, before, limit)


def _assert_children_keep(tree, before, limit):
    """Fix the first open object to each of its candidates, and look at all maps below the limit."""
    first = np.arange(tree.sizes[0, 0])
    for x in first:
        assert _residual.fix(tree, 0, 0, int(x), 0.0, limit)
        for partners, cost in before.items():
            if partners[0] == tree.candidates[0, 0, x] and cost < limit:
                assert tree.bounds[1] < limit
                _assert_says(tree, 1, partners, cost)


def _costs(relations, terms, partners):
    """Return what each entry of a map loses in a cell."""
    costs = np.empty((len(relations.pairs), 2 * relations.cosine.shape[1]))
    _cells.pair_costs(relations, 0, len(costs), terms, costs)
    return [
        costs[i, relations.columns[pair]] for i, pair in enumerate(oracle.induced(tuple(partners)))
    ]


def _assert_says(tree, level, partners, cost):
    """Compare what a node says of a map with its cost."""
    said = _said(tree, level, partners)
    assert said <= cost + 1e-11
    if tree.candidates.shape[1] == tree.candidates.shape[2]:
        assert said >= cost - 1e-11


def _said(tree, level, partners):
    """Return what a node says that a map loses: K, its leaders and the costs of its pairs."""
    count, total = tree.counts[level], tree.bounds[level]
    chosen = []
    for k in range(count):
        candidates = tree.candidates[level, k, : tree.sizes[level, k]].tolist()
        chosen.append(candidates.index(partners[tree.objects[level, k]]))
        total += tree.leaders[level, k, chosen[k]]
    for k, other in itertools.combinations(range(count), 2):
        start = tree.starts[level, k, other] + chosen[k] * tree.sizes[level, other]
        total += tree.blocks[start + chosen[other]]
    return total


def test_no_node_of_a_search_says_more_of_a_map_than_it_loses():
    assert sum(_look_at_nodes(seed) for seed in range(120)) > 100


def _look_at_nodes(seed):
    """Search a cell step by step, and hold all better maps of each node against what it says.

    Returns
    -------
    int
        How often there was a map to look at where objects are fixed.
    """
    rng = np.random.default_rng(seed)
    objects = 3 + seed % 2
    table = random_table(rng, objects, objects + seed // 2 % 2)
    weights = ((0.0, 1.0, 0.0), (1.0, 1.0, 1.0), (0.3, 2.0, 0.0))[seed // 4 % 3]
    relations, spread = relations_of(table, weights)
    box = np.array([(rng.uniform(0.0, 6.0), rng.uniform(0.5, 1.5)), *[(-9.0, 9.0)] * QUANTILES])
    every = every_confidence(table, weights)
    inside = {partners: zeta for partners, zeta in every.items() if belongs(table, partners, box)}
    if not inside:
        return 0
    beaten = sorted(inside.values())[-min(5, len(inside))] - 1e-6
    found = Ranking(np.array([min(every, key=every.get)]), np.array([beaten]))
    shape = (objects, table.argument_objects)
    cells = _cells.Cells(box[None], np.ones(1), np.ones((1, *shape), dtype=np.bool_))
    tree, fixed = _residual.empty_tree(*shape), _fixed.empty_fixed(objects)
    place, given_up, looked_at = _branch.first_place(0), np.full(1, -np.inf), 0
    search = (relations, found, spread, cells, tree, fixed, place, given_up)
    while place[_branch.CELL] == 0:
        _branch.search_cells(*search, 1, 10**6)
        level = place[_branch.LEVEL]
        if place[_branch.CELL] > 0 or place[_branch.SWEEPS] == 0:
            continue
        for partners, zeta in inside.items():
            held = zip(fixed.objects[:level], fixed.partners[:level], strict=True)
            if zeta > found.values[0] + TRUE and all(partners[a] == c for a, c in held):
                looked_at += level > 0
                assert _said(tree, level, partners) <= 1.0 - zeta + 1e-11
    assert found.values[0] >= max(inside.values()) - TRUE
    return int(looked_at)


def _whole_search(table, partners, value, room=None):
    """Return what a search of one cell with all maps takes, from a map and its ζ.

    ``room`` is how much memory it has, if not enough.
    """
    relations, spread = relations_of(table, WEIGHTS[0])
    found = Ranking(np.array([partners]), np.array([value]))
    shape = table.template_objects, table.argument_objects
    cells = _roomy_cell(relations, *shape, spread)
    cells = _cells.Cells(cells.boxes[:1], np.array([0.99]), cells.allowed[:1])
    tree = _residual.empty_tree(*shape)
    tree = tree._replace(blocks=tree.blocks[:room])
    fixed, place = _fixed.empty_fixed(shape[0]), _branch.first_place(0)
    return relations, found, spread, cells, tree, fixed, place, np.full(1, -np.inf)


def _small_search(seed=0, room=None):
    """Return the same of a small scene, from the worst map, and the best ζ."""
    table = random_table(np.random.default_rng(seed), 4, 5)
    every = every_confidence(table, WEIGHTS[0])
    worst = min(every, key=every.get)
    return _whole_search(table, worst, every[worst], room), max(every.values())


def test_a_search_of_cells_takes_no_second_step_where_one_takes_its_budget():
    table = random_table(np.random.default_rng(0), 10, 10)
    places = []
    for budget in (1, 10 * 9 // 2 * 10 * 9):  # the second is how many costs the root has
        search = _whole_search(table, range(10), 0.1)
        _branch.search_cells(*search, 1, 10**9)  # a cell begins
        _branch.search_cells(*search, budget, 10**9)
        places.append(search[6])
    assert places[0].tolist() == places[1].tolist()
    assert places[0][_branch.NODES] == 1


@pytest.mark.parametrize("most", range(1, 8))
def test_a_search_of_cells_looks_at_as_many_nodes_as_it_may(most):
    search, _ = _small_search()
    place = search[6]
    _branch.search_cells(*search, 10**9, most)
    assert (place[_branch.CELL], place[_branch.NODES]) == (0, most)


def test_a_cell_that_there_is_no_memory_for_is_given_up_with_its_bound():
    search, _ = _small_search(room=1)
    place, given_up = search[6:]
    _branch.search_cells(*search, 10**9, 10**9)
    assert (place[_branch.CELL], given_up[0]) == (1, 0.99)


def test_what_is_given_up_for_want_of_memory_has_a_true_bound():
    outcomes = set()
    for room in range(1, 300, 7):
        search, best = _small_search(seed=room, room=room)
        _branch.search_cells(*search, 10**9, 10**9)
        found, given_up = search[1].values[0], search[7][0]
        outcomes.add((given_up > -np.inf, found >= best - TRUE))
        assert max(found, given_up) >= best - TRUE
        assert given_up <= 1.0 + TRUE
    assert {(True, False), (False, True)} <= outcomes


@given(SEEDS, st.integers(2, 5), st.sampled_from([(0.0, 1.0, 0.0), *WEIGHTS]))
@examples(150)
def test_what_fixed_objects_lose_is_never_more_than_any_direction_of_the_cell_costs(
    seed, objects, weights
):
    rng = np.random.default_rng(seed)
    table = with_rotation_weights(rng, random_table(rng, objects, objects + 1))
    relations, spread = relations_of(table, weights)
    box = some_box(rng)
    terms = _cells.cell_terms(relations, 0.3, spread, box)
    partners, order = rng.permutation(objects + 1)[:objects], rng.permutation(objects)
    fixed = _fixed.empty_fixed(objects)
    _fixed.enter_cell(fixed, terms)
    middle, half = box[0]
    directions = middle + half * np.linspace(-1.0, 1.0, 2001)
    share = weights[1] / sum(weights) / table.template_pairs if objects > 2 else 0.0
    lost, vectors = 0.0, []
    for level, a in enumerate(order):
        lost += _fixed.fixed_loss(relations, fixed, level, a, partners[a])
        for b in order[:level]:
            i = oracle.pairs(objects).index((min(a, b), max(a, b)))
            pair = (partners[min(a, b)], partners[max(a, b)])
            turn = oracle.look_up(table, i, pair)[1]
            vectors.append(table.rotation_weights[i] * np.exp(1j * turn))
        components = np.array([(v * np.exp(-1j * directions)).real for v in vectors])
        true = 0.0
        if vectors:
            true = share * (components.max(axis=1).sum() - components.sum(axis=0).max())
        # Among so many directions each maximum is missed by less than 1e-6 of its length.
        assert lost == pytest.approx(true, abs=2e-6)


@pytest.mark.slow
@given(SEEDS, st.integers(3, 4), st.booleans())
@examples(100)
def test_where_rotation_is_all_costs_and_losses_of_a_whole_map_are_its_loss(seed, objects, heavy):
    rng = np.random.default_rng(seed)
    table = random_table(rng, objects, objects + 1)
    if heavy:
        table = with_rotation_weights(rng, table)
    weights = (0.0, 1.0, 0.0)
    relations, spread = relations_of(table, weights)
    for partners, value in every_confidence(table, weights).items():
        box = some_box(rng)
        box[0, 1] += 0.5
        box[1:] = [(-9.0, 9.0)] * QUANTILES
        terms = _cells.cell_terms(relations, 0.0, spread, box)
        fixed = _fixed.empty_fixed(objects)
        _fixed.enter_cell(fixed, terms)
        loss = sum(_costs(relations, terms, partners))
        for level, (a, c) in enumerate(enumerate(partners)):
            loss += _fixed.fixed_loss(relations, fixed, level, a, c)
        assert loss >= 1.0 - value - 1e-12
        if belongs(table, partners, box):
            assert loss == pytest.approx(1.0 - value, abs=1e-12)


@pytest.mark.slow
@given(st.integers(1, 6), st.integers(0, 4), st.integers(0, 2**32))
@examples(150)
def test_the_assignment_is_the_cheapest_and_its_reduced_costs_are_a_proof(rows, more, seed):
    rng = np.random.default_rng(seed)
    columns = rows + more
    kinds = [rng.uniform(0.0, 1.0, (rows, columns)), rng.integers(0, 3, (rows, columns))]
    costs = rng.choice(kinds)
    present = rng.uniform(0.0, 1.0, costs.shape) < rng.choice([0.5, 1.0])
    candidates = np.zeros((rows, columns), dtype=np.int64)
    listed, sizes = np.zeros((rows, columns)), present.sum(axis=1)
    for k in range(rows):
        candidates[k, : sizes[k]] = np.flatnonzero(present[k])
        listed[k, : sizes[k]] = costs[k, present[k]]
    holders = np.empty(columns, dtype=np.int64)
    found = reduce_by_assignment(listed, candidates, sizes, holders)
    totals = {
        p: sum(costs[k, c] for k, c in enumerate(p))
        for p in itertools.permutations(range(columns), rows)
        if all(present[k, c] for k, c in enumerate(p))
    }
    if not totals:
        assert found == FORBIDDEN
        return
    assert found == pytest.approx(min(totals.values()), abs=1e-12)
    taken = {int(k): c for c, k in enumerate(holders) if k >= 0}
    assert totals[tuple(taken[k] for k in range(rows))] == pytest.approx(found, abs=1e-12)
    reduced = np.zeros(costs.shape)
    for k in range(rows):
        reduced[k, present[k]] = listed[k, : sizes[k]]
    assert reduced.min() >= 0.0
    for p, total in totals.items():
        assert total >= found + sum(reduced[k, c] for k, c in enumerate(p)) - 1e-12


def test_no_map_of_a_cell_loses_less_than_its_costs():
    """The bound of a cell, entry by entry, against ζ of every map that belongs to it."""
    belonging = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        table = random_table(rng, 4, 5)
        weights = WEIGHTS[seed % len(WEIGHTS)]
        every = every_confidence(table, weights)
        first = next(iter(every))
        incumbent = every[first]
        relations, spread = relations_of(table, weights)
        box = some_box(rng)
        terms = _cells.cell_terms(relations, incumbent, spread, box)
        for partners, value in every.items():
            if value > incumbent and belongs(table, partners, box):
                belonging += 1
                loss = terms.base + sum(_costs(relations, terms, partners))
                assert 1.0 - value >= loss - 1e-12, seed
    assert belonging > 20


def share_bounds(t, ends):
    """Return between which shares of the L̂ the one up to t lies, by the quantiles of a cell."""
    shares = list(zip(_cells.QUANTILES, ends.tolist(), strict=True))
    least = max((share for share, (_, high) in shares if high <= t), default=0.0)
    return least, min((share for share, (low, _) in shares if low > t), default=1.0)


@given(SEEDS)
def test_hinges_and_constant_of_a_cell_are_the_integral_of_its_chords(seed):
    rng = np.random.default_rng(seed)
    box = some_box(rng)
    hinges = np.zeros((2, 2 * QUANTILES, 2))
    constant = _cells._write_hinges(box, hinges)
    edges = [-9.0, *np.sort(box[1:].ravel()), 9.0]
    levels = np.array([*rng.uniform(-3.0, 3.0, 5), *box[1:].ravel()])
    expected, total = np.zeros(len(levels)), 0.0
    for low, high in itertools.pairwise(edges):
        least, most = share_bounds(0.5 * (low + high), box[1:])
        steep = 1.0 - least - most
        if steep > 0.0:
            expected += 2.0 * steep * np.maximum(high - np.maximum(low, levels), 0.0)
        else:
            expected -= 2.0 * steep * np.maximum(np.minimum(high, levels) - low, 0.0)
        total += 2.0 * (high - low) * min(least * most, (1.0 - least) * (1.0 - most))
    (left, right), found = hinges, np.zeros(len(levels))
    for (place, slope), (other, fall) in zip(left, right, strict=True):
        found += slope * np.maximum(place - levels, 0.0) + fall * np.maximum(levels - other, 0.0)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert constant == pytest.approx(total, abs=1e-12)


@given(SEEDS, st.sampled_from(WEIGHTS), st.sampled_from([0.05, 0.5, 0.9, 0.99]))
def test_a_cell_costs_what_its_quantiles_and_the_incumbent_leave(seed, weights, incumbent):
    rng = np.random.default_rng(seed)
    relations, spread = relations_of(random_table(rng, 4, 5), weights)
    similarity, rotation, dilation = np.array(weights) / sum(weights)
    box = some_box(rng)
    terms = _cells.cell_terms(relations, incumbent, spread, box)
    least = _cells._write_hinges(box, np.zeros((2, 2 * QUANTILES, 2))) * 6.0 / 5.0
    most = spread
    if 1.0 - incumbent < dilation:  # δL of what is better is bounded
        most = min(most, -math.log2(1.0 - (1.0 - incumbent) / dilation))
    chord = math.log(2.0) * 2.0**-most
    if most > least + 1e-6:
        chord = (2.0**-least - 2.0**-most) / (most - least)
    assert terms.similarity_rate == pytest.approx(similarity / 6.0)
    assert terms.rotation_rate == pytest.approx(rotation / 6.0)
    assert terms.dilation_rate == pytest.approx(dilation * chord / 5.0)
    assert terms.base == pytest.approx(dilation * (1.0 - 2.0**-least))
    middle, half = box[0]
    np.testing.assert_allclose(terms.turn, [*direction(middle), *direction(half)])


@given(SEEDS, st.sampled_from(WEIGHTS), st.booleans())
def test_an_entry_costs_what_the_direction_that_suits_it_best_leaves(seed, weights, directed):
    rng = np.random.default_rng(seed)
    table = with_rotation_weights(rng, random_table(rng, 3, 4))
    if directed:
        table = dataclasses.replace(table, evidence=rng.random((3, 12)))
    relations, spread = relations_of(table, weights)
    box = some_box(rng)
    terms = _cells.cell_terms(relations, 0.3, spread, box)
    costs, (middle, half) = np.empty((3, 12)), box[0]
    _cells.pair_costs(relations, 0, 3, terms, costs)
    for i, pair in itertools.product(range(3), itertools.permutations(range(4), 2)):
        column = relations.columns[pair]
        similar, turn, dilation = oracle.look_up(table, i, pair)
        if directed:
            similar = table.evidence[i, column]
        away = abs(np.angle(np.exp(1j * (turn - middle))))
        greatest = math.cos(max(0.0, away - half))
        level = 1.5 * math.log2(dilation)
        left, right = terms.hinges
        kinked = sum(slope * max(place - level, 0.0) for place, slope in left)
        kinked += sum(slope * max(level - place, 0.0) for place, slope in right)
        assert costs[i, column] == pytest.approx(
            terms.similarity_rate * (1.0 - similar)
            + terms.rotation_rate * table.rotation_weights[i] * (1.0 - greatest)
            + terms.dilation_rate * kinked,
            abs=1e-12,
        )


def direction(angle):
    return math.cos(angle), math.sin(angle)


def test_a_cell_all_around_keeps_no_direction_and_one_pair_costs_similarity_alone():
    box = _cells.first_cell((2, 3), -1.0, 1.0).boxes[0]
    relations, spread = relations_of(random_table(np.random.default_rng(0), 2, 3), (1.0, 2.0, 3.0))
    terms = _cells.cell_terms(relations, 0.5, spread, box)
    assert terms.turn[_cells.HALF_COSINE] == -2.0
    assert terms[:4] == (pytest.approx(1.0 / 6.0), 0.0, 0.0, 0.0)
    assert not terms.hinges.any()


@given(SEEDS, st.sampled_from(WEIGHTS))
def test_while_maps_are_tried_none_is_more_than_the_best_of_each_pair(seed, weights):
    table = random_table(np.random.default_rng(seed), 4, 5)
    begin = Ranking(np.arange(4)[None], np.zeros(1))
    search = module._Search(
        MatchProblem(table, weights), Evolved(Outcome.CONVERGED, begin, 0, 0), Exact.Params()
    )
    finish(search.read())
    next(search.backtrack(), None)
    share = weights[0] / sum(weights)
    most = share * table.entry_evidence.max(axis=1).mean() + 1.0 - share
    assert search.upper_bound == pytest.approx(most)


@pytest.mark.parametrize("weights", [(1.0, 1.0, 1.0), (1.0, 0.0, 1.0), (1.0, 1.0, 0.0)])
def test_where_maps_are_few_cells_stay_four_times_as_wide(weights):
    table = random_table(np.random.default_rng(0), 4, 5)
    begin = Ranking(np.arange(4)[None], np.zeros(1))
    params = Exact.Params(cell_angle=30.0, cell_dilation=50.0)  # wider than a layer
    search = module._Search(
        MatchProblem(table, weights), Evolved(Outcome.CONVERGED, begin, 0, 0), params
    )
    finish(search.read())
    angle = 2.0 * math.radians(30.0) if weights[1] else math.inf
    dilation = 100.0 if weights[2] else math.inf
    np.testing.assert_allclose(search._smallest_cell(), [angle, *[dilation] * QUANTILES])


def test_the_levels_of_a_path_are_those_of_its_entries_in_order():
    table = random_table(np.random.default_rng(3), 4, 5)
    relations, _ = relations_of(table, (0.0, 0.0, 1.0))
    every = every_confidence(table, (0.0, 0.0, 1.0))
    worst = min(every, key=every.get)
    found = Ranking(np.array([worst]), np.array([every[worst]]))
    path = _backtrack.first_path(relations, 5, 0)
    looked_at = 0
    while path.place[_backtrack.DEPTH] >= 0:
        _backtrack.backtrack(relations, found, path, 1)
        for depth in range(2, path.place[_backtrack.DEPTH] + 1):
            levels = path.levels[depth, : depth * (depth - 1) // 2].tolist()
            assert levels == sorted(levels)
            looked_at += len(levels) > 1
    assert looked_at > 20
    assert found.values[0] == pytest.approx(max(every.values()), abs=TRUE)
