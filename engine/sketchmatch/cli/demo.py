"""``sketchmatch demo``: the bundled living room, matched by a real server."""

from __future__ import annotations

import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from sketchmatch.cli.options import Access, say, to_path
from sketchmatch.cli.output import answering, clean, tell

__all__ = ["demo"]

_START_SECONDS = 120.0
_STOP_SECONDS = 10.0


@answering
def demo(
    overlay: Annotated[
        Path,
        typer.Option(
            "--overlay", metavar="FILE", help="Draw the answer into this picture.", parser=to_path
        ),
    ] = Path("demo-overlay.png"),
    seed: Annotated[int, typer.Option(help="Random seed: same seed, same answer.")] = 0,
) -> None:
    """Match a sketch of a living room with a robot's map of it.

    Starts a server in a process of its own, asks it over gRPC, shows the search while it runs,
    prints which sketched object is which mapped object, and draws both.
    """
    with _server() as server:
        # The server starts while this process loads what it needs.
        from sketchmatch.cli import display, pictures
        from sketchmatch.cli.answering import answerer
        from sketchmatch.cli.sources import in_metres, source_of
        from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH

        pictures.check_path(overlay)
        with answerer(_address(server), None, Access(tls=False)) as asked:
            sources = source_of(LIVING_ROOM_SKETCH), source_of(LIVING_ROOM_MAP)
            answer = display.watch(asked.events(*sources, seed=seed))
    metres = in_metres(sources[1])
    pictures.draw_match(answer, LIVING_ROOM_MAP, overlay, metres)
    display.show_match(answer, metres, verbose=False)
    say(f"the picture is in {overlay}")
    say("draw a place yourself: sketchmatch serve --web (in a checkout, make pad)")


@contextmanager
def _server() -> Iterator[subprocess.Popen[str]]:
    """Run a server in a process of its own."""
    command = [sys.executable, "-m", "sketchmatch", "serve", "--address", "127.0.0.1:0"]
    # Whatever the configuration says of strangers: it is of this machine, and not for long.
    for option in ("--tls-certificate", "--tls-key", "--tls-client-ca", "--tokens"):
        command += [option, ""]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, encoding="utf-8")
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(_STOP_SECONDS)
        except subprocess.TimeoutExpired:
            process.kill()


def _address(process: subprocess.Popen[str]) -> str:
    """Return where a server listens once it serves, and pass on what it says from then on."""
    from sketchmatch_client import Client

    assert process.stderr is not None
    for line in process.stderr:
        tell(f"[server] {clean(line.rstrip())}")
        if found := re.search(r"listening on (\S+)", line):
            threading.Thread(target=_pass_on, args=(process,), daemon=True).start()
            with Client(found[1], tls=False, token="") as client:
                client.wait_until_serving(_START_SECONDS)
            return found[1]
    raise RuntimeError("the server of the demo ended before it began to listen")


def _pass_on(process: subprocess.Popen[str]) -> None:
    assert process.stderr is not None
    for line in process.stderr:
        tell(f"[server] {clean(line.rstrip())}")
