"""The port for browsers: the sketch pad, and the services over Connect, gRPC-Web and JSON."""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Awaitable, Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from http import HTTPStatus
from ipaddress import ip_address
from typing import TYPE_CHECKING, Any

from sketchmatch.app.application import Application
from sketchmatch.config.addresses import is_of_this_machine
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.server.called import Handlers
from sketchmatch.server.pages import NOT_BUILT, Pages, answer_plainly, bundled_pages
from sketchmatch.server.tls import Pems, newest_context
from sketchmatch.server.watched import Watched

if TYPE_CHECKING:
    import uvicorn

__all__ = ["Gateway"]

_SETTING = "server.web_address"
_BACKLOG = 1024
_Asgi = Callable[[Any, Any, Any], Awaitable[None]]


class Gateway:
    """Answers browsers as the gRPC server answers others, with the same handlers.

    Parameters
    ----------
    address
        Host and port to listen on; port 0 picks a free one.
    origins
        Of pages from elsewhere that may call; none may by default.
    app
        What answers.
    handlers
        The same with the services and interceptors of the gRPC server.
    services
        Full names of the services.
    robots
        Addresses of ROS bridges that the sketch pad may send routes to.
    pems
        What is in the files of certificates; None: no encryption.

    Raises
    ------
    InvalidInputError
        If the address cannot be listened on, or what the gateway needs is not installed.
    """

    def __init__(
        self,
        address: str,
        origins: Sequence[str],
        app: Application,
        handlers: Handlers,
        services: Iterable[str],
        robots: Sequence[str] = (),
        pems: Watched[Pems] | None = None,
    ) -> None:
        try:
            import uvicorn

            from sketchmatch.server.connect import connect_application
        except ImportError:
            problem = "is set, but connectrpc and uvicorn are not both installed; "
            raise InvalidInputError(
                Reason.INVALID_FIELD, _SETTING, f"{problem}run pip install 'sketchmatch[web]'"
            ) from None
        connect = connect_application(
            services,
            handlers,
            app.setup.limits.transport_bytes,
            lambda: app.setup.limits.max_request_bytes,
        )
        pages = bundled_pages(robots)
        self._socket, self.address = _listening(address)
        self.url = f"{'https' if pems else 'http'}://{self.address}/"
        self.sentences = (
            [f"the sketch pad is at {self.url}"]
            if pages
            else [f"programs in browsers are answered at {self.url}", NOT_BUILT]
        )
        front = _Front(connect, pages, origins, local=is_of_this_machine(address))
        self._server = _server(uvicorn, front, pems)
        self._end: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Answer from now on."""
        self._end = asyncio.create_task(self._server.serve(sockets=[self._socket]))

    async def stop(self, grace: float) -> None:
        """Answer nothing new, and leave so many seconds to what is under way."""
        self._server.config.timeout_graceful_shutdown = max(1, round(grace))
        self._server.should_exit = True
        if self._end is not None:
            await self._end


class _Front:
    """Says who may ask, and passes on what is asked."""

    def __init__(self, connect: _Asgi, pages: Pages, origins: Sequence[str], local: bool) -> None:
        self._connect, self._pages = connect, pages
        self._origins, self._local = frozenset(origins), local

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] != "http":
            return
        headers = {key.lower(): value.decode("latin-1") for key, value in scope["headers"]}
        # A page from elsewhere whose name was made to mean this machine has no business here.
        if self._local and not _names_this_machine(headers.get(b"host", "")):
            text = "this server answers only at names of this machine, such as localhost; use one"
            await answer_plainly(send, HTTPStatus.MISDIRECTED_REQUEST, text)
            return
        if not scope["path"].startswith("/sketchmatch."):
            await self._pages(scope, receive, send)
            return
        allowed = _cors(headers.get(b"origin", ""), self._origins)
        if scope["method"] == "OPTIONS":
            status = HTTPStatus.NO_CONTENT if allowed else HTTPStatus.FORBIDDEN
            await _answer_preflight(send, status, allowed)
        else:
            await self._connect(scope, receive, _adding(allowed, send))


def _cors(origin: str, origins: frozenset[str]) -> list[tuple[bytes, bytes]]:
    """Return what tells a browser that a page from elsewhere may call; nothing if it may not."""
    if not origin or origin not in origins:
        return []
    return [
        (b"access-control-allow-origin", origin.encode("latin-1")),
        (b"access-control-expose-headers", b"grpc-status, grpc-message, grpc-status-details-bin"),
        (b"vary", b"Origin"),
    ]


async def _answer_preflight(
    send: Any, status: HTTPStatus, allowed: list[tuple[bytes, bytes]]
) -> None:
    granted = [
        (b"access-control-allow-methods", b"POST"),
        (
            b"access-control-allow-headers",
            b"authorization, content-type, connect-protocol-version, connect-timeout-ms, "
            b"x-grpc-web, x-user-agent, grpc-timeout",
        ),
        (b"access-control-max-age", b"7200"),
    ]
    headers = [*allowed, *granted] if allowed else []
    await send({"type": "http.response.start", "status": int(status), "headers": headers})
    await send({"type": "http.response.body", "body": b""})


def _adding(headers: list[tuple[bytes, bytes]], send: Any) -> Any:
    added = [*headers, (b"cache-control", b"no-store"), (b"x-content-type-options", b"nosniff")]

    async def adding(message: Any) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message["headers"], *added]}
        await send(message)

    return adding


def _names_this_machine(host: str) -> bool:
    name = host.rpartition(":")[0] if host.rpartition(":")[2].isdecimal() else host
    name = name.strip("[]").lower()
    if name == "localhost" or name.endswith(".localhost"):
        return True
    try:
        ip_address(name)
    except ValueError:
        return False
    return True


def _listening(address: str) -> tuple[socket.socket, str]:
    host, _, port = address.rpartition(":")
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host.strip("[]"), int(port)))
        listener.listen(_BACKLOG)
    except (OSError, OverflowError) as error:
        listener.close()
        why = (getattr(error, "strerror", None) or str(error)).lower()
        problem = f"{address!r} cannot be listened on ({why}); choose a free port of this host"
        raise InvalidInputError(Reason.INVALID_FIELD, _SETTING, problem) from None
    return listener, f"{host}:{listener.getsockname()[1]}"


def _server(uvicorn_: Any, front: _Asgi, pems: Watched[Pems] | None) -> uvicorn.Server:
    class Server(uvicorn_.Server):  # type: ignore[misc]
        @contextmanager
        def capture_signals(self) -> Iterator[None]:
            """Leave signals to who runs the servers."""
            yield

    # What it has to say is for people who run it alone.
    logging.getLogger("uvicorn").setLevel(logging.CRITICAL)
    config = uvicorn_.Config(
        front,
        lifespan="off",
        ws="none",
        log_config=None,
        access_log=False,
        server_header=False,
        proxy_headers=False,
        ssl_context_factory=None if pems is None else lambda *_: newest_context(pems),
    )
    server: uvicorn.Server = Server(config)
    return server
