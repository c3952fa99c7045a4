"""What a server lets one request, and all requests together, ask of it."""

from __future__ import annotations

import os
from dataclasses import dataclass, field

from sketchmatch.model.limits import SourceLimits

__all__ = ["Limits"]


@dataclass(frozen=True)
class Limits:
    """Limits of a server.

    Attributes
    ----------
    max_request_bytes
        Size of one request. A little more passes the transport, so that the refusal can be clear.
    max_concurrent_matches
        Matches and segmentations that run at the same time.
    max_time_budget
        Seconds that one match may take, or None for no limit.
    sources
        How large a sketch or a map may be.
    """

    max_request_bytes: int = 64 * 1024 * 1024
    max_concurrent_matches: int = 4 * (os.cpu_count() or 1)
    max_time_budget: float | None = None
    sources: SourceLimits = field(default_factory=SourceLimits)

    @property
    def transport_bytes(self) -> int:
        """Size above which the transport itself refuses a message."""
        return 4 * self.max_request_bytes
