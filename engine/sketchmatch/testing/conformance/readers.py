"""Contracts of readers of files."""

from __future__ import annotations

import inspect
import json
from collections.abc import Iterator
from typing import Any, get_args

from sketchmatch.api import InvalidInputError
from sketchmatch.model import Source
from sketchmatch.testing.conformance.contract import Contract, require

__all__ = ["CONTRACTS"]

_NO_FILES = (
    b"",
    b"\0" * 64,
    b"\xff\xfe\xfa",
    b"{",
    b"{}",
    b"[]",
    b"null",
    b"<svg/>",
    b"one\ntwo\n",
)
_VALUES: tuple[Any, ...] = (None, [], {}, "text", 7, [None], [[]], [{}])


def source_is_known(reader: type[Any]) -> None:
    """Have a ``source`` that is StrokeSet, PolygonSet, OccupancyGrid, Image, or a subclass."""
    source = getattr(reader, "source", None)
    known = isinstance(source, type) and issubclass(source, get_args(Source))
    require(known, f"source is {source!r}")


def read_takes_a_file_and_a_part(reader: type[Any]) -> None:
    """Have a method ``read`` that takes the bytes of a file and the name of a part."""
    signature = inspect.signature(reader.read)
    try:
        signature.bind(None, b"", "")
    except TypeError as error:
        require(False, f"read{signature} cannot be called with a file and a part: {error}")


def what_is_no_such_file_is_refused(reader: type[Any]) -> None:
    """Refuse by InvalidInputError, in one line, what is no file of this kind, or read a source."""
    for data in (*_NO_FILES, *_documents(reader)):
        shown = repr(data[:40])
        try:
            found = reader().read(data, "")
        except InvalidInputError as error:
            require("\n" not in str(error), f"of {shown}, it says {str(error)!r}")
            continue
        fits = isinstance(found, reader.source)
        require(fits, f"of {shown}, it returned a {type(found).__name__}")


def _documents(reader: type[Any]) -> Iterator[bytes]:
    """Yield JSON that has the keys by which a reader is chosen, and nothing of use under them."""
    keys = tuple(getattr(reader, "keys", ()))
    for value in _VALUES if keys else ():
        yield json.dumps(dict.fromkeys(keys, value)).encode()


CONTRACTS: tuple[Contract, ...] = (
    source_is_known,
    read_takes_a_file_and_a_part,
    what_is_no_such_file_is_refused,
)
