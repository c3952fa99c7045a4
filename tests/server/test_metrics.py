"""What a server counts, and how it tells it."""

import importlib.util
import re
import socket
import ssl
import subprocess
import time
import urllib.error
import urllib.request
from contextlib import contextmanager
from datetime import datetime

import grpc
import pytest

import sketchmatch
from sketchmatch.app.setup import Isolation, RequestLimits, Setup
from sketchmatch.errors import InvalidInputError
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.selection import UNCONFIGURED
from sketchmatch.server import monitor, serve
from sketchmatch.server.metrics import Counter, Histogram, Metric, Metrics
from sketchmatch.server.tls import Pems, TlsFiles, watched_pems
from sketchmatch.server.tokens import new_token
from sketchmatch_client import Client, InvalidRequestError, SketchmatchError, sources
from tests.certificates import Authority
from tests.pace import wait_until
from tests.server.harness import ENDLESS, hosting, in_loop, registry_with, scene
from tests.server.probes import Exploding
from tests.tools import require

EMPTY = f"{ssl.PEM_HEADER}\nMAA=\n{ssl.PEM_FOOTER}\n".encode()
"""A certificate in PEM with nothing in it."""


@contextmanager
def watched(monkeypatch, *plugins, **settings):
    """Yield a server and what it counts."""
    kept = []

    def keeping(methods):
        kept.append(Metrics(methods))
        return kept[-1]

    monkeypatch.setattr(serve, "Metrics", keeping)
    setup = Setup(
        Engine(registry_with(*plugins), UNCONFIGURED),
        RequestLimits(max_time_budget=20.0, max_concurrent_matches=3),
        isolation=Isolation(frozenset("*")),
    )
    with hosting(setup, **settings) as host:
        yield host, kept[0]


def gauge(metrics, name):
    (found,) = (item for item in metrics if item.metric.name == name)
    return found.values()


# Counting ---------------------------------------------------------------------------------------


def test_a_histogram_counts_up_to_each_bound_and_beyond():
    histogram = Histogram(Metric("a_seconds", "A."))
    for seconds in (0.005, 0.0051, 300.0, 301.0):
        histogram.add(seconds=seconds)
    ((counts, total),) = histogram.values().values()
    assert counts == [1] + [2] * (len(histogram.bounds) - 2) + [3, 4]
    assert total == pytest.approx(601.0101)


def test_a_counter_counts_by_labels():
    counter = Counter(Metric("a_total", "A.", ("b",)))
    counter.add("x")
    counter.add("x", count=2)
    counter.add("y")
    assert counter.values() == {("x",): 3, ("y",): 1}


def test_calls_are_counted_by_method_and_by_what_came_of_them(monkeypatch):
    with watched(monkeypatch, Exploding) as (host, metrics), Client(host.address) as client:
        client.match(scene(3), scene(3))
        client.segment(scene(3))
        client.server_info()
        with pytest.raises(InvalidRequestError):
            client.match(scene(3), scene(3), searcher="nobody")
        with pytest.raises(InvalidRequestError):
            client.match(scene(1), scene(3))
        with pytest.raises(SketchmatchError):
            client.match(scene(3), scene(3), searcher="exploding")
        with pytest.raises(SketchmatchError):
            client.match(scene(8), scene(8, 1), **ENDLESS, timeout=0.5)
        events = client.events(scene(8), scene(8, 1), **ENDLESS)
        next(events)
        wait_until(
            lambda: gauge(metrics, "sketchmatch_calls_open")["Match",] == 1, "no call is open"
        )
        events.close()
        wait_until(
            lambda: gauge(metrics, "sketchmatch_calls_open")["Match",] == 0, "a call stays open"
        )
    assert metrics.calls.values() == {
        ("Match", "OK"): 1,
        ("Segment", "OK"): 1,
        ("GetServerInfo", "OK"): 1,
        ("Match", "INVALID_ARGUMENT"): 2,
        ("Match", "INTERNAL"): 1,
        ("Match", "DEADLINE_EXCEEDED"): 1,
        ("Match", "CANCELLED"): 1,
    }
    assert metrics.refusals.values() == {
        ("UNKNOWN_ALGORITHM",): 1,
        ("TOO_FEW_OBJECTS",): 1,
        ("PLUGIN_FAILED",): 1,
    }
    counts, total = metrics.call_seconds.values()["Match",]
    assert counts[-1] == 6
    assert total > 0.4


@pytest.mark.parametrize("workers", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_scenes_are_counted_by_where_their_histograms_came_from(monkeypatch, tmp_path, workers):
    def described(*asked):
        with (
            watched(monkeypatch, store=tmp_path, workers=workers) as (host, metrics),
            Client(host.address) as client,
        ):
            for ask in asked:
                ask(client)
        return {labels[0]: count for labels, count in metrics.scenes.values().items()}

    kept = []

    def put(client):
        kept.append(sources.stored_scene(client.put_scene(scene(4)).stored_scene.name))

    def match(client):
        client.match(scene(3), kept[0], seed=1)

    # To put a scene is to describe it in as many directions as set and as chosen, here the same.
    assert described(put) == {"computed": 1, "held": 1, "kept": 0}
    assert described(put, match, match) == {"computed": 1, "held": 2, "kept": 1}
    # Another process knows the stored scene from the store, and the sketch not at all.
    assert described(match) == {"computed": 1, "held": 0, "kept": 1}


def test_matches_are_counted_by_searcher_and_outcome_and_their_stages_by_algorithm(monkeypatch):
    with watched(monkeypatch) as (host, metrics), Client(host.address) as client:
        client.match(scene(4), scene(4), searcher="exact", judge="confidence")
        client.match(scene(8), scene(8, 1), **ENDLESS, time_budget=0.3, judge="confidence")
    assert metrics.matches.values() == {("exact", "optimal"): 1, ("easm", "time_budget"): 1}
    stages = metrics.stage_seconds.values()
    assert {labels: counts[-1] for labels, (counts, _) in stages.items()} == {
        ("queue", "exact"): 1,
        ("queue", "easm"): 1,
        ("segment", "polygons"): 2,
        ("describe", "constant"): 2,
        ("relate", "cross-correlation"): 2,
        ("search", "exact"): 1,
        ("search", "easm"): 1,
    }
    assert stages["search", "easm"][1] > 0.1


def test_names_that_strangers_invent_have_one_count(monkeypatch, tmp_path):
    (tmp_path / "tokens").write_text(new_token("robot-7")[1].line)
    with watched(monkeypatch, tokens=tmp_path / "tokens") as (host, metrics):
        with grpc.insecure_channel(host.address) as channel:
            for method in ("/sketchmatch.v1.MatchService/Match", "/a/b", "/c/d"):
                with pytest.raises(grpc.RpcError):
                    channel.unary_unary(method)(b"", timeout=30)
        with Client(host.address) as client:
            assert client.is_serving()
    assert metrics.calls.values() == {
        ("Match", "UNAUTHENTICATED"): 1,
        ("other", "UNAUTHENTICATED"): 2,
    }
    assert metrics.refusals.values() == {("NOT_AUTHENTICATED",): 3}


def test_it_is_told_how_things_are(monkeypatch, tmp_path):
    pair = Authority(tmp_path, "ours").issue("localhost")
    files = TlsFiles(pair.certificate, pair.key)
    with watched(monkeypatch, tls=files) as (_, metrics):
        assert gauge(metrics, "sketchmatch_serving") == {(): 1.0}
        assert gauge(metrics, "sketchmatch_build_info") == {(sketchmatch.__version__,): 1.0}
        assert gauge(metrics, "sketchmatch_requests_limit") == {(): 3.0}
        assert gauge(metrics, "sketchmatch_requests") == {("running",): 0.0, ("waiting",): 0.0}
        assert gauge(metrics, "sketchmatch_waiting_bytes") == {(): 0.0}
        assert gauge(metrics, "sketchmatch_algorithm_ready")["searcher/align",] == 1.0
        (expires,) = gauge(metrics, "sketchmatch_certificate_expires_timestamp_seconds").values()
    assert expires == pytest.approx(time.time() + 30 * 86_400, abs=600)
    assert gauge(metrics, "sketchmatch_serving") == {(): 0.0}


@pytest.mark.parametrize("days", [1, 9_000, 30_000])  # these two before and after 2050
def test_a_certificate_says_until_when_it_is_good_as_openssl_says_it(tmp_path, days):
    pair = Authority(tmp_path, "ours").issue("localhost", days=days)
    command = ["openssl", "x509", "-noout", "-enddate", "-dateopt", "iso_8601", "-in"]
    told = subprocess.run([*command, pair.certificate], capture_output=True, text=True, check=True)
    until = datetime.fromisoformat(told.stdout.strip().removeprefix("notAfter="))
    found = watched_pems(TlsFiles(pair.certificate, pair.key), print).value
    assert found.expires == until


@pytest.mark.parametrize("pem", [b"", b"-----BEGIN TRUSTED CERTIFICATE-----", EMPTY])
def test_a_certificate_of_another_form_has_no_known_end_and_stops_nobody(pem):
    found = Pems(pem, b"", None, ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER))
    assert found.expires is None
    assert "it cannot be told" in found.validity


# Telling ----------------------------------------------------------------------------------------


def get(address, path):
    """Return status, type and text of an answer over HTTP."""
    try:
        with urllib.request.urlopen(f"http://{address}{path}", timeout=30) as answer:
            return answer.status, answer.headers["Content-Type"], answer.read().decode()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.headers["Content-Type"], error.read().decode()


@pytest.fixture
def unexposed(monkeypatch):
    """Do without the package that exposes metrics: probes are answered without it."""
    monkeypatch.setattr(monitor, "_exposition", lambda _: lambda: ("text/test", b"a 1\n"))


def at(host):
    """Return where a server has its monitor."""
    (found,) = (re.search(r"http://(.*)/metrics", line) for line in host.said if "metrics" in line)
    return found[1]


@pytest.mark.usefixtures("unexposed")
def test_probes_are_answered_over_http(monkeypatch):
    with watched(monkeypatch, metrics_address="127.0.0.1:0") as (host, _):
        assert get(at(host), "/livez") == (200, "text/plain; charset=utf-8", "ok\n")
        assert get(at(host), "/readyz?verbose")[0] == 200
        assert get(at(host), "/metrics") == (200, "text/test", "a 1\n")
        assert get(at(host), "/")[0] == 404
        address = at(host)
    with pytest.raises(urllib.error.URLError):
        get(address, "/livez")


@pytest.mark.usefixtures("unexposed")
def test_a_server_that_does_not_serve_yet_is_alive_and_not_ready():
    async def life():
        return monitor.Monitor("127.0.0.1:0", Metrics(()), lambda: False)

    found = in_loop(life()).result()
    try:
        assert get(found.address, "/livez")[0] == 200
        assert get(found.address, "/readyz")[0] == 503
    finally:
        found.close()


@pytest.mark.usefixtures("unexposed")
def test_a_server_whose_event_loop_hangs_is_not_alive(monkeypatch):
    monkeypatch.setattr(monitor, "_PATIENCE_SECONDS", 0.1)

    async def begin():
        return monitor.Monitor("127.0.0.1:0", Metrics(()), lambda: True)

    async def hang():
        time.sleep(1.0)

    found = in_loop(begin()).result()
    try:
        hanging = in_loop(hang())
        assert get(found.address, "/livez")[0] == 503
        hanging.result()
        assert get(found.address, "/livez")[0] == 200
    finally:
        found.close()


@pytest.mark.usefixtures("unexposed")
def test_whoever_says_nothing_holds_nobody_up(monkeypatch):
    with (
        watched(monkeypatch, metrics_address="127.0.0.1:0") as (host, _),
        socket.create_connection(at(host).split(":")),
    ):
        assert get(at(host), "/livez")[0] == 200


@pytest.mark.usefixtures("unexposed")
def test_an_address_in_use_is_refused_by_name(monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        with (
            pytest.raises(InvalidInputError) as caught,
            watched(monkeypatch, metrics_address=address),
        ):
            pass
    assert str(caught.value) == (
        f"server.metrics_address {address!r} cannot be listened on (address already in use); "
        "choose a free port of this host"
    )


def test_without_the_package_it_is_said_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "prometheus_client", None)
    with (
        pytest.raises(InvalidInputError, match=r"pip install 'sketchmatch\[metrics\]'"),
        watched(monkeypatch, metrics_address="127.0.0.1:0"),
    ):
        pass


def test_prometheus_reads_all_of_it(monkeypatch):
    require(importlib.util.find_spec("prometheus_client"), "the package prometheus-client")
    from prometheus_client.parser import text_string_to_metric_families

    settings = {"metrics_address": "127.0.0.1:0"}
    with watched(monkeypatch, **settings) as (host, metrics), Client(host.address) as client:
        client.match(scene(3), scene(3))
        client.match(scene(3), scene(3))
        status, kind, text = get(at(host), "/metrics")
    assert (status, kind.split(";")[0]) == (200, "text/plain")
    families = {family.name: family for family in text_string_to_metric_families(text)}
    samples = {
        (sample.name, frozenset(sample.labels.values())): sample.value
        for family in families.values()
        for sample in family.samples
    }
    for name, labels, value in (
        ("sketchmatch_calls_total", ["Match", "OK"], 2),
        ("sketchmatch_matches_total", ["align", "converged"], 2),
        ("sketchmatch_stage_seconds_count", ["search", "align"], 2),
        ("sketchmatch_call_seconds_bucket", ["Match", "+Inf"], 2),
        ("sketchmatch_serving", [], 1),
    ):
        assert samples[name, frozenset(labels)] == value, name
    names = {item.metric.name.removesuffix("_total") for item in metrics}
    told = {item.metric.name.removesuffix("_total") for item in metrics if item.values()}
    assert told <= families.keys()
    assert all(families[name].documentation for name in names & families.keys())
