"""How many sketches are kept, for how long and for whom."""

import asyncio
import math
from types import SimpleNamespace

import pytest

from sketchmatch.app.application import Application
from sketchmatch.app.setup import RequestLimits, Setup, SketchLimits
from sketchmatch.app.sketches import _unless_changed
from sketchmatch.app.waiting import Caller
from sketchmatch.errors import (
    InvalidInputError,
    NotFoundError,
    ServerStoppingError,
    TooBusyError,
)
from sketchmatch.model.limits import SourceLimits
from sketchmatch.pipeline.engine import Engine
from sketchmatch.registry import default_registry
from sketchmatch_client import sources
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest
from sketchmatch_proto.v1.sketch_service_pb2 import (
    CreateSketchRequest,
    DeleteSketchRequest,
    SketchStroke,
    UpdateSketchRequest,
    WatchSketchRequest,
)

BOXES = [[(0, 0), (2, 0), (2, 1), (0, 1)], [(5, 0), (6, 0), (6, 3), (5, 3)]]
REQUEST = CreateSketchRequest(match=MatchRequest(map=sources.polygons(BOXES))).SerializeToString()
LIMITS = SourceLimits(max_vertices=100)
ANNA, BERT = Caller("anna", "1", "anna"), Caller("bert", "2", "bert")


def with_sketches(scenario, **limits):
    """Run a scenario that is given sketches of an application of its own."""

    async def run():
        engine = Engine(default_registry(), limits=LIMITS)
        app = Application(Setup(engine, RequestLimits(sketches=SketchLimits(**limits))))
        try:
            await scenario(app.sketches)
        finally:
            await app.close()

    asyncio.run(run())


async def made(sketches, caller=ANNA):
    return (await sketches.create(REQUEST, caller)).sketch_id


def test_a_sketch_is_its_creators():
    async def scenario(sketches):
        name = await made(sketches)
        for request in (UpdateSketchRequest, DeleteSketchRequest):
            method = sketches.update if request is UpdateSketchRequest else sketches.delete
            with pytest.raises(NotFoundError, match=f"sketch_id is '{name}', but you have no"):
                await method(request(sketch_id=name), BERT)
        with pytest.raises(NotFoundError):
            await anext(sketches.watch(WatchSketchRequest(sketch_id=name), BERT))
        with pytest.raises(InvalidInputError, match="sketch_id is not set"):
            await sketches.update(UpdateSketchRequest(), ANNA)
        await sketches.update(UpdateSketchRequest(sketch_id=name), ANNA)

    with_sketches(scenario)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_points_that_are_nowhere_are_refused_and_change_nothing(value):
    async def scenario(sketches):
        name = await made(sketches)
        request = UpdateSketchRequest(sketch_id=name)
        for label in ("one", "two"):
            stroke = request.set_strokes.add(stroke_id=label).stroke
            stroke.points.add(x=0, y=1)
            stroke.points.add(x=1, y=2)
        stroke.points.add(x=3, y=value)
        with pytest.raises(InvalidInputError, match="is not finite") as no:
            await sketches.update(request, ANNA)
        assert no.value.field == "set_strokes[1].stroke.points[2]"
        again = await sketches.update(UpdateSketchRequest(sketch_id=name), ANNA)
        assert (again.revision, again.stroke_count) == (1, 0)

    with_sketches(scenario)


def test_a_pin_of_no_object_is_refused_and_changes_nothing():
    async def scenario(sketches):
        name = await made(sketches)
        request = UpdateSketchRequest(sketch_id=name)
        request.pins.pins.add().sketch_object.label = "bed"
        request.pins.pins.add().map_object.index = 1
        with pytest.raises(InvalidInputError, match="is not set; give index or label") as no:
            await sketches.update(request, ANNA)
        assert no.value.field == "pins.pins[1].sketch_object"
        again = await sketches.update(UpdateSketchRequest(sketch_id=name), ANNA)
        assert again.revision == 1

    with_sketches(scenario)


def test_nobody_has_more_sketches_than_one_may_and_all_together_may():
    async def scenario(sketches):
        first = await made(sketches)
        await made(sketches)
        with pytest.raises(TooBusyError, match="you have 2 sketches in progress, which is"):
            await made(sketches)
        await made(sketches, BERT)
        with pytest.raises(TooBusyError, match="the server has 3 sketches in progress, which is"):
            await made(sketches, BERT)
        await sketches.delete(DeleteSketchRequest(sketch_id=first), ANNA)
        await made(sketches)

    with_sketches(scenario, of_one=2, sketches=3)


def test_who_begins_too_many_loses_the_one_that_is_idle_longest(monkeypatch):
    async def scenario(sketches):
        watched, idle, late = await made(sketches), await made(sketches), await made(sketches)
        events = sketches.watch(WatchSketchRequest(sketch_id=watched), ANNA)
        assert await anext(events)
        with pytest.raises(TooBusyError, match=r"each caller; delete one; .* again in (59|60) s"):
            await made(sketches)
        monkeypatch.setattr("sketchmatch.app.sketches._SPARED", 0.02)
        await asyncio.sleep(0.03)
        await sketches.update(UpdateSketchRequest(sketch_id=late), ANNA)
        made_last = await made(sketches)
        with pytest.raises(NotFoundError):
            await sketches.update(UpdateSketchRequest(sketch_id=idle), ANNA)
        for name in (watched, late, made_last):
            await sketches.update(UpdateSketchRequest(sketch_id=name), ANNA)
        await events.aclose()

    with_sketches(scenario, of_one=3, sketches=9)


def test_a_sketch_ends_that_nobody_draws_or_watches():
    async def scenario(sketches):
        drawn, watched = await made(sketches), await made(sketches)
        events = sketches.watch(WatchSketchRequest(sketch_id=watched), ANNA)
        assert await anext(events)
        await asyncio.sleep(0.02)
        sketches.look()
        with pytest.raises(NotFoundError):
            await sketches.update(UpdateSketchRequest(sketch_id=drawn), ANNA)
        await sketches.update(UpdateSketchRequest(sketch_id=watched), ANNA)
        await events.aclose()
        sketches.look()  # just now it was watched
        await asyncio.sleep(0.02)
        sketches.look()
        with pytest.raises(NotFoundError):
            await sketches.update(UpdateSketchRequest(sketch_id=watched), ANNA)

    with_sketches(scenario, idle_seconds=0.01)


def test_too_many_strokes_or_points_are_refused_and_leave_the_sketch_as_it_was():
    async def scenario(sketches):
        name = await made(sketches)
        strokes = [SketchStroke(stroke_id=f"s{k}") for k in range(3)]
        with pytest.raises(
            InvalidInputError, match="makes 3 strokes in all, more than the limit of 2"
        ):
            await sketches.update(UpdateSketchRequest(sketch_id=name, set_strokes=strokes), ANNA)
        update = UpdateSketchRequest(sketch_id=name, set_strokes=strokes[:2])
        answer = await sketches.update(update, ANNA)
        assert (answer.revision, answer.stroke_count) == (1, 2)
        points = [(0.0, 0.0)] * (LIMITS.max_vertices + 1)
        (stroke,) = sources.strokes([points]).stroke_set.strokes
        update.set_strokes[0].stroke.CopyFrom(stroke)
        with pytest.raises(InvalidInputError, match="points in all, more than the limit"):
            await sketches.update(update, ANNA)

    with_sketches(scenario, strokes=2)


def test_nothing_is_begun_by_a_server_that_stops():
    async def scenario(sketches):
        name = await made(sketches)
        events = sketches.watch(WatchSketchRequest(sketch_id=name), ANNA)
        assert await anext(events)
        sketches.stop()
        with pytest.raises(ServerStoppingError):
            async for _ in events:
                pass
        with pytest.raises(ServerStoppingError):
            await made(sketches)

    with_sketches(scenario)


@pytest.mark.parametrize("changed", [False, True])
def test_the_whole_answer_is_given_up_once_something_is_drawn(changed):
    async def run():
        sketch, told = SimpleNamespace(changed=asyncio.Event()), []

        async def answer():
            try:
                await asyncio.sleep(0.02)
                told.append("answered")
            finally:
                told.append("over")
            return False

        if changed:
            asyncio.get_running_loop().call_soon(sketch.changed.set)
        await _unless_changed(sketch, answer())
        return told

    assert asyncio.run(run()) == (["over"] if changed else ["answered", "over"])


def test_what_goes_wrong_with_the_whole_answer_is_told():
    async def run():
        async def answer():
            raise TooBusyError("there is no room")

        await _unless_changed(SimpleNamespace(changed=asyncio.Event()), answer())

    with pytest.raises(TooBusyError):
        asyncio.run(run())
