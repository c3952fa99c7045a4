"""The one place that says how kernels are compiled and where the machine code is kept."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile
from types import FunctionType
from typing import Any, TypeVar

import numba
from numba.core import event
from numba.core.dispatcher import Dispatcher
from platformdirs import user_cache_path

__all__ = ["kernel", "on_compile"]

_CONFIG: Any = numba.config
_Function = TypeVar("_Function", bound=Callable[..., Any])


def kernel(function: _Function) -> _Function:
    """Compile a function with numba: without the GIL, cached on disk, no fast-math.

    Fast-math stays off because it would reorder sums and break agreement with the oracles.

    Parameters
    ----------
    function
        Of a file: what is compiled is kept by the content of that file and of those it uses.

    Returns
    -------
    callable
        The same function, compiled at its first call; with ``NUMBA_DISABLE_JIT=1`` the function
        itself.

    Examples
    --------
    >>> from sketchmatch.model import pair_count
    >>> kernel(pair_count)(8)
    28
    """
    with _caching_in(_cache_folder(function)):
        compiled: _Function = numba.njit(function, cache=True, nogil=True, error_model="numpy")
    return compiled


@contextmanager
def on_compile(listener: Callable[[str], None]) -> Iterator[None]:
    """Call ``listener`` with a function's name whenever numba starts to compile it anew.

    Machine code that is loaded from the cache, or in memory already, does not count.

    Examples
    --------
    >>> from sketchmatch.model import pair_count
    >>> count = kernel(pair_count)
    >>> count(8)
    28
    >>> names = []
    >>> with on_compile(names.append):
    ...     count(9)
    36
    >>> names
    []
    """

    class Listener(event.Listener):
        def on_start(self, happening: event.Event) -> None:
            listener(happening.data["dispatcher"].py_func.__name__)

        def on_end(self, happening: event.Event) -> None:
            pass

    with event.install_listener("numba:compile", Listener()):
        yield


def _cache_folder(function: Callable[..., Any]) -> Path:
    """Return a folder named after all the source that may end up in a function's machine code.

    Numba notices a change in the file of a kernel, but not in what is inlined from other files;
    without this an upgrade could go on running old machine code.
    """
    base = os.environ.get("NUMBA_CACHE_DIR")
    root = Path(base) if base else user_cache_path("sketchmatch", appauthor=False) / "kernels"
    digest = hashlib.sha256(_digest(function).encode())
    for cell in function.__closure__ or ():
        if isinstance(cell.cell_contents, Dispatcher):
            digest.update(_digest(cell.cell_contents.py_func).encode())
    return root / digest.hexdigest()[:16]


def _digest(function: Callable[..., Any]) -> str:
    """Return a digest of a function's file and of the kernels, their makers and constants there."""
    file = function.__code__.co_filename
    if file not in _DIGESTS:
        digest = hashlib.sha256(numba.__version__.encode())
        digest.update(Path(file).read_bytes())
        _DIGESTS[file] = ""  # a file does not count for itself
        for name, value in sorted(function.__globals__.items()):
            if isinstance(value, Dispatcher):
                digest.update(f"{name} {_digest(value.py_func)}".encode())
            elif isinstance(value, FunctionType) and value.__globals__.get("kernel") is kernel:
                digest.update(f"{name} {_digest(value)}".encode())
            elif isinstance(value, bool | int | float | tuple):
                digest.update(f"{name} {value!r}".encode())
        _DIGESTS[file] = digest.hexdigest()[:16]
    return _DIGESTS[file]


_DIGESTS: dict[str, str] = {}
"""By file; at the first kernel of a file all its imports have been made."""


class ByContent:
    """Tells numba where a kernel's machine code is: by all its source, wherever that is installed.

    So another environment, another checkout and an upgrade that changes no kernel find it. It has
    what numba asks of a cache locator; a numba too old to ask keeps code by path as well.
    """

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        self._py_file = file  # numba names it in warnings
        self._place = f"{function.__module__}-{function.__code__.co_firstlineno}"
        self._folder = Path(_CONFIG.CACHE_DIR)

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> ByContent:
        """Return the locator of a function."""
        return cls(function, file)

    def ensure_cache_path(self) -> None:
        """Make the folder, and see that it can be written."""
        _make(self._folder)

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """Return what changes with the source: the folder's name is made of it."""
        return self._folder.name

    def get_disambiguator(self) -> str:
        """Return what tells functions of one name apart: machine code refers to its module."""
        return self._place


@contextmanager
def _caching_in(folder: Path) -> Iterator[None]:
    """Let numba keep machine code in a folder, or where it likes if that cannot be written."""
    before = _CONFIG.CACHE_DIR, getattr(_CONFIG, "CACHE_LOCATOR_CLASSES", "")
    try:
        with suppress(OSError):
            _make(folder)
            _CONFIG.CACHE_DIR = str(folder)
            _CONFIG.CACHE_LOCATOR_CLASSES = f"{ByContent.__module__}.{ByContent.__qualname__}"
        yield
    finally:
        _CONFIG.CACHE_DIR, _CONFIG.CACHE_LOCATOR_CLASSES = before


def _make(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    TemporaryFile(dir=folder).close()
