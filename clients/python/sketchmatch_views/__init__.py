"""A match as rows of a table, as GeoJSON and as a picture.

Client and engine show their matches through it alike. It needs nothing but Python.
"""

from sketchmatch_views._picture import PAIR_COLOURS
from sketchmatch_views._view import Line, MatchRow, MatchView, Shape

__all__ = ["PAIR_COLOURS", "Line", "MatchRow", "MatchView", "Shape"]
