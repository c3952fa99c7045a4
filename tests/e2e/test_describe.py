"""``sketchmatch describe`` and ``sketchmatch relate``."""

import csv
import json
import math
import signal

import numpy as np
import PIL.Image
import pytest

from sketchmatch import directional_relation, force_histogram, match, read_scene
from sketchmatch.cli.app import ExitCode
from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH
from sketchmatch.pipeline.warmup import warm_up
from sketchmatch.registry import default_registry
from tests.processes import Terminal
from tests.processes import sketchmatch as run

ROOM = (LIVING_ROOM_SKETCH, LIVING_ROOM_MAP)
ESCAPE = "\x1b"


@pytest.fixture(scope="module", autouse=True)
def _warm():
    # On a new machine the kernels compile here, and no command says that it compiles them.
    warm_up(default_registry())


def geojson(path, *polygons):
    shapes = [{"type": "Polygon", "coordinates": [ring]} for ring in polygons]
    path.write_text(json.dumps({"type": "GeometryCollection", "geometries": shapes}))
    return path


def box(x, y, width=2, height=2):
    return [[x, y], [x + width, y], [x + width, y + height], [x, y + height], [x, y]]


@pytest.fixture
def boxes(tmp_path):
    """Return a file of three boxes: one, one to its right, one above it."""
    return geojson(tmp_path / "boxes.geojson", box(0, 0), box(7, 0), box(0, 9))


def lines(done):
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    assert ESCAPE not in done.stdout
    return [line.split("\t") for line in done.stdout.splitlines()]


def document(done):
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    return json.loads(done.stdout)


# describe ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_pipe_gets_a_line_for_each_pair_counted_from_0(boxes):
    head, *rows = lines(run("describe", boxes))
    assert head == ["a", "b", "phrase", "degree", "a_label", "b_label"]
    assert [row[:3] for row in rows] == [
        ["0", "1", "to the left of"],
        ["0", "2", "below"],
        ["1", "2", "to the right of and below"],
    ]
    assert all(0.9 < float(row[3]) <= 1 for row in rows)


def test_labels_come_with_the_pairs(command_line):
    _, *rows = lines(command_line("describe", LIVING_ROOM_SKETCH))
    assert len(rows) == 28
    assert rows[0][4:] == ["sideboard", "round table"]


@pytest.mark.slow
def test_a_terminal_gets_a_table_counted_from_1():
    terminal = Terminal("describe", LIVING_ROOM_SKETCH)
    assert terminal.end()[0] == 0
    assert "describing relations" in terminal.shown
    assert "28 relations of 8 objects, by constant" in terminal.shown
    assert "coffee table" in terminal.shown
    assert "to the right of and below" in terminal.shown


def test_json_is_one_document(command_line):
    found = document(
        command_line("describe", LIVING_ROOM_SKETCH, "--json", "--set", "histogram.directions=360")
    )
    assert found["histogram"] == {"name": "constant", "parameters": {"directions": 360}}
    assert found["segmenter"]["name"] == "strokes"
    scene = read_scene(LIVING_ROOM_SKETCH)
    assert tuple(found["labels"]) == scene.labels
    assert len(found["relations"]) == 28
    for line in found["relations"][:5]:
        a, b = (scene.objects[line["pair"][side]] for side in ("first", "second"))
        row = force_histogram(a, b, directions=360)
        expected = directional_relation(row)
        assert line["phrase"] == expected.phrase
        assert line["degree"] == pytest.approx(expected.degree, abs=1e-9)
        assert line["directionRadians"] == expected.direction
        angles = 2 * np.pi * np.arange(360) / 360
        main = math.atan2(row @ np.sin(angles), row @ np.cos(angles))
        assert line["mainDirectionRadians"] == pytest.approx(main, abs=1e-9)


def test_chosen_pairs_are_described_in_their_order_each_from_its_second(command_line, boxes):
    chosen = ("--pair", "2,1", "--pair", "1,3")
    _, *rows = lines(command_line("describe", boxes, *chosen))
    assert [row[:3] for row in rows] == [["1", "0", "to the right of"], ["0", "2", "below"]]


def test_a_ring_is_in_no_clear_direction_from_what_it_surrounds(command_line, tmp_path):
    ring = {"type": "Polygon", "coordinates": [box(-5, -5, 12, 12), box(-4, -4, 10, 10)[::-1]]}
    inner = {"type": "Polygon", "coordinates": [box(0, 0)]}
    path = tmp_path / "ring.geojson"
    path.write_text(json.dumps({"type": "GeometryCollection", "geometries": [ring, inner]}))
    picture = tmp_path / "ring.png"
    (line,) = document(command_line("describe", path, "--json", "--plot", picture))["relations"]
    assert line["phrase"] == "in no clear direction from"
    assert line["directionRadians"] is None
    assert picture.exists()


def test_out_saves_an_archive_or_a_table_of_the_same_numbers(command_line, boxes, tmp_path):
    chosen = ("--pair", "2,1", "--pair", "1,3")
    for name in ("x.npz", "x.csv"):
        lines(command_line("describe", boxes, *chosen, "--out", tmp_path / name))
    with np.load(tmp_path / "x.npz", allow_pickle=False) as found:
        assert found["pairs"].tolist() == [[1, 0], [0, 2]]
        assert found["histograms"].shape == (2, 180)
        assert found["labels"].tolist() == ["", "", ""]
        assert str(found["histogram"]) == "constant"
        expected = force_histogram(box(7, 0), box(0, 0))
        np.testing.assert_allclose(found["histograms"][0], expected, atol=1e-9)
        rows = found["histograms"]
    with (tmp_path / "x.csv").open(encoding="utf-8", newline="") as file:
        _, *table = csv.reader(file)
    assert (np.array([row[4:] for row in table], dtype=float) == rows).all()


@pytest.mark.slow
def test_plot_draws_the_scene_and_its_histograms(command_line, tmp_path):
    for source in ROOM:
        done = command_line("describe", source, "--plot", tmp_path / "x.png")
        assert (done.returncode, len(done.stdout.splitlines())) == (0, 29)
        assert done.stderr == (
            "sketchmatch: --plot draws the 16 of 28 relations with the strongest forces, as "
            "between large objects close together; choose others by --pair A,B\n"
        )
        with PIL.Image.open(tmp_path / "x.png") as picture:
            assert (picture.format, picture.width) == ("PNG", 1600)
            assert len(picture.getcolors(10**6)) > 50


@pytest.mark.slow
def test_a_plot_of_all_relations_says_nothing(boxes, tmp_path):
    assert len(lines(run("describe", boxes, "--plot", tmp_path / "x.png"))) == 4


# relate -----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_relate_lists_the_most_similar_first():
    head, *rows = lines(run("relate", *ROOM))
    assert head[:7] == ["a", "b", "c", "d", "similarity", "rotation_degrees", "dilation"]
    assert len(rows) == 20
    sigma = [float(row[4]) for row in rows]
    assert sigma == sorted(sigma, reverse=True)
    assert rows[0][7]


@pytest.mark.slow
def test_relate_shows_a_table_on_a_terminal():
    terminal = Terminal("relate", *ROOM, "--limit", "3")
    assert terminal.end()[0] == 0
    assert "comparing relations" in terminal.shown
    assert "3 of 784 comparisons, by cross-correlation of constant" in terminal.shown
    assert "°" in terminal.shown


@pytest.mark.parametrize("exchanged", [False, True])
def test_relate_says_of_the_entries_of_a_match_what_the_match_says(
    command_line, tmp_path, exchanged
):
    few = geojson(tmp_path / "few.geojson", box(0, 0), box(9, 1, 3, 2), box(2, 8, 1, 4))
    rings = (box(1, 1), box(12, 1, 3, 2), box(2, 12, 1, 4), box(20, 15, 4, 4))
    many = geojson(tmp_path / "many.geojson", *([[-y, x] for x, y in ring] for ring in rings))
    files = (many, few) if exchanged else (few, many)
    for entry in match(*files).fmap:
        (a, b), (c, d) = entry.sketch_pair, entry.map_pair
        chosen = ("--sketch-pair", f"{a + 1},{b + 1}", "--map-pair", f"{c + 1},{d + 1}")
        found = document(command_line("relate", *files, *chosen, "--json"))
        assert found["comparisonCount"] == 1
        (line,) = found["comparisons"]
        assert line["sketchPair"] == {"first": a, "second": b}
        assert line["mapPair"] == {"first": c, "second": d}
        assert line["similarity"] == pytest.approx(entry.similarity, abs=1e-12)
        assert line["dilation"] == pytest.approx(entry.dilation, rel=1e-12)
        apart = math.remainder(line["rotationRadians"] - entry.rotation, math.tau)
        assert apart == pytest.approx(0.0, abs=1e-9)


def test_the_dual_of_one_pair_is_turned_by_half(command_line, boxes):
    pairs = ("--sketch-pair", "1,2", "--map-pair", "1,2", "--map-pair", "2,1")
    _, *rows = lines(command_line("relate", boxes, boxes, *pairs))
    assert [row[:7] for row in rows] == [
        ["0", "1", "0", "1", "1.0000", "0.00", "1"],
        ["0", "1", "1", "0", "1.0000", "180.00", "1"],
    ]


def test_relate_takes_algorithms_and_their_parameters(command_line):
    options = ("--similarity", "cross-correlation", "--histogram", "constant", "--limit", "1")
    sets = ("--set", "map_segmenter.min_size=0.45", "--set", "histogram.directions=90")
    found = document(command_line("relate", *ROOM, *options, *sets, "--json"))
    assert found["histogram"]["parameters"] == {"directions": 90}
    assert len(found["mapLabels"]) < 8
    assert len(found["comparisons"]) == 1


# What is typed wrong ----------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["describe"], ["SCENE", "--help"]),
        (["describe", "missing.svg"], ["missing.svg does not exist"]),
        (["describe", LIVING_ROOM_MAP, "--pair", "1,9"], ["--pair '1,9'", "object 9", "1 … 8"]),
        (["describe", LIVING_ROOM_MAP, "--pair", "0,1"], ["--pair '0,1'", "object 0", "1 … 8"]),
        (["describe", LIVING_ROOM_MAP, "--pair", "2,2"], ["--pair '2,2'", "one object twice"]),
        (["describe", LIVING_ROOM_MAP, "--pair", "2"], ["--pair '2'", "as in 3,1"]),
        (["describe", LIVING_ROOM_MAP, "--pair", "a,b"], ["--pair 'a,b'", "as in 3,1"]),
        (["describe", "missing.svg", "--out", "x.txt"], ["--out", "x.txt", ".npz or .csv"]),
        (["describe", "missing.svg", "--out", "no/x.npz"], ["--out", "no folder 'no'"]),
        (["describe", "missing.svg", "--plot", "x.svg"], ["--plot", "x.svg", ".png"]),
        (["describe", LIVING_ROOM_MAP, "--histogram", "best"], ["histogram.name is 'best'"]),
        (["describe", LIVING_ROOM_MAP, "--set", "searcher.x=1"], ["use segmenter.… or histogram"]),
        (["describe", LIVING_ROOM_MAP, "--set", "histogram.directions=5"], ["is 5", "multiple"]),
        (["describe", LIVING_ROOM_MAP, "--segmenter", "strokes"], ["occupancy-grid"]),
        (["relate", LIVING_ROOM_SKETCH], ["MAP", "--help"]),
        (["relate", "missing.svg", LIVING_ROOM_MAP], ["missing.svg does not exist"]),
        (["relate", *ROOM, "--sketch-pair", "9,1"], ["--sketch-pair '9,1'", "sketch has", "1 … 8"]),
        (["relate", *ROOM, "--map-pair", "1,99"], ["--map-pair '1,99'", "map has", "1 … 8"]),
        (["relate", *ROOM, "--map-pair", "1,1"], ["--map-pair '1,1'", "one object twice"]),
        (["relate", *ROOM, "--limit", "0"], ["--limit", "--help"]),
        (["relate", *ROOM, "--similarity", "best"], ["similarity.name is 'best'"]),
        (["relate", *ROOM, "--set", "searcher.x=1"], ["'searcher' is not a stage here"]),
    ],
    ids=lambda value: " ".join(str(part).rpartition("/")[2] for part in value)[-50:],
)
def test_what_is_typed_wrong_gets_exit_code_2_and_one_line(command_line, arguments, words):
    done = command_line(*arguments)
    assert (done.stdout, done.returncode) == ("", ExitCode.INVALID_INPUT), done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith("sketchmatch: ")
    assert all(word in line for word in words), line


def test_a_fault_inside_a_file_is_told_with_its_place(command_line, tmp_path):
    path = geojson(tmp_path / "bow.geojson", [[0, 0], [2, 2], [2, 0], [0, 2], [0, 0]], box(5, 5))
    for arguments in (["describe", path], ["relate", path, path]):
        done = command_line(*arguments)
        assert done.returncode == ExitCode.INVALID_INPUT
        assert f"{path}: polygons[0]" in done.stderr


@pytest.mark.parametrize(("option", "name"), [("--out", "x.csv"), ("--plot", "x.png")])
def test_a_target_that_cannot_be_written_is_exit_code_2(command_line, boxes, option, name):
    target = boxes.parent / name
    target.mkdir()
    done = command_line("describe", boxes, option, target)
    assert done.returncode == ExitCode.INVALID_INPUT
    assert f"{option} cannot be written" in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.slow
@pytest.mark.parametrize("command", ["describe", "relate"])
def test_ctrl_c_ends_a_long_one_soon(tmp_path, command):
    spots = [(5 * (k % 18), 5 * (k // 18)) for k in range(320)]
    crowd = geojson(tmp_path / "crowd.geojson", *(box(x, y) for x, y in spots))
    few = geojson(tmp_path / "few.geojson", box(0, 0), box(9, 1, 3, 2), box(2, 8, 1, 4))
    files = [crowd] if command == "describe" else [few, crowd]
    terminal = Terminal(command, *files, "--set", "histogram.directions=900")
    terminal.wait_for("describing")
    terminal.process.send_signal(signal.SIGINT)
    assert terminal.end()[0] == ExitCode.INTERRUPTED
    assert "Traceback" not in terminal.shown
    assert terminal.shown.rstrip().endswith("sketchmatch: interrupted")


def test_help_says_how_objects_are_counted(command_line):
    for command in ("describe", "relate"):
        text = " ".join(command_line(command, "--help").stdout.replace("│", " ").split())
        assert "numbered from 1 as in tables and pictures" in text
        assert "number them from 0" in text
