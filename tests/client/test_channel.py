"""Addresses, timeouts and proxies."""

import math
import reprlib
from concurrent import futures

import grpc
import pytest

from sketchmatch_client import (
    AsyncClient,
    Client,
    InvalidRequestError,
    ServerUnavailableError,
    sources,
)
from sketchmatch_client._channel import channel_options
from sketchmatch_proto.v1 import catalog_service_pb2_grpc
from tests.client.fake_server import FakeServer

DIRECT = ("grpc.enable_http_proxy", 0)
SOURCE = sources.image(b"picture")


@pytest.fixture
def proxy(monkeypatch):
    """A proxy that leads nowhere, as the environment names it."""
    for name in ("no_proxy", "NO_PROXY", "no_grpc_proxy"):
        monkeypatch.delenv(name, raising=False)
    for name in ("http_proxy", "https_proxy", "grpc_proxy"):
        monkeypatch.setenv(name, "http://127.0.0.1:9")


@pytest.mark.usefixtures("proxy")
@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "0.0.0.0", "dns:///localhost"])
def test_no_proxy_stands_between_programs_of_one_machine(call, server, host):
    port = server.address.rpartition(":")[2]
    assert call(f"{host}:{port}", "server_info").api_version == "sketchmatch.v1"


@pytest.mark.usefixtures("proxy")
def test_a_socket_of_the_file_system_is_an_address(call, tmp_path):
    fake, address = FakeServer(), f"unix:{tmp_path / 'sketchmatch.sock'}"
    server = grpc.server(futures.ThreadPoolExecutor(2))
    catalog_service_pb2_grpc.add_CatalogServiceServicer_to_server(fake, server)
    server.add_insecure_port(address)
    server.start()
    try:
        assert call(address, "server_info").api_version == "sketchmatch.v1"
    finally:
        server.stop(grace=None).wait()


@pytest.mark.parametrize(
    "address",
    [
        *("127.0.0.1:1", "127.8.9.10:1", "localhost:1", "LOCALHOST.:1", "robot.localhost:1"),
        *("[::1]:1", "[::]:1", "[::ffff:127.0.0.1]:1", "0.0.0.0:1", "ip6-localhost:1"),
        *("ipv4:127.0.0.1:1", "ipv6:[::1]:1", "dns:localhost:1", "dns:///localhost:1"),
        *("dns://8.8.8.8/localhost:1", "unix:run/a.sock", "unix:///run/a.sock", "unix-abstract:a"),
    ],
)
def test_this_machine_is_reached_directly(address):
    assert DIRECT in channel_options(address, ())


@pytest.mark.parametrize(
    "address",
    [
        *("robot:1", "192.168.0.7:1", "[2001:db8::1]:1", "localhost.example:1", "mylocalhost:1"),
        *("128.0.0.1:1", "dns:///robot:1", "ipv4:10.0.0.1:1", "xds:///localhost"),
    ],
)
def test_a_proxy_may_lead_to_other_machines(address):
    assert DIRECT not in channel_options(address, ())


def test_options_that_are_given_win():
    given = ("grpc.enable_http_proxy", 1)
    assert channel_options("localhost:1", (given,))[-1] == given


@pytest.mark.parametrize("kind", [Client, AsyncClient])
@pytest.mark.parametrize(
    ("address", "remedy"),
    [
        ("localhost", "add the port, as in 'localhost:50051'"),
        ("50061", "add the host, as in 'localhost:50061'"),
        ("[::1]", "add the port, as in '[::1]:50051'"),
        ("::1", "give host and port, as in 'localhost:50051' or '[::1]:50051'"),
        ("::1:50051", "give host and port, as in 'localhost:50051' or '[::1]:50051'"),
        ("http://localhost:50051", "give host and port alone, as in 'localhost:50051'"),
        ("localhost:50051/", "give host and port"),
        ("localhost:port", "give host and port"),
        (":50051", "give host and port"),
        ("localhost:0", "give a port from 1 to 65535"),
        ("localhost:65536", "give a port from 1 to 65535"),
        ("unix:", "name a file by a path of at most 107 bytes, as in 'unix:/run/sketchmatch.sock'"),
        ("localhost:" + "9" * 5000, "give a port from 1 to 65535"),
        ("a\0b:50051", "give host and port, as in 'localhost:50051'"),
        ("\ud800:50051", "give host and port, as in 'localhost:50051'"),
        ("", "give host and port"),
        (" ", "give host and port"),
        (None, "give host and port"),
        (50051, "give host and port"),
    ],
)
def test_what_is_no_address_is_refused_at_once(kind, address, remedy):
    with pytest.raises(InvalidRequestError) as caught:
        kind(address)
    assert str(caught.value).startswith(f"address is {reprlib.repr(address)}; {remedy}")
    assert (caught.value.reason, caught.value.field) == ("INVALID_FIELD", "address")


def test_the_path_of_a_socket_is_no_longer_than_a_socket_takes():
    Client(f"unix:{107 * 'x'}").close()
    with pytest.raises(InvalidRequestError, match="; name a file by a path of at most 107 bytes"):
        Client(f"unix:{108 * 'x'}")


@pytest.mark.parametrize(
    "address",
    [
        *("localhost:1", "my_robot:65535", "[::1]:1", "unix:a", "xds:///robot", "dns:///robot"),
        "ipv4:10.0.0.1:50051,10.0.0.2:50051",
    ],
)
def test_what_grpc_takes_is_an_address(address):
    Client(address).close()


def test_tls_has_a_port_of_its_own():
    Client("robot.example", credentials=grpc.ssl_channel_credentials()).close()


@pytest.mark.parametrize("timeout", [math.inf, 1e10, 1e300])
def test_a_timeout_that_never_comes_is_no_limit(call, server, timeout):
    assert call(server.address, "server_info", timeout=timeout).api_version == "sketchmatch.v1"
    assert call(server.address, "events", SOURCE, SOURCE, timeout=timeout)
    call(server.address, "wait_until_serving", timeout=timeout)


def test_a_call_without_limit_overrules_the_limit_of_the_client(server):
    with Client(server.address, timeout=0.0) as client:
        assert client.server_info(timeout=math.inf).api_version == "sketchmatch.v1"


@pytest.mark.parametrize("timeout", [math.nan, -1.0, -math.inf, "5"])
@pytest.mark.parametrize(
    "method", ["match", "events", "segment", "algorithms", "server_info", "wait_until_serving"]
)
def test_what_is_no_time_is_refused(call, server, method, timeout):
    count = {"match": 2, "events": 2, "segment": 1}.get(method, 0)
    with pytest.raises(InvalidRequestError) as caught:
        call(server.address, method, *[SOURCE] * count, timeout=timeout)
    sentence = f"timeout is {timeout!r}; give seconds, at least 0, or None for no limit"
    assert str(caught.value) == sentence
    assert (caught.value.reason, caught.value.field) == ("INVALID_FIELD", "timeout")
    assert not server.requests


@pytest.mark.parametrize("kind", [Client, AsyncClient])
def test_what_is_no_time_is_refused_for_all_calls(kind):
    with pytest.raises(InvalidRequestError, match="timeout is nan"):
        kind("localhost:1", timeout=math.nan)


def test_waiting_for_a_moment_asks_once(call, server):
    server.set_health("NOT_SERVING")
    with pytest.raises(ServerUnavailableError, match="did not serve within 0 s"):
        call(server.address, "wait_until_serving", timeout=0)
