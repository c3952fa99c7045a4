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

    It connects with the first call, and again by itself when the link was lost. It may be
    used from several threads.

    Parameters
    ----------
    address
        Host and port of the server, e.g. ``"localhost:50051"``, or another address as gRPC
        names them, e.g. ``"unix:/run/sketchmatch.sock"``. Proxies that the environment names
        are not asked for what is on this machine.
    credentials
        Credentials of gRPC's own making, in place of what ``access`` says of encryption.
    timeout
        Seconds that a call may take where the call itself does not say. None or infinity: no
        limit.
    retries
        How often a request is sent again where the server is not available or has no room, after a
        pause that the server asks for or that grows from 0.1 s. The timeout is for all attempts
        together. A match that has begun goes on where the link was lost, with attempts for a
        minute; where the server lost it too, it is done again. With 0 none of that is done.
    options
        Channel options of gRPC, beside or instead of this package's own.
    **access
        How to get in, by encryption, certificates and a token: :class:`AccessOptions`. What is
        left out, the environment may say: ``SKETCHMATCH_TOKEN`` is ``token``, and so on.

    Raises
    ------
    SketchmatchError
        From every call: :mod:`sketchmatch_client.errors` has one class for each thing to do.
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
        """Close the connection; calls that are under way end."""
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
            Called with each :class:`Progress`, at most 20 a second. What it raises ends the
            match.
        timeout
            Seconds after which the call fails; infinity for none. To have the best match until
            then, give a ``time_budget`` instead.
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
        """Match a sketch with a map, event by event, or with a hand on it.

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
        """Read a match of one's own that was begun before, event by event.

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
            As :meth:`events` does; closing it does not stop a match that is to keep running or that
            others read, and its ``cancel()`` does.

        Raises
        ------
        NotFoundError
            If the server keeps no such match, or it is another caller's.
        """
        return self._reading(watched(match_id, after), self._limit(timeout))

    def get_match(self, match_id: str, *, timeout: float | None = None) -> GetMatchResponse:
        """Return how a match of one's own is, with its events so far.

        Raises
        ------
        NotFoundError
            If the server keeps no such match, or it is another caller's.
        """
        request = GetMatchRequest(match_id=match_id)
        stub = MatchServiceStub(self._channel)
        return self._asked(stub.GetMatch, request, timeout)

    def cancel_match(self, match_id: str, *, timeout: float | None = None) -> MatchSummary:
        """Stop a match of one's own, and return how it is.

        One that has ended stays as it is, but one that was interrupted is cancelled, and so not
        done again.

        Raises
        ------
        NotFoundError
            If the server keeps no such match, or it is another caller's.
        """
        request = CancelMatchRequest(match_id=match_id)
        stub = MatchServiceStub(self._channel)
        return self._asked(stub.CancelMatch, request, timeout).match

    def matches(self, *, timeout: float | None = None) -> Iterator[MatchSummary]:
        """Yield all matches of one's own that the server knows, the latest first.

        Parameters
        ----------
        timeout
            Seconds after which each call for some of them fails.
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
            Name of the algorithm; the server's choice when left out.
        params
            Its parameters.
        profile
            The server's pipeline that decides what is left out.
        include_map
            Whether the occupancy grid is wanted, too, such as that of a bag, as map_server saves
            maps.
        timeout
            Seconds after which the call fails.

        Returns
        -------
        SegmentResponse
            The scene, warnings, the segmenter as it ran, and the map where it is wanted.
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
        """Find the objects of a source, and have the server keep them for later matches.

        ``sources.stored_scene`` makes the name in the answer a sketch or map.

        Parameters
        ----------
        source, segmenter, params, profile, timeout
            As for :meth:`segment`.
        title
            What you call it, for people who choose among scenes; it is no part of the name.

        Returns
        -------
        PutSceneResponse
            The scene, under the hash of what it is, and whether you had not put it before.
        """
        request = _scenes.put_request(source, segmenter, params, profile, title)
        return self._asked(self._keeping.PutScene, request, timeout)

    def get_scene(
        self, name: str, *, include_source: bool = False, timeout: float | None = None
    ) -> GetSceneResponse:
        """Return a scene that you have put, with its source where that is wanted."""
        request = _scenes.get_request(name, include_source)
        return self._asked(self._keeping.GetScene, request, timeout)

    def list_scenes(self, *, timeout: float | None = None) -> list[SceneSummary]:
        """Return what there is to say of all scenes that you have put, the latest first."""
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
        """Give objects of a kept scene other labels, or the scene another title.

        Parameters
        ----------
        name
            Of the scene, which stays as it is.
        labels
            By index, from 0; an empty one takes the label away.
        title
            What you call it from now on; None: as before.
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
        """Forget a scene; it stays for others who have put it."""
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
        """Begin a sketch that is matched while it is drawn.

        Parameters
        ----------
        map
            From :mod:`sketchmatch_client.sources`; a stored scene is there at once.
        y_axis
            Which way y grows in the strokes to come: ``"down"`` on screens.
        timeout
            Seconds after which the call fails.
        **options
            As for :meth:`match`, at each revision.

        Returns
        -------
        Sketch
            Empty; ``update`` draws, ``watch`` tells what comes of it.
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
        """Carry points, routes and zones from a sketch to a map, back, or to a new map.

        Parameters
        ----------
        sketch, map
            From :mod:`sketchmatch_client.sources`; of two maps the old one is the sketch.
        features
            From :mod:`sketchmatch_client.features`. A route that is drawn in a sketch is carried
            without being asked.
        timeout
            Seconds after which the call fails.
        **options
            The object map where it is known, direction, radius …, and all that a match takes but
            ``alternatives``, ``request_id``, ``keep_running`` and ``priority``:
            :class:`TransferOptions`.

        Returns
        -------
        TransferResponse
            The carried features, each point with its standard deviation, and why what was changed.
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
            The part: a service, as in ``"sketchmatch.v1.MatchService"``, or an algorithm, as in
            ``"searcher/easm"``, which is warm once its kernels are compiled. The whole server when
            left out, which is warm once the default algorithms are.
        timeout
            Seconds after which the call fails.

        Raises
        ------
        InvalidRequestError
            If the server has no such part.
        ServerUnavailableError
            If nobody answers.
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
            Seconds to wait at most; infinity for no limit. A server's first ever start compiles
            its kernels.

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
