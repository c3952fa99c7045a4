"""What all workers need, loaded once: importing this module in the process they are forked from.

So a new worker is warm within milliseconds, and most of its memory is shared with the others.
"""

from __future__ import annotations

import gc
import logging
import os

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
    from sketchmatch.app.worker import leave_signals_to_the_server
    from sketchmatch.kernels._jit import on_compile
    from sketchmatch.pipeline.warmup import warm_up
    from sketchmatch.registry import PluginRules, discover

    leave_signals_to_the_server()
    try:
        with on_compile(_refuse):
            warm_up(discover(rules=PluginRules.of(allow=())))
    except _NotCompiledError:
        return
    except Exception:
        logging.getLogger(__name__).exception("workers will load what they need themselves")


_load()
gc.collect()
gc.freeze()  # or each collection would copy the memory that is shared
