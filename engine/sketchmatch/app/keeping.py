"""Requests about the scenes that a server keeps."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from google.protobuf.wrappers_pb2 import BytesValue

from sketchmatch.app.following import followed
from sketchmatch.app.scenes import SceneArchive
from sketchmatch.app.shelf import Described, cleaned_title, without_store
from sketchmatch.app.waiting import Caller
from sketchmatch.errors import InvalidInputError, Reason, ServerStoppingError, StoreError
from sketchmatch_proto.v1.scene_service_pb2 import (
    DeleteSceneRequest,
    DeleteSceneResponse,
    GetSceneRequest,
    GetSceneResponse,
    ListScenesRequest,
    ListScenesResponse,
    PutSceneResponse,
    StoredScene,
    UpdateSceneRequest,
    UpdateSceneResponse,
)

if TYPE_CHECKING:
    from sketchmatch.app.application import Application

__all__ = ["Keeping"]

_Result = TypeVar("_Result")


class Keeping:
    """Answers requests about scenes that are kept; the file is used in threads.

    Parameters
    ----------
    app
        Finds objects.
    archive
        Where scenes are kept; None where none are.
    """

    def __init__(self, app: Application, archive: SceneArchive | None) -> None:
        self._app = app
        self._archive = archive
        self._writing: set[asyncio.Future[None]] = set()

    @property
    def path(self) -> Path | None:
        """The archive's file, or None where there is none."""
        return None if self._archive is None else self._archive.path

    async def open(self) -> None:
        """Make the file where there is none; what is wrong with it is told to who needs it."""
        if self._archive is not None:
            with suppress(StoreError):
                await asyncio.to_thread(self._archive.open)

    async def put(self, data: bytes, caller: Caller) -> PutSceneResponse:
        """Find the objects of a source, and keep them; ``data`` is a ``PutSceneRequest``."""
        archive = self._kept("the request")
        await asyncio.to_thread(archive.open)
        while True:
            found, histograms = await self._found(data, caller)
            title = found.stored_scene.title  # of the request: what is kept has none
            found.stored_scene.ClearField("title")
            if found.HasField("source"):
                put = await asyncio.to_thread(archive.put, found, caller.known, title, self._most)
                for packed in histograms:
                    self.keep(packed)
                record, created = put
                return PutSceneResponse(stored_scene=record, created=created)
            name = found.stored_scene.name
            claimed = await asyncio.to_thread(archive.claim, name, caller.known, title, self._most)
            if claimed is not None:
                record, created = claimed
                return PutSceneResponse(stored_scene=record, created=created)
            # It was deleted meanwhile.

    async def get(self, request: GetSceneRequest, caller: Caller) -> GetSceneResponse:
        """Return a scene of a caller."""
        wanted = request.include_source
        return await self._asked(
            request.name, lambda archive: archive.get(request.name, caller.known, wanted)
        )

    async def record(self, name: str, caller: Caller, field: str) -> StoredScene:
        """Return the record of a scene of a caller, for a request that names it in a field."""
        archive = self._kept(field)
        found = await asyncio.to_thread(archive.get, name, caller.known, False, field)
        return found.stored_scene

    async def listed(self, request: ListScenesRequest, caller: Caller) -> ListScenesResponse:
        """Return a part of the list of a caller's scenes."""
        archive = self._kept("the request")
        return await asyncio.to_thread(
            archive.list, caller.known, request.page_size, request.page_token
        )

    async def update(self, request: UpdateSceneRequest, caller: Caller) -> UpdateSceneResponse:
        """Keep a scene of a caller with other labels, or under another title."""
        labels = [(each.object, each.label) for each in request.labels]
        title = cleaned_title(request.title) if request.HasField("title") else None
        most = self._most
        record = await self._asked(
            request.name,
            lambda archive: archive.relabel(request.name, labels, caller.known, title, most),
        )
        return UpdateSceneResponse(stored_scene=record)

    async def delete(self, request: DeleteSceneRequest, caller: Caller) -> DeleteSceneResponse:
        """Forget a scene of a caller."""
        await self._asked(request.name, lambda archive: archive.delete(request.name, caller.known))
        return DeleteSceneResponse()

    def keep(self, packed: bytes) -> None:
        """Keep histograms that a worker hands in, while others are answered."""
        work = asyncio.ensure_future(
            asyncio.to_thread(lambda: self.keep_described(Described.unpacked(packed)))
        )
        self._writing.add(work)
        work.add_done_callback(self._writing.discard)

    def keep_described(self, described: Described) -> None:
        """Keep histograms, in any thread."""
        if self._archive is not None:
            self._archive.keep(described)

    async def close(self) -> None:
        """Write what is to be written, and close the file."""
        await asyncio.gather(*self._writing)
        if self._archive is not None:
            self._archive.close()

    async def _found(self, data: bytes, caller: Caller) -> tuple[GetSceneResponse, list[bytes]]:
        """Return what is in a source, which comes with it unless it is kept, and histograms."""
        with self._app.running("PutSceneRequest", data, caller) as task:
            told = [response async for _, response in followed(task.log)]
        if not told:
            raise ServerStoppingError("the server is about to stop")
        histograms = [BytesValue.FromString(each).value for each in told[1:]]
        return GetSceneResponse.FromString(told[0]), histograms

    @property
    def _most(self) -> int | None:
        """Bytes that a caller may keep."""
        return self._app.setup.limits.max_stored_bytes

    def _kept(self, field: str) -> SceneArchive:
        if self._archive is None:
            raise without_store(field)
        return self._archive

    async def _asked(self, name: str, job: Callable[[SceneArchive], _Result]) -> _Result:
        """Do something with a scene that a request names."""
        archive = self._kept("the request")
        if not name:
            problem = "is not set; give the name of a scene"
            raise InvalidInputError(Reason.MISSING_FIELD, "name", problem)
        return await asyncio.to_thread(job, archive)
