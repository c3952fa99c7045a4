"""How many matches a server answers, and how soon, beside one thread in a process of its own.

Run it with ``make bench-server``. Every round measures each row anew, so that rows compare on a
machine that is busy otherwise: look at the ratios. Where it is very busy, one thread more or less
decides what share of it a program gets; so the table says, too, what the ratio is at most where
all processors are free, by the processor time that an answer costs, that of the clients with it.
Clients send bytes that were serialised once and read answers as bytes, as a load generator does;
they share the machine with the server.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median, quantiles

import grpc
from rich.console import Console
from rich.table import Table

from sketchmatch_client import match_request, sources
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest, MatchResponse
from tests.benchmarks.asked import Asked
from tests.processes import Server, children_of, server
from tests.server.harness import shapes, turned

_MATCH = "/sketchmatch.v1.MatchService/Match"
_OPTIONS = (("grpc.use_local_subchannel_pool", 1), ("grpc.max_receive_message_length", -1))
_LARGE = 100
_BESIDE = 4


@dataclass
class _Load:
    """What some clients got.

    Attributes
    ----------
    seconds
        How long each request took that was answered.
    refused
        How many the server had no room for.
    rate
        Answers a second.
    processor
        Seconds of the server's processor time for each answer.
    clients
        Seconds of the clients' processor time for each answer.
    """

    seconds: list[float] = field(default_factory=list)
    refused: int = 0
    rate: float = 0.0
    processor: float = 0.0
    clients: float = 0.0


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--clients", default="1,8,40", help="how many at the same time")
    parser.add_argument("--seconds", type=float, default=3.0, help="for each row")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--searcher", default="", help="the server's default when left out")
    parser.add_argument("--judge", default="", help="the server's default when left out")
    parser.add_argument("--serve", default="", help='options of the server, as in "--workers 0"')
    given = parser.parse_args()
    chosen = {stage: name for stage in ("searcher", "judge") if (name := getattr(given, stage))}
    small, large = _request(8, chosen), _request(_LARGE, {})
    counts = [int(count) for count in given.clients.split(",")]
    with server(*given.serve.split()) as running, _in_process(small) as alone:
        for table in asyncio.run(_measured(running, alone, small, large, counts, given)):
            Console().print(table)


async def _measured(
    running: Server,
    alone: Asked,
    small: bytes,
    large: bytes,
    counts: list[int],
    given: argparse.Namespace,
) -> list[Table]:
    alone_rates: list[tuple[float, float]] = []
    loads: dict[int, list[_Load]] = {count: [] for count in counts}
    beside: list[_Load] = []
    await _loaded(running, small, max(counts), 1.0)
    for _ in range(given.rounds):
        alone_rates.append(await asyncio.to_thread(_rate, alone, given.seconds))
        for count in counts:
            loads[count].append(await _loaded(running, small, count, given.seconds))
        async with _busy(running.address, large):
            beside.append(await _loaded(running, small, 1, given.seconds))
    return [_rate_table(alone_rates, loads), _latency_table(loads, beside)]


def processor_seconds(pid: int, children: bool = True) -> float:
    """Return the processor time of a process, and of all that it started and that still run."""
    ticks = 0
    for each in (pid, *(children_of(pid) if children else ())):
        with suppress(FileNotFoundError):
            text = Path(f"/proc/{each}/stat").read_text(encoding="ascii")
            ticks += sum(map(int, text.rpartition(")")[2].split()[11:13]))
    return ticks / os.sysconf("SC_CLK_TCK")


async def _loaded(running: Server, request: bytes, clients: int, seconds: float) -> _Load:
    """Let some clients, each with a connection of its own, send one request after the other."""
    address, server_pid = running.address, running.process.pid
    load, began, spent = _Load(), time.monotonic(), processor_seconds(server_pid)
    own = time.process_time()

    async def client() -> None:
        async with grpc.aio.insecure_channel(address, options=_OPTIONS) as channel:
            call = channel.unary_stream(_MATCH)
            while (asked := time.monotonic()) < began + seconds:
                try:
                    answers = [answer async for answer in call(request)]
                except grpc.aio.AioRpcError as error:
                    if error.code() is not grpc.StatusCode.RESOURCE_EXHAUSTED:
                        raise
                    load.refused += 1
                    await asyncio.sleep(0.1)
                    continue
                assert MatchResponse.FromString(answers[-1]).HasField("result")
                load.seconds.append(time.monotonic() - asked)

    await asyncio.gather(*(client() for _ in range(clients)))
    load.rate = len(load.seconds) / (time.monotonic() - began)
    answers = max(1, len(load.seconds))
    load.processor = (processor_seconds(server_pid) - spent) / answers
    load.clients = (time.process_time() - own) / answers
    return load


@asynccontextmanager
async def _busy(address: str, request: bytes) -> AsyncIterator[None]:
    """Keep a server busy with large matches."""

    async def client() -> None:
        async with grpc.aio.insecure_channel(address, options=_OPTIONS) as channel:
            while True:
                with suppress(grpc.aio.AioRpcError):  # it waited too long for its turn
                    async for _ in channel.unary_stream(_MATCH)(request):
                        pass

    clients = [asyncio.create_task(client()) for _ in range(_BESIDE)]
    await asyncio.sleep(1.0)
    try:
        yield
    finally:
        for each in clients:
            each.cancel()
        ends = await asyncio.gather(*clients, return_exceptions=True)
        assert all(isinstance(end, asyncio.CancelledError) for end in ends), ends
        await asyncio.sleep(0.5)


def _in_process(request: bytes) -> Asked:
    """Return a process whose one thread answers a request again and again."""
    return Asked("tests.benchmarks.server", request.hex())


def _rate(alone: Asked, seconds: float) -> tuple[float, float]:
    """Return how many answers it gives a second, and the processor seconds of each."""
    rate, processor = alone.say(f"{seconds}").split()
    return float(rate), float(processor)


def answer() -> None:
    """Read a request and then, again and again, for how many seconds it is to be answered."""
    from sketchmatch.app.jobs import Job, answers
    from sketchmatch.app.setup import Setup
    from sketchmatch.pipeline.engine import Engine
    from sketchmatch.pipeline.warmup import warm_up
    from sketchmatch.registry import default_registry

    warm_up(default_registry())
    setup, request = Setup(Engine(default_registry())), bytes.fromhex(sys.stdin.readline())

    def answered() -> None:
        job = Job("", MatchRequest.FromString(request))
        assert [response.SerializeToString() for response in answers(job, setup)]

    for _ in range(10):
        answered()
    print("warm", flush=True)
    for line in sys.stdin:
        began, spent, count = time.monotonic(), time.process_time(), 0
        while time.monotonic() < began + float(line):
            answered()
            count += 1
        rate, spent = count / (time.monotonic() - began), time.process_time() - spent
        print(rate, spent / count, flush=True)


def _request(objects: int, chosen: dict[str, str]) -> bytes:
    polygons = shapes(objects)
    sent: MatchRequest = match_request(
        sources.polygons(polygons), sources.polygons(turned(polygons)), **chosen
    )
    return sent.SerializeToString()


def _rate_table(alone: list[tuple[float, float]], loads: dict[int, list[_Load]]) -> Table:
    table = _table(
        "answers a second, 8 objects",
        "median",
        "× one thread in process",
        "processor ms",
        "clients' ms",
        "× at most by processor time",
        "refused",
    )
    spent = 1e3 * median(seconds for _, seconds in alone)
    rates = [rate for rate, _ in alone]
    table.add_row(
        "one thread in process", f"{median(rates):.0f}", "1.00", f"{spent:.1f}", *[""] * 3
    )
    for count, rounds in loads.items():
        most = min(count, os.cpu_count() or 1)
        bounds = [
            most * seconds / (load.processor + load.clients)
            for load, (_, seconds) in zip(rounds, alone, strict=True)
        ]
        ratios = [load.rate / rate for load, rate in zip(rounds, rates, strict=True)]
        table.add_row(
            f"{count} clients",
            f"{median(load.rate for load in rounds):.0f}",
            f"{median(ratios):.2f} ({min(ratios):.2f} … {max(ratios):.2f})",
            f"{1e3 * median(load.processor for load in rounds):.1f}",
            f"{1e3 * median(load.clients for load in rounds):.1f}",
            f"{median(bounds):.2f}",
            f"{sum(load.refused for load in rounds)}",
        )
    return table


def _latency_table(loads: dict[int, list[_Load]], beside: list[_Load]) -> Table:
    table = _table("ms until the result, 8 objects", "p50", "p99", "max")
    rows = {f"{count} clients": rounds for count, rounds in loads.items()}
    rows[f"1 client beside {_BESIDE} matches of {_LARGE} objects"] = beside
    for name, rounds in rows.items():
        times = [1e3 * seconds for load in rounds for seconds in load.seconds] or [0.0] * 2
        figures: list[Callable[[list[float]], float]] = [
            median,
            lambda values: quantiles(values, n=100, method="inclusive")[98],
            max,
        ]
        table.add_row(name, *(f"{figure(times):.0f}" for figure in figures))
    return table


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left")
    table.add_column("")
    for column in columns:
        table.add_column(column, justify="right")
    return table


if __name__ == "__main__":
    main()
