"""The one place that says how kernels are compiled and where the machine code is kept."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import event
from platformdirs import user_cache_path

__all__ = ["kernel", "on_compile"]

_Function = TypeVar("_Function", bound=Callable[..., Any])


def kernel(function: _Function) -> _Function:
    """Compile a function with numba: without the GIL, cached on disk, no fast-math.

    Fast-math stays off because it would reorder sums and break agreement with the oracles.
    """
    with _cache_in(_cache_folder()):
        compiled: _Function = numba.njit(function, cache=True, nogil=True, error_model="numpy")
    return compiled


@contextmanager
def on_compile(listener: Callable[[str], None]) -> Iterator[None]:
    """Call ``listener`` with a function's name whenever numba starts to compile it anew.

    Machine code that is loaded from the cache does not count.
    """

    class Listener(event.Listener):
        def on_start(self, happening: event.Event) -> None:
            listener(happening.data["dispatcher"].py_func.__name__)

        def on_end(self, happening: event.Event) -> None:
            pass

    with event.install_listener("numba:compile", Listener()):
        yield


def _cache_folder() -> Path:
    """Return a folder named after the source of all kernels.

    Numba notices a change in a kernel's own file, but not in the kernels that it inlines from
    other files; without this an upgrade could go on running the old ones.
    """
    base = os.environ.get("NUMBA_CACHE_DIR")
    root = Path(base) if base else user_cache_path("sketchmatch", appauthor=False) / "kernels"
    return root / _SOURCE_DIGEST


def _source_digest() -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


_SOURCE_DIGEST = _source_digest()


@contextmanager
def _cache_in(folder: Path) -> Iterator[None]:
    config: Any = numba.config
    before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
    try:
        yield
    finally:
        config.CACHE_DIR = before
