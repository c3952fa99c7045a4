"""Robots' maps: every key, mode and kind of picture, and every way to get them wrong."""

import io
import re
import struct
import zlib

import numpy as np
import PIL.Image
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io import read_source
from sketchmatch.io.ros_map import (
    MapServerHeader,
    decode_map_server,
    encode_map_server,
    parse_header,
)
from sketchmatch.model import OccupancyGrid
from sketchmatch_map_files import parse
from tests.tools import ROOT, require

GREYS = [0, 60, 100, 205, 254, 255]
HEADER = {
    "image": "map.pgm",
    "resolution": 0.05,
    "origin": [-1.0, 2.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}


def yaml_text(**changes):
    header = {**HEADER, **changes}
    return "".join(f"{key}: {value}\n" for key, value in header.items() if value != "left out")


def pgm(rows, maxval=255):
    rows = np.asarray(rows, np.uint8)
    return b"P5\n# by hand\n%d %d\n%d\n" % (*rows.shape[::-1], maxval) + rows.tobytes()


def encoded(picture, kind, tmp_path):
    path = tmp_path / f"picture.{kind}"
    picture.save(path)
    return path.read_bytes()


def cells(greys, **changes):
    return decode_map_server(yaml_text(**changes), pgm([greys])).cells[0].tolist()


def test_trinary_is_the_default_and_the_comparisons_are_strict():
    assert cells(GREYS) == [100, 100, -1, -1, 0, 0]
    # p(205) = 50/255 = 0.196…: free only where the threshold is above it.
    assert cells([205], free_thresh=0.25) == [0]
    # p(204) = 0.2 is not below 0.2, p(51) = 0.8 not above 0.8.
    assert cells([204, 51], free_thresh=0.2, occupied_thresh=0.8) == [-1, -1]


def test_negate_turns_white_into_occupied():
    assert cells(GREYS, negate=1) == [0, -1, -1, 100, 100, 100]
    assert cells([0, 255], negate="true") == [0, 100]


def test_scale_spreads_what_lies_between_the_thresholds():
    values = cells([0, 89, 128, 204, 255], mode="scale", free_thresh=0.2, occupied_thresh=0.65)
    # p = 1, 0.651, 0.498, 0.2, 0.
    assert values == [100, 100, round((127 / 255 - 0.2) / 0.45 * 100), 0, 0]


def test_raw_takes_values_as_they_are():
    assert cells([0, 42, 100, 101, 255], mode="raw") == [0, 42, 100, -1, -1]
    assert cells([0, 42], mode="raw", negate=1) == [0, 42]


def test_rows_are_turned_so_that_the_lowest_is_first():
    grid = decode_map_server(yaml_text(), pgm([[0, 254], [205, 205], [254, 0]]))
    assert grid.cells.tolist() == [[0, 100], [-1, -1], [100, 0]]
    assert grid.origin == (-1.0, 2.0, 0.0)
    assert grid.resolution == 0.05


@pytest.mark.parametrize("kind", ["png", "bmp", "tif"])
def test_every_lossless_format_holds_the_same_map(kind, tmp_path):
    greys = np.random.default_rng(0).choice(GREYS, (7, 5)).astype(np.uint8)
    expected = decode_map_server(yaml_text(), pgm(greys)).cells
    picture = PIL.Image.fromarray(greys)
    assert (
        decode_map_server(yaml_text(), encoded(picture, kind, tmp_path)).cells == expected
    ).all()
    colour = encoded(picture.convert("RGB"), kind, tmp_path)
    assert (decode_map_server(yaml_text(), colour).cells == expected).all()


def test_plain_and_16_bit_pgm_hold_the_same_map():
    plain = b"P2\n# by hand\n3 2\n255\n0 100 254\n205 0 255\n"
    expected = [[-1, 100, 0], [100, -1, 0]]
    assert decode_map_server(yaml_text(), plain).cells.tolist() == expected
    deep = b"P5\n3 2\n65535\n" + np.array([0, 25700, 65278, 52685, 0, 65535], ">u2").tobytes()
    assert decode_map_server(yaml_text(), deep).cells.tolist() == expected


def test_a_palette_is_looked_up(tmp_path):
    picture = PIL.Image.new("P", (3, 1))
    picture.putdata([0, 1, 2])
    picture.putpalette([255, 255, 255, 0, 0, 0, 205, 205, 205])
    data = encoded(picture, "png", tmp_path)
    assert decode_map_server(yaml_text(), data).cells.tolist() == [[0, 100, -1]]


def test_a_colour_counts_as_its_mean(tmp_path):
    colour = PIL.Image.fromarray(np.array([[[255, 0, 0], [255, 255, 0]]], np.uint8))
    # Means 85 and 170: p = 0.667 and 0.333.
    data = encoded(colour, "png", tmp_path)
    assert decode_map_server(yaml_text(), data).cells.tolist() == [[100, -1]]


@pytest.mark.parametrize(
    ("mode", "expected"), [("trinary", [100, -1, -1]), ("scale", [100, -1, -1]), ("raw", [0, 0, 9])]
)
def test_what_is_transparent_is_unknown(mode, expected, tmp_path):
    pixels = np.array([[[0, 0, 0, 255], [0, 0, 0, 0], [9, 9, 9, 254]]], np.uint8)
    data = encoded(PIL.Image.fromarray(pixels), "png", tmp_path)
    assert decode_map_server(yaml_text(mode=mode), data).cells.tolist() == [expected]


coordinates = st.floats(-1e4, 1e4, allow_subnormal=False)


@given(
    arrays(np.int8, st.tuples(*2 * [st.integers(1, 9)]), elements=st.integers(-1, 100)),
    st.floats(1e-5, 10.0),
    st.tuples(coordinates, coordinates, coordinates),
)
@example(np.arange(-1, 101, dtype=np.int8).reshape(6, 17), 0.05, (-1e-7, 2.0, 0.1))
def test_a_grid_that_is_saved_is_read_again_as_it_was(cells, resolution, origin):
    grid = OccupancyGrid(cells, resolution, origin)
    read = decode_map_server(*encode_map_server(grid, "the map.png"))
    np.testing.assert_array_equal(read.cells, cells)
    assert (read.resolution, read.origin, read.notes) == (resolution, origin, ())


@given(
    st.text(st.characters(codec="utf-8", exclude_categories=["C", "Z"]), min_size=1),
    st.floats(1e-5, 10.0),
    st.tuples(coordinates, coordinates, coordinates),
    st.booleans(),
    st.sampled_from(["trinary", "scale", "raw"]),
)
@example("floor #2: a \N{SLICE OF PIZZA}.pgm", 0.05, (-1e-7, 2.0, 0.1), True, "raw")
def test_a_header_that_is_written_is_read_again_as_it_was(name, resolution, origin, negate, mode):
    header = MapServerHeader(resolution, origin, negate, 0.65, 0.25, mode)
    assert parse_header(header.text(name)) == header
    assert parse(header.text(name)).values["image"] == name


def test_a_saved_map_is_dark_at_walls_and_unknown_to_ros_1_where_it_is_transparent():
    text, picture = encode_map_server(OccupancyGrid(np.array([[-1, 0], [50, 100]]), 0.25))
    seen = PIL.Image.open(io.BytesIO(picture))
    assert (seen.format, seen.mode) == ("PNG", "LA")
    assert np.asarray(seen).tolist() == [[[128, 255], [0, 255]], [[128, 0], [255, 255]]]
    assert text == (
        'image: "map.png"\nmode: scale\nresolution: 0.25\norigin: [0.0, 0.0, 0.0]\nnegate: 0\n'
        "occupied_thresh: 1.0\nfree_thresh: 0.0\n"
    )


def test_numbers_that_yaml_takes_for_strings_are_numbers():
    for text in ("5e-2", "'0.05'"):
        assert decode_map_server(yaml_text(resolution=text), pgm([[0]])).resolution == 0.05


def test_keys_of_other_tools_are_ignored():
    assert decode_map_server(yaml_text(author="me"), pgm([[0]])).cells.shape == (1, 1)


@pytest.mark.parametrize("yaw", [".nan", "nan", "-nan", "NaN", "-.nan"])
def test_a_yaw_of_nan_is_0_and_noted(yaw):
    grid = decode_map_server(yaml_text(origin=f"[1, 2, {yaw}]"), pgm([[0]]))
    assert grid.origin == (1.0, 2.0, 0.0)
    assert grid.notes == ("the yaw of the map's origin is nan and was read as 0",)


def with_greys(**shares):
    """Return greys, g205=30 in percent, and white in the rest of a hundred cells."""
    greys = np.full((10, 10), 254, np.uint8)
    start = 0
    for name, share in shares.items():
        greys.flat[start : start + share] = int(name[1:])
        start += share
    return greys


@pytest.mark.parametrize(
    ("greys", "changes", "unknown", "words"),
    [
        (
            with_greys(g205=30),
            {"free_thresh": 0.25},
            30,
            "30% of the map has the grey 205, .* 0.25",
        ),
        (with_greys(g205=30, g0=5), {"free_thresh": 0.2}, 30, "set keep_unknown to false"),
        (with_greys(g205=30), {}, 30, None),
        # Others than 205 are what the thresholds say, and so is one cell in 200.
        (with_greys(g204=30, g206=30), {"free_thresh": 0.25}, 0, None),
        (np.tile(with_greys(g205=1), 2)[:, 1:], {"free_thresh": 0.25}, 0, None),
        # No other cell is free: whoever drew this map has no other free grey.
        (with_greys(g205=90, g0=10), {"free_thresh": 0.25}, 0, None),
        (with_greys(g205=30), {"free_thresh": 0.25, "mode": "scale"}, 0, None),
        (with_greys(g205=30), {"free_thresh": 0.25, "mode": "raw"}, 100, None),
        (255 - with_greys(g205=30), {"free_thresh": 0.25, "negate": 1}, 30, "has the grey 50,"),
        (with_greys(g205=30), {"free_thresh": 0.25, "negate": 1}, 0, None),
    ],
)
def test_many_cells_of_the_grey_that_map_saver_writes_for_unknown_are_unknown(
    greys, changes, unknown, words
):
    grid = decode_map_server(yaml_text(**changes), pgm(greys))
    assert np.count_nonzero(grid.cells == -1) == unknown
    assert len(grid.notes) == (words is not None)
    if words is not None:
        assert re.search(words, grid.notes[0])


def test_a_trinary_map_keeps_the_shades_that_its_thresholds_were_applied_to(tmp_path):
    grid = decode_map_server(yaml_text(free_thresh=0.25), pgm([[0, 204, 254], [205, 205, 255]]))
    assert grid.cells.tolist() == [[-1, -1, 0], [100, 0, 0]]
    assert grid.picture.shades.tolist() == [[50, 50, 0], [255, 51, 1]]
    assert grid.picture.free().tolist() == [[True, True, True], [False, True, True]]
    assert grid.picture.free(0.2).tolist() == [[True, True, True], [False, False, True]]
    assert grid.picture.free(0.19).tolist() == [[False, False, True], [False, False, True]]
    negated = decode_map_server(yaml_text(negate=1), pgm([[0, 50]]))
    assert negated.picture.shades.tolist() == [[0, 50]]
    pixels = np.array([[[255, 255, 255, 255], [255, 255, 255, 9]]], np.uint8)
    data = encoded(PIL.Image.fromarray(pixels), "png", tmp_path)
    assert decode_map_server(yaml_text(), data).picture.shades.tolist() == [[0, 255]]
    for mode in ("scale", "raw"):
        assert decode_map_server(yaml_text(mode=mode), pgm([[0]])).picture is None


@pytest.mark.parametrize(
    ("key", "written", "same"),
    [
        ("mode", "Trinary", "trinary"),
        ("mode", "SCALE", "scale"),
        ("mode", "'raw'", "raw"),
        ("mode", "", "trinary"),
        ("negate", "'0'", 0),
        ("negate", '"1"', 1),
        ("negate", "no", 0),
        ("negate", "On", 1),
        ("negate", "TRUE", 1),
        ("resolution", "+5E-2", 0.05),
        ("resolution", "!!float 0.05", 0.05),
        ("resolution", ".05", 0.05),
        # Neither octal nor base 60, as YAML 1.1 would have it.
        ("resolution", "010", 10),
        ("occupied_thresh", "1.", 1),
    ],
)
def test_values_are_read_as_map_server_reads_them(key, written, same):
    greys = pgm([[0, 40, 100, 205, 254]])
    grid, expected = (decode_map_server(yaml_text(**{key: v}), greys) for v in (written, same))
    assert grid.cells.tolist() == expected.cells.tolist()
    assert grid.resolution == expected.resolution


def test_a_byte_order_mark_is_no_part_of_a_key():
    assert decode_map_server("\ufeff" + yaml_text(), pgm([[0]])).cells.tolist() == [[100]]


def test_of_a_key_that_stands_twice_the_first_counts_and_is_noted():
    text = (
        yaml_text()
        + "resolution: 0.1\nnegate: 0\nauthor: me\nauthor: you\ndesk: {mode: 1, mode: 2}\n"
    )
    grid = decode_map_server(text, pgm([[0]]))
    assert grid.resolution == 0.05
    assert set(parse(text).repeated) == {"resolution", "author"}
    assert grid.notes == ("the map's YAML has resolution twice, and the first, '0.05', was used",)


def test_of_several_documents_the_first_counts():
    assert decode_map_server(yaml_text() + "---\na: [\n", pgm([[0]])).resolution == 0.05


def test_values_may_repeat_each_other_but_not_themselves():
    text = yaml_text(resolution="&r 0.05", author="*r")
    assert decode_map_server(text, pgm([[0]])).resolution == 0.05
    for text in (yaml_text(author="&a [*a]"), yaml_text(author="*b")):
        with pytest.raises(InvalidInputError, match=r"write it out|is not YAML"):
            decode_map_server(text, pgm([[0]]))


def test_a_merge_key_brings_in_keys_that_are_not_there():
    text = "base: &b {negate: 1, resolution: 7, free_thresh: 0.196}\nmore: &m {negate: 0}\n"
    text += yaml_text(negate="left out", free_thresh="left out") + "<<: [*b, *m]\n"
    grid = decode_map_server(text, pgm([[0, 255]]))
    assert grid.cells.tolist() == [[0, 100]]
    assert (grid.resolution, grid.notes) == (0.05, ())
    with pytest.raises(InvalidInputError, match=r"negate is missing"):
        decode_map_server(text.replace("<<: [*b, *m]", "<<: 3"), pgm([[0]]))


LANDMARKS = """
home: { gotopose: [ 0, 0, 0 ] }
box1: { type: 'box', pose: [ 4.0, -4.7, 0, 0 ], light: { name: 'lamp', pose: [9, 9] } }
desk: { type: furniture, pose: { x: 1.5, y: 2, theta: 0 } }
semantic:
  objects:
    - { name: "plant ü", position: { x: 1, y: -2e0, z: 0 } }
    - { label: sofa, pose: { position: { x: 3, y: 4 }, orientation: { w: 1 } } }
    - { name: stool, x: 5, y: 6 }
  rooms: { kitchen: { type: room, centroid: [7, 8] } }
start: { pose: [.nan, 0] }
ending: { pose: near }
"""


def test_what_a_map_names_with_a_pose_are_its_landmarks():
    grid = decode_map_server(yaml_text() + LANDMARKS, pgm([[0]]))
    assert [(item.name, item.point, item.kind) for item in grid.landmarks] == [
        ("box1", (4.0, -4.7), "box"),
        ("desk", (1.5, 2.0), "furniture"),
        ("plant ü", (1.0, -2.0), ""),
        ("sofa", (3.0, 4.0), ""),
        ("stool", (5.0, 6.0), ""),
        ("kitchen", (7.0, 8.0), "room"),
    ]


def test_a_thousand_landmarks_are_enough_and_one_counts_once():
    listed = ", ".join(f"{{name: n, x: {k % 1002}, y: 0}}" for k in range(1500))
    grid = decode_map_server(yaml_text(all=f"[{listed}]"), pgm([[0]]))
    assert [item.point[0] for item in grid.landmarks] == list(range(1000))
    assert grid.notes == ("only the first 1000 named places of the map's YAML count",)
    fewer = decode_map_server(
        yaml_text(all=f"[{listed.split(', {name: n, x: 1000')[0]}]"), pgm([[0]])
    )
    assert (len(fewer.landmarks), fewer.notes) == (1000, ())


BAD_YAML = {
    "image is missing": ({"image": "left out"}, "image", "add it"),
    "resolution is missing": ({"resolution": "left out"}, "resolution", "'resolution: 0.05'"),
    "resolution is null": ({"resolution": "null"}, "resolution", "is missing"),
    "resolution is 0": ({"resolution": 0}, "resolution", "is 0; give the metres per cell"),
    "resolution is negative": ({"resolution": -0.1}, "resolution", "is -0.1; give the metres"),
    "resolution is nan": ({"resolution": ".nan"}, "resolution", "is nan; give a finite number"),
    "resolution is a word": ({"resolution": "fine"}, "resolution", "is 'fine'; give a finite"),
    "resolution is true": ({"resolution": "true"}, "resolution", "is 'true'; give a finite number"),
    "resolution is huge": ({"resolution": "1" * 400}, "resolution", "give a finite number"),
    "origin is short": ({"origin": [0, 0]}, "origin", "give [x, y, yaw]"),
    "origin is no list": ({"origin": 3}, "origin", "give [x, y, yaw]"),
    "origin is nan": ({"origin": "[0, .nan, 0]"}, "origin[1]", "is nan; give a finite number"),
    "yaw is infinite": ({"origin": "[0, 0, .inf]"}, "origin[2]", "is inf; give a finite number"),
    "negate is 2": ({"negate": 2}, "negate", "is 2; give 0"),
    "threshold out of range": ({"occupied_thresh": 65}, "occupied_thresh", "a share from 0 to 1"),
    "thresholds swapped": ({"free_thresh": 0.7}, "free_thresh", "not below occupied_thresh 0.65"),
    "free_thresh is missing": ({"free_thresh": "left out"}, "free_thresh", "add it"),
    "occupied_thresh is missing": ({"occupied_thresh": "left out"}, "occupied_thresh", "add it"),
    "negate is missing": ({"negate": "left out"}, "negate", "add it"),
    "mode unknown": ({"mode": "binary"}, "mode", "is 'binary'; give trinary, scale or raw"),
    "image is a list": ({"image": "[a.pgm]"}, "image", "give the picture's path"),
    "image is blank": ({"image": "' '"}, "image", "give the picture's path"),
    "resolution in hexadecimal": ({"resolution": "0x10"}, "resolution", "is '0x10'; give a finite"),
    "resolution as Python has it": ({"resolution": "1_0"}, "resolution", "is 10; give a finite"),
}


@pytest.mark.parametrize("case", BAD_YAML)
def test_a_wrong_key_is_named_with_the_remedy(case):
    changes, field, words = BAD_YAML[case]
    with pytest.raises(InvalidInputError) as caught:
        decode_map_server(yaml_text(**changes), pgm([[0]]))
    assert caught.value.field == f"yaml.{field}"
    assert caught.value.reason == Reason.INVALID_GRID
    assert words in caught.value.problem


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is not a list of keys and values"),
        ("- 1\n- 2", "is not a list of keys and values"),
        ("a: [1, 2", "is not YAML (line 1)"),
        ("a: b: c", "is not YAML (line 1)"),
        ("a: !!python/object:os.system x", "has types written with '!'; give plain values"),
        ("x: \0", "is not YAML"),
        ("[" * 60_000, "has lists nested more than 20 deep"),
        ("{a: " * 10_000, "has lists nested more than 20 deep"),
    ],
)
def test_text_that_is_no_header_is_refused(text, words):
    with pytest.raises(InvalidInputError, match=r"give (the file that map_server|plain)") as caught:
        decode_map_server(text, pgm([[0]]))
    assert caught.value.field == "yaml"
    assert words in caught.value.problem


def png(width, height, data):
    header = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    chunks = [header, b"IDAT" + zlib.compress(data), b"IEND"]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(chunk) - 4) + chunk + struct.pack(">I", zlib.crc32(chunk))
        for chunk in chunks
    )


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (pgm(np.zeros((9, 9)))[:-1], "is damaged or cut short"),
        (b"P2\n3 2\n255\n0 1 2 3 4\n", "is damaged or cut short"),
        (b"P2\n3 1\n255\n0 x 2\n", "is damaged or cut short"),
        (b"P5\n3", "is damaged or cut short"),
        (b"P5\n0 3\n255\n", "is not a picture"),
        (b"", "is not a picture; give a PNG, JPEG, WebP, GIF, BMP, TIFF or PGM file"),
        (b"image: map.pgm", "is not a picture"),
    ],
)
def test_a_broken_picture_is_refused(data, words):
    with pytest.raises(InvalidInputError) as caught:
        decode_map_server(yaml_text(), data)
    assert (caught.value.field, caught.value.reason) == ("image", Reason.INVALID_IMAGE)
    assert words in caught.value.problem


@pytest.mark.parametrize(
    "data",
    [
        b"P5\n9000 9000\n255\n",
        b"P5\n10000 10000\n255\n",
        b"P5\n2000000 2000000\n255\n",
        png(100_000, 100_000, b""),
    ],
)
def test_a_small_file_cannot_announce_a_huge_picture(data):
    with pytest.raises(InvalidInputError, match="the limit of 64 million pixels") as caught:
        decode_map_server(yaml_text(), data)
    assert (caught.value.field, caught.value.reason) == ("image", Reason.LIMIT_EXCEEDED)


def write_map(folder, text, picture=None):
    (folder / "map.yaml").write_text(text)
    if picture is not None:
        (folder / "map.pgm").write_bytes(picture)
    return folder / "map.yaml"


def test_the_picture_lies_beside_the_yaml_file(tmp_path, monkeypatch):
    path = write_map(tmp_path, yaml_text(), pgm([[0, 254]]))
    monkeypatch.chdir("/")
    grid = read_source(path)
    assert isinstance(grid, OccupancyGrid)
    assert grid.cells.tolist() == [[100, 0]]


def test_a_fault_in_a_file_names_file_and_key(tmp_path):
    path = write_map(tmp_path, yaml_text(resolution=0), pgm([[0]]))
    with pytest.raises(InvalidInputError) as caught:
        read_source(path)
    remedy = "resolution is 0; give the metres per cell as a positive number"
    assert str(caught.value) == f"{path}: {remedy}"


def test_a_missing_picture_names_both_files(tmp_path):
    path = write_map(tmp_path, yaml_text())
    with pytest.raises(InvalidInputError) as caught:
        read_source(path)
    picture = tmp_path / "map.pgm"
    assert str(caught.value) == f"{path}: image {picture} does not exist; check the path"


def test_a_truncated_picture_names_the_yaml_and_the_key(tmp_path):
    path = write_map(tmp_path, yaml_text(), pgm(np.zeros((4, 4)))[:-3])
    with pytest.raises(InvalidInputError, match="is damaged or cut short") as caught:
        read_source(path)
    assert caught.value.field == f"{path}: image"


@pytest.mark.parametrize(
    ("name", "shape", "counts"),
    [
        ("turtlebot3/map.yaml", (384, 384), (138722, 7939, 795)),
        ("nav2-depot/depot.yaml", (307, 604), (8894, 170587, 5947)),
        ("elsabot-downstairs/downstairs.yaml", (397, 292), (79631, 31435, 4858)),
        ("husky-playpen/playpen_map.yaml", (1984, 1984), (3784308, 149150, 2798)),
        ("pmb2-small-office/map.yaml", (297, 204), (3286, 43575 + 11114, 2613)),
    ],
)
def test_real_maps_have_the_cells_that_their_greys_say(name, shape, counts):
    path = ROOT.parent / "shared" / "data" / "ogm" / name
    require(path.exists(), f"the real map {name}")
    grid = read_source(path)
    assert grid.cells.shape == shape
    assert tuple(int((grid.cells == value).sum()) for value in (-1, 0, 100)) == counts
