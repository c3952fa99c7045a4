# ruff: noqa: ARG002 (what breaks its contract does not look at its arguments)
"""Whatever a plugin does, the caller learns whose fault it is, and the server goes on."""

import grpc
import numpy as np
import pytest

from sketchmatch.api import (
    Histogram,
    Searcher,
    SearchProgress,
    Segmentation,
    Segmenter,
    Similarity,
)
from sketchmatch.model import Fmap, PolygonSet
from sketchmatch_client import Client, ServerFailedError
from tests.server.harness import scene, serving

BROKEN = {}
"""Stage and words that the error must have, by class."""


def broken(stage, words):
    def note(plugin):
        plugin.name = plugin.__name__.lower()
        plugin.summary = "Breaks its contract."
        BROKEN[plugin] = (stage, words)
        return plugin

    return note


def progress(problem, entries=None, confidence=0.5):
    entries = np.arange(problem.table.template_pairs) if entries is None else entries
    return SearchProgress(Fmap(entries), confidence, 1, 1)


@broken("map_segmenter", "ZeroDivisionError: by zero")
class RaisingSegmenter(Segmenter):
    sources = (PolygonSet,)

    def segment(self, source):
        raise ZeroDivisionError("by zero")


@broken("map_segmenter", "it returned a NoneType, not a Segmentation")
class EmptySegmenter(Segmenter):
    sources = (PolygonSet,)

    def segment(self, source):
        return None


@broken("map_segmenter", "it found a str, not a Scene")
class RubbishSegmenter(Segmenter):
    sources = (PolygonSet,)

    def segment(self, source):
        return Segmentation("rubbish")


@broken("map_segmenter", "RuntimeError: cannot start")
class UnmakeableSegmenter(Segmenter):
    sources = (PolygonSet,)

    def __init__(self, params=None):
        raise RuntimeError("cannot start")

    def segment(self, source):
        raise NotImplementedError


@broken("histogram", "KeyError: 'a very odd key'")
class RaisingHistogram(Histogram):
    exponent = 0.0

    def describe(self, scene, pairs):
        raise KeyError("a very odd key")


@broken("histogram", r"array of shape \(180,\), not \(\d+, 180\)")
class FlatHistogram(Histogram):
    exponent = 0.0

    def describe(self, scene, pairs):
        return np.ones(self.params.directions)


@broken("histogram", "values that are not finite")
class NanHistogram(Histogram):
    exponent = 0.0

    def describe(self, scene, pairs):
        return np.full((len(pairs), self.params.directions), np.nan)


@broken("similarity", "StopIteration")
class RaisingSimilarity(Similarity):
    def compare(self, aligned, argument):
        raise StopIteration


@broken("similarity", "could not convert string to float")
class TextSimilarity(Similarity):
    def compare(self, aligned, argument):
        return ["alike"] * len(aligned)


@broken("searcher", "LookupError: lost, on two lines")
class RaisingSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem)
        raise LookupError("lost,\n on two lines")


@broken("searcher", "it ended without any answer")
class SilentSearcher(Searcher):
    def search(self, problem, rng):
        yield from ()


@broken("searcher", "it yielded a str, not a SearchProgress")
class RubbishSearcher(Searcher):
    def search(self, problem, rng):
        yield "rubbish"


@broken("searcher", "its search is a list, not a generator")
class ListSearcher(Searcher):
    def search(self, problem, rng):
        return [progress(problem)]


@broken("searcher", r"its FMAP has shape \(1,\), not \(6,\)")
class ShortSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem, [0])


@broken("searcher", "its FMAP has an entry outside 0 … 11")
class FarSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem, np.full(6, 12))


@broken("searcher", "its confidence is nan")
class NanSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem, confidence=np.nan)


@broken("searcher", "'victory' is not a valid Outcome")
class OddlyEndingSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem)
        return "victory"


@broken("searcher", "x{100,200}…")
class TalkativeSearcher(Searcher):
    def search(self, problem, rng):
        raise ValueError("x" * 100_000)


@pytest.fixture(scope="module")
def client():
    with serving(*BROKEN) as host, Client(host.address) as client:
        yield client


@pytest.mark.parametrize("plugin", BROKEN, ids=lambda plugin: plugin.__name__)
def test_a_broken_plugin_is_named_with_its_distribution_and_the_server_goes_on(
    client, plugin, caplog
):
    stage, words = BROKEN[plugin]
    kind = stage.removeprefix("map_")
    with pytest.raises(ServerFailedError, match=words) as raised:
        client.match(scene(4), scene(4), **{stage: plugin.name})
    sentence = str(raised.value)
    assert raised.value.reason == "PLUGIN_FAILED"
    assert raised.value.__cause__.code() is grpc.StatusCode.INTERNAL
    assert sentence.startswith(f"{kind} {plugin.name} of acme-plugins 1.2 failed (")
    assert sentence.endswith("; tell its author or choose another")
    assert "\n" not in sentence
    assert plugin.name in caplog.text, "the operator's log says so as well"
    assert client.match(scene(4), scene(4)).object_map == {k: k for k in range(4)}


@pytest.mark.parametrize("plugin", [RaisingSegmenter, EmptySegmenter], ids=["raises", "rubbish"])
def test_a_broken_segmenter_is_named_by_segment_as_well(client, plugin):
    with pytest.raises(ServerFailedError, match=f"segmenter {plugin.name} of acme-plugins 1.2"):
        client.segment(scene(4), segmenter=plugin.name)
    assert len(client.segment(scene(4)).scene.objects) == 4
