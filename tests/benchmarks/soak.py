"""A server is used and disturbed for minutes, and must stay as it is: a soak.

Run it with ``python -m tests.benchmarks.soak --minutes 10``. Callers ask for matches, leave and
cancel some, and keep scenes, while every few seconds the configuration is reloaded, a worker is
killed, and all links are cut. It ends with an error where an answer is wrong or lost, where a match
or a place does not come free, where the log has what nobody foresaw, or where memory, threads,
descriptors or processes of the server are more in the end than they were.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import random
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.table import Table

from sketchmatch_client import AsyncClient, sources
from sketchmatch_client.errors import SketchmatchError
from tests.processes import Server, children_of, memory_of, status_of
from tests.server.harness import ENDLESS, shapes, turned

_MIB = 1024 * 1024
_CALLERS = 6
_RELOAD, _KILL, _CUT, _SAMPLE = 5.0, 3.0, 4.0, 1.0
_PATIENCE = 120.0
_SETTLING = 2.0
_MOST_AT_ONCE, _OTHER_PROCESSES = 8, 4
"""Requests that run at once, each in a process that may wait for another half a minute longer."""
_MORE_THREADS, _MORE_FILES, _FILES_OF_A_PROCESS = 4, 8, 3
_MORE_MEMORY = 48 * _MIB
"""Of the latest matches up to 32 MiB are in memory, and the allocator keeps some more."""
_FORESEEN = ("a worker process ended unexpectedly (signal 9)",)


@dataclass(frozen=True)
class Sample:
    """What a server takes at a moment.

    Attributes
    ----------
    memory
        Bytes of its main process.
    threads, files
        Of its main process, open descriptors among the latter.
    processes
        That it has started, or one of these.
    """

    memory: int
    threads: int
    files: int
    processes: int


@dataclass
class Report:
    """What came of a soak.

    Attributes
    ----------
    done
        How often what was done.
    faults
        What went wrong, a sentence each.
    idle
        What the server took before and after, when nothing was asked of it.
    under_load
        What it took meanwhile, once a second.
    """

    done: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    idle: list[Sample] = field(default_factory=list)
    under_load: list[Sample] = field(default_factory=list)


class _Links:
    """Passes bytes on between callers and a server, and cuts all its links when it is told to."""

    def __init__(self, server: str) -> None:
        self._host, _, port = server.rpartition(":")
        self._port = int(port)
        self._open: set[asyncio.StreamWriter] = set()

    async def start(self) -> str:
        """Return the address at which callers find the server."""
        self._listening = await asyncio.start_server(self._accept, "127.0.0.1", 0)
        return f"127.0.0.1:{self._listening.sockets[0].getsockname()[1]}"

    def end(self) -> None:
        """Pass on nothing more."""
        self._listening.close()
        self.cut()

    def cut(self) -> None:
        """Reset all links."""
        for each in tuple(self._open):
            each.transport.abort()

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        ends = {writer}
        # The server may be away, or the soak over, which streams would tell of.
        with suppress(OSError, asyncio.CancelledError):
            try:
                there, back = await asyncio.open_connection(self._host, self._port)
                ends.add(back)
                self._open |= ends
                await asyncio.gather(self._pass(reader, back), self._pass(there, writer))
            finally:
                self._open -= ends
                for each in ends:
                    each.transport.abort()

    async def _pass(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError):
            while data := await reader.read(65_536):
                writer.write(data)
                await writer.drain()
        writer.close()


class _Soak:
    """Callers and disturbers of one server."""

    def __init__(self, server: Server, config: Path, seed: int) -> None:
        self._server, self._config = server, config
        self._chance = random.Random(seed)
        self._pid = server.process.pid
        self.report = Report()

    async def run(self, seconds: float) -> None:
        """Use and disturb the server for so long, after a while that does not count."""
        self._links = _Links(self._server.address)
        self._address = await self._links.start()
        await self._used(min(10.0, seconds / 4))
        self.report.done.clear()
        await self._at_rest()
        ends = time.monotonic() + seconds
        await self._used(seconds, sampling=True)
        assert time.monotonic() >= ends
        self._links.end()
        await self._at_rest()
        self._judge()

    async def _used(self, seconds: float, sampling: bool = False) -> None:
        ends = time.monotonic() + seconds
        disturbing = [
            asyncio.create_task(self._again(_RELOAD, self._reload)),
            asyncio.create_task(self._again(_KILL, self._kill)),
            asyncio.create_task(self._again(_CUT, self._cut)),
        ]
        if sampling:
            disturbing.append(asyncio.create_task(self._again(_SAMPLE, self._look)))
        try:
            await asyncio.gather(*(self._caller(k, ends) for k in range(_CALLERS)))
        finally:
            for each in disturbing:
                each.cancel()
            await asyncio.gather(*disturbing, return_exceptions=True)

    async def _again(self, seconds: float, what: object) -> None:
        while True:
            await asyncio.sleep(seconds)
            what()  # type: ignore[operator]

    def _reload(self) -> None:
        most = self._chance.choice([700, 800, 900])
        self._config.write_text(f"[limits]\nmax_objects = {most}\n", encoding="utf-8")
        os.kill(self._pid, signal.SIGHUP)
        self.report.done["reloads"] += 1

    def _kill(self) -> None:
        if workers := _workers(self._pid):
            with suppress(ProcessLookupError):
                os.kill(self._chance.choice(workers), signal.SIGKILL)
            self.report.done["workers killed"] += 1

    def _cut(self) -> None:
        self._links.cut()
        self.report.done["cuts of all links"] += 1

    def _look(self) -> None:
        self.report.under_load.append(_sample(self._pid))

    async def _caller(self, number: int, ends: float) -> None:
        kinds = [self._match, self._match, self._match, self._leave, self._cancel, self._keep]
        async with AsyncClient(self._address, retries=20, timeout=_PATIENCE) as client:
            k = 0
            while time.monotonic() < ends:
                k += 1
                kind = self._chance.choice(kinds)
                try:
                    await asyncio.wait_for(kind(client, 1000 * number + k), _PATIENCE)
                except (SketchmatchError, TimeoutError, AssertionError) as error:
                    what = kind.__name__.strip("_")
                    self.report.faults.append(f"{what}: {type(error).__name__}: {error}")

    async def _match(self, client: AsyncClient, seed: int) -> None:
        polygons = shapes(3 + seed % 6, seed)
        found = await client.match(sources.polygons(polygons), sources.polygons(turned(polygons)))
        expected = {k: k for k in range(len(polygons))}
        assert found.object_map == expected, f"seed {seed}: {found.object_map}"
        self.report.done["matches answered"] += 1

    async def _leave(self, client: AsyncClient, seed: int) -> None:
        pair = [sources.polygons(shapes(8, seed + k)) for k in range(2)]
        events = client.events(*pair, **ENDLESS)
        after = self._chance.randrange(1, 6)
        async for _ in events:
            after -= 1
            if not after:
                break
        await events.aclose()
        self.report.done["matches left"] += 1

    async def _cancel(self, client: AsyncClient, seed: int) -> None:
        pair = [sources.polygons(shapes(8, seed + k)) for k in range(2)]
        name = ""
        try:
            async for event in client.events(*pair, **ENDLESS):
                name = name or event.accepted.match_id
                if event.HasField("scenes"):
                    await client.cancel_match(name)
        except SketchmatchError as error:
            if error.reason != "MATCH_CANCELLED":
                raise
        self.report.done["matches cancelled"] += 1

    async def _keep(self, client: AsyncClient, seed: int) -> None:
        source = sources.polygons(shapes(5, seed))
        name = (await client.put_scene(source)).stored_scene.name
        kept = await client.get_scene(name, include_source=True)
        assert kept.source == source, f"seed {seed}: another source comes back"
        await client.delete_scene(name)
        self.report.done["scenes kept and deleted"] += 1

    async def _at_rest(self) -> None:
        """Note what the server takes once nothing is asked of it, and all that was has ended."""
        async with AsyncClient(self._server.address, timeout=_PATIENCE) as client:
            deadline = time.monotonic() + _PATIENCE
            while running := [m async for m in client.matches() if not m.HasField("ended_at")]:
                if time.monotonic() > deadline:
                    self.report.faults.append(f"{len(running)} matches never end")
                    break
                await asyncio.sleep(0.2)
            await self._match(client, 0)
            self.report.done["matches answered"] -= 1
        await asyncio.sleep(_SETTLING)
        self.report.idle.append(_sample(self._pid))

    def _judge(self) -> None:
        before, after = self.report.idle
        most_processes = max(each.processes for each in (*self.report.under_load, after))
        if most_processes > _MOST_AT_ONCE + _OTHER_PROCESSES:
            self.report.faults.append(f"there are {most_processes} processes")
        more = max(0, after.processes - before.processes)
        for name, most in (
            ("threads", _MORE_THREADS),
            ("files", _MORE_FILES + _FILES_OF_A_PROCESS * more),
            ("memory", _MORE_MEMORY),
        ):
            was, is_ = getattr(before, name), getattr(after, name)
            if is_ > was + most:
                self.report.faults.append(f"{name} grow from {was} to {is_}")
        for line in self._server.said:
            wrong = "Traceback" in line or " ERROR " in line
            if wrong and not any(foreseen in line for foreseen in _FORESEEN):
                self.report.faults.append(f"the log has {line!r}")


def _sample(pid: int) -> Sample:
    return Sample(
        memory_of(pid),
        int(status_of(pid)["Threads"]),
        len(list(Path(f"/proc/{pid}/fd").iterdir())),
        len(children_of(pid)),
    )


def _workers(pid: int) -> list[int]:
    """Return the processes that a server's work is done in."""
    found = children_of(pid)
    return [each for each in found if not children_of(each) and "tracker" not in _command(each)]


def _command(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text(encoding="utf-8")
    except OSError:
        return ""


@contextmanager
def _served(folder: Path) -> Iterator[tuple[Server, Path]]:
    config = folder / "sketchmatch.toml"
    config.write_text("", encoding="utf-8")
    server = Server(
        *("--config", str(config), "--store", str(folder / "store"), "--workers", "2"),
        *("--max-matches", str(_MOST_AT_ONCE)),
    )
    try:
        server.wait_for("(serving)$")
        yield server, config
    finally:
        if server.process.poll() is None:
            server.process.terminate()
        server.end()


def soaked(seconds: float, seed: int = 19) -> Report:
    """Use and disturb a server for so long, and return what came of it."""
    with TemporaryDirectory() as folder, _served(Path(folder)) as (server, config):
        soak = _Soak(server, config, seed)
        asyncio.run(soak.run(seconds))
        started = children_of(server.process.pid)
        server.process.terminate()
        if (code := server.end()) != 0:
            soak.report.faults.append(f"the server ends with {code}")
    left = [pid for pid in started if Path(f"/proc/{pid}").exists() and _command(pid)]
    if left:
        soak.report.faults.append(f"{len(left)} processes outlive the server")
    return soak.report


def main() -> int:
    """Soak, print, and return 1 if anything is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=19)
    given = parser.parse_args()
    report = soaked(60.0 * given.minutes, given.seed)
    Console().print(_table(report))
    for what, count in sorted(report.done.items()):
        print(f"{count} {what}")
    for fault in report.faults:
        print(f"wrong: {fault}")
    return 1 if report.faults else 0


def _table(report: Report) -> Table:
    table = Table(title="what the server takes", title_justify="left")
    table.add_column("")
    for column in ("memory, MiB", "threads", "descriptors", "processes"):
        table.add_column(column, justify="right")
    quarter = max(1, len(report.under_load) // 4)
    parts = [report.under_load[k * quarter : (k + 1) * quarter] for k in range(4)]
    rows = [("at rest before", report.idle[:1])]
    rows += [(f"quarter {k + 1} of the time", part) for k, part in enumerate(parts)]
    for name, samples in [*rows, ("at rest after", report.idle[1:])]:
        if samples:
            table.add_row(
                name,
                f"{median(each.memory for each in samples) / _MIB:.0f}",
                *(
                    f"{median(getattr(each, field) for each in samples):.0f}"
                    for field in ("threads", "files", "processes")
                ),
            )
    return table


if __name__ == "__main__":
    sys.exit(main())
