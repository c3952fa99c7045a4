"""How clients get in: what is said by argument or by the environment, and what is refused."""

import asyncio
import subprocess

import grpc
import pytest

from sketchmatch_client import (
    AsyncClient,
    Client,
    InvalidRequestError,
    NotAuthenticatedError,
    sources,
)
from tests.certificates import Authority

SOURCE = sources.image(b"picture")
TOKEN = "robot-7.s3cret"
NAMES = ("TOKEN", "TOKEN_FILE", "TLS", "ROOT_CERTIFICATES", "CERTIFICATE", "KEY")


@pytest.fixture(autouse=True)
def _nothing_around(monkeypatch):
    for name in NAMES:
        monkeypatch.delenv(f"SKETCHMATCH_{name}", raising=False)


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    return Authority(tmp_path_factory.mktemp("authority"), "authority").issue("robot-7")


@pytest.fixture(params=[Client, AsyncClient])
def kind(request):
    return request.param


def shown_by(server, **access):
    """Return what a server is shown as authorization by both clients."""
    with Client(server.address, timeout=60, **access) as client:
        client.server_info()

    async def ask():
        async with AsyncClient(server.address, timeout=60, **access) as client:
            await client.server_info()

    asyncio.run(ask())
    first, second = server.authorizations[-2:]
    assert first == second
    return first


@pytest.mark.parametrize(
    ("method", "count"),
    [("match", 2), ("events", 2), ("segment", 1), ("algorithms", 0), ("server_info", 0)],
)
def test_a_token_goes_with_every_call(server, call, monkeypatch, method, count):
    monkeypatch.setenv("SKETCHMATCH_TOKEN", TOKEN)
    call(server.address, method, *[SOURCE] * count)
    assert server.authorizations == [f"Bearer {TOKEN}"]


def test_without_a_token_nothing_is_shown(server):
    assert shown_by(server) is None
    assert shown_by(server, token="") is None


def test_a_token_may_be_in_a_file_or_in_the_environment(server, monkeypatch, tmp_path):
    file, other = tmp_path / "token", tmp_path / "other"
    file.write_text(f"{TOKEN}\n")
    other.write_text("pad.other")
    assert shown_by(server, token_file=file) == f"Bearer {TOKEN}"
    monkeypatch.setenv("SKETCHMATCH_TOKEN_FILE", str(other))
    assert shown_by(server) == "Bearer pad.other"
    monkeypatch.setenv("SKETCHMATCH_TOKEN", "pad.variable")
    assert shown_by(server) == "Bearer pad.variable"
    assert shown_by(server, token_file=file) == f"Bearer {TOKEN}"
    assert shown_by(server, token=TOKEN) == f"Bearer {TOKEN}"
    assert shown_by(server, token="") is None


@pytest.mark.parametrize("token", ["a b", "a\nb", "ä", "\0", 7, b"robot.token"])
def test_what_is_no_token_is_refused_and_not_repeated(kind, token):
    with pytest.raises(InvalidRequestError) as caught:
        kind("localhost:1", token=token)
    assert str(caught.value) == "token is not a token; give what `sketchmatch tokens add` printed"
    assert caught.value.field == "token"


@pytest.mark.parametrize("address", ["robot:1", "192.168.0.7:1", "dns:///robot:1", "[::2]:1"])
def test_a_token_does_not_leave_this_machine_without_encryption(kind, address, monkeypatch):
    with pytest.raises(InvalidRequestError) as caught:
        kind(address, token=TOKEN)
    assert str(caught.value) == (
        f"token would go to {address} without encryption, so others could read it; give the "
        "root_certificates of the server's authority, or switch on tls"
    )
    monkeypatch.setenv("SKETCHMATCH_TOKEN", TOKEN)
    with pytest.raises(InvalidRequestError, match=r"^SKETCHMATCH_TOKEN would go to "):
        kind(address)


@pytest.mark.parametrize("address", ["localhost:1", "127.0.0.1:1", "[::1]:1", "unix:/run/a.sock"])
def test_on_this_machine_a_token_needs_no_encryption(address):
    Client(address, token=TOKEN).close()


def test_with_encryption_of_any_kind_a_token_may_go_anywhere(pair):
    for access in (
        {"tls": True},
        {"root_certificates": pair.certificate},
        {"root_certificates": pair.certificate.read_bytes()},
        {"certificate": pair.certificate, "key": str(pair.key)},
        {"credentials": grpc.ssl_channel_credentials()},
    ):
        Client("robot.example", token=TOKEN, **access).close()


def test_the_environment_says_what_arguments_leave_out(kind, pair, monkeypatch):
    monkeypatch.setenv("SKETCHMATCH_ROOT_CERTIFICATES", str(pair.certificate))
    monkeypatch.setenv("SKETCHMATCH_CERTIFICATE", str(pair.certificate))
    monkeypatch.setenv("SKETCHMATCH_KEY", str(pair.key))
    kind("robot", token=TOKEN)  # without a port: it is encrypted
    with pytest.raises(InvalidRequestError, match="add the port"):
        kind("robot", tls=False)


@pytest.mark.parametrize(("text", "encrypted"), [("1", True), ("TRUE", True), ("0", False)])
def test_a_variable_says_whether_to_encrypt(kind, monkeypatch, text, encrypted):
    monkeypatch.setenv("SKETCHMATCH_TLS", text)
    if encrypted:
        kind("robot")
    else:
        with pytest.raises(InvalidRequestError, match="add the port"):
            kind("robot")


def test_what_contradicts_itself_or_is_no_pem_is_refused_by_name(kind, pair, monkeypatch, tmp_path):
    text, away = tmp_path / "text", tmp_path / "away"
    text.write_text("no PEM")
    credentials = grpc.ssl_channel_credentials()
    pem, key = pair.certificate, pair.key
    for field, access, problem in (
        ("certificate", {"certificate": pem}, "is given without key; give both"),
        ("key", {"key": key}, "is given without certificate; give both"),
        ("root_certificates", {"root_certificates": text}, "holds no certificate in PEM; "),
        ("root_certificates", {"root_certificates": b""}, "holds no certificate in PEM; "),
        ("key", {"certificate": pem, "key": pem}, "holds no private key, without a passphrase, in"),
        ("certificate", {"certificate": away, "key": key}, f"names {away}, which cannot be read ("),
        ("token_file", {"token_file": away}, f"names {away}, which cannot be read (no such file"),
        ("token_file", {"token_file": text}, "is not a token; "),
        ("token_file", {"token_file": text, "token": "a"}, "cannot be used with token; drop one"),
        ("key", {"tls": False, "key": key}, "needs encryption; leave out tls=False"),
        ("tls", {"tls": True, "credentials": credentials}, "cannot be used with credentials; "),
    ):
        with pytest.raises(InvalidRequestError) as caught:
            kind("localhost:1", **access)
        assert str(caught.value).startswith(f"{field} {problem}")
        assert (caught.value.reason, caught.value.field) == ("INVALID_FIELD", field)
    monkeypatch.setenv("SKETCHMATCH_TLS", "maybe")
    with pytest.raises(InvalidRequestError, match=r"^SKETCHMATCH_TLS is 'maybe'; give 1 or 0"):
        kind("localhost:1")


def test_a_key_of_another_certificate_is_refused_before_any_call(kind, pair, monkeypatch, tmp_path):
    other = Authority(tmp_path, "other").issue("robot-8").key
    locked = tmp_path / "locked.key"
    command = ["openssl", "pkcs8", "-topk8", "-in", pair.key, "-passout", "pass:s", "-out", locked]
    subprocess.run(command, check=True)
    for key in (other, locked):
        with pytest.raises(InvalidRequestError) as caught:
            kind("localhost:1", certificate=pair.certificate, key=key)
        told = "key is not the key of certificate, or has a passphrase; give the key of that"
        assert str(caught.value).startswith(told)
    monkeypatch.setenv("SKETCHMATCH_KEY", str(other))
    with pytest.raises(InvalidRequestError, match="SKETCHMATCH_KEY is not the key of cert"):
        kind("localhost:1", certificate=pair.certificate)


@pytest.mark.parametrize("method", ["server_info", "wait_until_serving"])
def test_certificates_that_cannot_be_used_are_no_reason_to_wait(
    server, call, monkeypatch, tmp_path, method
):
    broken = tmp_path / "ca.pem"
    broken.write_text("-----BEGIN CERTIFICATE-----\nnone\n-----END CERTIFICATE-----\n")
    monkeypatch.setenv("SKETCHMATCH_ROOT_CERTIFICATES", str(broken))
    with pytest.raises(InvalidRequestError, match="cannot be used; give certificate and the key"):
        call(server.address, method, retries=5)


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ("CERTIFICATE_VERIFY_FAILED", "it is of no authority that the client trusts, or it has ex"),
        ("CERTIFICATE_VERIFY_FAILED: certificate has expired", "certificate has expired"),
        ("Hostname Verification Check failed.", "it is for another name"),
    ],
)
def test_why_a_certificate_is_not_trusted_is_said_as_far_as_it_is_known(server, call, said, why):
    told = f"last error: UNKNOWN: Ssl handshake failed: SSL_ERROR_SSL: OPENSSL_internal:{said}"
    server.fail(grpc.StatusCode.UNAVAILABLE, told)
    with pytest.raises(NotAuthenticatedError) as caught:
        call(server.address, "server_info")
    assert f"cannot be trusted ({why}" in str(caught.value)


def test_an_argument_that_there_is_not_is_pythons_error(kind):
    with pytest.raises(TypeError, match="'tokn' is not an argument"):
        kind("localhost:1", tokn=TOKEN)


def test_a_client_shows_no_secret_of_its_own(kind):
    assert "s3cret" not in repr(kind("localhost:1", token=TOKEN))
