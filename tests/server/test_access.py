"""Who may call: real servers with TLS and tokens, friends, and strangers of every kind."""

import logging
import re
import signal
import subprocess
from contextlib import contextmanager

import grpc
import pytest
from grpc_health.v1 import health_pb2, health_pb2_grpc

from sketchmatch.app.application import Application
from sketchmatch.app.setup import Isolation, Setup
from sketchmatch.errors import InvalidInputError
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.selection import UNCONFIGURED
from sketchmatch.registry import default_registry
from sketchmatch.server import services, watched
from sketchmatch.server.serve import ServerSettings
from sketchmatch.server.tls import TlsFiles
from sketchmatch.server.tokens import new_token
from sketchmatch_client import (
    AsyncClient,
    Client,
    NotAuthenticatedError,
    ServerUnavailableError,
)
from sketchmatch_proto.v1.match_service_pb2_grpc import MatchServiceStub
from tests.certificates import Authority
from tests.contract.golden import as_json, golden
from tests.pace import wait_until
from tests.processes import server
from tests.server.harness import Host, hosting, in_loop, kinds, scene

SETUP = Setup(Engine(default_registry(), UNCONFIGURED), isolation=Isolation(frozenset("*")))


@pytest.fixture(scope="module")
def ours(tmp_path_factory):
    return Authority(tmp_path_factory.mktemp("ours"), "ours")


@pytest.fixture(scope="module")
def others(tmp_path_factory):
    return Authority(tmp_path_factory.mktemp("others"), "others")


@pytest.fixture(scope="module")
def robot():
    return new_token("robot-7")


@pytest.fixture(autouse=True)
def _looking_at_once(monkeypatch):
    monkeypatch.setattr(watched, "_LOOK_SECONDS", 0.0)


@pytest.fixture(scope="module")
def tls(ours):
    pair = ours.issue("localhost")
    return TlsFiles(pair.certificate, pair.key)


@pytest.fixture(scope="module")
def guarded(tls, robot, tmp_path_factory):
    """Yield a server that encrypts and wants a token."""
    file = tmp_path_factory.mktemp("tokens") / "tokens"
    file.write_text(f"# robots\n\n{robot[1].line}\n")
    with hosting(SETUP, tls=tls, tokens=file) as host:
        yield host


@pytest.fixture(params=["sync", "asyncio"])
def ask(request):
    """``ask(address, method, …, **access)`` with either client."""

    def plainly(address, method, *arguments, **access):
        with Client(address, timeout=60, **access) as client:
            return getattr(client, method)(*arguments)

    def in_a_loop(address, method, *arguments, **access):
        async def answer():
            async with AsyncClient(address, timeout=60, **access) as client:
                return await getattr(client, method)(*arguments)

        return in_loop(answer()).result(120)

    return plainly if request.param == "sync" else in_a_loop


# Friends ----------------------------------------------------------------------------------------


def test_every_call_of_both_clients_is_answered_over_tls_to_whom_shows_a_token(
    ask, guarded, ours, robot
):
    access = {"root_certificates": ours.certificate, "token": robot[0]}
    ask(guarded.address, "wait_until_serving", **access)
    assert ask(guarded.address, "server_info", **access).api_version == "sketchmatch.v1"
    assert ask(guarded.address, "algorithms", **access).algorithms
    assert len(ask(guarded.address, "segment", scene(3), **access).scene.objects) == 3
    match = ask(guarded.address, "match", scene(4), scene(4), **access)
    assert match.object_map == {0: 0, 1: 1, 2: 2, 3: 3}


def test_the_golden_request_has_the_same_answer_with_tls_and_a_token_as_without(
    address, guarded, ours, robot
):
    roots = ours.certificate.read_bytes()
    answers = []
    with (
        grpc.insecure_channel(address) as plain,
        grpc.secure_channel(guarded.address, grpc.ssl_channel_credentials(roots)) as encrypted,
    ):
        for channel in (plain, encrypted):
            metadata = (("authorization", f"Bearer {robot[0]}"),)
            events = list(
                MatchServiceStub(channel).Match(
                    golden("MatchRequest.turned"), metadata=metadata, timeout=60
                )
            )
            result = as_json(events[-1].result)
            for name in ("matchId", "statistics", "searchNote"):
                result.pop(name, None)
            answers.append(result)
    assert answers[0] == answers[1]


def test_credentials_of_grpcs_own_and_tokens_go_together(guarded, ours, robot):
    credentials = grpc.ssl_channel_credentials(ours.certificate.read_bytes())
    with Client(guarded.address, credentials=credentials, token=robot[0]) as client:
        assert client.server_info().version


def test_the_word_bearer_is_read_in_any_case(guarded, ours, robot):
    assert status_of(guarded, ours, f"bearer {robot[0]}") is grpc.StatusCode.OK


@contextmanager
def recorded(monkeypatch):
    """Yield the callers whose requests are taken."""
    callers, known = [], services.caller_of

    def recording(context):
        callers.append(known(context))
        return callers[-1]

    monkeypatch.setattr(services, "caller_of", recording)
    yield callers


def test_the_application_knows_its_caller_by_the_name_of_the_token(
    monkeypatch, ask, guarded, ours, robot
):
    with recorded(monkeypatch) as callers:
        access = {"root_certificates": ours.certificate, "token": robot[0]}
        ask(guarded.address, "match", scene(3), scene(3), **access)
        ask(guarded.address, "segment", scene(3), **access)
    assert callers == ["robot-7", "robot-7"]


@pytest.mark.parametrize(
    ("name", "alternatives", "caller"),
    [
        ("robot 8", "", "robot 8"),
        ("robot-9", "URI:spiffe://here/nine", "robot-9"),
        ("", "URI:spiffe://here/ten", "spiffe://here/ten"),
    ],
)
def test_with_mutual_tls_a_caller_is_who_the_certificate_names(
    monkeypatch, ask, tls, ours, others, name, alternatives, caller
):
    robots = others.issue(name, alternatives=alternatives)
    mutual = TlsFiles(tls.certificate, tls.key, others.certificate)
    access = {"certificate": robots.certificate, "key": robots.key.read_bytes()}
    with recorded(monkeypatch) as callers, hosting(SETUP, tls=mutual) as host:
        ask(host.address, "segment", scene(3), root_certificates=ours.certificate, **access)
    assert callers == [caller]


@pytest.mark.slow
def test_with_both_a_caller_needs_both_and_is_who_the_token_names(
    monkeypatch, ask, tls, ours, others, robot, tmp_path
):
    (tmp_path / "tokens").write_text(robot[1].line)
    pair = others.issue("link")
    mutual = TlsFiles(tls.certificate, tls.key, others.certificate)
    shown = {"certificate": pair.certificate, "key": pair.key}
    roots = {"root_certificates": ours.certificate}
    with (
        recorded(monkeypatch) as callers,
        hosting(SETUP, tls=mutual, tokens=tmp_path / "tokens") as host,
    ):
        ask(host.address, "segment", scene(3), token=robot[0], **shown, **roots)
        with pytest.raises(NotAuthenticatedError):
            ask(host.address, "segment", scene(3), **shown, **roots)
        with pytest.raises(ServerUnavailableError):
            ask(host.address, "segment", scene(3), token=robot[0], **roots)
    assert callers == ["robot-7"]


def test_callers_have_no_names_where_nobody_asks_for_them(monkeypatch, ask, address):
    with recorded(monkeypatch) as callers:
        ask(address, "segment", scene(3), token="whoever.secret")
    assert callers == [""]


# Strangers --------------------------------------------------------------------------------------


def status_of(host, authority, *authorizations, method="/sketchmatch.v1.MatchService/Match"):
    """Return what comes of a call with some metadata by hand, and an unreadable message."""
    credentials = grpc.ssl_channel_credentials(authority.certificate.read_bytes())
    metadata = [("authorization", each) for each in authorizations]
    with grpc.secure_channel(host.address, credentials) as channel:
        if method.endswith("Match"):
            call = channel.unary_stream(method)(b"", timeout=30, metadata=metadata)
            try:
                list(call)
            except grpc.RpcError as error:
                return error.code() if error.code() is not MISSING else grpc.StatusCode.OK
        else:
            try:
                channel.unary_unary(method)(b"", timeout=30, metadata=metadata)
            except grpc.RpcError as error:
                return error.code()
    return grpc.StatusCode.OK


MISSING = grpc.StatusCode.INVALID_ARGUMENT
"""What an empty request of a match gets from a server that heard it."""

REFUSED = grpc.StatusCode.UNAUTHENTICATED


@pytest.mark.parametrize(
    "method",
    [
        "/sketchmatch.v1.MatchService/Match",
        "/sketchmatch.v1.SceneService/Segment",
        "/sketchmatch.v1.TransferService/Transfer",
        "/sketchmatch.v1.CatalogService/ListAlgorithms",
        "/sketchmatch.v1.CatalogService/GetServerInfo",
        "/sketchmatch.v1.CatalogService/NoSuchMethod",
        "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
    ],
)
def test_no_method_answers_without_a_token(guarded, ours, method):
    assert status_of(guarded, ours, method=method) is REFUSED


def test_health_is_anybodys(guarded, ours):
    credentials = grpc.ssl_channel_credentials(ours.certificate.read_bytes())
    with grpc.secure_channel(guarded.address, credentials) as channel:
        answer = health_pb2_grpc.HealthStub(channel).Check(health_pb2.HealthCheckRequest())
    assert answer.status == health_pb2.HealthCheckResponse.SERVING


def wrong_tokens(right):
    """Return texts that are not the right token, each wrong in a way of its own."""
    name, _, secret = right.rpartition(".")
    flipped = secret[:-1] + ("A" if secret[-1] != "A" else "B")
    return {
        "another secret": f"{name}.{flipped}",
        "a shorter one": right[:-1],
        "a longer one": f"{right}A",
        "the name alone": name,
        "the secret alone": secret,
        "another name": f"robot-8.{secret}",
        "no name": f".{secret}",
        "nothing": "",
    }


@pytest.mark.parametrize("wrong", wrong_tokens("a.b"))
def test_a_wrong_token_is_refused_and_never_repeated(guarded, ours, robot, wrong, caplog):
    caplog.set_level(logging.DEBUG)
    token = wrong_tokens(robot[0])[wrong]
    said = len(guarded.said)
    assert status_of(guarded, ours, f"Bearer {token}") is REFUSED
    secret = token.rpartition(".")[2]
    told = " ".join([caplog.text, *guarded.said[said:]])
    assert not secret or secret not in told


@pytest.mark.parametrize(
    "authorizations",
    [["Basic cm9ib3Q6dG9rZW4="], ["{token}"], ["Bearer {token}", "Bearer {token}"], ["Bearer"]],
)
def test_another_form_of_authorization_is_refused(guarded, ours, robot, authorizations):
    shown = [each.format(token=robot[0]) for each in authorizations]
    assert status_of(guarded, ours, *shown) is REFUSED


def test_a_refusal_has_a_reason_for_programs_and_a_remedy_for_people(ask, guarded, ours, robot):
    wrong = wrong_tokens(robot[0])["another secret"]
    with pytest.raises(NotAuthenticatedError) as caught:
        ask(guarded.address, "server_info", root_certificates=ours.certificate, token=wrong)
    assert caught.value.reason == "NOT_AUTHENTICATED"
    assert str(caught.value) == (
        "this server does not know the token; ask its operator for another"
    )
    with pytest.raises(NotAuthenticatedError, match="the call has none; give the client"):
        ask(guarded.address, "server_info", root_certificates=ours.certificate)


def test_a_strangers_message_is_not_even_received(guarded, ours, monkeypatch):
    received = []
    monkeypatch.setattr(Application, "running", lambda *_: received.append(1))
    credentials = grpc.ssl_channel_credentials(ours.certificate.read_bytes())
    # More than the transport takes: a server that read it would say so.
    message = bytes(300 * 1024**2)
    options = [("grpc.max_send_message_length", -1)]
    with grpc.secure_channel(guarded.address, credentials, options) as channel:
        call = channel.unary_stream("/sketchmatch.v1.MatchService/Match")(message, timeout=60)
        with pytest.raises(grpc.RpcError) as caught:
            list(call)
    assert caught.value.code() is REFUSED
    assert not received


def test_a_server_of_another_authority_is_not_trusted(ask, guarded, others, robot):
    with pytest.raises(NotAuthenticatedError, match="cannot be trusted"):
        ask(guarded.address, "server_info", root_certificates=others.certificate, token=robot[0])


def test_waiting_for_a_server_that_is_not_trusted_ends_at_once(ask, guarded, others):
    with pytest.raises(NotAuthenticatedError, match="cannot be trusted"):
        ask(guarded.address, "wait_until_serving", root_certificates=others.certificate)


def test_a_certificate_for_another_name_is_not_trusted_unless_the_name_is_said(ask, ours):
    pair = ours.issue("elsewhere", alternatives="DNS:elsewhere.example")
    files = TlsFiles(pair.certificate, pair.key)
    way_in = {"root_certificates": ours.certificate}
    with hosting(SETUP, tls=files) as host:
        assert ask(host.address, "server_info", server_name="elsewhere.example", **way_in).version
        with pytest.raises(NotAuthenticatedError, match="it is for another name"):
            ask(host.address, "server_info", **way_in)


def test_plaintext_on_a_port_with_tls_is_told_what_may_be_wanted(ask, guarded, robot):
    with pytest.raises(ServerUnavailableError, match="requires encryption") as caught:
        ask(guarded.address, "server_info", token=robot[0])
    assert robot[0] not in str(caught.value)


def test_tls_on_a_port_without_is_told_that_it_does_not_encrypt(ask, address, ours):
    with pytest.raises(ServerUnavailableError, match="it does not use encryption"):
        ask(address, "server_info", root_certificates=ours.certificate)


@pytest.mark.slow
def test_a_client_without_a_certificate_of_the_right_authority_gets_nowhere(ask, tls, ours, others):
    mutual = TlsFiles(tls.certificate, tls.key, others.certificate)
    stranger = ours.issue("stranger")
    roots = {"root_certificates": ours.certificate}
    with hosting(SETUP, tls=mutual) as host:
        with pytest.raises(ServerUnavailableError, match="a certificate of the client"):
            ask(host.address, "server_info", **roots)
        with pytest.raises(ServerUnavailableError, match="a certificate of the client"):
            ask(
                host.address,
                "server_info",
                certificate=stranger.certificate,
                key=stranger.key,
                **roots,
            )


# Files that change ------------------------------------------------------------------------------


def test_an_expired_certificate_is_replaced_while_a_match_runs_on(ours):
    expired, fresh = ours.issue("localhost", days=-1), ours.issue("localhost")
    shown = ours.issue("localhost")
    access = {"root_certificates": ours.certificate, "timeout": 60}
    with (
        hosting(SETUP, tls=TlsFiles(shown.certificate, shown.key)) as host,
        Client(host.address, **access) as early,
    ):
        events = early.events(scene(8), scene(8, 1), searcher="easm", time_budget=3.0)
        assert next(events).HasField("accepted")
        shown.replace(expired)
        with (
            Client(host.address, **access) as client,
            pytest.raises(NotAuthenticatedError, match="expired"),
        ):
            client.server_info()
        shown.replace(fresh)
        with Client(host.address, **access) as client:
            assert client.server_info().version
        assert kinds(list(events))[-1] == "result"
        assert early.server_info().version
    told = [re.sub(r"\d{4}-\d\d-\d\d", "DAY", line) for line in host.said if "certificate" in line]
    assert told == [
        "the server's certificate is valid until DAY",
        "the certificates are read again; the server's certificate expired on DAY, "
        "so no client trusts it; renew it",
        "the certificates are read again; the server's certificate is valid until DAY",
    ]


def test_a_certificate_without_its_key_leaves_the_former_pair_and_is_told_once(ours):
    shown, fresh = ours.issue("localhost"), ours.issue("localhost")
    with hosting(SETUP, tls=TlsFiles(shown.certificate, shown.key)) as host:
        shown.certificate.write_bytes(fresh.certificate.read_bytes())
        for _ in range(3):
            with Client(host.address, root_certificates=ours.certificate) as client:
                assert client.server_info().version
    (told,) = (line for line in host.said if "stay as they were" in line)
    assert "is not the key of the certificate" in told


def test_tokens_change_while_the_server_runs(ours, tls, robot, tmp_path):
    file, (token, known), (other, other_known) = tmp_path / "tokens", robot, new_token("pad")
    file.write_text(known.line)
    access = {"root_certificates": ours.certificate}
    with (
        hosting(SETUP, tls=tls, tokens=file) as host,
        Client(host.address, token=token, **access) as old,
        Client(host.address, token=other, **access) as new,
    ):
        assert old.server_info().version
        with pytest.raises(NotAuthenticatedError):
            new.server_info()
        file.write_text(f"{known.line}\n{other_known.line}\n")
        assert old.server_info().version
        assert new.server_info().version
        file.write_text(f"{other_known.line}\n")
        with pytest.raises(NotAuthenticatedError):
            old.server_info()
        assert new.server_info().version
        file.write_text(f"nonsense {other}\n")
        assert new.server_info().version
        file.unlink()
        assert new.server_info().version
    told = [line for line in host.said if "stay as they were" in line]
    assert len(told) == 2
    assert f"{file}, line 1, is not of the form NAME:sha256:SALT:HASH" in told[0]
    assert not any(other in line for line in host.said)


def test_what_is_wrong_with_a_file_is_said_though_nobody_calls(monkeypatch, robot, tmp_path):
    monkeypatch.setattr("sketchmatch.server.serve._LOOK_AT_FILES", 0.05)
    file = tmp_path / "tokens"
    file.write_text(robot[1].line)
    with hosting(SETUP, tokens=file) as host:
        file.write_text("nonsense")
        wait_until(lambda: "the tokens stay as they were" in "".join(host.said), "it is not said")


@pytest.mark.slow
def test_a_reload_says_what_it_read_again(ours, robot, tmp_path):
    (tmp_path / "tokens").write_text(robot[1].line)
    pair = ours.issue("localhost")
    arguments = ["--tls-certificate", pair.certificate, "--tls-key", pair.key]
    with server(*map(str, arguments), "--tokens", str(tmp_path / "tokens")) as running:
        (tmp_path / "tokens").write_text("")
        pair.replace(ours.issue("localhost"))
        running.process.send_signal(signal.SIGHUP)
        running.wait_for("the configuration is reloaded")
        again = [line for line in running.said if "read again" in line]
        with (
            Client(running.address, root_certificates=ours.certificate, token=robot[0]) as old,
            pytest.raises(NotAuthenticatedError),
        ):
            old.server_info()
    assert [line.partition(";")[0] for line in again] == [
        "sketchmatch: the certificates are read again",
        "sketchmatch: the tokens are read again",
    ]


# What a server refuses to begin with ------------------------------------------------------------


def refused(**settings):
    with pytest.raises(InvalidInputError) as caught, hosting(SETUP, **settings):
        pass
    return str(caught.value)


@pytest.mark.parametrize("address", ["0.0.0.0:0", "[::]:0", "robot.example:0", "192.0.2.1:0"])
def test_strangers_are_not_let_in_from_other_machines(address):
    with pytest.raises(InvalidInputError) as caught:
        Host(SETUP, ServerSettings(address, 0.0)).wait_until_listening()
    assert str(caught.value) == (
        f"address {address!r} can be reached from other machines, and whoever reaches it may "
        "call and can read along; give --tls-certificate and --tls-key, and --tokens or "
        "--tls-client-ca, "
        "listen on 127.0.0.1, or allow this with --insecure"
    )


def test_what_is_lacking_is_named(tls, robot, tmp_path):
    (tmp_path / "tokens").write_text(robot[1].line)
    for settings, problem in (
        ({"tls": tls}, "whoever reaches it may call; give --tokens or --tls-client-ca,"),
        (
            {"tokens": tmp_path / "tokens"},
            "whoever reaches it can read along, tokens too; give --tls-certificate and --tls-key,",
        ),
    ):
        with pytest.raises(InvalidInputError, match=problem):
            Host(SETUP, ServerSettings("0.0.0.0:0", 0.0, **settings)).wait_until_listening()


@pytest.mark.parametrize("known", ["tokens", "client_ca"])
def test_a_server_that_encrypts_and_knows_its_callers_listens_anywhere(
    tls, ours, robot, tmp_path, known
):
    (tmp_path / "tokens").write_text(robot[1].line)
    settings = (
        {"tls": tls, "tokens": tmp_path / "tokens"}
        if known == "tokens"
        else {"tls": TlsFiles(tls.certificate, tls.key, ours.certificate)}
    )
    host = Host(SETUP, ServerSettings("0.0.0.0:0", 0.0, **settings))
    host.wait_until_listening()
    host.stop()
    host.join()
    assert not any("insecure" in line for line in host.said)


def test_insecure_is_said_in_full():
    host = Host(SETUP, ServerSettings("0.0.0.0:0", 0.0, insecure=True))
    host.wait_until_listening()
    host.stop()
    host.join()
    assert "insecure: whoever reaches this address may call and can read along" in host.said


def test_files_of_no_use_are_refused_by_name(ours, others, tmp_path):
    pair, other = ours.issue("localhost"), others.issue("localhost")
    text, away = tmp_path / "text", tmp_path / "away"
    text.write_text("no PEM")
    crypted = tmp_path / "crypted.key"
    crypted.write_text(
        other.key.read_text()
        .replace("BEGIN PRIVATE", "BEGIN ENCRYPTED PRIVATE")
        .replace("END PRIVATE", "END ENCRYPTED PRIVATE")
    )
    for files, problem in (
        ((away, pair.key), f"{away} cannot be read (no such file or directory); "),
        ((pair.certificate, away), f"{away} cannot be read"),
        ((pair.certificate, other.key), f"{other.key} is not the key of the certificate"),
        ((text, pair.key), f"{text} and {pair.key} are not a certificate and a private key in PEM"),
        ((pair.certificate, text), f"{pair.certificate} and {text} are not a certificate"),
        ((pair.certificate, pair.key, text), f"{text} has no certificate in PEM"),
    ):
        assert refused(tls=TlsFiles(*files)).startswith(problem)
    assert refused(tokens=away).startswith(f"{away} cannot be read")


def test_a_key_with_a_passphrase_is_refused_and_asks_for_none(ours, tmp_path):
    pair, crypted = ours.issue("localhost"), tmp_path / "crypted.key"
    command = ["openssl", "ec", "-aes256", "-passout", "pass:secret"]
    subprocess.run([*command, "-in", pair.key, "-out", crypted], check=True, capture_output=True)
    found = refused(tls=TlsFiles(pair.certificate, crypted))
    assert found.startswith(f"{crypted} is encrypted; give a key without a passphrase")
