"""What all workers need, loaded once: importing this module in the process they are forked from.

So a new worker is warm within milliseconds, and most of its memory is shared with the others.
"""

from __future__ import annotations

import gc
import logging
import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sketchmatch.registry import Registry

__all__: list[str] = []


class _NotCompiledError(BaseException):
    """A kernel is not in the cache."""


def _refuse(_: str) -> None:
    raise _NotCompiledError


def _load() -> None:
    """Load engine and kernels; those that have to be compiled are left to the first worker."""
    # Before NumPy is imported: workers share the processors, and its threads would wait for them.
    for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    from sketchmatch.app.worker import heed_no_signals, registry_of
    from sketchmatch.kernels._jit import on_compile
    from sketchmatch.pipeline.warmup import warm_up

    heed_no_signals()
    try:
        with on_compile(_refuse):
            registry = registry_of(())
            warm_up(registry)
            _rehearse(registry)
    except _NotCompiledError:
        return
    except Exception:
        logging.getLogger(__name__).exception(
            "loading ahead for all workers failed; each worker loads what it needs itself"
        )


def _rehearse(registry: Registry) -> None:
    """Match once, since much else is loaded when it is first used."""
    from sketchmatch.app.jobs import Job, answers
    from sketchmatch.app.setup import Setup
    from sketchmatch.pipeline.engine import Engine
    from sketchmatch_proto.v1.match_service_pb2 import MatchRequest
    from sketchmatch_proto.v1.source_pb2 import LabelledPolygon, Point, PolygonSet, Ring, Source

    corners = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
    polygons = [
        LabelledPolygon(rings=[Ring(points=[Point(x=x + at, y=y + at**2) for x, y in corners])])
        for at in (0.0, 3.0, 5.0, 8.0)
    ]
    source = Source(polygon_set=PolygonSet(polygons=polygons))
    for _ in answers(Job("", MatchRequest(sketch=source, map=source)), Setup(Engine(registry))):
        pass


_load()
gc.collect()
gc.freeze()  # or each collection would copy the memory that is shared
