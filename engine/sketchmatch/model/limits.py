"""How large a source may be: the one home of these limits.

They hold for files, for requests and for values made in Python alike, and are checked before the
memory is spent. The defaults are for one machine; the section ``[limits]`` of the configuration
changes them.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache

from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.model.sources import Image, OccupancyGrid, PolygonSet, Source, StrokeSet

__all__ = [
    "SourceLimits",
    "check_bytes",
    "check_objects",
    "check_pixels",
    "check_source",
    "check_vertices",
    "limited_to",
    "source_limits",
]

_MIB = 1024 * 1024
_MILLION = 1_000_000


@dataclass(frozen=True)
class SourceLimits:
    """How large one sketch or one map may be.

    Attributes
    ----------
    max_bytes
        Size of a file, or of a picture or text within a request.
    max_pixels
        Pixels of a picture, cells of a grid.
    max_side
        Pixels along a picture's larger side, cells along a grid's: a sliver takes long.
    max_vertices
        Points of all strokes or polygons together.
    max_objects
        Objects of a scene.

    Raises
    ------
    InvalidInputError
        If one is no whole number that lets something pass.

    Examples
    --------
    >>> SourceLimits(max_objects=50).max_objects
    50
    """

    max_bytes: int = 256 * _MIB
    max_pixels: int = 64 * _MILLION
    max_side: int = 65_535
    max_vertices: int = _MILLION
    max_objects: int = 1000

    def __post_init__(self) -> None:
        for name, least in _LEAST.items():
            _check_limit(name, getattr(self, name), least)

    @property
    def max_elements(self) -> int:
        """Elements of a drawing, counting every repetition: one for every ten vertices."""
        return max(1, self.max_vertices // 10)


_LEAST = {"max_bytes": 1, "max_pixels": 1, "max_side": 1, "max_vertices": 1, "max_objects": 2}

_in_force: ContextVar[SourceLimits | None] = ContextVar("source_limits", default=None)


def source_limits(otherwise: SourceLimits | None = None) -> SourceLimits:
    """Return the limits in force; where nobody put any in force ``otherwise``, or the defaults."""
    return _in_force.get() or otherwise or _defaults()


@cache
def _defaults() -> SourceLimits:
    return SourceLimits()


@contextmanager
def limited_to(limits: SourceLimits) -> Iterator[None]:
    """Put other limits in force for what this thread, or task, does within the block."""
    token = _in_force.set(limits)
    try:
        yield
    finally:
        _in_force.reset(token)


def check_bytes(size: int, field: str, given: str = "") -> None:
    """Refuse a file, or a part of a request, of too many bytes; ``given`` as below.

    Raises
    ------
    InvalidInputError
        With ``field`` as its path, and the limit's name, its value and the remedy.
    """
    limit = source_limits().max_bytes
    if size > limit:
        shown = f"{limit // _MIB} MiB" if limit % _MIB == 0 else f"{limit} bytes"
        raise _beyond(field, given or f"has {size} bytes", shown, "max_bytes", "reduce it")


def check_pixels(width: int, height: int, field: str) -> None:
    """Refuse a picture or a grid of too many pixels or too long, as its header announces it.

    Raises
    ------
    InvalidInputError
        As :func:`check_bytes` does.
    """
    limits, given = source_limits(), f"has {width} × {height} pixels"
    if width * height > limits.max_pixels:
        shown = f"{_counted(limits.max_pixels)} pixels"
        raise _beyond(field, given, shown, "max_pixels", "scale it down")
    if max(width, height) > limits.max_side:
        shown = f"{limits.max_side} pixels along a side"
        raise _beyond(field, given, shown, "max_side", "scale it down")


def check_vertices(count: int, field: str, given: str = "") -> None:
    """Refuse strokes or polygons of too many points; ``given`` says how many, if not plainly.

    Raises
    ------
    InvalidInputError
        As :func:`check_bytes` does.
    """
    limit = source_limits().max_vertices
    if count > limit:
        shown = f"{_counted(limit)} vertices"
        raise _beyond(field, given or f"has {count} vertices", shown, "max_vertices", "simplify it")


def check_objects(count: int, field: str, given: str = "") -> None:
    """Refuse a scene of too many objects; ``given`` says how many, if not plainly.

    Raises
    ------
    InvalidInputError
        As :func:`check_bytes` does.
    """
    limit = source_limits().max_objects
    if count > limit:
        shown = f"{_counted(limit)} objects"
        raise _beyond(
            field, given or f"has {count} objects", shown, "max_objects", "leave out the small ones"
        )


def check_source(source: Source, field: str = "") -> None:
    """Refuse a source that is too large in any way.

    Raises
    ------
    InvalidInputError
        As :func:`check_bytes` does.
    """
    match source:
        case StrokeSet(strokes):
            check_vertices(sum(len(stroke.points) for stroke in strokes), field)
        case PolygonSet(polygons, lines=lines):
            check_objects(len(polygons), field)
            rings = [ring for item in polygons for ring in item.rings]
            check_vertices(sum(map(len, [*rings, *lines])), field)
        case OccupancyGrid(cells):
            check_pixels(cells.shape[1], cells.shape[0], field)
        case Image(pixels):
            check_pixels(pixels.shape[1], pixels.shape[0], field)


def _check_limit(name: str, value: object, least: int) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or value < least:
        problem = f"is {quoted(value)}; give a whole number of at least {least}"
        raise InvalidInputError(Reason.INVALID_PARAMETER, name, problem)


def _counted(number: int) -> str:
    return f"{number // _MILLION} million" if number % _MILLION == 0 else str(number)


def _beyond(field: str, given: str, limit: str, name: str, remedy: str) -> InvalidInputError:
    return InvalidInputError(
        Reason.LIMIT_EXCEEDED,
        field,
        f"{given}, more than the limit of {limit}; {remedy}, or raise limits.{name} "
        f"(SKETCHMATCH_LIMITS__{name.upper()})",
    )
