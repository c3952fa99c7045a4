"""A sketch in progress, from the side of who draws it."""

from __future__ import annotations

import reprlib
from collections.abc import AsyncGenerator, Generator, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Self, Unpack

from sketchmatch_client import sources
from sketchmatch_client._requests import MatchOptions, Pins, match_request
from sketchmatch_client.errors import (
    InvalidRequestError,
    NotFoundError,
    async_translated_errors,
    refused_as,
    translated_errors,
)
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest
from sketchmatch_proto.v1.sketch_service_pb2 import (
    CreateSketchRequest,
    DeleteSketchRequest,
    PinSet,
    SketchStroke,
    UpdateSketchRequest,
    UpdateSketchResponse,
    WatchSketchRequest,
    WatchSketchResponse,
)
from sketchmatch_proto.v1.source_pb2 import Source

if TYPE_CHECKING:
    from sketchmatch_client._aio import AsyncClient
    from sketchmatch_client._sync import Client

__all__ = ["AsyncSketch", "Sketch", "create_request", "update_request"]

Strokes = Mapping[str, Iterable[Sequence[float]]]
"""Points of strokes, (x, y) or (x, y, seconds), by the names of the strokes."""


class Sketch:
    """A sketch in progress on a server; delete it, or use it in a ``with`` statement.

    :meth:`Client.sketch` makes it. One thread may draw while another one watches.

    Attributes
    ----------
    id
        Its name on the server.
    """

    def __init__(self, client: Client, id: str) -> None:  # noqa: A002
        self._client = client
        self.id = id

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.delete()

    def update(
        self,
        strokes: Strokes | None = None,
        *,
        erase: Iterable[str] = (),
        restore: int | None = None,
        labels: Mapping[str, str] | None = None,
        pins: Pins | None = None,
        timeout: float | None = None,
    ) -> UpdateSketchResponse:
        """Draw: first a revision is restored, then strokes are erased, then set.

        Parameters
        ----------
        strokes
            Strokes to add or to change, by a name for each.
        erase
            Names of the strokes to erase.
        restore
            A former revision to return to, for undo and redo.
        labels
            Names for people, by the names of strokes in this update.
        pins
            What is known of single objects from now on, as in :class:`MatchOptions`.
        timeout
            Seconds after which the call fails.

        Returns
        -------
        UpdateSketchResponse
            The number of the new revision, and how many strokes it has.
        """
        request = update_request(self.id, strokes or {}, erase, restore, labels or {}, pins)
        return self._client._asked(self._client._drawing.UpdateSketch, request, timeout, retries=0)

    def watch(self, *, timeout: float | None = None) -> Generator[WatchSketchResponse, None, None]:
        """Yield the results of the sketch until it ends: the latest of each kind of event.

        Closing the generator ends it.
        """
        client = self._client
        with translated_errors(client._address):
            call = client._drawing.WatchSketch(
                WatchSketchRequest(sketch_id=self.id),
                timeout=client._limit(timeout),
                metadata=client._metadata,
            )
            try:
                yield from call
            finally:
                call.cancel()

    def delete(self, *, timeout: float | None = None) -> None:
        """End the sketch; no error if it has ended."""
        try:
            self._client._asked(
                self._client._drawing.DeleteSketch, DeleteSketchRequest(sketch_id=self.id), timeout
            )
        except NotFoundError:
            return


class AsyncSketch:
    """As :class:`Sketch`, for asyncio; :meth:`AsyncClient.sketch` makes it."""

    def __init__(self, client: AsyncClient, id: str) -> None:  # noqa: A002
        self._client = client
        self.id = id

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.delete()

    async def update(
        self,
        strokes: Strokes | None = None,
        *,
        erase: Iterable[str] = (),
        restore: int | None = None,
        labels: Mapping[str, str] | None = None,
        pins: Pins | None = None,
        timeout: float | None = None,
    ) -> UpdateSketchResponse:
        """Draw; see :meth:`Sketch.update`."""
        request = update_request(self.id, strokes or {}, erase, restore, labels or {}, pins)
        return await self._client._asked(
            self._client._drawing.UpdateSketch, request, timeout, retries=0
        )

    async def watch(
        self, *, timeout: float | None = None
    ) -> AsyncGenerator[WatchSketchResponse, None]:
        """Yield the results of the sketch until it ends; see :meth:`Sketch.watch`."""
        client = self._client
        async with async_translated_errors(client._address):
            call = client._drawing.WatchSketch(
                WatchSketchRequest(sketch_id=self.id),
                timeout=client._limit(timeout),
                metadata=client._metadata,
            )
            try:
                async for event in call:
                    yield event
            finally:
                call.cancel()

    async def delete(self, *, timeout: float | None = None) -> None:
        """End the sketch; no error if it has ended."""
        request = DeleteSketchRequest(sketch_id=self.id)
        try:
            await self._client._asked(self._client._drawing.DeleteSketch, request, timeout)
        except NotFoundError:
            return


def create_request(
    map: Source,  # noqa: A002
    y_axis: sources.YAxis,
    **options: Unpack[MatchOptions],
) -> CreateSketchRequest:
    """Return the request for a sketch; see :meth:`Client.sketch`."""
    match = match_request(Source(), map, **options)
    match.ClearField("sketch")
    return CreateSketchRequest(
        match=match, y_axis=sources.strokes([], y_axis=y_axis).stroke_set.y_axis
    )


def update_request(
    sketch_id: str,
    strokes: Strokes,
    erase: Iterable[str],
    restore: int | None,
    labels: Mapping[str, str],
    pins: Pins | None,
) -> UpdateSketchRequest:
    """Return the request for a change; see :meth:`Sketch.update`."""
    _check_names(strokes, labels)
    names = list(strokes)
    drawn = sources.strokes(strokes.values(), [labels.get(name) for name in names])
    request = UpdateSketchRequest(sketch_id=sketch_id)
    with refused_as("INVALID_FIELD", "set_strokes", "has a stroke whose name is not text"):
        request.set_strokes.extend(
            SketchStroke(stroke_id=name, stroke=stroke)
            for name, stroke in zip(names, drawn.stroke_set.strokes, strict=True)
        )
    with refused_as("INVALID_FIELD", "erase_strokes", "is not a list of names of strokes"):
        request.erase_strokes.extend([erase] if isinstance(erase, str) else erase)
    with refused_as("INVALID_FIELD", "restore_revision", "is not the number of a revision"):
        if restore is not None:
            request.restore_revision = restore
    if pins is not None:
        known: MatchRequest = match_request(Source(), Source(), pins=pins)
        request.pins.CopyFrom(PinSet(pins=known.pins))
    return request


def _check_names(strokes: Strokes, labels: Mapping[str, str]) -> None:
    if not isinstance(strokes, Mapping):
        problem = f"strokes is {reprlib.repr(strokes)}; give a dict from names to points"
        raise InvalidRequestError(problem, "INVALID_FIELD", "strokes")
    if not isinstance(labels, Mapping):
        problem = f"labels is {reprlib.repr(labels)}; give a dict from names of strokes to labels"
        raise InvalidRequestError(problem, "INVALID_FIELD", "labels")
    for name in labels:
        if name not in strokes:
            problem = (
                f"labels names {reprlib.repr(name)}, which is no stroke of this update; "
                "send its points with its label"
            )
            raise InvalidRequestError(problem, "INVALID_FIELD", "labels")
