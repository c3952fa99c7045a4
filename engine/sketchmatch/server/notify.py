"""What systemd wants to hear of a service, where it started this one."""

from __future__ import annotations

import os
import socket
from contextlib import suppress

__all__ = ["notify"]


def notify(state: str) -> None:
    """Tell systemd, or whoever else started the server and set ``NOTIFY_SOCKET``; see sd_notify(3).

    Parameters
    ----------
    state
        For example ``"READY=1"``.
    """
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address.startswith(("/", "@")) or not hasattr(socket, "AF_UNIX"):
        return
    if address.startswith("@"):  # of Linux, without a file
        address = f"\0{address[1:]}"
    # Who does not listen need not hear.
    with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
        link.sendto(state.encode(), address)
