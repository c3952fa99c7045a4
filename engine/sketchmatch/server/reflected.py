"""The contract as servers describe it to clients that ask by reflection."""

from __future__ import annotations

from typing import Any

from google.protobuf import descriptor_pool

__all__ = ["Reflected"]


class Reflected:
    """Protobuf's pool of all descriptors, in which methods are found by their names too.

    The protocol of reflection wants that, and clients such as ghz ask so.

    Examples
    --------
    >>> from sketchmatch_proto.v1 import catalog_service_pb2
    >>> Reflected().FindFileContainingSymbol("sketchmatch.v1.CatalogService.GetServerInfo").name
    'sketchmatch/v1/catalog_service.proto'
    """

    def __init__(self) -> None:
        self._pool: Any = descriptor_pool.Default()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._pool, name)

    def FindFileContainingSymbol(self, symbol: str) -> Any:  # noqa: N802
        """Return the file in which something is declared; raises KeyError where nothing is."""
        try:
            return self._pool.FindFileContainingSymbol(symbol)
        except KeyError:
            return self._pool.FindMethodByName(symbol).containing_service.file
