"""A stranger's plugin runs in a process of its own, and harms no request but its own."""

import multiprocessing
import os
import re
import signal
import statistics
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from sketchmatch.app import workers
from sketchmatch.app.setup import Isolation, RequestLimits, Setup
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.selection import Choice, Defaults, Profile
from sketchmatch.registry import discover
from sketchmatch_client import (
    CallCancelledError,
    Client,
    InvalidRequestError,
    ServerFailedError,
)
from sketchmatch_proto.v1.catalog_service_pb2 import PluginState
from sketchmatch_proto.v1.match_pb2 import Outcome
from tests.pace import wait_until
from tests.processes import assert_all_end, children_of, server, sketchmatch
from tests.server.harness import hosting, scene
from tests.server.misbehaving import BROKEN, UNSTOPPABLE

PATIENCE = 1.0
ENDLESS = {"guessing": {"tries": 100_000, "pause": 0.01}, "lockingsearcher": {}}
"""Parameters with which a searcher goes on until it is stopped."""
PLUGINS = {
    "acme-misbehaving": "tests.server.misbehaving",
    "acme-well-behaved": "tests.server.well_behaved",
    "acme-unimportable": "tests.server.surely_not_there",
    "acme-rubbish": "tests.server.harness:shapes",
}


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Return a folder with several distributions, installed as pip would."""
    folder = tmp_path_factory.mktemp("site")
    for distribution, entry in PLUGINS.items():
        info = folder / f"{distribution.replace('-', '_')}-1.2.dist-info"
        info.mkdir()
        metadata = f"Metadata-Version: 2.1\nName: {distribution}\nVersion: 1.2\n"
        (info / "METADATA").write_text(metadata, encoding="utf-8")
        points = f"[sketchmatch]\n{distribution} = {entry}\n"
        (info / "entry_points.txt").write_text(points, encoding="utf-8")
    return folder


@contextmanager
def finding(site, patience):
    """Run a server that finds the distributions."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(site)
        setup = Setup(Engine(discover()), isolation=Isolation(patience=patience))
        with hosting(setup) as running:
            yield running


@pytest.fixture(scope="module")
def host(site):
    with finding(site, PATIENCE) as running:
        yield running


@pytest.fixture(scope="module")
def patient_host(site):
    """Yield one on which a new process may take its time, as it does on a busy machine."""
    with finding(site, 60.0) as running:
        yield running


@pytest.fixture(scope="module")
def client(host):
    with Client(host.address) as connected:
        connected.match(scene(4), scene(4), searcher="guessing")  # starts a process
        yield connected


def process_of(match) -> int:
    return int(match.result.search_note.removeprefix("process "))


def test_a_strangers_search_runs_in_another_process_and_finds_the_same(client):
    asked = {"searcher": "guessing", "params": {"searcher": {"tries": 50}}, "seed": 3}
    first, again = (client.match(scene(4), scene(5, 1), **asked) for _ in range(2))
    assert process_of(first) != os.getpid()
    assert process_of(first) == process_of(again), "a process that behaved is used again"
    trusting = Setup(
        Engine(discover()), isolation=Isolation(trusted=frozenset({"acme-well-behaved"}))
    )
    with hosting(trusting, warm=False) as host, Client(host.address) as inside:
        trusted = inside.match(scene(4), scene(5, 1), **asked)
    assert process_of(trusted) == os.getpid()
    for one in (first, again, trusted):
        one.result.ClearField("statistics")
        one.result.ClearField("match_id")
        one.result.ClearField("search_note")
    assert first.result == again.result == trusted.result


def test_its_events_come_one_by_one_and_it_is_stopped_when_the_caller_goes(client):
    slow = {"searcher": "guessing", "params": {"searcher": ENDLESS["guessing"]}}
    before = process_of(client.match(scene(4), scene(4), searcher="guessing"))
    events = client.events(scene(4), scene(4), **slow)
    seen = [next(events).WhichOneof("event") for _ in range(6)]
    assert seen[0] == "accepted"
    assert seen[-1] == "progress"
    events.close()
    time.sleep(1.0)
    after = client.match(scene(4), scene(4), searcher="guessing")
    assert process_of(after) == before, "it stopped when it was asked to, and is used again"


def test_its_time_budget_ends_it_with_an_answer(client):
    slow = {"searcher": "guessing", "params": {"searcher": ENDLESS["guessing"]}}
    found = client.match(scene(4), scene(4), **slow, time_budget=0.5)
    assert Outcome.Name(found.result.outcome) == "OUTCOME_TIME_BUDGET"


def test_its_time_budget_begins_when_it_has_compiled_what_it_needs(client, monkeypatch):
    monkeypatch.setattr(workers, "_OVERTIME", 0.2)
    slow = {"searcher": "compiling", "params": {"searcher": ENDLESS["guessing"]}}
    found = client.match(scene(4), scene(4), **slow, judge="confidence", time_budget=0.5)
    assert Outcome.Name(found.result.outcome) == "OUTCOME_TIME_BUDGET"


def test_a_bad_parameter_of_a_strangers_algorithm_is_refused_as_any_other(client):
    with pytest.raises(InvalidRequestError, match=r"searcher\.parameters\.tries is 0") as no:
        client.match(scene(4), scene(4), searcher="guessing", params={"searcher": {"tries": 0}})
    assert no.value.reason == "INVALID_PARAMETER"


def test_segment_uses_strangers_too_and_keeps_the_paths_of_their_refusals(client):
    assert len(client.segment(scene(4), segmenter="same-polygons").scene.objects) == 4
    with pytest.raises(InvalidRequestError, match=r"source.polygon_set.polygons\[0\] is not to my"):
        client.segment(scene(4), segmenter="refusing")


@pytest.mark.parametrize(
    ("distribution", "words"),
    [
        ("acme-unimportable", "ModuleNotFoundError: No module named"),
        ("acme-rubbish", "ValueError: it offers no algorithm"),
    ],
)
def test_what_cannot_be_loaded_is_listed_and_named_to_whoever_asks_for_it(
    client, distribution, words
):
    (plugin,) = (p for p in client.algorithms().plugins if p.distribution == distribution)
    assert PluginState.Name(plugin.state) == "PLUGIN_STATE_FAILED"
    assert re.search(words, plugin.reason)
    with pytest.raises(InvalidRequestError, match=f"plugin .* of {distribution} failed to load"):
        client.match(scene(4), scene(4), searcher="what-it-might-have-offered")


def test_a_wrong_name_is_refused_for_its_own_sake_though_workers_lack_the_plugins(site):
    words = {
        "searcher": r"pipeline\.searcher\.name is 'guesing', which is not a searcher; .* failed",
        "judge": r"pipeline\.judge\.name is 'nonesuch', which is not a judge; ",
        "profile": r"pipeline\.profile is 'nonesuch', which is not a profile; ",
    }
    asked = {
        "searcher": {"searcher": "guesing"},
        "judge": {"searcher": "guessing", "judge": "nonesuch"},
        "profile": {"searcher": "guessing", "profile": "nonesuch"},
    }
    defaults = Defaults(profiles=(Profile("mine", "", {"searcher": Choice("guessing")}),))
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(site)
        known = Setup(Engine(discover(), defaults), isolation=Isolation(patience=60.0))
        with hosting(known, workers=1) as host, Client(host.address) as client:
            for what, options in asked.items():
                with pytest.raises(InvalidRequestError, match=words[what]) as no:
                    client.match(scene(4), scene(4), **options)
                assert "plugins.allow" not in str(no.value)
            found = client.match(scene(4), scene(4), profile="mine", searcher="exact")
    assert found.object_map == {k: k for k in range(4)}


def test_what_a_plugin_that_failed_has_changed_no_other_request_meets(patient_host):
    with Client(patient_host.address) as client:
        for _ in range(2):
            with pytest.raises(ServerFailedError, match="histogram poisoninghistogram of acme-mis"):
                client.match(scene(4), scene(4), histogram="poisoninghistogram")
            assert len(client.segment(scene(4)).scene.objects) == 4


def test_threads_that_a_plugin_leaves_end_with_its_process_and_are_told(patient_host, caplog):
    with Client(patient_host.address) as client:
        for _ in range(2):
            found = client.match(scene(4), scene(4), histogram="threadedhistogram")
            assert found.object_map == {k: k for k in range(4)}
    told = [record.message for record in caplog.records if "left threads" in record.message]
    assert told[0] == (
        "histogram threadedhistogram of acme-misbehaving 1.2 left threads running (spinning), so "
        "its process was ended; report it to its author, or choose another"
    )


class Others:
    """Requests that have nothing to do with a plugin, one after the other."""

    def __init__(self, address: str) -> None:
        self.seconds: list[float] = []
        self._stop = threading.Event()
        self._failure: BaseException | None = None
        self._client = Client(address)
        self._thread = threading.Thread(target=self._ask, daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._stop.set()
        self._thread.join(30)
        self._client.close()
        if self._failure is not None:
            raise self._failure

    def median_of(self, count: int, at_least_while=lambda: False) -> float:
        """Return the median time of the requests to come."""
        first = len(self.seconds)
        while len(self.seconds) < first + count or at_least_while():
            assert self._thread.is_alive(), "a request failed that had nothing to do with it"
            time.sleep(0.005)
        return statistics.median(self.seconds[first:])

    def _ask(self) -> None:
        try:
            while not self._stop.is_set():
                began = time.perf_counter()
                found = self._client.match(scene(8), scene(8))
                self.seconds.append(time.perf_counter() - began)
                assert found.object_map == {k: k for k in range(8)}
        except BaseException as error:
            self._failure = error


def slowdown(host, misbehave) -> float:
    """Return how many times longer other requests take while something misbehaves."""
    with Others(host.address) as others:
        quiet = others.median_of(20)
        misbehaving = threading.Thread(target=misbehave, daemon=True)
        misbehaving.start()
        busy = others.median_of(20, at_least_while=misbehaving.is_alive)
        misbehaving.join()
    return busy / quiet


def fails(client, plugin) -> None:
    """Ask for an algorithm that misbehaves, and check that it is blamed."""
    stage, words = {**BROKEN, **UNSTOPPABLE}[plugin]
    # `auto` leaves no objects out, so that the judge is asked whether it does.
    chosen = {"searcher": "auto", stage: plugin.name}
    with pytest.raises(ServerFailedError, match=words) as raised:
        client.match(scene(4), scene(4), **chosen, time_budget=20.0)
    kind = stage.removeprefix("map_")
    assert raised.value.reason == "PLUGIN_FAILED"
    assert str(raised.value).startswith(f"{kind} {plugin.name} of acme-misbehaving 1.2 ")
    assert str(raised.value).endswith("; report it to its author, or choose another")


@pytest.mark.slow
@pytest.mark.parametrize(
    "plugins",
    [tuple(BROKEN), *((plugin,) for plugin in UNSTOPPABLE)],
    ids=lambda plugins: "+".join(plugin.__name__ for plugin in plugins)[:40],
)
def test_plugins_that_misbehave_harm_no_other_request(request, plugins):
    silent = "no sign of life" in (BROKEN | UNSTOPPABLE)[plugins[0]][1]
    host = request.getfixturevalue("host" if silent else "patient_host")
    blamed = []

    def misbehave():
        with Client(host.address) as client:
            for plugin in plugins:
                fails(client, plugin)
                blamed.append(plugin)

    # The machine may be busy with something else: that is no fault of the plugins.
    assert any(slowdown(host, misbehave) < 2.0 for _ in range(3))
    assert set(blamed) == set(plugins)


@pytest.mark.slow
def test_a_search_that_ignores_its_time_budget_is_stopped(host):
    del host
    patient = Setup(Engine(discover()), isolation=Isolation(patience=60.0))
    words = r"did not end 2 s after its time budget of 0\.5 s and was stopped"
    with (
        hosting(patient, warm=False) as other,
        Client(other.address) as connected,
        pytest.raises(ServerFailedError, match=words),
    ):
        connected.match(scene(4), scene(4), searcher="sleepingsearcher", time_budget=0.5)


@pytest.mark.slow
def test_stuck_requests_of_strangers_leave_places_to_all_others(host):
    """Half of four places are theirs: six of eight requests wait for one."""
    del host
    crowded = Setup(
        Engine(discover()), RequestLimits(max_concurrent_matches=4), Isolation(patience=60.0)
    )
    with hosting(crowded, workers=2) as other, Client(other.address) as connected:
        stuck = [
            connected.events(scene(4), scene(4), searcher="sleepingsearcher") for _ in range(8)
        ]
        told = []

        def ask(events):
            with suppress(CallCancelledError):
                told.extend(event.WhichOneof("event") for event in events)

        asking = [threading.Thread(target=ask, args=(events,)) for events in stuck]
        for each in asking:
            each.start()
        wait_until(lambda: told.count("accepted") == 2, "they do not begin")
        for _ in range(10):
            found = connected.match(scene(4), scene(4), timeout=60)
            assert found.object_map == {k: k for k in range(4)}
        assert told.count("accepted") == 2
        for events in stuck:
            events.cancel()
        for each in asking:
            each.join(30)
        wait_until(lambda: connected.match(scene(4), scene(4), searcher="guessing"), "")


@pytest.mark.slow
def test_no_process_outlives_its_server(host):
    del host
    with (
        hosting(Setup(Engine(discover())), warm=False) as other,
        Client(other.address) as connected,
    ):
        found = connected.match(scene(4), scene(4), searcher="guessing")
        assert process_of(found) in {child.pid for child in multiprocessing.active_children()}
    assert process_of(found) not in {child.pid for child in multiprocessing.active_children()}


@pytest.mark.slow
@pytest.mark.parametrize("searcher", ["guessing", "lockingsearcher"])
def test_no_process_outlives_a_server_that_is_killed(site, tmp_path, monkeypatch, searcher):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join((str(site), str(Path.cwd()))))
    file = tmp_path / "sketchmatch.toml"
    file.write_text("[plugins]\npatience_seconds = 2\n", encoding="utf-8")
    with server("--config", str(file)) as running, Client(running.address) as connected:
        connected.wait_until_serving(60)
        found = connected.match(scene(4), scene(4), searcher="guessing")
        events = connected.events(
            scene(4), scene(4), searcher=searcher, params={"searcher": ENDLESS[searcher]}
        )
        while next(events).WhichOneof("event") != "progress":
            pass
        children = children_of(running.process.pid)
        assert process_of(found) in children
        running.process.kill()
        running.process.wait(10)
        assert_all_end(children)


@pytest.mark.slow
def test_a_signal_to_the_whole_group_lets_strangers_matches_end_within_the_grace(site, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", os.fspath(site), prepend=os.pathsep)
    monkeypatch.setenv("PYTHONPATH", os.fspath(Path.cwd()), prepend=os.pathsep)
    asked = {"searcher": "guessing", "params": {"searcher": {"tries": 200, "pause": 0.01}}}
    with (
        server("--grace", "60", process_group=0) as running,
        Client(running.address) as connected,
        ThreadPoolExecutor(2) as threads,
    ):
        searching = connected.events(scene(4), scene(4), **asked)
        while not next(searching).progress.HasField("confidence"):
            pass
        before = set(children_of(running.process.pid))
        starting = threads.submit(connected.match, scene(4), scene(4), **asked)
        wait_until(lambda: set(children_of(running.process.pid)) - before, "no process starts")
        os.killpg(running.process.pid, signal.SIGTERM)
        ends = [*searching][-1], starting.result(60)
        assert running.end() == 0
    assert ends[0].WhichOneof("event") == "result"
    assert ends[1].result.search_note.startswith("process ")


@pytest.mark.slow
def test_strict_plugins_keep_a_server_from_starting_and_a_denied_one_is_no_problem(
    site, tmp_path, monkeypatch
):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join((str(site), str(Path.cwd()))))
    refused = sketchmatch("serve", "--address", "127.0.0.1:0", "--strict-plugins")
    assert refused.returncode == 5
    assert re.fullmatch(
        r"sketchmatch: plugin acme-\S+ of acme-\S+ 1\.2 failed to load: .* "
        r"\(and 1 more\); correct it, or set plugins\.strict to false\n",
        refused.stderr,
    )
    file = tmp_path / "sketchmatch.toml"
    file.write_text(
        '[plugins]\nstrict = true\ndeny = ["acme-rubbish", "Acme_Unimportable"]\n', encoding="utf-8"
    )
    with server("--config", str(file)) as running, Client(running.address) as connected:
        states = {
            plugin.distribution: (PluginState.Name(plugin.state), plugin.reason)
            for plugin in connected.algorithms().plugins
        }
    denied = ("PLUGIN_STATE_DISABLED", "the configuration denies it (plugins.deny)")
    assert states["acme-rubbish"] == states["acme-unimportable"] == denied
    assert states["acme-well-behaved"] == ("PLUGIN_STATE_ACTIVE", "")
