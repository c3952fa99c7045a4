"""Runs under the oldest grpcio and protobuf that the client supports, against a fake server."""

import asyncio
import sys

import google.protobuf
import grpc

from sketchmatch_client import AsyncClient, Client, InvalidRequestError, sources

IMAGE = sources.image(b"picture")


def match(address: str) -> object:
    with Client(address) as client:
        client.wait_until_serving(timeout=60)
        try:
            return client.match(IMAGE, IMAGE, searcher="easm", time_budget=1).object_map
        except InvalidRequestError as error:
            return error.field


async def match_async(address: str) -> object:
    async with AsyncClient(address) as client:
        await client.wait_until_serving(timeout=60)
        try:
            return (await client.match(IMAGE, IMAGE)).object_map
        except InvalidRequestError as error:
            return error.field


if __name__ == "__main__":
    print(grpc.__version__, google.protobuf.__version__)
    print(match(sys.argv[1]))
    print(asyncio.run(match_async(sys.argv[1])))
