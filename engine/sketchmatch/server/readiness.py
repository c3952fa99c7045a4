"""What is ready, as the standard health service tells it: server, services, and algorithms."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from typing import Any

import grpc
from grpc_health.v1 import health, health_pb2

from sketchmatch.registry import Registered

__all__ = ["MOST_WATCHERS", "Readiness"]

MOST_WATCHERS = 1000
"""Streams that may watch health at the same time."""

_Status = health_pb2.HealthCheckResponse
_WHOLE = ""


class _Health(health.aio.HealthServicer):
    """The standard service, with no more streams than a fleet's probes need.

    It answers strangers, whom the names of an operator's plugins do not concern: who asks of one
    knows it.
    """

    def __init__(self) -> None:
        super().__init__()
        self._watchers = 0

    async def Watch(self, request: Any, context: Any) -> None:  # noqa: N802
        """Tell each change, unless too many are told already."""
        if self._watchers >= MOST_WATCHERS:
            await context.abort(
                grpc.StatusCode.RESOURCE_EXHAUSTED,
                f"{MOST_WATCHERS} streams already watch the health of this server, which is the "
                "limit; use Check",
            )
        self._watchers += 1
        try:
            await super().Watch(request, context)
        finally:
            self._watchers -= 1

    async def List(self, _: Any, context: Any) -> None:  # noqa: N802
        """Tell nobody all names that health knows."""
        problem = "this server lists no names; use Check with a name, or '' for the whole server"
        await context.abort(grpc.StatusCode.UNIMPLEMENTED, problem)


class Readiness:
    """Which of the names that health knows are ready.

    The whole server has the empty name, each service that of the contract, and each algorithm
    ``KIND/NAME``, as in ``searcher/easm``: it is ready once its kernels are.

    Parameters
    ----------
    services
        Names of the services.
    """

    def __init__(self, services: Iterable[str]) -> None:
        self.servicer = _Health()
        self._services = tuple(services)
        self._loop = asyncio.get_running_loop()
        self._algorithms: set[str] = set()
        self._ready: set[str] = set()

    @property
    def serving(self) -> bool:
        """Whether requests are answered."""
        return _WHOLE in self._ready

    def states(self) -> dict[str, bool]:
        """Return whether each algorithm is ready."""
        return {name: name in self._ready for name in sorted(self._algorithms)}

    async def know(self, algorithms: Iterable[Registered]) -> None:
        """Know these algorithms from now on, and no others; what was ready stays so."""
        names = {_name(item) for item in algorithms}
        for name in self._algorithms - names:
            await self.servicer.set(name, _Status.SERVICE_UNKNOWN)
        for name in (names - self._algorithms) | {_WHOLE}:
            await self.servicer.set(
                name, _Status.SERVING if name in self._ready else _Status.NOT_SERVING
            )
        self._algorithms = names

    async def serve(self) -> None:
        """Say that requests are answered."""
        self._ready.add(_WHOLE)
        for name in (_WHOLE, *self._services):
            await self.servicer.set(name, _Status.SERVING)

    async def drain(self) -> None:
        """Say that no more requests are taken, whatever is said later."""
        self._ready.discard(_WHOLE)
        await self.servicer.enter_graceful_shutdown()

    def ready(self, item: Registered) -> None:
        """Say that an algorithm's kernels are there; it may be called from any thread."""
        self._ready.add(_name(item))
        asyncio.run_coroutine_threadsafe(self._tell(_name(item)), self._loop)

    async def _tell(self, name: str) -> None:
        if name in self._algorithms:
            await self.servicer.set(name, _Status.SERVING)


def _name(item: Registered) -> str:
    return f"{item.kind}/{item.name}"
