"""What a match would cost, beside what the server lets one cost."""

from __future__ import annotations

from sketchmatch.app.setup import RequestLimits
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import Scene
from sketchmatch.model.relations import pair_count
from sketchmatch.pipeline.describe import with_directions
from sketchmatch.pipeline.events import Accepted, MatchEvent, Segmented
from sketchmatch.pipeline.selection import Pipeline
from sketchmatch.registry import Registry

__all__ = ["Costs"]


class Costs:
    """Refuses a match whose cost, as its events tell it, is beyond the limits.

    Parameters
    ----------
    limits
        What a match may cost.
    registry
        Where its algorithms come from.
    """

    def __init__(self, limits: RequestLimits, registry: Registry) -> None:
        self._limits = limits
        self._registry = registry
        self._pipeline: Pipeline | None = None

    def check(self, event: MatchEvent) -> None:
        """Look at the next event.

        Raises
        ------
        InvalidInputError
            If the match costs too much, with the path of the field that makes it so.
        """
        match event:
            case Accepted():
                self._pipeline = event.pipeline
                self._check_candidates(event.pipeline)
            case Segmented() if self._pipeline is not None:
                self._check_comparisons(self._pipeline, event.sketch.scene, event.map.scene)

    def _check_candidates(self, pipeline: Pipeline) -> None:
        limit, parameters = self._limits.max_candidates, pipeline.searcher.params
        generations = getattr(parameters, "generations", None)
        population = getattr(parameters, "population", None) or 1
        if limit is None or not isinstance(generations, int) or not isinstance(population, int):
            return
        if (candidates := population * generations) > limit:
            raise InvalidInputError(
                Reason.LIMIT_EXCEEDED,
                "pipeline.searcher.parameters.generations",
                f"is {generations}, which makes {candidates} maps to weigh with a population of "
                f"{population}, more than this server's limit of {limit}; ask for fewer of either",
            )

    def _check_comparisons(self, pipeline: Pipeline, sketch: Scene, map_: Scene) -> None:
        if (limit := self._limits.max_comparisons) is None:
            return
        directions = with_directions(pipeline.histogram, self._registry, sketch, map_).directions
        comparisons = pair_count(len(sketch)) * pair_count(len(map_)) * directions
        if comparisons > limit:
            raise InvalidInputError(
                Reason.LIMIT_EXCEEDED,
                "sketch",
                f"has {len(sketch)} objects and the map {len(map_)}, which makes {comparisons} "
                f"comparisons in {directions} directions, more than this server's limit of "
                f"{limit}; leave out small objects or ask for fewer directions",
            )
