"""Break requests of every method for minutes: ``python -m tests.fuzz.messages --minutes 10``.

A server of its own gets golden requests, and whole ones that it can answer, with some bytes or some
fields changed. It must answer each, within its time, or refuse it by a status that is for bad
input: none may end it, let it hang, or be a fault of its own.
"""

from __future__ import annotations

import argparse
import itertools
import math
import random
import struct
import sys
import time
from collections import Counter, deque
from contextlib import suppress
from dataclasses import dataclass, field

import grpc
from google.protobuf import message_factory
from google.protobuf.descriptor import FieldDescriptor, MethodDescriptor
from google.protobuf.message import Message

from sketchmatch_client import Client, Sketch, sources
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest
from sketchmatch_proto.v1.scene_service_pb2 import PutSceneRequest, SegmentRequest
from sketchmatch_proto.v1.sketch_service_pb2 import (
    CreateSketchRequest,
    CreateSketchResponse,
    UpdateSketchRequest,
)
from sketchmatch_proto.v1.source_pb2 import Source
from sketchmatch_proto.v1.transfer_service_pb2 import TransferRequest
from tests.contract.golden import FILES, NAMES, golden
from tests.processes import Server, children_of, memory_of
from tests.server.harness import shapes, turned

METHODS: tuple[MethodDescriptor, ...] = tuple(
    method
    for file in FILES
    for service in file.services_by_name.values()
    for method in service.methods
)
"""Those of the contract."""

_REFUSALS = frozenset(
    {
        grpc.StatusCode.OK,
        grpc.StatusCode.CANCELLED,
        grpc.StatusCode.DEADLINE_EXCEEDED,
        grpc.StatusCode.FAILED_PRECONDITION,
        grpc.StatusCode.INVALID_ARGUMENT,
        grpc.StatusCode.NOT_FOUND,
        grpc.StatusCode.RESOURCE_EXHAUSTED,
    }
)
_PATIENCE, _OVERTIME = 5.0, 10.0
_ENDLESS = {"WatchSketch": 0.3}
_READ = 50
_NAMED_EVERY = 10
_NUMBERS = (0, 1, -1, 255, 65_536, 2**31 - 1, -(2**31), 2**32 - 1, 2**63 - 1, -(2**63), 2**64 - 1)
_REALS = (0.0, -0.0, 1e-308, 5e-324, 1e308, -1e308, math.inf, -math.inf, math.nan, 1e15, 0.5)
_TEXTS = (
    "",
    "\0",
    "a" * 5000,
    "𝒳\u202e",
    "../../etc/passwd",
    "rooms",
    "exact",
    "posterior",
    "%s{}",
)
_BOUNDS = {
    FieldDescriptor.TYPE_INT32: (-(2**31), 2**31 - 1),
    FieldDescriptor.TYPE_UINT32: (0, 2**32 - 1),
    FieldDescriptor.TYPE_INT64: (-(2**63), 2**63 - 1),
    FieldDescriptor.TYPE_UINT64: (0, 2**64 - 1),
    FieldDescriptor.TYPE_ENUM: (-(2**31), 2**31 - 1),
}


@dataclass
class Report:
    """What came of broken requests.

    Attributes
    ----------
    codes
        How often each method ended how.
    findings
        What may not be: the method, the request as hexadecimal digits, and why.
    memory
        MiB that the server and its workers have at the beginning and in the end.
    """

    codes: Counter[tuple[str, str]] = field(default_factory=Counter)
    findings: list[str] = field(default_factory=list)
    memory: list[float] = field(default_factory=list)


def requests_of(method: MethodDescriptor) -> list[Message]:
    """Return valid requests of a method: the golden ones, and some that are answered whole."""
    kind = method.input_type.name
    found = [golden(name) for name in NAMES if name.split(".")[0] == kind]
    sides = _sides()
    cells = [[100 * (abs(x - 8) > 6 or y % 9 < 2) for x in range(17)] for y in range(20)]
    grid = sources.occupancy_grid(cells, 0.5)
    lines = sources.strokes([[*ring, ring[0]] for ring in map(list, shapes(4, 1))])
    match kind:
        case "MatchRequest":
            found += [MatchRequest(sketch=a, map=b) for a, b in (sides, (lines, grid))]
        case "SegmentRequest" | "PutSceneRequest":
            made = SegmentRequest if kind == "SegmentRequest" else PutSceneRequest
            found += [made(source=source) for source in (*sides, grid, lines)]
        case "CreateSketchRequest":
            found.append(CreateSketchRequest(match=MatchRequest(map=sides[1])))
        case "UpdateSketchRequest":
            found.append(UpdateSketchRequest(set_strokes=golden("UpdateSketchRequest").set_strokes))
        case "TransferRequest":
            features = golden("TransferRequest").features
            found.append(TransferRequest(sketch=sides[0], map=sides[1], features=features))
    return found or [message_factory.GetMessageClass(method.input_type)()]


def _sides() -> tuple[Source, Source]:
    outlines = shapes(4, 1)
    return sources.polygons(turned(outlines)), sources.polygons(outlines, ["bed", "", "a", ""])


def _named(
    client: Client, seeds: dict[MethodDescriptor, list[Message]], sketches: list[str]
) -> None:
    """Let requests name what there is: a scene, the only sketch in progress, and a match."""
    drawn, mapped = _sides()
    scene = client.put_scene(mapped).stored_scene.name
    while sketches:
        Sketch(client, sketches.pop()).delete()
    sketch = client.sketch(sources.stored_scene(scene)).id
    sketches.append(sketch)
    match = client.match(drawn, sources.stored_scene(scene)).result.match_id
    for messages in seeds.values():
        for message in messages:
            for name, value in (("name", scene), ("sketch_id", sketch), ("match_id", match)):
                if name in message.DESCRIPTOR.fields_by_name:
                    setattr(message, name, value)


def broken(rng: random.Random, message: Message) -> bytes:
    """Return the bytes of a message with a few fields or a few bytes changed."""
    changed = type(message)()
    changed.CopyFrom(message)
    for _ in range(rng.randrange(4)):
        _change(rng, changed)
    data = bytearray(changed.SerializeToString())
    for _ in range(rng.choice((0, 0, 1, 3))):
        at = rng.randrange(len(data) + 1)
        match rng.randrange(4):
            case 0 if data:
                data[at % len(data)] = rng.randrange(256)
            case 1:
                del data[at : at + rng.randrange(1, 30)]
            case 2:
                data[at:at] = data[rng.randrange(len(data) + 1) :][:200]
            case _:
                data[at:at] = struct.pack("<Q", rng.choice(_NUMBERS) % 2**64)
    return bytes(data)


def _change(rng: random.Random, message: Message) -> None:
    """Change a field of a message, or of one within it."""
    present = [
        (described, value) for described, value in message.ListFields() if described.message_type
    ]
    if present and rng.random() < 0.8:
        described, value = rng.choice(present)
        if described.message_type.GetOptions().map_entry:
            message.ClearField(described.name)
        elif not described.is_repeated:
            _change(rng, value)
        elif value and rng.random() < 0.8:
            _change(rng, rng.choice(value))
        elif rng.random() < 0.5:
            value.extend([*value][: rng.randrange(1, 40)])
        else:
            del value[rng.randrange(len(value) + 1) :]
        return
    described = rng.choice(message.DESCRIPTOR.fields or [None])
    if described is None:
        return
    if described.message_type or rng.random() < 0.2:
        message.ClearField(described.name)
        if described.message_type and not described.is_repeated and rng.random() < 0.5:
            getattr(message, described.name).SetInParent()
        return
    value = _value(rng, described)
    if described.is_repeated:
        getattr(message, described.name).extend([value] * rng.choice((1, 2, 100)))
    else:
        setattr(message, described.name, value)


def _value(rng: random.Random, described: FieldDescriptor) -> object:
    match described.type:
        case FieldDescriptor.TYPE_DOUBLE | FieldDescriptor.TYPE_FLOAT:
            return rng.choice(_REALS)
        case FieldDescriptor.TYPE_BOOL:
            return rng.random() < 0.5
        case FieldDescriptor.TYPE_STRING:
            return rng.choice(_TEXTS)
        case FieldDescriptor.TYPE_BYTES:
            return rng.randbytes(rng.randrange(60))
    low, high = _BOUNDS[described.type]
    return min(max(rng.choice(_NUMBERS), low), high)


def fuzzed(seconds: float, seed: int) -> Report:
    """Send broken requests to a server for some time, the methods in turn."""
    report, rng = Report(), random.Random(seed)
    running = Server("--max-time-budget", "3", "--default-time-budget", "2")
    try:
        running.wait_for("serving$")
        report.memory.append(_mebibytes(running))
        with grpc.insecure_channel(running.address) as channel, Client(running.address) as client:
            calls = {each: _call(channel, each) for each in METHODS}
            seeds = {each: requests_of(each) for each in METHODS}
            sketches: list[str] = []
            end = time.monotonic() + seconds
            for turn in itertools.count():
                if time.monotonic() >= end or running.process.poll() is not None:
                    break
                if turn % _NAMED_EVERY == 0:  # some requests delete what there is
                    _named(client, seeds, sketches)
                for method, call in calls.items():
                    data = broken(rng, rng.choice(seeds[method]))
                    began = time.monotonic()
                    code, said = _ended(call, data, _ENDLESS.get(method.name, _PATIENCE))
                    if method.name == "CreateSketch" and code is grpc.StatusCode.OK:
                        sketches.append(CreateSketchResponse.FromString(said).sketch_id)
                    report.codes[method.name, code.name] += 1
                    problem = "" if code in _REFUSALS else f"it is {code.name} ({said!r})"
                    if time.monotonic() - began > _PATIENCE + _OVERTIME:
                        problem = "it hangs beyond its deadline"
                    if problem:
                        report.findings.append(f"{method.name} {data.hex()}: {problem}")
        if running.process.poll() is not None:
            report.findings.append(f"the server ended: {running.said[-5:]}")
            return report
        with Client(running.address) as client:
            if not client.is_serving():
                report.findings.append("the server does not serve any more")
        report.memory.append(_mebibytes(running))
        report.findings += [line for line in running.said if "Traceback" in line]
    finally:
        running.process.terminate()
        running.end()
    return report


def _call(channel: grpc.Channel, method: MethodDescriptor) -> grpc.UnaryStreamMultiCallable:
    path = f"/{method.containing_service.full_name}/{method.name}"
    if method.server_streaming:
        return channel.unary_stream(path)
    unary = channel.unary_unary(path)
    return lambda data, timeout: iter([unary(data, timeout=timeout)])


def _ended(
    call: grpc.UnaryStreamMultiCallable, data: bytes, patience: float
) -> tuple[grpc.StatusCode, bytes]:
    """Return how a call ended, and what was answered or said at last.

    Not all is read of what never ends by itself.
    """
    last: deque[bytes] = deque(maxlen=1)
    try:
        answers = call(data, timeout=patience)
        last.extend(itertools.islice(answers, _READ))
        if hasattr(answers, "cancel"):
            answers.cancel()
    except grpc.RpcError as error:
        return error.code(), error.details().encode()
    return grpc.StatusCode.OK, last[0] if last else b""


def _mebibytes(running: Server) -> float:
    """Return the resident memory of a server and of all that it has started."""
    total = memory_of(running.process.pid)
    for child in children_of(running.process.pid):
        with suppress(OSError):  # it has ended meanwhile
            total += memory_of(child)
    return total / 2**20


def main() -> int:
    """Break requests, and say what came of them."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.messages")
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=random.randrange(2**32))
    chosen = parser.parse_args()
    print(f"seed {chosen.seed}", flush=True)
    report = fuzzed(60.0 * chosen.minutes, chosen.seed)
    for method in METHODS:
        own = {code: n for (name, code), n in report.codes.items() if name == method.name}
        print(f"{method.name}: {', '.join(f'{n} {code}' for code, n in sorted(own.items()))}")
    print(f"MiB before and after: {', '.join(f'{each:.0f}' for each in report.memory)}")
    print(*report.findings, f"{len(report.findings)} findings", sep="\n")
    return 1 if report.findings else 0


if __name__ == "__main__":
    sys.exit(main())
