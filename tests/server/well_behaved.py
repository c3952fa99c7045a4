"""A plugin, as third parties distribute them, in plain Python and true to its contract."""

import os
import time

from pydantic import Field

from sketchmatch.api import (
    InvalidInputError,
    Outcome,
    Params,
    Reason,
    Searcher,
    SearchProgress,
    Segmenter,
    hookimpl,
)
from sketchmatch.model import Fmap, PolygonSet
from sketchmatch.pipeline.correspond import fmap_confidence
from sketchmatch_builtin.segmenters.polygons import PolygonSegmenter

sketchmatch_api_version = 1


class Guessing(Searcher):
    """Tries object maps by chance."""

    name = "guessing"
    summary = "Random object maps; the note tells the process."

    class Params(Params):
        """How long to try."""

        tries: int = Field(300, ge=1, description="Number of maps.")
        pause: float = Field(0.0, ge=0, description="Pause after each.")

    def search(self, problem, rng):
        table, best = problem.table, None
        for k in range(1, self.params.tries + 1):
            partners = rng.permutation(table.argument_objects)[: table.template_objects]
            fmap = Fmap.from_object_map(partners, table.argument_objects)
            confidence = fmap_confidence(fmap, table, problem.weights).total
            if best is None or confidence > best.confidence:
                best = SearchProgress(fmap, confidence, k, k, note=f"process {os.getpid()}")
            yield best
            time.sleep(self.params.pause)
        return Outcome.ITERATION_LIMIT


class Compiling(Guessing):
    name = "compiling"
    summary = "The same, which takes a while before the first search of a process."

    @classmethod
    def warm_up(cls):
        time.sleep(0.8)


class SamePolygons(PolygonSegmenter):
    name = "same-polygons"
    summary = "Every polygon is one object."


class Refusing(Segmenter):
    """Refuses everything."""

    name = "refusing"
    summary = "Finds nothing in anything."
    sources = (PolygonSet,)

    def segment(self, source):
        del source
        raise InvalidInputError(Reason.TOO_FEW_OBJECTS, "polygons[0]", "is not to my liking")


@hookimpl
def sketchmatch_register_searchers():
    return [Guessing, Compiling]


@hookimpl
def sketchmatch_register_segmenters():
    return [SamePolygons, Refusing]
