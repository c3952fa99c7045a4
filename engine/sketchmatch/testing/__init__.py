"""Tools for testing plugins: contracts, an oracle, and data with known truth.

- Contracts: :func:`check_plugin` puts a class of any kind to all of them, :func:`plugin_checks`
  yields them one by one, :func:`parametrize_plugins` makes a pytest test of each, and
  :func:`search_report` says what of a searcher no contract asks for.
- The oracle, slow and obvious: :func:`score_fmap`, :func:`best_object_map`, :func:`is_legal`,
  :func:`is_object_consistent`, :func:`mapped_pairs`.
- Problems with their truth: :func:`matching_problem` for searchers, :func:`judging_problem` for
  judges; :func:`random_relations` has none.
- Scenes and sketches: :func:`random_scene`, :func:`simulate_sketch`, :func:`draw_strokes`,
  :func:`draw_sloppily`; photographs of drawings in :mod:`sketchmatch.testing.photographs`.
- Maps: :func:`survey` sends a robot with a :class:`Lidar` through a :class:`World`, and
  :func:`map_scans` builds its occupancy grid.

Examples
--------
How often is the best map of all the true one?

>>> import numpy as np
>>> true = 0
>>> for seed in range(10):
...     problem, truth = matching_problem(np.random.default_rng(seed), objects=5, missing=1)
...     zeta, partners = best_object_map(problem.table, problem.weights)
...     true += partners == tuple(truth.tolist())
>>> true
9
"""

from sketchmatch.testing.conformance import (
    CheckResult,
    CheckState,
    ContractViolationError,
    PluginCheck,
    SearchReport,
    check_plugin,
    parametrize_plugins,
    plugin_checks,
    search_report,
)
from sketchmatch.testing.drawing import draw_strokes, strokes_to_svg
from sketchmatch.testing.driving import Odometry, estimate_poses, plan_tour
from sketchmatch.testing.lidar import Lidar, World, cast_rays, scan
from sketchmatch.testing.mapping import LogOddsGrid, SensorModel, map_scans
from sketchmatch.testing.oracle import (
    best_object_map,
    is_legal,
    is_object_consistent,
    mapped_pairs,
    score_fmap,
)
from sketchmatch.testing.problems import judging_problem, matching_problem, random_relations
from sketchmatch.testing.robot import Survey, survey
from sketchmatch.testing.sketches import (
    SimulatedSketch,
    random_scene,
    simulate_sketch,
    spacing,
)
from sketchmatch.testing.sloppy import SloppySketch, draw_sloppily

__all__ = [
    "CheckResult",
    "CheckState",
    "ContractViolationError",
    "Lidar",
    "LogOddsGrid",
    "Odometry",
    "PluginCheck",
    "SearchReport",
    "SensorModel",
    "SimulatedSketch",
    "SloppySketch",
    "Survey",
    "World",
    "best_object_map",
    "cast_rays",
    "check_plugin",
    "draw_sloppily",
    "draw_strokes",
    "estimate_poses",
    "is_legal",
    "is_object_consistent",
    "judging_problem",
    "map_scans",
    "mapped_pairs",
    "matching_problem",
    "parametrize_plugins",
    "plan_tour",
    "plugin_checks",
    "random_relations",
    "random_scene",
    "scan",
    "score_fmap",
    "search_report",
    "simulate_sketch",
    "spacing",
    "strokes_to_svg",
    "survey",
]
