"""The benchmarks: what peers are given, what is counted, and that tables are complete."""

import dataclasses
import itertools
from importlib.util import find_spec

import numpy as np
import pytest

from sketchmatch import Scene
from sketchmatch.model import Fmap
from sketchmatch.registry import Kind, default_registry
from tests.benchmarks import aligners, answers, histograms, matches, peers, searchers
from tests.experiments.generators import sample
from tests.strategies import random_table
from tests.tools import require

pytestmark = pytest.mark.slow


def table_with_answer(partners, others):
    """Return a table where σ is 1 for what an object map implies and small elsewhere."""
    table = random_table(np.random.default_rng(0), len(partners), others)
    similarity = 0.2 * table.similarity
    columns = Fmap.from_object_map(np.array(partners), others).entries % table.argument_pairs
    similarity[np.arange(table.template_pairs), columns] = 1.0
    return dataclasses.replace(table, similarity=similarity)


def test_affinity_is_what_each_pair_of_pairings_adds():
    table = random_table(np.random.default_rng(0), 3, 4)
    rows, columns = {(0, 1): 0, (0, 2): 1, (1, 2): 2}, np.full((4, 4), -1)
    for j, (c, d) in enumerate([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]):
        columns[c, d] = columns[d, c] = j
    values = peers.affinity(table)
    for a, c, b, d in np.ndindex(3, 4, 3, 4):
        expected = 0.0
        if a != b and c != d:
            sigma = table.similarity[rows[min(a, b), max(a, b)]]
            expected = sigma[columns[c, d]] - min(sigma)
        assert values[a, c, b, d] == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize("peer", peers.PEERS, ids=lambda peer: peer.name)
@pytest.mark.parametrize("others", [5, 7])
def test_a_peer_finds_an_obvious_answer(peer, others):
    require(peer.installed, f"{peer.package} (`make .venv/bench` installs it)")
    partners = [3, 0, 4, 2, 1]
    assert peer.prepare(table_with_answer(partners, others))().tolist() == partners


def test_rank_one_keeps_what_tells_maps_apart():
    require(find_spec("scipy"), "scipy (`make .venv/bench` installs it)")
    rng = np.random.default_rng(1)
    table = random_table(rng, 4, 4)
    # Rank one beside the means of rows and columns: nothing is lost.
    u, v = (part - part.mean() for part in rng.uniform(-0.4, 0.4, (2, 6)))
    means = 0.5 + 0.1 * np.add.outer(rng.uniform(-1, 1, 6), rng.uniform(-1, 1, 6))
    table = dataclasses.replace(table, similarity=means + np.outer(u, v))
    template, argument = peers.rank_one(table)
    totals, kept = [], []
    for _ in range(10):
        p = rng.permutation(4)
        columns = Fmap.from_object_map(p, 4).entries % 6
        totals.append(table.similarity[np.arange(6), columns].sum())
        kept.append((template * argument[np.ix_(p, p)]).sum() / 2)
    np.testing.assert_allclose(np.diff(totals), np.diff(kept), atol=1e-9)


def test_the_table_has_every_searcher(capsys):
    searchers.main(["--sizes=3,3x4", "--scenes=1", "--budget=5", "--no-peers", "--answers=none"])
    printed = capsys.readouterr().out
    for item in default_registry().of_kind(Kind.SEARCHER):
        assert printed.count(f" {item.name} ") >= 2
    assert "refutes: none" in printed
    assert "pygmtools" not in printed


def test_a_search_is_closed_at_its_budget():
    size = searchers.Size(8, 8, 1, 1e-9)
    easm = default_registry().find(Kind.SEARCHER, "easm").algorithm
    table, truth = searchers._problem(size, (0,))
    run = searchers._search(easm, table, truth, size, 0)
    assert run.stopped
    assert run.own <= 1.0


@pytest.mark.parametrize(
    "arguments",
    [["--sizes=2"], ["--sizes=8x4"], ["--searchers=x"], ["--budget=0"], ["--sketches=0"]],
)
def test_senseless_options_are_refused(arguments, capsys):
    with pytest.raises(SystemExit):
        searchers.main(arguments)
    assert "error" in capsys.readouterr().err


def test_histograms_count_the_edges_that_share_a_line():
    scene = histograms._two_outlines(5, jagged=True)
    starts, ends, offsets = scene.edges
    count = 0
    for k in range(90):
        across = -np.sin(np.pi * k / 90), np.cos(np.pi * k / 90)
        spans = [
            sorted((start @ across, end @ across)) for start, end in zip(starts, ends, strict=True)
        ]
        pairs = [(a, b) for a in spans[: offsets[1]] for b in spans[offsets[1] :]]
        count += sum(max(a[0], b[0]) < min(a[1], b[1]) for a, b in pairs)
    assert histograms.edge_pairs(scene) == count


def test_the_tables_of_histograms_are_complete(monkeypatch):
    monkeypatch.setattr(histograms, "_SECONDS", 0.0)
    vertices = histograms.by_vertices("constant", [5, 10])
    assert vertices.row_count == 2
    plugins = histograms.by_plugin(5, None)
    assert list(plugins.columns[0].cells) == histograms.names(Kind.HISTOGRAM)
    assert "missing" in plugins.caption
    objects = histograms.by_objects([3])
    assert len(objects.columns) == len(histograms.names(Kind.SIMILARITY)) + 3


# Parts of maps, extras and other places -----------------------------------------------------------


def laid_out(copies, wobble=0.0):
    """Return boxes of several sizes, and all but two of them turned and scaled as a sketch."""
    rng = np.random.default_rng(3)
    places = rng.uniform(0.0, 20.0, (copies, 2))
    sides = np.exp(rng.uniform(-0.7, 0.7, copies))
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    map_ = Scene.from_polygons(
        [corners * side + at for side, at in zip(sides, places, strict=True)]
    )
    kept = rng.permutation(copies)[2:]
    c, s = 0.4 * np.cos(2.0), 0.4 * np.sin(2.0)
    rings = [map_.objects[k].rings[0] + rng.normal(0.0, wobble, 2) for k in kept]
    return Scene.from_polygons([ring @ [[c, s], [-s, c]] for ring in rings]), map_, kept


def test_a_consistent_subset_is_found_in_a_turned_and_scaled_part():
    sketch, map_, kept = laid_out(9)
    assert aligners.ALIGNERS[-1].solve(sketch, map_).tolist() == kept.tolist()


def test_a_pose_is_found_from_pairings_of_like_sizes():
    require(aligners.ALIGNERS[1].installed, "scipy (`make .venv/bench` installs it)")
    sketch, map_, kept = laid_out(12, 0.1)
    assert aligners.ALIGNERS[1].solve(sketch, map_).tolist() == kept.tolist()
    found = aligners.ALIGNERS[0].solve(sketch, map_)
    taken = found[found >= 0]
    assert len(set(taken.tolist())) == len(taken) >= 1


def best_clique(weights, consistent):
    """Return the clique of the largest greatest eigenvalue, by trying all."""
    best, value = (), -1.0
    for size in range(1, len(weights) + 1):
        for some in itertools.combinations(range(len(weights)), size):
            block = np.ix_(some, some)
            if consistent[block].sum() == size * (size - 1):
                found = np.linalg.eigvalsh(weights[block] + np.eye(size))[-1]
                if found > value + 1e-9:
                    best, value = some, found
    return best, value


def test_dense_subgraphs_are_cliques_about_as_dense_as_the_densest():
    close = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        joined = np.triu(rng.random((9, 9)) < 0.5, 1)
        consistent = joined | joined.T
        weights = np.triu(rng.uniform(0.5, 1.0, (9, 9)), 1)
        weights = (weights + weights.T) * consistent
        found = aligners.dense_subgraph(weights, consistent)
        block = np.ix_(found, found)
        assert consistent[block].sum() == len(found) * (len(found) - 1)
        value = np.linalg.eigvalsh(weights[block] + np.eye(len(found)))[-1]
        close.append(value / best_clique(weights, consistent)[1])
    assert np.mean(close) > 0.9


@pytest.mark.parametrize("case", answers.CASES, ids=lambda case: case.name)
def test_every_method_answers_each_kind_of_sketch(case):
    found = answers.answers(case, 1, ["nn"], aligners.ALIGNERS[-1:], 5.0)
    assert list(found) == ["default", "nn", "CLIPPER (ours)"]
    assert all(len(each.right) == 8 and each.seconds > 0 for each in found.values())
    table = answers.answers_table({case: [found]})
    assert table.row_count == 3
    assert list(table.columns[2].cells) == list(found)


def test_what_is_right_is_the_truth_and_nothing_where_there_is_none():
    drawing = sample("plain", 0, objects=20, extra=1)
    truth = drawing.truth.tolist()
    assert answers._right(drawing, truth) == (True,) * 9
    wrong = [(k + 1) % 20 for k in truth]
    assert not any(answers._right(drawing, wrong))
    answer = answers.Answer(0.5, (True, False, True), None)
    assert answers._figures([answer])[:2] == ["0%", "66.7%"]
    placed = [dataclasses.replace(answer, here=here) for here in (True, False, None)]
    assert answers._figures(placed)[-1] == "50%"


def test_whole_matches_are_timed_by_stage(capsys, monkeypatch):
    monkeypatch.setattr(matches, "_SIZES", ((3, 4),))
    monkeypatch.setattr(matches, "_alone", lambda: None)
    matches.main(["--sketches=2", "--searchers=exact"])
    printed = capsys.readouterr().out
    for word in ("3 × 4", "default", "exact", "describe", "relate", "search"):
        assert word in printed


@pytest.mark.parametrize("arguments", [["--sketches=0"], ["--searchers=x"]])
def test_senseless_options_of_whole_matches_are_refused(arguments, capsys):
    with pytest.raises(SystemExit):
        matches.main(arguments)
    assert "error" in capsys.readouterr().err
