"""What channels and calls of both clients have in common."""

from __future__ import annotations

import math
import os
import re
import reprlib
from ipaddress import ip_address
from numbers import Real
from typing import Any

from sketchmatch_client.errors import InvalidRequestError, ServerUnavailableError

__all__ = [
    "CHECK_HEALTH",
    "HEALTH_POLL_SECONDS",
    "SERVING",
    "ChannelOptions",
    "channel_options",
    "check_address",
    "health_request",
    "is_here",
    "limit_of",
    "never_served",
    "no_such_part",
    "within",
]

ChannelOptions = tuple[tuple[str, Any], ...]

_OPTIONS: ChannelOptions = (
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
    ("grpc.http2.ping_timeout_ms", 10_000),
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.max_reconnect_backoff_ms", 5_000),
)
# No proxy, whatever http_proxy says, leads to where the client itself is.
_DIRECT: ChannelOptions = (("grpc.enable_http_proxy", 0),)

# The standard health service, by hand: its request is one text, its response one enum (both field
# 1). This saves a dependency.
CHECK_HEALTH = "/grpc.health.v1.Health/Check"
SERVING = b"\x08\x01"
_LONGEST_NAME = 127
HEALTH_POLL_SECONDS = 0.05

# gRPC fails at once where the deadline is further away than its clock can tell.
_FOR_EVER = 1e8

_SCHEMES = re.compile(r"(dns|ipv4|ipv6|unix|unix-abstract|vsock|xds|passthrough|google-c2p):")
_FILE = re.compile(r"unix:(?://)?(.*)", re.DOTALL)
_LONGEST_PATH = 107
_WITHIN_MACHINE = ("unix:", "unix-abstract:", "vsock:")
# A host and a port, perhaps behind the scheme and the name server that look the host up.
_HOST_AND_PORT = re.compile(
    r"(?:dns:(?://[^/]*/)?|ipv[46]:)?(?P<host>\[[^\]]*\]|[^:/\s]*)(?::(?P<port>\d+))?"
)
_DIGITS = 5
_THIS_MACHINE = {"localhost", "localhost.localdomain", "ip6-localhost", "ip6-loopback"}


def channel_options(address: str, given: ChannelOptions) -> ChannelOptions:
    """Return the options of a channel to a server; those that are given win."""
    return _OPTIONS + (_DIRECT if is_here(address) else ()) + given


def check_address(address: str, encrypted: bool) -> None:
    """Refuse what cannot be the address of a server.

    Raises
    ------
    InvalidRequestError
        If it is a URL, lacks a port where there is no default one, as there is for TLS, or names
        no file that can be a socket.
    """
    if not isinstance(address, str) or not address.strip() or not address.isprintable():
        raise _refused(address, "give host and port, as in 'localhost:50051'")
    file = _FILE.fullmatch(address)
    if file is not None and not 0 < len(os.fsencode(file[1])) <= _LONGEST_PATH:
        limit = f"a path of at most {_LONGEST_PATH} bytes"
        raise _refused(address, f"name a file by {limit}, as in 'unix:/run/sketchmatch.sock'")
    if _SCHEMES.match(address):
        return
    if "://" in address:
        raise _refused(address, "give host and port alone, as in 'localhost:50051'")
    parts = _HOST_AND_PORT.fullmatch(address)
    if parts is None or not parts["host"]:
        raise _refused(address, "give host and port, as in 'localhost:50051' or '[::1]:50051'")
    if parts["port"] is None and address.isdecimal():
        raise _refused(address, f"add the host, as in 'localhost:{address}'")
    if parts["port"] is None and not encrypted:
        raise _refused(address, f"add the port, as in '{address}:50051'")
    port = parts["port"] or "1"
    if len(port) > _DIGITS or not 0 < int(port) < 1 << 16:
        raise _refused(address, "give a port from 1 to 65535")


def health_request(name: str) -> bytes:
    """Return the message that asks whether something of a name serves; empty for the whole server.

    Raises
    ------
    InvalidRequestError
        If no server has the name.
    """
    text = name.encode("utf-8", "replace")
    if len(text) > _LONGEST_NAME:
        raise no_such_part(name)
    return b"\x0a" + bytes([len(text)]) + text if text else b""


def no_such_part(name: str) -> InvalidRequestError:
    """Return the error of a name that a server does not know."""
    return InvalidRequestError(
        f"name is {reprlib.repr(name)}, which the server does not have; name a service, as in "
        "sketchmatch.v1.MatchService, or an algorithm, as in searcher/easm",
        "INVALID_FIELD",
        "name",
    )


def limit_of(timeout: float | None) -> float | None:
    """Return how many seconds a call may take as gRPC takes it; None for no limit.

    Raises
    ------
    InvalidRequestError
        If it is no time.
    """
    if timeout is None:
        return None
    if not isinstance(timeout, Real) or not timeout >= 0:  # nan is not
        raise InvalidRequestError(
            f"timeout is {reprlib.repr(timeout)}; give seconds, at least 0, or None for no limit",
            "INVALID_FIELD",
            "timeout",
        )
    return float(timeout) if timeout < _FOR_EVER else None


def within(deadline: float, now: float) -> float | None:
    """Return what is left until a deadline, for gRPC; None if there is none."""
    return None if deadline == math.inf else max(deadline - now, 0.0)


def never_served(address: str, seconds: float) -> ServerUnavailableError:
    """Return the error of a server that somebody waited for in vain."""
    return ServerUnavailableError(
        f"the sketchmatch server at {address} did not serve within {seconds:g} s; "
        "start it, check the address, or wait longer"
    )


def is_here(address: str) -> bool:
    """Whether an address is one of this very machine."""
    if address.startswith(_WITHIN_MACHINE):
        return True
    parts = _HOST_AND_PORT.fullmatch(address)
    host = parts["host"].strip("[]").rstrip(".").lower() if parts else ""
    try:
        number = ip_address(host)
    except ValueError:
        return host in _THIS_MACHINE or host.endswith(".localhost")
    number = getattr(number, "ipv4_mapped", None) or number
    return number.is_loopback or number.is_unspecified


def _refused(address: object, remedy: str) -> InvalidRequestError:
    return InvalidRequestError(
        f"address is {reprlib.repr(address)}; {remedy}", "INVALID_FIELD", "address"
    )
