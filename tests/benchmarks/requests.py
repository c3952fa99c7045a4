"""Where the processor time of one small request goes in a worker, from bytes to bytes.

Run it with ``make bench-requests``; with ``ARGS="--against FOLDER"``, another checkout answers the
same requests in turns, and it is said whether its answers are the same. A request is 8 polygons on
the same 8 turned, each time others. Parts are those around the match itself; what they leave is the
work of kernels, searcher and judge. What is asked for seldom takes several times as long as in a
loop of its own, as no cache of the processor holds it any more: so a whole request is measured.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any
from unittest import mock

from rich.console import Console
from rich.table import Table

from tests.benchmarks.asked import Asked

_HERE = Path(__file__).resolve().parents[2]
_OBJECTS = 8
_REQUESTS = 20
_WHOLE = "request"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--against", type=Path, help="another checkout, measured in turns")
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--searcher", default="auto")
    parser.add_argument("--judge", default="confidence")
    given = parser.parse_args()
    sent = _requests(searcher=given.searcher, judge=given.judge)
    checkouts = [_HERE] if given.against is None else [given.against.resolve(), _HERE]
    with ExitStack() as stack:
        processes = [stack.enter_context(_answering(checkout, sent)) for checkout in checkouts]
        # Of each a digest of all answers, and the median seconds of each part of a request.
        rounds = [[json.loads(each.say("go")) for each in processes] for _ in range(given.rounds)]
    digests = {digest for found in rounds for digest, _ in found}
    Console().print(_table([[parts for _, parts in found] for found in rounds]))
    if given.against is not None:
        print("the answers are", "the same" if len(digests) == 1 else "NOT the same")


def _answering(checkout: Path, sent: list[bytes]) -> Asked:
    """Return a process that answers all requests, when it is asked, with a checkout's code."""
    rooms = [checkout / room for room in ("engine", "plugins", "clients/python")]
    path = os.pathsep.join(map(str, (*rooms, _HERE)))
    first = json.dumps([request.hex() for request in sent])
    return Asked("tests.benchmarks.requests", first, PYTHONPATH=path)


def answer() -> None:
    """Read requests and then, for each line, answer them all; the entry of a process."""
    from sketchmatch.app import jobs
    from sketchmatch.app.responses import ResponseWriter
    from sketchmatch.app.setup import Setup
    from sketchmatch.pipeline import answer as answering
    from sketchmatch.pipeline.engine import Engine
    from sketchmatch.pipeline.warmup import warm_up
    from sketchmatch.registry import default_registry
    from sketchmatch_builtin.segmenters.polygons import PolygonSegmenter
    from sketchmatch_proto.v1.match_service_pb2 import MatchRequest

    registry = default_registry()
    warm_up(registry)
    setup = Setup(Engine(registry))
    sent = [bytes.fromhex(request) for request in json.loads(sys.stdin.readline())]
    spent: dict[str, float] = defaultdict(float)

    def timed(name: str, work: Callable[..., Any]) -> Callable[..., Any]:
        def call(*given: Any, **named: Any) -> Any:
            before = time.process_time()
            try:
                return work(*given, **named)
            finally:
                spent[name] += time.process_time() - before

        return call

    def answered(request: bytes) -> list[bytes]:
        decoded = timed("decode", MatchRequest.FromString)(request)
        encoded = timed("encode", lambda response: response.SerializeToString())
        return [encoded(response) for response in jobs.answers(jobs.Job("", decoded), setup)]

    def all_answered() -> tuple[str, dict[str, float]]:
        rows, digest = [], hashlib.sha256()
        for request in sent:
            spent.clear()
            answers = timed(_WHOLE, answered)(request)
            rows.append(dict(spent))
            digest.update(_lasting(answers))
        return digest.hexdigest(), {
            part: median(row.get(part, 0.0) for row in rows) for part in rows[0]
        }

    with ExitStack() as stack:
        for name, holder, attribute in (
            ("decode", jobs.requests, "match_request"),
            ("encode", ResponseWriter, "response"),
            ("polygons", PolygonSegmenter, "segment"),
            ("words", answering, "nearest_relations"),
        ):
            work = timed(name, getattr(holder, attribute))
            stack.enter_context(mock.patch.object(holder, attribute, work))
        for _ in range(3):
            all_answered()
        print("warm", flush=True)
        for _ in sys.stdin:
            print(json.dumps(all_answered()), flush=True)


def _lasting(answers: list[bytes]) -> bytes:
    """Return what of the answers to a request is the same each time."""
    from sketchmatch_proto.v1.match_service_pb2 import MatchResponse

    kept = []
    for encoded in answers:
        response = MatchResponse.FromString(encoded)
        if response.HasField("progress"):
            continue
        response.accepted.match_id = response.result.match_id = ""
        response.result.ClearField("statistics")
        kept.append(response.SerializeToString(deterministic=True))
    return b"".join(kept)


def _requests(**chosen: str) -> list[bytes]:
    from sketchmatch_client import match_request, sources
    from tests.server.harness import shapes, turned

    drawn = [shapes(_OBJECTS, seed) for seed in range(_REQUESTS)]
    return [
        match_request(
            sources.polygons(polygons), sources.polygons(turned(polygons)), **chosen
        ).SerializeToString()
        for polygons in drawn
    ]


def _table(rounds: list[list[dict[str, float]]]) -> Table:
    """Return a table of rounds, each with the parts of one checkout or of two."""
    table = Table(title="processor ms of one request of 8 objects", title_justify="left")
    table.add_column("part")
    both = len(rounds[0]) == 2
    for column in (*(["against", "here", "ratio"] if both else ["here"]), "share"):
        table.add_column(column, justify="right")
    named = [part for part in rounds[0][-1] if part != _WHOLE]
    for part in named:
        _add(table, part, [[found[part] for found in each] for each in rounds], rounds)
    rest = [[found[_WHOLE] - sum(found[p] for p in named) for found in each] for each in rounds]
    _add(table, "all else", rest, rounds)
    table.add_section()
    _add(table, _WHOLE, [[found[_WHOLE] for found in each] for each in rounds], rounds)
    return table


def _add(
    table: Table, name: str, rows: list[list[float]], rounds: list[list[dict[str, float]]]
) -> None:
    medians = [median(column) for column in zip(*rows, strict=True)]
    ratio = [f"{median(new / old for old, new in rows):.2f}"] if len(medians) == 2 else []
    whole = median(found[-1][_WHOLE] for found in rounds)
    figures = [f"{1e3 * value:.3f}" for value in medians]
    table.add_row(name, *figures, *ratio, f"{medians[-1] / whole:.1%}")


if __name__ == "__main__":
    main()
