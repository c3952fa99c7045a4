import json
import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from google.protobuf.json_format import Parse

import sketchmatch
from sketchmatch.app.application import Application
from sketchmatch.cli.app import ExitCode
from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH
from sketchmatch_client import Client
from sketchmatch_proto.v1 import match_pb2
from sketchmatch_proto.v1.catalog_service_pb2 import Algorithm, ListAlgorithmsResponse
from sketchmatch_proto.v1.match_pb2 import MatchResult
from sketchmatch_proto.v1.scene_service_pb2 import SegmentResponse
from tests import processes
from tests.pace import within
from tests.processes import Terminal
from tests.processes import sketchmatch as run
from tests.server.harness import scene

ROOM = (LIVING_ROOM_SKETCH, LIVING_ROOM_MAP)
LONG = (
    "--searcher",
    "easm",
    "--set",
    "searcher.patience=10000000",
    "--set",
    "searcher.generations=10000000",
)
LONG += ("--time-budget", "20")  # no command outlives its test, whatever fails to stop it
ESCAPE = "\x1b"


@pytest.fixture(params=["in process", "server"])
def where(request):
    """Yield the options with which a command computes here, or asks a server."""
    if request.param == "in process":
        return []
    return ["--server", request.getfixturevalue("address")]


def geojson(path, *polygons):
    shapes = [{"type": "Polygon", "coordinates": [ring]} for ring in polygons]
    path.write_text(json.dumps({"type": "GeometryCollection", "geometries": shapes}))
    return path


@pytest.fixture
def uneven(tmp_path):
    """Return a file of four polygons and one of the first three of them."""
    four = [
        [[0, 0], [2, 0], [2, 2], [0, 2]],
        [[5, 0], [9, 0], [9, 3]],
        [[0, 6], [6, 6], [6, 7]],
        [[8, 9], [11, 9], [9, 12]],
    ]
    return geojson(tmp_path / "four.geojson", *four), geojson(tmp_path / "three.geojson", *four[:3])


def tables(done) -> list[list[list[str]]]:
    """Return the cells of the tables that a pipe gets, one for each block of lines."""
    assert (done.returncode, done.stderr) == (0, "")
    blocks = done.stdout.rstrip("\n").split("\n\n")
    return [[line.split("\t") for line in block.splitlines()] for block in blocks]


def result(done) -> MatchResult:
    assert done.returncode == 0, done.stderr
    return Parse(done.stdout, MatchResult())


# match ------------------------------------------------------------------------------------------


def test_json_is_the_contracts_message_and_the_same_in_process_and_from_a_server(
    command_line, address
):
    here = command_line("match", *ROOM, "--json", "--seed", "5")
    there = command_line("match", *ROOM, "--json", "--seed", "5", "--server", address)
    answers = [json.loads(done.stdout) for done in (here, there)]
    assert result(here).match_id
    for answer in answers:
        answer.pop("matchId")
        for name in [name for name in answer["statistics"] if name.endswith("Elapsed")]:
            answer["statistics"].pop(name)
    assert answers[0] == answers[1]
    assert answers[0]["seed"] == "5"


def test_json_tells_how_each_sketched_object_lies_to_another(command_line, where):
    lines = result(command_line("match", *ROOM, *where, "--json")).object_matches
    for line in lines:
        assert line.relation.reference_object in {other.sketch_object for other in lines}
        assert line.relation.phrase
        assert 0 <= line.relation.degree <= 1


def test_json_writes_out_index_0_and_empty_lists(command_line):
    answer = json.loads(command_line("match", *ROOM, "--json").stdout)
    assert answer["objectMatches"][0]["sketchObject"] == 0
    assert answer["unmatchedMapObjects"] == []


@pytest.mark.slow
def test_a_pipe_gets_tab_separated_lines_and_nothing_else(where):
    done = run("match", *ROOM, *where)
    assert done.returncode == 0
    assert done.stderr == ""
    head, *lines = [line.split("\t") for line in done.stdout.splitlines()]
    assert head == [
        "sketch_object",
        "map_object",
        "confidence",
        "sketch_label",
        "map_label",
        "probability",
    ]
    assert [line[0] for line in lines] == [str(k) for k in range(8)]
    assert sorted(line[1] for line in lines) == [str(k) for k in range(8)]
    assert all(0 < float(line[2]) <= 1 for line in lines)
    assert lines[0][3] == "sideboard"
    assert ESCAPE not in done.stdout


@pytest.mark.slow
def test_a_terminal_shows_the_search_while_it_runs_and_then_a_table(where):
    terminal = Terminal("match", *ROOM, *where, *LONG, "--time-budget", "5")
    terminal.wait_for("searching")
    terminal.wait_for("ζ 0.")
    terminal.wait_for("best so far: 1→")
    code, _ = terminal.end()
    assert code == 0
    assert re.search(r"iteration \d+ .* \d+ evaluations", terminal.shown)
    assert "8 of 8 sketched objects matched" in terminal.shown
    assert "sideboard" in terminal.shown
    assert "stopped by the time budget after" in terminal.shown
    assert "to the left of round table" in terminal.shown, "the piano, in the sketch"


@pytest.mark.slow
@pytest.mark.parametrize("command", ["segment", "match", "describe"])
def test_a_label_that_looks_like_markup_is_shown_as_it_is(command, tmp_path):
    def feature(name, x, size):
        ring = [[x, 0], [x + size, 0], [x + size, 1], [x, 1 + size]]
        shape = {"type": "Polygon", "coordinates": [ring]}
        return {"type": "Feature", "properties": {"name": name}, "geometry": shape}

    file = tmp_path / "office.geojson"
    features = [feature("[red]desk[/red]", 0, 1), feature("[b]", 4, 2), feature("[/]", 9, 1)]
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    terminal = Terminal(command, *(file,) * (2 if command == "match" else 1))
    assert terminal.end()[0] == ExitCode.OK
    for label in ("[red]desk[/red]", "[b]", "[/]"):
        assert label in terminal.shown


@pytest.mark.slow
def test_a_pipe_stays_clean_while_the_terminal_shows_the_search():
    terminal = Terminal("match", *ROOM, *LONG, "--time-budget", "4", "--json", stdout=False)
    terminal.wait_for("searching")
    code, piped = terminal.end()
    assert code == 0
    assert ESCAPE not in piped
    assert Parse(piped, MatchResult()).outcome == match_pb2.OUTCOME_TIME_BUDGET


def test_the_overlay_is_a_picture_of_the_right_size(command_line, where, tmp_path):
    target = tmp_path / "overlay.png"
    assert command_line("match", *ROOM, *where, "--overlay", target).returncode == 0
    with PIL.Image.open(target) as picture:
        assert (picture.format, picture.mode, picture.width) == ("PNG", "RGB", 1600)
        assert 600 < picture.height < 1600
        assert len(picture.getcolors(10**6)) > 50


def test_an_overlay_that_cannot_be_written_is_refused_before_the_match(command_line, tmp_path):
    done = command_line("match", *ROOM, "--overlay", tmp_path / "missing" / "overlay.png")
    assert done.returncode == ExitCode.INVALID_INPUT
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1


def test_an_overlay_never_takes_the_place_of_what_is_read(command_line, tmp_path):
    shade = np.full((40, 60), 254, np.uint8)
    shade[10:20, 10:20] = shade[25:33, 40:52] = 0
    PIL.Image.fromarray(shade).save(tmp_path / "office.png")
    yaml = "image: office.png\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\n"
    map_ = tmp_path / "office.yaml"
    map_.write_text(f"{yaml}occupied_thresh: 0.65\nfree_thresh: 0.2\n", encoding="utf-8")
    before = (tmp_path / "office.png").read_bytes()
    for given, drawn in ((map_, "office.png"), (tmp_path, "office.png")):
        done = command_line("segment", given, "--overlay", tmp_path / drawn)
        assert done.returncode == ExitCode.INVALID_INPUT
        assert "office.png', which is read here and would be lost" in done.stderr
    assert (tmp_path / "office.png").read_bytes() == before
    for _ in range(2):  # what was drawn before may be drawn again
        done = command_line("segment", map_, "--overlay", tmp_path / "scene.png")
        assert done.returncode == 0, done.stderr


def test_the_seed_decides_the_search(command_line, where):
    random = ("--searcher", "auto", "--json", "--seed")
    same, again, other = (
        result(command_line("match", *ROOM, *where, *random, seed)) for seed in (1, 1, 2)
    )
    assert same.statistics.evaluations == again.statistics.evaluations
    assert same.fmap_entries == again.fmap_entries
    assert same.statistics.evaluations != other.statistics.evaluations


def test_set_sets_parameters_of_any_stage(command_line, where):
    sets = (
        "--searcher",
        "easm",
        "--set",
        "searcher.generations=3",
        "--set",
        "searcher.consistency=pairwise",
    )
    sets += ("--set", "map_segmenter.min_size=0.45")
    answer = result(command_line("match", *ROOM, *where, "--json", *sets))
    assert answer.outcome == match_pb2.OUTCOME_ITERATION_LIMIT
    assert answer.statistics.iterations == 3
    assert list(answer.unmatched_sketch_objects), "the plant is smaller than that"


def test_segmenters_are_chosen_by_the_names_of_their_stages(command_line, where):
    done = command_line("match", *ROOM, *where, "--map-segmenter", "strokes")
    assert done.returncode == ExitCode.INVALID_INPUT
    assert "map_segmenter.name is 'strokes', which cannot read" in done.stderr
    done = command_line("match", *ROOM, *where, "--sketch-segmenter", "image")
    assert "sketch_segmenter.name is 'image', which cannot read" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("command", ["match", "relate"])
@pytest.mark.parametrize("side", ["sketch", "map"])
def test_former_names_of_options_hold_and_are_deprecated(command_line, command, side):
    segmenter = {"sketch": "strokes", "map": "occupancy-grid"}[side]
    now = command_line(command, *ROOM, f"--{side}-segmenter", segmenter)
    former = command_line(command, *ROOM, f"--segmenter-{side}", segmenter)
    assert former.stdout == now.stdout
    assert (now.stderr, now.returncode, former.returncode) == ("", 0, 0)
    assert former.stderr == (
        f"sketchmatch: --segmenter-{side} is deprecated; use --{side}-segmenter\n"
    )
    wrong = command_line(command, *ROOM, f"--segmenter-{side}", "best")
    (line,) = wrong.stderr.splitlines()
    assert f"{side}_segmenter.name is 'best'" in line


def test_a_server_on_this_machine_is_asked_without_a_proxy(command_line, address, monkeypatch):
    monkeypatch.setenv("http_proxy", "http://127.0.0.1:9")
    done = command_line("match", *ROOM, "--server", address)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_time_budget_gives_the_best_answer_until_then(command_line, where):
    with within(2.5):
        answer = result(command_line("match", *ROOM, *where, *LONG, "--json", "--time-budget", 0.5))
    assert answer.outcome == match_pb2.OUTCOME_TIME_BUDGET
    assert len(answer.object_matches) == 8


def test_weights_weigh_the_parts_of_the_confidence(command_line, where):
    answer = result(command_line("match", *ROOM, *where, "--json", "--weights", "1,0,3"))
    parts = answer.fmap_confidence
    assert parts.total == pytest.approx((parts.similarity + 3 * parts.dilation) / 4)


def test_weights_weigh_shapes_and_sizes_too(command_line, where):
    answer = result(command_line("match", *ROOM, *where, "--json", "--weights", "1,0,3,2,1"))
    parts = answer.fmap_confidence
    weighed = parts.similarity + 3 * parts.dilation + 2 * parts.shape + parts.size
    assert parts.total == pytest.approx(weighed / 7)


def test_rotations_of_distant_pairs_count_for_more(command_line, where):
    alike, by_distance = (
        result(command_line("match", *ROOM, *where, "--json", "--weights", f"1,1,1,0,0,{power}"))
        for power in (0, 2)
    )
    assert alike.object_matches != by_distance.object_matches  # margins and confidences differ
    parts = by_distance.fmap_confidence
    assert parts.rotation > alike.fmap_confidence.rotation
    assert parts.total == pytest.approx((parts.similarity + parts.rotation + parts.dilation) / 3)


def test_fewer_and_more_objects_in_the_sketch(command_line, where, uneven):
    four, three = uneven
    fewer = result(command_line("match", three, four, *where, "--json"))
    more = result(command_line("match", four, three, *where, "--json"))
    for answer in (fewer, more):
        assert [m.sketch_object for m in answer.object_matches] == [0, 1, 2]
        assert [m.map_object for m in answer.object_matches] == [0, 1, 2]
    assert list(fewer.unmatched_map_objects) == list(more.unmatched_sketch_objects) == [3]


@pytest.mark.slow
def test_the_table_says_how_many_are_without_a_partner(uneven):
    four, three = uneven
    terminal = Terminal("match", four, three)
    assert terminal.end()[0] == 0
    assert "3 of 4 sketched objects matched, 1 in the sketch without partner" in terminal.shown
    assert "to the right of No. 1" in terminal.shown, "objects without labels go by number"


# segment, plugins -------------------------------------------------------------------------------


def test_segment_lists_the_objects_in_lines_and_in_json(command_line, where, tmp_path):
    picture = tmp_path / "scene.png"
    lines = command_line("segment", LIVING_ROOM_MAP, *where, "--overlay", picture)
    message = command_line("segment", LIVING_ROOM_MAP, *where, "--json")
    found = Parse(message.stdout, SegmentResponse())
    head, *rows = [line.split("\t") for line in lines.stdout.splitlines()]
    columns = ["object", "label", "vertices", "area", "centroid_x", "centroid_y", "certainty"]
    assert head == columns
    assert [row[0] for row in rows] == [str(k) for k in range(8)]
    assert {row[6] for row in rows} == {"1"}
    assert [float(row[3]) for row in rows] == pytest.approx(
        [item.area for item in found.scene.objects], rel=1e-5
    )
    assert found.segmenter.name == "occupancy-grid"
    with PIL.Image.open(picture) as image:
        assert (image.format, image.width) == ("PNG", 1000)


def test_parameters_say_what_is_free_on_a_robots_map(command_line, where, tmp_path):
    # A walled room with a box and, of the grey of unknown cells, a thing seen from around alone.
    rows = [[205] * 40] * 3 + [[205, 205, *[0] * 36, 205, 205]]
    rows += [[205, 205, 0, *[254] * 34, 0, 205, 205] for _ in range(30)] + rows[::-1]
    for row in rows[10:20]:
        row[8:18], row[22:32] = [205] * 10, [0] * 10
    pixels = bytes(grey for row in rows for grey in row)
    (tmp_path / "room.pgm").write_bytes(b"P5\n40 %d\n255\n" % len(rows) + pixels)
    (tmp_path / "room.yaml").write_text(
        "image: /robot/room.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: '0'\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.25\nmode: Trinary\n"
        "cupboard: {pose: [1.3, 1.1, 0]}\n"
    )
    done = command_line("segment", tmp_path, *where)
    assert done.returncode == 0
    labels = [line.split("\t")[1] for line in done.stdout.splitlines()[1:]]
    assert labels == ["", "cupboard"]
    for words in ("its map room.yaml was read", "room.pgm beside room.yaml", "the grey 205"):
        assert words in done.stderr
    options = ("--set", "segmenter.keep_unknown=false")
    done = command_line("segment", tmp_path / "room.pgm", *where, *options)
    assert "only one object" in done.stderr


def test_segment_sets_parameters_and_refuses_those_of_other_stages(command_line, where):
    few = command_line("segment", LIVING_ROOM_MAP, *where, "--set", "segmenter.min_size=0.6")
    assert 3 <= len(few.stdout.splitlines()) < 9
    done = command_line("segment", LIVING_ROOM_MAP, *where, "--set", "searcher.population=3")
    assert done.returncode == ExitCode.INVALID_INPUT
    assert "use segmenter." in done.stderr


def test_plugins_list_says_the_same_here_and_of_a_server(command_line, address):
    everywhere = ((), ("--server", address))
    here, there = (command_line("plugins", "list", "--json", *where) for where in everywhere)
    catalogue = Parse(here.stdout, ListAlgorithmsResponse())
    assert catalogue.algorithms
    assert catalogue == Parse(there.stdout, ListAlgorithmsResponse())
    here, there = (command_line("plugins", "list", *where) for where in everywhere)
    assert here.stdout == there.stdout
    algorithms, profiles, plugins, readers = tables(here)
    assert readers[0] == ["reader", "files", "distribution", "version", "summary"]
    known = {name: files for name, files, *_ in readers[1:]}
    assert known["dxf"] == ".dxf"
    assert known["excalidraw"] == ".excalidraw {type, elements}"
    head = ["kind", "name", "default", "distribution", "version", "summary", "source"]
    assert algorithms[0] == head
    for kind, name in (("searcher", "align"), ("judge", "posterior")):
        assert [kind, name, "true", "sketchmatch"] in [line[:4] for line in algorithms]
    assert len(algorithms) == 1 + len(catalogue.algorithms)
    assert profiles[0] == ["profile", "default", "summary"]
    assert plugins[0] == ["plugin", "version", "state", "reason"]
    assert ["sketchmatch", sketchmatch.__version__, "active", ""] in plugins


def test_plugins_list_takes_one_kind(command_line, where):
    algorithms, *_ = tables(command_line("plugins", "list", *where, "--kind", "similarity"))
    assert {line[0] for line in algorithms} == {"kind", "similarity"}
    assert len(algorithms) == 6


@pytest.mark.slow
def test_plugins_list_shows_parameters_on_a_terminal():
    terminal = Terminal("plugins", "list")
    assert terminal.end()[0] == 0
    assert "mutation_rate = 0.3" in terminal.shown
    assert "cell_angle = 24 °" in terminal.shown


def test_plugins_show_is_what_the_catalogue_says_of_one(command_line, where):
    shown = Parse(command_line("plugins", "show", "rooms", *where, "--json").stdout, Algorithm())
    listed = Parse(
        command_line("plugins", "list", *where, "--json").stdout, ListAlgorithmsResponse()
    )
    assert shown == next(item for item in listed.algorithms if item.name == "rooms")
    done = command_line("plugins", "show", "rooms", *where)
    lines = [line.split("\t") for line in done.stdout.splitlines()]
    assert lines[:2] == [["kind", "segmenter"], ["name", "rooms"]]
    sources = ["occupancy_grid", "map_server_map", "stroke_set", "polygon_set", "image"]
    assert ["reads", *sources] in lines
    assert next(line for line in lines if line[:2] == ["parameter", "door_width"]) == [
        *("parameter", "door_width", "number | null", "null", "> 0, ≤ 10000", "m"),
        "Widest passage that is a doorway; by default half the width of a robot's map's typical "
        "room, but at most 2.1 m, and in a drawing half the width of the wider part that it joins. "
        "For drawings, metres here mean the drawing's own unit.",
    ]


@pytest.mark.slow
def test_plugins_show_is_readable_on_a_terminal():
    terminal = Terminal("plugins", "show", "exact")
    assert terminal.end()[0] == 0
    for text in (
        f"exact, a searcher of sketchmatch {sketchmatch.__version__}",
        "as those of direct do",
        "[3] P. Hahn, T. Grant",
        "integer | null",
        "2 … 360",
    ):
        assert text in terminal.shown


@pytest.fixture
def strangers(tmp_path):
    """Return the environment of processes in which others' plugins are installed."""
    install(
        tmp_path,
        "acme-plugins",
        "from sketchmatch.api import Similarity, hookimpl\n"
        "class Mine(Similarity):\n"
        "    name, summary = 'exact', 'A [b]name[/b] of another kind.'\n"
        "    def compare(self, aligned, argument): ...\n"
        "@hookimpl\n"
        "def sketchmatch_register_similarities(): return [Mine]\n",
    )
    install(tmp_path, "broken-plugins", "raise OSError('no licence')")
    return {**os.environ, "PYTHONPATH": str(tmp_path)}


def install(folder, distribution, code):
    """Write what pip would leave of a plugin of one module."""
    module = distribution.replace("-", "_")
    (folder / f"{module}.py").write_text(code)
    about = folder / f"{module}-1.2.dist-info"
    about.mkdir()
    about.joinpath("METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {distribution}\nVersion: 1.2\n"
    )
    about.joinpath("entry_points.txt").write_text(f"[sketchmatch]\nmine = {module}\n")


@pytest.mark.slow
def test_strokes_are_drawn_and_warned_about_alike_whoever_segments_them(tmp_path):
    """A stranger's segmenter that finds what ours finds leaves the same pictures and lines."""
    install(
        tmp_path,
        "acme-strokes",
        "from sketchmatch.api import Segmenter, hookimpl\n"
        "from sketchmatch.model import StrokeSet\n"
        "from sketchmatch_builtin.segmenters.strokes import StrokeSegmenter\n"
        "class Mine(Segmenter):\n"
        "    name, summary, sources = 'by-hand', 'As ours.', (StrokeSet,)\n"
        "    def segment(self, source): return StrokeSegmenter().segment(source)\n"
        "@hookimpl\n"
        "def sketchmatch_register_segmenters(): return [Mine]\n",
    )
    path = os.pathsep.join(filter(None, (str(tmp_path), os.environ.get("PYTHONPATH"))))
    square = [(0, 0), (9, 0), (9, 9), (0, 9), (0, 0)]
    strokes = [{"points": [[k * (x + 30), k * (y + 10 * k)] for x, y in square]} for k in (1, 2, 3)]
    strokes.append({"points": [[0, 60], [20, 50], [50, 70]], "label": "route"})
    strokes.append({"points": [[60, 0], [70, 5], [90, 5]]})
    sketch = tmp_path / "sketch.json"
    sketch.write_text(json.dumps({"y_axis": "up", "strokes": strokes}))
    for command, option, picture in (
        (("segment", sketch), "--segmenter", "--overlay"),
        (("describe", sketch), "--segmenter", "--plot"),
        (("match", sketch, sketch), "--segmenter-sketch", "--overlay"),
    ):
        answers = []
        for name in ("strokes", "by-hand"):
            target = tmp_path / f"{name}.png"
            asked = (*command, option, name, picture, target)
            done = run(*asked, env={**os.environ, "PYTHONPATH": path})
            assert done.returncode == 0, done.stderr
            answers.append((done.stdout, done.stderr, target.read_bytes()))
        assert answers[0] == answers[1]
        assert "left out" in answers[0][1]


@pytest.mark.slow
def test_plugins_list_says_what_became_of_each_plugin(strangers):
    algorithms, _, plugins, readers = tables(run("plugins", "list", env=strangers))
    assert ["dxf", ".dxf"] in [line[:2] for line in readers]
    origins = {(line[1], line[3]) for line in algorithms}
    assert {("exact", "acme-plugins"), ("exact", "sketchmatch")} <= origins
    states = {line[0]: line[1:] for line in plugins}
    assert states["acme-plugins"] == ["1.2", "active", ""]
    assert states["broken-plugins"][:2] == ["1.2", "failed"]
    assert "no licence" in states["broken-plugins"][2]


@pytest.mark.slow
def test_the_configuration_shows_in_the_lists(strangers, tmp_path):
    file = tmp_path / "sketchmatch.toml"
    file.write_text(
        "[pipeline.searcher]\nname = 'easm'\nparameters = { population = 77 }\n"
        "[plugins]\ndeny = ['acme-plugins']\n"
    )
    algorithms, _, plugins, _ = tables(run("plugins", "list", "--config", file, env=strangers))
    assert {line[1] for line in algorithms if line[:3:2] == ["searcher", "true"]} == {"easm"}
    assert "acme-plugins" not in {line[3] for line in algorithms}
    states = {line[0]: line[2:] for line in plugins}
    assert states["acme-plugins"] == ["disabled", "the configuration denies it (plugins.deny)"]
    shown = run("plugins", "show", "easm", "--config", file, env=strangers).stdout
    assert "parameter\tpopulation\tinteger | null\t77\t" in shown


@pytest.mark.slow
def test_a_name_in_two_kinds_needs_the_kind(strangers):
    done = run("plugins", "show", "exact", env=strangers)
    assert_one_line(done, ExitCode.INVALID_INPUT, "'exact'", "searcher and a similarity", "--kind")
    done = run("plugins", "show", "exact", "--kind", "similarity", env=strangers)
    assert "A [b]name[/b] of another kind." in done.stdout


@pytest.mark.slow
def test_plugins_reference_writes_the_page_of_any_distribution(strangers):
    page = run("plugins", "reference", "--distribution", "acme-plugins", env=strangers).stdout
    assert page.startswith("# Algorithms of acme-plugins\n")
    assert "### `exact`" in page
    assert "Branch and bound" not in page


# serve ------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_serve_takes_its_limits_from_options():
    limits = ("--max-request-mib", "2", "--max-matches", "3", "--max-time-budget", "1.5")
    default = ("--default-time-budget", "1.25")
    with processes.server(*limits, *default) as running, Client(running.address) as client:
        said = client.server_info().limits
        accepted = next(client.events(scene(3), scene(3)))
    assert accepted.accepted.time_budget.ToTimedelta().total_seconds() == 1.25
    assert said.max_request_bytes == 2 * 1024**2
    assert said.max_concurrent_matches == 3
    assert said.max_time_budget.ToTimedelta().total_seconds() == 1.5


@pytest.mark.parametrize(
    ("option", "value"),
    [("--max-request-mib", 0), ("--max-matches", 0), ("--max-time-budget", -1), ("--grace", -1)],
)
def test_serve_refuses_limits_that_let_nothing_pass(command_line, option, value):
    assert_one_line(command_line("serve", option, value), 2, option)


@pytest.mark.slow
@pytest.mark.parametrize("address", ["nowhere.invalid:1", "256.0.0.1:1"])
def test_serve_refuses_an_address_that_is_none(address):
    done = run("serve", "--insecure", "--address", address)
    assert_one_line(done, 2, "cannot be listened on")


# What is typed wrong, and what goes wrong -------------------------------------------------------


def assert_one_line(done, code, *words):
    assert done.stdout == ""
    assert done.returncode == code, done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith("sketchmatch: ")
    assert all(word in line for word in words), line


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["mach"], ["mach", "--help"]),
        (["match"], ["SKETCH", "--help"]),
        (["match", LIVING_ROOM_SKETCH], ["MAP", "--help"]),
        (["match", *ROOM, "--sed", "1"], ["--sed", "--help"]),
        (["match", *ROOM, "--seed", "one"], ["--seed", "valid integer", "--help"]),
        (["match", *ROOM, "--seed", "-1"], ["seed is -1", "give an integer 0"]),
        (["match", *ROOM, "--seed", str(2**64)], ["seed", "2**64"]),
        (["match", *ROOM, "--weights", "1,2"], ["--weights '1,2'", "as in 1,1,1"]),
        (["match", *ROOM, "--weights", "1,1,1,1"], ["--weights '1,1,1,1'", "1,1,1,0.5,0.5"]),
        (["match", *ROOM, "--set", "population=3"], ["--set", "as in searcher.population=400"]),
        (["match", *ROOM, "--set", "sercher.population=3"], ["sercher", "searcher"]),
        (["match", *ROOM, "--time-budget", "nan"], ["time_budget", "give a positive time"]),
        (["match", *ROOM, "--overlay", "x.txt"], ["x.txt", ".png"]),
        (["match", "missing.svg", LIVING_ROOM_MAP], ["missing.svg does not exist", "check"]),
        (["match", "", LIVING_ROOM_MAP], ["SKETCH", "it is empty; give the path of a file"]),
        (["segment", LIVING_ROOM_MAP, "--out", ""], ["--out", "it is empty"]),
        (["match", LIVING_ROOM_SKETCH, "."], [". is a folder without a map", "give the .yaml"]),
        (["segment", __file__], ["is of an unknown kind", ".yaml"]),
        (["plugins", "lits"], ["lits", "--help"]),
        (["plugins", "list", "--kind", "serch"], ["--kind", "'serch'", "searcher"]),
        (["plugins", "show", "eams"], ["'eams' is not an algorithm", "easm"]),
        (["plugins", "show", "zzz"], ["'zzz' is not an algorithm", "choose one of", "easm"]),
        (["plugins", "show", "easm", "--kind", "histogram"], ["'easm' is not a histogram"]),
        (["plugins", "reference", "--distribution", "zzz"], ["'zzz'", "sketchmatch"]),
        (["plugins", "list", "--config", "x.toml", "--server", "localhost:1"], ["--config"]),
    ],
    ids=lambda value: " ".join(str(part) for part in value[:4])[-40:],
)
def test_what_is_typed_wrong_gets_exit_code_2_and_one_line_with_the_remedy(
    command_line, arguments, words
):
    assert_one_line(command_line(*arguments), ExitCode.INVALID_INPUT, *words)


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments", [["match", *ROOM], ["segment", LIVING_ROOM_MAP], ["plugins", "list"]]
)
def test_a_server_that_is_not_there_is_exit_code_3(command_line, arguments):
    done = command_line(*arguments, "--server", "127.0.0.1:9")
    assert_one_line(done, ExitCode.SERVER_UNAVAILABLE, "127.0.0.1:9", "start it, or check")


@pytest.mark.slow
def test_a_busy_server_is_exit_code_3_as_well(command_line):
    with processes.server("--max-matches", "1", "--max-waiting", "0") as running:
        other = Terminal("match", *ROOM, *LONG, "--server", running.address)
        other.wait_for("searching")
        done = command_line("match", *ROOM, "--server", running.address)
        other.process.send_signal(signal.SIGINT)
        assert other.end()[0] == ExitCode.INTERRUPTED
    assert_one_line(done, ExitCode.SERVER_UNAVAILABLE, "send the request again in 1 s")


def test_no_answer_in_time_is_exit_code_4(command_line, where):
    done = command_line("match", *ROOM, *where, "--time-budget", "1e-6")
    assert_one_line(done, ExitCode.NO_ANSWER_IN_TIME, "allow more time")


def test_what_nobody_foresaw_is_exit_code_1_and_still_one_line(command_line, monkeypatch):
    def failing(*_):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(Application, "answers", failing)
    monkeypatch.delenv("SKETCHMATCH_DEBUG", raising=False)
    done = command_line("match", *ROOM)
    assert_one_line(done, ExitCode.UNFORESEEN, "division by zero", "SKETCHMATCH_DEBUG=1")
    monkeypatch.setenv("SKETCHMATCH_DEBUG", "1")
    assert "Traceback" in command_line("match", *ROOM).stderr


def test_the_end_of_a_file_does_not_look_like_ctrl_c(command_line, monkeypatch):
    def failing(*_):
        raise EOFError("Ran out of input")

    monkeypatch.setattr(Application, "answers", failing)
    done = command_line("match", *ROOM)
    assert done.returncode == ExitCode.UNFORESEEN
    assert "(EOFError: Ran out of input)" in done.stderr
    assert "interrupted" not in done.stderr


@pytest.mark.slow
def test_ctrl_c_ends_a_long_match_soon_and_quietly(where):
    terminal = Terminal("match", *ROOM, *where, *LONG)
    terminal.wait_for("searching")
    with within(3.0):
        terminal.process.send_signal(signal.SIGINT)
        code, _ = terminal.end()
    assert code == ExitCode.INTERRUPTED == 130
    assert "Traceback" not in terminal.shown
    assert terminal.shown.rstrip().endswith("sketchmatch: interrupted")


@pytest.mark.slow
@pytest.mark.parametrize("command", [["match", *ROOM], ["plugins", "list", "--json"]])
def test_a_reader_who_has_had_enough_is_no_error(command, where):
    line = shlex.join([*processes.COMMAND, *map(str, command), *where])
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; ({line}; echo $? >&2) | true"],
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    assert done.stderr.split() == ["0"]


def test_help_and_version(command_line):
    assert command_line("--version").stdout == f"sketchmatch {sketchmatch.__version__}\n"
    for arguments in ([], ["--help"], ["-h"]):
        done = command_line(*arguments)
        assert (done.returncode, done.stderr) == (0, "")
        assert all(word in done.stdout for word in ("match", "segment", "serve", "demo", "plugins"))
    assert "--time-budget" in command_line("match", "--help").stdout


@pytest.mark.slow
def test_the_installed_program_is_the_same_as_the_module():
    program = Path(sys.executable).with_name("sketchmatch")
    done = subprocess.run([program, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == run("--version").stdout
