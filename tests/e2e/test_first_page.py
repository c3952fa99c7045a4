"""The first page, the guide and where all clients begin, by command and by program."""

import json
import re
import shlex
import shutil
import subprocess
import sys
import urllib.request

import pytest

from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH
from tests.certificates import Authority
from tests.pages import Page
from tests.processes import free_port
from tests.tools import ROOT, require
from tests.web import serving_pad

# An environment is made, and kernels are compiled in it.
pytestmark = [pytest.mark.slow, pytest.mark.timeout(1200)]

PAGE, GUIDE = Page("README.md", __name__), Page("engine/GUIDE.md", __name__)
DEMO = PAGE.take_one("console", "$ make demo")
PAD = PAGE.take_one("console", "$ sketchmatch serve --web ")
BEGINNING = PAGE.take_one("console", "$ sketchmatch plugins list")
COMMANDS = GUIDE.take_one("console", "$ sketchmatch plugins list")
CARRYING = GUIDE.take_one("console", "$ sketchmatch transfer sketch.svg office.yaml goals.geojson")
SCENES = GUIDE.take_one("console", "$ sketchmatch scenes put")
TOKENS = GUIDE.take_one("console", "$ sketchmatch tokens add")
MATCH = PAGE.take_one("python", "import Scene, match")
RESULT = GUIDE.take_one("python", "import Scene, match")
TRANSFER = GUIDE.take_one("python", "import Feature, carry")
RELATION = GUIDE.take_one("python", "directional_relation(")
CLIENT = PAGE.take_one("python", "sources.strokes(strokes")
IN_PROGRESS = GUIDE.take_one("python", "client.sketch(")
BEGIN = Page("clients/README.md", __name__).take_one("console", "$ sketchmatch serve")
FIRST = Page("clients/python/README.md", __name__).take("python")[0]
TUTORIAL = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")

GIVEN = """\
from sketchmatch_client import Client, sources

desk = [[0, 0], [2, 0], [2, 1], [0, 1]]
shelf = [[0, 3], [1, 3], [1, 6], [0, 6]]
plant = [[4, 4], [5, 4], [4.5, 5]]
strokes = [
    [(10, 10), (60, 10), (60, 40), (10, 40), (10, 11)],
    [(100, 80), (120, 80), (110, 95), (101, 81)],
    [(20, 90), (50, 90), (50, 130), (20, 130), (21, 91)],
]
"""
"""What the programs of the page speak of."""


def feature(kind, coordinates, **properties):
    return {
        "type": "Feature",
        "properties": properties,
        "geometry": {"type": kind, "coordinates": coordinates},
    }


def lay(folder):
    """Put the files that the page speaks of into a folder."""
    drawn = LIVING_ROOM_SKETCH.read_text(encoding="utf-8").replace("sofa", "desk")
    (folder / "sketch.svg").write_text(drawn, encoding="utf-8")
    for name in ("office", "old", "new"):
        shutil.copy(LIVING_ROOM_MAP, folder / f"{name}.yaml")
    shutil.copy(LIVING_ROOM_MAP.with_suffix(".pgm"), folder)
    boxes = ((0, 0, 4, 2), (10, 1, 3, 3), (2, 8, 2, 5))
    strokes = [
        {"points": [[x, y], [x + w, y], [x + w, y + h], [x, y + h], [x, y + 0.1]]}
        for x, y, w, h in boxes
    ]
    files = {
        "sketch.json": {"y_axis": "down", "strokes": strokes},
        "drawn.geojson": feature("LineString", [[150, -150], [250, -150]], name="patrol"),
        "goals.geojson": feature("Point", [1.0, -1.0], name="dock"),
        "zones.geojson": feature("Polygon", [[[0, 0], [1, 0], [1, 1], [0, 0]]], name="no-go"),
    }
    for name, content in files.items():
        (folder / name).write_text(json.dumps(content), encoding="utf-8")


@pytest.fixture(scope="module")
def among_files(clean_shell):
    """Yield a shell where `sketchmatch` is installed, among the files that the page speaks of."""
    require(shutil.which("jq"), "jq")
    folder = clean_shell.folder / "first page"
    folder.mkdir()
    lay(folder)
    clean_shell.run(f"pushd {shlex.quote(str(folder))}")
    yield clean_shell
    clean_shell.run("pip uninstall --quiet --yes sketchmatch-tabu; popd")


@pytest.fixture
def reader(among_files):
    """Yield that shell, and end the servers that a test starts in it."""
    yield among_files
    among_files.run("kill $(jobs -p) || true; wait")


def follow(shell, commands, places=()):
    """Run commands, with other addresses, and return what each says.

    A server stays in the background.
    """
    text, said = "\n".join(commands), []
    for shown, place in dict(places).items():
        text = text.replace(shown, place)
    for command in text.splitlines():
        if command.startswith("sketchmatch serve"):
            shell.run(f"{command} &")
            health = f"sketchmatch health localhost:{re.search(r':([0-9]+)', command)[1]}"
            if "--tls" in command:
                health += " --root-certificates ca.pem"
            shell.run(f"until {health} 2>/dev/null; do sleep 0.2; done")
            said.append([])
        else:
            said.append(shell.run(command))
    return said


def rows(said):
    """Return the lines that tell of objects; notes and what servers log are among the others."""
    return [line.split("\t") for line in said if re.match(r"\d+\t", line)]


def test_the_demo_runs_in_a_fresh_checkout(clean_shell):
    (demo,) = DEMO.commands
    said = clean_shell.run(f"cd sketchmatch && {demo} && cd ..", seconds=600)
    assert len(rows(said)) == 8
    assert (clean_shell.folder / "sketchmatch" / "demo-overlay.png").exists()


def test_whoever_begins_with_a_client_has_an_answer(clean_shell):
    _, install, *lay_files, serve = BEGIN.commands
    assert f"\n$ {install}\n" in TUTORIAL  # as the shell's environment was made
    place = f"localhost:{free_port()}"
    follow(clean_shell, [*lay_files, f"{serve} --address {place}"])
    program = FIRST.text.replace("localhost:50051", place)
    said = clean_shell.run(f"python -W error -c {shlex.quote(program)}")
    clean_shell.run("kill $!; wait $!")
    # What the server logs may come in between.
    assert any(line.startswith("8 of 8 sketched objects matched") for line in said)


def test_the_sketch_pad_is_served():
    (command,) = PAD.commands
    _, _, *options = command.split()
    with (
        serving_pad(*options) as (_, address),
        urllib.request.urlopen(address) as answer,
    ):
        assert "<title>" in answer.read().decode()


@pytest.mark.parametrize(("block", "files"), [(BEGINNING, 4), (COMMANDS, 8)])
def test_every_command_does_something_good(reader, block, files):
    folder = reader.folder / "first page"
    written = set(re.findall(r"--(?:overlay|out|plot|keepout) (\S+)", block.text))
    assert len(written) == files
    for name in written:
        (folder / name).unlink(missing_ok=True)
    said = follow(reader, block.commands, {"50051": str(free_port())})
    assert len(rows(said[0])) == 8
    assert {name for name in written if not (folder / name).exists()} == set()
    pinned = next(k for k, each in enumerate(block.commands) if "--pin" in each)
    assert ["6", "2"] in [row[:2] for row in rows(said[pinned])]


def test_routes_and_zones_are_carried(reader):
    folder = reader.folder / "first page"
    if not (folder / "mask.yaml").exists():
        (keepout,) = [each for each in COMMANDS.commands if "--keepout" in each]
        reader.run(keepout)
    follow(reader, CARRYING.commands)
    for name in ("carried.png", "new.geojson", "way.yaml", "new_mask.yaml"):
        assert (folder / name).exists()


def hash_in(said):
    (found,) = [line for line in said if re.fullmatch(r"[0-9a-f]{64}", line)]
    return found


def test_scenes_stay(reader):
    put, label, match = SCENES.commands
    place = f"127.0.0.1:{free_port()}"
    follow(reader, [f"sketchmatch serve --address {place}"])
    name = hash_in(reader.run(f"{put} --server {place}"))
    labelled = hash_in(reader.run(f"{label.replace('be890d', name[:6])} --server {place}"))
    said = reader.run(match.replace("b0d541", labelled[:6]).replace("127.0.0.1:50051", place))
    assert len(rows(said)) == 8
    assert len(re.findall(r"^[0-9a-f]{64}$", SCENES.text, re.M)) == 2  # as long as these


def test_who_has_a_token_may_call(reader):
    folder = reader.folder / "first page"
    authority = Authority(folder, "ca")
    own = authority.issue("localhost")
    own.certificate.rename(folder / "server.pem")
    own.key.rename(folder / "server.key")
    port = free_port()
    places = {"robots.example": "localhost", "50051": str(port)}
    *_, answer = follow(reader, TOKENS.commands, places)
    assert len(rows(answer)) == 8


def printed(folder, *programs):
    """Run programs of the page as one, and return what it prints."""
    code = GIVEN + "".join(programs)
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=200,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_programs_in_python_run(tmp_path):
    lay(tmp_path)
    assert " sketched objects matched" in printed(tmp_path, MATCH.text)
    said = printed(tmp_path, RESULT.text, RELATION.text, "print(relation)\n")
    assert " sketched objects matched" in said
    assert " of " in said.splitlines()[-1]
    said = printed(tmp_path, TRANSFER.text, "print(len(driven.carried), len(moved.carried))\n")
    assert said.splitlines()[-1] == "1 1"


@pytest.mark.parametrize(
    ("program", "last"), [(CLIENT, " sketched objects matched"), (IN_PROGRESS, "result 2")]
)
def test_the_programs_that_ask_a_server_run(program, last, address, tmp_path):
    lay(tmp_path)
    assert last in printed(tmp_path, program.text.replace("localhost:50051", address))
