"""Who answers a command: a server, or the same application in this process.

Either takes the client's options and gives the contract's messages.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, Unpack, cast

from sketchmatch.cli.options import Access, say
from sketchmatch.config import load, open_engine
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model.limits import limited_to
from sketchmatch_client import (
    Client,
    InvalidRequestError,
    MatchOptions,
    TransferOptions,
    match_request,
    segment_request,
    transfer_request,
)
from sketchmatch_proto.v1.catalog_service_pb2 import ListAlgorithmsResponse
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse
from sketchmatch_proto.v1.scene_service_pb2 import SegmentResponse
from sketchmatch_proto.v1.source_pb2 import Source
from sketchmatch_proto.v1.transfer_service_pb2 import Feature, TransferResponse

if TYPE_CHECKING:
    from sketchmatch.app.application import Application

__all__ = ["Answerer", "answerer", "client_of", "naming"]


class Answerer(Protocol):
    """What a command asks, as :class:`sketchmatch_client.Client` answers it."""

    def events(
        self,
        sketch: Source,
        map: Source,  # noqa: A002
        **options: Unpack[MatchOptions],
    ) -> Generator[MatchResponse, None, None]:
        """Match a sketch with a map, event by event."""

    def segment(
        self,
        source: Source,
        *,
        segmenter: str | None = None,
        params: Mapping[str, Any] | None = None,
        profile: str | None = None,
    ) -> SegmentResponse:
        """Find the objects of one source."""

    def transfer(
        self,
        sketch: Source,
        map: Source,  # noqa: A002
        features: Iterable[Feature] = (),
        **options: Unpack[TransferOptions],
    ) -> TransferResponse:
        """Carry features from one scene to the other."""

    def algorithms(self) -> ListAlgorithmsResponse:
        """Return what there is to choose from."""


@contextmanager
def answerer(
    server: str | None,
    config: Path | None,
    access: Access = Access(),  # noqa: B008
) -> Iterator[Answerer]:
    """Yield the server at an address, or this process; files may be as large as it says.

    Raises
    ------
    InvalidInputError
        If the configuration, or how to get in at the server, is of no use.
    """
    configuration = load(config)
    with limited_to(configuration.limits):
        if server is not None:
            with client_of(server, "--server", access) as client:
                yield client
        else:
            _refuse_access(access)
            from sketchmatch.app.application import Application
            from sketchmatch.app.setup import Isolation, Setup

            engine = open_engine(configuration)
            everybody = Isolation(trusted=frozenset("*"))
            yield _Here(Application(Setup(engine, isolation=everybody)))


def client_of(address: str, named: str, access: Access) -> Client:
    """Return a client of the server at an address; its errors name what was typed.

    Parameters
    ----------
    address
        Of the server.
    named
        What the address is called on the command line.
    access
        How to get in.

    Raises
    ------
    InvalidInputError
        If one of them is of no use.
    """
    with naming({"address": named, **{name: _option(name) for name in vars(access)}}):
        return Client(address, **vars(access))


@contextmanager
def naming(typed: Mapping[str, str]) -> Iterator[None]:
    """Give errors about what a client was given the names by which it was typed.

    Raises
    ------
    InvalidInputError
        In place of the client's own error.
    """
    try:
        yield
    except InvalidRequestError as error:
        if error.field not in typed:
            raise
        problem = str(error).removeprefix(f"{error.field} ")
        raise InvalidInputError(Reason.INVALID_FIELD, typed[error.field], problem) from None


def _refuse_access(access: Access) -> None:
    for name, value in vars(access).items():
        if value is not None:
            problem = "needs a server, but none is given; add --server, or leave it out"
            raise InvalidInputError(Reason.INVALID_FIELD, _option(name), problem)


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


class _Here:
    """Answers in this process."""

    def __init__(self, app: Application) -> None:
        self._app = app

    def events(
        self,
        sketch: Source,
        map: Source,  # noqa: A002
        **options: Unpack[MatchOptions],
    ) -> Generator[MatchResponse, None, None]:
        from sketchmatch.pipeline.warmup import announcing_compilation

        request = match_request(sketch, map, **options)
        with announcing_compilation(say), closing(self._app.answers(request)) as responses:
            for response in responses:
                yield cast(MatchResponse, response)

    def segment(
        self,
        source: Source,
        *,
        segmenter: str | None = None,
        params: Mapping[str, Any] | None = None,
        profile: str | None = None,
    ) -> SegmentResponse:
        (response,) = self._app.answers(segment_request(source, segmenter, params, profile))
        return cast(SegmentResponse, response)

    def transfer(
        self,
        sketch: Source,
        map: Source,  # noqa: A002
        features: Iterable[Feature] = (),
        **options: Unpack[TransferOptions],
    ) -> TransferResponse:
        from sketchmatch.pipeline.warmup import announcing_compilation

        request = transfer_request(sketch, map, features, **options)
        with announcing_compilation(say), closing(self._app.answers(request)) as responses:
            *_, response = responses
        return cast(TransferResponse, response)

    def algorithms(self) -> ListAlgorithmsResponse:
        return self._app.algorithms()
