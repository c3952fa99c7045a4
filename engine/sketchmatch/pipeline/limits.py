"""How large scenes may be."""

from __future__ import annotations

from sketchmatch.api import Histogram
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import Scene, pair_count

__all__ = ["check_comparisons", "check_histograms"]

# What 2 GB hold: 100 × 100 objects, and the histograms of 700 objects in 180 directions.
_MAX_COMPARISONS = 30_000_000
_MAX_HISTOGRAM_VALUES = 50_000_000


def check_histograms(field: str, scene: Scene, histogram: Histogram) -> None:
    """Refuse a scene whose histograms would not fit into memory.

    Raises
    ------
    InvalidInputError
        With ``field`` as its path.
    """
    values = pair_count(len(scene)) * histogram.params.directions
    if values > _MAX_HISTOGRAM_VALUES:
        raise InvalidInputError(
            Reason.LIMIT_EXCEEDED,
            field,
            f"has {len(scene)} objects, whose relations take {values} numbers, more than the "
            f"limit of {_MAX_HISTOGRAM_VALUES}; leave out small objects",
        )


def check_comparisons(sketch: Scene, map_: Scene) -> None:
    """Refuse two scenes whose relation table would not fit into memory.

    Raises
    ------
    InvalidInputError
        With the path ``sketch``.
    """
    comparisons = pair_count(len(sketch)) * pair_count(len(map_))
    if comparisons > _MAX_COMPARISONS:
        raise InvalidInputError(
            Reason.LIMIT_EXCEEDED,
            "sketch",
            f"has {len(sketch)} objects and the map {len(map_)}, which makes {comparisons} "
            f"comparisons of relations, more than the limit of {_MAX_COMPARISONS}; "
            "leave out small objects",
        )
