"""The benchmarks: what peers are given, what is counted, and that tables are complete."""

import dataclasses
from importlib.util import find_spec

import numpy as np
import pytest

from sketchmatch.model import Fmap
from sketchmatch.registry import Kind, default_registry
from tests.benchmarks import histograms, peers, searchers
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
    "arguments", [["--sizes=2"], ["--sizes=8x4"], ["--searchers=x"], ["--budget=0"]]
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
