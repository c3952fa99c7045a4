"""The Python client's README, block by block, against a real server."""

import os
import shutil
import subprocess
import sys
import tomllib

import PIL.Image
import PIL.ImageDraw
import pytest

from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH
from tests.environment import environment, said_by
from tests.pages import Page
from tests.tools import ROOT

CLIENT = ROOT / "clients" / "python"
PAGE = Page("clients/python/README.md", __name__)
INSTALL = PAGE.take_one("sh", "pip install")
BLOCKS = [block.text for block in PAGE.take("python")]
GIVEN = """\
from sketchmatch_client import Client, sources

client = Client("localhost:50051")
room = sources.map_server_map("room.yaml")
"""
"""What the text says of a block that begins in the middle."""
SAID = (
    "8 of 8 sketched objects matched",
    "  in the sketch ",
    "the bed 0? 4 of 4 sketched objects matched",
    "object_matches {",
    "3 of 3 sketched objects matched",
    "[map_object: ",
    "patrol [",
    "",
)
"""What each block prints, among other things."""


def test_a_first_answer_takes_five_lines():
    _, lines = BLOCKS[0].split("\n\n")
    assert len(lines.splitlines()) == 5


@pytest.fixture
def here(tmp_path):
    """Return a folder with the files that the README names."""
    shutil.copy(LIVING_ROOM_SKETCH, tmp_path / "sketch.svg")
    shutil.copy(LIVING_ROOM_MAP, tmp_path / "room.yaml")
    shutil.copy(LIVING_ROOM_MAP.with_suffix(".pgm"), tmp_path)
    paper = PIL.Image.new("L", (400, 400), 255)
    pen = PIL.ImageDraw.Draw(paper)
    for box in ((30, 40, 180, 120), (250, 60, 340, 160), (60, 250, 160, 350)):
        pen.rectangle(box, outline=0, width=4)
    paper.save(tmp_path / "sketch.png")
    (tmp_path / "ca.pem").write_text("-----BEGIN CERTIFICATE-----\n", encoding="utf-8")
    (tmp_path / "robot-7.token").write_text("robot-7.secret\n", encoding="utf-8")
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_every_block_runs(address, here, number):
    code = BLOCKS[number]
    if "import " not in code:
        code = GIVEN + code
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code.replace("localhost:50051", address)],
        cwd=here,
        input="1\n",
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert SAID[number] in done.stdout


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    """Return the client as it is published, by the ending of the file."""
    folder = tmp_path_factory.mktemp("published")
    programs = environment(folder / "tools", "hatchling")
    said_by(programs / "python", "-m", "hatchling", "build", "--directory", folder, cwd=CLIENT)
    return {file.suffix: file for file in folder.iterdir() if file.is_file()}


@pytest.mark.slow
@pytest.mark.parametrize("source", ["as the page says", ".whl", ".gz"])
def test_what_is_installed_gives_a_first_answer(published, source, address, here):
    programs = environment(here / "environment")
    said_by(
        *(
            "bash",
            "-ec",
            f"pip install {published[source]}" if source in published else INSTALL.text,
        ),
        cwd=ROOT,
        PATH=f"{programs}{os.pathsep}{os.environ['PATH']}",
        PIP_CONSTRAINT=str(ROOT / "constraints.txt"),
    )
    where = "import sketchmatch_client, sys\nprint(sketchmatch_client.__file__)\n"
    light = "print({'numpy', 'numba', 'cv2'} & sys.modules.keys())\n"
    code = where + BLOCKS[0].replace("localhost:50051", address) + light
    first, *said, heavy = said_by(programs / "python", "-W", "error", "-c", code, cwd=here)
    assert first.startswith(str(here))
    assert SAID[0] in said[0]
    assert heavy == "set()"


def test_the_source_distribution_holds_every_package_of_the_wheel():
    project = tomllib.loads((CLIENT / "pyproject.toml").read_text(encoding="utf-8"))
    targets = project["tool"]["hatch"]["build"]["targets"]
    assert set(targets["wheel"]["packages"]) < set(targets["sdist"]["include"])
