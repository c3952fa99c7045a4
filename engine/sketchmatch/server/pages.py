"""The files of the sketch pad, as browsers ask for them."""

from __future__ import annotations

import gzip
import hashlib
import json
import mimetypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from importlib import resources
from pathlib import PurePosixPath
from typing import Any

__all__ = ["NOT_BUILT", "Pages", "answer_plainly", "bundled_pages"]

NOT_BUILT = "the sketch pad is not built; run make web in a checkout, and install that"

ROBOTS = "/robots.json"
"""Where the page reads to which ROS bridges it may send routes."""


def _headers(robots: Sequence[str] = ()) -> tuple[tuple[bytes, bytes], ...]:
    """Return what goes with every page.

    Nothing is loaded from elsewhere, nothing runs within a page, and it connects to nobody but this
    server and the robots that whoever runs it has named.
    """
    policy = (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' blob: data:",
        "font-src 'self'",
        " ".join(("connect-src 'self'", *robots)),
        "manifest-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
    return (
        (b"content-security-policy", "; ".join(policy).encode()),
        (b"cross-origin-opener-policy", b"same-origin"),
        (b"cross-origin-resource-policy", b"same-origin"),
        (b"referrer-policy", b"no-referrer"),
        (b"x-content-type-options", b"nosniff"),
    )


_HEADERS = _headers()

_TYPES = {".js": "text/javascript", ".webmanifest": "application/manifest+json"}
_WORTH_GZIP = ("text/", "image/svg", "application/json", "application/manifest")


@dataclass(frozen=True)
class _Page:
    kind: str
    data: bytes
    packed: bytes | None
    tag: bytes
    lasting: bool


class Pages:
    """Files in memory; there are few, and they are small.

    Parameters
    ----------
    files
        What is in each, by the path that browsers ask for.
    robots
        Addresses of ROS bridges that the page may send routes to.
    """

    def __init__(self, files: Mapping[str, bytes], robots: Sequence[str] = ()) -> None:
        listed = {ROBOTS: json.dumps(list(robots)).encode()} if files else {}
        self._pages = {path: _page(path, data) for path, data in {**files, **listed}.items()}
        self._headers = _headers(robots)

    def __bool__(self) -> bool:
        return "/index.html" in self._pages

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Answer a request, as ASGI has it."""
        del receive
        path = scope["path"]
        page = self._pages.get("/index.html" if path == "/" else path)
        if scope["method"] not in ("GET", "HEAD"):
            await answer_plainly(send, HTTPStatus.METHOD_NOT_ALLOWED, "pages can only be read")
        elif page is None:
            text = "there is no such page" if self else NOT_BUILT
            await answer_plainly(send, HTTPStatus.NOT_FOUND, text)
        else:
            await _answer(page, self._headers, scope, send)


def bundled_pages(robots: Sequence[str] = ()) -> Pages:
    """Return the sketch pad that came with the engine; no pages where it was not built."""
    folder = resources.files("sketchmatch.server") / "pad"
    found: dict[str, bytes] = {}

    def gather(at: Any, path: str) -> None:
        for item in at.iterdir():
            below = f"{path}/{item.name}"
            if item.is_dir():
                gather(item, below)
            else:
                found[below] = item.read_bytes()

    if folder.is_dir():
        gather(folder, "")
    return Pages(found, robots)


async def answer_plainly(send: Any, status: HTTPStatus, text: str) -> None:
    """Answer with a sentence."""
    body = f"{text}\n".encode()
    headers = [(b"content-type", b"text/plain; charset=utf-8"), *_HEADERS]
    await _send(send, status, headers, body)


async def _answer(
    page: _Page, always: Sequence[tuple[bytes, bytes]], scope: Any, send: Any
) -> None:
    asked = dict(scope["headers"])
    kept = b"public, max-age=31536000, immutable" if page.lasting else b"no-cache"
    headers = [(b"etag", page.tag), (b"cache-control", kept), *always]
    if asked.get(b"if-none-match") == page.tag:
        await _send(send, HTTPStatus.NOT_MODIFIED, headers, b"")
        return
    headers.append((b"content-type", page.kind.encode()))
    data = page.data
    if page.packed is not None:
        headers.append((b"vary", b"Accept-Encoding"))
        if b"gzip" in asked.get(b"accept-encoding", b""):
            data = page.packed
            headers.append((b"content-encoding", b"gzip"))
    await _send(send, HTTPStatus.OK, headers, data, bodiless=scope["method"] == "HEAD")


async def _send(
    send: Any,
    status: HTTPStatus,
    headers: list[tuple[bytes, bytes]],
    body: bytes,
    bodiless: bool = False,
) -> None:
    size = (b"content-length", str(len(body)).encode())
    start = {"type": "http.response.start", "status": int(status), "headers": [*headers, size]}
    await send(start)
    await send({"type": "http.response.body", "body": b"" if bodiless else body})


def _page(path: str, data: bytes) -> _Page:
    suffix = PurePosixPath(path).suffix
    kind = _TYPES.get(suffix) or mimetypes.guess_type(path)[0] or "application/octet-stream"
    packed = None
    if kind.startswith(_WORTH_GZIP) or kind == "text/javascript":
        packed = gzip.compress(data, 9, mtime=0)
        kind = f"{kind}; charset=utf-8" if kind.startswith("text/") else kind
    tag = f'"{hashlib.sha256(data).hexdigest()[:32]}"'.encode()
    # The builder puts a hash into the names of these.
    return _Page(kind, data, packed, tag, path.startswith("/assets/"))
