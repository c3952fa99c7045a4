"""Where servers listen, and robots: what an address must have, before anybody guesses the rest."""

from __future__ import annotations

import re
from ipaddress import ip_address

__all__ = ["address_fault", "bridge_fault", "is_of_this_machine", "network_fault"]

_LOCAL = re.compile(r"unix(?:-abstract)?:(.*)", re.S)
_URL = re.compile(r"[a-z][a-z0-9+.-]*://", re.I)
_BRIDGE = re.compile(r"wss?://(?:[\w.-]+|\[[0-9a-f:]+\])(?::\d{1,5})?(?:/[\w./-]*)?", re.I | re.A)
_PORTS = 65_535
_DIGITS = 5
_LONGEST_PATH = 107


def address_fault(address: str) -> str:
    """Return what an address to listen on should be and is not, to follow "it"; empty if sound.

    Parameters
    ----------
    address
        ``HOST:PORT``, ``[IPv6]:PORT``, ``unix:PATH`` or ``unix-abstract:NAME``.

    Examples
    --------
    >>> address_fault("127.0.0.1:50051")
    ''
    >>> address_fault("127.0.0.1")
    'should have a port, as in 127.0.0.1:50051'
    """
    if local := _LOCAL.fullmatch(address):
        return _file_fault(local[1])
    return network_fault(address)


def is_of_this_machine(address: str) -> bool:
    """Whether only programs of this machine reach an address.

    Examples
    --------
    >>> is_of_this_machine("127.0.0.1:50051"), is_of_this_machine("0.0.0.0:50051")
    (True, False)
    """
    if _LOCAL.fullmatch(address):
        return True
    host = address.rpartition(":")[0].strip("[]").lower()
    try:
        number = ip_address(host)
    except ValueError:
        return host == "localhost"
    return (getattr(number, "ipv4_mapped", None) or number).is_loopback


def _file_fault(path: str) -> str:
    if not path or "\0" in path:
        return "should name a file, as in unix:/run/sketchmatch.sock"
    if len(path.encode(errors="surrogateescape")) > _LONGEST_PATH:
        return f"should name a file by a path of at most {_LONGEST_PATH} bytes"
    return ""


def network_fault(address: str) -> str:
    """Return what a host and a port should be and are not, as :func:`address_fault` does."""
    host, colon, port = address.rpartition(":")
    bracketed = host.startswith("[") and host.endswith("]")
    numbered = port.isascii() and port.isdecimal() and len(port) <= _DIGITS
    numbered = numbered and int(port) <= _PORTS
    faults = (
        (_URL.match(address), "be HOST:PORT and not a URL, as in 127.0.0.1:50051"),
        (
            not colon and numbered,
            f"begin with a host, as in 127.0.0.1:{port}, or 0.0.0.0:{port} for all addresses",
        ),
        (not colon, f"have a port, as in {address or '127.0.0.1'}:50051"),
        (
            ":" in host and not bracketed,
            "have brackets around an IPv6 address, as in [::1]:50051",
        ),
        (
            not host.strip("[]") or host.split() != [host] or not host.isprintable(),
            "begin with a host, as in 127.0.0.1:50051, or 0.0.0.0:50051 for all addresses",
        ),
        (not numbered, f"end with a port from 0 to {_PORTS}, as in {host}:50051"),
    )
    return next((f"should {fault}" for wrong, fault in faults if wrong), "")


def bridge_fault(address: str) -> str:
    """Return what is wrong with the address of a ROS bridge; empty if nothing is.

    Examples
    --------
    >>> bridge_fault("ws://robot.local:9090")
    ''
    >>> bridge_fault("robot.local:9090")
    'should each be a WebSocket, as in ws://robot.local:9090'
    """
    # It becomes part of a header, in which spaces, commas and semicolons have a meaning.
    if _BRIDGE.fullmatch(address):
        return ""
    return "should each be a WebSocket, as in ws://robot.local:9090"
