"""What channels and calls of both clients have in common."""

from __future__ import annotations

from typing import Any

from sketchmatch_client.errors import ServerUnavailableError

__all__ = [
    "CHECK_HEALTH",
    "HEALTH_POLL_SECONDS",
    "OPTIONS",
    "SERVING",
    "ChannelOptions",
    "never_served",
]

ChannelOptions = tuple[tuple[str, Any], ...]

OPTIONS: ChannelOptions = (
    # What is too large is the server's to say: only it knows its memory.
    ("grpc.max_send_message_length", -1),
    ("grpc.max_receive_message_length", -1),
    # Buffer as little as there may be: what waits here for a slow reader is progress that the
    # server can no longer replace by the latest. A whole message passes at once all the same.
    ("grpc.http2.lookahead_bytes", 1),
    ("grpc.http2.bdp_probe", 0),
    # A robot's link may vanish without a word: find out within 40 s, and reconnect soon.
    ("grpc.keepalive_time_ms", 30_000),
    ("grpc.keepalive_timeout_ms", 10_000),
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.max_reconnect_backoff_ms", 5_000),
)

# The standard health service, by hand: its request for the whole server is the empty message,
# and a response is one enum (field 1). This saves a dependency.
CHECK_HEALTH = "/grpc.health.v1.Health/Check"
SERVING = b"\x08\x01"
HEALTH_POLL_SECONDS = 0.05


def never_served(address: str, seconds: float) -> ServerUnavailableError:
    """Return the error of a server that somebody waited for in vain."""
    return ServerUnavailableError(
        f"the sketchmatch server at {address} did not serve within {seconds:g} s; "
        "start it, check the address, or wait longer"
    )
