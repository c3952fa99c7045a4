"""Runs under the oldest grpcio and protobuf that the client supports, against a fake server."""

import asyncio
import sys
from threading import Timer

import google.protobuf
import grpc

from sketchmatch_client import (
    AsyncClient,
    CallCancelledError,
    Client,
    InvalidRequestError,
    sources,
)

IMAGE = sources.image(b"picture")


def match(address: str) -> object:
    with Client(address) as client:
        client.wait_until_serving(timeout=60)
        try:
            return client.match(IMAGE, IMAGE, searcher="easm", time_budget=1).object_map
        except InvalidRequestError as error:
            return error.field


def cancel(address: str) -> object:
    """Cancel a match from another thread."""
    with Client(address, timeout=60) as client, client.events(IMAGE, IMAGE) as call:
        first = next(call).WhichOneof("event")
        Timer(0.2, call.cancel).start()
        try:
            return call.result()
        except CallCancelledError:
            return f"cancelled after {first}"


async def match_async(address: str) -> object:
    async with AsyncClient(address) as client:
        await client.wait_until_serving(timeout=60)
        try:
            return (await client.match(IMAGE, IMAGE)).object_map
        except InvalidRequestError as error:
            return error.field


if __name__ == "__main__":
    print(grpc.__version__, google.protobuf.__version__)
    address, *what = sys.argv[1:]
    if what == ["cancel"]:
        print(cancel(address))
    else:
        print(match(address))
        print(asyncio.run(match_async(address)))
