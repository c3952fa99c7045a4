"""The two files of a robot's map: every way to name them, and every way to be given them."""

import shutil

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

import sketchmatch_map_files
from sketchmatch.app.requests import source
from sketchmatch.cli.sources import source_of
from sketchmatch.errors import InvalidInputError
from sketchmatch.io import read_source
from sketchmatch.io.files import read_map_files
from sketchmatch.model import Image, OccupancyGrid
from sketchmatch_map_files import _reader, find_picture, parse, text_of
from tests.tools import ROOT, require

CASES = ROOT.parent / "shared" / "data" / "cases" / "20-map-yaml-image-paths"
# What map_server opens, or would if the file were there.
PICTURES = {
    **dict.fromkeys(
        (
            *("anchor", "block", "block-note", "comment", "commented-image-then-real", "docstart"),
            *("dotdot", "flow", "indented", "json", "key-space-colon", "nextline", "quoted-key"),
            "tab",
        ),
        "m.pgm",
    ),
    "escape": "büro.pgm",
    "hash": "map #2.pgm",
    "hash-unquoted": "map#2.pgm",
    "single-quote": "bob's map.pgm",
    "spaces": "my map.pgm",
    "unicode": "büro_地図.pgm",
}
# What lies elsewhere: it says first what is not there.
ELSEWHERE = {
    "abs-elsewhere": "/home/robot/maps/m.pgm",
    "subdir-of-cwd": "maps/m.pgm",
    "tilde": "~/m.pgm",
    "twice": "old.pgm",
    "windows-abs": r"C:\Users\me\maps\m.pgm",
    "windows-rel": r".\m.pgm",
}
HEADER = (
    "resolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
)
PGM = b"P5\n3 2\n255\n\xfe\xfe\xfe\x00\xcd\xfe"


def write(folder, name="office", picture="office.pgm", image=None):
    text = f"image: {image or picture}\n{HEADER}"
    (folder / f"{name}.yaml").write_text(text, encoding="utf-8")
    (folder / picture).write_bytes(PGM)
    return folder / f"{name}.yaml"


def refused(path):
    with pytest.raises(InvalidInputError) as caught:
        read_source(path)
    assert str(caught.value).startswith(str(path))
    return str(caught.value)


def case(name):
    path = CASES / f"{name}.yaml"
    require(path.exists(), f"shared/data/cases/{CASES.name}")
    return path


def test_every_case_has_its_expectation():
    require(CASES.exists(), f"shared/data/cases/{CASES.name}")
    assert {path.stem for path in CASES.glob("*.yaml")} == {*PICTURES, *ELSEWHERE}


@pytest.mark.parametrize("name", PICTURES)
def test_every_legal_spelling_names_the_picture_that_map_server_opens(name):
    path = case(name)
    picture, notes = find_picture(path, parse(text_of(path.read_bytes())))
    assert picture.samefile(CASES / PICTURES[name])
    assert notes == ()
    grid = read_source(path)
    assert grid.cells.shape == (190, 215)
    assert grid.notes == ()


@pytest.mark.parametrize("name", ELSEWHERE)
def test_a_picture_of_another_machine_is_found_beside_the_yaml_and_said(name):
    path = case(name)
    note = f"the map's image {ELSEWHERE[name]} does not exist, and m.pgm beside {path.name}"
    grid = read_source(path)
    assert grid.cells.shape == (190, 215)
    assert grid.notes == (f"{note} was used",)


def test_a_picture_at_its_place_comes_before_one_beside_the_yaml(tmp_path):
    (tmp_path / "maps").mkdir()
    path = write(tmp_path, image="maps/office.pgm")
    (tmp_path / "maps" / "office.pgm").write_bytes(b"P5\n1 1\n255\n\x00")
    grid = read_source(path)
    assert (grid.cells.tolist(), grid.notes) == ([[100]], ())


@pytest.mark.parametrize(
    "image", ["/gone/away.pgm", "..", "/", r"C:\away.pgm", "x" * 5000 + ".pgm"]
)
def test_what_is_nowhere_is_named(tmp_path, image):
    assert "check the path" in refused(write(tmp_path, image=image)) or "is a directory" in refused(
        tmp_path / "office.yaml"
    )


@pytest.mark.parametrize("kind", ["pgm", "png", "PGM"])
def test_the_picture_of_a_map_is_read_as_the_map_that_the_yaml_beside_it_says(tmp_path, kind):
    write(tmp_path, "office", f"office.{kind}")
    grid = read_source(tmp_path / f"office.{kind}")
    assert isinstance(grid, OccupancyGrid)
    assert grid.cells.tolist() == [[100, -1, 0], [0, 0, 0]]
    assert grid.notes == (
        f"office.{kind} is the picture of a map, and office.yaml beside it was read",
    )


def test_of_several_maps_of_one_picture_that_of_its_name_is_read_or_all_are_named(tmp_path):
    write(tmp_path, "office")
    write(tmp_path, "zones")
    assert "office.yaml beside it" in read_source(tmp_path / "office.pgm").notes[0]
    shutil.move(tmp_path / "office.yaml", tmp_path / "places.yaml")
    message = refused(tmp_path / "office.pgm")
    assert "several maps; give one of them: places.yaml, zones.yaml" in message


def test_a_picture_that_no_yaml_names_is_a_picture(tmp_path):
    write(tmp_path, "office", "office.pgm")
    (tmp_path / "params.yaml").write_text("image: drawing.png\n", encoding="utf-8")
    (tmp_path / "broken.yaml").write_text("image: [", encoding="utf-8")
    (tmp_path / "drawing.pgm").write_bytes(b"P5\n3 1\n255\n\xfe\x80\x00")
    assert isinstance(read_source(tmp_path / "drawing.pgm"), Image)
    assert read_map_files(tmp_path / "drawing.pgm") is None


@pytest.mark.parametrize(
    ("comment", "resolution", "words"),
    [
        (b"", 0.05, "cells of 0.05 m, and its lower left corner as the origin; give its YAML"),
        (b"# CREATOR: map_saver.cpp 0.025 m/pix\n", 0.025, "cells of 0.025 m, as it says"),
        (b"# CREATOR: map_saver.cpp 0.000 m/pix\n", 0.05, "cells of 0.05 m, and"),
        (b"# by hand\n# and again\n", 0.05, "cells of 0.05 m, and"),
    ],
)
def test_a_saved_map_without_its_yaml_gets_one_and_says_what_is_assumed(
    tmp_path, comment, resolution, words
):
    path = tmp_path / 'my "map".pgm'
    path.write_bytes(PGM.replace(b"3 2", comment + b"3 2"))
    grid = read_source(path)
    assert grid.cells.tolist() == [[100, -1, 0], [0, 0, 0]]
    assert grid.resolution == resolution
    assert words in grid.notes[0]


@pytest.mark.parametrize(
    "picture",
    [
        PGM.replace(b"\xcd", b"\xfe"),
        b"P5\n10 30\n255\n" + bytes([205, 205, *[254] * 298]),
        b"P5\n10 30\n255\n" + bytes([254, 254, *[205] * 298]),
        PGM.replace(b"\xcd", b"\xcc"),
        b"P2\n2 1\n255\n205 254\n",
        b"P5\n2 2\n255\n" + bytes([205, 205, 0, 0]),
    ],
)
def test_a_pgm_of_other_greys_is_a_picture(tmp_path, picture, capsys):
    (tmp_path / "sketch.pgm").write_bytes(picture)
    assert isinstance(read_source(tmp_path / "sketch.pgm"), Image)
    assert source_of(tmp_path / "sketch.pgm").image.data == picture
    words = "sketch.pgm was read as a drawing; if it is a robot's map, give its .yaml"
    assert words in " ".join(capsys.readouterr().err.split())


def test_white_with_which_people_clean_maps_is_no_other_grey(tmp_path):
    (tmp_path / "map.pgm").write_bytes(PGM.replace(b"\x00", b"\xff"))
    assert read_source(tmp_path / "map.pgm").cells.tolist() == [[0, -1, 0], [0, 0, 0]]


def test_an_image_that_stands_twice_is_noted(tmp_path):
    path = write(tmp_path)
    path.write_text(path.read_text() + "image: other.pgm\n", encoding="utf-8")
    (note,) = read_source(path).notes
    assert note == "office.yaml has image twice, and the first, office.pgm, was used"


def test_the_folder_of_a_map_is_read_as_the_map(tmp_path):
    write(tmp_path)
    (tmp_path / "nav2_params.yaml").write_text("image: office.pgm\n", encoding="utf-8")
    (tmp_path / "README.md").write_text("A map.", encoding="utf-8")
    grid = read_source(tmp_path)
    assert grid.cells.shape == (2, 3)
    assert grid.notes == (f"{tmp_path} is a folder, and its map office.yaml was read",)


def test_a_bags_folder_is_no_maps(tmp_path):
    write(tmp_path)
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n", encoding="utf-8")
    assert read_map_files(tmp_path) is None


def test_a_folder_of_several_maps_names_them(tmp_path):
    names = [f"{k}.yaml" for k in range(6)]
    for k in range(6):
        write(tmp_path, str(k), f"{k}.pgm")
    assert refused(tmp_path).endswith(f"give one of them: {', '.join(names[:5])}, …")


def test_a_fault_in_the_yaml_that_was_found_names_it(tmp_path):
    write(tmp_path)
    text = f"image: office.pgm\n{HEADER}".replace("negate: 0", "negate: 7")
    (tmp_path / "office.yaml").write_text(text, encoding="utf-8")
    expected = ": office.yaml: negate is 7; give 0, or 1 where white is occupied"
    assert refused(tmp_path) == f"{tmp_path}{expected}"
    assert refused(tmp_path / "office.pgm") == f"{tmp_path / 'office.pgm'}{expected}"


def test_the_command_line_says_how_a_map_was_found(tmp_path, capsys):
    write(tmp_path)
    message = source_of(tmp_path, "map")
    assert message.map_server_map.image == PGM
    said = capsys.readouterr().err
    assert f"map: {tmp_path} is a folder" in " ".join(said.split())


def test_the_yaml_is_parsed_once_on_its_way_into_the_engine(tmp_path, monkeypatch):
    parse.cache_clear()
    calls = []
    read = _reader.read_document
    monkeypatch.setattr(_reader, "read_document", lambda text: calls.append(text) or read(text))
    grid = source(source_of(write(tmp_path)), "map", True)
    assert np.array_equal(grid.cells, [[100, -1, 0], [0, 0, 0]])
    assert len(calls) == 1
    assert sketchmatch_map_files.parse is parse


TEXTS = st.text(st.characters(codec="utf-8", exclude_categories=("Cc", "Cs")), max_size=12)
VALUES = st.recursive(
    TEXTS | st.none() | st.integers() | st.booleans() | st.floats(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXTS, inner, max_size=4),
    max_leaves=12,
)


def as_text(value):
    """What yaml-cpp holds: text as it is written, and null."""
    if isinstance(value, dict):
        return {key: as_text(item) for key, item in value.items()}
    if isinstance(value, list):
        return [as_text(item) for item in value]
    return value if value is None else yaml.load(yaml.safe_dump(value), yaml.BaseLoader)


@pytest.mark.slow
@given(
    values=st.dictionaries(TEXTS, VALUES, max_size=5),
    flow=st.sampled_from([True, False, None]),
    start=st.booleans(),
    unicode=st.booleans(),
)
def test_what_pyyaml_writes_is_read_as_the_text_that_it_wrote(values, flow, start, unicode):
    text = yaml.safe_dump(
        values, default_flow_style=flow, explicit_start=start, allow_unicode=unicode
    )
    found = parse("\ufeff" + text)
    assert found.values == as_text(values)
    assert found.repeated == {}
