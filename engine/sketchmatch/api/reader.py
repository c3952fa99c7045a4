"""The interface of readers: from the bytes of a file to a source."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

__all__ = ["Reader"]


class Reader(ABC):
    """Reads files of one kind, such as annotations of a tool.

    Files reach it from the command line, from paths in Python and from requests, as
    ``Source.file``. Helpers for JSON and XML are in :mod:`sketchmatch.api.documents`.

    Attributes
    ----------
    name
        What errors and lists call it: small letters, digits and hyphens.
    summary
        One line for lists.
    suffixes
        Endings of its files' names, in small letters, such as ``".excalidraw"``. If several readers
        match, the longest ending decides; ``.json`` alone is not allowed.
    keys
        Top-level keys of a JSON document of this kind, whatever its name. If several readers match,
        the one with the most keys reads it; empty for other formats.
    source
        The type of what it returns: one of the source types in :mod:`sketchmatch.model`, or a
        subclass of one with more in it. What is of a subclass goes to the segmenter that names
        just that class in its ``sources``, if there is exactly one, unless somebody chooses.

    Examples
    --------
    >>> from sketchmatch.api.documents import load_json
    >>> from sketchmatch.model import LabelledPolygon, PolygonSet
    >>> class Boxes(Reader):
    ...     name = "boxes"
    ...     summary = "Boxes as [x0, y0, x1, y1]."
    ...     keys = ("boxes",)
    ...     source = PolygonSet
    ...
    ...     def read(self, data, part=""):
    ...         boxes = load_json(data.decode())["boxes"]
    ...         return PolygonSet(
    ...             tuple(
    ...                 LabelledPolygon(([[x0, y0], [x1, y0], [x1, y1], [x0, y1]],))
    ...                 for x0, y0, x1, y1 in boxes
    ...             )
    ...         )
    >>> len(Boxes().read(b'{"boxes": [[0, 0, 2, 1], [4, 0, 5, 5]]}').polygons)
    2
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    suffixes: ClassVar[tuple[str, ...]] = ()
    keys: ClassVar[tuple[str, ...]] = ()
    source: ClassVar[type[Any]]

    @abstractmethod
    def read(self, data: bytes, part: str = "") -> Any:
        """Return what a file holds, with y upwards.

        Parameters
        ----------
        data
            The file, no larger than the limit on bytes.
        part
            Which part of it: what follows ``#`` in ``plan.dxf#walls``. Empty for all, or for the
            only one.

        Raises
        ------
        InvalidInputError
            With a path within the file, if it cannot be used or has no such part. Any other
            exception counts as a fault of the reader.
        """
