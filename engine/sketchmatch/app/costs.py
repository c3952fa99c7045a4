"""What a match would cost, beside what the server lets one cost."""

from __future__ import annotations

from dataclasses import dataclass

from sketchmatch.api import Searcher
from sketchmatch.app.setup import RequestLimits
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import Scene
from sketchmatch.model.relations import pair_count
from sketchmatch.pipeline.request import most_maps
from sketchmatch.pipeline.selection import Pipeline
from sketchmatch.registry import Registry

__all__ = ["Costs"]


@dataclass(frozen=True)
class Costs:
    """Refuses a match whose cost is beyond the limits.

    Attributes
    ----------
    limits
        What a match may cost.
    registry
        Where its algorithms come from.
    """

    limits: RequestLimits
    registry: Registry

    def check(self, pipeline: Pipeline, scenes: tuple[Scene, Scene] | None) -> None:
        """Look at the algorithms of a match, or at two scenes that they are to compare.

        Raises
        ------
        InvalidInputError
            If the match costs too much, with the path of the field that makes it so.
        """
        if scenes is None:
            self._check_candidates(pipeline.searcher)
        else:
            self._check_comparisons(pipeline.histogram.directions, *scenes)

    def _check_candidates(self, searcher: Searcher) -> None:
        if (limit := self.limits.max_candidates) is None:
            return
        candidates = most_maps(searcher, self.registry)
        if candidates is not None and candidates > limit:
            raise InvalidInputError(
                Reason.LIMIT_EXCEEDED,
                "pipeline.searcher.parameters",
                f"let {searcher.name!r} evaluate {candidates} object maps, more than this server's "
                f"limit of {limit}; give values with which it evaluates fewer",
            )

    def _check_comparisons(self, directions: int, sketch: Scene, map_: Scene) -> None:
        if (limit := self.limits.max_comparisons) is None:
            return
        comparisons = pair_count(len(sketch)) * pair_count(len(map_)) * directions
        if comparisons > limit:
            raise InvalidInputError(
                Reason.LIMIT_EXCEEDED,
                "sketch",
                f"has {len(sketch)} objects and the map has {len(map_)}, which makes {comparisons} "
                f"comparisons in {directions} directions, more than this server's limit of "
                f"{limit}; leave out small objects or ask for fewer directions",
            )
