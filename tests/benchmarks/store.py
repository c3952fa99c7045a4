"""What it costs to keep matches: ``python -m tests.benchmarks.store``.

Two servers answer the same 8-object match in turn, one of which keeps what it does; so the ratio of
their latencies means something on a busy machine too.
"""

from __future__ import annotations

import statistics
import time
from contextlib import ExitStack

from sketchmatch_client import Client
from tests.processes import Server
from tests.server.harness import scene

ROUNDS, EACH = 30, 10


def main() -> None:
    """Print the median latency with a store and without, and their ratio."""
    sketch, map_ = scene(8, 0), scene(8, 1)
    taken: dict[str, list[float]] = {"store": [], "no store": []}
    with ExitStack() as stack:
        servers = {"store": Server(), "no store": Server("--no-store")}
        clients = {}
        for name, server in servers.items():
            stack.callback(server.process.wait)
            stack.callback(server.process.terminate)
            clients[name] = stack.enter_context(Client(server.address))
            clients[name].wait_until_serving(120)
        for client in clients.values():
            for _ in range(5):
                client.match(sketch, map_)
        for number in range(ROUNDS):
            for name in sorted(clients, reverse=number % 2 == 1):
                for _ in range(EACH):
                    began = time.perf_counter()
                    clients[name].match(sketch, map_)
                    taken[name].append(time.perf_counter() - began)
    medians = {name: statistics.median(seconds) for name, seconds in taken.items()}
    for name, median in medians.items():
        print(f"{name:10} {1000 * median:6.2f} ms")
    print(f"ratio      {medians['store'] / medians['no store']:6.3f}")


if __name__ == "__main__":
    main()
