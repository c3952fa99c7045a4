"""What contributors test with: scenes, sketches and maps with known truth."""

from sketchmatch.testing.drawing import draw_strokes, strokes_to_svg
from sketchmatch.testing.driving import Odometry, estimate_poses, plan_tour
from sketchmatch.testing.lidar import Lidar, World, cast_rays, scan
from sketchmatch.testing.mapping import LogOddsGrid, SensorModel, map_scans
from sketchmatch.testing.robot import Survey, survey
from sketchmatch.testing.sketches import (
    SimulatedSketch,
    random_scene,
    simulate_sketch,
    spacing,
)
from sketchmatch.testing.sloppy import SloppySketch, draw_sloppily

__all__ = [
    "Lidar",
    "LogOddsGrid",
    "Odometry",
    "SensorModel",
    "SimulatedSketch",
    "SloppySketch",
    "Survey",
    "World",
    "cast_rays",
    "draw_sloppily",
    "draw_strokes",
    "estimate_poses",
    "map_scans",
    "plan_tour",
    "random_scene",
    "scan",
    "simulate_sketch",
    "spacing",
    "strokes_to_svg",
    "survey",
]
