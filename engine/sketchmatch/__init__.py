"""Match a hand-drawn sketch of a place with a robot's map of it, object by object.

The names below load what they need when they are first used, so that programs that only talk to
a server start without numba and OpenCV.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sketchmatch.errors import InvalidInputError, SketchmatchError
    from sketchmatch.model import Scene
    from sketchmatch.pipeline.compare import Comparison
    from sketchmatch.pipeline.engine import Engine
    from sketchmatch.pipeline.events import Progress
    from sketchmatch.pipeline.knowledge import Pin
    from sketchmatch.pipeline.result import MatchResult
    from sketchmatch.pipeline.words import DirectionalRelation, directional_relation
    from sketchmatch.public import (
        carry,
        compare,
        force_histogram,
        label_force_histograms,
        match,
        read_scene,
        transfer,
    )
    from sketchmatch.transfers.features import Feature
    from sketchmatch.transfers.transfer import TransferResult

__all__ = [
    "Comparison",
    "DirectionalRelation",
    "Engine",
    "Feature",
    "InvalidInputError",
    "MatchResult",
    "Pin",
    "Progress",
    "Scene",
    "SketchmatchError",
    "TransferResult",
    "carry",
    "compare",
    "directional_relation",
    "force_histogram",
    "label_force_histograms",
    "match",
    "read_scene",
    "transfer",
]
__version__ = "0.1.0"

_HOMES = {
    "Comparison": "sketchmatch.pipeline.compare",
    "Engine": "sketchmatch.pipeline.engine",
    "Feature": "sketchmatch.transfers.features",
    "TransferResult": "sketchmatch.transfers.transfer",
    "carry": "sketchmatch.public",
    "compare": "sketchmatch.public",
    "DirectionalRelation": "sketchmatch.pipeline.words",
    "InvalidInputError": "sketchmatch.errors",
    "MatchResult": "sketchmatch.pipeline.result",
    "Pin": "sketchmatch.pipeline.knowledge",
    "Progress": "sketchmatch.pipeline.events",
    "Scene": "sketchmatch.model",
    "SketchmatchError": "sketchmatch.errors",
    "directional_relation": "sketchmatch.pipeline.words",
    "force_histogram": "sketchmatch.public",
    "label_force_histograms": "sketchmatch.public",
    "match": "sketchmatch.public",
    "read_scene": "sketchmatch.public",
    "transfer": "sketchmatch.public",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'sketchmatch' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    """Return the names that a prompt completes, those yet to be loaded too."""
    return sorted({*globals(), *__all__})
