"""Laying a sketch upon a map: poses, and the object maps that follow; for searcher and judge."""

from sketchmatch_builtin.alignment._candidates import (
    Laid,
    Late,
    completed,
    drive,
    known_maps,
    laid_maps,
    near_maps,
    never,
    refined_maps,
    template_maps,
)
from sketchmatch_builtin.alignment._measures import Line, Measured, Whole, measured, relations_of
from sketchmatch_builtin.alignment._sides import Sides, sides_of
from sketchmatch_builtin.alignment._things import Things

__all__ = [
    "Laid",
    "Late",
    "Line",
    "Measured",
    "Sides",
    "Things",
    "Whole",
    "completed",
    "drive",
    "known_maps",
    "laid_maps",
    "measured",
    "near_maps",
    "never",
    "refined_maps",
    "relations_of",
    "sides_of",
    "template_maps",
]
