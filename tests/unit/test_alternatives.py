"""The next best maps and the margins, against trying every map."""

import itertools

import numpy as np
import pytest

from sketchmatch import InvalidInputError, Scene, match
from sketchmatch.api import Outcome, Searcher, SearchProgress
from sketchmatch.kernels.exchange import omission_confidences
from sketchmatch.model import Fmap, RelationTable, object_pairs
from sketchmatch.pipeline.alternatives import exchange_confidences, other_maps, partner_margins
from sketchmatch.pipeline.correspond import (
    confidence_relations,
    fmap_confidence,
    object_map,
    occm,
)
from sketchmatch.pipeline.match import run_match
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch.pipeline.selection import Choice
from sketchmatch.registry import Kind, Registered, Registry, default_registry
from tests.oracle import maps
from tests.strategies import random_table, with_evidence, with_rotation_weights

WEIGHTS = (1.0, 1.0, 1.0)
SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
GRID = Scene.from_polygons([np.add(SQUARE, (4 * k, 4 * m)) for k in range(3) for m in range(3)])


def zeta(partners, table):
    fmap = Fmap.from_object_map(np.array(partners), table.argument_objects)
    return fmap_confidence(fmap, table, WEIGHTS).total


def mapped(partners, table):
    return object_map(occm(Fmap.from_object_map(np.array(partners), table.argument_objects), table))


@pytest.mark.parametrize(("few", "many"), [(2, 2), (2, 5), (4, 4), (4, 6)])
def test_an_exchange_has_the_confidence_of_the_map_that_it_makes(few, many):
    table = random_table(np.random.default_rng(few + many), few, many)
    best = list(range(few))
    computed = exchange_confidences(mapped(best, table), table, WEIGHTS)
    for g, h in itertools.product(range(few), range(many)):
        if best[g] == h:
            assert computed[g, h] == -np.inf
            continue
        changed = [best[g] if partner == h else partner for partner in best]
        changed[g] = h
        assert computed[g, h] == pytest.approx(zeta(changed, table), abs=1e-12)


@pytest.mark.parametrize("evidence", [False, True])
@pytest.mark.parametrize(("few", "many"), [(3, 3), (4, 4), (5, 7)])
def test_an_omission_has_the_confidence_of_what_is_left(few, many, evidence):
    rng = np.random.default_rng(few + many)
    table = random_table(rng, few, many)
    if evidence:
        table = with_rotation_weights(rng, with_evidence(rng, table))
    partners, weights = rng.permutation(many)[:few].tolist(), (1.0, 2.0, 0.5)
    computed = omission_confidences(
        Fmap.from_object_map(np.array(partners), many).entries,
        object_pairs(few),
        table.rotation_weights,
        confidence_relations(table, weights),
    )
    for g in range(few):
        rows = [i for i, pair in enumerate(maps.pairs(few)) if g not in pair]
        part = RelationTable(
            table.similarity[rows],
            table.rotation[rows],
            table.dilation[rows],
            few - 1,
            many,
            None if table.evidence is None else table.evidence[rows],
            table.rotation_weights[rows],
        )
        left = [partner for k, partner in enumerate(partners) if k != g]
        expected = maps.confidence(part, maps.induced(left), weights)[0]
        assert computed[g] == pytest.approx(expected, abs=1e-9)


def test_the_other_maps_are_those_known_the_best_first_and_all_different():
    table = random_table(np.random.default_rng(3), 4, 5)
    best = max(itertools.permutations(range(5), 4), key=lambda p: zeta(p, table))
    everything = [Fmap.from_object_map(np.array(p), 5) for p in itertools.permutations(range(5), 4)]
    found = other_maps(mapped(best, table), [*everything, *everything], None, table, WEIGHTS, 6)
    values = sorted((zeta(p, table) for p in itertools.permutations(range(5), 4)), reverse=True)
    assert [other.confidence.total for other in found] == pytest.approx(values[1:])
    assert len({tuple(other.mapped.partners) for other in found}) == 119


def test_a_margin_is_the_loss_with_the_best_other_partner():
    table = random_table(np.random.default_rng(4), 4, 4)
    everyone = list(itertools.permutations(range(4)))
    best = max(everyone, key=lambda p: zeta(p, table))
    fmaps = [Fmap.from_object_map(np.array(p), 4) for p in everyone]
    exchanges = exchange_confidences(mapped(best, table), table, WEIGHTS)
    others = other_maps(mapped(best, table), fmaps, exchanges, table, WEIGHTS, 23)
    computed = partner_margins(mapped(best, table), zeta(best, table), others, exchanges)
    for g in range(4):
        rival = max(zeta(p, table) for p in everyone if p[g] != best[g])
        assert computed[g] == pytest.approx(zeta(best, table) - rival, abs=1e-12)


def test_a_symmetric_scene_shows_its_symmetric_answers():
    result = match(GRID, GRID, alternatives=7, profile="thesis")
    assert result.fmap_confidence == pytest.approx(1.0)
    centre = 4
    turned = [other for other in result.alternatives if other.confidence.total > 0.999]
    assert len(turned) == 3, "a square grid looks the same after three turns"
    for match_ in result.matches:
        ambiguous = match_.margin == pytest.approx(0.0, abs=1e-3)
        assert ambiguous == (match_.sketch_object != centre)


def test_more_alternatives_than_there_are_maps_are_refused():
    pair = Scene.from_polygons([SQUARE, np.add(SQUARE, (3, 1))])
    assert len(match(pair, pair).alternatives) == 1
    with pytest.raises(InvalidInputError, match="2 objects on 2 have only 1 other object map; ask"):
        match(pair, pair, alternatives=2)
    with pytest.raises(InvalidInputError, match="alternatives is -1"):
        match(pair, pair, alternatives=-1)
    assert match(GRID, GRID, alternatives=0).alternatives == ()


def test_a_searchers_note_is_in_the_result():
    class Identity(Searcher):
        """Answers with the identity."""

        name = "identity"
        summary = "The identity."

        def search(self, problem, rng):
            del rng
            assert problem.alternatives == 3
            assert 0 < problem.time_budget < 60
            partners = np.arange(problem.table.template_objects)
            fmap = Fmap.from_object_map(partners, problem.table.argument_objects)
            yield SearchProgress(fmap, 1.0, 1, 1, note="guessed")
            return Outcome.CONVERGED

    entry = Registered(Kind.SEARCHER, Identity, "tests", "0")
    registry = Registry([*default_registry().algorithms, entry])
    request = MatchRequest(GRID, GRID, {"searcher": Choice("identity")}, time_budget=60)
    *_, last = run_match(request, registry)
    assert last.result.search_note == "guessed"
