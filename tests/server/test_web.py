"""The port for browsers: the same answers, limits, tokens and errors as over gRPC."""

import asyncio
import base64
import gzip
import http.client
import json
import re
import shutil
import socket
import ssl
import struct
import sys
import time
import urllib.request
from urllib.parse import urlsplit

import pytest
from google.rpc import error_details_pb2

from sketchmatch.app.setup import Isolation, RequestLimits, Setup
from sketchmatch.errors import InvalidInputError
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.selection import UNCONFIGURED
from sketchmatch.registry import default_registry
from sketchmatch.server.pages import Pages
from sketchmatch.server.serve import ServerSettings
from sketchmatch.server.tls import TlsFiles
from sketchmatch.server.tokens import new_token
from sketchmatch_client import match_request
from sketchmatch_proto.v1 import match_service_pb2, scene_service_pb2
from tests.certificates import Authority
from tests.pace import wait_until
from tests.server.harness import ENDLESS, Host, hosting, scene

INFO = "/sketchmatch.v1.CatalogService/GetServerInfo"
SEGMENT = "/sketchmatch.v1.SceneService/Segment"
MATCH = "/sketchmatch.v1.MatchService/Match"


def setup(**limits):
    return Setup(
        Engine(default_registry(), UNCONFIGURED),
        RequestLimits(**{"max_time_budget": 20.0, **limits}),
        Isolation(trusted=frozenset("*")),
    )


def gateway(settings=None, warm=False, **limits):
    return hosting(setup(**limits), warm, web_address="127.0.0.1:0", **(settings or {}))


def address_of(host: Host) -> str:
    (url,) = [
        found[1]
        for line in host.said
        if (
            found := re.match(
                r"(?:the sketch pad is|programs in browsers are answered) at (\S+)", line
            )
        )
    ]
    return urlsplit(url).netloc


@pytest.fixture(scope="module")
def server():
    with gateway(warm=True) as host:
        yield host


def ask(host, path, body=b"", kind="application/json", method="POST", **headers):
    link = http.client.HTTPConnection(address_of(host), timeout=60)
    try:
        names = {key.replace("_", "-"): value for key, value in headers.items()}
        link.request(method, path, body, {"Content-Type": kind, **names})
        answer = link.getresponse()
        return answer.status, answer.headers, answer.read()
    finally:
        link.close()


def frames(data):
    found = []
    while data:
        flags, size = struct.unpack(">BI", data[:5])
        found.append((flags, data[5 : 5 + size]))
        data = data[5 + size :]
    return found


def framed(message, flags=0):
    return struct.pack(">BI", flags, len(message)) + message


def reason_of(error):
    info = error_details_pb2.ErrorInfo()
    (packed,) = [d["value"] for d in error["details"] if d["type"] == info.DESCRIPTOR.full_name]
    info.ParseFromString(base64.b64decode(packed + "=="))
    assert info.domain == "sketchmatch"
    return info.reason


def small_match(**options):
    return match_request(scene(4), scene(4), **options)


def test_json_is_answered_in_json(server):
    status, headers, body = ask(server, INFO, b"{}")
    assert (status, headers["Content-Type"]) == (200, "application/json")
    assert json.loads(body)["apiVersion"] == "sketchmatch.v1"


def test_binary_connect_is_answered_as_grpc_is(server):
    request = scene_service_pb2.SegmentRequest(source=scene(5)).SerializeToString()
    status, _, body = ask(server, SEGMENT, request, "application/proto")
    assert status == 200
    assert len(scene_service_pb2.SegmentResponse.FromString(body).scene.objects) == 5


def test_a_stream_has_every_event_and_ends_without_error(server):
    body = framed(small_match().SerializeToString())
    status, _, answer = ask(server, MATCH, body, "application/connect+proto")
    *events, (flags, end) = frames(answer)
    told = [match_service_pb2.MatchResponse.FromString(event) for _, event in events]
    kinds = [event.WhichOneof("event") for event in told]
    assert status == 200
    assert (kinds[0], kinds.count("scenes"), kinds[-1]) == ("accepted", 1, "result")
    assert len(told[-1].result.object_matches) == 4
    assert (flags, json.loads(end)) == (2, {})


def test_plain_json_is_no_request_for_a_stream(server):
    """As engine/RUNNING.md says of curl."""
    assert ask(server, MATCH, b"{}")[0] == 415


def test_a_stream_of_json_has_the_same(server):
    request = {"sketch": {"strokeSet": {}}, "map": {}}
    _, _, answer = ask(
        server, MATCH, framed(json.dumps(request).encode()), "application/connect+json"
    )
    ((flags, end),) = frames(answer)
    error = json.loads(end)["error"]
    assert (flags, error["code"]) == (2, "invalid_argument")


def test_grpc_web_is_answered_with_trailers_in_the_body(server):
    body = framed(small_match().SerializeToString())
    _, headers, answer = ask(server, MATCH, body, "application/grpc-web+proto")
    *events, (flags, trailer) = frames(answer)
    result = match_service_pb2.MatchResponse.FromString(events[-1][1])
    assert headers["Content-Type"].startswith("application/grpc-web")
    assert result.HasField("result")
    assert flags == 0x80
    assert b"grpc-status: 0" in trailer.lower()


def test_grpc_web_errors_carry_their_details(server):
    _, _, answer = ask(server, MATCH, framed(b""), "application/grpc-web+proto")
    ((_, trailer),) = frames(answer)
    assert b"grpc-status: 3" in trailer.lower()
    assert b"grpc-status-details-bin" in trailer.lower()


def test_an_error_says_what_and_where_with_its_details(server):
    status, _, body = ask(server, SEGMENT, b"{}")
    error = json.loads(body)
    bad = error_details_pb2.BadRequest()
    (packed,) = [d["value"] for d in error["details"] if d["type"].endswith("BadRequest")]
    bad.ParseFromString(base64.b64decode(packed + "=="))
    assert (status, error["code"], reason_of(error)) == (400, "invalid_argument", "MISSING_FIELD")
    assert error["message"].startswith("source is not set")
    assert bad.field_violations[0].field == "source"


@pytest.mark.parametrize(
    ("body", "kind"),
    [
        (b"{", "application/json"),
        (b'{"sauce": 1}', "application/json"),
        (b"\xff", "application/json"),
        (b"[" * 100_000, "application/json"),
        (b"\xff\xff", "application/proto"),
    ],
)
def test_what_is_no_message_is_refused_with_a_reason(server, body, kind):
    status, _, answer = ask(server, SEGMENT, body, kind)
    error = json.loads(answer)
    assert (status, reason_of(error)) == (400, "INVALID_FIELD")
    assert "\n" not in error["message"]


@pytest.mark.parametrize("kind", ["application/proto", "application/json"])
def test_a_request_may_be_compressed(server, kind):
    message = scene_service_pb2.SegmentRequest(source=scene(3))
    plain = message.SerializeToString()
    if kind.endswith("json"):
        from google.protobuf import json_format

        plain = json_format.MessageToJson(message).encode()
    status, _, body = ask(server, SEGMENT, gzip.compress(plain), kind, Content_Encoding="gzip")
    assert status == 200, body


@pytest.mark.parametrize("kind", ["application/proto", "application/json"])
def test_a_request_that_inflates_to_more_than_the_limit_is_refused(kind):
    with gateway(max_request_bytes=100_000) as host:
        bomb = gzip.compress(b" " * 50_000_000)
        status, _, body = ask(host, SEGMENT, bomb, kind, Content_Encoding="gzip")
        plain = ask(host, SEGMENT, b" " * 105_000, kind)
    assert (status, reason_of(json.loads(body))) == (400, "MESSAGE_TOO_LARGE")
    assert (plain[0], reason_of(json.loads(plain[2]))) == (400, "MESSAGE_TOO_LARGE")


def test_there_are_no_other_methods(server):
    assert ask(server, "/sketchmatch.v1.SceneService/Guess", b"{}")[0] == 404
    assert ask(server, SEGMENT, b"{}", method="DELETE")[0] == 405


def test_calls_show_a_token_where_the_server_wants_one(tmp_path):
    token, known = new_token("pad")
    tokens = tmp_path / "tokens"
    tokens.write_text(f"{known.line}\n")
    with gateway({"tokens": tokens}) as host:
        status, _, body = ask(host, INFO, b"{}")
        wrong = ask(host, INFO, b"{}", Authorization=f"Bearer {token}x")
        right = ask(host, INFO, b"{}", Authorization=f"Bearer {token}")
        page = ask(host, "/", method="GET")
    assert (status, reason_of(json.loads(body))) == (401, "NOT_AUTHENTICATED")
    assert (wrong[0], right[0]) == (401, 200)
    assert page[0] in (200, 404)  # the pad itself is nothing secret


def test_a_stranger_is_refused_before_the_request_is_received(tmp_path, caplog):
    tokens = tmp_path / "tokens"
    tokens.write_text(f"{new_token('pad')[1].line}\n")
    with gateway({"tokens": tokens}) as host, caplog.at_level("INFO"):
        name, _, port = address_of(host).rpartition(":")
        with socket.create_connection((name, int(port)), 30) as link:
            head = f"POST {SEGMENT} HTTP/1.1\r\nHost: localhost\r\nContent-Length: 50000000\r\n"
            link.sendall(f"{head}Content-Type: application/proto\r\n\r\n".encode())
            assert link.recv(4096).startswith(b"HTTP/1.1 401 ")
    assert any("Segment code=UNAUTHENTICATED" in line for line in caplog.messages)


def test_a_busy_server_says_when_to_come_back_and_a_caller_who_leaves_gives_its_place_back():
    with gateway(max_concurrent_matches=1, max_waiting=0) as host:
        body = framed(small_match(**ENDLESS).SerializeToString())
        link = http.client.HTTPConnection(address_of(host), timeout=60)
        link.request("POST", MATCH, body, {"Content-Type": "application/connect+proto"})
        answer = link.getresponse()
        assert answer.read(5)
        status, _, refused = ask(host, SEGMENT, segment_body(), "application/proto")
        error = json.loads(refused)
        assert (status, error["code"]) == (429, "resource_exhausted")
        assert any(detail["type"] == "google.rpc.RetryInfo" for detail in error["details"])
        answer.close()
        link.close()

        def answered():
            return ask(host, SEGMENT, segment_body(), "application/proto")[0] == 200

        wait_until(answered, "a caller who has left keeps its place")


def segment_body():
    return scene_service_pb2.SegmentRequest(source=scene(3)).SerializeToString()


def test_a_call_that_waited_long_enough_is_late(server):
    body = framed(small_match(**ENDLESS).SerializeToString())
    began = time.monotonic()
    _, _, answer = ask(server, MATCH, body, "application/connect+proto", Connect_Timeout_Ms="300")
    end = json.loads(frames(answer)[-1][1])
    assert end["error"]["code"] == "deadline_exceeded"
    assert time.monotonic() - began < 20


def test_calls_are_logged_as_those_over_grpc(server, caplog):
    with caplog.at_level("INFO", logger="sketchmatch.server.calls"):
        ask(server, SEGMENT, b"{}")
    (line,) = [line for line in caplog.messages if line.startswith("Segment ")]
    assert "code=INVALID_ARGUMENT" in line
    assert "caller=ipv4:127.0.0.1:" in line
    assert "reason=MISSING_FIELD" in line


def test_pages_from_elsewhere_may_not_call(server):
    status, headers, _ = ask(
        server,
        INFO,
        method="OPTIONS",
        Origin="https://evil.example",
        Access_Control_Request_Method="POST",
    )
    assert status == 403
    assert headers["Access-Control-Allow-Origin"] is None
    _, headers, _ = ask(server, INFO, b"{}", Origin="https://evil.example")
    assert headers["Access-Control-Allow-Origin"] is None


def test_pages_from_a_named_origin_may_call():
    named = "https://pad.example"
    with gateway({"web_origins": (named,)}) as host:
        status, before, _ = ask(host, INFO, method="OPTIONS", Origin=named)
        _, answered, _ = ask(host, INFO, b"{}", Origin=named)
        _, other, _ = ask(host, INFO, b"{}", Origin="https://pad.example.evil")
    assert (status, before["Access-Control-Allow-Origin"]) == (204, named)
    assert "authorization" in before["Access-Control-Allow-Headers"]
    assert answered["Access-Control-Allow-Origin"] == named
    assert other["Access-Control-Allow-Origin"] is None


def test_a_name_that_was_made_to_mean_this_machine_is_refused(server):
    assert ask(server, INFO, b"{}", Host="evil.example")[0] == 421
    assert ask(server, INFO, b"{}", Host="localhost:8080")[0] == 200
    assert ask(server, INFO, b"{}", Host="[::1]")[0] == 200


def test_an_address_in_use_is_refused_in_words():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        host = Host(setup(), ServerSettings("127.0.0.1:0", web_address=address))
        with pytest.raises(InvalidInputError, match=r"server\.web_address .* choose a free port"):
            host.wait_until_listening()


def test_other_machines_reach_it_only_where_that_is_meant():
    host = Host(setup(), ServerSettings("127.0.0.1:0", web_address="0.0.0.0:0"))
    with pytest.raises(
        InvalidInputError, match=r"server\.web_address .*reached from other machines"
    ):
        host.wait_until_listening()


def test_a_missing_package_is_named_with_the_remedy(monkeypatch):
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    host = Host(setup(), ServerSettings("127.0.0.1:0", web_address="127.0.0.1:0"))
    with pytest.raises(InvalidInputError, match=r"pip install 'sketchmatch\[web\]'"):
        host.wait_until_listening()


def common_name(host, trusting):
    """Return whose certificate a handshake shows."""
    name, _, port = address_of(host).rpartition(":")
    with (
        socket.create_connection((name, int(port)), 30) as link,
        trusting.wrap_socket(link, server_hostname="localhost") as secure,
    ):
        return dict(part[0] for part in secure.getpeercert()["subject"])["commonName"]


def test_it_encrypts_with_the_certificate_of_the_server_and_with_a_renewed_one(tmp_path):
    authority = Authority(tmp_path, "ours")
    pair = authority.issue("first")
    trusting = ssl.create_default_context(cafile=str(authority.certificate))
    settings = {"tls": TlsFiles(pair.certificate, pair.key)}
    with gateway(settings) as host:
        request = urllib.request.Request(
            f"https://{address_of(host)}{INFO}", b"{}", {"Content-Type": "application/json"}
        )
        with urllib.request.urlopen(request, context=trusting) as answer:
            assert json.load(answer)["version"]
        assert common_name(host, trusting) == "first"
        pair.replace(authority.issue("second"))
        time.sleep(1.1)
        assert common_name(host, trusting) == "second"  # by the first handshake already
        pair.certificate.write_bytes(authority.issue("third").certificate.read_bytes())
        time.sleep(1.1)
        assert common_name(host, trusting) == "second"  # the key is yet to come
        assert any("stay as they were" in line for line in host.said)


@pytest.mark.parametrize("version", [ssl.TLSVersion.TLSv1_2, ssl.TLSVersion.TLSv1_3])
def test_no_session_outlives_the_certificates_it_began_with(tmp_path, version):
    authority = Authority(tmp_path, "ours")
    pair = authority.issue("first")
    trusting = ssl.create_default_context(cafile=str(authority.certificate))
    trusting.maximum_version = version
    with gateway({"tls": TlsFiles(pair.certificate, pair.key)}) as host:
        name, _, port = address_of(host).rpartition(":")

        def asked(session=None):
            with (
                socket.create_connection((name, int(port)), 30) as link,
                trusting.wrap_socket(link, server_hostname="localhost", session=session) as secure,
            ):
                secure.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
                assert secure.recv(4)
                return secure.session, secure.session_reused

        session, _ = asked()
        assert not asked(session)[1]


def test_browsers_show_certificates_of_the_authorities_there_are_now(tmp_path):
    ours, theirs, others = (Authority(tmp_path, name) for name in ("ours", "theirs", "others"))
    pair, known = ours.issue("server"), tmp_path / "known.pem"
    shutil.copy(theirs.certificate, known)

    def answered(authority):
        trusting = ssl.create_default_context(cafile=str(ours.certificate))
        if authority:
            own = authority.issue("browser")
            trusting.load_cert_chain(own.certificate, own.key)
        request = urllib.request.Request(
            f"https://{address_of(host)}{INFO}", b"{}", {"Content-Type": "application/json"}
        )
        try:
            with urllib.request.urlopen(request, context=trusting) as answer:
                return answer.status == 200
        except OSError:
            return False

    with gateway({"tls": TlsFiles(pair.certificate, pair.key, known)}) as host:
        assert [answered(each) for each in (theirs, others, None)] == [True, False, False]
        shutil.copy(others.certificate, known)
        time.sleep(1.1)
        assert [answered(each) for each in (theirs, others, None)] == [False, True, False]


def page(pages, path, method="GET", **headers):
    """Ask for a page as an ASGI server does."""
    sent = []

    async def send(message):
        sent.append(message)

    asked = [
        (key.replace("_", "-").lower().encode(), value.encode()) for key, value in headers.items()
    ]
    scope = {"type": "http", "path": path, "method": method, "headers": asked}
    asyncio.run(pages(scope, None, send))
    start, body = sent
    return start["status"], dict(start["headers"]), body["body"]


PAGES = Pages(
    {
        "/index.html": b"<!doctype html><title>pad</title>",
        "/assets/index-1a2b.js": b"let a = 1;" * 100,
        "/places/map.png": b"\x89PNG",
    }
)


def test_the_root_is_the_page_and_nothing_may_be_inline_or_from_elsewhere():
    status, headers, body = page(PAGES, "/")
    policy = headers[b"content-security-policy"].decode()
    assert (status, body) == (200, b"<!doctype html><title>pad</title>")
    assert headers[b"content-type"] == b"text/html; charset=utf-8"
    assert "default-src 'none'" in policy
    assert "script-src 'self'" in policy
    assert "unsafe" not in policy
    assert "http" not in policy
    assert headers[b"x-content-type-options"] == b"nosniff"


def test_the_page_connects_to_the_robots_that_are_named_and_to_nobody_else():
    def connects(pages):
        _, headers, _ = page(pages, "/")
        policy = headers[b"content-security-policy"].decode()
        (said,) = [part for part in policy.split("; ") if part.startswith("connect-src")]
        return said

    robots = ("ws://robot.local:9090", "wss://fleet.example/bridge")
    named = Pages({"/index.html": b"<!doctype html>"}, robots)
    assert connects(PAGES) == "connect-src 'self'"
    assert connects(named) == "connect-src 'self' ws://robot.local:9090 wss://fleet.example/bridge"
    assert json.loads(page(PAGES, "/robots.json")[2]) == []
    assert json.loads(page(named, "/robots.json")[2]) == list(robots)


def test_scripts_are_compressed_and_kept_and_pages_are_asked_for_again():
    _, plain, body = page(PAGES, "/assets/index-1a2b.js")
    _, headers, packed = page(PAGES, "/assets/index-1a2b.js", Accept_Encoding="gzip, br")
    assert gzip.decompress(packed) == body == b"let a = 1;" * 100
    assert b"content-encoding" not in plain
    assert headers[b"content-encoding"] == b"gzip"
    assert headers[b"content-length"] == str(len(packed)).encode()
    assert b"immutable" in headers[b"cache-control"]
    _, first, _ = page(PAGES, "/")
    assert first[b"cache-control"] == b"no-cache"
    status, _, body = page(PAGES, "/", If_None_Match=first[b"etag"].decode())
    assert (status, body) == (304, b"")


def test_pictures_are_sent_as_they_are():
    _, headers, body = page(PAGES, "/places/map.png", Accept_Encoding="gzip")
    assert (headers[b"content-type"], body) == (b"image/png", b"\x89PNG")
    assert b"content-encoding" not in headers


@pytest.mark.parametrize("path", ["/no", "/../pages.py", "/assets/", "/index.html/"])
def test_there_are_no_other_pages(path):
    status, headers, _ = page(PAGES, path)
    assert status == 404
    assert b"content-security-policy" in headers


def test_pages_are_only_read():
    assert page(PAGES, "/", "POST")[0] == 405
    status, headers, body = page(PAGES, "/", "HEAD")
    assert (status, body) == (200, b"")
    assert headers[b"content-length"] == b"33"


def test_a_server_without_a_built_pad_says_how_to_build_it():
    status, _, body = page(Pages({}), "/")
    assert status == 404
    assert b"make web" in body


@pytest.mark.parametrize(
    ("pages", "said"),
    [
        (PAGES, ["the sketch pad is at http"]),
        (Pages({}), ["programs in browsers are answered at http", "the sketch pad is not built; "]),
    ],
)
def test_where_the_pad_is_is_said_where_there_is_one(pages, said, monkeypatch):
    monkeypatch.setattr("sketchmatch.server.gateway.bundled_pages", lambda _: pages)
    with gateway() as host:
        heard = [line for line in host.said if "pad" in line or "browsers" in line]
    assert [line[: len(begin)] for line, begin in zip(heard, said, strict=True)] == said
