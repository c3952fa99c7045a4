"""Ask a sketchmatch server which sketched object is which object on a robot's map.

:class:`Client` and :class:`AsyncClient` offer the same calls; :mod:`sketchmatch_client.sources`
makes sketches and maps to hand to them, and :mod:`sketchmatch_client.features` points, routes and
zones that are carried between them.
"""

from sketchmatch_client import features, sources
from sketchmatch_client._access import AccessOptions
from sketchmatch_client._aio import AsyncClient
from sketchmatch_client._call import MatchCall
from sketchmatch_client._match import Match, MatchCollector, Progress
from sketchmatch_client._requests import MatchOptions, Pin, match_request, segment_request
from sketchmatch_client._sketch import AsyncSketch, Sketch
from sketchmatch_client._summary import summary
from sketchmatch_client._sync import Client
from sketchmatch_client._transfer import TransferOptions, transfer_request
from sketchmatch_client.errors import (
    CallCancelledError,
    DeadlineExceededError,
    InvalidRequestError,
    NotAuthenticatedError,
    NotFoundError,
    NotSupportedError,
    ServerBusyError,
    ServerFailedError,
    ServerUnavailableError,
    SketchmatchError,
    StoreError,
)
from sketchmatch_views import MatchRow

__all__ = [
    "AccessOptions",
    "AsyncClient",
    "AsyncSketch",
    "CallCancelledError",
    "Client",
    "DeadlineExceededError",
    "InvalidRequestError",
    "Match",
    "MatchCall",
    "MatchCollector",
    "MatchOptions",
    "MatchRow",
    "NotAuthenticatedError",
    "NotFoundError",
    "NotSupportedError",
    "Pin",
    "Progress",
    "ServerBusyError",
    "ServerFailedError",
    "ServerUnavailableError",
    "Sketch",
    "SketchmatchError",
    "StoreError",
    "TransferOptions",
    "features",
    "match_request",
    "segment_request",
    "sources",
    "summary",
    "transfer_request",
]

__version__ = "0.1.0"
