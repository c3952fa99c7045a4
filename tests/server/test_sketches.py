"""Sketches in progress, over the wire: drawn, changed, undone, watched."""

import asyncio
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import grpc
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sketchmatch.app.setup import RequestLimits, Setup
from sketchmatch.app.sketches import question
from sketchmatch.pipeline.engine import Engine
from sketchmatch.registry import default_registry
from sketchmatch_client import (
    AsyncClient,
    Client,
    InvalidRequestError,
    NotFoundError,
    ServerUnavailableError,
    StoreError,
    sources,
)
from sketchmatch_proto.v1.match_pb2 import MatchResult
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest
from sketchmatch_proto.v1.sketch_service_pb2 import CreateSketchRequest
from sketchmatch_proto.v1.sketch_service_pb2_grpc import SketchServiceStub
from tests.contract.golden import golden
from tests.pace import slowness
from tests.processes import server
from tests.server.harness import hosting, scene, shapes, turned
from tests.tools import ROOT

MAP = scene(9, 1, [f"thing {k}" for k in range(9)])
OUTLINES = [[*outline, outline[0]] for outline in np.array(turned(shapes(9, 1)), object)]


def outline(k, shift=0.0):
    return [(float(x) + shift, float(y)) for x, y in OUTLINES[k]]


@pytest.fixture(scope="module")
def host(tmp_path_factory):
    setup = Setup(Engine(default_registry()), RequestLimits(max_time_budget=20.0))
    with hosting(setup, store=tmp_path_factory.mktemp("state") / "store") as host:
        yield host


@pytest.fixture(scope="module")
def client(host) -> Iterator[Client]:
    with Client(host.address, timeout=60) as client:
        yield client


class Watching:
    """What a sketch has told so far."""

    def __init__(self, sketch):
        self.events, self.error = [], None
        self._news = threading.Condition()
        self._thread = threading.Thread(target=self._watch, args=(sketch,), daemon=True)
        self._thread.start()

    def _watch(self, sketch):
        try:
            for event in sketch.watch(timeout=120):
                with self._news:
                    self.events.append(event)
                    self._news.notify_all()
        except Exception as error:
            self.error = error
        with self._news:
            self._news.notify_all()

    def outcome(self, revision):
        """Return what came of a revision in the end."""

        def found():
            return [
                event
                for event in self.events
                if event.revision == revision
                and (
                    event.HasField("problem")
                    or (event.HasField("result") and not event.result.result.provisional)
                )
            ]

        with self._news:
            assert self._news.wait_for(lambda: found() or self.error, 30.0 * slowness())
        assert self.error is None
        return found()[-1]

    def end(self):
        self._thread.join(30.0 * slowness())
        assert not self._thread.is_alive()
        return self.error


@contextmanager
def drawing(client, map_=MAP, **options):
    with client.sketch(map_, **options) as sketch:
        yield sketch, Watching(sketch)


def result_of(message):
    plain = MatchResult()
    plain.CopyFrom(message)
    for field in ("match_id", "statistics"):
        plain.ClearField(field)
    return plain


def matched(client, strokes, map_=MAP, **options):
    return result_of(client.match(sources.strokes(strokes), map_, **options).result)


def test_a_sketch_grows_object_by_object(client):
    with drawing(client) as (sketch, watching):
        too_few = watching.outcome(0).problem
        assert too_few.reason == "TOO_FEW_OBJECTS"
        assert too_few.message.startswith("sketch.stroke_set.strokes ")
        for k in range(4):
            made = sketch.update({f"s{k}": outline(k)})
            assert (made.revision, made.stroke_count) == (k + 1, k + 1)
        found = watching.outcome(4).result
        assert {m.sketch_object: m.map_object for m in found.result.object_matches} == {
            k: k for k in range(4)
        }
        first, *others = watching.events
        assert [item.label for item in first.map.scene.objects] == [f"thing {k}" for k in range(9)]
        assert not any(event.HasField("map") for event in others)
        revisions = [event.revision for event in watching.events]
        assert revisions == sorted(revisions)
        (objects,) = [e.objects for e in others if e.HasField("objects") and e.revision == 4][-1:]
        assert len(objects.scene.objects) == 4


def test_ten_seconds_of_a_fast_pen_are_one_update(client):
    with drawing(client) as (sketch, watching):
        sketch.update({f"s{k}": outline(k) for k in range(3)})
        corners = np.array(outline(3))
        along = np.linspace(0, len(corners) - 1, 10_000)
        line = [np.interp(along, range(len(corners)), corners[:, axis]) for axis in (0, 1)]
        drawn = [(float(x), float(y), float(t)) for x, y, t in zip(*line, along, strict=True)]
        made = sketch.update({"s3": drawn})
        found = watching.outcome(made.revision).result.result
        assert {m.sketch_object: m.map_object for m in found.object_matches} == {
            k: k for k in range(4)
        }


STEPS = st.lists(
    st.tuples(st.sampled_from(["set", "erase", "undo"]), st.integers(0, 8), st.integers(0, 2)),
    min_size=1,
    max_size=8,
)


@settings(max_examples=6)
@given(steps=STEPS)
def test_the_final_answer_is_that_of_a_match_of_the_finished_sketch(client, steps):
    strokes = {f"s{k}": outline(k) for k in range(3)}
    with drawing(client) as (sketch, watching):
        revision = sketch.update(strokes).revision
        history = [{}, dict(strokes)]
        for what, which, shift in steps:
            name = f"s{which}"
            if what == "set":
                strokes = {**strokes, name: outline(which, 0.1 * shift)}
                revision = sketch.update({name: strokes[name]}).revision
            elif what == "erase" and name in strokes and len(strokes) > 2:
                strokes = {key: points for key, points in strokes.items() if key != name}
                revision = sketch.update(erase=[name]).revision
            else:
                back = max(1, revision - which)
                strokes = history[back]
                revision = sketch.update(restore=back).revision
            history.append(dict(strokes))
        found = watching.outcome(revision).result.result
        assert result_of(found) == matched(client, strokes.values())


def test_a_quick_answer_comes_before_the_whole_one(client):
    with drawing(client) as (sketch, watching):
        sketch.update({f"s{k}": outline(k) for k in range(5)})
        watching.outcome(1)
        sketch.update({"s5": outline(5)})
        whole = watching.outcome(2).result.result
        told = [e.result.result for e in watching.events if e.HasField("result")]
        results = told[1:]
        assert [each.provisional for each in results] == [True, False]
        quick = results[0]
        assert [m.map_object for m in quick.object_matches] == [0, 1, 2, 3, 4, 5]
        assert quick.place_probability == pytest.approx(told[0].place_probability)
        assert result_of(whole) == matched(client, [outline(k) for k in range(6)])


def test_a_searcher_that_is_not_warm_answers_once(client):
    with drawing(client, searcher="auto", judge="confidence") as (sketch, watching):
        sketch.update({f"s{k}": outline(k) for k in range(4)})
        watching.outcome(1)
        sketch.update({"s4": outline(4)})
        watching.outcome(2)
        results = [e for e in watching.events if e.HasField("result") and e.revision == 2]
        assert len(results) == 1


def test_a_stored_map_and_one_that_comes_along_are_the_same(client, address):
    strokes = [outline(k) for k in (0, 3, 5, 7)]
    stored = sources.stored_scene(client.put_scene(MAP).stored_scene.name)
    expected = matched(client, strokes)
    with Client(address, timeout=60) as storeless:
        for each, map_ in ((client, stored), (client, MAP), (storeless, MAP)):
            with drawing(each, map_) as (sketch, watching):
                sketch.update({str(k): points for k, points in enumerate(strokes)})
                assert result_of(watching.outcome(1).result.result) == expected


def test_pins_hold_from_the_update_on_and_go_with_the_revision(client):
    strokes = {f"s{k}": outline(k) for k in range(4)}
    labels = {"s0": "lamp"}
    with drawing(client, pins={"lamp": None}) as (sketch, watching):
        sketch.update(strokes, labels=labels)
        assert list(watching.outcome(1).result.result.unmatched_sketch_objects) == [0]
        sketch.update(pins={"lamp": 7})
        lines = watching.outcome(2).result.result.object_matches
        assert {m.sketch_object: m.map_object for m in lines}[0] == 7
        sketch.update(pins=[])
        lines = watching.outcome(3).result.result.object_matches
        assert {m.sketch_object: m.map_object for m in lines}[0] == 0
        sketch.update(restore=1)
        assert list(watching.outcome(4).result.result.unmatched_sketch_objects) == [0]


def test_what_is_wrong_with_a_revision_is_told_and_mended_by_the_next(client):
    with drawing(client) as (sketch, watching):
        sketch.update({f"s{k}": outline(k) for k in range(3)}, labels={"s1": "lamp"})
        sketch.update(pins={"sofa": 1})
        problem = watching.outcome(2).problem
        assert (problem.reason, problem.field) == ("INVALID_FIELD", "pins[0].sketch_object")
        sketch.update(pins={"lamp": 1})
        assert watching.outcome(3).result.result.object_matches


def test_who_watches_later_sees_the_map_and_where_it_stands(client):
    with drawing(client) as (sketch, watching):
        sketch.update({f"s{k}": outline(k) for k in range(3)})
        expected = watching.outcome(1)
        late = Watching(sketch)
        assert late.outcome(1) == expected
        assert late.events[0].HasField("map")
        assert {event.WhichOneof("event") for event in late.events} <= {
            "map",
            "objects",
            "progress",
            "result",
        }


def test_a_slow_sketch_is_overtaken_by_the_latest_revision(client):
    endless = {"searcher": {"patience": 10_000_000, "generations": 10_000_000}}
    with drawing(client, searcher="easm", params=endless, time_budget=15) as (sketch, watching):
        sketch.update({f"s{k}": outline(k) for k in range(6)})
        with watching._news:
            assert watching._news.wait_for(
                lambda: any(e.HasField("progress") for e in watching.events), 30.0 * slowness()
            )
        sketch.update({f"s{k}": outline(k) for k in range(7)})
        with watching._news:
            assert watching._news.wait_for(
                lambda: watching.events[-1].revision == 2, 10.0 * slowness()
            )
        assert not any(e.HasField("result") for e in watching.events if e.revision == 1)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"erase": ["s9"]}, "erase_strokes[0]"),
        ({"strokes": {"": [(0, 0), (1, 1)]}}, "set_strokes[0].stroke_id"),
        ({"strokes": {"x" * 65: [(0, 0), (1, 1)]}}, "set_strokes[0].stroke_id"),
        ({"restore": 7}, "restore_revision"),
    ],
)
def test_an_update_of_no_use_is_refused_by_field_and_changes_nothing(client, change, field):
    with client.sketch(MAP) as sketch:
        sketch.update({"s0": outline(0)})
        with pytest.raises(InvalidRequestError) as caught:
            sketch.update(**change)
        assert caught.value.field == field
        made = sketch.update({"s1": outline(1)})
        assert (made.revision, made.stroke_count) == (2, 2)


@pytest.mark.slow
def test_a_whole_drawing_may_be_set_at_once(client):
    strokes = {f"s{k}": np.repeat(outline(k % 4), 100, axis=0).tolist() for k in range(60)}
    with client.sketch(MAP) as sketch:
        assert sketch.update(strokes).stroke_count == 60


def test_revisions_of_long_ago_are_forgotten(client):
    with client.sketch(MAP) as sketch:
        for k in range(258):
            sketch.update({"s0": [(0, 0), (k, 1)]})
        sketch.update(restore=3)
        with pytest.raises(
            InvalidRequestError, match="no longer kept; give a revision from 4 to 259"
        ):
            sketch.update(restore=3)


def test_the_oldest_revisions_of_a_large_sketch_are_forgotten_sooner(client):
    ink = np.resize(outline(0), (30_000, 2))
    with client.sketch(MAP) as sketch:
        sketch.update({"small": outline(1)})
        for k in range(6):
            made = sketch.update({"large": ink + k, "more": outline(2)}).revision
        with pytest.raises(InvalidRequestError, match=r"is 1, .*; give a revision from [3-6] to 7"):
            sketch.update(restore=1)
        assert sketch.update(restore=made - 1).stroke_count == 3
        sketch.update(erase=["large"])
        assert sketch.update(restore=made + 1).stroke_count == 3


def test_revisions_that_share_their_strokes_are_no_larger_for_it(client):
    ink = np.resize(outline(0), (30_000, 2))
    with client.sketch(MAP) as sketch:
        sketch.update({"large": ink})
        for k in range(20):
            sketch.update({"small": outline(1, k)})
        assert sketch.update(restore=0).stroke_count == 0


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"searcher": "unheard-of"}, "match.pipeline.searcher.name"),
        ({"weights": (0, 0, 0)}, "match.weights"),
        ({"params": {"map_segmenter": {"x": 1}}}, "match.pipeline.map_segmenter.parameters.x"),
        ({"profile": "unheard-of"}, "match.pipeline.profile"),
    ],
)
def test_a_match_that_cannot_be_had_is_refused_before_anything_is_drawn(client, options, field):
    with pytest.raises(InvalidRequestError) as caught:
        client.sketch(MAP, **options)
    assert caught.value.field == field


def test_a_way_of_y_that_is_none_is_refused_at_once(host):
    request = CreateSketchRequest(match=MatchRequest(map=MAP), y_axis=9)
    with grpc.insecure_channel(host.address) as channel, pytest.raises(grpc.RpcError) as caught:
        SketchServiceStub(channel).CreateSketch(request, timeout=60)
    assert caught.value.code() is grpc.StatusCode.INVALID_ARGUMENT
    assert caught.value.details().startswith("y_axis is 9, which this server")


def test_maps_of_no_use_are_refused_at_once(client):
    with pytest.raises(InvalidRequestError) as caught:
        client.sketch(sources.polygons([[(0, 0), (1, 1), (2, 2)], [(0, 0), (1, 0), (0, 1)]]))
    assert caught.value.field.startswith("match.map.polygon_set.polygons[0]")
    with pytest.raises(NotFoundError, match=r"map\.stored_scene is"):
        client.sketch(sources.stored_scene("ab" * 32))


def test_a_sketch_that_was_deleted_is_not_there(client):
    sketch = client.sketch(MAP)
    watching = Watching(sketch)
    watching.outcome(0)
    sketch.delete()
    assert isinstance(watching.end(), NotFoundError)
    with pytest.raises(NotFoundError, match="create one"):
        sketch.update({"s0": outline(0)})
    sketch.delete()


def test_a_sketch_can_be_drawn_and_watched_in_asyncio(host):
    async def drawn():
        async with (
            AsyncClient(host.address, timeout=60) as client,
            await client.sketch(MAP, y_axis="down") as sketch,
        ):
            await sketch.update({f"s{k}": [(x, -y) for x, y in outline(k)] for k in range(3)})
            async for event in sketch.watch():
                if event.HasField("result") and event.revision == 1:
                    return event.result.result.object_matches
        return None

    lines = asyncio.run(asyncio.wait_for(drawn(), 60.0 * slowness()))
    assert {m.sketch_object: m.map_object for m in lines} == {0: 0, 1: 1, 2: 2}


def test_a_server_that_stops_ends_the_sketches_at_once():
    setup = Setup(Engine(default_registry()), RequestLimits())
    with hosting(setup, grace=30.0) as host, Client(host.address, timeout=60) as client:
        watching = Watching(client.sketch(MAP))
        watching.outcome(0)
        host.stop()
        assert isinstance(watching.end(), ServerUnavailableError)


def test_the_question_is_about_the_object_that_decides_most():
    result = golden("MatchResponse.result").result
    result.ambiguity.deciding_sketch_objects[:] = [2, 1]
    asked = question(result)
    assert asked.sketch_object == 2
    assert [each.map_object for each in asked.options] == [0, 1]
    shares = [each.probability for each in asked.options]
    assert shares == [pytest.approx(0.365 / 0.65), pytest.approx(0.285 / 0.65)]


def test_an_object_that_one_map_leaves_out_may_be_none_of_the_maps():
    result = golden("MatchResponse.result").result
    result.ambiguity.deciding_sketch_objects[:] = [1]
    likeliest, other = question(result).options
    assert likeliest.map_object == 3
    assert not other.HasField("map_object")


def test_nothing_is_asked_where_nothing_is_open():
    result = golden("MatchResponse.result").result
    result.ClearField("ambiguity")
    assert question(result) is None


def test_the_example_of_the_clients_readme_runs(client, capsys):
    page = (ROOT / "clients" / "python" / "README.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"^~~~python\n(.*?)^~~~", page, re.DOTALL | re.MULTILINE)
    exec(example, {"client": client, "room": MAP, "sources": sources})
    assert "map_object" in capsys.readouterr().out


@pytest.mark.slow
def test_options_of_serve_say_how_many_sketches_there_are_and_how_long_and_how_much_is_kept(
    tmp_path,
):
    options = ["--max-sketches-per-caller", "1", "--sketch-idle", "7.5", "--keep-scenes-mib", "1"]
    rough = np.random.default_rng(0).uniform(1.0, 1.001, 40_000)
    angles = np.linspace(0.0, 2.0 * np.pi, len(rough), endpoint=False)
    outline_ = np.stack([rough * np.cos(angles), rough * np.sin(angles)], axis=1)
    with (
        server("--store", tmp_path / "store", *options) as running,
        Client(running.address, timeout=60) as client,
        grpc.insecure_channel(running.address) as channel,
    ):
        service = SketchServiceStub(channel)
        request = CreateSketchRequest(match=MatchRequest(map=MAP))
        assert service.CreateSketch(request).idle_timeout.ToMilliseconds() == 7500
        with pytest.raises(grpc.RpcError, match="you have 1 sketch in progress, which is"):
            service.CreateSketch(request)
        client.put_scene(MAP)
        with pytest.raises(StoreError, match="is full; delete what is not needed"):
            client.put_scene(sources.polygons([outline_, outline_ + 3.0]))
