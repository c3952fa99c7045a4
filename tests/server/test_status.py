from urllib.parse import quote

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.server.status import refusal


def test_a_refusal_fits_into_the_8_kib_that_grpc_has_for_trailers_whatever_it_quotes():
    long = "ζ" * 100_000
    refused = refusal(InvalidInputError(Reason.INVALID_FIELD, long, long))
    (_, details), *_ = refused.trailing_metadata
    assert len(quote(refused.message)) + 4 / 3 * len(details) < 8 * 1024
    assert refused.message.endswith("…")


def test_what_nobody_foresaw_tells_the_caller_nothing_of_the_servers_inside():
    refused = refusal(RuntimeError("password is 1234"))
    assert "1234" not in refused.message
    assert "report" in refused.message
