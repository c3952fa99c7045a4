"""All that a plugin may import from the engine, in addition to ``sketchmatch.model``.

A distribution offers its algorithms, and readers of files, through one entry point in the group
``sketchmatch``, naming a module with any of six hooks, each marked with :data:`hookimpl` and
returning classes::

    from sketchmatch.api import hookimpl

    @hookimpl
    def sketchmatch_register_searchers():
        return [MySearcher]
"""

from sketchmatch.api._algorithm import API_VERSION, Algorithm, Params
from sketchmatch.api._hooks import hookimpl
from sketchmatch.api.histogram import Histogram, HistogramParams
from sketchmatch.api.judge import Candidate, Judge, JudgedMap, Judgement, JudgeProblem
from sketchmatch.api.reader import Reader
from sketchmatch.api.searcher import MatchProblem, Outcome, Searcher, SearchProgress
from sketchmatch.api.segmenter import Segmentation, Segmenter
from sketchmatch.api.similarity import Alignment, ProductSimilarity, Similarity
from sketchmatch.errors import InvalidInputError, Reason

__all__ = [
    "API_VERSION",
    "Algorithm",
    "Alignment",
    "Candidate",
    "Histogram",
    "HistogramParams",
    "InvalidInputError",
    "Judge",
    "JudgeProblem",
    "JudgedMap",
    "Judgement",
    "MatchProblem",
    "Outcome",
    "Params",
    "ProductSimilarity",
    "Reader",
    "Reason",
    "SearchProgress",
    "Searcher",
    "Segmentation",
    "Segmenter",
    "Similarity",
    "hookimpl",
]
