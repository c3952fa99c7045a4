"""A stranger's files are read wherever files are named: here, in Python, and on a server."""

import json
import os

import pytest

from sketchmatch import match, read_scene
from sketchmatch.app.setup import Setup
from sketchmatch.errors import PluginError
from sketchmatch.io import read_source
from sketchmatch.pipeline.engine import Engine
from sketchmatch.registry import default_registry, discover
from sketchmatch_client import Client, InvalidRequestError, ServerFailedError, sources
from tests.server.harness import hosting

pytestmark = pytest.mark.slow

SHELVES = {"shelves": [["a", 0, 0, 2.0], ["b", 5, 0, 1.5], ["low", 9, 9, 0.2], ["c", 3, 8, 1.0]]}


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Put a stranger's distribution on the path, as pip would."""
    folder = tmp_path_factory.mktemp("site")
    info = folder / "acme_shelves-1.2.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme-shelves\nVersion: 1.2\n")
    (info / "entry_points.txt").write_text("[sketchmatch]\nshelves = tests.server.reading\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        default_registry.cache_clear()
        yield folder
    default_registry.cache_clear()


@pytest.fixture(scope="module")
def client(site):
    del site
    with hosting(Setup(Engine(discover())), warm=False) as host, Client(host.address) as connected:
        yield connected


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "hall.json"
    path.write_text(json.dumps(SHELVES))
    return path


def labels(scene):
    return [item.label for item in scene.objects]


def test_python_reads_it_and_finds_its_objects_with_the_segmenter_for_such_files(site, file):
    del site
    assert read_source(file).heights == (2.0, 1.5, 0.2, 1.0)
    assert labels(read_scene(file)) == ["a", "b", "c"]
    assert labels(read_scene(f"{file}#a,b")) == ["a", "b"]
    assert match(file, file).object_map == {0: 0, 1: 1, 2: 2}


def test_a_server_reads_it_in_a_process_of_its_own(client, file):
    found = client.segment(sources.file(file))
    assert labels(found.scene) == ["a", "b", "c"]
    assert found.segmenter.name == "high-shelves"
    reading, finding = (int(warning.rstrip(".").rpartition(" ")[2]) for warning in found.warnings)
    assert reading == finding != os.getpid()


def test_a_server_matches_it_and_another_segmenter_can_be_chosen(client, file):
    source = sources.file(file.read_bytes(), name="hall.shelves", part="a,low")
    assert labels(client.segment(source, segmenter="polygons").scene) == ["a", "low"]
    found = client.match(sources.file(file), sources.file(file))
    assert found.object_map == {0: 0, 1: 1, 2: 2}


def test_a_fault_of_the_file_has_its_path_in_the_request(client, file):
    with pytest.raises(InvalidRequestError, match=r"^source\.file\.shelves is empty; give some"):
        client.segment(sources.file(file.read_bytes(), name="x.json", part="none"))
    with pytest.raises(
        InvalidRequestError, match=r"source\.file is of an unknown kind; give a file"
    ):
        client.segment(sources.file(b"?", name="x.unknown"))
    with pytest.raises(InvalidRequestError, match=r"map\.file is of an unknown kind; give a file"):
        client.match(sources.file(file), sources.file(b"?", name="x.unknown"))
    with pytest.raises(InvalidRequestError, match=r"source\.file is the YAML of a map or a bag"):
        client.segment(sources.file(b"image: x.pgm", name="room.yaml"))
    with pytest.raises(InvalidRequestError, match=r"source\.file\.data "):
        client.segment(sources.file(b"P5\n9 9\n255\n" + bytes([254] * 81), name="white.pgm"))
    one = sources.file(
        b'{"type": "Polygon", "coordinates": [[[0, 0], [2, 2], [2, 0], [0, 2]]]}', name="x.json"
    )
    two = sources.file(b'{"shapes": [{"points": [[0, 0], [0, 1], [1, 1]]}]}', name="x.json")
    for source in (one, two):
        with pytest.raises(InvalidRequestError, match=r"source\.file\.polygons holds one polygon"):
            client.segment(source)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("raising", r"reader raising of acme-shelves 1\.2 failed \(ZeroDivisionError: by zero\)"),
        ("lying", r"failed \(it returned a str, not a PolygonSet\); report it to its author"),
        ("exiting", r"reader exiting of acme-shelves 1\.2 ended its process \(exit code 3\)"),
    ],
)
def test_a_reader_that_misbehaves_is_blamed_and_harms_nobody_else(
    client, file, tmp_path, kind, words
):
    with pytest.raises(ServerFailedError, match=words):
        client.segment(sources.file(b"", name=f"x.{kind}"))
    assert labels(client.segment(sources.file(file)).scene) == ["a", "b", "c"]
    if kind != "exiting":
        (tmp_path / f"x.{kind}").touch()
        with pytest.raises(PluginError, match=words):
            read_source(tmp_path / f"x.{kind}")


def test_the_catalogue_lists_readers_of_others_beside_ours(client):
    listed = {item.name: item for item in client.algorithms().readers}
    assert {"dxf", "coco", "cvat", "excalidraw", "labelme", "scene-graph"} <= set(listed)
    shelves = listed["shelves"]
    assert (shelves.distribution, shelves.distribution_version) == ("acme-shelves", "1.2")
    assert (list(shelves.suffixes), list(shelves.json_keys)) == ([".shelves"], ["shelves"])
