"""The thesis's judgement: the map with the highest ζ is the answer."""

from __future__ import annotations

from sketchmatch.api import Judge, JudgedMap, Judgement, JudgeProblem
from sketchmatch.model import ConfidenceWeights
from sketchmatch_builtin.judges._odds import likelihood, met
from sketchmatch_builtin.judges.calibration import calibrated, default_price

__all__ = ["HighestConfidence"]


class HighestConfidence(Judge):
    """The map with the highest ζ, less the price of what it leaves out, is the answer.

    Its probability follows from ζ of the maps that come close to it, by odds learned from simulated
    sketches: for the weights of the thesis, the default similarity measure on histograms of
    constant forces, and object maps. Otherwise, and for too many objects, there are no
    probabilities. Other places are not considered: all probabilities assume this one.

    References
    ----------
    "Scene Matching Between a Quantitative Map and a Qualitative Hand Drawn Sketch", thesis,
    section 3.6.1.

    Examples
    --------
    Of the maps of a plain sketch the right one comes first:

    >>> import numpy as np
    >>> from sketchmatch.testing import judging_problem
    >>> problem, truth = judging_problem(np.random.default_rng(0), objects=5)
    >>> best, *others = HighestConfidence().judge(problem).maps
    >>> best.partners.tolist() == truth.tolist(), len(others)
    (True, 3)
    """

    name = "confidence"
    summary = "The map with the highest confidence ζ wins, as in the thesis."

    def price(self, weights: ConfidenceWeights) -> float:
        """Return the price of leaving objects out that fits the weights."""
        return default_price(weights)

    def judge(self, problem: JudgeProblem) -> Judgement:
        """Put the candidates in the order of what they are worth."""
        others = met(problem)
        calibration = calibrated(problem.weights) if problem.usual else None
        if calibration is not None and problem.exchanges is not None:
            return likelihood(problem, others, calibration)
        ranked = (problem.candidates[0], *others)
        return Judgement(tuple(JudgedMap(each.partners) for each in ranked))
