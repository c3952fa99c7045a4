"""What it costs to keep matches: ``python -m tests.benchmarks.store``.

Two servers answer the same 8-object match in turn, one of which keeps what it does; so the ratios
of their latencies, and of the processor time that they spent, mean something on a busy machine.
"""

from __future__ import annotations

import statistics
import time
from contextlib import ExitStack

from sketchmatch_client import Client
from tests.benchmarks.server import processor_seconds
from tests.processes import Server
from tests.server.harness import scene

ROUNDS, EACH = 30, 10


def main() -> None:
    """Print median latency and processor time with a store and without, and their ratios."""
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
        pids = {name: server.process.pid for name, server in servers.items()}
        spent = {name: -processor_seconds(pid) for name, pid in pids.items()}
        for number in range(ROUNDS):
            for name in sorted(clients, reverse=number % 2 == 1):
                for _ in range(EACH):
                    began = time.perf_counter()
                    clients[name].match(sketch, map_)
                    taken[name].append(time.perf_counter() - began)
        spent = {name: spent[name] + processor_seconds(pid) for name, pid in pids.items()}
    medians = {name: statistics.median(seconds) for name, seconds in taken.items()}
    for name, median in medians.items():
        each = spent[name] / (ROUNDS * EACH)
        print(f"{name:10} {1000 * median:6.2f} ms {1000 * each:6.2f} ms of processors")
    ratios = [each["store"] / each["no store"] for each in (medians, spent)]
    print(f"ratio      {ratios[0]:6.3f}    {ratios[1]:6.3f}")


if __name__ == "__main__":
    main()
