"""The one place that says how kernels are compiled and where the machine code is kept."""

# mypy: disallow-untyped-calls=False, disallow-untyped-decorators=False
# (much of numba has no types)

from __future__ import annotations

import hashlib
import logging
import os
import pickle
import stat
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from tempfile import gettempdir
from types import FunctionType
from typing import Any, TypeVar
from uuid import uuid4

import numba
from numba.core import entrypoints, event, types
from numba.core.caching import FunctionCache
from numba.core.compiler import CompileResult
from numba.core.dispatcher import Dispatcher
from numba.core.imputils import impl_ret_borrowed
from numba.core.serialize import dumps
from numba.extending import lower_builtin, type_callable
from numpy.typing import NDArray
from platformdirs import user_cache_path

__all__ = ["kernel", "on_compile", "read_only"]

_log = logging.getLogger(__name__)
_Function = TypeVar("_Function", bound=Callable[..., Any])
_Item = TypeVar("_Item", bound=Any)

# Before numba compiles it reads what each installed distribution says of itself, and raises what
# a broken one makes of that; but only once.
with suppress(Exception):
    entrypoints.init_all()


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
    options: Any = {"no_cfunc_wrapper": True}  # nothing but Python and kernels calls them
    compiled: Any = numba.njit(function, nogil=True, error_model="numpy", **options)
    if isinstance(compiled, Dispatcher):
        compiled._cache = _Cache(function)  # type: ignore[attr-defined]
    return compiled  # type: ignore[no-any-return]


def read_only(array: NDArray[_Item]) -> NDArray[_Item]:
    """Return an array, in kernels as one that is not written to, as values of the model have them.

    A kernel is compiled anew where an array may be written to, though it does not write to it.
    """
    return array


@type_callable(read_only)
def _type_of_read_only(_: Any) -> Any:
    def typed(array: Any) -> Any:
        return array.copy(readonly=True) if isinstance(array, types.Array) else None

    return typed


@lower_builtin(read_only, types.Array)
def _lower_read_only(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    return impl_ret_borrowed(context, builder, signature.return_type, arguments[0])


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


class _Cache(FunctionCache):
    """Where numba finds the machine code of a kernel, and puts it.

    It is named after all its source, wherever that is installed: so another environment, another
    checkout and an upgrade that changes no kernel find it. A file that is damaged or cannot be read
    is as good as none. Where none can be written, machine code lasts as long as the process.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._py_func = function
        self._name = f"{function.__name__}-{_source_digest(function)}.code"
        self.enable()

    @property
    def cache_path(self) -> str:
        """A folder for numba's statistics."""
        return str(next(_folders(), ""))

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the kernel compiled for some types, or None."""
        target_context.refresh()
        key = self._index_key(sig, target_context.codegen())
        for folder in _folders():
            if packed := _read(folder / self._name).get(key):
                with suppress(Exception):  # of what this numba cannot use, whatever that raises
                    return CompileResult._rebuild(target_context, *pickle.loads(packed))
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the kernel compiled for some types where that can be done."""
        if data.library.has_dynamic_globals:
            return  # it refers to memory of this process
        key, packed = self._index_key(sig, data.codegen), dumps(data._reduce())
        problem = ""
        for folder in _folders():
            file = folder / self._name
            try:
                _write(file, {**_read(file), key: packed})
            except OSError as error:
                problem = problem or f"in {folder} ({error.strerror})"
            else:
                if folder != _usual_folder():
                    _tell(problem, f"keeps them in {folder}")
                return
        _tell(problem, "compiles them at each start")


@cache
def _tell(problem: str, consequence: str) -> None:
    """Say once that kernels are not kept where they should be."""
    _log.warning(
        "sketchmatch cannot keep compiled kernels %s and %s; "
        "NUMBA_CACHE_DIR can name a folder that can be written",
        problem or "in a home folder, because there is none,",
        consequence,
    )


def _folders() -> Iterator[Path]:
    """Yield the folders where machine code may be, the best first."""
    if (usual := _usual_folder()) is not None:
        yield usual
    if (temporary := _temporary_folder()) is not None:
        yield temporary


def _usual_folder() -> Path | None:
    """Return the folder that the environment names, or else the user's; None without a home."""
    if given := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(given)
    try:
        own = user_cache_path("sketchmatch", appauthor=False) / "kernels"
    except RuntimeError:
        return None
    return own if own.is_absolute() else None  # an older platformdirs says ~/.cache


def _temporary_folder() -> Path | None:
    """Return a temporary folder that is this user's alone, because what is in it is executed."""
    user = os.getuid() if hasattr(os, "getuid") else None
    try:
        folder = Path(gettempdir()) / ("sketchmatch" if user is None else f"sketchmatch-{user}")
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return None
    if user is None:  # where each user has a temporary folder anyway
        return folder
    private = stat.S_ISDIR(found.st_mode) and not found.st_mode & 0o077
    return folder if private and found.st_uid == user else None


def _read(file: Path) -> dict[Any, bytes]:
    """Return what a file holds, packed, by numba's key; nothing if it is not as it was written."""
    try:
        content = file.read_bytes()
        digest, held = content[:_DIGEST_BYTES], content[_DIGEST_BYTES:]
        return pickle.loads(held) if hashlib.sha256(held).digest() == digest else {}
    except Exception:  # it may name what is no longer there
        return {}


def _write(file: Path, held: dict[Any, bytes]) -> None:
    """Write a file so that others find it whole or not at all."""
    content = dumps(held)
    file.parent.mkdir(parents=True, exist_ok=True)
    beside = file.with_name(f"{uuid4().hex}.part")
    try:
        beside.write_bytes(hashlib.sha256(content).digest() + content)
        beside.replace(file)
    finally:
        beside.unlink(missing_ok=True)


_DIGEST_BYTES = hashlib.sha256().digest_size


def _source_digest(function: Callable[..., Any]) -> str:
    """Return a digest of all the source that may end up in a function's machine code.

    Numba would notice a change in the file of a kernel, but not in what is inlined from other
    files, and an upgrade could go on running old machine code.
    """
    digest = hashlib.sha256(_digest(function).encode())
    for cell in function.__closure__ or ():
        if isinstance(cell.cell_contents, Dispatcher):
            digest.update(_digest(cell.cell_contents.py_func).encode())
    # Machine code refers to its module, and numba packs it by the rules of one Python.
    place = (sys.implementation.cache_tag, function.__module__, function.__code__.co_firstlineno)
    digest.update(repr(place).encode())
    return digest.hexdigest()[:24]


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
