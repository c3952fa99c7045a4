"""Golden messages: what goes over the wire, written by hand. ``golden/README.md`` has more."""

import json
from pathlib import Path
from typing import Any

from google.protobuf import descriptor_pool, json_format, message_factory
from google.protobuf.message import Message
from google.rpc import error_details_pb2, status_pb2

from sketchmatch_proto.v1 import (
    catalog_service_pb2,
    errors_pb2,
    match_pb2,
    match_service_pb2,
    pipeline_pb2,
    scene_pb2,
    scene_service_pb2,
    sketch_service_pb2,
    source_pb2,
    transfer_service_pb2,
)

FOLDER = Path(__file__).with_name("golden")
NAMES = sorted(path.stem for path in FOLDER.glob("*.json"))
KINDS = [line.split() for line in (FOLDER / "kinds.txt").read_text(encoding="utf-8").splitlines()]
"""Number and name of each code, its error in Python and C++, its failure in TypeScript."""
FILES = tuple(
    module.DESCRIPTOR
    for module in (
        catalog_service_pb2,
        errors_pb2,
        match_pb2,
        match_service_pb2,
        pipeline_pb2,
        scene_pb2,
        scene_service_pb2,
        sketch_service_pb2,
        source_pb2,
        transfer_service_pb2,
    )
)
"""The contract."""
DETAILS = (error_details_pb2.ErrorInfo, error_details_pb2.BadRequest, error_details_pb2.RetryInfo)
"""What a status holds; whoever reads its JSON must know these."""


def golden(name: str) -> Any:
    """Return a golden message; its name begins with that of its type."""
    kind = name.split(".", maxsplit=1)[0]
    full_name = status_pb2.Status.DESCRIPTOR.full_name
    if kind != "Status":
        full_name = f"sketchmatch.v1.{kind}"
    described = descriptor_pool.Default().FindMessageTypeByName(full_name)
    message = message_factory.GetMessageClass(described)()
    return json_format.ParseDict(as_written(name), message)


def as_written(name: str) -> Any:
    """Return the JSON of a golden message."""
    return json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))


def as_json(message: Message) -> Any:
    """Return a message as protobuf's own JSON."""
    return json_format.MessageToDict(message)
