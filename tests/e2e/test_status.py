"""``sketchmatch health`` and ``sketchmatch status``, of real servers."""

import json
import re
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

import sketchmatch
from tests.client.fake_server import running
from tests.processes import Terminal


def test_health_says_serving_with_exit_code_0(command_line, address):
    done = command_line("health", address)
    assert (done.returncode, done.stdout, done.stderr) == (0, "SERVING\n", "")
    assert command_line("health", address, "--of", "searcher/align").stdout == "SERVING\n"


def test_health_of_a_server_that_does_not_serve_is_exit_code_3(command_line):
    with running() as fake:
        fake.set_health("NOT_SERVING")
        done = command_line("health", fake.address)
    assert (done.returncode, done.stdout, done.stderr) == (3, "NOT_SERVING\n", "")


def test_health_of_nobody_is_exit_code_3_and_a_line(command_line):
    done = command_line("health", "127.0.0.1:1")
    assert (done.returncode, done.stdout) == (3, "")
    assert done.stderr.startswith("sketchmatch: the sketchmatch server at 127.0.0.1:1 is not avail")
    assert len(done.stderr.splitlines()) == 1


@pytest.fixture
def probed():
    """Yield what says whether it is ready, and its address over HTTP."""
    answers = {"/readyz": 200}

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(answers.get(self.path, 404))
            self.end_headers()

        def log_message(self, *_):
            pass

    with HTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield answers, f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()
        thread.join()


def test_health_may_be_asked_over_http_without_certificates_and_proxies(
    command_line, probed, monkeypatch
):
    answers, address = probed
    monkeypatch.setenv("http_proxy", "http://127.0.0.1:9")
    monkeypatch.setenv("SKETCHMATCH_ROOT_CERTIFICATES", "away")
    done = command_line("health", address)
    assert (done.returncode, done.stdout, done.stderr) == (0, "SERVING\n", "")
    answers["/readyz"] = 503
    done = command_line("health", f"{address}/")
    assert (done.returncode, done.stdout, done.stderr) == (3, "NOT_SERVING\n", "")
    del answers["/readyz"]  # as of the port for browsers
    done = command_line("health", address)
    assert (done.returncode, done.stdout) == (3, "")
    assert done.stderr.startswith(f"sketchmatch: {address} does not answer whether the server")
    done = command_line("health", address, "--of", "searcher/easm")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("sketchmatch: --of cannot be asked over HTTP; ")


@pytest.mark.parametrize("address", ["http://127.0.0.1:1", "http://", "http://[:1", "http://a b"])
def test_a_probe_that_nobody_answers_is_exit_code_3_and_a_line(command_line, address):
    done = command_line("health", address)
    assert (done.returncode, done.stdout) == (3, "")
    assert done.stderr.startswith(f"sketchmatch: {address} does not answer whether the")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["nowhere"], "ADDRESS is 'nowhere'; add the port, as in 'nowhere:50051'"),
        (["{address}", "--of", "searcher/esm"], "--of is 'searcher/esm', which the server does"),
        (["{address}", "--of", "x" * 1000], "--of is 'xxxxxx"),
        (["{address}", "--token-file", "away"], "--token-file names away, which cannot be read"),
    ],
)
def test_health_asked_wrongly_is_exit_code_2_and_a_line(command_line, address, arguments, sentence):
    done = command_line("health", *(text.format(address=address) for text in arguments))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"sketchmatch: {sentence}")
    assert len(done.stderr.splitlines()) == 1


def test_status_shows_a_line_of_each_kind_with_a_tab(command_line, address):
    done = command_line("status", address)
    assert done.returncode == 0
    lines = dict(line.split("\t") for line in done.stdout.splitlines())
    assert list(lines) == ["server", "version", "limits", "algorithms", "plugin"]
    assert re.fullmatch(rf"{address}, SERVING, answers in \d+ ms", lines["server"])
    assert lines["version"].startswith(
        f"sketchmatch {sketchmatch.__version__}, sketchmatch.v1, up "
    )
    assert "64 MiB a request; 1000 objects a scene" in lines["limits"]
    assert re.fullmatch(r"\d+, (all ready|not ready: .*)", lines["algorithms"])
    assert lines["plugin"] == f"sketchmatch {sketchmatch.__version__}, active"


def test_status_of_an_older_server_says_nothing_of_readiness(command_line):
    with running() as fake:
        fake.set_health("NOT_SERVING")
        lines = command_line("status", fake.address).stdout.splitlines()
    assert f"{fake.address}, NOT_SERVING, " in lines[0]
    assert lines[-1] == "algorithms\t1"


def test_status_as_json(command_line, address):
    found = json.loads(command_line("status", address, "--json").stdout)
    assert found["address"] == address
    assert found["serving"] is True
    assert found["ready"]["searcher/align"] is True
    assert found["info"]["limits"]["maxObjects"] == 1000


@pytest.mark.slow
def test_on_a_terminal_the_lines_are_a_table(address):
    screen = Terminal("status", address)
    assert screen.end()[0] == 0
    assert f"server      {address}, SERVING" in screen.shown
