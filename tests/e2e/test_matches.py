"""`sketchmatch matches`: what a caller's matches on a server are, typed as people type it."""

import json

import pytest

from sketchmatch_client import Client
from tests.processes import sketchmatch
from tests.server.harness import ENDLESS, scene, serving


@pytest.fixture(scope="module")
def served():
    """A server with a match that was done and one that runs: its address and their names."""
    with serving(max_time_budget=600.0) as host, Client(host.address) as client:
        done = client.match(scene(4, 0), scene(4, 1)).accepted.match_id
        options = {**ENDLESS, "keep_running": True, "time_budget": 600.0}
        with client.events(scene(4, 0), scene(4, 1), **options) as call:
            runs = next(call).accepted.match_id
        yield host.address, done, runs


def lines(*command):
    found = sketchmatch("matches", *command)
    assert (found.returncode, found.stderr) == (0, "")
    return [line.split("\t") for line in found.stdout.splitlines()]


@pytest.mark.slow
def test_ones_matches_are_listed_shown_watched_and_cancelled(served):
    address, done, runs = served
    listed = lines("list", "--server", address)
    assert [line[:2] for line in listed] == [[runs, "RUNNING"], [done, "SUCCEEDED"]]
    latest = sketchmatch("matches", "list", "--server", address, "--json", "--limit=1")
    (only,) = json.loads(latest.stdout)["matches"]
    assert only["matchId"] == runs
    shown = lines("show", done, "--server", address)
    assert shown[0][:2] == ["sketch_object", "map_object"]
    assert len(shown) == 5
    assert lines("watch", done, "--server", address) == shown
    assert lines("cancel", runs, "--server", address)[0][0] == runs
    stopped = sketchmatch("matches", "watch", runs, "--server", address)
    assert (stopped.returncode, stopped.stdout) == (5, "")
    assert stopped.stderr == "sketchmatch: the match was cancelled\n"


@pytest.mark.slow
def test_a_match_that_is_not_there_and_a_server_that_is_not_asked_are_one_line_each(served):
    address, *_ = served
    missing = sketchmatch("matches", "show", "nobody", "--server", address)
    assert missing.returncode == 2
    assert missing.stderr.count("\n") == 1
    assert "you have no match 'nobody' on this server" in missing.stderr
    here = sketchmatch("match", "sketch.svg", "map.yaml", "--keep-running")
    assert (here.returncode, here.stderr.count("\n")) == (2, 1)
    assert "--keep-running needs a server, but none is given" in here.stderr
