"""Configuration from the outside: the commands, and what it does to matches and servers."""

import json
import re
import signal
from contextlib import contextmanager

import pytest

from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH
from sketchmatch_client import Client, InvalidRequestError, sources
from tests import processes

PAIR = (LIVING_ROOM_SKETCH, LIVING_ROOM_MAP)
SQUARES = [[(x, 0), (x + 1 + x / 9, 0), (x, 1)] for x in (0, 3, 7)]
MINE = """
profile = "mine"
[pipeline.searcher]
name = "nn"
[algorithms.searcher.nn]
seed_points = 5
[profiles.mine]
summary = "What I always use."
[profiles.mine.histogram]
name = "hybrid"
[server]
max_request_mib = 3
max_matches = 2
"""


@pytest.fixture(autouse=True)
def _nothing_around(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "home"))


@pytest.fixture
def mine(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(MINE)
    return path


def said(done):
    """Return the one line of a refusal."""
    assert (done.returncode, done.stdout) == (2, ""), done
    (line,) = done.stderr.splitlines()
    return line


# The commands -----------------------------------------------------------------------------------


def test_a_file_is_written_checked_and_shown(command_line, tmp_path):
    path = tmp_path / "sketchmatch.toml"
    done = command_line("config", "init")
    assert (done.returncode, done.stdout) == (0, "")
    assert said(command_line("config", "init")).endswith(
        "sketchmatch.toml exists already; choose another name, or replace it with --force"
    )
    assert command_line("config", "init", path, "--force").returncode == 0
    text = path.read_text(encoding="utf-8")
    for text_ in (text, re.sub(r"^# ", "", text, flags=re.M)):
        path.write_text(text_, encoding="utf-8")
        done = command_line("config", "check")
        assert (done.returncode, done.stdout) == (0, "sketchmatch.toml is sound\n"), done.stderr


def test_it_is_not_written_where_it_cannot_be(command_line, tmp_path):
    line = said(command_line("config", "init", tmp_path / "away" / "a.toml"))
    assert line.endswith("cannot be written (no such file or directory); check the path")


def test_show_says_what_is_in_force_and_why(command_line, mine, monkeypatch):
    monkeypatch.setenv("SKETCHMATCH_SERVER__MAX_MATCHES", "7")
    done = command_line("config", "show", "--config", mine)
    assert done.returncode == 0
    assert "max_matches = 7  # SKETCHMATCH_SERVER__MAX_MATCHES\n" in done.stdout
    assert f"max_request_mib = 3  # {mine}: server.max_request_mib\n" in done.stdout
    assert "grace_seconds = 5.0  # default\n" in done.stdout
    again = mine.with_name("again.toml")
    again.write_text(done.stdout, encoding="utf-8")
    assert command_line("config", "check", again).returncode == 0
    found = json.loads(command_line("config", "show", "--config", mine, "--json").stdout)
    assert found["file"] == str(mine)
    assert found["settings"]["algorithms.searcher.nn.seed_points"] == {
        "value": 5,
        "origin": "file",
        "place": f"{mine}: algorithms.searcher.nn.seed_points",
    }


def test_check_says_every_fault_in_a_line(command_line, mine):
    mine.write_text(MINE.replace("max_matches = 2", "max_matches = 0\ncolour = 1"))
    done = command_line("config", "check", mine)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.splitlines() == [
        f"sketchmatch: {mine}: server.max_matches is 0; it should be greater than or equal to 1",
        f"sketchmatch: {mine}: server.colour is not a setting; server has: address, grace_seconds, "
        "max_request_mib, max_matches, workers, max_waiting, max_waiting_mib, max_wait_seconds, "
        "max_time_budget_seconds, default_time_budget_seconds, max_matches_per_caller, "
        "max_requests_per_minute, max_stored_mib_per_caller, max_comparisons, max_candidates, "
        "tls_certificate, tls_key, tls_client_ca, tokens, store, keep, keep_matches_days, "
        "keep_matches_mib, keep_scenes_mib, max_sketches, max_sketches_per_caller, "
        "sketch_idle_seconds, metrics_address, traces_endpoint, web_address, web_origins, "
        "web_robots, insecure",
    ]


# Matches in this process ------------------------------------------------------------------------


def test_a_match_takes_file_profile_and_flags_each_over_the_other(command_line, mine):
    def pipeline(*options):
        done = command_line("match", *PAIR, "--json", *options)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    assert pipeline()["statistics"]["iterations"] != "5"
    assert pipeline("--config", mine)["statistics"]["iterations"] == "5"
    assert pipeline("--config", mine, "--profile", "proof")["outcome"] == "OUTCOME_OPTIMAL"
    assert (
        pipeline("--config", mine, "--set", "searcher.seed_points=3")["statistics"]["iterations"]
        == "3"
    )
    assert pipeline("--config", mine, "--searcher", "exact")["outcome"] == "OUTCOME_OPTIMAL"
    mine.rename("sketchmatch.toml")
    assert pipeline()["statistics"]["iterations"] == "5", "the file that lies here is read"


def test_describe_relate_and_segment_take_it_too(command_line, mine):
    def chosen(command, *arguments):
        done = command_line(command, *arguments, "--json", "--config", mine)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)["histogram" if command != "segment" else "segmenter"]

    assert chosen("describe", LIVING_ROOM_SKETCH)["name"] == "hybrid"
    assert chosen("relate", *PAIR)["name"] == "hybrid"
    assert chosen("describe", LIVING_ROOM_SKETCH, "--profile", "thesis-easm")["name"] == "constant"
    mine.write_text("[algorithms.segmenter.strokes]\nmin_size = 0.125\n")
    assert chosen("segment", LIVING_ROOM_SKETCH)["parameters"]["min_size"] == 0.125


def test_plugins_list_shows_what_is_the_default_here(command_line, mine):
    mine.rename("sketchmatch.toml")
    found = json.loads(command_line("plugins", "list", "--json").stdout)
    searchers = {
        item["name"]: item
        for item in found["algorithms"]
        if item["kind"] == "ALGORITHM_KIND_SEARCHER"
    }
    assert [name for name, item in searchers.items() if item["isDefault"]] == ["nn"]
    schema = searchers["nn"]["parametersSchema"]["properties"]["seed_points"]
    assert schema["default"] == 5
    profiles = {item["name"]: item for item in found["profiles"]}
    assert [name for name, item in profiles.items() if item["isDefault"]] == ["mine"]
    assert profiles["mine"]["summary"] == "What I always use."
    assert profiles["mine"]["pipeline"]["histogram"]["name"] == "hybrid"


@pytest.mark.parametrize("command", [("match", *PAIR), ("segment", LIVING_ROOM_MAP), ("serve",)])
@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "[pipeline.searcher]\nname = 'best'",
            "pipeline.searcher.name is 'best', which is not a s",
        ),
        ("[sever]", "sever is not a setting; did you mean server?"),
        ("[server]\naddress = ?", "is not TOML at line 2, column 11 (invalid value); correct it"),
    ],
)
def test_a_bad_file_is_refused_in_one_line(command_line, tmp_path, command, text, words):
    path = tmp_path / "bad.toml"
    path.write_text(text)
    line = said(command_line(*command, "--config", path))
    joint = " " if "TOML" in words else ": "
    assert line.startswith(f"sketchmatch: {path}{joint}{words}")


def test_a_profile_or_file_that_is_not_there_is_refused(command_line):
    line = said(command_line("match", *PAIR, "--profile", "best"))
    assert line == (
        "sketchmatch: pipeline.profile is 'best', which is not a profile; "
        "choose one of: proof, thesis, thesis-easm, thesis-fsnn"
    )
    assert "away.toml does not exist" in said(command_line("match", *PAIR, "--config", "away.toml"))
    line = said(command_line("match", *PAIR, "--config", "a.toml", "--server", "127.0.0.1:1"))
    assert line == (
        "sketchmatch: --config is not used with --server, as the server has its own; "
        "leave out one of the two"
    )


def test_serve_names_the_option_that_is_wrong(command_line):
    line = said(command_line("serve", "--max-objects", "1"))
    assert line == "sketchmatch: --max-objects is 1; it should be greater than or equal to 2"


# Servers ----------------------------------------------------------------------------------------


@contextmanager
def client_of(*arguments):
    with processes.server(*arguments) as running, Client(running.address) as client:
        yield client


@pytest.mark.slow
def test_a_server_takes_its_file_and_options_over_it(mine):
    sketch = sources.polygons(SQUARES)
    with client_of("--config", str(mine), "--max-matches", "3") as client:
        info = client.server_info().limits
        assert (info.max_request_bytes, info.max_concurrent_matches) == (3 * 1024 * 1024, 3)
        found = client.match(sketch, sketch)
        pipeline = found.accepted.pipeline
        assert (pipeline.profile, pipeline.histogram.name) == ("mine", "hybrid")
        assert pipeline.searcher.name == "nn"
        assert pipeline.searcher.parameters["seed_points"] == 5
        proof = client.match(sketch, sketch, profile="proof", histogram="angles")
        assert proof.accepted.pipeline.profile == "proof"
        assert proof.accepted.pipeline.searcher.name == "exact"
        assert proof.accepted.pipeline.histogram.name == "angles"
        with pytest.raises(InvalidRequestError) as caught:
            client.match(sketch, sketch, profile="best")
        assert (caught.value.reason, caught.value.field) == ("UNKNOWN_PROFILE", "pipeline.profile")
        assert "choose one of: mine, proof, thesis, thesis-easm" in str(caught.value)
        offered = client.algorithms()
        assert [item.name for item in offered.profiles if item.is_default] == ["mine"]
        assert all(item.source for item in offered.algorithms if item.name == "easm")


@pytest.mark.slow
def test_a_server_reads_its_file_again_on_sighup_and_keeps_to_options(mine):
    sketch = sources.polygons(SQUARES)
    options = ("--config", str(mine), "--max-matches", "3")
    with processes.server(*options) as running, Client(running.address) as client:

        def reload(text, said):
            mine.write_text(text)
            running.process.send_signal(signal.SIGHUP)
            running.wait_for(said)
            return client.match(sketch, sketch).accepted.pipeline.profile

        assert reload("profile = 'proof'", "is reloaded") == "proof"
        assert client.server_info().limits.max_concurrent_matches == 3
        assert reload("profile = 'best'", f"{mine}: profile is 'best', which is no") == "proof"


def test_a_command_names_a_profile_of_the_server(command_line, address):
    done = command_line("match", *PAIR, "--server", address, "--profile", "proof", "--json")
    assert json.loads(done.stdout)["outcome"] == "OUTCOME_OPTIMAL", done.stderr
    line = said(command_line("match", *PAIR, "--server", address, "--profile", "best"))
    assert "is 'best', which is not a profile" in line


@pytest.mark.slow
def test_a_profile_without_its_plugin_does_not_keep_a_server_from_starting(mine):
    mine.write_text("[profiles.other.searcher]\nname = 'annealing'\n")
    sketch = sources.polygons(SQUARES)
    with client_of("--config", str(mine)) as client:
        assert client.match(sketch, sketch).object_map == {0: 0, 1: 1, 2: 2}
        with pytest.raises(InvalidRequestError) as caught:
            client.match(sketch, sketch, profile="other")
        assert str(caught.value).startswith(
            "pipeline.profile is 'other', whose searcher.name is 'annealing', which is not a search"
        )
