"""What becomes of a call whose caller has gone."""

import asyncio

import grpc
import pytest

from sketchmatch.server.interceptors import ErrorInterceptor


def test_a_call_whose_caller_has_gone_is_cancelled_and_not_well_done():
    async def write(_request, _context):
        raise grpc.aio.InternalError("nobody reads this")

    async def handler_of(_details):
        return grpc.unary_stream_rpc_method_handler(write)

    class Details:
        method = "/sketchmatch.v1.MatchService/Match"

    async def call():
        handler = await ErrorInterceptor().intercept_service(handler_of, Details())
        await handler.unary_stream(None, None)

    with pytest.raises(asyncio.CancelledError):
        asyncio.run(call())
