"""How often a search by laying tells where it is."""

import numpy as np

from sketchmatch.testing import matching_problem
from sketchmatch_builtin.searchers.align import Align


def test_sketches_of_many_objects_are_laid_a_few_poses_at_a_time():
    problem, _ = matching_problem(np.random.default_rng(0), objects=40)
    told = [each.evaluations for each in Align().search(problem, np.random.default_rng(0))]
    assert told[-1] > 20_000
    assert max(np.diff(told)) < 5_000
