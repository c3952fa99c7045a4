# ruff: noqa: ARG002 (what breaks its contract does not look at its arguments)
"""A plugin, as third parties distribute them, whose algorithms all break their contract."""

import ctypes
import math
import os
import re
import sys
import threading
import time

import numpy as np

from sketchmatch.api import (
    Histogram,
    Judge,
    JudgedMap,
    Judgement,
    Params,
    Searcher,
    SearchProgress,
    Segmentation,
    Segmenter,
    Similarity,
    hookimpl,
)
from sketchmatch.model import Fmap, PolygonSet
from sketchmatch.pipeline.correspond import fmap_confidence
from sketchmatch_builtin.histograms.constant import ConstantForce

BROKEN = {}
"""Stage and words that the error must have, by class: these harm no other request in any case."""
UNSTOPPABLE = {}
"""The same for those that only a process of their own can keep from harming others."""


def broken(stage, words, into=BROKEN):
    def note(plugin):
        plugin.name = plugin.__name__.lower()
        plugin.summary = "Breaks its contract."
        into[plugin] = (stage, words)
        return plugin

    return note


def unstoppable(stage, words):
    return broken(stage, words, UNSTOPPABLE)


def progress(problem, entries=None, confidence=None, **more):
    """Return progress that is sound, but for what is given."""
    table = problem.table
    fmap = Fmap(np.arange(table.template_pairs) if entries is None else entries)
    if confidence is None:
        confidence = fmap_confidence(fmap, table, problem.weights).total
    return SearchProgress(fmap, confidence, **{"iteration": 1, "evaluations": 1, **more})


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


@broken("histogram", "it returned -1, which is less than 0")
class NegativeHistogram(Histogram):
    exponent = 0.0

    def describe(self, scene, pairs):
        return np.linspace(-1.0, 1.0, self.params.directions)[None].repeat(len(pairs), axis=0)


@broken("histogram", r"it changed its input: objects\[0\].rings\[0\]")
class ScribblingHistogram(ConstantForce):
    def describe(self, scene, pairs):
        found = super().describe(scene, pairs)
        scribble(scene.objects[0].rings[0])
        return found


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


@broken("similarity", "it returned 1.5, which is more than 1")
class EnthusiasticSimilarity(Similarity):
    def compare(self, aligned, argument):
        return np.full(len(aligned), 1.5)


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


@broken("searcher", "it says that its FMAP has ζ nan, but that has 1")
class NanSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem, confidence=np.nan)


@broken("searcher", r"it says that its FMAP has ζ 0.99, but that has 0\.\d+")
class BoastingSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem, other_map(problem).entries, confidence=0.99)


@broken("searcher", r"its ζ fell from 1 to 0\.\d+")
class FallingSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem)
        yield progress(problem, other_map(problem).entries)


@broken("searcher", "its FMAP takes a pair of objects twice, or a pair and its dual")
class RepeatingSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem, np.zeros(6))


@broken("searcher", "its FMAP takes a pair of objects twice, or a pair and its dual")
class DualSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem, [0, 6, 1, 2, 3, 4])


@broken("searcher", "its FMAP has an entry outside 0 … 11")
class OddAlternativeSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem, alternatives=(Fmap(np.full(6, -1)),))


@broken("searcher", "its upper bound is 0.2, but its FMAP has ζ 1")
class ModestSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem, upper_bound=0.2)


@broken("searcher", "its evaluations is 'many', not a count")
class UncountedSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem, evaluations="many")


@broken("searcher", "its note is a int, not a string")
class NoteSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem, note=7)


@broken("searcher", "its object map has a partner outside −1 … 3")
class FarFetchingSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem, maps=(np.array([0, 1, 2, 9]),))


@broken("searcher", "its object map is 'none', not an array of whole numbers")
class WordySearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem, maps=("none",))


@broken("searcher", "it changed its input: similarity")
class ScribblingSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem)
        scribble(problem.table.similarity)


@broken("searcher", "SystemExit: 3")
class LeavingSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem)
        sys.exit(3)


@broken("searcher", "generator ignored GeneratorExit")
class ClingingSearcher(Searcher):
    def search(self, problem, rng):
        while True:
            try:
                yield progress(problem)
                time.sleep(0.01)
            except GeneratorExit:
                yield progress(problem)


@broken("searcher", "'victory' is not a valid Outcome")
class OddlyEndingSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem)
        return "victory"


@broken("searcher", "x{100,200}…")
class TalkativeSearcher(Searcher):
    def search(self, problem, rng):
        raise ValueError("x" * 100_000)


@broken("searcher", "OSError: no such parameter")
class OddParamsSearcher(Searcher):
    class Params(Params):
        """Raise whatever is asked of them."""

        def model_post_init(self, context):
            raise OSError("no such parameter")

    def search(self, problem, rng):
        raise NotImplementedError


class PoisoningHistogram(Histogram):
    """Leaves the process in a state in which nothing works any more."""

    name = "poisoninghistogram"
    summary = "Breaks its process."
    exponent = 0.0

    def describe(self, scene, pairs):
        np.asarray = None
        return np.ones((len(pairs), self.directions))


class ThreadedHistogram(ConstantForce):
    """Leaves a thread that computes as long as its process lives."""

    name = "threadedhistogram"

    def describe(self, scene, pairs):
        threading.Thread(target=spin, name="spinning", daemon=True).start()
        return super().describe(scene, pairs)


def spin():
    while True:
        pass


@unstoppable("searcher", "gave no sign of life for 1 s and was stopped")
class SleepingSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem)
        time.sleep(600)


@unstoppable("searcher", "gave no sign of life for 1 s and was stopped")
class LoopingSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem)
        while True:
            pass


@unstoppable("searcher", "gave no sign of life for 1 s and was stopped")
class LockingSearcher(Searcher):
    """Holds the interpreter's lock, so that no other thread of its process does anything."""

    def search(self, problem, rng):
        yield progress(problem)
        re.match(r"(a+)+$", 60 * "a" + "b")


@unstoppable("searcher", r"ended its process \(exit code 7\)")
class ExitingSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem)
        os._exit(7)


@unstoppable("searcher", r"ended its process \(signal 11\)")
class CrashingSearcher(Searcher):
    def search(self, problem, rng):
        yield progress(problem)
        ctypes.string_at(0)


@unstoppable("histogram", "gave no sign of life for 1 s and was stopped")
class LoopingHistogram(Histogram):
    exponent = 0.0

    def describe(self, scene, pairs):
        while True:
            pass


@unstoppable("similarity", "gave no sign of life for 1 s and was stopped")
class LoopingSimilarity(Similarity):
    def compare(self, aligned, argument):
        while True:
            pass


@unstoppable("map_segmenter", "gave no sign of life for 1 s and was stopped")
class LoopingSegmenter(Segmenter):
    sources = (PolygonSet,)

    def segment(self, source):
        while True:
            pass


@unstoppable("searcher", "gave no sign of life for 1 s and was stopped")
class UnmakeableSearcher(Searcher):
    def __init__(self, params=None):
        while True:
            pass

    def search(self, problem, rng):
        raise NotImplementedError


@broken("judge", "ZeroDivisionError: no scales")
class RaisingJudge(Judge):
    def judge(self, problem):
        raise ZeroDivisionError("no scales")


@broken("judge", "TypeError: neither yes nor no")
class UndecidedJudge(Judge):
    @property
    def partial(self):
        raise TypeError("neither yes nor no")

    def judge(self, problem):
        raise NotImplementedError


@broken("judge", "it returned a tuple, not a Judgement")
class SilentJudge(Judge):
    def judge(self, problem):
        return ()


@broken("judge", "its maps are not a tuple of JudgedMap")
class UnjudgingJudge(Judge):
    def judge(self, problem):
        return Judgement(problem.candidates)


@broken("judge", "it returned no map")
class MaplessJudge(Judge):
    def judge(self, problem):
        return Judgement(())


@broken("judge", "it returned a map twice")
class StammeringJudge(Judge):
    def judge(self, problem):
        return says([0, 1, 2, 3], [1, 0, 2, 3], [0, 1, 2, 3])


@broken("judge", r"its object map has shape \(2,\), not \(4,\)")
class ShortJudge(Judge):
    def judge(self, problem):
        return says([0, 1])


@broken("judge", "its object map has a partner outside −1 … 3")
class LostJudge(Judge):
    def judge(self, problem):
        return says([0, 1, 2, 4])


@broken("judge", "its object map takes an object of the argument twice")
class BigamousJudge(Judge):
    def judge(self, problem):
        return says([0, 1, 2, 2])


@broken("judge", "its object map matches 3 objects, fewer than 4")
class ForgetfulJudge(Judge):
    def judge(self, problem):
        return says([0, 1, 2, -1])


@broken("judge", "its probability of a map is 1.5, not a number within 0 … 1")
class OverconfidentJudge(Judge):
    def judge(self, problem):
        return says([0, 1, 2, 3], probability=1.5)


@broken("judge", "its probability of a map is nan, not a number within 0 … 1")
class ConfusedJudge(Judge):
    def judge(self, problem):
        return says([0, 1, 2, 3], probability=math.nan)


@broken("judge", "its elsewhere is -0.5, not a number within 0 … 1")
class DisplacedJudge(Judge):
    def judge(self, problem):
        return says([0, 1, 2, 3], elsewhere=-0.5)


@broken("judge", "right with probability 0.75, but the place is another one with 0.5")
class TornJudge(Judge):
    def judge(self, problem):
        return says([0, 1, 2, 3], probability=0.75, elsewhere=0.5)


@broken("judge", r"it returned an array of shape \(4, 4\), not \(4, 5\)")
class NarrowJudge(Judge):
    def judge(self, problem):
        return says([0, 1, 2, 3], lines=np.eye(4))


@broken("judge", "it returned 1.5, which is more than 1")
class BoldJudge(Judge):
    def judge(self, problem):
        return says([0, 1, 2, 3], lines=1.5 * np.eye(4, 5))


@broken("judge", "right with probability 0.75, but one of its lines only with 0.5")
class ContradictingJudge(Judge):
    def judge(self, problem):
        lines = np.eye(4, 5)
        lines[2, 2] = 0.5
        return says([0, 1, 2, 3], probability=0.75, lines=lines)


@broken("judge", "it changed its input: table.similarity")
class ScribblingJudge(Judge):
    def judge(self, problem):
        scribble(problem.table.similarity)
        return says([0, 1, 2, 3])


@unstoppable("judge", "gave no sign of life for 1 s and was stopped")
class PonderingJudge(Judge):
    def judge(self, problem):
        while True:
            pass


@unstoppable("judge", r"ended its process \(exit code 7\)")
class ExitingJudge(Judge):
    def judge(self, problem):
        os._exit(7)


def says(first, *others, probability=None, lines=None, elsewhere=None):
    """Return a judgement of maps, of which the first is known how likely it is."""
    maps = (JudgedMap(first, probability), *map(JudgedMap, others))
    return Judgement(maps, lines, elsewhere)


def scribble(array):
    """Change an array that is read-only."""
    array.flags.writeable = True
    array *= 0.9
    array.flags.writeable = False


def other_map(problem):
    """Return the histogram map of an object map that is not the best."""
    return Fmap.from_object_map(np.array([1, 0, 2, 3]), problem.table.argument_objects)


def _of(interface):
    return [plugin for plugin in (*BROKEN, *UNSTOPPABLE) if issubclass(plugin, interface)]


@hookimpl
def sketchmatch_register_segmenters():
    return _of(Segmenter)


@hookimpl
def sketchmatch_register_histograms():
    return [*_of(Histogram), PoisoningHistogram, ThreadedHistogram]


@hookimpl
def sketchmatch_register_similarities():
    return _of(Similarity)


@hookimpl
def sketchmatch_register_searchers():
    return _of(Searcher)


@hookimpl
def sketchmatch_register_judges():
    return _of(Judge)
