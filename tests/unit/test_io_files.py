"""The door for every kind of file."""

import subprocess
import sys

import pytest

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io import read_source


def refused(path):
    with pytest.raises(InvalidInputError) as caught:
        read_source(path)
    return caught.value


def test_a_missing_file_is_named(tmp_path):
    error = refused(tmp_path / "none.svg")
    assert str(error) == f"{tmp_path / 'none.svg'} does not exist; check the path"
    assert error.reason == Reason.INVALID_FILE


def test_a_directory_is_named(tmp_path):
    (tmp_path / "maps.yaml").mkdir()
    error = refused(tmp_path / "maps.yaml")
    remedy = "is a folder without a map; give the .yaml that map_server saved"
    assert str(error) == f"{tmp_path / 'maps.yaml'} {remedy}"


@pytest.mark.parametrize("name", ["sketch.dwg", "sketch", ".svg"])
def test_an_unknown_kind_lists_the_known_ones(tmp_path, name):
    (tmp_path / name).write_text("?")
    error = refused(tmp_path / name)
    assert error.reason == Reason.INVALID_FILE
    assert "is of no known kind; give a file that ends in one of .bag .bmp" in error.problem


def test_a_path_that_the_system_refuses_is_named():
    assert "cannot be read (file name too long)" in refused("x" * 5000 + ".svg").problem


@pytest.mark.parametrize("name", ["/dev/zero", "/dev/null"])
def test_a_device_is_not_read(tmp_path, name):
    (tmp_path / "endless.png").symlink_to(name)
    assert "is no plain file" in refused(tmp_path / "endless.png").problem


def test_a_path_with_a_null_is_named():
    assert "; " in refused("a\0b.svg").problem


def test_contents_at_fault_are_named_after_the_path(tmp_path):
    path = tmp_path / "sketch.json"
    path.write_text('{"strokes": [{"points": [[0, 0], [1, null]]}]}')
    expected = f"{path}: strokes[0].points[1][1] is missing; give a finite number"
    assert str(refused(path)) == expected


def test_slow_libraries_wait_until_a_file_needs_them():
    script = (
        "import sys, sketchmatch.io; print([name for name in"
        " ('cv2', 'PIL', 'svgelements', 'yaml', 'grpc') if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"
