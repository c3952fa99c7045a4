"""Scenes that a server keeps, over the wire: put, matched with, labelled, listed and deleted."""

import sqlite3
from collections.abc import Iterator
from contextlib import ExitStack, closing
from dataclasses import replace

import grpc
import numpy as np
import pytest

from sketchmatch.app.setup import RequestLimits, Setup
from sketchmatch.model import Scene
from sketchmatch.pipeline.engine import Engine
from sketchmatch.registry import default_registry
from sketchmatch.server.tokens import new_token
from sketchmatch_client import (
    Client,
    InvalidRequestError,
    NotFoundError,
    ServerBusyError,
    StoreError,
    sources,
)
from tests.server.harness import Host, hosting, scene, shapes, turned

LABELS = [f"thing {k}" for k in range(6)]
MAP = scene(6, 1, LABELS)
SKETCH = sources.polygons(turned(shapes(6, 1)[1:5]), ["thing 1", "", "thing 3", ""])
MISSING = "ab" * 32


def setup():
    return Setup(Engine(default_registry()), RequestLimits(max_time_budget=20.0))


@pytest.fixture(scope="module")
def host(tmp_path_factory) -> Iterator[Host]:
    with hosting(setup(), store=tmp_path_factory.mktemp("state") / "store") as host:
        yield host


@pytest.fixture
def client(host):
    with Client(host.address, timeout=60) as client:
        yield client


@pytest.fixture
def name(client):
    return client.put_scene(MAP).stored_scene.name


def answer(match):
    """Return what a match came to, but for its name and cost."""
    for field in ("match_id", "statistics"):
        match.result.ClearField(field)
    return match.result, match.scenes


def test_a_match_with_a_stored_scene_is_that_with_its_source(client, name):
    expected = answer(client.match(SKETCH, MAP))
    assert answer(client.match(SKETCH, sources.stored_scene(name))) == expected
    sketch = client.put_scene(SKETCH).stored_scene.name
    both = client.match(sources.stored_scene(sketch), sources.stored_scene(name))
    assert answer(both) == expected


def test_rooms_of_a_stored_scene_that_a_person_drew_as_one_are_told_as_one(client):
    rooms = [(0, 0, 90, 30), (0, 32, 40, 90), (42, 32, 64, 60), (42, 62, 64, 90), (66, 32, 90, 90)]
    doors = [(10, 30, 19, 32), (48, 30, 57, 32), (48, 60, 57, 62), (74, 30, 83, 32)]
    cells = np.full((94, 94), 100)
    for x, y, u, v in (*rooms, *doors):
        cells[2 + y : 2 + v, 2 + x : 2 + u] = 0
    map_ = sources.occupancy_grid(cells, 0.1)
    kept = client.put_scene(map_, segmenter="rooms").stored_scene
    ways = {(passage.first, passage.second) for passage in kept.passages}
    assert len(ways) == 4
    (merged,) = (
        pair for pair in ways if all(20 < kept.scene.objects[k].area * 4 < 27 for k in pair)
    )
    drawn = [(0, 0, 90, 30), (0, 32, 40, 90), (42, 32, 64, 90), (66, 32, 90, 90)]
    sketch = sources.polygons([[(x, y), (u, y), (u, v), (x, v)] for x, y, u, v in drawn])
    result = client.match(sketch, sources.stored_scene(kept.name)).result
    (group,) = result.object_groups
    assert ([*group.sketch_objects], {*group.map_objects}) == ([2], {*merged})
    sent = client.match(sketch, map_, map_segmenter="rooms").result
    assert [*sent.object_groups] == [group]


def test_to_put_a_scene_again_changes_nothing(client, name):
    again = client.put_scene(MAP)
    assert (again.stored_scene.name, again.created) == (name, False)
    assert again.stored_scene.scene == client.segment(MAP).scene


def test_a_segmenter_by_name_and_parameters_makes_a_scene_of_its_own(client):
    grid = [[0] * 40 for _ in range(40)]
    for row, column in ((5, 5), (5, 25), (25, 10)):
        for k in range(8):
            grid[row + k][column : column + 8] = [100] * 8
    source = sources.occupancy_grid(grid, 0.05)
    kept = client.put_scene(source).stored_scene
    other = client.put_scene(source, params={"min_size": 0.05}).stored_scene
    assert kept.name != other.name
    assert other.segmenter.parameters["min_size"] == 0.05


def test_labels_are_what_a_match_sees(client, name):
    labelled = client.update_scene(name, {0: "wardrobe"})
    assert labelled.name != name
    assert labelled.scene.objects[0].label == "wardrobe"
    scenes = client.match(SKETCH, sources.stored_scene(labelled.name)).scenes
    assert scenes.map.objects[0].label == "wardrobe"
    assert client.match(SKETCH, sources.stored_scene(name)).scenes.map.objects[0].label == "thing 0"


def test_a_scene_comes_back_with_its_source_until_it_is_deleted(client):
    made = client.put_scene(scene(3, 9))
    name = made.stored_scene.name
    assert made.created
    assert client.get_scene(name, include_source=True).source == scene(3, 9)
    assert name in [each.name for each in client.list_scenes()]
    client.delete_scene(name)
    assert name not in [each.name for each in client.list_scenes()]
    with pytest.raises(NotFoundError, match=f"^name is {name}, but you have stored no scene"):
        client.get_scene(name)


@pytest.mark.parametrize("side", ["sketch", "map"])
def test_a_scene_that_is_not_there_is_named_with_the_side(client, side):
    sides = {"sketch": SKETCH, "map": MAP, side: sources.stored_scene(MISSING)}
    with pytest.raises(NotFoundError, match=f"^{side}.stored_scene is {MISSING}, but you"):
        client.match(**sides)


def test_a_segmenter_for_what_is_segmented_is_refused(client, name):
    with pytest.raises(InvalidRequestError, match="needs no segmenter; drop it") as caught:
        client.match(SKETCH, sources.stored_scene(name), map_segmenter="polygons")
    assert caught.value.field == "pipeline.map_segmenter"


def test_what_cannot_be_kept_is_refused_by_field(client, name):
    with pytest.raises(InvalidRequestError) as caught:
        client.put_scene(sources.stored_scene(name))
    assert caught.value.field == "source.stored_scene"
    with pytest.raises(InvalidRequestError) as caught:
        client.put_scene(MAP, segmenter="unheard-of")
    assert caught.value.field == "segmenter.name"
    with pytest.raises(InvalidRequestError) as caught:
        client.get_scene("")
    assert caught.value.field == "name"


def test_a_caller_who_keeps_as_much_as_it_may_is_told_to_delete(tmp_path):
    limited = replace(setup(), limits=RequestLimits(max_stored_bytes=8_000))
    with (
        hosting(limited, store=tmp_path / "store") as host,
        Client(host.address, timeout=60) as client,
    ):
        kept = client.put_scene(MAP).stored_scene.name
        with pytest.raises(ServerBusyError, match="the limit for each caller is") as refused:
            client.put_scene(scene(100, 2))
        assert refused.value.reason == "LIMIT_EXCEEDED"
        assert refused.value.retry_after is None
        assert refused.value.__cause__.code() is grpc.StatusCode.RESOURCE_EXHAUSTED
        assert [each.name for each in client.list_scenes()] == [kept]


def test_without_a_store_inline_sources_are_matched_and_the_rest_is_said(address):
    with Client(address, timeout=60) as client:
        for call in (lambda: client.put_scene(MAP), client.list_scenes):
            with pytest.raises(StoreError, match="this server keeps nothing"):
                call()
        with pytest.raises(StoreError, match=r"^map\.stored_scene needs a store"):
            client.match(SKETCH, sources.stored_scene(MISSING))
        assert client.match(SKETCH, MAP).object_map


def test_a_damaged_store_is_said_and_inline_sources_are_matched(tmp_path):
    store = tmp_path / "store"
    store.mkdir()
    (store / "scenes.sqlite").write_bytes(b"no database " * 1000)
    with hosting(setup(), store=store) as host, Client(host.address, timeout=60) as client:
        for call in (lambda: client.put_scene(MAP), client.list_scenes):
            with pytest.raises(StoreError, match=r"scenes\.sqlite is damaged; move it away"):
                call()
        with pytest.raises(StoreError, match="is damaged"):
            client.match(SKETCH, sources.stored_scene(MISSING))
        assert client.match(SKETCH, MAP).object_map


@pytest.mark.slow
def test_a_full_store_is_said_then_a_lost_one_and_inline_sources_are_matched(tmp_path):
    store, rough = tmp_path / "store", np.random.default_rng(0).uniform(1.0, 1.01, 10_000)
    angles = np.linspace(0.0, 2.0 * np.pi, len(rough), endpoint=False)
    outline = np.stack([rough * np.cos(angles), rough * np.sin(angles)], axis=1)
    with (
        hosting(setup(), store=store, scenes_bytes=1 << 18) as host,
        Client(host.address, timeout=60) as client,
    ):
        name = client.put_scene(MAP).stored_scene.name
        expected = answer(client.match(SKETCH, MAP))
        with pytest.raises(StoreError, match=r"scenes\.sqlite is full; delete what is not needed"):
            client.put_scene(sources.polygons([outline, outline + 3.0]))
        assert answer(client.match(SKETCH, MAP)) == expected
        assert answer(client.match(SKETCH, sources.stored_scene(name))) == expected
        for file in store.glob("scenes.sqlite*"):
            file.unlink()
        with pytest.raises(StoreError, match=r"scenes\.sqlite cannot be used"):
            client.match(SKETCH, sources.stored_scene(name))
        assert answer(client.match(SKETCH, MAP)) == expected


@pytest.mark.slow
def test_scenes_outlive_the_server_and_workers_match_with_them(tmp_path):
    store = tmp_path / "store"
    with hosting(setup(), store=store) as host, Client(host.address, timeout=60) as client:
        name = client.put_scene(MAP).stored_scene.name
        expected = answer(client.match(SKETCH, MAP))
    with (
        hosting(setup(), store=store, workers=1) as host,
        Client(host.address, timeout=60) as client,
    ):
        match = client.match(SKETCH, sources.stored_scene(name))
        assert answer(match) == expected
        again = client.put_scene(MAP)
        assert (again.stored_scene.name, again.created) == (name, False)
        with pytest.raises(NotFoundError, match=r"^map\.stored_scene is"):
            client.match(SKETCH, sources.stored_scene(MISSING))


def test_the_histograms_of_a_scene_are_kept_with_it_and_no_others(tmp_path):
    store = tmp_path / "store"
    with hosting(setup(), store=store) as host, Client(host.address, timeout=60) as client:
        client.put_scene(MAP)
        client.sketch(scene(5, 3)).delete()  # of a map that comes along, and is not kept
    with closing(sqlite3.connect(store / "scenes.sqlite")) as file:
        rows = file.execute("SELECT outlines, length(bytes) FROM histograms").fetchall()
    assert rows
    assert {outlines for outlines, _ in rows} == {Scene.from_polygons(shapes(6, 1)).identity}
    within, *pairs = sorted(size for _, size in rows)
    assert within == 4 + 6 * 90 * 8
    assert pairs
    assert pairs[0] >= 4 + 15 * 180 * 8


def test_a_title_is_the_callers_own_and_no_part_of_the_name(client, name):
    assert client.get_scene(name).stored_scene.title == ""
    titled = client.put_scene(MAP, title="  our   flat ")
    assert (titled.stored_scene.name, titled.stored_scene.title) == (name, "our flat")
    assert not titled.created
    assert client.put_scene(MAP).stored_scene.title == "our flat", (
        "putting it again takes none away"
    )
    assert client.get_scene(name).stored_scene.title == "our flat"
    assert {each.name: each.title for each in client.list_scenes()}[name] == "our flat"


def test_a_title_is_changed_alone_kept_with_new_labels_and_taken_away(client, name):
    changed = client.update_scene(name, title="the flat")
    assert (changed.name, changed.title) == (name, "the flat")
    labelled = client.update_scene(name, {0: "cupboard"})
    assert labelled.name != name
    assert labelled.title == "the flat"
    other = client.update_scene(name, {0: "dresser"}, title="with a dresser")
    titles = {each.name: each.title for each in client.list_scenes()}
    assert (titles[name], titles[other.name]) == ("the flat", "with a dresser")
    assert client.update_scene(name, title="").title == ""


def test_a_title_longer_than_a_line_is_refused(client):
    with pytest.raises(InvalidRequestError, match=r"title has 201 characters; give at most 200"):
        client.put_scene(MAP, title="x" * 201)
    assert client.put_scene(MAP, title="x" * 200).stored_scene.title == "x" * 200


def test_a_server_says_whether_it_keeps_scenes(client):
    assert client.server_info().keeps_scenes
    with hosting(setup()) as host, Client(host.address) as without:
        assert not without.server_info().keeps_scenes


@pytest.fixture
def anna_and_bert(tmp_path):
    """Two callers with tokens, at one server."""
    known = {name: new_token(name) for name in ("anna", "bert")}
    file = tmp_path / "tokens"
    file.write_text("".join(f"{entry.line}\n" for _, entry in known.values()))
    with (
        hosting(setup(), store=tmp_path / "store", tokens=file) as host,
        ExitStack() as stack,
    ):
        yield [
            stack.enter_context(Client(host.address, timeout=60, token=token))
            for token, _ in known.values()
        ]


def test_the_same_name_is_the_same_answer_whoever_put_it(anna_and_bert):
    anna, bert = anna_and_bert
    put = anna.put_scene(MAP, title="of anna").stored_scene
    stored = sources.stored_scene(put.name)
    with pytest.raises(NotFoundError, match=r"^map\.stored_scene is"):
        bert.match(SKETCH, stored)
    with pytest.raises(NotFoundError, match=r"^name is"):
        bert.get_scene(put.name)
    again = bert.put_scene(MAP)
    assert (again.stored_scene.name, again.created) == (put.name, True)
    assert again.stored_scene.title == "", "a title is the caller's own"
    assert answer(bert.match(SKETCH, stored)) == answer(anna.match(SKETCH, stored))
    assert anna.get_scene(put.name).stored_scene.scene == again.stored_scene.scene
    labels = [client.update_scene(put.name, {2: "sofa"}) for client in (anna, bert)]
    assert labels[0].name == labels[1].name != put.name
    assert labels[0].scene == labels[1].scene


def test_a_scene_is_forgotten_by_its_caller_alone(anna_and_bert):
    anna, bert = anna_and_bert
    anna.put_scene(MAP)
    name = bert.put_scene(MAP).stored_scene.name
    expected = answer(bert.match(SKETCH, sources.stored_scene(name)))
    anna.delete_scene(name)
    with pytest.raises(NotFoundError):
        anna.match(SKETCH, sources.stored_scene(name))
    assert answer(bert.match(SKETCH, sources.stored_scene(name))) == expected


def test_a_title_is_one_line_without_escape_sequences(client):
    put = client.put_scene(scene(3, 11), title="\x1b[31mour\nflat\u202e").stored_scene
    assert put.title == "our flat"
    assert client.update_scene(put.name, title="the\x07 flat").title == "the flat"


def test_a_name_before_anything_was_put_is_not_found(tmp_path):
    with (
        hosting(setup(), store=tmp_path / "store") as host,
        Client(host.address, timeout=60) as client,
    ):
        stored = sources.stored_scene(MISSING)
        for call in (
            lambda: client.match(SKETCH, stored),
            lambda: client.sketch(stored),
            lambda: client.transfer(SKETCH, stored, object_map={0: 0, 1: 1}),
            lambda: client.get_scene(MISSING),
        ):
            with pytest.raises(
                NotFoundError, match="you have stored no scene of this name on this server"
            ):
                call()


def test_a_name_that_is_none_is_not_repeated_as_it_came(client):
    with pytest.raises(NotFoundError) as caught:
        client.get_scene("\x1b[31m" + 59 * "a")
    assert str(caught.value).isprintable()
