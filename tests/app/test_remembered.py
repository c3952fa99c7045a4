"""What is kept of stored scenes: taken by matches, and computed anew where it cannot be."""

import sqlite3
from contextlib import closing

import numpy as np
import pytest

from sketchmatch.api import forces
from sketchmatch.app.jobs import answers
from sketchmatch.app.orders import Order
from sketchmatch.app.remembered import Remembered
from sketchmatch.app.scenes import SceneArchive
from sketchmatch.app.setup import RequestLimits, Setup
from sketchmatch.app.shelf import Described
from sketchmatch.app.store import Store
from sketchmatch.pipeline.engine import Engine
from sketchmatch.registry import default_registry
from sketchmatch_client import match_request, sources
from sketchmatch_proto.v1.scene_service_pb2 import GetSceneResponse, PutSceneRequest
from tests.server.harness import scene, shapes, turned

MAP, SKETCH = scene(6, 1), sources.polygons(turned([shapes(6, 1)[k] for k in (0, 2, 3, 5)]))


@pytest.fixture
def archive(tmp_path):
    store = Store(tmp_path / "store")
    archive = SceneArchive(store, 1 << 24)
    archive.open()
    yield archive
    archive.close()
    store.close()


def process(archive, request):
    """Answer a request as a process does that has just begun; return its responses."""
    remembered = Remembered(archive.path)
    setup = remembered.setup(Setup(Engine(default_registry()), RequestLimits()), archive.keep)
    order = Order("a", type(request).__name__, request.SerializeToString(), "anna")
    found = [*answers(order.job(setup.limits.max_request_bytes), setup)]
    remembered.close()
    return found


@pytest.fixture
def name(archive):
    """A scene that anna has put, as a server keeps what comes of it."""
    put, *described = process(archive, PutSceneRequest(source=MAP))
    assert isinstance(put, GetSceneResponse)
    archive.put(put, "anna")
    for each in described:
        archive.keep(Described.unpacked(each.value))
    return put.stored_scene.name


@pytest.fixture
def computed(monkeypatch):
    """The objects whose own histograms are computed, by their number in each call."""
    counts, compute = [], forces.force_histograms

    def counting(edges, pairs, *rest):
        counts.append(len(pairs))
        return compute(edges, pairs, *rest)

    monkeypatch.setattr(forces, "force_histograms", counting)
    return counts


def matched(archive, name):
    """Return what a process that has just begun makes of a match with a stored scene."""
    *_, last = process(archive, match_request(SKETCH, sources.stored_scene(name)))
    last.result.ClearField("statistics")
    last.result.ClearField("match_id")
    return last.result


def changed(archive, change):
    """Change the histograms within the objects of the scene that is kept, in the file."""
    with closing(sqlite3.connect(archive.path)) as file, file:
        made = file.execute(f"{change} WHERE described_by LIKE '%within objects%'")
    assert made.rowcount == 1


OTHER = "CAST(substr(bytes, 1, 99) || x'55' || substr(bytes, 101) AS BLOB)"


def test_a_match_with_a_stored_map_computes_the_sketchs_own_histograms_alone(
    archive, name, computed
):
    first = matched(archive, name)
    computed.clear()  # of what compiles kernels
    assert matched(archive, name) == first
    assert computed == [4]


@pytest.mark.parametrize(
    "change",
    [
        f"UPDATE histograms SET bytes = {OTHER}",
        "UPDATE histograms SET bytes = substr(bytes, 1, 99)",
        "UPDATE histograms SET bytes = x''",
        "UPDATE histograms SET described_by = '0.0.1 within objects, 180'",
        "DELETE FROM histograms",
    ],
    ids=["damaged", "cut", "empty", "older", "missing"],
)
def test_what_cannot_be_taken_is_computed_anew_and_kept(archive, name, computed, change):
    expected = matched(archive, name)
    changed(archive, change)
    computed.clear()
    assert matched(archive, name) == expected
    assert computed == [6, 4]
    computed.clear()
    assert matched(archive, name) == expected
    assert computed == [4]


def test_what_is_kept_is_what_would_be_computed(archive, name):
    with closing(sqlite3.connect(archive.path)) as file:
        (kept,) = file.execute(
            "SELECT bytes FROM histograms WHERE described_by LIKE '%within objects%'"
        ).fetchone()
    found = archive.get(name, "anna").stored_scene.scene.objects
    outlines = [np.array([[p.x, p.y] for p in item.rings[0].points]) for item in found]
    objects = [forces.SceneObject.from_rings([outline]) for outline in outlines]
    assert kept[4:] == forces.own_histograms(objects).astype("<f8").tobytes()
    assert len(kept) == 4 + 6 * 90 * 8
