"""A match has a life of its own: named, watched by any number, cancelled, kept beyond a restart."""

import asyncio
import contextlib
import sqlite3
import time

import pytest

from sketchmatch.app.application import Application
from sketchmatch.app.archive import Archive
from sketchmatch.app.orders import Order, Wish
from sketchmatch.app.store import Store
from sketchmatch.app.tasks import Record, State, Task
from sketchmatch.app.waiting import Caller
from sketchmatch.errors import (
    InvalidInputError,
    MatchCancelledError,
    MatchInterruptedError,
    NotFoundError,
    ServerStoppingError,
    StoreError,
)
from sketchmatch_client import features, match_request, sources, transfer_request
from sketchmatch_proto.v1.match_pb2 import OUTCOME_UNSPECIFIED
from tests.app.test_application import SCENE, Held, ended, held, setup, until  # noqa: F401

ALICE, BOB = Caller("alice", "1"), Caller("bob", "1")
DAY, MIB = 86_400.0, 1 << 20


class Kept:
    """An archive in a folder, and how many matches it failed to keep."""

    def __init__(self, folder, seconds=DAY, size=16 * MIB):
        self.failed = 0
        self.store = Store(folder)
        self.archive = Archive(self.store, seconds, size, self._fail)

    def _fail(self, count):
        self.failed += count

    def close(self):
        self.archive.close()
        self.store.close()


@pytest.fixture
def kept(tmp_path):
    made = Kept(tmp_path)
    yield made
    made.close()


@contextlib.asynccontextmanager
async def serving(archive=None, **limits):
    app = Application(setup(**limits), archive=archive)
    await app.start(lambda _: None)
    try:
        yield app
    finally:
        Held.go.set()
        await app.close()


def named(request_id, seed=0, **options):
    request = match_request(SCENE, SCENE, seed=seed, **options)
    request.request_id = request_id
    return request.SerializeToString()


def endless(request_id="", keep_running=False):
    options = {"searcher": "held", "keep_running": keep_running}
    return named(request_id, **options)


async def state(match, expected):
    await until(lambda: match.state is expected, f"it is {match.state.name} for ever")


async def matched(app, data, caller=ALICE):
    """Do a match to its end, and return it as it is known then."""
    async with app.matching(data, caller) as match:
        await ended(match)
    return (await app.matches.get(caller.name, match.id)).record()


async def name_of(request_id):
    """Return the name of the match that Alice calls so."""
    async with serving() as app:
        return (await matched(app, named(request_id))).id


class TestOneLife:
    def test_a_request_sent_again_under_its_name_is_the_same_match_done_once(self):
        async def run():
            async with serving() as app:
                async with contextlib.AsyncExitStack() as stack:
                    found = [
                        await stack.enter_async_context(app.matching(named("n1"), ALICE))
                        for _ in range(3)
                    ]
                    assert found[0] is found[1] is found[2]
                    told = await ended(found[0])
                async with app.matching(named("n1"), ALICE) as later:
                    assert later.id == found[0].id
                    assert await ended(later) == told
                one, other = await matched(app, named("")), await matched(app, named(""))
                assert one.id != other.id

        asyncio.run(run())

    def test_a_name_tells_requests_apart_by_what_they_say_and_not_by_how_maps_are_ordered(self):
        async def run():
            async with serving() as app:
                await matched(app, named("n1"))
                with pytest.raises(
                    InvalidInputError, match="already belongs to another request"
                ) as no:
                    await matched(app, named("n1", seed=1))
                assert no.value.field == "request_id"
                await matched(app, named("n1", seed=1), BOB)

        asyncio.run(run())
        order = Order("", "MatchRequest", match_request(SCENE, SCENE).SerializeToString())
        two = [
            match_request(SCENE, SCENE, searcher="easm", params={"searcher": params})
            for params in ({"population": 9, "patience": 3}, {"patience": 3, "population": 9})
        ]
        for request in two:
            request.request_id = "n1"
        wishes = [
            Order("", "MatchRequest", each.SerializeToString(deterministic=False)).wish(MIB)
            for each in two
        ]
        assert wishes[0].digest == wishes[1].digest != b""
        assert order.wish(MIB) == Wish()
        other = match_request(SCENE, sources.polygons([[[0, 0], [1, 0], [0, 1]]] * 2))
        other.request_id = "n1"
        elsewhere = Order("", "MatchRequest", other.SerializeToString()).wish(MIB)
        assert elsewhere.digest != wishes[0].digest

    def test_a_match_has_the_same_name_where_all_that_was_known_of_it_is_lost(self):
        first, again, other = (asyncio.run(name_of(name)) for name in ("n1", "n1", "n2"))
        assert first == again != other

    def test_a_name_that_is_too_long_is_refused(self):
        async def run():
            async with serving() as app:
                with pytest.raises(InvalidInputError, match="at most 128 bytes"):
                    await matched(app, named("x" * 129))
                await matched(app, named("x" * 128))

        asyncio.run(run())

    @pytest.mark.usefixtures("held")
    def test_it_stops_when_its_last_reader_has_gone_and_is_done_again_when_asked_for(self):
        async def run():
            async with serving() as app:
                async with app.matching(endless("n1"), ALICE) as match:
                    async with app.matching(endless("n1"), ALICE):
                        pass
                    await until(Held.began.is_set, "it does not begin")
                    assert match.state is State.RUNNING
                await state(match, State.INTERRUPTED)
                with pytest.raises(MatchInterruptedError, match="no client was reading"):
                    match.log.check()
                last = match.log.last
                Held.go.set()
                async with app.matching(endless("n1"), ALICE) as again:
                    assert again is not match
                    assert again.id == match.id
                    assert [event.WhichOneof("event") for event in await ended(again)][
                        -1
                    ] == "result"
                assert min(number for number, _ in again.log.items()) > last
                assert again.record().created == match.record().created

        asyncio.run(run())

    @pytest.mark.usefixtures("held")
    def test_one_that_is_to_keep_running_goes_on_without_readers(self):
        async def run():
            async with serving() as app:
                async with app.matching(endless("n1", keep_running=True), ALICE) as match:
                    await until(Held.began.is_set, "it does not begin")
                await asyncio.sleep(0.1)
                assert match.state is State.RUNNING
                with app.reading(await app.matches.get("alice", match.id)):
                    pass
                assert match.state is State.RUNNING
                Held.go.set()
                await state(match, State.SUCCEEDED)

        asyncio.run(run())

    @pytest.mark.parametrize("waits", [False, True])
    @pytest.mark.usefixtures("held")
    def test_a_cancelled_match_comes_to_one_end_and_is_not_done_again(self, waits):
        async def run():
            async with serving(max_concurrent_matches=1) as app:
                async with contextlib.AsyncExitStack() as stack:
                    if waits:
                        await stack.enter_async_context(app.matching(endless("n0"), BOB))
                    match = await stack.enter_async_context(app.matching(endless("n1"), ALICE))
                    if not waits:
                        await until(Held.began.is_set, "it does not begin")
                    app.cancel(match)
                    assert match.state is (State.CANCELLED if waits else State.CANCELLING)
                    await state(match, State.CANCELLED)
                    app.cancel(match)
                    assert match.state is State.CANCELLED
                async with app.matching(endless("n1"), ALICE) as again:
                    assert again.id == match.id
                    with pytest.raises(MatchCancelledError):
                        again.log.check()
                await until(lambda: app.idle, "a place is never given back")

        asyncio.run(run())

    @pytest.mark.usefixtures("held")
    def test_one_that_is_cancelled_after_it_was_interrupted_is_not_done_again(self, kept):
        async def run():
            async with serving(kept.archive) as app:
                async with app.matching(endless("n1"), ALICE) as match:
                    await until(Held.began.is_set, "it does not begin")
                await state(match, State.INTERRUPTED)
                interrupted = await app.matches.get("alice", match.id)
                cancelled = app.cancel(interrupted)
                assert cancelled.state is State.CANCELLED
                assert cancelled.events == interrupted.events
                async with app.matching(endless("n1"), ALICE) as again:
                    with pytest.raises(MatchCancelledError):
                        again.log.check()
                kept.archive.flush()
                assert kept.archive.find("alice", match.id).state is State.CANCELLED
                assert app.cancel(again).state is State.CANCELLED

        asyncio.run(run())

    @pytest.mark.usefixtures("held")
    def test_one_that_is_cancelled_while_it_stops_for_want_of_readers_is_cancelled(self):
        async def run():
            async with serving() as app:
                async with app.matching(endless("n1"), ALICE) as match:
                    await until(Held.began.is_set, "it does not begin")
                assert match.state is State.CANCELLING
                app.cancel(match)
                await state(match, State.CANCELLED)

        asyncio.run(run())

    @pytest.mark.usefixtures("held")
    def test_what_is_no_match_is_not_kept_when_it_is_stopped(self, kept):
        request = transfer_request(SCENE, SCENE, [features.point(0, 0)], searcher="held")

        async def run():
            async with serving(kept.archive) as app:
                with app.running("TransferRequest", request.SerializeToString(), ALICE):
                    await until(Held.began.is_set, "it does not begin")
                await until(lambda: app.idle, "it does not end")
                kept.archive.flush()
                assert await app.matches.page("alice", 0, "") == ([], "")

        asyncio.run(run())

    def test_a_life_goes_one_way(self):
        order = Order("m1", "MatchRequest", match_request(SCENE, SCENE).SerializeToString())
        task = Task(order, setup())
        task.begin()
        with pytest.raises(AssertionError, match="cannot be RUNNING"):
            task.begin()
        task.end()
        assert task.state is State.SUCCEEDED
        with pytest.raises(AssertionError, match="SUCCEEDED cannot be FAILED"):
            task.end(ValueError("too late"))


class TestOnesOwn:
    def test_another_callers_match_does_not_exist(self, kept):
        async def run():
            async with serving(kept.archive) as app:
                record = await matched(app, named("n1"))
                for name in (record.id, "nobody"):
                    with pytest.raises(NotFoundError, match="no match"):
                        await app.matches.get("bob", name)
                with pytest.raises(InvalidInputError, match="match_id is not set"):
                    await app.matches.get("alice", "")
                assert await app.matches.page("bob", 10, "") == ([], "")

        asyncio.run(run())

    @pytest.mark.parametrize("keeps", [False, True])
    def test_pages_list_each_match_once_the_latest_first(self, tmp_path, keeps):
        made = Kept(tmp_path) if keeps else None

        async def run():
            async with serving(made.archive if made else None) as app:
                begun = [(await matched(app, named(f"n{k}"))).id for k in range(5)]
                if made:
                    made.archive.flush()
                listed, token, pages = [], "", 0
                while pages == 0 or token:
                    page, token = await app.matches.page("alice", 2, token)
                    listed += [record.id for record in page]
                    pages += 1
                assert listed == begun[::-1]
                assert pages == 3
                with pytest.raises(InvalidInputError, match="page_token"):
                    await app.matches.page("alice", 2, "nonsense")
                with pytest.raises(InvalidInputError, match="page_size"):
                    await app.matches.page("alice", -1, "")

        asyncio.run(run())
        if made:
            made.store.close()


class TestKept:
    def test_a_restart_loses_nothing_that_was_finished(self, tmp_path):
        found = []

        async def run(reads):
            kept = Kept(tmp_path)
            async with serving(kept.archive) as app:
                if not reads:
                    found.append(await matched(app, named("n1")))
                else:
                    found.append((await app.matches.get("alice", found[0].id)).record())
                    async with app.matching(named("n1"), ALICE) as same:
                        assert await ended(same) == await ended(found[0])
                        assert same.id == found[0].id
            kept.store.close()

        asyncio.run(run(reads=False))
        asyncio.run(run(reads=True))
        before, after = found
        assert before.events == after.events
        assert (before.state, before.outcome) == (after.state, after.outcome)
        assert before.outcome != OUTCOME_UNSPECIFIED
        assert (before.created, before.ended) == (after.created, after.ended)

    def test_what_ran_is_interrupted_after_a_loss_and_is_done_again_when_asked_for(self, tmp_path):
        kept = Kept(tmp_path)
        wish = Order("", "MatchRequest", named("n1")).wish(MIB)
        name = asyncio.run(name_of("n1"))
        lost = Record(name, "alice", wish, State.RUNNING, time.time(), events=((1, b"\x0a\0"),))
        kept.archive.keep(lost, name)
        kept.close()

        async def run():
            again = Kept(tmp_path)
            async with serving(again.archive) as app:
                record = await app.matches.get("alice", name)
                assert record.state is State.INTERRUPTED
                assert record.ended is not None
                with pytest.raises(MatchInterruptedError, match="stopped or crashed"):
                    record.log.check()
                done = await matched(app, named("n1"))
                assert done.id == name
                assert done.state is State.SUCCEEDED
                assert min(number for number, _ in done.events) > 1
                again.archive.flush()
                assert again.archive.find("alice", name).events == done.events
            again.store.close()

        asyncio.run(run())

    @pytest.mark.usefixtures("held")
    def test_a_server_that_stops_says_of_what_waited_that_it_was_interrupted(self, tmp_path):
        kept = Kept(tmp_path)

        async def run():
            async with serving(kept.archive, max_concurrent_matches=1) as app:
                async with (
                    app.matching(endless("n0", keep_running=True), ALICE) as runs,
                    app.matching(named("n1"), ALICE) as waits,
                ):
                    await until(Held.began.is_set, "it does not begin")
                    await app.drain(0.0)
                    with pytest.raises(ServerStoppingError):
                        waits.log.check()
                await state(runs, State.SUCCEEDED)
            return waits.id

        waited = asyncio.run(run())
        kept.store.close()
        again = Kept(tmp_path)
        assert again.archive.find("alice", waited).state is State.INTERRUPTED
        assert {record.state for record in again.archive.page("alice", None, 9)} == {
            State.INTERRUPTED,
            State.SUCCEEDED,
        }
        again.close()

    def test_what_ended_too_long_ago_goes(self, tmp_path):
        kept = Kept(tmp_path, seconds=100.0)
        now = time.time()
        for name, ago in (("old", 101.0), ("young", 50.0)):
            record = Record(name, "alice", Wish(), State.SUCCEEDED, now - 200.0, now - ago)
            kept.archive.keep(record, name)
        kept.close()
        again = Kept(tmp_path, seconds=100.0)
        again.archive.flush()
        assert [record.id for record in again.archive.page("alice", None, 9)] == ["young"]
        again.close()

    def test_what_ended_first_goes_first_where_there_is_too_much(self, tmp_path):
        kept = Kept(tmp_path, size=MIB)
        now, event = time.time(), bytes(20_000)
        for k in range(200):
            record = Record(
                f"m{k:03}", "alice", Wish(), State.SUCCEEDED, now, now + k, events=((1, event),)
            )
            kept.archive.keep(record, record.id)
            if k % 20 == 19:
                kept.archive.flush()
        left = [record.id for record in kept.archive.page("alice", None, 999)]
        kept.close()
        assert 10 <= len(left) < 60
        assert left[0] == "m199"
        assert left == [f"m{k:03}" for k in range(199, 199 - len(left), -1)]
        assert kept.failed == 0
        assert (tmp_path / "matches.sqlite").stat().st_size <= MIB


class TestStoreThatFails:
    def test_matches_go_on_and_are_not_kept_until_it_is_mended(self, tmp_path, caplog):
        (tmp_path / "matches.sqlite").write_bytes(b"no database" * 1000)
        kept = Kept(tmp_path)

        async def run():
            async with serving(kept.archive) as app:
                record = await matched(app, named("n1"))
                assert record.state is State.SUCCEEDED
                kept.archive.flush()
                assert kept.failed >= 1
                assert "is damaged" in caplog.text
                (tmp_path / "matches.sqlite").rename(tmp_path / "damaged")
                later = await matched(app, named("n2"))
                kept.archive.flush()
                found = kept.archive.find("alice", later.id)
                assert (found.state, found.events) == (later.state, later.events)

        asyncio.run(run())
        kept.store.close()

    def test_what_cannot_be_told_for_certain_is_an_error_and_what_is_in_memory_is_told(
        self, tmp_path
    ):
        (tmp_path / "matches.sqlite").write_bytes(b"no database" * 1000)
        kept = Kept(tmp_path)

        async def run():
            async with serving(kept.archive) as app:
                record = await matched(app, named("n1"))
                assert (await app.matches.get("alice", record.id)).record() == record
                with pytest.raises(StoreError, match="is damaged; move it away"):
                    await app.matches.get("alice", "older")
                with pytest.raises(StoreError, match="is damaged"):
                    await app.matches.page("alice", 10, "")

        asyncio.run(run())
        kept.store.close()

    def test_a_locked_file_holds_no_match_up(self, kept, tmp_path):
        async def run():
            async with serving(kept.archive) as app:
                first = await matched(app, named("n1"))
                kept.archive.flush()
                other = sqlite3.connect(tmp_path / "matches.sqlite", isolation_level=None)
                other.execute("BEGIN EXCLUSIVE")
                async with app.matching(named(""), ALICE) as match:
                    assert (await ended(match))[-1].HasField("result")
                other.execute("ROLLBACK")
                other.close()
                last = await matched(app, named("n3"))
                kept.archive.flush(30.0)
                for record in (first, last):
                    assert kept.archive.find("alice", record.id) is not None

        asyncio.run(run())

    def test_a_disk_without_room_is_counted_and_said_once(self, tmp_path, caplog):
        kept = Kept(tmp_path, size=300_000)
        now = time.time()
        for k in range(3):
            record = Record(
                f"m{k}", "alice", Wish(), State.RUNNING, now, events=((1, bytes(400_000)),)
            )
            kept.archive.keep(record, record.id)
            kept.archive.flush()
        assert kept.failed == 3
        assert caplog.text.count("is full") == 1
        kept.close()
