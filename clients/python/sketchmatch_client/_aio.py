"""The client for asyncio."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import AsyncGenerator, Awaitable, Callable, Iterable, Mapping
from contextlib import aclosing
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self, TypeVar, Unpack, cast

import grpc
import grpc.aio
from google.protobuf.message import Message

from sketchmatch_client import _scenes
from sketchmatch_client._access import AccessOptions, access_to
from sketchmatch_client._channel import (
    CHECK_HEALTH,
    HEALTH_POLL_SECONDS,
    SERVING,
    ChannelOptions,
    channel_options,
    health_request,
    limit_of,
    never_served,
    no_such_part,
    within,
)
from sketchmatch_client._course import Course, watched
from sketchmatch_client._match import Match, MatchCollector, ProgressCallback, tell_progress
from sketchmatch_client._requests import MatchOptions, match_request, segment_request
from sketchmatch_client._retry import Attempts, Counted, checked_retries
from sketchmatch_client._sketch import AsyncSketch, create_request
from sketchmatch_client._transfer import TransferOptions, transfer_request
from sketchmatch_client.errors import (
    DeadlineExceededError,
    NotFoundError,
    ServerUnavailableError,
    SketchmatchError,
    async_translated_errors,
)
from sketchmatch_client.sources import YAxis
from sketchmatch_proto.v1.catalog_service_pb2 import (
    GetServerInfoRequest,
    GetServerInfoResponse,
    ListAlgorithmsRequest,
    ListAlgorithmsResponse,
)
from sketchmatch_proto.v1.catalog_service_pb2_grpc import CatalogServiceStub
from sketchmatch_proto.v1.match_service_pb2 import (
    CancelMatchRequest,
    GetMatchRequest,
    GetMatchResponse,
    ListMatchesRequest,
    MatchResponse,
    MatchSummary,
)
from sketchmatch_proto.v1.match_service_pb2_grpc import MatchServiceStub
from sketchmatch_proto.v1.scene_service_pb2 import (
    GetSceneResponse,
    ListScenesRequest,
    PutSceneResponse,
    SceneSummary,
    SegmentResponse,
    StoredScene,
)
from sketchmatch_proto.v1.scene_service_pb2_grpc import SceneServiceStub
from sketchmatch_proto.v1.sketch_service_pb2_grpc import SketchServiceStub
from sketchmatch_proto.v1.source_pb2 import Source
from sketchmatch_proto.v1.transfer_service_pb2 import Feature, TransferResponse
from sketchmatch_proto.v1.transfer_service_pb2_grpc import TransferServiceStub

if TYPE_CHECKING:  # these exist for type checkers alone
    from sketchmatch_proto.v1.catalog_service_pb2_grpc import CatalogServiceAsyncStub
    from sketchmatch_proto.v1.match_service_pb2_grpc import MatchServiceAsyncStub
    from sketchmatch_proto.v1.scene_service_pb2_grpc import SceneServiceAsyncStub
    from sketchmatch_proto.v1.sketch_service_pb2_grpc import SketchServiceAsyncStub
    from sketchmatch_proto.v1.transfer_service_pb2_grpc import TransferServiceAsyncStub

__all__ = ["AsyncClient"]

_Answer = TypeVar("_Answer")


class AsyncClient:
    """As :class:`Client`, for asyncio; close it, or use it in an ``async with`` statement.

    It belongs to the event loop of its first call.

    Parameters
    ----------
    address, credentials, timeout, retries, options, **access
        As for :class:`Client`.

    Raises
    ------
    SketchmatchError
        From every call: :mod:`sketchmatch_client.errors` has one class for each way to react.
    """

    def __init__(
        self,
        address: str,
        *,
        credentials: grpc.ChannelCredentials | None = None,
        timeout: float | None = None,
        retries: int = 3,
        options: ChannelOptions = (),
        **access: Unpack[AccessOptions],
    ) -> None:
        way_in = access_to(address, credentials, access)
        self._address = address
        self._credentials = way_in.credentials
        self._metadata = way_in.metadata
        self._timeout = limit_of(timeout)
        self._retries = checked_retries(retries)
        self._options = channel_options(address, way_in.options + options)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connection; calls in progress end."""
        await self._channel.close()

    async def match(
        self,
        sketch: Source,
        map: Source,  # noqa: A002
        *,
        on_progress: ProgressCallback | None = None,
        timeout: float | None = None,
        **options: Unpack[MatchOptions],
    ) -> Match:
        """Match a sketch with a map and wait for the answer; see :meth:`Client.match`."""
        collector = MatchCollector(None)
        async with aclosing(self.events(sketch, map, timeout=timeout, **options)) as events:
            async for event in events:
                collector.add(event)
                tell_progress(event, on_progress)
        return collector.match()

    def events(
        self,
        sketch: Source,
        map: Source,  # noqa: A002
        *,
        timeout: float | None = None,
        **options: Unpack[MatchOptions],
    ) -> AsyncGenerator[MatchResponse, None]:
        """Match a sketch with a map, event by event; see :meth:`Client.events`.

        Closing the generator cancels the match. Leaving a loop over it does not close it at once;
        ``contextlib.aclosing`` does.
        """
        request = match_request(sketch, map, **options)
        return self._events(Course(request), self._limit(timeout))

    def watch(
        self, match_id: str, after: int = 0, *, timeout: float | None = None
    ) -> AsyncGenerator[MatchResponse, None]:
        """Read one of the caller's earlier matches; see :meth:`Client.watch`."""
        return self._events(watched(match_id, after), self._limit(timeout))

    async def get_match(self, match_id: str, *, timeout: float | None = None) -> GetMatchResponse:
        """Return the state of one of the caller's matches; see :meth:`Client.get_match`."""
        request = GetMatchRequest(match_id=match_id)
        return await self._asked(self._matching.GetMatch, request, timeout)

    async def cancel_match(self, match_id: str, *, timeout: float | None = None) -> MatchSummary:
        """Stop one of the caller's matches; see :meth:`Client.cancel_match`."""
        request = CancelMatchRequest(match_id=match_id)
        answer = await self._asked(self._matching.CancelMatch, request, timeout)
        return answer.match

    async def matches(self, *, timeout: float | None = None) -> AsyncGenerator[MatchSummary, None]:
        """Yield all of the caller's matches, the latest first; see :meth:`Client.matches`."""
        request = ListMatchesRequest()
        while True:
            page = await self._asked(self._matching.ListMatches, request, timeout)
            for match in page.matches:
                yield match
            if not page.next_page_token:
                return
            request.page_token = page.next_page_token

    async def segment(
        self,
        source: Source,
        *,
        segmenter: str | None = None,
        params: Mapping[str, Any] | None = None,
        profile: str | None = None,
        include_map: bool = False,
        timeout: float | None = None,
    ) -> SegmentResponse:
        """Find the objects of one source, without a match; see :meth:`Client.segment`."""
        request = segment_request(source, segmenter, params, profile, include_map)
        return await self._asked(self._keeping.Segment, request, timeout)

    async def put_scene(
        self,
        source: Source,
        *,
        segmenter: str | None = None,
        params: Mapping[str, Any] | None = None,
        profile: str | None = None,
        title: str = "",
        timeout: float | None = None,
    ) -> PutSceneResponse:
        """Store a scene on the server; see :meth:`Client.put_scene`."""
        request = _scenes.put_request(source, segmenter, params, profile, title)
        return await self._asked(self._keeping.PutScene, request, timeout)

    async def get_scene(
        self, name: str, *, include_source: bool = False, timeout: float | None = None
    ) -> GetSceneResponse:
        """Return a scene that the caller has put, with its source if requested."""
        request = _scenes.get_request(name, include_source)
        return await self._asked(self._keeping.GetScene, request, timeout)

    async def list_scenes(self, *, timeout: float | None = None) -> list[SceneSummary]:
        """Return summaries of all scenes that the caller has put, the latest first."""
        found, request = list[SceneSummary](), ListScenesRequest()
        while True:
            page = await self._asked(self._keeping.ListScenes, request, timeout)
            found.extend(page.scenes)
            if not page.next_page_token:
                return found
            request.page_token = page.next_page_token

    async def update_scene(
        self,
        name: str,
        labels: Mapping[int, str] | None = None,
        *,
        title: str | None = None,
        timeout: float | None = None,
    ) -> StoredScene:
        """Change labels or title of a stored scene; see :meth:`Client.update_scene`."""
        request = _scenes.update_request(name, labels, title)
        return (await self._asked(self._keeping.UpdateScene, request, timeout)).stored_scene

    async def delete_scene(self, name: str, *, timeout: float | None = None) -> None:
        """Delete a scene; it stays for other callers who have put it."""
        deletion = Counted(self._keeping.DeleteScene)
        try:
            await self._asked(deletion, _scenes.delete_request(name), timeout)
        except NotFoundError:
            if deletion.asked == 1:
                raise
            # It is gone by a request whose answer was lost.

    async def sketch(
        self,
        map: Source,  # noqa: A002
        *,
        y_axis: YAxis = "up",
        timeout: float | None = None,
        **options: Unpack[MatchOptions],
    ) -> AsyncSketch:
        """Start a sketch that is matched while it is drawn; see :meth:`Client.sketch`."""
        request = create_request(map, y_axis, **options)
        made = await self._asked(self._drawing.CreateSketch, request, timeout)
        return AsyncSketch(self, made.sketch_id)

    async def transfer(
        self,
        sketch: Source,
        map: Source,  # noqa: A002
        features: Iterable[Feature] = (),
        *,
        timeout: float | None = None,
        **options: Unpack[TransferOptions],
    ) -> TransferResponse:
        """Transfer points, routes and zones; see :meth:`Client.transfer`."""
        request = transfer_request(sketch, map, features, **options)
        stub = cast("TransferServiceAsyncStub", TransferServiceStub(self._channel))
        return await self._asked(stub.Transfer, request, timeout)

    async def algorithms(self, *, timeout: float | None = None) -> ListAlgorithmsResponse:
        """Return the algorithms that the server offers, its profiles and its plugins."""
        stub = cast("CatalogServiceAsyncStub", CatalogServiceStub(self._channel))
        request = ListAlgorithmsRequest()
        return await self._asked(stub.ListAlgorithms, request, timeout)

    async def server_info(self, *, timeout: float | None = None) -> GetServerInfoResponse:
        """Return the server's versions and limits."""
        stub = cast("CatalogServiceAsyncStub", CatalogServiceStub(self._channel))
        request = GetServerInfoRequest()
        return await self._asked(stub.GetServerInfo, request, timeout)

    async def is_serving(self, name: str = "", *, timeout: float | None = None) -> bool:
        """Return whether the server, or a part of it, is warm; see :meth:`Client.is_serving`."""
        check: grpc.aio.UnaryUnaryMultiCallable[bytes, bytes] = self._channel.unary_unary(
            CHECK_HEALTH
        )
        async with async_translated_errors(self._address):
            try:
                answer = await check(health_request(name), timeout=self._limit(timeout))
            except grpc.RpcError as error:
                if error.code() is grpc.StatusCode.NOT_FOUND:
                    raise no_such_part(name) from error
                raise
        return answer == SERVING

    async def wait_until_serving(self, timeout: float = 60.0) -> None:
        """Wait until the server is up and warm; see :meth:`Client.wait_until_serving`."""
        limit = limit_of(timeout)
        deadline = time.monotonic() + (math.inf if limit is None else limit)
        while not await self._serves_by(within(deadline, time.monotonic())):
            if time.monotonic() >= deadline:
                raise never_served(self._address, timeout)
            await asyncio.sleep(HEALTH_POLL_SECONDS)

    @cached_property
    def _channel(self) -> grpc.aio.Channel:
        """The channel, made within the loop that is to run it."""
        if self._credentials is None:
            return grpc.aio.insecure_channel(self._address, self._options)
        return grpc.aio.secure_channel(self._address, self._credentials, self._options)

    @property
    def _matching(self) -> MatchServiceAsyncStub:
        return cast("MatchServiceAsyncStub", MatchServiceStub(self._channel))

    @property
    def _keeping(self) -> SceneServiceAsyncStub:
        return cast("SceneServiceAsyncStub", SceneServiceStub(self._channel))

    @property
    def _drawing(self) -> SketchServiceAsyncStub:
        return cast("SketchServiceAsyncStub", SketchServiceStub(self._channel))

    async def _events(
        self, course: Course, limit: float | None
    ) -> AsyncGenerator[MatchResponse, None]:
        attempts = Attempts(self._retries, limit)
        while True:
            try:
                async with async_translated_errors(self._address):
                    call = self._begun(course, attempts.limit)
                    try:
                        async for response in call:
                            attempts.succeeded()
                            if (event := course.take(response)) is not None:
                                yield event
                    finally:
                        call.cancel()
                return
            except SketchmatchError as error:
                if course.ends(error):
                    return
                pause = course.pause_after(error, attempts)
                if pause is None:
                    raise
            await asyncio.sleep(pause)

    def _begun(self, course: Course, seconds: float | None) -> Any:
        """Return the call that tells of a match from where it is known."""
        if (watching := course.watching) is not None:
            return self._matching.WatchMatch(watching, timeout=seconds, metadata=self._metadata)
        assert course.request is not None
        return self._matching.Match(course.request, timeout=seconds, metadata=self._metadata)

    async def _asked(
        self,
        method: Callable[..., Awaitable[_Answer]],
        request: Message,
        timeout: float | None,
        retries: int | None = None,
    ) -> _Answer:
        """Return what a method answers to a request, which is perhaps sent again."""
        attempts = Attempts(self._retries if retries is None else retries, self._limit(timeout))
        while True:
            try:
                async with async_translated_errors(self._address):
                    return await method(request, timeout=attempts.limit, metadata=self._metadata)
            except SketchmatchError as error:
                pause = attempts.pause_after(error)
                if pause is None:
                    raise
            await asyncio.sleep(pause)

    async def _serves_by(self, timeout: float | None) -> bool:
        try:
            return await self.is_serving(timeout=math.inf if timeout is None else timeout)
        except (ServerUnavailableError, DeadlineExceededError):
            return False

    def _limit(self, timeout: float | None) -> float | None:
        return self._timeout if timeout is None else limit_of(timeout)
