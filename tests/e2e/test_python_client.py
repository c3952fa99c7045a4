"""The Python client's README, block by block, against a real server."""

import re
import shutil
import subprocess
import sys

import PIL.Image
import PIL.ImageDraw
import pytest

from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH
from tests.tools import ROOT

README = (ROOT / "clients" / "python" / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^(?:```|~~~)python\n(.*?)^(?:```|~~~)", README, re.S | re.M)
GIVEN = """\
from sketchmatch_client import Client, sources

client = Client("localhost:50051")
room = sources.map_server_map("room.yaml")
"""
"""What the text says of a block that begins in the middle."""
SAID = (
    "8 of 8 sketched objects matched",
    "  in the sketch ",
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
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert SAID[number] in done.stdout
