"""What a match was accepted with, sent again, gives the same result."""

import numpy as np
import pytest

from sketchmatch.app.jobs import Job, answers
from sketchmatch.app.setup import Isolation, RequestLimits, Setup
from sketchmatch.config import builtin
from sketchmatch.pipeline.engine import Engine
from sketchmatch.registry import default_registry
from sketchmatch_client import match_request, sources
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest

BOX = np.array([[0.0, 0.0], [1.0, 0.0], [1.3, 0.7], [0.0, 1.0]])
PLACES = [(3.1 * k, 2.7 * (k * k % 5)) for k in range(7)]
SIZES = (1.0, 1.4, 0.7, 1.8, 1.1, 0.9, 1.5)
REGISTRY = default_registry()
SETUP = Setup(Engine(REGISTRY, builtin().defaults), RequestLimits(), Isolation(frozenset("*")))


def scene(objects, shift=0.0):
    shapes = [SIZES[k] * BOX + PLACES[k] for k in objects]
    return sources.polygons([(ring + shift * np.sin(ring[::-1])).tolist() for ring in shapes])


SKETCH, MAP = scene([0, 1, 2, 3, 4], 0.8), scene([1, 2, 3, 4, 5, 6])


def told(request):
    """Return what a request was accepted with, and its result but for its name and times."""
    events = list(answers(Job("m", request), SETUP))
    result = events[-1].result
    result.statistics.Clear()
    return events[0].accepted, result


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"allow_unmatched": False},
        {"allow_unmatched": True, "unmatched_price": 0.2},
        {"searcher": "exact", "judge": "confidence", "allow_unmatched": True},
        {"searcher": "exact", "judge": "confidence"},
        {"profile": "thesis", "allow_unmatched": True},
        {"profile": "thesis"},
        {"searcher": "fsnn-pso", "seed": 5, "judge": "confidence"},
        {"searcher": "easm", "seed": 2**53 + 1, "weights": (1, 2, 1, 0.5, 0.25, 1)},
        {"histogram": "hybrid", "similarity": "overlap", "pins": {2: None}},
    ],
    ids=str,
)
def test_a_match_is_repeated_by_what_it_was_accepted_with(options):
    accepted, result = told(match_request(SKETCH, MAP, **options))
    again = match_request(SKETCH, MAP, pins=options.get("pins"))
    for field, value in accepted.ListFields():
        if field.name in MatchRequest.DESCRIPTOR.fields_by_name:
            if field.message_type:
                getattr(again, field.name).CopyFrom(value)
            else:
                setattr(again, field.name, value)
    assert told(again) == (accepted, result)
