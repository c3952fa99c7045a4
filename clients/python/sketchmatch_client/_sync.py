"""The client for plain, blocking code."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Self, TypeVar, Unpack

import grpc
from google.protobuf.message import Message

from sketchmatch_client import _scenes
from sketchmatch_client._access import AccessOptions, access_to
from sketchmatch_client._call import MatchCall
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
from sketchmatch_client._match import Match, ProgressCallback
from sketchmatch_client._requests import MatchOptions, match_request, segment_request
from sketchmatch_client._retry import Attempts, Counted, checked_retries
from sketchmatch_client._sketch import Sketch, create_request
from sketchmatch_client._transfer import TransferOptions, transfer_request
from sketchmatch_client.errors import (
    DeadlineExceededError,
    NotFoundError,
    ServerUnavailableError,
    SketchmatchError,
    translated_errors,
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

__all__ = ["Client"]

_Answer = TypeVar("_Answer")
_CANCELLING = 10.0


class Client:
    """A connection to a sketchmatch server; close it, or use it in a ``with`` statement.

    It connects with the first call, and reconnects by itself when the connection is lost. Threads
    may share it.

    Parameters
    ----------
    address
        Host and port of the server, e.g. ``"localhost:50051"``, or another gRPC address, e.g.
        ``"unix:/run/sketchmatch.sock"``. Proxies from the environment are not used for this
        machine.
    credentials
        gRPC credentials; they replace the encryption that ``access`` configures.
    timeout
        Time limit of calls that set none, in seconds. None or infinity: no limit.
    retries
        How often a request is sent again if the server is unavailable or busy, after a pause that
        the server asks for or that grows from 0.1 s. The timeout covers all attempts together. A
        match in progress is resumed after a lost connection, with attempts for a minute; if the
        server lost it too, it runs again. 0 disables all of this.
    options
        gRPC channel options, added to this package's own or replacing them.
    **access
        Encryption, certificates and a token: :class:`AccessOptions`. Environment variables replace
        absent ones: ``SKETCHMATCH_TOKEN`` is ``token``, and so on.

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
        self._metadata = way_in.metadata
        self._timeout = limit_of(timeout)
        self._retries = checked_retries(retries)
        chosen = channel_options(address, way_in.options + options)
        self._channel = (
            grpc.insecure_channel(address, chosen)
            if way_in.credentials is None
            else grpc.secure_channel(address, way_in.credentials, chosen)
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection; calls in progress end."""
        self._channel.close()

    def match(
        self,
        sketch: Source,
        map: Source,  # noqa: A002
        *,
        on_progress: ProgressCallback | None = None,
        timeout: float | None = None,
        **options: Unpack[MatchOptions],
    ) -> Match:
        """Match a sketch with a map and wait for the answer.

        Parameters
        ----------
        sketch, map
            From :mod:`sketchmatch_client.sources`.
        on_progress
            Called with each :class:`Progress`, at most 20 times a second. An exception from it ends
            the match.
        timeout
            Seconds after which the call fails; infinity for none. To get the best match until then
            instead, give a ``time_budget``.
        **options
            Profile, algorithms, parameters, seed, time budget …: :class:`MatchOptions`.

        Returns
        -------
        Match
            How it ran, the objects found and the result.
        """
        return self.events(sketch, map, timeout=timeout, **options).result(on_progress)

    def events(
        self,
        sketch: Source,
        map: Source,  # noqa: A002
        *,
        timeout: float | None = None,
        **options: Unpack[MatchOptions],
    ) -> MatchCall:
        """Match a sketch with a map, event by event, with control over the match.

        Parameters
        ----------
        sketch, map, timeout, **options
            As for :meth:`match`.

        Returns
        -------
        MatchCall
            An iterator of :class:`MatchResponse`: ``accepted``, ``scenes``, any number of
            ``progress``, ``result``; a newer server may send others, to be skipped. Its
            ``cancel()`` stops the match from another thread, and its ``result()`` waits for the
            end.
        """
        request = match_request(sketch, map, **options)
        return self._reading(Course(request), self._limit(timeout))

    def watch(self, match_id: str, after: int = 0, *, timeout: float | None = None) -> MatchCall:
        """Read one of the caller's earlier matches, event by event.

        Parameters
        ----------
        match_id
            Its name, as :class:`MatchAccepted` has it.
        after
            The number of the last event that is known already.
        timeout
            Seconds after which the call fails.

        Returns
        -------
        MatchCall
            As :meth:`events` does. Closing it does not stop a match that is to keep running or that
            others read; its ``cancel()`` does.

        Raises
        ------
        NotFoundError
            If the server keeps no such match, or it is another caller's.
        """
        return self._reading(watched(match_id, after), self._limit(timeout))

    def get_match(self, match_id: str, *, timeout: float | None = None) -> GetMatchResponse:
        """Return the state of one of the caller's matches, with its events so far.

        Raises
        ------
        NotFoundError
            If the server keeps no such match, or it is another caller's.
        """
        request = GetMatchRequest(match_id=match_id)
        stub = MatchServiceStub(self._channel)
        return self._asked(stub.GetMatch, request, timeout)

    def cancel_match(self, match_id: str, *, timeout: float | None = None) -> MatchSummary:
        """Stop one of the caller's matches, and return its state.

        One that has ended stays as it is, but one that was interrupted is cancelled, and so does
        not run again.

        Raises
        ------
        NotFoundError
            If the server keeps no such match, or it is another caller's.
        """
        request = CancelMatchRequest(match_id=match_id)
        stub = MatchServiceStub(self._channel)
        return self._asked(stub.CancelMatch, request, timeout).match

    def matches(self, *, timeout: float | None = None) -> Iterator[MatchSummary]:
        """Yield all of the caller's matches that the server knows, the latest first.

        Parameters
        ----------
        timeout
            Seconds after which each call for a page of them fails.
        """
        stub, request = MatchServiceStub(self._channel), ListMatchesRequest()
        while True:
            page = self._asked(stub.ListMatches, request, timeout)
            yield from page.matches
            if not page.next_page_token:
                return
            request.page_token = page.next_page_token

    def segment(
        self,
        source: Source,
        *,
        segmenter: str | None = None,
        params: Mapping[str, Any] | None = None,
        profile: str | None = None,
        include_map: bool = False,
        timeout: float | None = None,
    ) -> SegmentResponse:
        """Find the objects of one source, without a match.

        Parameters
        ----------
        source
            From :mod:`sketchmatch_client.sources`.
        segmenter
            Name of the algorithm; by default the server's choice.
        params
            Its parameters.
        profile
            The server's pipeline that supplies what is not given here.
        include_map
            Whether to return the occupancy grid as well, such as that of a bag, as map_server saves
            maps.
        timeout
            Seconds after which the call fails.

        Returns
        -------
        SegmentResponse
            The scene, warnings, the segmenter as it ran, and the map if requested.
        """
        request = segment_request(source, segmenter, params, profile, include_map)
        return self._asked(self._keeping.Segment, request, timeout)

    def put_scene(
        self,
        source: Source,
        *,
        segmenter: str | None = None,
        params: Mapping[str, Any] | None = None,
        profile: str | None = None,
        title: str = "",
        timeout: float | None = None,
    ) -> PutSceneResponse:
        """Find the objects of a source, and store them on the server for later matches.

        ``sources.stored_scene`` makes a sketch or map of the name in the answer.

        Parameters
        ----------
        source, segmenter, params, profile, timeout
            As for :meth:`segment`.
        title
            A title for people who choose among scenes; not part of the name.

        Returns
        -------
        PutSceneResponse
            The scene, named by the hash of its content, and whether it is new to the caller.
        """
        request = _scenes.put_request(source, segmenter, params, profile, title)
        return self._asked(self._keeping.PutScene, request, timeout)

    def get_scene(
        self, name: str, *, include_source: bool = False, timeout: float | None = None
    ) -> GetSceneResponse:
        """Return a scene that the caller has put, with its source if requested."""
        request = _scenes.get_request(name, include_source)
        return self._asked(self._keeping.GetScene, request, timeout)

    def list_scenes(self, *, timeout: float | None = None) -> list[SceneSummary]:
        """Return summaries of all scenes that the caller has put, the latest first."""
        found, request = list[SceneSummary](), ListScenesRequest()
        while True:
            page = self._asked(self._keeping.ListScenes, request, timeout)
            found.extend(page.scenes)
            if not page.next_page_token:
                return found
            request.page_token = page.next_page_token

    def update_scene(
        self,
        name: str,
        labels: Mapping[int, str] | None = None,
        *,
        title: str | None = None,
        timeout: float | None = None,
    ) -> StoredScene:
        """Change labels of a stored scene's objects, or its title.

        Parameters
        ----------
        name
            Of the scene, which stays as it is.
        labels
            By index, from 0; an empty one removes the label.
        title
            The new title; None keeps the present one.
        timeout
            Seconds after which the call fails.

        Returns
        -------
        StoredScene
            The scene with these labels, under its own name, which a title does not change.
        """
        request = _scenes.update_request(name, labels, title)
        return self._asked(self._keeping.UpdateScene, request, timeout).stored_scene

    def delete_scene(self, name: str, *, timeout: float | None = None) -> None:
        """Delete a scene; it stays for other callers who have put it."""
        deletion = Counted(self._keeping.DeleteScene)
        try:
            self._asked(deletion, _scenes.delete_request(name), timeout)
        except NotFoundError:
            if deletion.asked == 1:
                raise
            # It is gone by a request whose answer was lost.

    def sketch(
        self,
        map: Source,  # noqa: A002
        *,
        y_axis: YAxis = "up",
        timeout: float | None = None,
        **options: Unpack[MatchOptions],
    ) -> Sketch:
        """Start a sketch that is matched while it is drawn.

        Parameters
        ----------
        map
            From :mod:`sketchmatch_client.sources`; a stored scene is ready at once.
        y_axis
            Which way y grows in the strokes to come: ``"down"`` on screens.
        timeout
            Seconds after which the call fails.
        **options
            As for :meth:`match`, at each revision.

        Returns
        -------
        Sketch
            Empty; ``update`` draws, ``watch`` streams the results.
        """
        request = create_request(map, y_axis, **options)
        made = self._asked(self._drawing.CreateSketch, request, timeout)
        return Sketch(self, made.sketch_id)

    def transfer(
        self,
        sketch: Source,
        map: Source,  # noqa: A002
        features: Iterable[Feature] = (),
        *,
        timeout: float | None = None,
        **options: Unpack[TransferOptions],
    ) -> TransferResponse:
        """Transfer points, routes and zones from a sketch to a map, back, or to a new map.

        Parameters
        ----------
        sketch, map
            From :mod:`sketchmatch_client.sources`; of two maps the old one is the sketch.
        features
            From :mod:`sketchmatch_client.features`. A route that is drawn in a sketch is always
            transferred.
        timeout
            Seconds after which the call fails.
        **options
            The object map if known, direction, radius …, and all options of a match except
            ``alternatives``, ``request_id``, ``keep_running`` and ``priority``:
            :class:`TransferOptions`.

        Returns
        -------
        TransferResponse
            The transferred features, each point with its standard deviation, and what was changed
            and why.
        """
        request = transfer_request(sketch, map, features, **options)
        stub = TransferServiceStub(self._channel)
        return self._asked(stub.Transfer, request, timeout)

    def algorithms(self, *, timeout: float | None = None) -> ListAlgorithmsResponse:
        """Return the algorithms that the server offers, its profiles and its plugins."""
        stub, request = CatalogServiceStub(self._channel), ListAlgorithmsRequest()
        return self._asked(stub.ListAlgorithms, request, timeout)

    def server_info(self, *, timeout: float | None = None) -> GetServerInfoResponse:
        """Return the server's versions and limits."""
        stub, request = CatalogServiceStub(self._channel), GetServerInfoRequest()
        return self._asked(stub.GetServerInfo, request, timeout)

    def is_serving(self, name: str = "", *, timeout: float | None = None) -> bool:
        """Return whether the server, or a part of it, is up and warm.

        Parameters
        ----------
        name
            The part: a service, e.g. ``"sketchmatch.v1.MatchService"``, or an algorithm, e.g.
            ``"searcher/easm"``, which is warm once its kernels are compiled. By default the whole
            server, which is warm once the default algorithms are.
        timeout
            Seconds after which the call fails.

        Raises
        ------
        InvalidRequestError
            If the server has no such part.
        ServerUnavailableError
            If there is no answer.
        """
        check: grpc.UnaryUnaryMultiCallable[bytes, bytes] = self._channel.unary_unary(CHECK_HEALTH)
        with translated_errors(self._address):
            try:
                answer = check(health_request(name), timeout=self._limit(timeout))
            except grpc.RpcError as error:
                if error.code() is grpc.StatusCode.NOT_FOUND:
                    raise no_such_part(name) from error
                raise
        return answer == SERVING

    def wait_until_serving(self, timeout: float = 60.0) -> None:
        """Wait until the server is up and warm.

        Parameters
        ----------
        timeout
            Longest wait in seconds; infinity for no limit. A server's very first start compiles its
            kernels.

        Raises
        ------
        ServerUnavailableError
            If it does not serve by then.
        """
        limit = limit_of(timeout)
        deadline = time.monotonic() + (math.inf if limit is None else limit)
        while not self._serves_by(within(deadline, time.monotonic())):
            if time.monotonic() >= deadline:
                raise never_served(self._address, timeout)
            time.sleep(HEALTH_POLL_SECONDS)

    @property
    def _keeping(self) -> SceneServiceStub:
        return SceneServiceStub(self._channel)

    @property
    def _drawing(self) -> SketchServiceStub:
        return SketchServiceStub(self._channel)

    def _reading(self, course: Course, limit: float | None) -> MatchCall:
        stub = MatchServiceStub(self._channel)

        def begin(course: Course, seconds: float | None) -> Any:
            if (watching := course.watching) is not None:
                return stub.WatchMatch(watching, timeout=seconds, metadata=self._metadata)
            assert course.request is not None
            return stub.Match(course.request, timeout=seconds, metadata=self._metadata)

        def cancel(match_id: str) -> object:
            request = CancelMatchRequest(match_id=match_id)
            return stub.CancelMatch.future(request, timeout=_CANCELLING, metadata=self._metadata)

        return MatchCall(
            course, begin, cancel, self._address, lambda: Attempts(self._retries, limit)
        )

    def _asked(
        self,
        method: Callable[..., _Answer],
        request: Message,
        timeout: float | None,
        retries: int | None = None,
    ) -> _Answer:
        """Return what a method answers to a request, which is perhaps sent again."""
        attempts = Attempts(self._retries if retries is None else retries, self._limit(timeout))
        while True:
            try:
                with translated_errors(self._address):
                    return method(request, timeout=attempts.limit, metadata=self._metadata)
            except SketchmatchError as error:
                pause = attempts.pause_after(error)
                if pause is None:
                    raise
            time.sleep(pause)

    def _serves_by(self, timeout: float | None) -> bool:
        try:
            return self.is_serving(timeout=math.inf if timeout is None else timeout)
        except (ServerUnavailableError, DeadlineExceededError):
            return False

    def _limit(self, timeout: float | None) -> float | None:
        return self._timeout if timeout is None else limit_of(timeout)
