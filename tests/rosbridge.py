"""A ROS bridge as far as a page sees it: JSON over a WebSocket, remembered by topic."""

import base64
import hashlib
import json
import socketserver
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_TEXT, _CLOSE = 1, 8
_GUID = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11"


class Bridge:
    """What was advertised and published, and what to refuse.

    Parameters
    ----------
    refusal
        What the bridge says of whatever is advertised; empty if it takes it.
    """

    def __init__(self, refusal: str) -> None:
        self.refusal = refusal
        self.url = ""
        self.told: list[dict[str, Any]] = []

    def published(self) -> list[dict[str, Any]]:
        return [each for each in self.told if each["op"] == "publish"]


@contextmanager
def rosbridge(refusal: str = "") -> Iterator[Bridge]:
    """Run a bridge on a free port."""
    bridge = Bridge(refusal)

    class Handler(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            key = _header(self.rfile, b"sec-websocket-key")
            accept = base64.b64encode(hashlib.sha1(key + _GUID).digest())
            self.wfile.write(
                b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n"
                b"Connection: Upgrade\r\nSec-WebSocket-Accept: " + accept + b"\r\n\r\n"
            )
            while (message := _received(self.rfile)) is not None:
                bridge.told.append(json.loads(message))
                if bridge.refusal and bridge.told[-1]["op"] == "advertise":
                    said = {"op": "status", "level": "error", "msg": bridge.refusal}
                    self.wfile.write(_framed(json.dumps(said).encode()))

    class Server(socketserver.ThreadingTCPServer):
        daemon_threads = True

    with Server(("127.0.0.1", 0), Handler) as server:
        bridge.url = f"ws://127.0.0.1:{server.server_address[1]}"
        thread = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
        thread.start()
        yield bridge
        server.shutdown()
        thread.join()


def _header(stream: Any, wanted: bytes) -> bytes:
    found = b""
    while line := stream.readline().strip():
        name, _, value = line.partition(b":")
        if name.lower() == wanted:
            found = value.strip()
    return found


def _received(stream: Any) -> bytes | None:
    """Return the next message of a browser; None when it has gone."""
    message = b""
    while len(head := stream.read(2)) == 2:
        size = head[1] & 0x7F
        if size > 125:
            kind = ">H" if size == 126 else ">Q"
            (size,) = struct.unpack(kind, stream.read(struct.calcsize(kind)))
        mask = stream.read(4)
        data = stream.read(size)
        if head[0] & 0x0F == _CLOSE:
            return None
        message += bytes(byte ^ mask[k % 4] for k, byte in enumerate(data))
        if head[0] & 0x80:
            return message
    return None


def _framed(message: bytes) -> bytes:
    assert len(message) < 126, "short sentences only"
    return bytes([0x80 | _TEXT, len(message)]) + message
