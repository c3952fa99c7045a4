"""What commands write, and where: on wide and narrow terminals, in pipes, in any encoding."""

import json
import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import PIL.Image
import pytest
from google.protobuf.json_format import Parse

from sketchmatch.cli.app import ExitCode
from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH
from sketchmatch_proto.v1.match_pb2 import MatchResult
from tests import processes
from tests.processes import Terminal
from tests.processes import sketchmatch as run

pytestmark = pytest.mark.slow

ROOM = (LIVING_ROOM_SKETCH, LIVING_ROOM_MAP)
ENDLESS = (
    *("--searcher", "easm", "--time-budget", "60"),
    *("--set", "searcher.patience=10000000", "--set", "searcher.generations=10000000"),
)
LABELS = ["sideboard", "round table", "plant", "armchair", "piano", "bookshelf", "sofa"]
ESCAPE = "\x1b"
NOISY = """
import ctypes, os
print("noise at import")
from sketchmatch.api import Similarity, hookimpl

class Noisy(Similarity):
    '''Noise.'''
    name, summary = "noisy", "Prints."
    def compare(self, aligned, argument):
        print("noise by Python")
        os.write(1, b"noise by the system\\n")
        ctypes.CDLL(None).puts(b"noise by C")
        return 1.0 - 0.5 * abs(aligned - argument).mean(axis=1).clip(0.0, 2.0)
@hookimpl
def sketchmatch_register_similarities(): return [Noisy]
"""


def slow(*values):
    """Return a case that is left out where time is short: another protects the same code."""
    return pytest.param(*values, marks=pytest.mark.slow)


@pytest.fixture(params=["in process", "server"])
def where(request):
    if request.param == "in process":
        return []
    return ["--server", request.getfixturevalue("address")]


def lines_of(terminal) -> list[str]:
    """Return the lines of an answer on a terminal, without what was shown while it was sought."""
    shown = terminal.shown.replace("\r\n", "\n")
    begin = re.search(r"\d+ (of|objects|relations|comparisons)\b[^\n]*\n", shown)
    return [line.rstrip() for line in shown[begin.start() :].splitlines()]


# Terminals --------------------------------------------------------------------------------------


def test_at_80_columns_each_object_has_one_line_with_its_relation():
    terminal = Terminal("match", *ROOM, columns=80)
    assert terminal.end()[0] == ExitCode.OK
    lines = lines_of(terminal)
    assert all(len(line) <= 80 for line in lines)
    assert lines[0] == "8 of 8 sketched objects matched"
    assert re.split(r"\s{2,}", lines[1]) == [
        *("in the sketch", "on the map", "likely", "position in the sketch")
    ]
    rows = [re.split(r"\s{2,}", line) for line in lines[3:11]]
    assert (rows[0][:2], rows[0][3:]) == (
        ["1 sideboard", "7"],
        ["to the right of and below round table"],
    )
    assert all(re.fullmatch(r"(> )?9\d\.\d %", row[2]) for row in rows)
    assert [row[0] for row in rows[:7]] == [f"{k} {name}" for k, name in enumerate(LABELS, 1)]


def test_figures_are_words_and_what_is_not_certain_is_not_100_percent():
    terminal = Terminal("match", *ROOM, columns=100)
    terminal.end()
    text = "\n".join(lines_of(terminal))
    assert re.search(r"Probability (> )?9\d(\.\d)? %  This place (> )?9\d(\.\d)? %", text)
    assert "Rotation 116° clockwise  Scale 0.0105 m per sketch unit" in text
    next_best = r"Next best, (< )?0\.\d %, ζ 0\.\d{3}: on the map "
    assert re.search(next_best + r"[a-z ]+ (has no partner|is No\. \d)", text)
    assert "100 %" not in text
    assert "100%" not in text


@pytest.mark.parametrize(
    ("arguments", "whole"),
    [
        (["match", *ROOM], ["1 sideboard", "  on the map: 7, likely: "]),
        slow(["segment", LIVING_ROOM_SKETCH], ["1 sideboard", "vertices: 15, area: 10535.8"]),
        slow(["describe", LIVING_ROOM_SKETCH, "--pair", "1,3"], ["is: to the right of and below"]),
        slow(["relate", *ROOM, "--limit", "1"], ["3 plant, 8 coffee table", "  on the map: 4, 8"]),
        slow(["plugins", "list", "--kind", "similarity"], ["overlap", "  kind: similarity"]),
        (["plugins", "show", "exact"], ["cell_angle", "  type: number, default: 24"]),
    ],
    ids=lambda value: " ".join(map(str, value[:2])),
)
def test_at_60_columns_tables_are_lists_in_which_nothing_is_cut(arguments, whole):
    terminal = Terminal(*arguments, columns=60)
    assert terminal.end()[0] == ExitCode.OK
    shown = terminal.shown.replace("\r\n", "\n")
    answer = shown[shown.index(whole[0]) :]
    assert all(part in answer for part in whole), shown
    assert not set("─━┃│") & set(answer)
    # Summaries have ellipses of their own, with blanks about them or before a comma.
    assert not re.search(r"\w…", answer)
    assert all(len(line.rstrip()) <= 60 for line in answer.splitlines())


def test_ctrl_c_shows_the_best_map_so_far(where):
    terminal = Terminal("match", *ROOM, *where, *ENDLESS, columns=80)
    terminal.wait_for("best so far: 1→7")
    terminal.process.send_signal(signal.SIGINT)
    assert terminal.end()[0] == ExitCode.INTERRUPTED
    last = terminal.shown[terminal.shown.index("The best map so far, after ") :]
    assert re.match(r"The best map so far, after \d+\.\d s, with ζ 0\.\d{3}", last)
    assert re.search(r"^1 sideboard +7 +0\.\d{3}", last, re.M)
    assert last.count("\n") == 12
    assert last.rstrip().endswith("sketchmatch: interrupted")


def test_ctrl_c_leaves_a_pipe_empty():
    terminal = Terminal("match", *ROOM, *ENDLESS, stdout=False)
    terminal.wait_for("best so far")
    terminal.process.send_signal(signal.SIGINT)
    assert terminal.end() == (ExitCode.INTERRUPTED, "")
    assert "The best map so far" in terminal.shown


# Pipes ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", ["match", slow("segment"), slow("describe")])
def test_a_reader_who_has_had_enough_does_not_cost_the_files(command, tmp_path):
    picture = tmp_path / "picture.png"
    files = [str(path) for path in (ROOM if command == "match" else ROOM[:1])]
    option = "--plot" if command == "describe" else "--overlay"
    read, written = os.pipe()
    os.close(read)
    done = subprocess.run(
        [*processes.COMMAND, command, *files, option, str(picture)],
        stdout=written,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
        timeout=200,
    )
    os.close(written)
    notes = [line for line in done.stderr.splitlines() if " draws the 16 of 28" not in line]
    assert (done.returncode, notes) == (ExitCode.OK, [])
    with PIL.Image.open(picture) as image:
        assert image.width >= 1000


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no full device")
@pytest.mark.parametrize(
    "arguments",
    [["match", *ROOM], ["--help"], slow(["plugins", "list", "--json"]), slow(["config", "show"])],
)
def test_an_answer_that_cannot_be_written_is_one_sentence_and_an_exit_code(arguments):
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [*processes.COMMAND, *map(str, arguments)],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            timeout=200,
        )
    assert done.returncode == ExitCode.INVALID_INPUT
    assert done.stderr == (
        "sketchmatch: standard output cannot be written (no space left on device); free some "
        "space there, or send the answer elsewhere\n"
    )


@pytest.mark.skipif(os.name != "posix", reason="of shells that can close a file")
@pytest.mark.parametrize(
    ("arguments", "told"),
    [(["--version"], True), slow(["segment", ROOM[0]], True), slow(["-h"], False)],
)
def test_an_answer_that_nobody_could_read_is_one_sentence_and_an_exit_code(arguments, told):
    command = shlex.join([*processes.COMMAND, *map(str, arguments)])
    done = subprocess.run(
        ["sh", "-c", f"{command} >&-" if told else f"{command} >&- 2>&-"],
        stderr=subprocess.PIPE,
        text=True,
        check=False,
        timeout=200,
    )
    assert done.returncode == ExitCode.INVALID_INPUT
    assert done.stderr == told * (
        "sketchmatch: standard output is closed; send the answer to a file, or to /dev/null\n"
    )


@pytest.fixture
def noisy(tmp_path):
    """Return the environment of processes in which a plugin prints whatever it does."""
    (tmp_path / "noisy.py").write_text(NOISY)
    about = tmp_path / "noisy-1.0.dist-info"
    about.mkdir()
    about.joinpath("METADATA").write_text("Metadata-Version: 2.1\nName: noisy\nVersion: 1.0\n")
    about.joinpath("entry_points.txt").write_text("[sketchmatch]\nnoisy = noisy\n")
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    return {**os.environ, "PYTHONPATH": path}


def test_what_plugins_print_goes_to_standard_error(noisy):
    done = run("match", *ROOM, "--json", "--similarity", "noisy", env=noisy)
    assert done.returncode == ExitCode.OK, done.stderr
    assert len(Parse(done.stdout, MatchResult()).object_matches) == 8
    for source in ("at import", "by Python", "by the system", "by C"):
        assert f"noise {source}\n" in done.stderr
    listed = run("plugins", "list", "--json", env=noisy)
    assert "noisy" in {item["name"] for item in json.loads(listed.stdout)["algorithms"]}
    assert listed.stderr == "noise at import\n"


# Encodings --------------------------------------------------------------------------------------

STRANGE = ["Küche → Bad", "椅子", "sofa 🛋", "\x1b[2J\x1b[31mred\tand\nlow", "\u202edesk\x9b1m"]


@pytest.fixture
def strange(tmp_path):
    """Return a sketch whose labels no encoding but UTF-8 has, or that terminals would obey."""
    shapes = [
        {
            "type": "Feature",
            "properties": {"name": name},
            "geometry": {
                "type": "Polygon",
                "coordinates": [[[5 * k, k * k], [5 * k + 2, k * k], [5 * k, k * k + 1 + k]]],
            },
        }
        for k, name in enumerate(STRANGE)
    ]
    path = tmp_path / "strange.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": shapes}))
    return path


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "latin-1", "utf-8"])
@pytest.mark.parametrize(
    "arguments",
    [("match", 2), ("segment", 1), ("describe", 1), ("relate", 2)],
    ids=lambda value: value[0],
)
def test_no_character_stops_a_command_and_none_is_obeyed(
    command_line, strange, monkeypatch, encoding, arguments
):
    command, count = arguments
    monkeypatch.setattr(sys, "stdout", _encoded(sys.stdout, encoding))
    monkeypatch.setattr(sys, "stderr", _encoded(sys.stderr, encoding))
    for form in ([], ["--json"]):
        done = command_line(command, *[strange] * count, *form)
        assert (done.returncode, done.stderr) == (ExitCode.OK, "")
        assert not set("\x1b\x9b\u202e") & set(done.stdout)
        if form:
            said = json.dumps(json.loads(done.stdout), ensure_ascii=False)
            assert all(name in said for name in STRANGE[:3]), "JSON loses nothing"
        else:
            assert done.stdout.count("\t") % (done.stdout.count("\n")) == 0
            assert len({line.count("\t") for line in done.stdout.splitlines()}) == 1


def _encoded(stream, encoding):
    return open(stream.fileno(), "w", encoding=encoding, closefd=False)


@pytest.mark.parametrize("encoding", ["ascii", slow("cp1252")])
def test_a_terminal_of_another_encoding_shows_tables_and_errors(encoding):
    terminal = Terminal("match", *ROOM, columns=100, PYTHONIOENCODING=encoding)
    assert terminal.end()[0] == ExitCode.OK
    assert "1 sideboard" in terminal.shown
    assert "zeta 0.956: similarity" in terminal.shown
    missing = Terminal("match", "Küche→.svg", LIVING_ROOM_MAP, PYTHONIOENCODING=encoding)
    assert missing.end()[0] == ExitCode.INVALID_INPUT
    assert "->.svg does not exist; check the path" in missing.shown


@pytest.mark.parametrize(
    "arguments",
    [
        ["match", "--help"],
        ["plugins", "list"],
        slow(["plugins", "show", "exact"]),
        slow(["plugins", "reference"]),
        slow(["config", "show"]),
        slow(["config", "show", "--json"]),
    ],
    ids=" ".join,
)
def test_ascii_is_enough_for_every_command(arguments):
    done = run(*arguments, env={**os.environ, "PYTHONIOENCODING": "ascii"})
    assert (done.returncode, done.stderr) == (ExitCode.OK, "")
    assert done.stdout.isascii()


def test_an_error_that_quotes_a_file_is_one_line_that_no_terminal_obeys(command_line, tmp_path):
    done = command_line("segment", tmp_path / "\x1b[31mred\nmap.svg")
    assert done.returncode == ExitCode.INVALID_INPUT
    (line,) = done.stderr.splitlines()
    assert r"\x1b[31mred map.svg does not exist" in line


# Notes ------------------------------------------------------------------------------------------


@pytest.fixture
def plan(tmp_path):
    """Return a drawing of two objects and 208 lines that enclose nothing."""
    lines = "".join(
        f'<line x1="{400 + k % 20 * 40}" y1="{400 + k // 20 * 40}" '
        f'x2="{420 + k % 20 * 40}" y2="{401 + k // 20 * 40}" stroke="black"/>'
        for k in range(208)
    )
    boxes = '<rect x="10" y="10" width="60" height="50"/><rect x="99" y="99" width="9" height="7"/>'
    path = tmp_path / "plan.svg"
    path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg">{boxes}{lines}</svg>')
    return path


def test_of_208_notes_one_is_told_and_how_many_more_there_are(command_line, plan):
    said = command_line("segment", plan).stderr.splitlines()
    assert len(said) == 2
    assert "was left out: its ends are" in said[0]
    assert said[0].endswith(" (and 207 more like it)")
    assert said[1] == "sketchmatch: -v shows all 208 notes"
    assert len(command_line("segment", plan, "-v").stderr.splitlines()) == 208
    assert len(json.loads(command_line("segment", plan, "--json").stdout)["warnings"]) == 208
    both = command_line("match", plan, plan, "--json", "--verbose").stderr.splitlines()
    assert sum(line.startswith("sketchmatch: map: ") for line in both) == 208


# Addresses --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("address", "listening", "asked"),
    [
        ("127.0.0.1", "have a port, as in 127.0.0.1:50051", "add the port, as in"),
        ("50061", "begin with a host, as in 127.0.0.1:50061", "add the host, as in"),
        ("", "have a port, as in 127.0.0.1:50051", "give host and port, as in"),
        ("::1", "have brackets around an IPv6 address, as in [::1]:50051", "give host and port"),
        ("http://robot:50051", "be HOST:PORT and not a URL", "give host and port alone"),
        ("robot:http", "end with a port from", "give host and port"),
        ("robot:65536", "end with a port from", "give a port from"),
        (":50051", "begin with a host", "give host and port"),
        ("unix:", "name a file", "name a file"),
    ],
)
def test_an_address_that_grpc_would_complete_by_guessing_is_refused(
    command_line, address, listening, asked
):
    for command, words in (
        (["serve", "--address"], f"it should {listening}"),
        (["plugins", "list", "--server"], asked),
    ):
        done = command_line(*command, address)
        assert (done.returncode, done.stdout) == (ExitCode.INVALID_INPUT, "")
        assert done.stderr.startswith(f"sketchmatch: {command[-1]} is {address!r}; {words}")


def test_a_server_listens_at_a_file_that_no_second_one_takes(command_line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    address = "unix:s.sock"
    running = processes.Server("--address", address)
    try:
        assert running.wait_for(r"listening on (\S+)") == address
        running.wait_for("serving$")
        done = command_line("match", *ROOM, "--server", address)
        assert done.stdout.startswith("sketch_object\t"), done.stderr
        second = run("serve", "--address", address)
        assert second.returncode == ExitCode.INVALID_INPUT
        assert "name a file that no server uses" in second.stderr
        assert command_line("plugins", "list", "--server", address).returncode == ExitCode.OK
    finally:
        running.process.terminate()
        running.end()
