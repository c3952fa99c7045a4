"""Scenes under the hash of what they are: what makes the name, whose they are, and broken files."""

import sqlite3
from contextlib import closing

import numpy as np
import pytest

from sketchmatch.api import Segmentation
from sketchmatch.app import responses
from sketchmatch.app.scenes import SceneArchive
from sketchmatch.app.shelf import Described, Shelf, described_by, name_of
from sketchmatch.app.store import Store
from sketchmatch.errors import InvalidInputError, NotFoundError, QuotaError, StoreError
from sketchmatch.model import Scene
from sketchmatch.pipeline.describe import in_directions
from sketchmatch.registry import Kind, default_registry
from sketchmatch_client import sources
from sketchmatch_proto.v1.scene_service_pb2 import GetSceneResponse
from sketchmatch_proto.v1.source_pb2 import Source

REGISTRY = default_registry()
BOXES = [[(0, 0), (2, 0), (2, 1), (0, 1)], [(5, 0), (6, 0), (6, 3), (5, 3)]]
SOURCE = sources.polygons(BOXES, ["bed", ""])


def segmenter(name="polygons", **parameters):
    algorithm = REGISTRY.find(Kind.SEGMENTER, name).algorithm
    return algorithm(algorithm.Params(**parameters))


def found(source=SOURCE, labels=("bed", ""), shift=0.0):
    """Return what a worker finds in a source."""
    scene = Scene.from_polygons([np.array(box) + shift for box in BOXES], labels)
    made = segmenter()
    name, _ = name_of(source, made, REGISTRY)
    route = np.array([[0.5, 0.25], [1.5, 2.5]])
    segmentation = Segmentation(scene, ("one was left out",), route, ((0, 1),))
    return GetSceneResponse(
        stored_scene=responses.stored_scene(name, segmentation, made), source=source
    )


@pytest.fixture
def store(tmp_path):
    store = Store(tmp_path / "store")
    yield store
    store.close()


@pytest.fixture
def archive(store):
    archive = SceneArchive(store, 1 << 24)
    archive.open()
    yield archive
    archive.close()


@pytest.fixture
def shelf(archive):
    shelf = Shelf(archive.path)
    yield shelf
    shelf.close()


@pytest.fixture
def name(archive):
    """A scene that anna has put."""
    _, created = archive.put(found(), "anna")
    assert created
    return found().stored_scene.name


class TestNames:
    def test_the_same_source_has_the_same_name_however_it_was_encoded(self):
        later = Source.FromString(SOURCE.SerializeToString() + b"\xfa\x07\x03new")
        assert name_of(later, segmenter(), REGISTRY) == name_of(SOURCE, segmenter(), REGISTRY)

    def test_another_source_label_segmenter_or_parameter_makes_another_name(self):
        grid = sources.occupancy_grid([[0, 100], [-1, 0]], 0.05)
        other = segmenter("occupancy-grid")
        names = {
            name_of(source, made, REGISTRY)[0]
            for source, made in [
                (SOURCE, segmenter()),
                (sources.polygons(BOXES, ["bed", "desk"]), segmenter()),
                (sources.polygons(BOXES, ["bed", ""], y_axis="down"), segmenter()),
                (grid, other),
                (grid, segmenter("occupancy-grid", close_gaps=0.75)),
                (grid, segmenter("rooms")),
            ]
        }
        assert len(names) == 6

    def test_another_version_makes_another_name(self, monkeypatch):
        before, _ = name_of(SOURCE, segmenter(), REGISTRY)
        monkeypatch.setattr("sketchmatch.__version__", "99.9")
        assert name_of(SOURCE, segmenter(), REGISTRY)[0] != before


class TestOwners:
    def test_a_scene_is_there_for_who_has_put_it_alone(self, archive, name):
        assert archive.get(name, "anna").stored_scene == found().stored_scene
        for method in (archive.get, archive.delete):
            with pytest.raises(NotFoundError, match=f"name is {name}"):
                method(name, "bert")
        with pytest.raises(NotFoundError):
            archive.relabel(name, [(0, "cot")], "bert")
        assert not archive.list("bert", 0, "").scenes

    def test_who_puts_the_same_has_the_same(self, archive, name):
        record, created = archive.claim(name, "bert")
        assert created
        assert record == archive.get(name, "bert").stored_scene == found().stored_scene
        assert archive.claim(name, "bert") == (record, False)
        assert not archive.put(found(), "anna")[1]

    def test_what_one_forgets_stays_with_the_other_until_nobody_has_it(self, archive, name):
        archive.claim(name, "bert")
        archive.delete(name, "anna")
        assert archive.get(name, "bert", True).source == SOURCE
        archive.delete(name, "bert")
        assert archive.claim(name, "bert") is None
        with closing(sqlite3.connect(archive.path)) as file:
            for table in ("contents", "scenes", "owners"):
                assert file.execute(f"SELECT count(*) FROM {table}").fetchone() == (0,)

    def test_the_source_comes_only_where_it_is_wanted(self, archive, name):
        assert archive.get(name, "anna", include_source=True).source == SOURCE
        assert not archive.get(name, "anna").HasField("source")

    def test_a_name_of_any_length_is_quoted_and_cut(self, archive):
        with pytest.raises(
            NotFoundError, match=r"^name is 'x+…, but you have stored no scene"
        ) as caught:
            archive.get("x" * 10_000, "anna")
        assert len(str(caught.value)) < 250


class TestLabels:
    def test_labels_make_another_scene_beside_the_one_without_them(self, archive, name):
        other = archive.relabel(name, [(1, " the \n desk ")], "anna")
        assert [item.label for item in other.scene.objects] == ["bed", "the desk"]
        assert other.name != name
        assert archive.get(name, "anna").stored_scene == found().stored_scene
        assert archive.get(other.name, "anna", True).source == SOURCE

    def test_the_same_labels_lead_to_the_same_name_on_any_way(self, archive, name):
        one = archive.relabel(name, [(0, "cot"), (1, "desk")], "anna")
        step = archive.relabel(name, [(1, "desk")], "anna")
        assert archive.relabel(step.name, [(0, "cot")], "anna").name == one.name
        back = archive.relabel(one.name, [(0, "bed"), (1, "")], "anna")
        assert back == found().stored_scene

    def test_labels_of_what_is_not_there_are_refused_and_change_nothing(self, archive, name):
        with pytest.raises(InvalidInputError, match="of an object, from 0 to 1") as caught:
            archive.relabel(name, [(0, "cot"), (2, "desk")], "anna")
        assert caught.value.field == "labels[1].object"
        assert len(archive.list("anna", 0, "").scenes) == 1

    def test_a_label_stays_when_the_scene_without_it_is_deleted(self, archive, name):
        other = archive.relabel(name, [(1, "desk")], "anna")
        archive.delete(name, "anna")
        assert archive.get(other.name, "anna", True).source == SOURCE
        assert archive.relabel(other.name, [(1, "")], "anna").name == name


class TestLists:
    def test_the_latest_comes_first_page_by_page(self, archive):
        named = [f"thing {k}" for k in range(5)]
        names = []
        for label in named:
            put = found(sources.polygons(BOXES, [label, ""]), (label, ""))
            archive.put(put, "anna")
            names.append(put.stored_scene.name)
        seen, token = [], ""
        for expected in (2, 2, 1):
            page = archive.list("anna", 2, token)
            assert len(page.scenes) == expected
            seen += page.scenes
            token = page.next_page_token
        assert token == ""
        assert [each.name for each in seen] == names[::-1]
        assert [list(each.labels) for each in seen] == [[label] for label in named[::-1]]
        assert {each.object_count for each in seen} == {2}
        assert seen[0].put_time.seconds > 1_700_000_000

    @pytest.mark.parametrize(
        ("size", "token", "field"),
        [(1001, "", "page_size"), (-1, "", "page_size"), (1, "x", "page_token")],
    )
    def test_a_page_that_is_none_is_refused(self, archive, size, token, field):
        with pytest.raises(InvalidInputError) as caught:
            archive.list("anna", size, token)
        assert caught.value.field == field


class TestShelf:
    def test_a_scene_is_read_as_it_was_found_and_decoded_once(self, shelf, name):
        read = shelf.segmentation(name, "anna", "map.stored_scene")
        assert read.scene.identity == Scene.from_polygons(BOXES).identity
        assert read.scene.labels == ("bed", "")
        assert read.warnings == ("one was left out",)
        assert read.route.tolist() == [[0.5, 0.25], [1.5, 2.5]]
        assert read.passages == ((0, 1),)
        assert shelf.segmentation(name, "anna", "map.stored_scene") is read
        assert shelf.holds(read.scene)
        assert not shelf.holds(Scene.from_polygons(BOXES))

    def test_anothers_scene_is_not_there_even_where_it_was_decoded(self, shelf, name):
        shelf.segmentation(name, "anna", "map.stored_scene")
        with pytest.raises(NotFoundError, match=f"^map.stored_scene is {name}, but you"):
            shelf.segmentation(name, "bert", "map.stored_scene")

    def test_histograms_come_back_to_the_last_digit(self, archive, shelf, name):
        scene = shelf.segmentation(name, "anna", "map").scene
        histogram = in_directions(REGISTRY.find(Kind.HISTOGRAM, "constant").algorithm(), 8)
        values = np.random.default_rng(0).random((1, 8))
        assert shelf.histograms(scene, histogram) is None
        told = Described(scene.identity, described_by(histogram.identity), values)
        archive.keep(Described.unpacked(told.packed()))
        assert (shelf.histograms(scene, histogram) == values).all()
        archive.delete(name, "anna")
        assert shelf.histograms(scene, histogram) is None

    def test_histograms_of_what_is_not_kept_are_not_kept(self, archive):
        archive.keep(Described("outlines of another scene", "h", np.ones((1, 8))))
        with closing(sqlite3.connect(archive.path)) as file:
            assert file.execute("SELECT count(*) FROM histograms").fetchone() == (0,)

    def test_without_a_store_the_field_is_named(self):
        with pytest.raises(StoreError, match=r"^map\.stored_scene needs a store, but this server"):
            Shelf(None).segmentation("x", "anna", "map.stored_scene")


class TestQuotas:
    """Noise cannot be compressed: each of these sources takes a little over a mebibyte."""

    MIB = 1024 * 1024

    @pytest.fixture
    def large(self):
        noise = np.random.default_rng(0)
        return [found(sources.image(noise.bytes(self.MIB))) for _ in range(3)]

    def test_a_caller_keeps_what_it_may_and_others_theirs(self, archive, large):
        for each in large[:2]:
            assert archive.put(each, "anna", most=2 * self.MIB + 20_000)[1]
        said = (
            r"with this scene you would store 3 MiB, and the limit for each "
            r"caller is 2\.02 MiB; delete scenes that you do not need"
        )
        with pytest.raises(QuotaError, match=said):
            archive.put(large[2], "anna", most=2 * self.MIB + 20_000)
        with pytest.raises(NotFoundError):
            archive.get(large[2].stored_scene.name, "anna")
        assert archive.put(large[2], "bert", most=2 * self.MIB + 20_000)[1]
        with pytest.raises(QuotaError):
            archive.claim(large[2].stored_scene.name, "anna", most=2 * self.MIB + 20_000)
        archive.delete(large[0].stored_scene.name, "anna")
        assert archive.claim(large[2].stored_scene.name, "anna", most=2 * self.MIB + 20_000)

    def test_what_is_refused_leaves_nothing_behind(self, archive, large):
        with pytest.raises(QuotaError):
            archive.put(large[0], "anna", most=self.MIB)
        with sqlite3.connect(archive.path) as file:
            for table in ("scenes", "contents", "owners"):
                assert file.execute(f"SELECT count(*) FROM {table}").fetchone() == (0,)

    def test_what_is_put_again_takes_nothing_and_a_lower_limit_takes_nothing_away(
        self, archive, large
    ):
        assert archive.put(large[0], "anna")[1]
        assert not archive.put(large[0], "anna", most=1)[1]
        assert archive.get(large[0].stored_scene.name, "anna")

    def test_a_source_counts_once_however_many_labels_it_is_given(self, archive, large):
        archive.put(large[0], "anna")
        name = large[0].stored_scene.name
        for label in ("chair", "table"):
            archive.relabel(name, [(0, label)], "anna", most=self.MIB + 20_000)
        with pytest.raises(QuotaError, match="limit for each caller"):
            archive.relabel(name, [(0, "lamp")], "anna", most=self.MIB)


class TestBrokenFiles:
    def test_a_full_store_says_so_and_keeps_what_it_has(self, store):
        archive = SceneArchive(store, max_bytes=1)
        noise = np.random.default_rng(0).bytes(2_000_000)
        archive.put(found(), "anna")
        large = found(sources.image(noise))
        with pytest.raises(StoreError, match="is full; delete what is not needed"):
            archive.put(large, "anna")
        assert archive.get(found().stored_scene.name, "anna")
        archive.keep(Described("x", "y", np.zeros((9000, 180))))  # which is not worth an error
        archive.close()

    def test_a_damaged_file_says_so_to_who_writes_and_who_reads(self, archive, shelf, name):
        archive.close()
        for file in archive.path.parent.glob("scenes.sqlite*"):
            file.write_bytes(b"no database " * 1000)
        with pytest.raises(StoreError, match="is damaged; move it away"):
            archive.get(name, "anna")
        with pytest.raises(StoreError, match="is damaged; move it away"):
            shelf.segmentation(name, "anna", "map")
        assert shelf.record(name) is None

    @pytest.mark.parametrize("table", ["histograms", "scenes", "contents"])
    def test_a_byte_that_changed_is_found(self, archive, shelf, name, table):
        scene = shelf.segmentation(name, "anna", "map").scene
        archive.keep(Described.within(scene))
        assert len(shelf.own_histograms(scene)) == 2
        archive.close()
        column = {"histograms": "bytes", "scenes": "record", "contents": "source"}[table]
        with closing(sqlite3.connect(archive.path)) as file, file:
            ((kept,),) = file.execute(f"SELECT {column} FROM {table}").fetchall()
            other = kept[:9] + bytes([kept[9] ^ 1]) + kept[10:]
            file.execute(f"UPDATE {table} SET {column} = ?", (other,))
        if table == "histograms":
            assert shelf.own_histograms(scene) is None
            archive.keep(Described.within(scene))
            assert len(shelf.own_histograms(scene)) == 2
            return
        with pytest.raises(StoreError, match="is damaged; move it away"):
            archive.get(name, "anna", include_source=True)
        if table == "scenes":
            assert shelf.record(name) is None
            with pytest.raises(StoreError, match="is damaged; move it away"):
                shelf.segmentation(name, "anna", "map")
        else:
            assert shelf.source(name) is None
        assert not archive.put(found(), "anna")[1]
        assert archive.get(name, "anna", include_source=True).source == SOURCE
        assert archive.get(name, "anna").stored_scene == found().stored_scene

    def test_a_damaged_scene_can_be_deleted(self, archive, name):
        with closing(sqlite3.connect(archive.path)) as file, file:
            file.execute("UPDATE scenes SET record = x'00'")
        archive.delete(name, "anna")
        with pytest.raises(NotFoundError):
            archive.get(name, "anna")

    def test_a_file_that_is_gone_is_said_and_another_one_is_read(self, archive, shelf, name):
        shelf.segmentation(name, "anna", "map")
        for file in archive.path.parent.glob("scenes.sqlite*"):
            file.unlink()
        with pytest.raises(StoreError, match="cannot be used"):
            shelf.segmentation(name, "anna", "map")
        archive.put(found(), "bert")
        assert shelf.segmentation(name, "bert", "map")
        with pytest.raises(NotFoundError):
            shelf.segmentation(name, "anna", "map")
