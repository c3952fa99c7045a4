"""What a server keeps on disk: whole or not at all, bounded, and where it fails it says so."""

import re
import sqlite3
from contextlib import ExitStack
from types import SimpleNamespace

import pytest

from sketchmatch.app.store import Store
from sketchmatch.errors import StoreError

TABLE = "CREATE TABLE things (name TEXT PRIMARY KEY, data BLOB NOT NULL)"
MIB = 2**20


@pytest.fixture
def store(tmp_path):
    store = Store(tmp_path / "kept" / "here")
    yield store
    store.close()


@pytest.fixture
def things(store):
    database = store.database("things", TABLE, 1, MIB)
    yield database
    database.close()


def put(database, name, data=b"."):
    database.work(lambda file: file.execute("INSERT INTO things VALUES (?, ?)", (name, data)))


def names(database):
    return database.work(
        lambda file: [name for (name,) in file.execute("SELECT name FROM things ORDER BY name")]
    )


@pytest.fixture
def reopened(store):
    """The file of the things, as another server opens it."""
    with ExitStack() as opened:

        def reopen(version=1, max_bytes=MIB):
            database = store.database("things", TABLE, version, max_bytes)
            opened.callback(database.close)
            return database

        yield reopen


def test_what_is_put_is_there_after_a_restart(reopened, things):
    put(things, "chair")
    things.close()
    assert names(reopened()) == ["chair"]


def test_a_job_that_raises_leaves_nothing_behind(things):
    def job(file):
        file.execute("INSERT INTO things VALUES ('chair', '')")
        raise KeyError("table")

    with pytest.raises(KeyError, match="table"):
        things.work(job)
    assert names(things) == []


def test_a_second_server_is_refused_until_the_first_has_left(store):
    with pytest.raises(StoreError, match=r"here is used by another server; name another folder"):
        Store(store.folder)
    store.close()
    Store(store.folder).close()


def test_a_folder_that_cannot_be_made_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match=r"file/kept cannot be written to \(Not a directory\)"):
        Store(tmp_path / "file" / "kept")


def test_strangers_on_the_machine_cannot_read_the_folder(store):
    assert store.folder.stat().st_mode & 0o077 == 0


def test_a_full_file_says_so_keeps_what_it_had_and_takes_more_after_a_deletion(reopened):
    database = reopened(max_bytes=400_000)
    put(database, "chair", bytes(250_000))
    with pytest.raises(StoreError, match=r"things\.sqlite is full; delete what is not needed"):
        put(database, "table", bytes(250_000))
    assert names(database) == ["chair"]
    database.work(lambda file: file.execute("DELETE FROM things"))
    put(database, "table", bytes(250_000))
    assert names(database) == ["table"]


def test_a_file_shrinks_after_what_was_in_it_is_deleted(reopened, store):
    database, file = reopened(max_bytes=64 * MIB), store.folder / "things.sqlite"
    for k in range(24):
        put(database, f"large {k}", bytes(MIB))
    put(database, "small")
    database.close()
    assert file.stat().st_size > 24 * MIB
    database.work(lambda open_: open_.execute("DELETE FROM things WHERE name LIKE 'large%'"))
    for _ in range(25):
        assert names(database) == ["small"]
    database.close()
    assert file.stat().st_size < 2 * MIB


@pytest.mark.parametrize(("free", "words"), [(1000, "its disk is full"), (1 << 30, "is full; del")])
def test_a_full_disk_is_told_from_a_limit_that_is_met(reopened, monkeypatch, free, words):
    usage = SimpleNamespace(free=free)
    monkeypatch.setattr("sketchmatch.app.store.shutil.disk_usage", lambda _: usage)
    with pytest.raises(StoreError, match=words):
        put(reopened(max_bytes=400_000), "chair", bytes(600_000))


def test_a_damaged_file_is_said_and_another_is_made_once_it_is_moved_away(things):
    put(things, "chair")
    things.close()
    things.path.write_bytes(b"no database, " * 1000)
    for _ in range(2):
        with pytest.raises(StoreError, match="is damaged; move it away, and the server makes"):
            names(things)
    things.path.unlink()
    put(things, "table")
    assert names(things) == ["table"]


def test_a_file_that_is_gone_is_made_anew(things):
    put(things, "chair")
    for path in things.path.parent.glob("things.sqlite*"):
        path.unlink()
    assert names(things) == []
    put(things, "table")
    assert names(things) == ["table"]


def test_a_file_that_another_process_holds_is_said(monkeypatch, things):
    monkeypatch.setattr("sketchmatch.app.store._PATIENCE_SECONDS", 0.01)
    put(things, "chair")
    things.close()
    holder = sqlite3.connect(things.path, isolation_level=None)
    holder.execute("BEGIN EXCLUSIVE")
    with pytest.raises(StoreError, match="is in use by another process; end that"):
        put(things, "table")
    holder.close()
    put(things, "table")
    assert names(things) == ["chair", "table"]


def test_a_file_of_another_version_is_left_as_it_is(reopened, things):
    put(things, "chair")
    things.close()
    other = reopened(version=2)
    file, other_version = f"the store's file {other.path}", "another version of sketchmatch"
    sentence = f"{file} was written by {other_version}; move it away"
    with pytest.raises(StoreError, match=f"^{re.escape(sentence)}$"):
        names(other)
    assert names(reopened()) == ["chair"]
