"""The golden answer for a scene that is turned by a quarter and doubled, by the slow oracle."""

import itertools
import math

import numpy as np
import pytest

from sketchmatch.model import RelationTable
from tests.contract.golden import golden
from tests.contract.values import MAP, SKETCH
from tests.oracle import directions, evidence, forces, maps, relations

DIRECTIONS = 36
TRUTH = (2, 0, 3)
PAIRS = maps.pairs(3)
CLOSE = {"abs": 1e-12}


@pytest.fixture(scope="module")
def request_():
    return golden("MatchRequest.turned")


@pytest.fixture(scope="module")
def result():
    return golden("MatchResponse.turned").result


@pytest.fixture(scope="module")
def drawn():
    return relations.descriptor(SKETCH, DIRECTIONS)


@pytest.fixture(scope="module")
def entries(drawn):
    """(σ, R, L) of each pair of the sketch on each ordered pair of the map."""
    mapped = relations.descriptor(MAP, DIRECTIONS)
    return {
        (i, other): relations.relation(drawn[pair], mapped[other])
        for i, pair in enumerate(PAIRS)
        for other in itertools.permutations(range(4), 2)
    }


@pytest.fixture(scope="module")
def every(request_, entries):
    """ζ and its five parts of every object map, by definition."""
    own = [
        [forces.force_histogram(item.rings, item.rings, DIRECTIONS) for item in scene.objects]
        for scene in (SKETCH, MAP)
    ]
    weights = request_.weights
    centroids = [item.centroid for item in SKETCH.objects]
    counts = [math.dist(centroids[a], centroids[b]) ** weights.distance for a, b in PAIRS]

    def parts(partners):
        others = maps.induced(partners)
        found = [entries[i, other] for i, other in enumerate(others)]
        turns = [complex(math.cos(turn), math.sin(turn)) for _, turn, _ in found]
        levels = [1.5 / math.log(2) * math.log(dilation) for *_, dilation in found]
        gaps = [abs(x - y) for x, y in itertools.combinations(levels, 2)]
        shapes = [
            evidence.parts(*own, pair, other, turn, level)
            for pair, other, (_, turn, _), level in zip(PAIRS, others, found, levels, strict=True)
        ]
        values = (
            np.mean([similarity for similarity, *_ in found]),
            abs(np.dot(counts, turns)) / sum(counts),
            math.exp(-math.log(2) * np.mean(gaps)),
            *np.mean(shapes, axis=0),
        )
        kinds = ("similarity", "rotation", "dilation", "shape", "size")
        total = np.average(values, weights=[getattr(weights, kind) for kind in kinds])
        return dict(zip(("total", *kinds), (total, *values), strict=True))

    return {p: parts(p) for p in itertools.permutations(range(4), 3)}


def partners_of(map_):
    assert [line.sketch_object for line in map_.object_matches] == [0, 1, 2]
    return tuple(line.map_object for line in map_.object_matches)


def test_the_map_is_the_sketch_turned_by_a_quarter_and_doubled_and_one_object_more():
    for drawn_, k in zip(SKETCH.objects, TRUTH, strict=True):
        turned = [(32 - 2 * y, 2 * x) for x, y in drawn_.rings[0].tolist()]
        assert set(turned) == set(map(tuple, MAP.objects[k].rings[0].tolist()))


def test_it_is_the_best_map_and_the_two_next_best(result, every):
    ranked = sorted(every, key=lambda partners: -every[partners]["total"])
    assert ranked[0] == TRUTH
    assert [partners_of(map_) for map_ in (result, *result.alternatives)] == ranked[:3]


def test_each_part_of_the_confidence_is_that_of_the_definition(result, every):
    for map_ in (result, *result.alternatives):
        for kind, value in every[partners_of(map_)].items():
            assert getattr(map_.fmap_confidence, kind) == pytest.approx(value, **CLOSE)


def test_an_object_is_as_sure_as_its_relations_are_alike(result, entries):
    table = RelationTable(
        *([[entries[i, c][k] for c in maps.pairs(4)] for i in range(3)] for k in range(3)), 3, 4
    )
    for map_ in (result, *result.alternatives):
        counted, implied = maps.occm(table, maps.induced(partners_of(map_)))
        partners, confidence = maps.object_map(counted, implied)
        assert tuple(partners) == partners_of(map_)
        assert map_.omap_confidence == pytest.approx(confidence, **CLOSE)
        for line in map_.object_matches:
            share = float(counted[line.sketch_object][line.map_object]) / 2
            assert line.confidence == pytest.approx(share, **CLOSE)


def test_the_entries_are_those_of_the_definition(result, entries):
    pairs = [(entry.sketch_pair, entry.map_pair) for entry in result.fmap_entries]
    assert [(a.first, a.second) for a, _ in pairs] == PAIRS
    assert [(c.first, c.second) for _, c in pairs] == maps.induced(TRUTH)
    for i, (entry, other) in enumerate(zip(result.fmap_entries, maps.induced(TRUTH), strict=True)):
        found = (entry.similarity, entry.rotation_radians, entry.dilation)
        assert found == pytest.approx(entries[i, other], **CLOSE)


def test_a_margin_is_what_the_best_map_with_another_partner_loses(result, every):
    known = [partners_of(map_) for map_ in result.alternatives]
    for a, line in enumerate(result.object_matches):
        exchanged = [p for p in every if sum(x != y for x, y in zip(p, TRUTH, strict=True)) <= 2]
        rivals = [every[p]["total"] for p in (*known, *exchanged) if p[a] != TRUTH[a]]
        assert line.margin == pytest.approx(1 - max(rivals), **CLOSE)


def test_a_relation_is_the_direction_that_suits_best(result, drawn):
    phrases = {0: "to the right of", 2: "above", 4: "to the left of", 6: "below"}
    for a, line in enumerate(result.object_matches):
        told = line.relation
        # In steps of which one bin has 200, and that no end of a bin divides: nothing is rounded.
        degrees = [
            directions.degree(drawn[a, told.reference_object], k * math.pi / 4, steps=3600)
            for k in range(8)
        ]
        assert phrases[int(np.argmax(degrees))] == told.phrase
        assert told.degree == pytest.approx(max(degrees), abs=1e-9)
